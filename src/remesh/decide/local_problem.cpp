// SPDX-License-Identifier: MIT
#include "local_problem.hpp"

#include <algorithm>
#include <cmath>

#include "fem/held_rule.hpp"
#include "geometry/measures.hpp"
#include "projection/forgotten_history.hpp"
#include "projection/transfer_patch.hpp"
#include "remesh/curved_cell.hpp"
#include "remesh/edits.hpp"

namespace itr {

namespace {

/// Adds a cell to one side of an edit, which has few vertices: their numbers are searched for.
template <int Dim>
void add_to_side(const std::array<VertexId, Dim + 1>& vertices, const CurvedCell<Dim>& cell, double density,
                 TransferCells<Dim>& side) {
  side.add(vertices, cell.nodes, cell.edges, density, [&side](VertexId v) {
    const auto it = std::find(side.vertices.begin(), side.vertices.end(), v);
    const auto number = static_cast<int>(it - side.vertices.begin());
    if (it == side.vertices.end()) side.vertices.push_back(v);
    return number;
  });
}

/// Facets and tags of vertices after an edit, as HeldRule asks for them.
template <int Dim>
struct MeshAfter {
  const Mesh<Dim>& mesh;
  const Edit<Dim>& edit;

  int vertex_tag(VertexId v) const { return v == kNewVertex ? edit.value->tag : mesh.vertex_tag(v); }
  template <std::size_t N, typename F>
  friend void for_each_facet_tag(const MeshAfter& after, const std::array<VertexId, N>& vertices, const F& f) {
    for (const auto& facet : after.edit.inserted_facets)
      if (has_all(facet.vertices, vertices)) f(facet.tag);
    if (vertices[N - 1] == kNewVertex) return;
    for (const FacetId facet : after.mesh.facets_of(vertices[0]))
      if (has_all(after.mesh.facet(facet), vertices) && std::ranges::count(after.edit.removed_facets, facet) == 0)
        f(after.mesh.facet_tag(facet));
  }
};

}  // namespace

/// Keeps vertices of the surface within `room` of their start, because the patch knows only what they could touch there. It
/// is an energy of value zero that only limits steps.
template <int Dim>
class MotionBound final : public Energy {
 public:
  /// Bounds no vertex until `add` names some.
  void reset(ConstVectorView start, double room) {
    bounded_.clear();
    start_ = start;
    room_ = room;
  }
  void add(int vertex) { bounded_.push_back(vertex); }
  std::string_view name() const override { return "motion bound"; }
  double value(ConstVectorView, Workspace&) const override { return 0; }
  void add_gradient(ConstVectorView, VectorView, Workspace&) const override {}
  void add_hessian(ConstVectorView, PsdProjection, HessianSink&, Workspace&) const override {}
  double max_step(ConstVectorView x, ConstVectorView dx, Workspace&) const override {
    double step = 1;
    const ConstVectorView start = start_.view();
    for (const int v : bounded_) {
      const Vec<Dim> move = dx.segment<Dim>(Dim * v), away = x.segment<Dim>(Dim * v) - start.segment<Dim>(Dim * v);
      if ((away + step * move).norm() <= room_) continue;
      // Where the way leaves the ball: |away + t move| = room.
      const double a = move.squaredNorm(), b = away.dot(move), c = std::max(0.0, room_ * room_ - away.squaredNorm());
      step = std::min(step, 0.99 * c / (b + std::sqrt(b * b + a * c)));
    }
    return step;
  }

