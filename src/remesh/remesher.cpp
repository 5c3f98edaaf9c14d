// SPDX-License-Identifier: MIT
#include "itr/remesh/remesher.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <set>
#include <unordered_map>

#include "itr/core/check.hpp"
#include "itr/core/timer.hpp"
#include "itr/geometry/predicates.hpp"
#include "itr/mesh/validate.hpp"
#include "itr/remesh/edits.hpp"
#include "itr/remesh/local_problem.hpp"
#include "itr/remesh/patch.hpp"
#include "itr/remesh/prediction.hpp"
#include "itr/remesh/ranking.hpp"

namespace itr {

namespace {

constexpr int kIterationsAfterAcceptance = 100;
/// Wherever an edge ranks by energy, a new vertex that alone gains this many tolerances is worth a trial. Smaller values
/// find more and cost more trials (study in verification/paper).
constexpr double kWorthwhile = 5;
constexpr double kTinyEdge = 1e-3;  ///< in shortest initial edges: shorter ones may collapse whatever their rank

EdgeKey key(VertexId a, VertexId b) { return {std::min(a, b), std::max(a, b)}; }

class Remesher {
 public:
  Remesher(Mesh<2>& mesh, RemeshFields<2>& fields, const StepContext<2>& context, const RemeshOptions& options)
      : mesh_(mesh),
        fields_(fields),
        context_(context),
        options_(options),
        tree_(mesh, fields, context),
        total_volume_(mesh.total_volume()) {}

  RemeshReport run() {
    for (int sweep = 0; sweep < options_.sweeps; ++sweep) {
      const int before = accepted();
      ranks_ = rank_edges(mesh_, fields_, context_, options_);
      if (options_.split.enabled) split();
      if (options_.collapse.enabled) collapse();
      if (options_.swap.enabled) swap();
      if (options_.smooth.enabled) smooth();
      if (accepted() == before) break;
    }
    if (const auto middle = trial_seconds_.begin() + static_cast<std::ptrdiff_t>(trial_seconds_.size() / 2);
        !trial_seconds_.empty()) {
      std::nth_element(trial_seconds_.begin(), middle, trial_seconds_.end());
      report_.trial_seconds = *middle;
    }
    return report_;
  }

 private:
  /// A queue of edges, highest priority first, ties by key; each edge is tried once until it is pushed again.
  class Queue {
   public:
    void push(const EdgeKey& edge, double priority) {
      if (const auto it = priority_.find(edge); it != priority_.end()) entries_.erase({-it->second, edge});
      priority_[edge] = priority;
      entries_.insert({-priority, edge});
    }
    std::optional<EdgeKey> pop() {
      if (entries_.empty()) return std::nullopt;
      const EdgeKey edge = entries_.begin()->second;
      entries_.erase(entries_.begin());
      priority_.erase(edge);
      return edge;
    }

   private:
    std::set<std::pair<double, EdgeKey>> entries_;
    std::unordered_map<EdgeKey, double, EdgeKeyHash> priority_;
  };

  int accepted() const {
    return report_.splits.accepted + report_.collapses.accepted + report_.swaps.accepted + report_.smooths.accepted;
  }

  Rank rank(const EdgeKey& edge) const {
    const auto it = ranks_.find(edge);
    return it == ranks_.end() ? Rank::middle : it->second;
  }
  int depth(const EdgeKey& edge) const {
    const auto it = depth_.find(edge);
    return it == depth_.end() ? 0 : it->second;
  }
  double rest_length(const EdgeKey& e) const { return (mesh_.rest(e[0]) - mesh_.rest(e[1])).norm(); }
  double length(const EdgeKey& e) const { return (fields_.x.segment<2>(2 * e[0]) - fields_.x.segment<2>(2 * e[1])).norm(); }
  bool exists(const EdgeKey& e) const {
    return mesh_.is_vertex_alive(e[0]) && mesh_.is_vertex_alive(e[1]) && !mesh_.cells_of_edge(e).empty();
  }
  /// Whether contact can act on an edge's ends, so that the bulk terms do not tell what a split gains.
  bool is_in_contact(const EdgeKey& e) {
    if (!context_.contact.enabled || (!mesh_.is_boundary(e[0]) && !mesh_.is_boundary(e[1]))) return false;
    Box<2> box;
    for (const int v : e) box.include(Vec<2>(fields_.x.segment<2>(2 * v)));
    near_.clear();
    tree_.query(box.inflated(context_.contact.activation_distance), near_);
    return std::any_of(near_.begin(), near_.end(), [&](int hit) {
      if (hit < 0) return true;
      const auto& f = mesh_.facet(hit);
      return f[0] != e[0] && f[0] != e[1] && f[1] != e[0] && f[1] != e[1];
    });
  }
  bool is_surface(const EdgeKey& e) const { return mesh_.find_facet({e[0], e[1]}) != kNone; }

