// SPDX-License-Identifier: MIT
// The energy of a step on the whole mesh with every term it can have, listed again for the tests of remeshing: without any
// patch, and with the history as a function on the body (design, section 3).
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <memory>
#include <stdexcept>
#include <vector>

#include "energy/contact/contact.hpp"
#include "energy/contact/friction.hpp"
#include "energy/damping.hpp"
#include "energy/elastic/elastic.hpp"
#include "energy/inertia.hpp"
#include "energy/load.hpp"
#include "energy/pressure.hpp"
#include "newton/newton.hpp"
#include "remesh/fields.hpp"

namespace itr {

inline std::array<Vec<2>, 3> rest_corners(const Mesh<2>& mesh, CellId c) {
  const auto& [i, j, k] = mesh.cell(c);
  return {mesh.rest(i), mesh.rest(j), mesh.rest(k)};
}

/// The function that a field is on a cell, at a rest position.
inline Vec<2> value_in(const Mesh<2>& mesh, const VectorX& field, CellId c, const Vec<2>& X) {
  const auto& [i, j, k] = mesh.cell(c);
  const Vec<2> w = mesh.inverse_rest_edges(c) * (X - mesh.rest(i));
  return (1 - w.sum()) * vertex_of<2>(field, i) + w[0] * vertex_of<2>(field, j) + w[1] * vertex_of<2>(field, k);
}

/// The cell that holds a rest position of a body: the one that it is deepest in.
inline CellId cell_at(const Mesh<2>& mesh, int body, const Vec<2>& X) {
  CellId best = kNone;
  double depth = -1e-9;
  for (int c = 0; c < mesh.cell_slots(); ++c) {
    if (!mesh.is_cell_alive(c) || mesh.body(c) != body) continue;
    const Vec<2> w = mesh.inverse_rest_edges(c) * (X - mesh.rest(mesh.cell(c)[0]));
    const double least = std::min({w[0], w[1], 1 - w.sum()});
    if (least > depth) depth = least, best = c;
  }
  if (best == kNone) throw std::logic_error("a rest position outside of the mesh");
  return best;
}

/// Common part of two triangles, as a convex polygon (Sutherland & Hodgman 1974).
inline std::vector<Vec<2>> overlap(const std::array<Vec<2>, 3>& a, const std::array<Vec<2>, 3>& b) {
  std::vector<Vec<2>> polygon(a.begin(), a.end());
  for (int k = 0; k < 3 && !polygon.empty(); ++k) {
    const Vec<2>&from = b[k], &to = b[(k + 1) % 3];
    const auto inside = [&](const Vec<2>& p) { return (to - from)[0] * (p - from)[1] - (to - from)[1] * (p - from)[0]; };
    std::vector<Vec<2>> kept;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const Vec<2>&p = polygon[i], &q = polygon[(i + 1) % polygon.size()];
      const double at_p = inside(p), at_q = inside(q);
      if (at_p >= 0) kept.push_back(p);
      if ((at_p > 0 && at_q < 0) || (at_p < 0 && at_q > 0)) kept.push_back(p + at_p / (at_p - at_q) * (q - p));
    }
    polygon = kept;
  }
  return polygon;
}

/// 1/2 the integral of rho |a - b|^2 for two fields on two meshes of one body, exact: both are linear on what a cell of one
/// and a cell of the other have in common.
inline double squared_distance(const Mesh<2>& mesh_a, const VectorX& a, const Mesh<2>& mesh_b, const VectorX& b,
                               const std::map<int, Material>& materials) {
  double sum = 0;
  for (int ca = 0; ca < mesh_a.cell_slots(); ++ca)
    for (int cb = 0; cb < mesh_b.cell_slots(); ++cb) {
      if (!mesh_a.is_cell_alive(ca) || !mesh_b.is_cell_alive(cb) || mesh_a.body(ca) != mesh_b.body(cb)) continue;
      const auto polygon = overlap(rest_corners(mesh_a, ca), rest_corners(mesh_b, cb));
      for (std::size_t i = 2; i < polygon.size(); ++i) {
        const Vec<2> corners[] = {polygon[0], polygon[i - 1], polygon[i]};
        const double area = 0.5 * (Mat<2>() << corners[1] - corners[0], corners[2] - corners[0]).finished().determinant();
        Vec<2> total = Vec<2>::Zero();
        double squares = 0;
        for (const Vec<2>& X : corners) {
          const Vec<2> difference = value_in(mesh_a, a, ca, X) - value_in(mesh_b, b, cb, X);
          total += difference;
          squares += difference.squaredNorm();
        }
        sum += materials.at(mesh_a.body(ca)).density * area / 24 * (squares + total.squaredNorm());
      }
    }
  return sum;
}

