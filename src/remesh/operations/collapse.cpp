// SPDX-License-Identifier: MIT
// Collapses and straightenings. Where both are asked for, they are in one queue by what they are predicted to cost for each
// node that they remove.
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "remesh/edits.hpp"
#include "remesh/schedule/wave.hpp"

namespace itr {

namespace {

/// The most energy that chords may cost, in tolerances of a split. A curved edge that touches has lower energy than its
/// chords because contact does not act beyond them.
constexpr double kMostForChords = 1e6;

template <int Dim>
class Coarsener {
 public:
  Coarsener(RemeshSession<Dim>& session, bool straightens)
      : session_(session),
        ask_(session.ask()),
        options_(ask_.options().collapse),
        straightens_(straightens),
        tolerance_(options_.acceptance_tolerance.value()),
        straighten_tolerance_(ask_.options().straighten_tolerance()) {}

  /// The collapses of `edges`, and the straightenings of those with nodes.
  std::vector<Place> candidates(const std::vector<EdgeKey>& edges) const {
    if (!straightens_) return places(edges);
    std::vector<Place> found;
    for (const EdgeKey& edge : edges) {
      if (options_.enabled) found.push_back(edge);
      if (ask_.mesh().node_of(edge[0], edge[1]) != kNone) found.push_back(Place::node_of(edge));
    }
    return found;
  }

  /// Shortest first, or cheapest first.
  std::optional<PlaceQueue::Entry> rank(const Place& place, LocalScratch<Dim>& scratch) const {
    const EdgeKey edge = place.edge();
    if (place.is_node()) return rank_straighten(edge, scratch);
    if (const auto* baseline = session_.baseline(); baseline && !baseline->may_collapse(edge)) return std::nullopt;
    if (ask_.refuse_collapse(edge) != Refusal::none) return std::nullopt;
    if (!straightens_) return PlaceQueue::Entry{.place = place, .priority = -ask_.rest_length(edge)};
    if (session_.memory().was_refused(RemeshMemory::collapse, edge, ask_.roughness(edge), ask_.is_in_contact(edge, scratch)))
      return std::nullopt;
    const auto proposal = propose_collapse(ask_.mesh(), ask_.strata(), edge);
    if (!proposal)
      return PlaceQueue::Entry{.place = place, .priority = -std::numeric_limits<double>::max()};  // to be counted
    const Edit<Dim>& edit = *proposal.edit;
    return PlaceQueue::Entry{.place = place,
                             .priority = ask_.predict_collapse(edit, tolerance_, scratch) / -edit.added_nodes()};
  }

  void look(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    const EdgeKey edge = trial.edge();
    if (trial.candidate.place.is_node()) return look_at_straighten(trial, scratch);
    if (const Refusal refusal = ask_.refuse_collapse(edge); refusal != Refusal::none) return trial.refuse(refusal);
    if (session_.memory().depth(edge) >= kMostGenerations) return trial.refuse(Refusal::depth);
    trial.signal = ask_.roughness(edge);
    ask_.find_contact(trial, scratch);
    if (session_.memory().was_refused(RemeshMemory::collapse, edge, trial.signal, trial.in_contact)) return;
    trial.is_asked = true;
    if (!trial.take(propose_collapse(ask_.mesh(), ask_.strata(), edge))) return;
    const bool is_known = straightens_ && session_.is_unchanged(trial.candidate);
    const double gain = is_known ? trial.candidate.priority * -trial.edit->added_nodes()
                                 : ask_.predict_collapse(*trial.edit, tolerance_, scratch, &trial.surface_read);
    if (ask_.any_is_curved(trial.edit->removed_cells)) trial.predicted = gain;
    if (!trial.in_contact && ask_.is_hopeless(trial.edit->removed_cells, gain, tolerance_))
      return trial.refuse(Refusal::prediction);
    ask_.judge(trial, tolerance_, ask_.options().local, scratch);
  }

