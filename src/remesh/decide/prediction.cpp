// SPDX-License-Identifier: MIT
#include "prediction.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <boost/container/small_vector.hpp>
#include "energy/elastic/jacobian_barrier.hpp"
#include "fem/held_rule.hpp"
#include "remesh/placed_cell.hpp"
#include "split_model.hpp"

namespace itr {

namespace {

constexpr double kUnknown = std::numeric_limits<double>::infinity();

/// The fraction of its model's gain that a vertex moved by the forces an edit adds gets: cells around, not in the model,
/// resist.
constexpr double kFractionOfRelaxation = 0.25;

/// A cell on these vertices after an edit.
template <int Dim>
PlacedCell<Dim> place(const RemeshState<Dim>& state, const typename MeshTypes<Dim>::Cell& vertices, const Edit<Dim>& edit) {
  return place(state.mesh, state.fields, state.context, cell_after(state.mesh, edit, vertices), edit);
}
template <int Dim>
PlacedCell<Dim> place(const RemeshState<Dim>& state, CellId c) {
  return place(state, state.mesh.cell(c), no_edit<Dim>());
}

/// Adds a facet after an edit, of which corners have these places.
template <int Dim>
void add_facet(const RemeshState<Dim>& state, const typename MeshTypes<Dim>::Facet& facet, int tag, const Edit<Dim>& edit,
               const typename CellModel<Dim>::Places& places, CellModel<Dim>& model) {
  std::array<Vec<Dim>, Dim> X, x;
  for (int k = 0; k < Dim; ++k) {
    X[k] = rest_after(state.mesh, edit, facet[k]);
    x[k] = RemeshFields<Dim>::after(state.fields.x, edit, facet[k]);
  }
  model.add_facet(X, x, tag, places);
}

/// Each vertex and node moves by itself, which is an estimate of what they gain together: those that the edit sets under all
/// forces on them, since all of their cells are here, the others under the forces that the edit adds. At curved edges
/// forgotten history is left out.
template <int Dim>
double predict_gain_of_each(const RemeshState<Dim>& state, const Edit<Dim>& edit, bool has_curves) {
  const StepContext<Dim>& context = state.context;
  if (has_curves && !context.loads.tractions.empty() && !edit.inserted_facets.empty()) return kUnknown;
  boost::container::small_vector<VertexId, 64> ids;  // ascending
  for (const auto& cell : edit.inserted_cells) {
    const CurvedCell<Dim> nodes = cell_after(state.mesh, edit, cell.vertices);
    for (int k = 0; k < kQuadraticNodes<Dim>; ++k)
      if (has_node<Dim>(nodes.edges, k)) ids.push_back(nodes.nodes[k]);
  }
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  const auto places_of = [&](const auto& nodes, CurvedEdges edges) {
    auto places = CellModel<Dim>::still();
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      const auto at = std::lower_bound(ids.begin(), ids.end(), nodes[k]);
      if (has_node<Dim>(edges, static_cast<int>(k)) && at != ids.end() && *at == nodes[k])
        places[k] = static_cast<int>(at - ids.begin());
    }
    return places;
  };
  const auto add = [&](const typename MeshTypes<Dim>::Cell& vertices, int body, const Edit<Dim>& by, CellModel<Dim>& model) {
    const CurvedCell<Dim> cell = cell_after(state.mesh, by, vertices);
    model.add(place(state.mesh, state.fields, context, cell, by), body, places_of(cell.nodes, cell.edges));
  };
  const int part = state.mesh.part(edit.removed_cells[0]);
  CellModel<Dim> before(context, part), after(context, part);
  for (const CellId c : edit.removed_cells) add(state.mesh.cell(c), state.mesh.body(c), no_edit<Dim>(), before);
  for (const auto& cell : edit.inserted_cells) add(cell.vertices, cell.body, edit, after);
  if (has_curves && (!std::isfinite(after.energy()) || before.has_barrier())) return kUnknown;  // inverted, or nearly so now
  if (!context.loads.tractions.empty()) {
    for (const FacetId f : edit.removed_facets)
      add_facet(state, state.mesh.facet(f), state.mesh.facet_tag(f), no_edit<Dim>(), places_of(state.mesh.facet(f), 0),
                before);
    for (const auto& facet : edit.inserted_facets)
      add_facet(state, facet.vertices, facet.tag, edit, places_of(facet.vertices, 0), after);
  }
  double gain = before.energy() - after.energy();
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const bool is_set = edit.sets(ids[i]) || ids[i] >= state.mesh.node_slots();
    const Vec<Dim> force = is_set ? after.gradient(i) : Vec<Dim>(after.gradient(i) - before.gradient(i));
    const Eigen::LLT<Mat<Dim>> llt(after.hessian(i));
    if (llt.info() != Eigen::Success) return kUnknown;
    gain += (is_set ? 1 : kFractionOfRelaxation) * 0.5 * force.dot(llt.solve(force));
  }
  return gain;
}