/// All terms but inertia on the vertex slots of a mesh and the obstacles after them, with what is lagged (friction, damping,
/// pressure without a potential) taken at `lagged_x`; inertia where the history is a field of this mesh.
class WholeMeshEnergy {
 public:
  WholeMeshEnergy(const Mesh<2>& mesh, const RemeshFields<2>& fields, const StepContext<2>& context, const VectorX& lagged_x)
      : bodies_(mesh.node_slots()), obstacles_(context.obstacles.x), newton_(context.newton) {
    set_cells(mesh, context);
    set_surface(context);
    hold(mesh, context);
    const VectorX lag = with_obstacles(lagged_x, context.obstacles.x);
    const VelocityRule velocity{context.velocity_rate,
                                with_obstacles(fields.velocity_reference, context.obstacles.velocity_reference)};
    const double scale = context.scaling;
    const auto elastic = std::make_shared<ElasticEnergy<2>>(cells_, context.materials, scale);
    const auto contact =
        std::make_shared<ContactEnergy<2>>(surface_, context.contact, context.contact.barrier_stiffness, scale);
    without_inertia_.add(elastic);
    without_inertia_.add(contact);
    without_inertia_.add(std::make_shared<LoadEnergy<2>>(cells_, context.materials, context.loads, scale));
    without_inertia_.add(std::make_shared<PressureEnergy<2>>(cells_, context.loads, lag, scale));
    for (const DampingOptions& damping : context.damping) {
      const Energy& damped = damping.term == DampingOptions::Term::elastic ? static_cast<const Energy&>(*elastic) : *contact;
      without_inertia_.add(std::make_shared<DampingEnergy<2>>(damped, lag, damping.coefficient, velocity, workspace_));
    }
    if (context.contact.friction_coefficient > 0)
      without_inertia_.add(std::make_shared<FrictionEnergy<2>>(*contact, lag, workspace_, context.contact, velocity, scale));
    inertia_ = std::make_shared<InertiaEnergy<2>>(cells_, context.materials, context.mass,
                                                  with_obstacles(fields.predictor, context.obstacles.x));
  }
  WholeMeshEnergy(const WholeMeshEnergy&) = delete;
  WholeMeshEnergy& operator=(const WholeMeshEnergy&) = delete;

  double without_inertia(const VectorX& x) { return without_inertia_.value(with_obstacles(x, obstacles_), workspace_); }
  double inertia(const VectorX& x) { return inertia_->value(with_obstacles(x, obstacles_), workspace_); }
  double value(const VectorX& x) { return without_inertia(x) + inertia(x); }
  /// Moves x to the minimum; whether that was reached.
  bool minimize(VectorX& x) {
    EnergySum sum = without_inertia_;
    sum.add(inertia_);
    VectorX all = with_obstacles(x, obstacles_);
    DenseSystem system;
    const bool converged = itr::minimize(sum, all, dofs_, VectorX(), system, newton_, workspace_).converged();
    x = all.head(2 * bodies_);
    return converged;
  }
  /// Whether component c of a vertex can move.
  bool is_free(int v, int c) const { return dofs_.unknown[2 * v + c] != kNone; }

 private:
  VectorX with_obstacles(const VectorX& field, const std::vector<Vec<2>>& values) const {
    VectorX all(2 * cells_.num_vertices);
    all.head(2 * bodies_) = field;
    for (std::size_t o = 0; o < values.size(); ++o) vertex_of<2>(all, bodies_ + static_cast<int>(o)) = values[o];
    return all;
  }

  void set_cells(const Mesh<2>& mesh, const StepContext<2>& context) {
    for (int v = 0; v < bodies_; ++v) cells_.rest.push_back(mesh.rest(v));
    cells_.rest.insert(cells_.rest.end(), context.obstacles.rest.begin(), context.obstacles.rest.end());
    cells_.num_vertices = static_cast<int>(cells_.rest.size());
    for (int c = 0; c < mesh.cell_slots(); ++c)
      if (mesh.is_cell_alive(c))
        cells_.elements.push_back({mesh.cell(c), mesh.body(c), mesh.volume(c), mesh.inverse_rest_edges(c)});
    for (int f = 0; f < mesh.facet_slots(); ++f)
      if (mesh.is_facet_alive(f)) cells_.facets.push_back({mesh.facet(f), mesh.facet_tag(f)});
  }

  void set_surface(const StepContext<2>& context) {
    std::vector<std::array<int, 2>> edges;
    std::vector<char> counts(cells_.num_vertices, 0);
    for (const auto& facet : cells_.facets) {
      edges.push_back(facet.vertices);
      for (const int v : facet.vertices) counts[v] = 1;
    }
    for (const auto& [a, b] : context.obstacles.edges) edges.push_back({bodies_ + a, bodies_ + b});
    surface_ = make_collision_surface<2>(edges, {}, {}, cells_.rest, counts);
  }

  void hold(const Mesh<2>& mesh, const StepContext<2>& context) {
    std::vector<char> held(2 * cells_.num_vertices, 1);
    for (int v = 0; v < bodies_; ++v)
      if (mesh.is_vertex_alive(v)) held[2 * v] = held[2 * v + 1] = 0;
    for (const auto& facet : cells_.facets)
      if (const auto it = context.held_components.find(facet.tag); it != context.held_components.end())
        for (const int v : facet.vertices)
          for (int c = 0; c < 2; ++c) held[2 * v + c] |= it->second[c];
    dofs_ = DofMap::from_held(held);
  }

  int bodies_;
  std::vector<Vec<2>> obstacles_;
  NewtonOptions newton_;
  CellSet<2> cells_;
  CollisionSurface surface_;
  DofMap dofs_;
  Workspace workspace_;
  EnergySum without_inertia_;
  std::shared_ptr<InertiaEnergy<2>> inertia_;
};

}  // namespace itr