  void settle(Trial<Dim>& trial, std::vector<Place>& fresh) {
    const bool straightens = trial.candidate.place.is_node();
    OperationCount& count = straightens ? session_.report().straightens : session_.report().collapses;
    count.note(trial.verdict.refusal);
    if (!trial.is_asked) return;
    if (session_.commits().commit(trial, count)) return straightens ? add_changed(trial, fresh) : add_around(trial, fresh);
    const Refusal refusal = trial.verdict.refusal;
    if (refusal != Refusal::prediction && refusal != Refusal::bound && refusal != Refusal::energy) return;
    constexpr double kNever = std::numeric_limits<double>::infinity();  // a rougher field, a rounder edge lose more
    session_.memory().remember(
        straightens ? RemeshMemory::straighten : RemeshMemory::collapse, trial.edge(),
        {trial.signal / kSameSignal, trial.in_contact ? trial.signal * kSameSignal : kNever, trial.in_contact});
  }

 private:
  std::optional<PlaceQueue::Entry> rank_straighten(const EdgeKey& edge, LocalScratch<Dim>& scratch) const {
    if (ask_.refuse_straighten(edge) != Refusal::none) return std::nullopt;
    const double gain = ask_.predict_straighten(edge, scratch);
    const bool in_contact = ask_.is_in_contact(edge, scratch);
    const bool was_refused = session_.memory().was_refused(RemeshMemory::straighten, edge, std::abs(gain), in_contact);
    if (was_refused && !ask_.overhangs(edge, scratch) && !ask_.is_distorted(ask_.mesh().cells_of_edge(edge)))
      return std::nullopt;
    return PlaceQueue::Entry{.place = Place::node_of(edge), .priority = gain};
  }

  void look_at_straighten(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    const EdgeKey edge = trial.edge();
    if (const Refusal refusal = ask_.refuse_straighten(edge); refusal != Refusal::none) return trial.refuse(refusal);
    ask_.find_contact(trial, scratch);
    const double gain = session_.is_unchanged(trial.candidate) ? trial.candidate.priority
                                                               : ask_.predict_straighten(edge, scratch, &trial.surface_read);
    trial.signal = std::abs(gain);
    trial.predicted = gain;
    trial.edit = make_straighten(ask_.mesh(), edge);
    const bool overhangs = ask_.overhangs(edge, scratch);
    const double tolerance = overhangs || ask_.is_distorted(trial.edit->removed_cells)
                                 ? std::min(straighten_tolerance_, -ask_.options().split.acceptance_tolerance.value())
                                 : straighten_tolerance_;
    if (!overhangs && !trial.in_contact && ask_.is_hopeless(trial.edit->removed_cells, gain, tolerance))
      return trial.refuse(Refusal::prediction);
    ask_.judge(trial, tolerance, ask_.options().local, scratch);
    if (!overhangs || trial.verdict.accepted() || ask_.refuse_chords(edge) != Refusal::none) return;
    trial.edit = make_chords(ask_.mesh(), edge);
    ask_.judge(trial, kMostForChords * tolerance, ask_.options().local, scratch);
  }

  void add(const std::vector<EdgeKey>& edges, std::vector<Place>& fresh) const {
    const auto found = candidates(edges);
    fresh.insert(fresh.end(), found.begin(), found.end());
  }
  void add_changed(const Trial<Dim>& trial, std::vector<Place>& fresh) const {
    const auto changed = std::span<const CellId>(trial.verdict.patch).last(trial.edit->inserted_cells.size());
    add(edges_of<Dim>(ask_.mesh(), changed), fresh);
  }
  void add_around(const Trial<Dim>& trial, std::vector<Place>& fresh) {
    const VertexId kept = trial.edit->value->vertex;
    const int generation = session_.memory().depth(trial.edge()) + 1;
    const auto near = edges_of<Dim>(ask_.mesh(), ask_.mesh().cells_of(kept));
    for (const EdgeKey& edge : near)
      if (edge[0] == kept || edge[1] == kept) session_.memory().set_depth(edge, generation);
    add(near, fresh);
  }

  RemeshSession<Dim>& session_;
  const RemeshQueries<Dim>& ask_;
  const CollapseOptions& options_;
  bool straightens_;
  double tolerance_, straighten_tolerance_;  ///< [J]
};

}  // namespace

template <int Dim>
void coarsen_edges(RemeshSession<Dim>& session) {
  const Mesh<Dim>& mesh = session.ask().mesh();
  Coarsener<Dim> coarsener(session, session.ask().options().straighten.enabled && mesh.has_nodes());
  run_waves(session, coarsener, coarsener.candidates(mesh.edges()));
  session.memory().forget_depths();
}

template void coarsen_edges(RemeshSession<2>&);
template void coarsen_edges(RemeshSession<3>&);

}  // namespace itr
