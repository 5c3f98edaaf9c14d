// SPDX-License-Identifier: MIT
#include "itr/remesh/local_problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "itr/energy/pressure.hpp"
#include "itr/geometry/measures.hpp"
#include "itr/geometry/predicates.hpp"
#include "itr/projection/transfer.hpp"

namespace itr {

namespace {

constexpr int obstacle_index(VertexId global) { return -2 - global; }
constexpr bool is_obstacle(VertexId global) { return global < kNone; }

/// Keeps surface vertices where the patch knows everything that they could touch: an energy of value zero that only limits
/// steps.
class MotionBound final : public Energy {
 public:
  explicit MotionBound(const std::vector<std::pair<int, Box<2>>>& bounds) : bounds_(bounds) {}
  std::string_view name() const override { return "motion bound"; }
  double value(ConstVectorView, Workspace&) const override { return 0; }
  void add_gradient(ConstVectorView, VectorView, Workspace&) const override {}
  void add_hessian(ConstVectorView, PsdProjection, HessianSink&, Workspace&) const override {}
  double max_step(ConstVectorView x, ConstVectorView dx, Workspace&) const override {
    double step = 1;
    for (const auto& [v, box] : bounds_)
      for (int c = 0; c < 2; ++c) {
        const double from = x[2 * v + c], move = dx[2 * v + c];
        const double room = move > 0 ? box.max[c] - from : from - box.min[c];
        if (std::abs(move) > room) step = std::min(step, 0.99 * room / std::abs(move));
      }
    return step;
  }

