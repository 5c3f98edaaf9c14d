// SPDX-License-Identifier: MIT
#include "queries.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <boost/container/small_vector.hpp>
#include "core/profile.hpp"
#include "core/timer.hpp"
#include "energy/rigid_body.hpp"
#include "fem/chords.hpp"
#include "prospect.hpp"
#include "remesh/edits.hpp"
#include "remesh/placed_cell.hpp"

namespace itr {

template <int Dim>
std::vector<EdgeKey> edges_of(const Mesh<Dim>& mesh, std::span<const CellId> cells) {
  std::vector<EdgeKey> edges;
  for (const CellId c : cells) {
    if (!mesh.is_cell_alive(c)) continue;
    const auto& cell = mesh.cell(c);
    for (int i = 0; i <= Dim; ++i)
      for (int j = i + 1; j <= Dim; ++j) edges.push_back(edge_key(cell[i], cell[j]));
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

template <int Dim>
bool RemeshQueries<Dim>::exists(const Candidate& candidate) const {
  const auto vertices = candidate.vertices();
  if (!std::ranges::all_of(vertices, [&](VertexId v) { return mesh_.is_vertex_alive(v); })) return false;
  if (const auto cells = mesh_.cells_of(vertices[0]);
      !cells.empty() && rigid_body_of(context_.materials.at(mesh_.body(cells[0]))))
    return false;
  if (vertices.size() < 3) return vertices.size() == 1 || mesh_.are_joined(vertices[0], vertices[1]);
  return std::ranges::any_of(mesh_.cells_of(vertices[0]), [&](CellId c) {
    const auto& cell = mesh_.cell(c);
    return std::ranges::all_of(vertices, [&](VertexId v) { return std::ranges::find(cell, v) != cell.end(); });
  });
}

template <int Dim>
Refusal RemeshQueries<Dim>::refuse_split(const EdgeKey& e) const {
  if (rest_length(e) < options_.split.min_edge_length.value()) return Refusal::length;
  if (!has_contact() || !is_surface(e)) return Refusal::none;
  return has_short_halves(e) || makes_short_chords(e) ? Refusal::dhat : Refusal::none;
}

template <int Dim>
bool RemeshQueries<Dim>::has_short_halves(const EdgeKey& e) const {
  const double dhat = context_.contact.dhat;
  const auto x = [&](VertexId v) { return fields_.x.template segment<Dim>(Dim * v); };
  return rest_length(e) < 2 * dhat || (x(e[0]) - x(e[1])).norm() < 2 * dhat;
}

template <int Dim>
bool RemeshQueries<Dim>::makes_short_chords(const EdgeKey& e) const {
  if (!mesh_.has_nodes()) return false;
  const double dhat = context_.contact.dhat;
  const Edit<Dim> edit = make_split(mesh_, e);
  const auto rest = [&](VertexId v) { return rest_after(mesh_, edit, v); };
  const auto x = [&](VertexId v) { return fields_.after(fields_.x, edit, v); };
  const auto is_on_surface = [&](const EdgeKey& edge) {
    return std::any_of(edit.inserted_facets.begin(), edit.inserted_facets.end(), [&](const auto& facet) {
      const auto has = [&](VertexId v) { return std::find(facet.vertices.begin(), facet.vertices.end(), v); };
      return has(edge[0]) != facet.vertices.end() && has(edge[1]) != facet.vertices.end();
    });
  };
  return std::any_of(edit.inserted_nodes.begin(), edit.inserted_nodes.end(), [&](const auto& node) {
    if (!is_on_surface(node.edge)) return false;
    const Vec<Dim> middle = fields_.interpolate(fields_.x, node);
    return (rest(node.edge[0]) - rest(node.edge[1])).norm() < 2 * dhat || (x(node.edge[0]) - middle).norm() < dhat ||
           (x(node.edge[1]) - middle).norm() < dhat;
  });
}

template <int Dim>
Refusal RemeshQueries<Dim>::refuse_collapse(const EdgeKey& e) const {
  const double longest = longest_collapse(options_.collapse, context_);
  if (rest_length(e) > longest) return Refusal::length;
  const auto around = mesh_.cells_of_edge(e);
  const bool is_one_small = std::any_of(around.begin(), around.end(), [&](CellId c) { return is_small(mesh_, c, longest); });
  return is_one_small ? Refusal::none : Refusal::length;
}

template <int Dim>
Refusal RemeshQueries<Dim>::refuse_curve(const EdgeKey& e) const {
  if (mesh_.node_of(e[0], e[1]) != kNone) return Refusal::not_asked;
  return has_contact() && is_surface(e) && has_short_halves(e) ? Refusal::dhat : Refusal::none;
}

template <int Dim>
Refusal RemeshQueries<Dim>::refuse_chords(const EdgeKey& e) const {
  if (!options_.split.enabled) return Refusal::not_asked;
  if (rest_length(e) < options_.split.min_edge_length.value()) return Refusal::length;
  return has_short_halves(e) ? Refusal::dhat : Refusal::none;
}

template <int Dim>
double RemeshQueries<Dim>::overhang(const EdgeKey& e) const {
  const VertexId node = has_contact() ? mesh_.node_of(e[0], e[1]) : kNone;
  double largest = 0;
  if (node == kNone) return largest;
  const auto at = [&](VertexId v) -> Vec<Dim> { return fields_.x.template segment<Dim>(Dim * v); };
  any_facet_at(e, [&](FacetId f) {
    const auto& facet = mesh_.facet(f);
    const auto index = [&](VertexId v) {
      return static_cast<int>(std::find(facet.begin(), facet.end(), v) - facet.begin());
    };
    std::array<Vec<Dim>, Dim> corners;
    for (int k = 0; k < Dim; ++k) corners[k] = at(facet[k]);
    largest = std::max(largest, distance_from_chords<Dim>(corners, index(e[0]), index(e[1]), at(node)));
    return false;
  });
  return largest;
}

template <int Dim>
double RemeshQueries<Dim>::reach(const EdgeKey& e) const {
  const auto at = [](const VectorX& field, VertexId v) { return field.segment<Dim>(Dim * v); };
  double motion = 0;
  if (!fields_.past_positions.empty() && context_.has_inertia)
    for (const VertexId v : e) motion = std::max(motion, (at(fields_.x, v) - at(fields_.past_positions[0], v)).norm());
  return context_.contact.dhat + motion;
}

template <int Dim>
bool RemeshQueries<Dim>::overhangs(const EdgeKey& e, LocalScratch<Dim>& scratch) const {
  const double height = overhang(e);
  return height > kMostOverhang * context_.contact.dhat && touches_within(e, reach(e) + height, scratch);
}

template <int Dim>
bool RemeshQueries<Dim>::is_distorted(std::span<const CellId> cells) const {
  return std::any_of(cells.begin(), cells.end(), [&](CellId c) {
    const CurvedCell<Dim> cell = cell_before(mesh_, c);
    return cell.edges && relative_jacobian<Dim>(cell.values(fields_.x, no_edit<Dim>())) < kLeastRelativeJacobian;
  });
}

template <int Dim>
double RemeshQueries<Dim>::predict_straighten(const EdgeKey& edge, LocalScratch<Dim>& scratch,
                                              Box<Dim>* surface_read) const {
  const double gain = is_in_contact({OperationKind::straighten, edge}, scratch)
                          ? std::numeric_limits<double>::quiet_NaN()
                          : itr::predict_straighten<Dim>(state(), edge);
  return std::isnan(gain) ? gain_of_vertex<Dim>(state(), make_straighten(mesh_, edge), scratch, surface_read) : gain;
}

template <int Dim>
double RemeshQueries<Dim>::predict_collapse(const Edit<Dim>& edit, double tolerance, LocalScratch<Dim>& scratch,
                                            Box<Dim>* surface_read) const {
  if (!any_is_curved(edit.removed_cells)) return predict(edit);
  if (context_.has_inertia) {
    const double most = gain_of_vertex<Dim>(state(HistoryRule::interpolated), edit, scratch, surface_read);
    if (is_hopeless(most, itr::patch_over_vertex<Dim>(largest_poisson_ratio(edit.removed_cells)), tolerance)) return most;
  }
  return gain_of_vertex<Dim>(state(), edit, scratch, surface_read);
}

template <int Dim>
double RemeshQueries<Dim>::predict_split(const EdgeKey& edge, LocalScratch<Dim>& scratch, Box<Dim>* surface_read) const {
  const bool is_curved = mesh_.has_nodes() && any_is_curved(mesh_.cells_of_edge(edge));
  // Splits and curves stand in one queue: what the predictions cannot tell, local solves do of both.
  const bool is_averaged = patches_ && patches_->act_in(mesh_.cells_of_edge(edge));
  if (is_averaged || ((is_curved || options_.curve.enabled) && !is_predictable(context_)))
    return gain_of_vertex<Dim>(state(), make_split(mesh_, edge), scratch, surface_read);
  if (!is_curved) return itr::predict_split<Dim>(state(), edge);
  const double gain = itr::predict_split_at_curves<Dim>(state(), edge);
  return std::isnan(gain) ? gain_of_vertex<Dim>(state(), make_split(mesh_, edge), scratch, surface_read) : gain;
}

template <int Dim>
double RemeshQueries<Dim>::predict_curve(const EdgeKey& edge, LocalScratch<Dim>& scratch, Box<Dim>* surface_read) const {
  const double gain = itr::predict_curve<Dim>(state(), edge);
  return std::isnan(gain) ? gain_of_vertex<Dim>(state(), make_curve(mesh_, edge), scratch, surface_read) : gain;
}

template <int Dim>
std::optional<double> RemeshQueries<Dim>::patch_over_refinement(const Trial<Dim>& trial) const {
  const auto cells = cells_of(trial);
  const bool is_curved = options_.curve.enabled || any_is_curved(cells);
  if (trial.in_contact) return is_curved ? std::optional(kPatchOverPredictionInContact<Dim>) : std::nullopt;
  const double nu = largest_poisson_ratio(cells);
  return is_curved ? patch_over_nodes<Dim>(nu) : itr::patch_over_vertex<Dim>(nu);
}

template <int Dim>
bool RemeshQueries<Dim>::touches_within(const EdgeKey& e, double distance, LocalScratch<Dim>& scratch) const {
  const double seen = std::min(distance, gate_.present().span());
  return any_facet_at(
      e, [&](FacetId f) { return scratch.neighbourhoods.is_in_contact(gate_.present(), f, seen, scratch.hits); });
}

template <int Dim>
void RemeshQueries<Dim>::find_contact(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
  trial.in_contact = is_in_contact(trial.candidate(), scratch);
  if (!has_contact() || !trial.candidate().is_edge() || !is_surface(trial.edge())) return;
  Box<Dim> edge;
  for (const FacetId f : mesh_.facets_of(trial.edge()[0])) edge.include(gate_.present().box_of(f));
  trial.surface_read.include(edge.inflated(reach(trial.edge()) + overhang(trial.edge())));
}

template <int Dim>
double RemeshQueries<Dim>::roughness(const Candidate& candidate) const {
  const auto vertices = candidate.vertices();
  const auto& at_first = mesh_.cells_of(vertices[0]);
  boost::container::small_vector<CellId, Dim == 2 ? 16 : 64> around(at_first.begin(), at_first.end());
  for (std::size_t i = 1; i < vertices.size(); ++i)
    for (const CellId c : mesh_.cells_of(vertices[i]))
      if (std::ranges::find_first_of(mesh_.cell(c), vertices.first(i)) == mesh_.cell(c).end()) around.push_back(c);
  const auto variation = [&](const VectorX& field, auto&& weight) {
    Mat<Dim> sum = Mat<Dim>::Zero();
    double total = 0, squares = 0;
    for (const CellId c : around) {
      const auto element = element_of(mesh_, c);
      const double w = weight(c);
      for_each_gradient<Dim>(element, field, [&](const Mat<Dim>& gradient, double fraction) {
        sum += fraction * w * gradient;
        squares += fraction * w * gradient.squaredNorm();
      });
      total += w;
    }
    return std::max(0.0, squares - sum.squaredNorm() / total);
  };
  const auto stiffness = [&](CellId c) { return mesh_.volume(c) * context_.materials.at(mesh_.body(c)).youngs_modulus; };
  double result = context_.scaling * variation(fields_.x, stiffness);
  if (context_.has_inertia) {
    const double size =
        vertices.size() == 1 ? mesh_.volume(around[0]) : (mesh_.rest(vertices[0]) - mesh_.rest(vertices[1])).squaredNorm();
    const auto mass = [&](CellId c) { return size * mesh_.volume(c) * context_.materials.at(mesh_.body(c)).density; };
    result += variation(fields_.predictor, mass);
  }
  return result;
}

template <int Dim>
double RemeshQueries<Dim>::largest_poisson_ratio(std::span<const CellId> cells) const {
  double nu = 0;
  for (const CellId c : cells)  // where the volume is averaged, what is left in the cells has about none
    if (!patches_ || patches_->shares(c).empty()) nu = std::max(nu, context_.materials.at(mesh_.body(c)).poisson_ratio);
  return nu;
}

/// Whether the edit changes facets, or curves along facets, of surfaces that are kept.
template <int Dim>
bool changes_kept(const Mesh<Dim>& mesh, const Edit<Dim>& edit, const std::vector<int>& kept) {
  if (kept.empty()) return false;
  const auto is_kept = [&](FacetId f) { return std::ranges::find(kept, mesh.facet_tag(f)) != kept.end(); };
  const auto is_old = [&](VertexId v) { return v >= 0 && v < mesh.node_slots(); };
  const auto is_along = [&](const EdgeKey& edge) {
    return is_old(edge[0]) && is_old(edge[1]) && std::ranges::any_of(mesh.facets_of_edge(edge), is_kept);
  };
  return std::ranges::any_of(edit.removed_facets, is_kept) || std::ranges::any_of(edit.removed_nodes, is_along) ||
         std::ranges::any_of(edit.inserted_nodes, [&](const auto& node) { return is_along(node.edge); }) ||
         (edit.value && is_old(edit.value->vertex) && std::ranges::any_of(mesh.facets_of(edit.value->vertex), is_kept));
}

template <int Dim>
void RemeshQueries<Dim>::judge(Trial<Dim>& trial, const LocalRelaxationOptions& local, LocalScratch<Dim>& scratch) const {
  const ScopedTimer timer(trial.seconds);
  const auto phase = ScopedPhase::coarse("local trials");
  const RemeshState<Dim> state = this->state();
  const Edit<Dim>& edit = *trial.edit;
  if (changes_kept(mesh_, edit, context_.kept_surfaces)) return trial.refuse(Refusal::held);
  const bool moves = edit.kind == Edit<Dim>::Kind::smooth;
  const bool is_refined = edit.kind == Edit<Dim>::Kind::split || edit.kind == Edit<Dim>::Kind::curve;
  TrialOptions options{.required = context_.scaling * trial.tolerance, .local = local};
  // The vertex or nodes that a move or a swap sets do not tell what the vertices around gain.
  if ((!baseline_ || baseline_->has_bounds()) && !moves && edit.kind != Edit<Dim>::Kind::swap)
    options.patch_over_vertex = is_refined && !trial.in_contact ? *patch_over_refinement(trial) : patch_over_vertex(trial);
  const bool is_curved = any_is_curved(edit.removed_cells) || !edit.inserted_nodes.empty();
  if (is_curved && !trial.in_contact) options.predicted = trial.gain;
  trial.was_previewed = true;
  preview<Dim>(state, gate_, edit, options, scratch, trial.verdict);
  trial.surface_read.include(trial.verdict.surface_read);
}

template std::vector<EdgeKey> edges_of(const Mesh<2>&, std::span<const CellId>);
template std::vector<EdgeKey> edges_of(const Mesh<3>&, std::span<const CellId>);
template class RemeshQueries<2>;
template class RemeshQueries<3>;

}  // namespace itr
