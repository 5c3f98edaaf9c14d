// SPDX-License-Identifier: MIT
// The energy of cells as a quadratic function of one vertex, or of the node of an edge: what predictions are made of.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "energy/elastic/point.hpp"
#include "energy/load_points.hpp"
#include "geometry/measures.hpp"
#include "itr/fem/mass.hpp"
#include "local_problem.hpp"
#include "remesh/curved_cell.hpp"

namespace itr {

/// Energy of cells, and what it does when one of their vertices moves.
template <int Dim>
class QuadraticModel {
 public:
  /// `part`: the connected part of all its cells.
  QuadraticModel(const StepContext<Dim>& context, int part) : context_(context), part_(part) {}

  struct Corners {
    std::array<Vec<Dim>, Dim + 1> rest, x, predictor;
  };
  /// Data of a cell that do not depend on which of its corners moves.
  struct CellAt {
    CellAt(const StepContext<Dim>& context, const Corners& corners, int body) : at(corners) {
      const Mat<Dim> edges = edge_matrix<Dim>(at.rest);
      inverse = edges.inverse();
      volume = simplex_volume<Dim>(edges);
      const Material& material = context.materials.at(body);
      Vec<Dim> center = Vec<Dim>::Zero();
      for (const auto& p : at.rest) center += p / (Dim + 1);
      moduli = elastic_moduli<Dim>(material, center);
      F = edge_matrix<Dim>(at.x) * inverse;
      mass = mass_density<Dim>(material, center) * volume;
    }
    const Corners& at;
    Mat<Dim> inverse, F;
    double volume, mass;
    ElasticModuli moduli;
  };
  void add_cell(const CellAt& cell) {
    energy_ += context_.scaling * cell.volume * elastic_density<Dim>(cell.F, cell.moduli);
    add_inertia_and_load(cell, kNone);
  }
  /// Adds a cell whose corner `moving` moves; the response is the cell's.
  void add_cell(const CellAt& cell, const ElasticPoint<Dim>& response, int moving) {
    const double s = context_.scaling, V = cell.volume;
    const Vec<Dim> gradient = barycentric_gradient<Dim>(cell.inverse, moving);
    energy_ += s * V * response.density();
    gradient_ += s * V * response.gradient(gradient);
    hessian_ += s * V * response.hessian(gradient);
    add_inertia_and_load(cell, moving);
  }
  /// `moving`: the corner that moves, or kNone.
  void add_cell(const Corners& at, int body, int moving) {
    const CellAt cell(context_, at, body);
    if (moving == kNone)
      add_cell(cell);
    else
      add_cell(cell, ElasticPoint<Dim>(cell.F, cell.moduli), moving);
  }

  /// Adds the split of a cell of constant moduli at the middle of its edge from corner `a` to `b`. Both halves deform and
  /// move as the whole did, so that without loads the energy stays, and the new vertex feels them at once.
  void add_split_cell(const Mesh<Dim>& mesh, CellId c, const Corners& at, int a, int b) {
    const Material& material = context_.materials.at(mesh.body(c));
    const ElasticModuli moduli = elastic_moduli<Dim>(material, at.rest[0]);
    const Mat<Dim>& inverse = mesh.inverse_rest_edges(c);
    const Mat<Dim> F = edge_matrix<Dim>(at.x) * inverse;
    const ElasticPoint<Dim> response(F, moduli);
    const Vec<Dim> ga = barycentric_gradient<Dim>(inverse, a), gb = barycentric_gradient<Dim>(inverse, b);
    const double sV = context_.scaling * mesh.volume(c), mass = material.density * mesh.volume(c);
    gradient_ += sV * response.gradient(ga + gb);
    hessian_ += 2 * sV * (response.hessian(ga) + response.hessian(gb));
    if (context_.has_inertia) {
      const ElementMass<Dim> matrix(context_.mass, mass);
      Vec<Dim> total = Vec<Dim>::Zero();
      for (int k = 0; k <= Dim; ++k) total += at.x[k] - at.predictor[k];
      gradient_ += matrix.product(total, Vec<Dim>((at.x[a] - at.predictor[a] + at.x[b] - at.predictor[b]) / 2));
      hessian_.diagonal().array() += matrix.diagonal();
    }
    if (!context_.loads.acceleration) return;
    add_load(at.rest, at.x, -context_.scaling * mass, context_.loads.acceleration, kNone);
    for (const int end : {a, b}) {
      auto rest = at.rest, x = at.x;
      rest[end] = (at.rest[a] + at.rest[b]) / 2;
      x[end] = (at.x[a] + at.x[b]) / 2;
      add_load(rest, x, context_.scaling * mass / 2, context_.loads.acceleration, end);
    }
  }