 private:
  std::vector<int> bounded_;
  ScratchVector start_;
  double room_ = 0;
};

/// Storage that another problem has left, or new one.
template <int Dim>
std::unique_ptr<LocalStorage<Dim>> LocalScratch<Dim>::take_storage() {
  if (spare.empty()) return std::make_unique<LocalStorage<Dim>>();
  auto storage = std::move(spare.back());
  spare.pop_back();
  return storage;
}

template <int Dim>
LocalProblem<Dim>::LocalProblem(const RemeshState<Dim>& state, std::span<const CellId> patch, const Edit<Dim>& edit,
                                bool is_after, LocalScratch<Dim>& scratch)
    : state_(state),
      mesh_(state.mesh),
      edit_(edit),
      is_after_(is_after),
      scratch_(scratch),
      storage_(scratch.take_storage()) {
  scratch_.known.clear(mesh_.node_slots());
  scratch_.known_obstacles.clear(static_cast<int>(state.context.obstacles.x.size()));
  if (static_cast<int>(scratch_.local_of.size()) < mesh_.node_slots()) scratch_.local_of.resize(2 * mesh_.node_slots());
  scratch_.local_of_obstacle.resize(state.context.obstacles.x.size());
  add_cells(patch);
  if (state.patches) add_patches(patch);
  if (needs_facets(state.context)) add_loaded_facets();
  hold_vertices();
  if (state.context.contact.enabled) add_surface();
  add_terms();
}

template <int Dim>
LocalProblem<Dim>::~LocalProblem() {
  cells_.rest.clear();
  cells_.elements.clear();
  cells_.facets.clear();
  cells_.patches.reset();
  vertices_.clear();
  changes_.clear();
  energy_.clear();
  if (!state_.context.host.empty()) workspace_ = {};  // what they keep in it may be of this one
  scratch_.spare.push_back(std::move(storage_));
}

/// The edge of which this is the node; {kNone, kNone} of a vertex.
template <int Dim>
EdgeKey LocalProblem<Dim>::edge_of(const LocalVertex& v) const {
  if (v.kind == Kind::of_mesh) return mesh_.edge_of_node(v.id);
  const auto* node = v.kind == Kind::created ? edit_.created_node(v.id) : nullptr;
  return node ? node->edge : EdgeKey{kNone, kNone};
}

template <int Dim>
VertexId LocalProblem<Dim>::node_of(VertexId a, VertexId b) const {
  return is_after_ ? node_after(mesh_, edit_, a, b) : mesh_.node_of(a, b);
}

template <int Dim>
bool LocalProblem<Dim>::is_on_surface(const LocalVertex& v) const {
  if (v.kind != Kind::of_mesh) return false;
  bool found = false;
  for_each_facet_at(mesh_, v.id, [&](FacetId) { found = true; });
  return found;
}

template <int Dim>
Vec<Dim> LocalProblem<Dim>::rest_position(const LocalVertex& v) const {
  if (v.kind == Kind::of_obstacle) return state_.context.obstacles.rest[v.id];
  if (!is_after_) return mesh_.rest(v.id);
  const auto* node = edit_.created_node(v.id);
  if (!node) return rest_after(mesh_, edit_, v.id);
  return (rest_after(mesh_, edit_, node->edge[0]) + rest_after(mesh_, edit_, node->edge[1])) / 2;
}

template <int Dim>
Vec<Dim> LocalProblem<Dim>::field_value(const VectorX& field, const std::vector<Vec<Dim>>& obstacle_values,
                                        const LocalVertex& v) const {
  if (v.kind == Kind::of_obstacle) return obstacle_values.empty() ? Vec<Dim>(Vec<Dim>::Zero()) : obstacle_values[v.id];
  return is_after_ ? RemeshFields<Dim>::after(field, edit_, v.id) : Vec<Dim>(field.segment<Dim>(Dim * v.id));
}

template <int Dim>
ConstVectorView LocalProblem<Dim>::gather(const VectorX& field, const std::vector<Vec<Dim>>& obstacle_values,
                                          ScratchVector& values) const {
  VectorView view = values.resize(static_cast<Eigen::Index>(Dim * vertices_.size()));
  for (std::size_t i = 0; i < vertices_.size(); ++i)
    view.segment<Dim>(Dim * static_cast<int>(i)) = field_value(field, obstacle_values, vertices_[i]);
  return view;
}

/// The local id of a vertex, made on first use.
template <int Dim>
int LocalProblem<Dim>::local(LocalVertex v) {
  if (v.kind == Kind::of_mesh) {
    if (!scratch_.known.mark(v.id)) return scratch_.local_of[v.id];
  } else if (v.kind == Kind::of_obstacle) {
    if (!scratch_.known_obstacles.mark(v.id)) return scratch_.local_of_obstacle[v.id];
  } else if (const auto it = std::find(vertices_.begin(), vertices_.end(), v); it != vertices_.end()) {
    return static_cast<int>(it - vertices_.begin());
  }
  const int id = static_cast<int>(vertices_.size());
  vertices_.push_back(v);
  cells_.rest.push_back(rest_position(v));
  if (v.kind == Kind::of_mesh) scratch_.local_of[v.id] = id;
  if (v.kind == Kind::of_obstacle) scratch_.local_of_obstacle[v.id] = id;
  return id;
}

template <int Dim>
bool LocalProblem<Dim>::is_free(int i) const {
  const auto* unknown = &dofs_.unknown[Dim * i];
  return std::any_of(unknown, unknown + Dim, [](int u) { return u != kNone; });
}

template <int Dim>
bool LocalProblem<Dim>::is_removed(FacetId f) const {
  return is_after_ && std::find(edit_.removed_facets.begin(), edit_.removed_facets.end(), f) != edit_.removed_facets.end();
}

template <int Dim>
void LocalProblem<Dim>::add_cells(std::span<const CellId> patch) {
  cells_.axisymmetric = mesh_.is_axisymmetric();
  scratch_.cells.clear(mesh_.cell_slots());
  cells_.elements.reserve(patch.size() + edit_.inserted_cells.size());
  scratch_.curved.clear();
  for (const CellId c : patch) {
    scratch_.cells.mark(c);
    if (is_after_ && std::find(edit_.removed_cells.begin(), edit_.removed_cells.end(), c) != edit_.removed_cells.end())
      continue;
    add_cell({mesh_.cell(c), mesh_.body(c), mesh_.volume(c), mesh_.inverse_rest_edges(c), mesh_.part(c), c});
  }
  for (std::size_t i = 0; is_after_ && i < edit_.inserted_cells.size(); ++i) {
    const auto& cell = edit_.inserted_cells[i];
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = cells_.rest[local(cell.vertices[k])];
    const Mat<Dim> edges = edge_matrix<Dim>(p);
    add_cell({cell.vertices, cell.body, simplex_volume<Dim>(edges), edges.inverse(), mesh_.part(edit_.removed_cells[0])});
  }
  for (const auto& element : scratch_.curved) cells_.add(element);
}

/// Both sides have the patches before the edit, of which the parts outside stay as they are.
template <int Dim>
void LocalProblem<Dim>::add_patches(std::span<const CellId> patch) {
  const CarriedPatches<Dim>& carried = *state_.patches;
  using Shares = typename CarriedPatches<Dim>::Shares;
  const std::vector<Shares> inserted = is_after_ ? carried.shares_after(mesh_, edit_) : std::vector<Shares>();
  const std::span<const CellId> star =
      state_.cuts_star ? std::span<const CellId>(edit_.removed_cells) : std::span<const CellId>();
  cells_.patches = carried.in(cells_, inserted, patch, star);
}

/// Makes the vertices of a simplex local, and finds its curved edges.
template <int Dim>
template <typename Simplex>
void LocalProblem<Dim>::localize(Simplex& simplex) {
  if (has_curves(mesh_, edit_) || cells_.axisymmetric) {
    simplex.curved = find_edge_nodes<static_cast<int>(std::tuple_size_v<decltype(simplex.vertices)>) - 1>(
        simplex.vertices, [&](VertexId a, VertexId b) { return node_of(a, b); }, simplex.edge_nodes);
    for (VertexId& node : simplex.edge_nodes) node = local(node);
  }
  for (VertexId& v : simplex.vertices) v = local(v);
}

template <int Dim>
void LocalProblem<Dim>::add_cell(typename CellSet<Dim>::Element cell) {
  localize(cell);
  if (cell.curved && !cells_.axisymmetric)
    scratch_.curved.push_back(cell);
  else
    cells_.add(cell);
}

template <int Dim>
void LocalProblem<Dim>::add_loaded_facet(typename CellSet<Dim>::BoundaryFacet facet) {
  localize(facet);
  cells_.facets.push_back(facet);
}

template <int Dim>
void LocalProblem<Dim>::add_loaded_facets() {
  const std::size_t count = vertices_.size();
  for (std::size_t i = 0; i < count; ++i) {
    const LocalVertex v = vertices_[i];
    if (v.kind == Kind::created) continue;
    for (const FacetId f : mesh_.facets_of(v.id)) {
      const auto& facet = mesh_.facet(f);
      const auto is_known = [&](VertexId w) { return scratch_.known[w]; };
      if (facet[0] != v.id || !std::all_of(facet.begin() + 1, facet.end(), is_known) || is_removed(f)) continue;
      add_loaded_facet({facet, mesh_.facet_tag(f), mesh_.part_of_vertex(v.id)});
    }
  }
  if (!is_after_) return;
  for (const auto& facet : edit_.inserted_facets)
    add_loaded_facet({facet.vertices, facet.tag, mesh_.part(edit_.removed_cells[0])});
}

template <int Dim>
void LocalProblem<Dim>::hold_vertices() {
  std::vector<char>& held = storage_->held;
  held.assign(Dim * vertices_.size(), 0);
  const HeldRule<Dim> rule(state_.context.held_components);
  const auto tags_at = [&](const auto& ends) {
    return is_after_ ? rule.tags_at(MeshAfter<Dim>{mesh_, edit_}, ends) : rule.tags_at(mesh_, ends);
  };
  const auto is_of_patch = [&](CellId c) { return scratch_.cells[c]; };
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    const LocalVertex v = vertices_[i];
    const EdgeKey edge = edge_of(v);
    const bool is_node = edge[0] != kNone;
    const bool is_free = is_node ? edge[1] == kNewVertex || std::ranges::all_of(mesh_.cells_of_edge(edge), is_of_patch)
                                 : v.kind == Kind::created || std::ranges::all_of(mesh_.cells_of(v.id), is_of_patch);
    if (!is_free) {
      std::fill_n(held.begin() + static_cast<std::ptrdiff_t>(Dim * i), Dim, 1);
      continue;
    }
    const auto tags = is_node ? tags_at(edge) : tags_at(std::array{v.id});
    for (int c = 0; c < Dim; ++c) held[Dim * i + c] = tags[c] != kNoTag;
    if (cells_.axisymmetric && cells_.rest[i][0] == 0) held[Dim * i] = 1;
  }
  dofs_.hold(held);
}

