// SPDX-License-Identifier: MIT
// The energy of cells with curved edges, with each vertex and node moving by itself.
#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <vector>

#include "energy/elastic/jacobian_barrier.hpp"
#include "energy/elastic/point.hpp"
#include "geometry/measures.hpp"
#include "itr/fem/mass.hpp"
#include "local_problem.hpp"
#include "remesh/curved_cell.hpp"
#include "remesh/edits.hpp"

namespace itr {

/// One side of an edit that replaces cells with curved edges: as it is, and with each vertex and node moving by itself.
template <int Dim>
class NodalModels {
 public:
  struct Model {
    VertexId id;
    Vec<Dim> gradient = Vec<Dim>::Zero();
    Mat<Dim> hessian = Mat<Dim>::Zero();
  };
  NodalModels(const RemeshState<Dim>& state, const Edit<Dim>& edit) : state_(state), edit_(edit) {}

  /// A cell after the edit; `is_after`: its vertices and nodes may be of the edit.
  void add_cell(const typename MeshTypes<Dim>::Cell& vertices, int body, bool is_after) {
    const Edit<Dim> none{.kind = edit_.kind};
    const Edit<Dim>& edit = is_after ? edit_ : none;
    const auto cell =
        curved_cell<Dim>(vertices, [&](VertexId a, VertexId b) { return node_after(state_.mesh, edit, a, b); });
    std::array<Model*, kQuadraticNodes<Dim>> models{};
    for (int k = 0; k < kQuadraticNodes<Dim>; ++k)
      if (has_node<Dim>(cell.edges, k)) model(cell.nodes[k]);
    for (int k = 0; k < kQuadraticNodes<Dim>; ++k)  // all are there: none moves any more
      if (has_node<Dim>(cell.edges, k)) models[k] = &model(cell.nodes[k]);
    add(cell, body, edit, models);
  }
  /// A cell after the edit, of which nothing moves: its energy alone.
  void add_still_cell(const CurvedCell<Dim>& cell, int body) { add(cell, body, edit_, {}); }
  double energy() const { return energy_; }
  /// Whether a JacobianBarrier acts: the energy has it, gradients and Hessians do not.
  bool has_barrier() const { return has_barrier_; }
  const auto& models() const { return models_; }
  const Model* find(VertexId id) const {
    const auto it = std::find_if(models_.begin(), models_.end(), [&](const Model& model) { return model.id == id; });
    return it == models_.end() ? nullptr : &*it;
  }

 private:
  struct PlacedCell {
    CurvedEdges edges;
    std::array<Vec<Dim>, Dim + 1> rest;
    QuadraticCell<Dim> x;
    const Material& material;
    std::array<Model*, kQuadraticNodes<Dim>> models;  ///< null at straight edges, and of what does not move
    Vec<Dim> place(const std::array<double, Dim + 1>& l) const {
      Vec<Dim> X = Vec<Dim>::Zero();
      for (int k = 0; k <= Dim; ++k) X += l[k] * rest[k];
      return X;
    }
  };

  void add(const CurvedCell<Dim>& cell, int body, const Edit<Dim>& edit,
           const std::array<Model*, kQuadraticNodes<Dim>>& models) {
    const StepContext<Dim>& context = state_.context;
    PlacedCell placed{cell.edges, {}, cell.values(state_.fields.x, edit), context.materials.at(body), models};
    for (int k = 0; k <= Dim; ++k) placed.rest[k] = rest_after(state_.mesh, edit, cell.nodes[k]);
    add_elasticity(placed);
    if (!context.has_inertia && !context.loads.acceleration) return;
    QuadraticCell<Dim> way = placed.x;
    if (context.has_inertia) way -= cell.values(state_.fields.predictor, edit);
    add_mass_and_weight(placed, way);
  }

  Model& model(VertexId id) {
    const auto it = std::find_if(models_.begin(), models_.end(), [&](const Model& model) { return model.id == id; });
    if (it != models_.end()) return *it;
    models_.push_back({id});
    return models_.back();
  }

  void add_elasticity(const PlacedCell& cell) {
    const Mat<Dim> edges = edge_matrix<Dim>(cell.rest);
    const auto linear = barycentric_gradients<Dim>(edges.inverse());
    const double volume = simplex_volume<Dim>(edges);
    for (const auto& point : quadrature<Dim>(cell.edges ? state_.context.quadrature_degree : 1)) {
      const auto shapes = quadratic_gradients<Dim, Dim>(cell.edges, point.weights, linear);
      const ElasticModuli moduli = elastic_moduli<Dim>(cell.material, cell.place(point.weights));
      const Mat<Dim> F = cell.x * shapes.transpose();
      const ElasticPoint<Dim> response(F, moduli);
      const double weight = state_.context.scaling * volume * point.share;
      energy_ += weight * response.density();
      for (int k = 0; k < kQuadraticNodes<Dim>; ++k) {
        if (!cell.models[k]) continue;
        cell.models[k]->gradient += weight * response.gradient(shapes.col(k));
        cell.models[k]->hessian += weight * response.hessian(shapes.col(k));
      }
    }
    const JacobianBarrier<Dim> barrier(cell.edges, linear, cell.x);
    if (!barrier.is_active()) return;
    has_barrier_ = true;
    std::array<double, Dim + 1> barycenter;
    barycenter.fill(1.0 / (Dim + 1));
    energy_ += state_.context.scaling * volume *
               barrier_density<Dim>(barrier, elastic_moduli<Dim>(cell.material, cell.place(barycenter)));
  }

  /// `way`: from the predictor, where there is inertia.
  void add_mass_and_weight(const PlacedCell& cell, const QuadraticCell<Dim>& way) {
    const StepContext<Dim>& context = state_.context;
    const double volume = simplex_volume<Dim>(edge_matrix<Dim>(cell.rest));
    for (const auto& point : quadrature<Dim>(cell.edges ? kMassDegree : 2)) {
      const auto shapes = quadratic_shapes<Dim>(cell.edges, point.weights);
      const Vec<Dim> X = cell.place(point.weights);
      const double weight = point.share * mass_density<Dim>(cell.material, X) * volume;
      Vec<Dim> force = Vec<Dim>::Zero();
      if (context.has_inertia) {
        const Vec<Dim> here = way * shapes;
        force = weight * here;
        energy_ += 0.5 * force.dot(here);
      }
      if (context.loads.acceleration) {
        const Vec<Dim> load = context.scaling * weight * context.loads.acceleration(X);
        energy_ -= load.dot(cell.x * shapes - X);
        force -= load;
      }
      for (int k = 0; k < kQuadraticNodes<Dim>; ++k) {
        if (!cell.models[k]) continue;
        cell.models[k]->gradient += shapes[k] * force;
        if (context.has_inertia) cell.models[k]->hessian.diagonal().array() += weight * shapes[k] * shapes[k];
      }
    }
  }

  const RemeshState<Dim>& state_;
  const Edit<Dim>& edit_;
  double energy_ = 0;
  bool has_barrier_ = false;
  std::vector<Model> models_;
};

}  // namespace itr