  std::vector<EdgeKey> edges_of(const std::vector<CellId>& cells) const {
    std::vector<EdgeKey> edges;
    for (const CellId c : cells)
      if (mesh_.is_cell_alive(c))
        for (int k = 0; k < 3; ++k) edges.push_back(key(mesh_.cell(c)[k], mesh_.cell(c)[(k + 1) % 3]));
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    return edges;
  }

  /// Orientation of the inserted cells in every stored configuration, at interpolated values.
  bool is_valid_in_all_configurations(const Edit<2>& edit) const {
    const auto valid_in = [&](const VectorX& field) {
      const auto at = [&](VertexId v) {
        return edit.value && v == edit.value->vertex ? RemeshFields<2>::interpolate(field, *edit.value)
                                                     : Vec<2>(field.segment<2>(2 * v));
      };
      return std::all_of(edit.inserted_cells.begin(), edit.inserted_cells.end(), [&](const auto& cell) {
        return orientation(at(cell.vertices[0]), at(cell.vertices[1]), at(cell.vertices[2])) > 0;
      });
    };
    if (!valid_in(fields_.x)) return false;
    for (const auto& past : fields_.past_positions)
      if (!valid_in(past) || !surface_stays_free(edit, past)) return false;
    return true;
  }

  /// Whether the surface edges that an edit inserts touch no other one at past positions. Splits change no geometry.
  bool surface_stays_free(const Edit<2>& edit, const VectorX& past) const {
    if (!context_.contact.enabled || edit.kind == Edit<2>::Kind::split || edit.inserted_facets.empty()) return true;
    const auto index = static_cast<std::size_t>(&past - fields_.past_positions.data());
    const auto at = [&](VertexId v) {
      return edit.value && v == edit.value->vertex ? RemeshFields<2>::interpolate(past, *edit.value)
                                                   : Vec<2>(past.segment<2>(2 * v));
    };
    for (const auto& inserted : edit.inserted_facets) {
      const auto [a, b] = inserted.vertices;
      const Vec<2> pa = at(a), pb = at(b);
      for (int f = 0; f < mesh_.facet_slots(); ++f) {
        if (!mesh_.is_facet_alive(f)) continue;
        if (std::find(edit.removed_facets.begin(), edit.removed_facets.end(), f) != edit.removed_facets.end()) continue;
        const auto [c, d] = mesh_.facet(f);
        if (a != c && a != d && b != c && b != d && segments_intersect(pa, pb, at(c), at(d))) return false;
      }
      for (const auto& [c, d] : context_.obstacles.edges) {
        const auto& obstacle = context_.obstacles.past_x[index];
        if (segments_intersect(pa, pb, obstacle[c], obstacle[d])) return false;
      }
    }
    return true;
  }

  /// Previews an edit and commits it where it lowers the energy of its patch by `tolerance` [J] (design §3, rules a-d).
  /// Returns the cells of the patch with the new ones where it was accepted.
  std::optional<std::vector<CellId>> attempt(const Edit<2>& edit, const Vec<2>& center, double tolerance, bool one_ring) {
    const ScopedTimer timer(trial_seconds_.emplace_back(0));
    if (!is_valid_in_all_configurations(edit)) return std::nullopt;
    LocalRelaxationOptions local = options_.local;
    if (one_ring) local.rings = 1, local.relative_volume = 0;
    std::vector<CellId> patch = select_patch(mesh_, edit.removed_cells, center, total_volume_, local, patch_marks_);
    const auto build = [&](bool apply) {
      return std::make_unique<LocalProblem>(mesh_, fields_, context_, patch, &edit, apply, options_.history, tree_,
                                            scratch_);
    };
    auto before = build(false);
    const double energy_before = before->value();
    auto after = build(true);
    if (!after->has_unknowns() || !after->is_free_of_intersections()) return std::nullopt;
    const bool contact = before->touches_contact() || after->touches_contact();
    const int iterations = contact ? options_.local.max_contact_iterations : options_.local.max_iterations;
    const double required = context_.scaling * tolerance;
    const double energy_after = after->relax(iterations).energy;
    if (!(energy_before - energy_after >= required)) return std::nullopt;
    // The side without the edit gets the same effort, so that residual left over elsewhere is not credited to the edit.
    if (before->has_unknowns()) {
      const double relaxed = before->relax(iterations).energy;
      if (!(relaxed - energy_after >= required)) return std::nullopt;
    }
    after->relax(kIterationsAfterAcceptance);
    commit(edit, *after, patch);
    return patch;
  }

