// SPDX-License-Identifier: MIT
#include <algorithm>
#include <span>
#include <unordered_map>

#include "remesh/edits/edit_checks.hpp"
#include "remesh/schedule/wave.hpp"

namespace itr {

namespace {

int valence(const Mesh<2>& mesh, VertexId v) {
  return static_cast<int>(mesh.cells_of(v).size()) + (mesh.is_boundary(v) ? 1 : 0);
}

/// By how much a swap brings the valences of its quadrilateral nearer to 6 (4 on the boundary).
double valence_gain(const Mesh<2>& mesh, const EdgeKey& edge) {
  double gain = 0;
  const auto badness = [&](VertexId v, int change) {
    const double off = valence(mesh, v) + change - (mesh.is_boundary(v) ? 4 : 6);
    return off * off;
  };
  for (const int v : edge) gain += badness(v, 0) - badness(v, -1);
  for (const CellId c : mesh.cells_of_edge(edge))
    for (const int v : mesh.cell(c))
      if (v != edge[0] && v != edge[1]) gain += badness(v, 0) - badness(v, 1);
  return gain;
}

constexpr double kBetter = 1.2;  ///< of the worst quality: by how much a swap betters a shape

/// Worst quality of the cells that an edit makes over that of those that it removes.
double shape_gain(const Mesh<3>& mesh, const Edit<3>& edit) {
  double after = 1;
  for (const auto& cell : edit.inserted_cells)
    after = std::min(after, quality_with<3>(mesh, cell.vertices, kNone, Vec<3>::Zero()));
  return after / worst_quality<3>(mesh, edit.removed_cells);
}

/// Least gain of a swap that does not improve the shape [J].
template <int Dim>
double least_gain(const RemeshQueries<Dim>& ask) {
  return std::max(ask.least_worthwhile(), ask.options().swap.acceptance_tolerance.value());
}

/// Least gain of a swap [J]: `least`, and for each node that it adds that of a curve.
template <int Dim>
double with_nodes(const RemeshQueries<Dim>& ask, const Edit<Dim>& edit, double least) {
  const int added = edit.added_nodes();
  return added <= 0 ? least : least + added * ask.options().curve_tolerance();
}

/// Whether the prediction from bulk terms reaches `least` [J].
template <int Dim>
bool is_promising(const RemeshQueries<Dim>& ask, const Edit<Dim>& edit, double least) {
  return ask.predict(edit) >= ask.context().scaling * least;
}

/// The differences between the dimensions: the order of edges, and what replaces an edge. Only a swap that improves the
/// shape may cost a little energy: without that condition, edges swap to and fro.
struct DiagonalSwap {
  const RemeshQueries<2>& ask;
  bool may_go(const EdgeKey& edge) const { return !ask.is_surface(edge); }
  double priority(const EdgeKey& edge) const { return valence_gain(ask.mesh(), edge); }
  Proposal<2> propose(const EdgeKey& edge) const { return propose_diagonal_swap(ask.mesh(), ask.strata(), edge); }
  bool betters_shape(const EdgeKey& edge, const Edit<2>&) const { return valence_gain(ask.mesh(), edge) > 0; }
  /// Edges to be asked again after a swap, from all around or where cells are new.
  static constexpr bool kAsksAllAround = true;
  bool is_worth_asking_again(const EdgeKey& edge) const { return valence_gain(ask.mesh(), edge) > 0; }
};

/// Removes an edge such that the energy of the new tetrahedra is least. At frozen positions this energy is a sum over
/// tetrahedra.
struct EdgeRemoval {
  const RemeshQueries<3>& ask;
  bool may_go(const EdgeKey&) const { return true; }  // in the volume and within flat patches, as strata say
  double priority(const EdgeKey& edge) const { return -worst_quality<3>(ask.mesh(), ask.mesh().cells_of_edge(edge)); }
  Proposal<3> propose(const EdgeKey& edge) const {
    return propose_edge_removal(ask.mesh(), ask.strata(), edge, [&](const auto& cell, int body, const Edit<3>& edit) {
      return ask.energy_of(cell, body, edit);
    });
  }
  bool betters_shape(const EdgeKey&, const Edit<3>& edit) const { return shape_gain(ask.mesh(), edit) > kBetter; }
  static constexpr bool kAsksAllAround = false;
  bool is_worth_asking_again(const EdgeKey&) const { return true; }
};

template <int Dim, typename Policy>
class Swapper {
 public:
  explicit Swapper(RemeshSession<Dim>& session)
      : session_(session), ask_(session.ask()), options_(ask_.options().swap), policy_{ask_} {}

