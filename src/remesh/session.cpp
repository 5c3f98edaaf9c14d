// SPDX-License-Identifier: MIT
#include "session.hpp"

#include <algorithm>
#include <cmath>

#include <boost/container/small_vector.hpp>
#include "itr/core/check.hpp"
#include "itr/core/timer.hpp"
#include "itr/mesh/validate.hpp"
#include "itr/remesh/edits.hpp"
#include "prospect.hpp"

namespace itr {

template <int Dim>
RemeshSession<Dim>::RemeshSession(Mesh<Dim>& mesh, RemeshFields<Dim>& fields, const StepContext<Dim>& context,
                                  const RemeshOptions& options, const RemeshMemory& memory, Strata<Dim>& strata)
    : mesh_(mesh),
      fields_(fields),
      context_(context),
      options_(options),
      total_volume_(mesh.total_volume()),
      gate_(mesh, fields, context),
      strata_(strata),
      lanes_(context.host.empty() ? num_threads() : 1),  // terms of the program may not be for several threads
      refusals_(memory),
      changed_at_(mesh.vertex_slots(), 0) {
  if (strata.empty()) strata = Strata<Dim>(mesh);
  ITR_AUDIT(strata.find_defect(mesh).empty(), strata.find_defect(mesh));
}

template <int Dim>
bool RemeshSession<Dim>::is_surface(const EdgeKey& e) const {
  const auto facets = mesh_.facets_of(e[0]);
  return std::any_of(facets.begin(), facets.end(), [&](FacetId f) {
    return std::find(mesh_.facet(f).begin(), mesh_.facet(f).end(), e[1]) != mesh_.facet(f).end();
  });
}

template <int Dim>
bool RemeshSession<Dim>::may_be_split(const EdgeKey& e, bool& is_bound_by_dhat) const {
  if (!exists(e) || rest_length(e) < options_.split.min_edge_length.value()) return false;
  if (!has_contact() || !is_surface(e)) return true;
  const double dhat = context_.contact.activation_distance;
  is_bound_by_dhat = rest_length(e) < 2 * dhat || length(e) < 2 * dhat;
  return !is_bound_by_dhat;
}

template <int Dim>
bool RemeshSession<Dim>::may_be_collapsed(const EdgeKey& e) const {
  const double longest = longest_collapse(options_.collapse, context_);
  if (!exists(e) || rest_length(e) > longest) return false;
  const auto around = mesh_.cells_of_edge(e);
  return std::any_of(around.begin(), around.end(), [&](CellId c) { return is_small(mesh_, c, longest); });
}

template <int Dim>
bool RemeshSession<Dim>::is_in_contact(const EdgeKey& e, LocalScratch<Dim>& scratch) const {
  if (!has_contact()) return false;
  const double dhat = context_.contact.activation_distance;
  const auto facets = mesh_.facets_of(e[0]);
  return std::any_of(facets.begin(), facets.end(), [&](FacetId f) {
    return std::find(mesh_.facet(f).begin(), mesh_.facet(f).end(), e[1]) != mesh_.facet(f).end() &&
           scratch.neighbourhoods.is_in_contact(gate_.present(), f, dhat, scratch.hits);
  });
}

template <int Dim>
void RemeshSession<Dim>::find_contact(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
  trial.in_contact = is_in_contact(trial.edge(), scratch);
  if (!has_contact() || !is_surface(trial.edge())) return;
  Box<Dim> edge;
  for (const FacetId f : mesh_.facets_of(trial.edge()[0]))
    for (const VertexId v : mesh_.facet(f)) edge.include(gate_.present().at(v));
  trial.surface_read.include(edge.inflated(context_.contact.activation_distance));
}

template <int Dim>
typename RemeshSession<Dim>::PieceInContact RemeshSession<Dim>::piece(FacetId f) const {
  PieceInContact piece{gate_.present().piece(f), {}};
  for (const int v : mesh_.facet(f)) piece.rest.add(mesh_.rest(v), v);
  return piece;
}

template <int Dim>
std::vector<typename RemeshSession<Dim>::PieceInContact> RemeshSession<Dim>::pieces_in_contact(
    FacetId f, LocalScratch<Dim>& scratch) const {
  const SurfaceIndex<Dim>& surface = gate_.present();
  const double dhat = context_.contact.activation_distance;
  std::vector<PieceInContact> pieces;
  for (const auto& [other, distance] : scratch.neighbourhoods.near(surface, f, dhat, scratch.hits)) {
    if (distance >= dhat) continue;
    if (other >= 0) {
      pieces.push_back(piece(other));
      continue;
    }
    const int primitive = Neighbourhoods<Dim>::of_obstacle(other);
    PieceInContact& obstacle = pieces.emplace_back(PieceInContact{surface.obstacle_piece(primitive), {}});
    for (const int v : surface.primitives().all[primitive].ids())
      obstacle.rest.add(context_.obstacles.rest[v], SurfacePiece<Dim>::id_of_obstacle(v));
  }
  return pieces;
}

template <int Dim>
bool RemeshSession<Dim>::apply_if_valid(const Edit<Dim>& edit) {
  Verdict<Dim> verdict;
  if (!gate_.passes(edit, scratch().gate)) return false;
  commit(edit, verdict);
  return true;
}

template <int Dim>
std::vector<EdgeKey> RemeshSession<Dim>::edges_of(std::span<const CellId> cells) const {
  std::vector<EdgeKey> edges;
  for (const CellId c : cells) {
    if (!mesh_.is_cell_alive(c)) continue;
    const auto& cell = mesh_.cell(c);
    for (int i = 0; i <= Dim; ++i)
      for (int j = i + 1; j <= Dim; ++j) edges.push_back({std::min(cell[i], cell[j]), std::max(cell[i], cell[j])});
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

template <int Dim>
double RemeshSession<Dim>::roughness(const EdgeKey& edge) const {
  const auto& at_first = mesh_.cells_of(edge[0]);
  boost::container::small_vector<CellId, Dim == 2 ? 16 : 64> around(at_first.begin(), at_first.end());
  if (edge[1] != kNone)
    for (const CellId c : mesh_.cells_of(edge[1]))
      if (std::find(mesh_.cell(c).begin(), mesh_.cell(c).end(), edge[0]) == mesh_.cell(c).end()) around.push_back(c);
  const auto variation = [&](const VectorX& field, auto&& weight) {
    Mat<Dim> sum = Mat<Dim>::Zero();
    double total = 0, squares = 0;
    for (const CellId c : around) {
      const Mat<Dim> gradient = deformation_gradient<Dim>(element_of(mesh_, c), field);
      const double w = weight(c);
      sum += w * gradient;
      squares += w * gradient.squaredNorm();
      total += w;
    }
    return std::max(0.0, squares - sum.squaredNorm() / total);
  };
  const auto stiffness = [&](CellId c) { return mesh_.volume(c) * context_.materials.at(mesh_.body(c)).youngs_modulus; };
  double result = context_.scaling * variation(fields_.x, stiffness);
  if (context_.has_inertia) {
    const double size =
        edge[1] == kNone ? mesh_.volume(around[0]) : (mesh_.rest(edge[0]) - mesh_.rest(edge[1])).squaredNorm();
    const auto mass = [&](CellId c) { return size * mesh_.volume(c) * context_.materials.at(mesh_.body(c)).density; };
    result += variation(fields_.predictor, mass);
  }
  return result;
}

template <int Dim>
void RemeshSession<Dim>::mark_gains() {
  gained_.clear(mesh_.vertex_slots());
  for (VertexId v = 0; v < mesh_.vertex_slots(); ++v)
    if (changed_at_[v] > 0) gained_.mark(v);
}

template <int Dim>
bool RemeshSession<Dim>::shape_matters(const EdgeKey& e, double roughness) const {
  if (!screens() || roughness >= context_.scaling * least_worthwhile()) return true;
  if (gained_[e[0]] || (e[1] != kNone && gained_[e[1]])) return true;
  const auto around = mesh_.cells_of(e[0]);
  return std::any_of(around.begin(), around.end(), [&](CellId c) {
    const auto& cell = mesh_.cell(c);
    return (e[1] == kNone || std::find(cell.begin(), cell.end(), e[1]) != cell.end()) &&
           mesh_.quality(c) < QualityRule{}.floor;
  });
}

template <int Dim>
double RemeshSession<Dim>::largest_poisson_ratio(std::span<const CellId> cells) const {
  double nu = 0;
  for (const CellId c : cells) nu = std::max(nu, context_.materials.at(mesh_.body(c)).poisson_ratio);
  return nu;
}

template <int Dim>
void RemeshSession<Dim>::judge(Trial<Dim>& trial, const Vec<Dim>& center, double tolerance,
                               const LocalRelaxationOptions& local, LocalScratch<Dim>& scratch) const {
  const ScopedTimer timer(trial.seconds);
  const RemeshState<Dim> state = this->state();
  const Edit<Dim>& edit = *trial.edit;
  TrialOptions options{.required = context_.scaling * tolerance, .local = local};
  if (options_.screening == Screening::bounds && edit.kind != Edit<Dim>::Kind::smooth && edit.value)
    options.patch_over_vertex = patch_over_vertex<Dim>(largest_poisson_ratio(edit.removed_cells));
  trial.is_asked = trial.was_previewed = true;
  preview<Dim>(state, gate_, edit, center, total_volume_, options, scratch, trial.verdict);
  trial.surface_read.include(trial.verdict.surface_read);
}

template <int Dim>
void RemeshSession<Dim>::begin_wave() {
  commits_before_wave_ = commits_;
  written_.clear(mesh_.vertex_slots());
  surface_written_.clear();
}

template <int Dim>
bool RemeshSession<Dim>::was_overtaken(const Trial<Dim>& trial) const {
  if (commits_ == commits_before_wave_) return false;
  const bool reads_past_surface = has_contact() && trial.edit && trial.edit->kind != Edit<Dim>::Kind::split &&
                                  !trial.edit->inserted_facets.empty();  // see Gate
  if (reads_past_surface && !surface_written_.empty()) return true;
  if (std::any_of(surface_written_.begin(), surface_written_.end(),
                  [&](const Box<Dim>& box) { return box.overlaps(trial.surface_read); }))
    return true;
  return std::any_of(trial.verdict.patch.begin(), trial.verdict.patch.end(), [&](CellId c) {
    const auto& cell = mesh_.cell(c);
    return !mesh_.is_cell_alive(c) || std::any_of(cell.begin(), cell.end(), [&](VertexId v) { return written_[v]; });
  });
}

template <int Dim>
bool RemeshSession<Dim>::commit(Trial<Dim>& trial, OperationCount& count) {
  if (trial.was_previewed) trial_seconds_.push_back(trial.seconds);
  ++count.tried;
  count.relaxed += trial.verdict.was_relaxed;
  count.accepted += trial.verdict.accepted();
  if (trial.verdict.accepted()) commit(*trial.edit, trial.verdict);
  return trial.verdict.accepted();
}

template <int Dim>
void RemeshSession<Dim>::commit(const Edit<Dim>& edit, Verdict<Dim>& verdict) {
  ++commits_;
  for (const CellId c : edit.removed_cells)
    for (const VertexId v : mesh_.cell(c)) mark_written(v);
  Box<Dim> surface;
  const auto include_facets_at = [&](VertexId v) {
    for (const FacetId f : mesh_.facets_of(v))
      for (const VertexId w : mesh_.facet(f)) surface.include(gate_.present().at(w));
  };
  if (has_contact()) {
    for (const FacetId f : edit.removed_facets) include_facets_at(mesh_.facet(f)[0]);
    for (const auto& [v, x] : verdict.positions)
      if (v != kNewVertex) include_facets_at(v);
  }

  const int first_cell = mesh_.cell_slots(), first_facet = mesh_.facet_slots();
  const VertexId created = mesh_.apply(edit);
  fields_.make_room(mesh_.vertex_slots());
  fields_.follow(edit, created);
  gate_.follow(edit, first_facet);
  strata_.follow(edit, created);
  changed_at_.resize(mesh_.vertex_slots(), 0);
  for (const auto& [v, x] : verdict.positions) {
    const VertexId vertex = v == kNewVertex ? created : v;
    fields_.x.template segment<Dim>(Dim * vertex) = x;
    if (has_contact()) gate_.move(vertex);
    mark_written(vertex);
  }
  const std::size_t first = verdict.patch.size();
  for (int c = first_cell; c < mesh_.cell_slots(); ++c) {
    verdict.patch.push_back(c);
    for (const VertexId v : mesh_.cell(c)) mark_written(v);
  }
  if (has_contact()) {
    for (const auto& [v, x] : verdict.positions) include_facets_at(v == kNewVertex ? created : v);
    for (FacetId f = first_facet; f < mesh_.facet_slots(); ++f) include_facets_at(mesh_.facet(f)[0]);
    if (surface.min[0] <= surface.max[0]) surface_written_.push_back(surface);
  }
  for (const EdgeKey& edge : edges_of(std::span(verdict.patch).subspan(first))) refusals_.forget(edge);
  ITR_AUDIT(mesh_.find_defect().empty(), mesh_.find_defect());
  ITR_AUDIT(find_inverted<Dim>(mesh_, fields_.x) == kNone);
}

template <int Dim>
void RemeshSession<Dim>::mark_written(VertexId v) {
  written_.mark(v);
  changed_at_[v] = commits_;
  for (const CellId c : mesh_.cells_of(v))
    for (const VertexId w : mesh_.cell(c)) changed_at_[w] = commits_;
}

template <int Dim>
double RemeshSession<Dim>::median_trial_seconds() {
  if (trial_seconds_.empty()) return 0;
  const auto middle = trial_seconds_.begin() + static_cast<std::ptrdiff_t>(trial_seconds_.size() / 2);
  std::nth_element(trial_seconds_.begin(), middle, trial_seconds_.end());
  return *middle;
}

template class RemeshSession<2>;
template class RemeshSession<3>;

}  // namespace itr