/// As the solve of the step does: where the points of a cell do not see how near it is to an inversion, there are more.
template <int Dim>
void LocalProblem<Dim>::set_quadrature(ConstVectorView x) {
  ElasticEnergy<Dim>& elastic = *storage_->potential->elastic();
  if (!state_.fields.levels.empty()) {
    QuadratureLevels levels;
    std::size_t next = 0;  // of the edit's cells, of which the curved ones are here
    const auto level_of_next = [&] {
      while (!cells_.axisymmetric && cell_after<Dim>(mesh_, edit_, edit_.inserted_cells[next].vertices).edges == 0) ++next;
      return state_.fields.level_of_new_cell(edit_, next++);
    };
    for (const auto& element : cells_.curved())
      levels.push_back(element.cell == kNone ? level_of_next() : state_.fields.levels[element.cell]);
    elastic.set_quadrature_levels(levels);
  }
  elastic.refine_quadrature(x);
}

template <int Dim>
void LocalProblem<Dim>::add_terms() {
  const StepContext<Dim>& context = state_.context;
  cells_.num_vertices = static_cast<int>(vertices_.size());
  const ConstVectorView x = gather(state_.fields.x, context.obstacles.x, x_);
  storage_->predictor.resize(0);
  storage_->velocity_reference.resize(0);
  if (context.has_inertia) gather(state_.fields.predictor, {}, storage_->predictor);
  if (needs_velocities(context, touches_contact_) && state_.fields.velocity_reference.size() > 0)
    gather(state_.fields.velocity_reference, context.obstacles.velocity_reference, storage_->velocity_reference);
  const PotentialHistory history{storage_->predictor.view(), storage_->velocity_reference.view()};
  if (storage_->potential)
    storage_->potential->renew(context, history);
  else
    storage_->potential.emplace(context, cells_, history);
  IncrementalPotential<Dim>& potential = *storage_->potential;
  set_quadrature(x);
  // With lumped mass a split changes how inertia is integrated.
  const bool is_nested = !is_after_ || (edit_.is_nested() && context.mass == MassKind::consistent);
  if (context.has_inertia && !is_nested && state_.history == HistoryRule::function)
    add_unrepresented_history(*potential.inertia());
  if (has_surface_) {
    auto& motion_bound = storage_->motion_bound;
    if (!motion_bound) motion_bound = std::make_shared<MotionBound<Dim>>();
    motion_bound->reset(x, scratch_.reach.room());
    for (int i = 0; i < static_cast<int>(changes_.size()); ++i)
      if (changes_[i] && is_free(i)) motion_bound->add(i);
    energy_.add(motion_bound);  // first: contact then looks no further than that
  }
  if (touches_contact_) potential.add_contact(storage_->surface, context.contact.barrier_stiffness);
  potential.add_to(energy_, potential.lag(x, workspace_));
}