  /// Adds the bubble 4 l_a l_b of the edge from corner `a` to `b` in a cell of constant moduli. Its gradient is linear,
  /// 4 (l_a g_b + l_b g_a), and F constant: all integrals are exact but that of a load that varies.
  void add_curved_cell(const Mesh<Dim>& mesh, CellId c, const Corners& at, int a, int b) {
    const Material& material = context_.materials.at(mesh.body(c));
    const Mat<Dim>& inverse = mesh.inverse_rest_edges(c);
    const Mat<Dim> F = edge_matrix<Dim>(at.x) * inverse;
    const ElasticModuli moduli = elastic_moduli<Dim>(material, at.rest[0]);
    const ElasticPoint<Dim> response(F, moduli);
    const Vec<Dim> ga = barycentric_gradient<Dim>(inverse, a), gb = barycentric_gradient<Dim>(inverse, b);
    const double sV = context_.scaling * mesh.volume(c), mass = material.density * mesh.volume(c);
    constexpr double kFirst = 1.0 / (Dim + 1), kSecond = kFirst / (Dim + 2), kThird = kSecond / (Dim + 3),
                     kFourth = kThird / (Dim + 4);  // integrals of products of different coordinates, by the volume
    gradient_ += 4 * kFirst * sV * response.gradient(ga + gb);
    hessian_ += 16 * kSecond * sV * (response.hessian(ga) + response.hessian(gb) + response.hessian(ga + gb));
    if (context_.has_inertia) {
      Vec<Dim> total = at.x[a] - at.predictor[a] + at.x[b] - at.predictor[b];
      for (int k = 0; k <= Dim; ++k) total += at.x[k] - at.predictor[k];
      gradient_ += 4 * kThird * mass * total;
      hessian_.diagonal().array() += 16 * 4 * kFourth * mass;
    }
    if (context_.loads.acceleration)
      gradient_ -= context_.scaling * 4 * kSecond * mass *
                   context_.loads.acceleration(mesh.middle({mesh.cell(c)[a], mesh.cell(c)[b]}));
  }
  /// Adds a cell other edges of which are curved, by the rules of quadrature that energy and mass have.
  void add_mixed_cell(const RemeshState<Dim>& state, CellId c, const EdgeKey& edge) {
    const Mesh<Dim>& mesh = state.mesh;
    const auto cell = curved_cell<Dim>(mesh.cell(c), nodes_of_edges(mesh));
    const Material& material = context_.materials.at(mesh.body(c));
    const auto linear = barycentric_gradients<Dim>(mesh.inverse_rest_edges(c));
    const ElasticModuli moduli = elastic_moduli<Dim>(material, mesh.rest(mesh.cell(c)[0]));
    const auto place = [&](VertexId v) { return std::find(cell.nodes.begin(), cell.nodes.end(), v) - cell.nodes.begin(); };
    const auto a = place(edge[0]), b = place(edge[1]);
    const double sV = context_.scaling * mesh.volume(c), mass = material.density * mesh.volume(c);
    const auto x = at_nodes<Dim>(cell.nodes, state.fields.x);
    for (const auto& point : quadrature<Dim>(context_.quadrature_degree)) {
      const auto& l = point.weights;
      const Mat<Dim> F = x * quadratic_gradients<Dim, Dim>(cell.edges, l, linear).transpose();
      const ElasticPoint<Dim> response(F, moduli);
      const Vec<Dim> bubble = 4 * (l[a] * linear.col(b) + l[b] * linear.col(a));
      gradient_ += sV * point.share * response.gradient(bubble);
      hessian_ += sV * point.share * response.hessian(bubble);
    }
    const auto way = [&]() -> QuadraticCell<Dim> {
      if (!context_.has_inertia) return QuadraticCell<Dim>::Zero();
      return x - at_nodes<Dim>(cell.nodes, state.fields.predictor);
    }();
    for (const auto& point : quadrature<Dim>(kMassDegree)) {
      const double bubble = 4 * point.weights[a] * point.weights[b], weight = point.share * mass * bubble;
      if (context_.has_inertia) {
        gradient_ += weight * way * quadratic_shapes<Dim>(cell.edges, point.weights);
        hessian_.diagonal().array() += weight * bubble;
      }
      if (context_.loads.acceleration)
        gradient_ -= context_.scaling * weight * context_.loads.acceleration(mesh.middle(edge));
    }
  }
  /// Adds a facet at the edge.
  void add_curved_facet(const std::array<Vec<Dim>, Dim>& rest, const Vec<Dim>& middle, int tag) {
    constexpr double kSecond = 1.0 / (Dim * (Dim + 1));
    for (const auto& [loaded, traction] : context_.loads.tractions)
      if (loaded == tag)
        gradient_ -=
            context_.scaling * 4 * kSecond * facet_area(rest) * traction(RestPoint<Dim>(middle, inward_normal(rest), part_));
  }