 private:
  std::vector<std::pair<int, Box<2>>> bounds_;
};

}  // namespace

void SurfaceTree::query(const Box<2>& box, std::vector<int>& hits) {
  if (!valid_) {
    std::vector<Box<2>> boxes;
    ids_.clear();
    for (int f = 0; f < mesh_.facet_slots(); ++f) {
      if (!mesh_.is_facet_alive(f)) continue;
      Box<2> box_of;
      for (const int v : mesh_.facet(f)) box_of.include(Vec<2>(fields_.x.segment<2>(2 * v)));
      boxes.push_back(box_of);
      ids_.push_back(f);
    }
    for (std::size_t e = 0; e < context_.obstacles.edges.size(); ++e) {
      Box<2> box_of;
      for (const int v : context_.obstacles.edges[e]) box_of.include(context_.obstacles.x[v]);
      boxes.push_back(box_of);
      ids_.push_back(-1 - static_cast<int>(e));
    }
    tree_.build(boxes);
    valid_ = true;
  }
  scratch_.clear();
  tree_.query(box, scratch_);
  std::sort(scratch_.begin(), scratch_.end());
  for (const int i : scratch_) hits.push_back(ids_[i]);
}

LocalProblem::LocalProblem(const Mesh<2>& mesh, const RemeshFields<2>& fields, const StepContext<2>& context,
                           const std::vector<CellId>& patch, const Edit<2>* edit, bool apply_edit, HistoryRule history,
                           SurfaceTree& surface_tree, LocalScratch& scratch)
    : mesh_(mesh), fields_(fields), context_(context), edit_(edit), apply_edit_(apply_edit), scratch_(scratch) {
  scratch_.known.clear(mesh.vertex_slots());
  scratch_.local_of.resize(mesh.vertex_slots());
  add_cells(patch);
  if (!context.loads.tractions.empty() || !context.loads.pressures.empty()) add_loaded_facets();
  hold_vertices();
  if (context.contact.enabled) add_surface(surface_tree);
  add_terms(history);
}

Vec<2> LocalProblem::rest_position(VertexId v) const {
  if (is_obstacle(v)) return context_.obstacles.rest[obstacle_index(v)];
  if (apply_edit_ && edit_->value && edit_->value->vertex == v) return edit_->value->rest;
  return mesh_.rest(v);
}

Vec<2> LocalProblem::field_value(const VectorX& field, const std::vector<Vec<2>>& obstacle_values, VertexId v) const {
  if (is_obstacle(v)) return obstacle_values.empty() ? Vec<2>(Vec<2>::Zero()) : obstacle_values[obstacle_index(v)];
  if (apply_edit_ && edit_->value && edit_->value->vertex == v) return RemeshFields<2>::interpolate(field, *edit_->value);
  return field.segment<2>(2 * v);
}

VectorX LocalProblem::gather(const VectorX& field, const std::vector<Vec<2>>& obstacle_values) const {
  VectorX values(2 * global_.size());
  for (std::size_t i = 0; i < global_.size(); ++i)
    values.segment<2>(2 * static_cast<int>(i)) = field_value(field, obstacle_values, global_[i]);
  return values;
}

/// The local id of a vertex, made on first use.
int LocalProblem::local(VertexId v) {
  if (is_obstacle(v) || v == kNewVertex) {  // few: searched
    const auto it = std::find(global_.begin(), global_.end(), v);
    if (it != global_.end()) return static_cast<int>(it - global_.begin());
  } else if (!scratch_.known.mark(v)) {
    return scratch_.local_of[v];
  }
  const int id = static_cast<int>(global_.size());
  global_.push_back(v);
  cells_.rest.push_back(rest_position(v));
  if (!is_obstacle(v) && v != kNewVertex) scratch_.local_of[v] = id;
  return id;
}

bool LocalProblem::is_removed_facet(FacetId f) const {
  return apply_edit_ &&
         std::find(edit_->removed_facets.begin(), edit_->removed_facets.end(), f) != edit_->removed_facets.end();
}

void LocalProblem::add_cells(const std::vector<CellId>& patch) {
  scratch_.cells.clear(mesh_.cell_slots());
  cells_.elements.reserve(patch.size() + 4);
  for (const CellId c : patch) {
    scratch_.cells.mark(c);
    if (apply_edit_ && std::find(edit_->removed_cells.begin(), edit_->removed_cells.end(), c) != edit_->removed_cells.end())
      continue;
    std::array<int, 3> vertices;
    for (int k = 0; k < 3; ++k) vertices[k] = local(mesh_.cell(c)[k]);
    cells_.elements.push_back({vertices, mesh_.body(c), mesh_.volume(c), mesh_.inverse_rest_edges(c)});
  }
  if (!apply_edit_) return;
  for (const auto& cell : edit_->inserted_cells) {
    CellSet<2>::Element element{{}, cell.body, 0, {}};
    std::array<Vec<2>, 3> p;
    for (int k = 0; k < 3; ++k) {
      element.vertices[k] = local(cell.vertices[k]);
      p[k] = cells_.rest[element.vertices[k]];
    }
    const Mat<2> edges = edge_matrix<2>(p);
    element.volume = simplex_volume<2>(edges);
    element.inverse_edges = edges.inverse();
    cells_.elements.push_back(element);
  }
}

void LocalProblem::add_loaded_facets() {
  const std::size_t count = global_.size();
  for (std::size_t i = 0; i < count; ++i) {
    const VertexId v = global_[i];
    if (v == kNewVertex) continue;
    for (const FacetId f : mesh_.facets_of(v)) {
      const auto& facet = mesh_.facet(f);
      if (facet[0] != v || !scratch_.known[facet[1]] || is_removed_facet(f)) continue;
      cells_.facets.push_back({{local(facet[0]), local(facet[1])}, mesh_.facet_tag(f)});
    }
  }
  if (apply_edit_)
    for (const auto& facet : edit_->inserted_facets)
      cells_.facets.push_back({{local(facet.vertices[0]), local(facet.vertices[1])}, facet.tag});
}

void LocalProblem::hold_vertices() {
  std::vector<char> held(2 * global_.size(), 0);
  const auto hold_components = [&](std::size_t i, int tag) {
    const auto it = context_.held_components.find(tag);
    if (it == context_.held_components.end()) return;
    for (int c = 0; c < 2; ++c)
      if (it->second[c]) held[2 * i + c] = 1;
  };
  for (std::size_t i = 0; i < global_.size(); ++i) {
    const VertexId v = global_[i];
    if (v == kNewVertex) {
      for (const auto& facet : edit_->inserted_facets)
        if (facet.vertices[0] == v || facet.vertices[1] == v) hold_components(i, facet.tag);
      continue;
    }
    const auto around = mesh_.cells_of(v);
    const bool inside = std::all_of(around.begin(), around.end(), [&](CellId c) { return scratch_.cells[c]; });
    if (!inside) held[2 * i] = held[2 * i + 1] = 1;
    for (const FacetId f : mesh_.facets_of(v)) hold_components(i, mesh_.facet_tag(f));
  }
  dofs_ = DofMap::from_held(held);
}

void LocalProblem::add_surface(SurfaceTree& tree) {
  // Vertices whose contacts can change: free ones, and those whose surface edges the edit replaces.
  std::vector<char> changes(global_.size(), 0);
  for (std::size_t i = 0; i < global_.size(); ++i)
    if (global_[i] != kNewVertex && mesh_.is_boundary(global_[i]))
      changes[i] = dofs_.unknown[2 * i] != kNone || dofs_.unknown[2 * i + 1] != kNone;
  if (edit_) {
    const auto mark = [&](VertexId v) {
      if (v == kNewVertex && !apply_edit_) return;
      if (apply_edit_ && v == edit_->removed_vertex) return;
      changes[local(v)] = 1;
    };
    for (const FacetId f : edit_->removed_facets)
      for (const int v : mesh_.facet(f)) mark(v);
    for (const auto& facet : edit_->inserted_facets)
      for (const int v : facet.vertices) mark(v);
  }
  if (std::find(changes.begin(), changes.end(), 1) == changes.end()) return;
  has_surface_ = true;

  std::vector<FacetId> own;
  for (std::size_t i = 0; i < changes.size(); ++i)
    if (changes[i] && global_[i] != kNewVertex)
      for (const FacetId f : mesh_.facets_of(global_[i]))
        if (!is_removed_facet(f)) own.push_back(f);
  std::sort(own.begin(), own.end());
  own.erase(std::unique(own.begin(), own.end()), own.end());
  Box<2> box;
  double longest = 0;
  const auto position = [&](VertexId v) { return field_value(fields_.x, context_.obstacles.x, v); };
  const auto add_edge = [&](VertexId a, VertexId b) {
    const int i = local(a), j = local(b);
    surface_.edges.push_back({std::min(i, j), std::max(i, j)});
  };
  const auto add_own_edge = [&](VertexId a, VertexId b) {
    add_edge(a, b);
    box.include(position(a));
    box.include(position(b));
    longest = std::max(longest, (position(a) - position(b)).norm());
  };
  for (const FacetId f : own) add_own_edge(mesh_.facet(f)[0], mesh_.facet(f)[1]);
  if (apply_edit_)
    for (const auto& facet : edit_->inserted_facets) add_own_edge(facet.vertices[0], facet.vertices[1]);
  const std::size_t inserted = apply_edit_ ? edit_->inserted_facets.size() : 0;
  std::vector<std::array<int, 2>> changed(surface_.edges.end() - inserted, surface_.edges.end());

  const double room = std::max(2 * context_.contact.activation_distance, 0.25 * longest);
  scratch_.hits.clear();
  tree.query(box.inflated(room + context_.contact.activation_distance), scratch_.hits);
  for (const int hit : scratch_.hits) {
    if (hit < 0) {
      const auto& edge = context_.obstacles.edges[-1 - hit];
      add_edge(-2 - edge[0], -2 - edge[1]);
    } else if (!is_removed_facet(hit) && !std::binary_search(own.begin(), own.end(), hit)) {
      add_edge(mesh_.facet(hit)[0], mesh_.facet(hit)[1]);
    }
  }
  std::sort(surface_.edges.begin(), surface_.edges.end());
  surface_.edges.erase(std::unique(surface_.edges.begin(), surface_.edges.end()), surface_.edges.end());
  for (const auto& edge : changed)
    changed_edges_.push_back(
        static_cast<int>(std::lower_bound(surface_.edges.begin(), surface_.edges.end(), edge) - surface_.edges.begin()));

  dofs_.unknown.resize(2 * global_.size(), kNone);
  surface_.counts.assign(global_.size(), 0);
  std::copy(changes.begin(), changes.end(), surface_.counts.begin());
  weigh_surface();
  bounds_.assign(global_.size(), {});
  for (std::size_t i = 0; i < changes.size(); ++i)
    if (changes[i]) bounds_[i] = box.inflated(room);
}

/// Rest areas and degrees of the surface's vertices on the whole surface, the edit included.
void LocalProblem::weigh_surface() {
  surface_.area.assign(global_.size(), 0);
  surface_.degree.assign(global_.size(), 0);
  std::vector<char> used(global_.size(), 0);
  for (const auto& edge : surface_.edges)
    for (const int i : edge) used[i] = 1;
  for (std::size_t i = 0; i < global_.size(); ++i) {
    if (!used[i]) continue;
    const VertexId v = global_[i];
    surface_.vertices.push_back(static_cast<int>(i));
    if (is_obstacle(v)) {
      surface_.area[i] = context_.obstacles.area[obstacle_index(v)];
      surface_.degree[i] = context_.obstacles.degree[obstacle_index(v)];
      continue;
    }
    const auto add = [&](const std::array<int, 2>& facet) {
      surface_.area[i] += (rest_position(facet[1]) - rest_position(facet[0])).norm() / 2;
      ++surface_.degree[i];
    };
    if (v != kNewVertex)
      for (const FacetId f : mesh_.facets_of(v))
        if (!is_removed_facet(f)) add(mesh_.facet(f));
    if (apply_edit_)
      for (const auto& facet : edit_->inserted_facets)
        if (facet.vertices[0] == v || facet.vertices[1] == v) add(facet.vertices);
  }
}

void LocalProblem::add_terms(HistoryRule history) {
  cells_.num_vertices = static_cast<int>(global_.size());
  x_ = gather(fields_.x, context_.obstacles.x);
  if (context_.has_inertia) {
    auto inertia =
        std::make_shared<InertiaEnergy<2>>(cells_, context_.materials, context_.mass, gather(fields_.predictor, {}));
    const bool nested = !apply_edit_ || edit_->kind == Edit<2>::Kind::split;
    if (!nested && history == HistoryRule::function) add_unrepresented_history(*inertia);
    energy_.add(std::move(inertia));
  }
  const auto elastic = std::make_shared<ElasticEnergy<2>>(cells_, context_.materials, context_.scaling);
  energy_.add(elastic);
  add_damping(DampingOptions::Term::elastic, *elastic);
  if (context_.loads.has_dead_loads())
    energy_.add(std::make_shared<LoadEnergy<2>>(cells_, context_.materials, context_.loads, context_.scaling));
  if (!context_.loads.pressures.empty())
    energy_.add(std::make_shared<PressureEnergy<2>>(cells_, context_.loads, x_, context_.scaling));
  if (!has_surface_) return;
  std::vector<std::pair<int, Box<2>>> bounds;
  for (std::size_t i = 0; i < bounds_.size(); ++i)
    if (surface_.counts[i]) bounds.emplace_back(static_cast<int>(i), bounds_[i]);
  // Before contact, which then looks no further than that.
  energy_.add(std::make_shared<MotionBound>(bounds));
  contact_ =
      std::make_shared<ContactEnergy<2>>(surface_, context_.contact, context_.contact.barrier_stiffness, context_.scaling);
  touches_contact_ = contact_->has_candidates(x_, workspace_);
  energy_.add(contact_);
  add_damping(DampingOptions::Term::contact, *contact_);
  if (!touches_contact_ || context_.contact.friction_coefficient == 0 || context_.contact.friction_iterations == 0) return;
  auto friction =
      std::make_shared<FrictionEnergy<2>>(*contact_, x_, workspace_, context_.contact, velocity_rule(), context_.scaling);
  if (!friction->empty()) energy_.add(std::move(friction));
}

VelocityRule LocalProblem::velocity_rule() const {
  return {context_.velocity_rate, gather(fields_.velocity_reference, context_.obstacles.velocity_reference)};
}

void LocalProblem::add_damping(DampingOptions::Term term, const Energy& damped) {
  for (const DampingOptions& options : context_.damping)
    if (options.term == term)
      energy_.add(std::make_shared<DampingEnergy<2>>(damped, x_, options.coefficient, velocity_rule(), workspace_));
}

void LocalProblem::add_unrepresented_history(InertiaEnergy<2>& inertia) const {
  // Numbering of the removed cells' own: their vertices carry the functions as they were.
  std::vector<VertexId> old_ids, new_ids;
  std::vector<std::array<int, 3>> old_cells, new_cells;
  std::vector<double> old_density, new_density;
  const auto number = [](std::vector<VertexId>& ids, VertexId v) {
    const auto it = std::find(ids.begin(), ids.end(), v);
    if (it != ids.end()) return static_cast<int>(it - ids.begin());
    ids.push_back(v);
    return static_cast<int>(ids.size()) - 1;
  };
  for (const CellId c : edit_->removed_cells) {
    const auto& cell = mesh_.cell(c);
    old_cells.push_back({number(old_ids, cell[0]), number(old_ids, cell[1]), number(old_ids, cell[2])});
    old_density.push_back(context_.materials.at(mesh_.body(c)).density);
  }
  for (const auto& cell : edit_->inserted_cells) {
    const auto& v = cell.vertices;
    new_cells.push_back({number(new_ids, v[0]), number(new_ids, v[1]), number(new_ids, v[2])});
    new_density.push_back(context_.materials.at(cell.body).density);
  }
  std::vector<Vec<2>> old_rest, new_rest;
  for (const VertexId v : old_ids) old_rest.push_back(mesh_.rest(v));
  for (const VertexId v : new_ids) new_rest.push_back(rest_position(v));
  const TransferMesh<2> old_mesh{old_rest, old_cells, old_density}, new_mesh{new_rest, new_cells, new_density};
  MatrixX A;
  patch_cross_mass<2>(old_mesh, new_mesh, A);

  // Constants are in both spaces; without them the squares below lose no digits.
  const Vec<2> shift = field_value(fields_.predictor, {}, new_ids[0]);
  MatrixX old_values(old_ids.size(), 2), new_values(new_ids.size(), 2);
  for (std::size_t i = 0; i < old_ids.size(); ++i)
    old_values.row(i) = (fields_.predictor.segment<2>(2 * old_ids[i]) - shift).transpose();
  for (std::size_t i = 0; i < new_ids.size(); ++i)
    new_values.row(i) = (field_value(fields_.predictor, {}, new_ids[i]) - shift).transpose();
  const auto mass_product = [](const TransferMesh<2>& mesh, const MatrixX& values) {
    MatrixX product = MatrixX::Zero(values.rows(), values.cols());
    for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
      const auto& cell = mesh.cells[c];
      const double mass =
          mesh.density[c] * simplex_volume<2>({mesh.rest[cell[0]], mesh.rest[cell[1]], mesh.rest[cell[2]]}) / 12;
      const Eigen::RowVector2d total = values.row(cell[0]) + values.row(cell[1]) + values.row(cell[2]);
      for (const int v : cell) product.row(v) += mass * (total + values.row(v));
    }
    return product;
  };
  const MatrixX transferred = A * old_values, represented = mass_product(new_mesh, new_values);
  const MatrixX residual = represented - transferred;
  VectorX local_residual = VectorX::Zero(2 * static_cast<int>(global_.size()));
  for (std::size_t i = 0; i < new_ids.size(); ++i)
    local_residual.segment<2>(2 * scratch_.local_of[new_ids[i]]) = residual.row(i).transpose();
  const double loss = 0.5 * (new_values.cwiseProduct(represented - 2 * transferred).sum() +
                             old_values.cwiseProduct(mass_product(old_mesh, old_values)).sum());
  inertia.set_unrepresented_history(std::move(local_residual), std::max(0.0, loss));
}