/// Fraction of the forgotten history that no relaxation regains (ball-wall 2D: a fraction of 1 refuses so many collapses
/// that a sixth more vertices stay).
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
    Vec<Dim> step = Vec<Dim>::Zero(), predictor = step;
    for (const auto& [cell, body] : edit.inserted_cells) {
      std::array<Vec<Dim>, Dim + 1> rest;
      for (int k = 0; k <= Dim; ++k) rest[k] = rest_after(state.mesh, edit, cell[k]);
      const Vec<Dim> weights = edge_matrix<Dim>(rest).inverse() * (X - rest[0]);
      const double depth = std::min(weights.minCoeff(), 1 - weights.sum());
      if (depth <= deepest) continue;
      deepest = depth;
      step = predictor = Vec<Dim>::Zero();
      for (int k = 0; k <= Dim; ++k) {
        const double weight = k == 0 ? 1 - weights.sum() : weights[k - 1];
        const Vec<Dim> x_hat = after(state.fields.predictor, cell[k]);
        predictor += weight * x_hat;
        step += weight * (after(state.fields.x, cell[k]) - x_hat);
      }
    }
    const Vec<Dim> gap = state.fields.predictor.template segment<Dim>(Dim * v) - predictor;
    forgotten += mass * (gap.squaredNorm() / (Dim + 2) - gap.dot(step));
  }
  return kLeastForgotten * forgotten;
}

template <int Dim>
double predict_gain(const RemeshState<Dim>& state, const Edit<Dim>& edit) {
  const StepContext<Dim>& context = state.context;
  if (!is_predictable(context) || (state.patches && state.patches->act_in(edit.removed_cells))) return kUnknown;
  const bool has_curves = std::ranges::any_of(edit.removed_cells, [&](CellId c) { return state.mesh.is_curved(c); });
  if (has_curves || !edit.value) return predict_gain_of_each(state, edit, has_curves);
  const VertexId set = edit.value->vertex;
  const auto places_of = [&](const auto& vertices) {
    const auto at = std::find(vertices.begin(), vertices.end(), set);
    return CellModel<Dim>::moving(at == vertices.end() ? kNone : static_cast<int>(at - vertices.begin()));
  };
  const int part = state.mesh.part(edit.removed_cells[0]);
  CellModel<Dim> before(context, part), after(context, part);
  for (const CellId c : edit.removed_cells) before.add(place(state, c), state.mesh.body(c));
  for (const auto& cell : edit.inserted_cells)
    after.add(place(state, cell.vertices, edit), cell.body, places_of(cell.vertices));
  if (!context.loads.tractions.empty()) {
    for (const FacetId f : edit.removed_facets)
      add_facet(state, state.mesh.facet(f), state.mesh.facet_tag(f), no_edit<Dim>(), CellModel<Dim>::still(), before);
    for (const auto& facet : edit.inserted_facets)
      add_facet(state, facet.vertices, facet.tag, edit, places_of(facet.vertices), after);
  }
  double gain = before.energy() - (after.energy() - after.relaxation_of(0));
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
  CellModel<Dim> model(context, mesh.part_of_vertex(edge[0]));
  for (const CellId c : around) {
    const auto& cell = mesh.cell(c);
    const auto b = static_cast<int>(std::find(cell.begin(), cell.end(), edge[1]) - cell.begin());
    if (b > Dim) continue;
    const auto a = static_cast<int>(std::find(cell.begin(), cell.end(), edge[0]) - cell.begin());
    model.add_halves(place(state, c), mesh.body(c), mesh.inverse_rest_edges(c), mesh.volume(c), a, b);
  }
  return -(model.energy() - model.relaxation_of(0));
}

