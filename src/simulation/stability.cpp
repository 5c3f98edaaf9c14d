// SPDX-License-Identifier: MIT
#include "simulation/stability.hpp"
#include "energy/rigid_body.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <set>

#include "energy/elastic/point.hpp"
#include "geometry/bvh.hpp"
#include "geometry/predicates.hpp"
#include "mesh/cell_of_facet.hpp"
#include "mesh/facet_measure.hpp"
#include "sizes.hpp"

namespace itr {

namespace {

constexpr double kSlender = 0.25;  ///< thickness by diagonal, below which bodies buckle at strains below some 0.2
constexpr double kLayers = 4;      ///< of elements through the thickness, from which linear ones hardly keep up what buckles
constexpr double kStart = 1e-3;    ///< of a way through a body, where it begins
constexpr double kCompressed = 1e-9;  ///< stress by modulus
constexpr double kNegligible = 0.02;  ///< of the largest part of the way that straight edges cannot follow

/// Whether the body of a cell may buckle, as far as its stress tells.
template <int Dim>
bool is_compressed(const Material& material, const Mesh<Dim>& mesh, CellId c, const VectorX& x) {
  if (rigid_body_of(material)) return false;
  const auto element = element_of(mesh, c);
  const Mat<Dim> F = deformation_gradient<Dim>(element, x);
  const Mat<Dim> stress = elastic_stress<Dim>(F, elastic_moduli<Dim>(material, mesh.rest(mesh.cell(c)[0]))) * F.transpose();
  const Eigen::SelfAdjointEigenSolver<Mat<Dim>> principal(Mat<Dim>((stress + stress.transpose()) / 2),
                                                          Eigen::EigenvaluesOnly);
  return principal.eigenvalues()[0] < -kCompressed * material.youngs_modulus;
}

/// The inner side of a boundary facet.
template <int Dim>
struct Inside {
  int body = 0;
  Vec<Dim> center, inward;  ///< at rest; a unit vector
};

template <int Dim>
Inside<Dim> inside_of(const Mesh<Dim>& mesh, FacetId f) {
  const auto& facet = mesh.facet(f);
  Inside<Dim> inside{0, Vec<Dim>::Zero(), Vec<Dim>::Zero()};
  for (const int v : facet) inside.center += mesh.rest(v) / Dim;
  const CellId c = cell_of_facet(mesh, f);
  const auto& cell = mesh.cell(c);
  const auto apex = std::ranges::find_if(cell, [&](VertexId v) { return !holds(facet, v); });
  // The gradient of the apex' barycentric coordinate is normal to the facet.
  inside.body = mesh.body(c);
  inside.inward = barycentric_gradients<Dim>(mesh.inverse_rest_edges(c)).col(apex - cell.begin()).normalized();
  return inside;
}

bool meets(const Mesh<2>& mesh, FacetId f, const Vec<2>& p, const Vec<2>& q) {
  const auto& facet = mesh.facet(f);
  return segments_intersect(p, q, mesh.rest(facet[0]), mesh.rest(facet[1]));
}
bool meets(const Mesh<3>& mesh, FacetId f, const Vec<3>& p, const Vec<3>& q) {
  const auto& facet = mesh.facet(f);
  return segment_intersects_triangle(p, q, mesh.rest(facet[0]), mesh.rest(facet[1]), mesh.rest(facet[2]));
}

/// Mean length of a facet's edges at rest, as if it were regular [m].
template <int Dim>
double edge_length(const Mesh<Dim>& mesh, FacetId f) {
  const double measure = facet_measure(mesh, f);
  return Dim == 2 ? measure : std::sqrt(measure * 4 / std::sqrt(3.0));
}

/// Bodies with a part that is thin against the body and has few elements through its thickness, by straight ways from facets
/// through the body.
template <int Dim>
std::set<int> slender_bodies(const Mesh<Dim>& mesh) {
  const std::map<int, BodySize> sizes = body_sizes(mesh);
  std::vector<Box<Dim>> boxes(mesh.facet_slots());
  for (FacetId f = 0; f < mesh.facet_slots(); ++f)
    for (const int v : mesh.facet(f)) boxes[f].include(mesh.rest(v));
  const Bvh<Dim> tree(boxes);
  std::set<int> slender;
  std::vector<int> hits;
  for (FacetId f = 0; f < mesh.facet_slots() && slender.size() < sizes.size(); ++f) {
    const Inside<Dim> inside = inside_of(mesh, f);
    if (slender.contains(inside.body)) continue;
    const double length = std::min(kSlender * sizes.at(inside.body).diagonal, kLayers * edge_length(mesh, f));
    const Vec<Dim> p = inside.center + kStart * length * inside.inward, q = inside.center + length * inside.inward;
    Box<Dim> direction;
    direction.include(p);
    direction.include(q);
    hits.clear();
    tree.query(direction, hits);
    if (std::any_of(hits.begin(), hits.end(), [&](FacetId other) { return other != f && meets(mesh, other, p, q); }))
      slender.insert(inside.body);
  }
  return slender;
}

template <int Dim>
bool may_buckle(const StepSetup<Dim>& setup, const State<Dim>& state, const VectorX& x) {
  const std::set<int> slender = slender_bodies(state.mesh);
  const std::map<int, Material> materials = materials_at(setup, state.t);
  for (CellId c = 0; !slender.empty() && c < state.mesh.cell_slots(); ++c) {
    const int body = state.mesh.body(c);
    if (slender.contains(body) && is_compressed(materials.at(body), state.mesh, c, x)) return true;
  }
  return false;
}

/// A field over the nodes of a mesh and obstacles on the same one with all edges curved.
template <int Dim>
VectorX on_curved(const Mesh<Dim>& mesh, const Mesh<Dim>& curved, const VectorX& field) {
  if (field.size() == 0) return field;
  const int vertices = Dim * mesh.num_vertices(), nodes = Dim * mesh.num_nodes();
  const auto at = [&](int node) { return field.segment<Dim>(Dim * node); };
  VectorX result(field.size() + Dim * (curved.num_curved() - mesh.num_curved()));
  result.head(vertices) = field.head(vertices);
  for (VertexId i = curved.num_vertices(); i < curved.node_slots(); ++i) {
    const auto [a, b] = curved.edge_of_node(i);
    const int node = mesh.node_of(a, b);
    result.segment<Dim>(Dim * i) = node == kNone ? Vec<Dim>((at(a) + at(b)) / 2) : Vec<Dim>(at(node));
  }
  result.tail(field.size() - nodes) = field.tail(field.size() - nodes);
  return result;
}

}  // namespace

template <int Dim>
std::vector<EdgeKey> find_edges_that_lock(const StepTools<Dim>& tools, const State<Dim>& state, const VectorX& x) {
  if (!may_buckle(tools.setup, state, x)) return {};
  const Mesh<Dim>& mesh = state.mesh;
  const std::vector<EdgeKey> edges = mesh.edges();
  if (std::ssize(edges) == mesh.num_curved()) return {};
  Mesh<Dim> curved = mesh;
  curved.set_curved_edges(edges);
  History history = state.history;
  for (auto* fields : {&history.x, &history.v, &history.a})
    for (VectorX& field : *fields) field = on_curved(mesh, curved, field);
  ChordLevels chords(state.chords.empty() ? 0 : curved.num_curved(), 0);
  for (std::size_t i = 0; i < state.chords.size(); ++i) {
    const EdgeKey edge = mesh.edge_of_node(mesh.num_vertices() + static_cast<int>(i));
    chords[curved.node_of(edge) - curved.num_vertices()] = state.chords[i];
  }
  const linear::FactorRecord record = tools.solver.record();
  ProblemCache<Dim> cache(tools.solver);
  VectorX direction;
  {
    StepProblem<Dim> problem(tools.setup, curved, history, state.t, cache, state.stiffness, {}, chords);
    direction = problem.find_instability(on_curved(mesh, curved, x));
  }
  tools.solver.restore(record);
  ++tools.cache.served;  // the solver has analysed another system since
  if (direction.size() == 0) return {};
  std::vector<double> parts;
  for (const EdgeKey& edge : edges) {
    const auto [a, b] = edge;
    const auto at = [&](int node) { return direction.segment<Dim>(Dim * node); };
    const bool is_straight = mesh.node_of(edge) == kNone;
    parts.push_back(is_straight ? (at(curved.node_of(edge)) - (at(a) + at(b)) / 2).norm() : 0);
  }
  const double largest = *std::max_element(parts.begin(), parts.end());
  std::vector<EdgeKey> found;
  for (std::size_t i = 0; i < edges.size(); ++i)
    if (parts[i] > kNegligible * largest) found.push_back(edges[i]);
  return found;
}

template std::vector<EdgeKey> find_edges_that_lock(const StepTools<2>&, const State<2>&, const VectorX&);
template std::vector<EdgeKey> find_edges_that_lock(const StepTools<3>&, const State<3>&, const VectorX&);

}  // namespace itr
