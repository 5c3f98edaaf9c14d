// SPDX-License-Identifier: MIT
#include <algorithm>
#include <span>
#include <unordered_map>

#include "edit_checks.hpp"
#include "itr/energy/elastic/laws.hpp"
#include "wave.hpp"

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

double quality(const Mesh<3>& mesh, const MeshTypes<3>::Cell& v) {
  return simplex_quality<3>({mesh.rest(v[0]), mesh.rest(v[1]), mesh.rest(v[2]), mesh.rest(v[3])});
}

/// What differs between the dimensions: which edges first, and what takes their place. A swap that betters the shape may
/// cost a little energy, for the sake of the mesh: without that condition, edges swap to and fro.
struct DiagonalSwap {
  const RemeshSession<2>& session;
  double priority(const EdgeKey& edge) const { return valence_gain(session.mesh(), edge); }
  std::optional<Edit<2>> edit(const EdgeKey& edge) const { return make_swap(session.mesh(), edge); }
  bool betters_shape(const EdgeKey& edge, const Edit<2>&) const { return valence_gain(session.mesh(), edge) > 0; }
  /// Edges to be asked again after a swap, from all around or where cells are new.
  static constexpr bool kAsksAllAround = true;
  bool is_worth_asking_again(const EdgeKey& edge) const { return valence_gain(session.mesh(), edge) > 0; }
};

/// At frozen positions the elastic energy is a sum over tetrahedra: that of the new ones is least.
struct EdgeRemoval {
  const RemeshSession<3>& session;
  double priority(const EdgeKey& edge) const {
    return -worst_quality<3>(session.mesh(), session.mesh().cells_of_edge(edge));
  }
  std::optional<Edit<3>> edit(const EdgeKey& edge) const {
    return propose_edge_removal(session.mesh(), session.strata(), edge,
                                [&](const auto& cell, int body) { return elastic_energy(cell, body); })
        .edit;
  }
  bool betters_shape(const EdgeKey&, const Edit<3>& edit) const {
    constexpr double kBetter = 1.2;
    double after = 1;
    for (const auto& cell : edit.inserted_cells) after = std::min(after, quality(session.mesh(), cell.vertices));
    return after > kBetter * worst_quality<3>(session.mesh(), edit.removed_cells);
  }
  static constexpr bool kAsksAllAround = false;
  bool is_worth_asking_again(const EdgeKey&) const { return true; }

 private:
  double elastic_energy(const MeshTypes<3>::Cell& cell, int body) const {
    std::array<Vec<3>, 4> X, x;
    Vec<3> barycenter = Vec<3>::Zero();
    for (int k = 0; k < 4; ++k) {
      X[k] = session.mesh().rest(cell[k]);
      x[k] = session.fields().x.segment<3>(3 * cell[k]);
      barycenter += X[k] / 4;
    }
    const Mat<3> edges = edge_matrix<3>(X), F = edge_matrix<3>(x) * edges.inverse();
    const ElasticModuli moduli = elastic_moduli<3>(session.context().materials.at(body), barycenter);
    return simplex_volume<3>(edges) * elastic_density<3>(F, moduli);
  }
};

template <int Dim, typename Policy>
class Swapper {
 public:
  explicit Swapper(RemeshSession<Dim>& session) : session_(session), options_(session.options().swap), policy_{session} {}

  std::optional<EdgeQueue::Entry> rank(const EdgeKey& edge, LocalScratch<Dim>&) const {
    if (session_.is_surface(edge) || (has_begun_ && !policy_.is_worth_asking_again(edge))) return std::nullopt;
    return EdgeQueue::Entry{.edge = edge, .priority = policy_.priority(edge)};
  }

  void look(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    const EdgeKey& edge = trial.edge();
    if (const auto it = tries_.find(edge); it != tries_.end() && it->second >= options_.max_depth) return;
    if (!session_.exists(edge)) return;
    trial.edit = policy_.edit(edge);
    if (!trial.edit) return;
    const double tolerance = options_.acceptance_tolerance;
    const double least =
        policy_.betters_shape(edge, *trial.edit) ? tolerance : std::max(session_.least_worthwhile(), tolerance);
    trial.signal = session_.roughness(edge);
    session_.find_contact(trial, scratch);
    if (session_.was_refused(RemeshMemory::swap, edge, trial.signal, trial.in_contact)) return;
    trial.is_asked = true;
    trial.verdict.decision = Decision::by_bound;
    if (session_.screens() && session_.predict(*trial.edit) < session_.context().scaling * least) return;
    const Vec<Dim> center = 0.5 * (session_.mesh().rest(edge[0]) + session_.mesh().rest(edge[1]));
    session_.judge(trial, center, least, session_.options().local, scratch);
  }

  void settle(Trial<Dim>& trial, std::vector<EdgeKey>& fresh) {
    has_begun_ = true;
    if (!trial.is_asked) return;
    if (trial.was_previewed) ++tries_[trial.edge()];
    if (!trial.was_previewed || !session_.commit(trial, session_.report().swaps)) {
      session_.remember(RemeshMemory::swap, trial.edge(),
                        {trial.signal / kSameSignal, trial.signal * kSameSignal, trial.in_contact});
      return;
    }
    const std::span<const CellId> patch(trial.verdict.patch);
    const auto near = session_.edges_of(Policy::kAsksAllAround ? patch : patch.last(trial.edit->inserted_cells.size()));
    fresh.insert(fresh.end(), near.begin(), near.end());
  }

 private:
  RemeshSession<Dim>& session_;
  const SwapOptions& options_;
  Policy policy_;
  bool has_begun_ = false;
  std::unordered_map<EdgeKey, int, EdgeKeyHash> tries_;
};

}  // namespace

void swap_edges(RemeshSession<2>& session) {
  Swapper<2, DiagonalSwap> swapper(session);
  run_waves(session, swapper, session.mesh().edges());
}

void swap_edges(RemeshSession<3>& session) {
  Swapper<3, EdgeRemoval> swapper(session);
  run_waves(session, swapper, session.mesh().edges());
}

}  // namespace itr
