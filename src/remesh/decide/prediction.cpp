// SPDX-License-Identifier: MIT
#include "prediction.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include <boost/container/small_vector.hpp>
#include "energy/elastic/jacobian_barrier.hpp"
#include "nodal_models.hpp"
#include "quadratic_model.hpp"
#include "remesh/edits.hpp"
#include "split_model.hpp"

namespace itr {

namespace {

constexpr double kUnknown = std::numeric_limits<double>::infinity();

/// The share of its model's gain that a vertex moved by the forces an edit adds gets: cells around, not in the model,
/// resist.
constexpr double kShareOfRelaxation = 0.25;

/// The vertex and nodes that the edit sets move under all forces on them, since all of their cells are here; the others
/// under the forces that the edit adds. Each moves by itself, which is an estimate of what they gain together. Forgotten
/// history is left out.
template <int Dim>
double predict_gain_at_curves(const RemeshState<Dim>& state, const Edit<Dim>& edit) {
  if (!state.context.loads.tractions.empty() && !edit.inserted_facets.empty()) return kUnknown;
  NodalModels<Dim> before(state, edit), after(state, edit);
  for (const CellId c : edit.removed_cells) before.add_cell(state.mesh.cell(c), state.mesh.body(c), false);
  for (const auto& cell : edit.inserted_cells) after.add_cell(cell.vertices, cell.body, true);
  if (!std::isfinite(after.energy()) || before.has_barrier()) return kUnknown;  // inverted there, or nearly so now
  double gain = before.energy() - after.energy();
  for (const auto& model : after.models()) {
    const bool is_set = (edit.value && model.id == edit.value->vertex) || model.id >= state.mesh.node_slots();
    const auto* old = is_set ? nullptr : before.find(model.id);
    const Vec<Dim> force = old ? Vec<Dim>(model.gradient - old->gradient) : model.gradient;
    const Eigen::LLT<Mat<Dim>> llt(model.hessian);
    if (llt.info() != Eigen::Success) return kUnknown;
    gain += (is_set ? 1 : kShareOfRelaxation) * 0.5 * force.dot(llt.solve(force));
  }
  return gain;
}

/// A swap sets no vertex. Each vertex moves by itself under the forces that the edit adds.
template <int Dim>
double predict_gain_of_swap(const RemeshState<Dim>& state, const Edit<Dim>& edit) {
  boost::container::small_vector<VertexId, 64> vertices;  // ascending
  for (const auto& cell : edit.inserted_cells) vertices.insert(vertices.end(), cell.vertices.begin(), cell.vertices.end());
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  const std::span<const VertexId> moving(vertices.data(), vertices.size());
  MovingModels<Dim> before(state, moving), after(state, moving);
  for (const CellId c : edit.removed_cells) before.add_cell(state.mesh.cell(c), state.mesh.body(c));
  for (const auto& cell : edit.inserted_cells) after.add_cell(cell.vertices, cell.body);
  if (!state.context.loads.tractions.empty()) {
    for (const FacetId f : edit.removed_facets) before.add_facet(state.mesh.facet(f), state.mesh.facet_tag(f));
    for (const auto& facet : edit.inserted_facets) after.add_facet(facet.vertices, facet.tag);
  }
  double gain = before.energy() - after.energy();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const Vec<Dim> force = after[i].gradient() - before[i].gradient();
    const Eigen::LLT<Mat<Dim>> llt(after[i].hessian());
    if (llt.info() != Eigen::Success) return kUnknown;
    gain += kShareOfRelaxation * 0.5 * force.dot(llt.solve(force));
  }
  return gain;
}

/// Share of the forgotten history that no relaxation regains (ball-wall 2D: a share of 1 refuses so many collapses that a
/// sixth more vertices stay).
constexpr double kLeastForgotten = 0.3;

}  // namespace