/// Adds the history of an edge that is straightened: its node's shape function times by how much the predictor was off the
/// mean of the ends.
template <int Dim>
void LocalProblem<Dim>::add_history_of_node(InertiaEnergy<Dim>& inertia) const {
  const VectorX& predictor = state_.fields.predictor;
  const VertexId node = mesh_.node_of(edit_.edge[0], edit_.edge[1]);
  const auto at = [&](VertexId v) -> Vec<Dim> { return predictor.segment<Dim>(Dim * v); };
  const Vec<Dim> gap = at(node) - (at(edit_.edge[0]) + at(edit_.edge[1])) / 2;
  VectorX residual = VectorX::Zero(Dim * static_cast<int>(vertices_.size()));
  const auto add = [&](VertexId v, double mass) {
    const auto place = std::find(vertices_.begin(), vertices_.end(), LocalVertex{Kind::of_mesh, v}) - vertices_.begin();
    residual.segment<Dim>(Dim * place) -= mass * gap;
  };
  double loss = 0;
  for (const CellId c : edit_.removed_cells) {
    const auto cell = cell_before(mesh_, c);
    const double mass = state_.context.materials.at(mesh_.body(c)).density * mesh_.volume(c);
    Mat<kQuadraticNodes<Dim>> matrix = constant_quadratic_mass<Dim>(MassKind::consistent, cell.edges);
    if (mesh_.is_axisymmetric()) {
      std::array<Vec<Dim>, Dim + 1> corners;
      for (int k = 0; k <= Dim; ++k) corners[k] = mesh_.rest(mesh_.cell(c)[k]);
      matrix = turned_mass<Dim>(MassKind::consistent, cell.edges, corners);
    }
    const auto n = std::find(cell.nodes.begin(), cell.nodes.end(), node) - cell.nodes.begin();
    for (int k = 0; k < kQuadraticNodes<Dim>; ++k)
      if (k != n && has_node<Dim>(cell.edges, k)) add(cell.nodes[k], mass * matrix(k, n));
    for (const VertexId end : edit_.edge) add(end, mass * matrix(n, n) / 2);  // the straight edge moves with its ends
    loss += 0.5 * mass * matrix(n, n) * gap.squaredNorm();
  }
  inertia.set_unrepresented_history(residual, loss);
}