  std::optional<PlaceQueue::Entry> rank(const Place& place, LocalScratch<Dim>&) const {
    const EdgeKey edge = place.edge();
    if (!policy_.may_go(edge) || (has_begun_ && !policy_.is_worth_asking_again(edge))) return std::nullopt;
    return PlaceQueue::Entry{.place = place, .priority = policy_.priority(edge)};
  }

  void look(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    const EdgeKey edge = trial.edge();
    if (const auto it = tries_.find(edge); it != tries_.end() && it->second >= kMostGenerations)
      return trial.refuse(Refusal::depth);
    if (!ask_.exists(edge)) return trial.refuse(Refusal::gone);
    trial.signal = ask_.roughness(edge);
    ask_.find_contact(trial, scratch);
    if (session_.memory().was_refused(RemeshMemory::swap, edge, trial.signal, trial.in_contact)) return;
    if (!trial.take(policy_.propose(edge))) return;
    const bool for_shape = policy_.betters_shape(edge, *trial.edit) && session_.shape_matters(edge, trial.signal);
    const double least = with_nodes(ask_, *trial.edit, for_shape ? *options_.acceptance_tolerance : least_gain(ask_));
    trial.is_asked = true;
    if (!trial.in_contact && !is_promising(ask_, *trial.edit, least))  // there trials tell
      return trial.refuse(Refusal::prediction);
    ask_.judge(trial, least, ask_.options().local, scratch);
  }

  void settle(Trial<Dim>& trial, std::vector<Place>& fresh) {
    has_begun_ = true;
    OperationCount& count = session_.report().swaps;
    count.note(trial.verdict.refusal);
    if (!trial.is_asked) return;
    if (trial.was_previewed) ++tries_[trial.edge()];
    if (!trial.was_previewed || !session_.commits().commit(trial, count)) {
      session_.memory().remember(RemeshMemory::swap, trial.edge(),
                                 {trial.signal / kSameSignal, trial.signal * kSameSignal, trial.in_contact});
      return;
    }
    const std::span<const CellId> patch(trial.verdict.patch);
    const auto near =
        edges_of<Dim>(ask_.mesh(), Policy::kAsksAllAround ? patch : patch.last(trial.edit->inserted_cells.size()));
    fresh.insert(fresh.end(), near.begin(), near.end());
  }

 private:
  RemeshSession<Dim>& session_;
  const RemeshQueries<Dim>& ask_;
  const SwapOptions& options_;
  Policy policy_;
  bool has_begun_ = false;
  std::unordered_map<EdgeKey, int, EdgeKeyHash> tries_;
};

/// Removes facets between present cells, each once, only for a gain of energy. Leaves out facets whose removal an edge
/// removal would undo to improve the shape.
void remove_facets(RemeshSession<3>& session) {
  const RemeshQueries<3>& ask = session.ask();
  const Mesh<3>& mesh = ask.mesh();
  const double least = least_gain(ask);
  const CellId end = mesh.cell_slots();
  for (CellId c = 0; c < end; ++c)
    for (int k = 0; k < 4 && mesh.is_cell_alive(c); ++k) {
      if (ask.is_cancelled()) return;
      const auto facet = opposite_facet<3>(mesh.cell(c), k);
      auto proposal = propose_facet_removal(mesh, facet);
      if (!proposal) continue;
      const auto& cells = proposal.edit->removed_cells;
      if (std::min(cells[0], cells[1]) != c || shape_gain(mesh, *proposal.edit) < 1 / kBetter) continue;
      const double required = with_nodes(ask, *proposal.edit, least);
      if (!is_promising(ask, *proposal.edit, required)) continue;
      Trial<3> trial{.candidate = {.place = proposal.edit->edge, .priority = 0}, .edit = std::move(proposal.edit)};
      session.commits().begin_wave();
      ask.judge(trial, required, ask.options().local, session.scratch());
      session.report().swaps.note(trial.verdict.refusal);
      session.commits().commit(trial, session.report().swaps);
    }
}

}  // namespace

void swap_edges(RemeshSession<2>& session) {
  Swapper<2, DiagonalSwap> swapper(session);
  run_waves(session, swapper, places(session.ask().mesh().edges()));
}

void swap_edges(RemeshSession<3>& session) {
  Swapper<3, EdgeRemoval> swapper(session);
  run_waves(session, swapper, places(session.ask().mesh().edges()));
  remove_facets(session);
}

}  // namespace itr