template <int Dim>
double least_forgotten(const RemeshState<Dim>& state, const Edit<Dim>& edit) {
  const auto after = [&](const VectorX& field, VertexId v) { return RemeshFields<Dim>::after(field, edit, v); };
  double forgotten = 0;
  for (const VertexId v : {edit.value->vertex, edit.removed_vertex}) {
    if (v == kNone || v == kNewVertex) continue;
    const Vec<Dim>& X = state.mesh.rest(v);
    double mass = 0;
    for (const CellId c : edit.removed_cells) {
      const auto& cell = state.mesh.cell(c);
      if (std::find(cell.begin(), cell.end(), v) != cell.end())
        mass += state.context.materials.at(state.mesh.body(c)).density * state.mesh.volume(c) / (Dim + 1);
    }
    // There in the new mesh.
    double deepest = -std::numeric_limits<double>::infinity();
    Vec<Dim> way = Vec<Dim>::Zero(), predictor = way;
    for (const auto& [cell, body] : edit.inserted_cells) {
      std::array<Vec<Dim>, Dim + 1> rest;
      for (int k = 0; k <= Dim; ++k) rest[k] = rest_after(state.mesh, edit, cell[k]);
      const Vec<Dim> weights = edge_matrix<Dim>(rest).inverse() * (X - rest[0]);
      const double depth = std::min(weights.minCoeff(), 1 - weights.sum());
      if (depth <= deepest) continue;
      deepest = depth;
      way = predictor = Vec<Dim>::Zero();
      for (int k = 0; k <= Dim; ++k) {
        const double weight = k == 0 ? 1 - weights.sum() : weights[k - 1];
        const Vec<Dim> x_hat = after(state.fields.predictor, cell[k]);
        predictor += weight * x_hat;
        way += weight * (after(state.fields.x, cell[k]) - x_hat);
      }
    }
    const Vec<Dim> gap = state.fields.predictor.template segment<Dim>(Dim * v) - predictor;
    forgotten += mass * (gap.squaredNorm() / (Dim + 2) - gap.dot(way));
  }
  return kLeastForgotten * forgotten;
}

template <int Dim>
double predict_gain(const RemeshState<Dim>& state, const Edit<Dim>& edit) {
  const StepContext<Dim>& context = state.context;
  if (!is_predictable(context)) return kUnknown;
  if (state.mesh.has_nodes()) {
    const auto is_curved = [&](CellId c) { return state.mesh.is_curved(c); };
    if (std::any_of(edit.removed_cells.begin(), edit.removed_cells.end(), is_curved))
      return predict_gain_at_curves(state, edit);
  }
  if (!edit.value) return predict_gain_of_swap(state, edit);
  const VertexId set = edit.value->vertex;
  const auto at = [&](const VectorX& field, VertexId v, bool after) {
    return after ? RemeshFields<Dim>::after(field, edit, v) : Vec<Dim>(field.segment<Dim>(Dim * v));
  };
  const auto rest = [&](VertexId v) { return rest_after(state.mesh, edit, v); };
  const int part = state.mesh.part(edit.removed_cells[0]);
  QuadraticModel<Dim> before(context, part), after(context, part);
  for (const CellId c : edit.removed_cells)
    before.add_cell(corners_of(state, state.mesh.cell(c)), state.mesh.body(c), kNone);
  for (const auto& cell : edit.inserted_cells) {
    typename QuadraticModel<Dim>::Corners corners;
    int moving = kNone;
    for (int k = 0; k <= Dim; ++k) {
      const VertexId v = cell.vertices[k];
      if (v == set) moving = k;
      corners.rest[k] = rest(v);
      corners.x[k] = at(state.fields.x, v, true);
      if (context.has_inertia) corners.predictor[k] = at(state.fields.predictor, v, true);
    }
    after.add_cell(corners, cell.body, moving);
  }
  if (!context.loads.tractions.empty()) {
    const auto add_facet = [&](const auto& facet, int tag, bool is_after, QuadraticModel<Dim>& model) {
      std::array<Vec<Dim>, Dim> X, x;
      int moving = kNone;
      for (int k = 0; k < Dim; ++k) {
        if (is_after && facet[k] == set) moving = k;
        X[k] = is_after ? rest(facet[k]) : state.mesh.rest(facet[k]);
        x[k] = at(state.fields.x, facet[k], is_after);
      }
      model.add_facet(X, x, tag, moving);
    };
    for (const FacetId f : edit.removed_facets) add_facet(state.mesh.facet(f), state.mesh.facet_tag(f), false, before);
    for (const auto& facet : edit.inserted_facets) add_facet(facet.vertices, facet.tag, true, after);
  }
  double gain = before.energy() - after.relaxed();
  if (context.has_inertia && state.history == HistoryRule::function && !edit.is_nested())
    gain -= least_forgotten<Dim>(state, edit);
  return gain;
}