  void commit(const Edit<2>& edit, const LocalProblem& after, std::vector<CellId>& patch) {
    const int first_new = mesh_.cell_slots();
    const VertexId created = mesh_.apply(edit);
    fields_.follow(edit, created);
    after.write_back(fields_.x, created);
    for (int c = first_new; c < mesh_.cell_slots(); ++c) patch.push_back(c);
    if (context_.contact.enabled) tree_.invalidate();
    inherit(edit, created);
    ITR_AUDIT(mesh_.find_defect().empty(), mesh_.find_defect());
    ITR_AUDIT(find_inverted<2>(mesh_, fields_.x) == kNone);
  }

  /// Rank and depth of the edges that an edit makes.
  void inherit(const Edit<2>& edit, VertexId created) {
    if (edit.kind != Edit<2>::Kind::split) return;
    const Rank from = rank(edit.edge);
    const int generation = depth(edit.edge) + 1;
    for (const CellId c : mesh_.cells_of(created))
      for (const int v : mesh_.cell(c))
        if (v != created) {
          ranks_[key(v, created)] = from;
          depth_[key(v, created)] = generation;
        }
  }

  void split() {
    // Most promising first. (The paper orders by energy density; this gains a fifth more with the same tolerance, or the
    // same with fewer vertices: verification/paper.)
    Queue queue;
    const double tolerance = context_.scaling * options_.split.acceptance_tolerance;
    const auto push = [&](const EdgeKey& edge) {
      if (depth(edge) >= options_.split.max_depth) return;
      const bool top = rank(edge) == Rank::top;
      if (!top && options_.screening != Screening::predicted_decrease) return;
      const double gain = predict_split(mesh_, fields_, context_, edge).of_vertex;
      if (top || (gain >= kWorthwhile * tolerance && !is_in_contact(edge))) queue.push(edge, gain);
    };
    for (const EdgeKey& edge : mesh_.edges()) push(edge);
    while (const auto edge = queue.pop()) {
      if (!exists(*edge) || depth(*edge) >= options_.split.max_depth || rest_length(*edge) < options_.split.min_edge_length)
        continue;
      if (context_.contact.enabled && is_surface(*edge)) {
        const double dhat = context_.contact.activation_distance;
        if (rest_length(*edge) < 2 * dhat || length(*edge) < 2 * dhat) {
          ++report_.bound_by_activation_distance;
          continue;
        }
      }
      if (options_.screening != Screening::none && !is_in_contact(*edge) &&
          predict_split(mesh_, fields_, context_, *edge).at_most < tolerance)
        continue;
      ++report_.splits.tried;
      const auto edit = make_split(mesh_, *edge);
      const auto patch = attempt(edit, edit.value->rest, options_.split.acceptance_tolerance, false);
      if (!patch) continue;
      ++report_.splits.accepted;
      for (const EdgeKey& near : edges_of(*patch)) push(near);
    }
    depth_.clear();
  }

  void collapse() {
    const double longest =
        std::min(options_.collapse.abs_max_edge_length, options_.collapse.rel_max_edge_length * context_.shortest_edge);
    const auto is_candidate = [&](const EdgeKey& e) {
      return options_.screening == Screening::none || rank(e) == Rank::bottom ||
             rest_length(e) < kTinyEdge * context_.shortest_edge;
    };
    Queue queue;
    for (const EdgeKey& edge : mesh_.edges())
      if (is_candidate(edge)) queue.push(edge, -rest_length(edge));
    while (const auto edge = queue.pop()) {
      if (!exists(*edge) || rest_length(*edge) > longest || depth(*edge) >= options_.collapse.max_depth) continue;
      const auto around = mesh_.cells_of_edge(*edge);
      if (std::all_of(around.begin(), around.end(), [&](CellId c) { return mesh_.volume(c) > longest * longest / 2; }))
        continue;
      ++report_.collapses.tried;
      const auto edit = make_collapse(mesh_, *edge);
      if (!edit) continue;
      const int generation = depth(*edge) + 1;
      if (!attempt(*edit, edit->value->rest, options_.collapse.acceptance_tolerance, false)) continue;
      ++report_.collapses.accepted;
      const auto ring = mesh_.cells_of(edit->value->vertex);
      for (const EdgeKey& near : edges_of({ring.begin(), ring.end()})) {
        if (near[0] == edit->value->vertex || near[1] == edit->value->vertex) depth_[near] = generation;
        if (is_candidate(near)) queue.push(near, -rest_length(near));
      }
    }
    depth_.clear();
  }