NewtonSummary LocalProblem::relax(int max_iterations) {
  NewtonOptions options = context_.newton;
  options.max_iterations = max_iterations;
  if (options.norm == NewtonNorm::euclidean) return minimize(energy_, x_, dofs_, VectorX(), system_, options, workspace_);
  const VectorX weights = unit_mass_diagonal(cells_);
  return minimize(energy_, x_, dofs_, VectorX(), system_, options, workspace_, {.norm_weights = &weights});
}

bool LocalProblem::is_free_of_intersections() const {
  const auto p = [&](int v) { return Vec<2>(x_.segment<2>(2 * v)); };
  for (const int e : changed_edges_) {
    const auto [a, b] = surface_.edges[e];
    for (const auto& [c, d] : surface_.edges) {
      if (a == c || a == d || b == c || b == d) continue;
      if (segments_intersect(p(a), p(b), p(c), p(d))) return false;
    }
  }
  return true;
}

void LocalProblem::write_back(VectorX& x, VertexId created) const {
  for (std::size_t i = 0; i < global_.size(); ++i) {
    const VertexId v = global_[i] == kNewVertex ? created : global_[i];
    if (is_obstacle(v)) continue;
    for (int c = 0; c < 2; ++c)
      if (dofs_.unknown[2 * i + c] != kNone) x[2 * v + c] = x_[2 * static_cast<int>(i) + c];
  }
}

}  // namespace itr