template <int Dim>
double predict_split(const RemeshState<Dim>& state, const EdgeKey& edge) {
  const StepContext<Dim>& context = state.context;
  const Mesh<Dim>& mesh = state.mesh;
  const auto around = mesh.cells_of(edge[0]);
  const auto varies = [&](CellId c) { return context.materials.at(mesh.body(c)).has_varying_moduli(); };
  if (!is_predictable(context) || context.mass == MassKind::lumped || !context.loads.tractions.empty() ||
      std::any_of(around.begin(), around.end(), varies))
    return predict_gain<Dim>(state, make_split<Dim>(mesh, edge));
  QuadraticModel<Dim> model(context, mesh.part_of_vertex(edge[0]));
  for (const CellId c : around) {
    const auto& cell = mesh.cell(c);
    const auto b = static_cast<int>(std::find(cell.begin(), cell.end(), edge[1]) - cell.begin());
    if (b > Dim) continue;
    const auto a = static_cast<int>(std::find(cell.begin(), cell.end(), edge[0]) - cell.begin());
    model.add_split_cell(mesh, c, corners_of(state, cell), a, b);
  }
  return -model.relaxed();
}

namespace {

/// Whether a JacobianBarrier acts in a cell around an edge: predictions of splits, curves and straightenings leave it out.
template <int Dim>
bool has_barrier(const RemeshState<Dim>& state, const EdgeKey& edge) {
  const Mesh<Dim>& mesh = state.mesh;
  const auto around = mesh.cells_of_edge(edge);
  return std::any_of(around.begin(), around.end(), [&](CellId c) {
    if (!mesh.is_curved(c)) return false;
    const CurvedCell<Dim> cell = cell_before(mesh, c);
    const auto linear = barycentric_gradients<Dim>(mesh.inverse_rest_edges(c));
    return JacobianBarrier<Dim>(cell.edges, linear, at_nodes<Dim>(cell.nodes, state.fields.x)).is_active();
  });
}

/// Whether the nodes of curved edges around an edge feel only terms of constant moduli and density, and no tractions.
template <int Dim>
bool are_terms_constant(const RemeshState<Dim>& state, const EdgeKey& edge) {
  const StepContext<Dim>& context = state.context;
  const Mesh<Dim>& mesh = state.mesh;
  if (!is_predictable(context) || has_barrier(state, edge)) return false;
  if (!context.loads.tractions.empty() && !mesh.facets_of_edge(edge).empty()) return false;
  const auto around = mesh.cells_of_edge(edge);
  return std::none_of(around.begin(), around.end(), [&](CellId c) {
    const Material& material = context.materials.at(mesh.body(c));
    return material.has_varying_moduli() || material.density_at;
  });
}

}  // namespace

template <int Dim>
double predict_split_at_curves(const RemeshState<Dim>& state, const EdgeKey& edge) {
  return are_terms_constant(state, edge) ? SplitModel<Dim>(state, edge).gain() : std::numeric_limits<double>::quiet_NaN();
}

template <int Dim>
double predict_curve(const RemeshState<Dim>& state, const EdgeKey& edge) {
  constexpr double kCannotTell = std::numeric_limits<double>::quiet_NaN();
  const StepContext<Dim>& context = state.context;
  const Mesh<Dim>& mesh = state.mesh;
  if (!is_predictable(context) || has_barrier(state, edge)) return kCannotTell;
  const auto around = mesh.cells_of_edge(edge);
  const auto is_hard = [&](CellId c) { return context.materials.at(mesh.body(c)).has_varying_moduli(); };
  if (std::any_of(around.begin(), around.end(), is_hard)) return kCannotTell;
  QuadraticModel<Dim> model(context, mesh.part_of_vertex(edge[0]));
  for (const CellId c : around) {
    if (mesh.is_curved(c)) {
      model.add_mixed_cell(state, c, edge);
      continue;
    }
    const auto& cell = mesh.cell(c);
    const auto place = [&](VertexId v) { return static_cast<int>(std::find(cell.begin(), cell.end(), v) - cell.begin()); };
    model.add_curved_cell(mesh, c, corners_of(state, cell), place(edge[0]), place(edge[1]));
  }
  const Vec<Dim> middle = (mesh.rest(edge[0]) + mesh.rest(edge[1])) / 2;
  for (const FacetId f : mesh.facets_of_edge(edge)) {
    std::array<Vec<Dim>, Dim> rest;
    for (int k = 0; k < Dim; ++k) rest[k] = mesh.rest(mesh.facet(f)[k]);
    model.add_curved_facet(rest, middle, mesh.facet_tag(f));
  }
  return -model.relaxed(HeldRule<Dim>(context.held_components).tags_at(mesh, edge));
}