  int valence(VertexId v) const { return static_cast<int>(mesh_.cells_of(v).size()) + (mesh_.is_boundary(v) ? 1 : 0); }

  /// By how much a swap brings the valences of its quadrilateral nearer to 6 (4 on the boundary).
  double valence_gain(const EdgeKey& edge) const {
    double gain = 0;
    const auto badness = [&](VertexId v, int change) {
      const double off = valence(v) + change - (mesh_.is_boundary(v) ? 4 : 6);
      return off * off;
    };
    for (const int v : edge) gain += badness(v, 0) - badness(v, -1);
    for (const CellId c : mesh_.cells_of_edge(edge))
      for (const int v : mesh_.cell(c))
        if (v != edge[0] && v != edge[1]) gain += badness(v, 0) - badness(v, 1);
    return gain;
  }

  void swap() {
    Queue queue;
    for (const EdgeKey& edge : mesh_.edges())
      if (!is_surface(edge)) queue.push(edge, valence_gain(edge));
    std::unordered_map<EdgeKey, int, EdgeKeyHash> tries;
    while (const auto edge = queue.pop()) {
      if (!exists(*edge) || tries[*edge]++ >= options_.swap.max_depth) continue;
      const auto edit = make_swap(mesh_, *edge);
      if (!edit) continue;
      ++report_.swaps.tried;
      const Vec<2> center = 0.5 * (mesh_.rest((*edge)[0]) + mesh_.rest((*edge)[1]));
      // An increase in energy is allowed for the sake of the mesh's shape only: without that, edges swap to and fro.
      const double least =
          valence_gain(*edge) > 0 ? options_.swap.acceptance_tolerance : std::max(0.0, options_.swap.acceptance_tolerance);
      const auto patch = attempt(*edit, center, least, false);
      if (!patch) continue;
      ++report_.swaps.accepted;
      for (const EdgeKey& near : edges_of(*patch))
        if (!is_surface(near) && valence_gain(near) > 0) queue.push(near, valence_gain(near));
    }
  }

  /// Worst AMIPS measure over the ring: how badly its triangles need smoothing.
  double worst_shape(VertexId vertex) const {
    double worst = 0;
    for (const CellId c : mesh_.cells_of(vertex)) {
      double squares = 0;
      for (int k = 0; k < 3; ++k)
        squares += (mesh_.rest(mesh_.cell(c)[k]) - mesh_.rest(mesh_.cell(c)[(k + 1) % 3])).squaredNorm();
      worst = std::max(worst, squares / (2 * std::sqrt(3.0) * mesh_.volume(c)));
    }
    return worst;
  }

  void smooth() {
    std::vector<std::pair<double, VertexId>> order;
    for (int v = 0; v < mesh_.vertex_slots(); ++v)
      if (mesh_.is_vertex_alive(v) && !mesh_.is_boundary(v)) order.emplace_back(-worst_shape(v), v);
    std::sort(order.begin(), order.end());
    for (int round = 0; round < options_.smooth.max_iterations; ++round)
      for (const auto& [badness, v] : order) {
        const Vec<2> target = best_shaped_position(mesh_, v, 10);
        if ((target - mesh_.rest(v)).squaredNorm() < 1e-6 * std::abs(mesh_.volume(mesh_.cells_of(v)[0]))) continue;
        const auto edit = make_move(mesh_, v, target);
        if (!edit) continue;
        ++report_.smooths.tried;
        if (attempt(*edit, target, options_.smooth.acceptance_tolerance, true)) ++report_.smooths.accepted;
      }
  }

  Mesh<2>& mesh_;
  RemeshFields<2>& fields_;
  const StepContext<2>& context_;
  const RemeshOptions& options_;
  SurfaceTree tree_;
  double total_volume_;
  EdgeRanks ranks_;
  std::unordered_map<EdgeKey, int, EdgeKeyHash> depth_;
  LocalScratch scratch_;
  std::vector<int> near_;
  Marks patch_marks_;
  RemeshReport report_;
  std::vector<double> trial_seconds_;
};

}  // namespace

RemeshReport remesh(Mesh<2>& mesh, RemeshFields<2>& fields, const StepContext<2>& context, const RemeshOptions& options) {
  return Remesher(mesh, fields, context, options).run();
}

}  // namespace itr