/// Adds the part of the predictor, a function on the old mesh, that the new mesh cannot represent.
template <int Dim>
void LocalProblem<Dim>::add_unrepresented_history(InertiaEnergy<Dim>& inertia) const {
  if (edit_.kind == Edit<Dim>::Kind::straighten) return add_history_of_node(inertia);
  // Numberings of the two sides' own: the nodes of removed cells carry the functions as they were.
  TransferCells<Dim> old_side, new_side;
  old_side.axisymmetric = new_side.axisymmetric = mesh_.is_axisymmetric();
  const auto density = [&](int body) { return state_.context.materials.at(body).density; };
  for (const CellId c : edit_.removed_cells)
    add_to_side<Dim>(mesh_.cell(c), cell_before(mesh_, c), density(mesh_.body(c)), old_side);
  for (const auto& cell : edit_.inserted_cells)
    add_to_side<Dim>(cell.vertices, cell_after(mesh_, edit_, cell.vertices), density(cell.body), new_side);
  const auto local_vertex = [&](VertexId v) { return LocalVertex{is_created(v) ? Kind::created : Kind::of_mesh, v}; };
  for (const VertexId v : old_side.vertices) old_side.rest.push_back(mesh_.rest(v));
  for (const VertexId v : new_side.vertices) new_side.rest.push_back(rest_position(local_vertex(v)));
  const VectorX& predictor = state_.fields.predictor;
  const std::vector<VertexId>& new_ids = new_side.vertices;
  const MatrixX old_predictor = old_side.gather(predictor);
  MatrixX new_predictor(new_ids.size(), Dim), new_x(new_ids.size(), Dim);
  for (std::size_t i = 0; i < new_ids.size(); ++i) {
    new_predictor.row(i) = field_value(predictor, {}, local_vertex(new_ids[i])).transpose();
    new_x.row(i) = field_value(state_.fields.x, {}, local_vertex(new_ids[i])).transpose();
  }
  const ForgottenHistory forgotten =
      forgotten_history<Dim>(state_.context.mass, old_side.view(), new_side.view(), old_predictor, new_predictor, new_x);
  VectorX residual = VectorX::Zero(Dim * static_cast<int>(vertices_.size()));
  for (std::size_t i = 0; i < new_ids.size(); ++i) {
    const auto at = std::find(vertices_.begin(), vertices_.end(), local_vertex(new_ids[i])) - vertices_.begin();
    residual.segment<Dim>(Dim * at) = forgotten.residual.row(i).transpose();
  }
  inertia.set_unrepresented_history(residual, forgotten.loss);
}