  void add_facet(const std::array<Vec<Dim>, Dim>& rest, const std::array<Vec<Dim>, Dim>& x, int tag, int moving) {
    for (const auto& [loaded, traction] : context_.loads.tractions)
      if (loaded == tag) add_load(rest, x, context_.scaling * facet_area(rest), traction, moving);
  }

  double energy() const { return energy_; }
  const Vec<Dim>& gradient() const { return gradient_; }
  const Mat<Dim>& hessian() const { return hessian_; }
  /// Energy where the vertex finds its minimum; infinitely low where there is none.
  double relaxed() const {
    const Eigen::LLT<Mat<Dim>> llt(hessian_);
    if (llt.info() != Eigen::Success) return -std::numeric_limits<double>::infinity();
    return energy_ - 0.5 * gradient_.dot(llt.solve(gradient_));
  }
  /// Energy at the minimum over the components that no condition of these tags holds.
  double relaxed(const std::array<int, Dim>& tags) {
    for (int c = 0; c < Dim; ++c)
      if (tags[c] != kNoTag) {
        hessian_.row(c).setZero();
        hessian_.col(c).setZero();
        hessian_(c, c) = 1;
        gradient_[c] = 0;
      }
    return relaxed();
  }

 private:
  void add_inertia_and_load(const CellAt& cell, int moving) {
    if (context_.has_inertia) add_inertia(cell.at, cell.mass, moving);
    if (context_.loads.acceleration)
      add_load(cell.at.rest, cell.at.x, context_.scaling * cell.mass, context_.loads.acceleration, moving);
  }
  template <std::size_t N>
  void add_load(const std::array<Vec<Dim>, N>& rest, const std::array<Vec<Dim>, N>& x, double weight,
                const std::function<Vec<Dim>(const RestPoint<Dim>&)>& load, int moving) {
    using Point = LoadPoint<N>;
    std::array<Vec<Dim>, N> u;
    Vec<Dim> sum = Vec<Dim>::Zero();
    for (std::size_t k = 0; k < N; ++k) {
      u[k] = x[k] - rest[k];
      sum += u[k];
    }
    for_each_load_point<Dim>(rest, part_, weight, load, [&](std::size_t q, const Vec<Dim>& force) {
      energy_ -= force.dot(Point::at(q, u, sum));
      if (moving != kNone) gradient_ -= (static_cast<int>(q) == moving ? Point::kNear : Point::kFar) * force;
    });
  }

