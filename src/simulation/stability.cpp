// SPDX-License-Identifier: MIT
#include "simulation/stability.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <set>

#include "energy/elastic/point.hpp"
#include "sizes.hpp"

namespace itr {

namespace {

/// Thickness by diagonal, below which bodies buckle at strains below some 0.2.
template <int Dim>
constexpr double kSlender = Dim == 2 ? 0.25 : 0.12;
constexpr double kCompressed = 1e-9;  ///< stress by modulus
constexpr double kNegligible = 0.02;  ///< of the largest part of the way that straight edges cannot follow

/// Whether the body of a cell may buckle, as far as its stress tells.
template <int Dim>
bool is_compressed(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, CellId c, const VectorX& x) {
  const Material& material = setup.materials.at(mesh.body(c));
  const auto element = element_of(mesh, c);
  const Mat<Dim> F = deformation_gradient<Dim>(element, x);
  const Mat<Dim> stress = elastic_stress<Dim>(F, elastic_moduli<Dim>(material, mesh.rest(mesh.cell(c)[0]))) * F.transpose();
  const Eigen::SelfAdjointEigenSolver<Mat<Dim>> principal(Mat<Dim>((stress + stress.transpose()) / 2),
                                                          Eigen::EigenvaluesOnly);
  return principal.eigenvalues()[0] < -kCompressed * material.youngs_modulus;
}

template <int Dim>
bool may_buckle(const StepSetup<Dim>& setup, const State<Dim>& state, const VectorX& x) {
  std::set<int> slender;
  for (const auto& [body, size] : body_sizes(state.mesh))
    if (size.thickness < kSlender<Dim> * size.diagonal) slender.insert(body);
  for (CellId c = 0; !slender.empty() && c < state.mesh.cell_slots(); ++c)
    if (slender.contains(state.mesh.body(c)) && is_compressed(setup, state.mesh, c, x)) return true;
  return false;
}

/// A field over the nodes of a space and obstacles in the space with all edges curved.
template <int Dim>
VectorX in_space(const Mesh<Dim>& mesh, const Space& space, const Space& curved, const VectorX& field) {
  if (field.size() == 0) return field;
  const int vertices = Dim * mesh.vertex_slots(), nodes = Dim * num_nodes(mesh, space);
  const auto at = [&](int node) { return field.segment<Dim>(Dim * node); };
  VectorX result(field.size() + Dim * (curved.num_curved() - space.num_curved()));
  result.head(vertices) = field.head(vertices);
  for (int i = 0; i < curved.num_curved(); ++i) {
    const auto [a, b] = curved.curved_edges()[i];
    const int node = space.node_of(a, b, mesh.vertex_slots());
    result.segment<Dim>(vertices + Dim * i) = node == kNone ? Vec<Dim>((at(a) + at(b)) / 2) : Vec<Dim>(at(node));
  }
  result.tail(field.size() - nodes) = field.tail(field.size() - nodes);
  return result;
}

}  // namespace

template <int Dim>
std::vector<EdgeKey> find_edges_that_lock(const StepTools<Dim>& tools, const State<Dim>& state, const VectorX& x) {
  if (!may_buckle(tools.setup, state, x)) return {};
  const Mesh<Dim>& mesh = state.mesh;
  const Space curved(mesh.edges());
  if (curved == state.space) return {};
  History history = state.history;
  for (auto* fields : {&history.x, &history.v, &history.a})
    for (VectorX& field : *fields) field = in_space(mesh, state.space, curved, field);
  const linear::FactorRecord record = tools.solver.record();
  ProblemCache<Dim> cache(tools.solver);
  VectorX way;
  {
    StepProblem<Dim> problem(tools.setup, mesh, curved, history, state.t, cache, state.stiffness);
    way = problem.find_instability(in_space(mesh, state.space, curved, x));
  }
  tools.solver.restore(record);
  ++tools.cache.served;  // the solver has analysed another system since
  if (way.size() == 0) return {};
  std::vector<double> parts;
  for (int i = 0; i < curved.num_curved(); ++i) {
    const auto [a, b] = curved.curved_edges()[i];
    const auto at = [&](int node) { return way.segment<Dim>(Dim * node); };
    const bool is_straight = state.space.find(a, b) == kNone;
    parts.push_back(is_straight ? (at(mesh.vertex_slots() + i) - (at(a) + at(b)) / 2).norm() : 0);
  }
  const double largest = *std::max_element(parts.begin(), parts.end());
  std::vector<EdgeKey> found;
  for (int i = 0; i < curved.num_curved(); ++i)
    if (parts[i] > kNegligible * largest) found.push_back(curved.curved_edges()[i]);
  return found;
}

template std::vector<EdgeKey> find_edges_that_lock(const StepTools<2>&, const State<2>&, const VectorX&);
template std::vector<EdgeKey> find_edges_that_lock(const StepTools<3>&, const State<3>&, const VectorX&);

}  // namespace itr