namespace {

/// The node in a cell of the edge between two of its vertices.
template <int Dim>
int place_of_node(const typename MeshTypes<Dim>::Cell& cell, const EdgeKey& edge) {
  int node = kNone;
  for_each_edge<Dim>([&](int k, int i, int j) {
    if (edge_key(cell[i], cell[j]) == edge) node = Dim + 1 + k;
  });
  return node;
}
/// The vertices between which a node of a cell is.
template <int Dim>
std::array<int, 2> ends_of_node(int node) {
  std::array<int, 2> ends{};
  for_each_edge<Dim>([&](int k, int i, int j) {
    if (Dim + 1 + k == node) ends = {i, j};
  });
  return ends;
}

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
  CellModel<Dim> model(context, mesh.part_of_vertex(edge[0]));
  for (const CellId c : around) {
    PlacedCell<Dim> cell = place(state, c);
    const int node = place_of_node<Dim>(mesh.cell(c), edge);
    const auto [i, j] = ends_of_node<Dim>(node);
    cell.curved = static_cast<CurvedEdges>(cell.curved | 1 << (node - Dim - 1));
    for (QuadraticCell<Dim>* values : {&cell.x, &cell.step}) values->col(node) = (values->col(i) + values->col(j)) / 2;
    model.add(cell, mesh.body(c), CellModel<Dim>::moving(node));
  }
  const Vec<Dim> middle = (mesh.rest(edge[0]) + mesh.rest(edge[1])) / 2;
  for (const FacetId f : mesh.facets_of_edge(edge)) {
    std::array<Vec<Dim>, Dim> rest;
    for (int k = 0; k < Dim; ++k) rest[k] = mesh.rest(mesh.facet(f)[k]);
    model.add_facet_of_node(rest, middle, mesh.facet_tag(f));
  }
  model.hold(0, HeldRule<Dim>(context.held_components).tags_at(mesh, edge));
  return model.relaxation_of(0);
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
  const int part = mesh.part_of_vertex(edge[0]);
  CellModel<Dim> before(context, part), after(context, part);
  for (const CellId c : mesh.cells_of_edge(edge)) {
    PlacedCell<Dim> cell = place(state, c);
    if (!state.fields.levels.empty()) cell.level = state.fields.levels[c];
    before.add(cell, mesh.body(c));
    const int node = place_of_node<Dim>(mesh.cell(c), edge);
    const auto [i, j] = ends_of_node<Dim>(node);
    const Vec<Dim> move = (cell.x.col(i) + cell.x.col(j)) / 2 - cell.x.col(node);
    cell.x.col(node) += move;
    cell.step.col(node) += move;
    after.add(cell, mesh.body(c));
  }
  return after.has_barrier() ? kCannotTell : before.energy() - after.energy();
}

template <int Dim>
double cell_energy(const RemeshState<Dim>& state, const typename MeshTypes<Dim>::Cell& cell, int body,
                   const Edit<Dim>& edit) {
  const int part = edit.removed_cells.empty() ? state.mesh.part_of_vertex(cell[0]) : state.mesh.part(edit.removed_cells[0]);
  CellModel<Dim> model(state.context, part);
  model.add(place(state, cell, edit), body);
  return model.energy();
}

#define ITR_INSTANTIATE(Dim)                                                        \
  template double predict_gain(const RemeshState<Dim>&, const Edit<Dim>&);          \
  template double least_forgotten(const RemeshState<Dim>&, const Edit<Dim>&);       \
  template double predict_split(const RemeshState<Dim>&, const EdgeKey&);           \
  template double predict_split_at_curves(const RemeshState<Dim>&, const EdgeKey&); \
  template double predict_curve(const RemeshState<Dim>&, const EdgeKey&);           \
  template double predict_straighten(const RemeshState<Dim>&, const EdgeKey&);      \
  template double cell_energy<Dim>(const RemeshState<Dim>&, const MeshTypes<Dim>::Cell&, int, const Edit<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