  void add_inertia(const Corners& at, double mass, int moving) {
    Vec<Dim> total = Vec<Dim>::Zero();
    double squares = 0;
    for (int k = 0; k <= Dim; ++k) {
      const Vec<Dim> d = at.x[k] - at.predictor[k];
      total += d;
      squares += d.squaredNorm();
    }
    const ElementMass<Dim> matrix(context_.mass, mass);
    energy_ += matrix.energy(total, squares);
    if (moving == kNone) return;
    gradient_ += matrix.product(total, Vec<Dim>(at.x[moving] - at.predictor[moving]));
    hessian_.diagonal().array() += matrix.diagonal();
  }

  const StepContext<Dim>& context_;
  int part_;
  double energy_ = 0;
  Vec<Dim> gradient_ = Vec<Dim>::Zero();
  Mat<Dim> hessian_ = Mat<Dim>::Zero();
};

/// Corners of a cell on vertices of the mesh.
template <int Dim>
typename QuadraticModel<Dim>::Corners corners_of(const RemeshState<Dim>& state, const typename MeshTypes<Dim>::Cell& cell) {
  typename QuadraticModel<Dim>::Corners corners;
  for (int k = 0; k <= Dim; ++k) {
    corners.rest[k] = state.mesh.rest(cell[k]);
    corners.x[k] = state.fields.x.template segment<Dim>(Dim * cell[k]);
    if (state.context.has_inertia) corners.predictor[k] = state.fields.predictor.template segment<Dim>(Dim * cell[k]);
  }
  return corners;
}

/// One side of an edit that sets no vertex: as it is, and with each of some vertices moving by itself.
template <int Dim>
class MovingModels {
 public:
  MovingModels(const RemeshState<Dim>& state, std::span<const VertexId> vertices)
      : state_(state),
        vertices_(vertices),
        still_(state.context, state.mesh.part_of_vertex(vertices[0])),
        moving_(vertices.size(), still_) {}
  void add_cell(const typename MeshTypes<Dim>::Cell& cell, int body) {
    const auto corners = corners_of(state_, cell);
    const typename QuadraticModel<Dim>::CellAt at(state_.context, corners, body);
    const ElasticPoint<Dim> response(at.F, at.moduli);
    still_.add_cell(at);
    for (int k = 0; k <= Dim; ++k) moving_[index(cell[k])].add_cell(at, response, k);
  }
  void add_facet(const typename MeshTypes<Dim>::Facet& facet, int tag) {
    std::array<Vec<Dim>, Dim> X, x;
    for (int k = 0; k < Dim; ++k) {
      X[k] = state_.mesh.rest(facet[k]);
      x[k] = state_.fields.x.template segment<Dim>(Dim * facet[k]);
    }
    still_.add_facet(X, x, tag, kNone);
    for (int k = 0; k < Dim; ++k) moving_[index(facet[k])].add_facet(X, x, tag, k);
  }
  double energy() const { return still_.energy(); }
  const QuadraticModel<Dim>& operator[](std::size_t i) const { return moving_[i]; }

 private:
  std::size_t index(VertexId v) const {
    return static_cast<std::size_t>(std::lower_bound(vertices_.begin(), vertices_.end(), v) - vertices_.begin());
  }
  const RemeshState<Dim>& state_;
  std::span<const VertexId> vertices_;
  QuadraticModel<Dim> still_;
  std::vector<QuadraticModel<Dim>> moving_;
};

}  // namespace itr