template <int Dim>
NewtonSummary LocalProblem<Dim>::relax(int max_iterations) {
  NewtonOptions options = state_.context.newton;
  options.max_iterations = max_iterations;
  NewtonExtras extras{.is_brief = true};
  if (cells_.has_curved())
    extras.after_step = [&](const VectorX& x) { return storage_->potential->elastic()->refine_quadrature(x); };
  if (options.norm != NewtonNorm::euclidean) {
    VectorView weights = storage_->norm_weights.resize(Dim * cells_.num_vertices);
    get_unit_mass_diagonal(cells_, weights);
    extras.norm_weights = {weights.data(), static_cast<std::size_t>(weights.size())};
  }
  return minimize(energy_, x_.view(), dofs_, VectorX(), scratch_.system, options, workspace_, extras);
}

template <int Dim>
double LocalProblem<Dim>::contact_energy() {
  return touches_contact_ ? std::max(0.0, storage_->potential->contact()->value(x_.view(), workspace_)) : 0;
}

template <int Dim>
bool LocalProblem<Dim>::distorts() const {
  return std::ranges::any_of(cells_.curved(), [&](const auto& element) {
    return element.cell == kNone && relative_jacobian<Dim>(at_all_nodes<Dim>(element, x_.view())) < kLeastRelativeJacobian;
  });
}

template <int Dim>
void LocalProblem<Dim>::get_positions(std::vector<Position>& positions) const {
  positions.clear();
  const ConstVectorView x = x_.view();
  for (int i = 0; i < static_cast<int>(vertices_.size()); ++i)
    if (is_free(i)) positions.push_back({vertices_[i].id, x.segment<Dim>(Dim * i)});
}

template class LocalProblem<2>;
template class LocalProblem<3>;

}  // namespace itr