// Motion that the straight edge cannot carry counts as it does in the space before (rule b). There the straightened mesh has
// the node at the mean of the ends, so that no other space is needed.
template <int Dim>
double predict_straighten(const RemeshState<Dim>& state, const EdgeKey& edge) {
  constexpr double kCannotTell = std::numeric_limits<double>::quiet_NaN();
  const StepContext<Dim>& context = state.context;
  const Mesh<Dim>& mesh = state.mesh;
  if (!are_terms_constant(state, edge)) return kCannotTell;
  if (context.has_inertia && state.history != HistoryRule::function) return kCannotTell;
  const VertexId node = mesh.node_of(edge[0], edge[1]);
  const auto at = [&](VertexId v) { return state.fields.x.template segment<Dim>(Dim * v); };
  const Vec<Dim> middle = (at(edge[0]) + at(edge[1])) / 2, move = middle - at(node);
  double gain = 0;
  for (const CellId c : mesh.cells_of_edge(edge)) {
    const Material& material = context.materials.at(mesh.body(c));
    const CurvedCell<Dim> cell = cell_before(mesh, c);
    const auto n = std::find(cell.nodes.begin() + Dim + 1, cell.nodes.end(), node) - cell.nodes.begin();
    const auto linear = barycentric_gradients<Dim>(mesh.inverse_rest_edges(c));
    const ElasticModuli moduli = elastic_moduli<Dim>(material, mesh.rest(edge[0]));
    const auto x = at_nodes<Dim>(cell.nodes, state.fields.x);
    auto straight = x;
    straight.col(n) = middle;
    if (JacobianBarrier<Dim>(cell.edges, linear, straight).is_active()) return kCannotTell;
    const int level = state.fields.levels.empty() ? 0 : state.fields.levels[c];
    double density = 0;
    for (const auto& point : cell_quadrature<Dim>(level, context.quadrature_degree)) {
      const auto shapes = quadratic_gradients<Dim, Dim>(cell.edges, point.weights, linear);
      density += point.share * (elastic_density<Dim>(x * shapes.transpose(), moduli) -
                                elastic_density<Dim>(straight * shapes.transpose(), moduli));
    }
    gain += context.scaling * mesh.volume(c) * density;
    const double mass = material.density * mesh.volume(c);
    const auto& unit = constant_quadratic_mass<Dim>(MassKind::consistent, cell.edges);
    if (context.has_inertia) {
      const QuadraticCell<Dim> way = x - at_nodes<Dim>(cell.nodes, state.fields.predictor);
      gain -= mass * ((way * unit.col(n)).dot(move) + 0.5 * unit(n, n) * move.squaredNorm());
    }
    if (!context.loads.acceleration) continue;
    for (const auto& point : quadrature<Dim>(kMassDegree)) {
      Vec<Dim> X = Vec<Dim>::Zero();
      for (int k = 0; k <= Dim; ++k) X += point.weights[k] * mesh.rest(cell.nodes[k]);
      const double share = point.share * quadratic_shapes<Dim>(cell.edges, point.weights)[n];
      gain += context.scaling * mass * share * context.loads.acceleration(X).dot(move);
    }
  }
  return gain;
}

template <int Dim>
double cell_energy(const RemeshState<Dim>& state, const typename MeshTypes<Dim>::Cell& cell, int body,
                   const Edit<Dim>& edit) {
  if (const auto curved = curved_cell_after(state.mesh, edit, cell); curved.edges) {
    NodalModels<Dim> models(state, edit);
    models.add_still_cell(curved, body);
    return models.energy();
  }
  QuadraticModel<Dim> model(state.context, state.mesh.part_of_vertex(cell[0]));
  model.add_cell(corners_of(state, cell), body, kNone);
  return model.energy();
}

template double predict_gain(const RemeshState<2>&, const Edit<2>&);
template double predict_gain(const RemeshState<3>&, const Edit<3>&);
template double least_forgotten(const RemeshState<2>&, const Edit<2>&);
template double least_forgotten(const RemeshState<3>&, const Edit<3>&);
template double predict_split(const RemeshState<2>&, const EdgeKey&);
template double predict_split(const RemeshState<3>&, const EdgeKey&);
template double predict_split_at_curves(const RemeshState<2>&, const EdgeKey&);
template double predict_split_at_curves(const RemeshState<3>&, const EdgeKey&);
template double predict_curve(const RemeshState<2>&, const EdgeKey&);
template double predict_curve(const RemeshState<3>&, const EdgeKey&);
template double predict_straighten(const RemeshState<2>&, const EdgeKey&);
template double predict_straighten(const RemeshState<3>&, const EdgeKey&);
template double cell_energy<2>(const RemeshState<2>&, const MeshTypes<2>::Cell&, int, const Edit<2>&);
template double cell_energy<3>(const RemeshState<3>&, const MeshTypes<3>::Cell&, int, const Edit<3>&);

}  // namespace itr
