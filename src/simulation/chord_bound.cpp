// SPDX-License-Identifier: MIT
#include "simulation/chord_bound.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "fem/chords.hpp"
#include "fem/refined_chords.hpp"
#include "geometry/bvh.hpp"
#include "geometry/quadratic_patch.hpp"
#include "simulation/closed_faces.hpp"
#include "simulation/contact_surface.hpp"

namespace itr {

namespace {

constexpr double kOfActivation = 0.25;  ///< of dhat, which a curve in contact may leave its chords by
constexpr double kOfGap = 0.5;          ///< of the gap, shared by two curves that face each other
constexpr double kLeastChord = 1.25;    ///< in dhat: ends of shorter chords would push each other
constexpr int kMostRounds = 8;
/// A halving is taken back where curves would stay this much below the bound without it.
constexpr double kSlack = 4;
constexpr double kGainOfHalving = 4;  ///< a curve leaves chords of half the length by a quarter

template <int Dim>
using Corners = std::array<Vec<Dim>, Dim>;

/// A bound on how far a quadratic patch leaves the flat simplex of its corners [m]. `bulges`: by how much the middles of its
/// edges leave those of the simplex. Along the simplex nothing is left unless the patch turns back on itself.
template <int Dim>
double height_over(const Corners<Dim>& corners, const std::array<Vec<Dim>, Dim*(Dim - 1) / 2>& bulges) {
  double shortest = std::numeric_limits<double>::infinity(), longest_bulge = 0;
  for (int i = 0; i < Dim; ++i)
    for (int j = 0; j < i; ++j) shortest = std::min(shortest, (corners[i] - corners[j]).norm());
  for (const Vec<Dim>& bulge : bulges) longest_bulge = std::max(longest_bulge, bulge.norm());
  const Vec<Dim> normal = unit_normal(corners);
  const bool is_across = 4 * longest_bulge <= shortest && !normal.isZero();
  double largest = 0, sum = 0;
  for (const Vec<Dim>& bulge : bulges) {
    const double height = is_across ? std::abs(bulge.dot(normal)) : bulge.norm();
    largest = std::max(largest, height);
    sum += height;
  }
  constexpr double kMostOfSum = 4.0 / 3;  // of 4 times the products of barycentric coordinates
  return std::min(sum, kMostOfSum * largest);
}

template <int Dim>
class ChordBound {
 public:
  ChordBound(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& levels, const RefinedChords<Dim>& chords,
             const VectorX& x, int age)
      : setup_(setup), mesh_(mesh), levels_(levels), x_(x), chords_(chords), own_(static_cast<int>(chords_.facets.size())) {
    const int nodes = mesh.num_nodes();
    if (has_closed_faces(mesh, age))
      closed_ = closed_faces<Dim>(mesh.rest(), setup.contact.reach_of_closed(), coincidence(mesh),
                                  [&](int node) { return is_closed(mesh, node, age); });
    points_.reserve(chords_.points.size());
    for (const auto& weights : chords_.points) points_.push_back(combined<Dim>(weights, [&](int node) { return at(node); }));
    for (const auto& facet : chords_.facets) {
      Corners<Dim>& corners = corners_.emplace_back();
      for (int k = 0; k < Dim; ++k) corners[k] = facet[k] < nodes ? at(facet[k]) : points_[facet[k] - nodes];
    }
    for (int i = 0; i < own_; ++i) heights_.push_back(height_of(i));
    heights_.resize(own_ + add_obstacles(nodes), 0);
    std::vector<Box<Dim>> boxes(corners_.size());
    for (std::size_t i = 0; i < boxes.size(); ++i)
      for (const Vec<Dim>& p : corners_[i]) boxes[i].include(p);
    tree_.build(boxes);
  }

  /// By slot of facets: how far curves leave their chords, times `factor`, by how far they may.
  std::vector<double> excess(double factor = 1) const {
    std::vector<double> result(mesh_.facet_slots(), 0);
    for_each_pair(factor, [&](int i, int, double excess) {
      result[chords_.parents[i]] = std::max(result[chords_.parents[i]], excess);
      return true;
    });
    return result;
  }

  /// Whether Bernstein bounds prove that curves are apart from what they may reach by how far they leave their chords.
  bool are_curves_apart() const {
    constexpr double kMayReach = 2;  // half of the gap is what they may leave chords by
    const auto patch_of = [&](int i) {
      if (i >= own_)
        return quadratic_patch<Dim>(corners_[i], [&](int k, int l) { return (corners_[i][k] + corners_[i][l]) / 2; });
      const auto& facet = mesh_.facet(chords_.parents[i]);
      Corners<Dim> corners;
      for (int k = 0; k < Dim; ++k) corners[k] = at(facet[k]);
      return quadratic_patch<Dim>(corners, [&](int k, int l) -> Vec<Dim> {
        const int node = mesh_.node_of(facet[k], facet[l]);
        return node == kNone ? Vec<Dim>((corners[k] + corners[l]) / 2) : at(node);
      });
    };
    std::set<std::pair<FacetId, int>> proven;
    return for_each_pair(1, [&](int i, int j, double excess) {
      const std::pair<FacetId, int> pair{chords_.parents[i], j < own_ ? chords_.parents[j] : mesh_.facet_slots() + j};
      return excess < kMayReach || !proven.insert(pair).second || are_apart(patch_of(i), patch_of(j));
    });
  }

  ChordDemand demand() const {
    ChordDemand result{levels_, 0};
    result.levels.resize(mesh_.num_curved(), 0);
    const std::vector<double> excess = this->excess();
    for (FacetId f = 0; f < mesh_.facet_slots(); ++f) {
      result.excess = std::max(result.excess, excess[f]);
      if (excess[f] <= 1) continue;
      int lowest = kMostHalvings<Dim>;
      for_each_curve(f, [&](int edge) {
        if (level(edge) < most_halvings(edge)) lowest = std::min(lowest, level(edge));
      });
      const double halvings = std::ceil(std::log(excess[f]) / std::log(kGainOfHalving));
      const int target = static_cast<int>(std::min<double>(kMostHalvings<Dim>, lowest + halvings));
      for_each_curve(f, [&](int edge) {
        const int most = std::max(level(edge), std::min(target, most_halvings(edge)));
        result.levels[edge] = std::max<std::uint8_t>(result.levels[edge], static_cast<std::uint8_t>(most));
      });
    }
    return result;
  }

  /// Curves of which a halving can be taken back, for these positions.
  std::vector<char> find_lowerable() const {
    std::vector<char> result(mesh_.num_curved(), 0);
    for (int edge = 0; edge < mesh_.num_curved(); ++edge) result[edge] = level(edge) > 0;
    const std::vector<double> excess = this->excess(kSlack * kGainOfHalving);
    for (FacetId f = 0; f < mesh_.facet_slots(); ++f)
      if (excess[f] > 1) for_each_curve(f, [&](int edge) { result[edge] = 0; });
    return result;
  }

 private:
  /// Calls visit(i, j, excess) for each simplex i that a curve leaves and what may be too near to it, with the ratio of how
  /// far it does, times `factor`, to how far it may. False once a visit is.
  template <typename Visit>
  bool for_each_pair(double factor, const Visit& visit) const {
    std::vector<int> hits;
    for (int i = 0; i < own_; ++i) {
      const double height = factor * heights_[i];
      if (height == 0) continue;
      Box<Dim> box;
      for (const Vec<Dim>& p : corners_[i]) box.include(p);
      hits.clear();
      tree_.query(box.inflated(2 * height / kOfGap), hits);  // a gap that is larger allows that height
      for (const int j : hits)
        if (!are_neighbours(i, j) && !are_closed(i, j) && !visit(i, j, height / allowed(i, j))) return false;
    }
    return true;
  }

  Vec<Dim> at(int node) const { return vertex_of<Dim>(x_, node); }
  int level(int edge) const { return levels_.empty() ? 0 : levels_[edge]; }

  double height_of(int i) const {
    const auto& facet = mesh_.facet(chords_.parents[i]);
    const auto& coordinates = chords_.coordinates[i];
    std::array<Vec<Dim>, Dim*(Dim - 1) / 2> bulges;
    bool is_curved = false;
    int edge = 0;
    for (int k = 0; k < Dim; ++k)
      for (int l = 0; l < k; ++l) {
        Vec<Dim>& bulge = bulges[edge++] = Vec<Dim>::Zero();
        for (int a = 0; a < Dim; ++a)
          for (int b = 0; b < a; ++b) {
            const int node = mesh_.node_of(facet[a], facet[b]);
            if (node == kNone) continue;
            is_curved = true;
            const double along_a = coordinates[k][a] - coordinates[l][a], along_b = coordinates[k][b] - coordinates[l][b];
            bulge -= along_a * along_b * (at(node) - (at(facet[a]) + at(facet[b])) / 2);
          }
      }
    return is_curved ? height_over<Dim>(corners_[i], bulges) : 0;
  }

  /// Adds the obstacles' primitives as simplices, of which some have no extent, and returns how many there are.
  std::size_t add_obstacles(int nodes) {
    const auto& obstacles = setup_.obstacles;
    const auto add = [&](const auto& ids) {
      Corners<Dim>& corners = corners_.emplace_back();
      for (int k = 0; k < Dim; ++k) corners[k] = at(nodes + ids[std::min<std::size_t>(k, ids.size() - 1)]);
    };
    for (const auto& triangle : obstacles.triangles)
      if constexpr (Dim == 3) add(triangle);
    for (const auto& edge : obstacles.edges) add(edge);
    for (int v = 0; v < static_cast<int>(obstacles.rest.size()); ++v) add(std::array{v});
    return corners_.size() - own_;
  }

  bool are_neighbours(int i, int j) const {
    if (j >= own_) return false;
    const auto &a = mesh_.facet(chords_.parents[i]), &b = mesh_.facet(chords_.parents[j]);
    return std::find_first_of(a.begin(), a.end(), b.begin(), b.end()) != a.end();
  }

  /// Whether the two are no contact.
  bool are_closed(int i, int j) const {
    return j < own_ && closed_.exclude<Dim>(mesh_.facet(chords_.parents[i]), mesh_.facet(chords_.parents[j]));
  }

  double allowed(int i, int j) const {
    const double gap = std::sqrt(simplex_distance_squared<Dim>(corners_[i], corners_[j])), dhat = setup_.contact.dhat;
    const double of_gap = heights_[j] > 0 ? kOfGap / 2 * gap : kOfGap * gap;
    return gap < dhat ? std::min(kOfActivation * dhat, of_gap) : of_gap;
  }

  /// Calls visit(edge) for the curved edges of a facet.
  template <typename Visit>
  void for_each_curve(FacetId f, const Visit& visit) const {
    const auto& facet = mesh_.facet(f);
    for (int i = 0; i < Dim; ++i)
      for (int j = 0; j < i; ++j)
        if (const int node = mesh_.node_of(facet[i], facet[j]); node != kNone) visit(node - mesh_.num_vertices());
  }

  int most_halvings(int edge) const {
    const int node = mesh_.num_vertices() + edge;
    const auto [a, b] = mesh_.edge_of_node(node);
    const Vec<Dim> middle = at(node);
    const double chord =
        std::min({(middle - at(a)).norm(), (at(b) - middle).norm(), (mesh_.rest(a) - mesh_.rest(b)).norm() / 2});
    const double halvings = std::floor(std::log2(chord / (kLeastChord * setup_.contact.dhat)));
    return static_cast<int>(std::clamp<double>(halvings, 0, kMostHalvings<Dim>));
  }

  const StepSetup<Dim>& setup_;
  const Mesh<Dim>& mesh_;
  const ChordLevels& levels_;
  const VectorX& x_;
  const RefinedChords<Dim>& chords_;
  int own_;             ///< simplices of bodies
  ClosedFaces closed_;  ///< by vertices
  std::vector<Vec<Dim>> points_;
  std::vector<Corners<Dim>> corners_;  ///< of simplices, then of obstacles
  std::vector<double> heights_;        ///< by simplex: how far the curve leaves it [m]
  Bvh<Dim> tree_;
};

template <int Dim>
bool has_chords(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh) {
  return setup.contact.enabled && !setup.proxy && mesh.has_nodes();
}

/// The form in which levels are compared: empty where all are 0.
ChordLevels normalized(ChordLevels levels) {
  if (std::all_of(levels.begin(), levels.end(), [](int level) { return level == 0; })) levels.clear();
  return levels;
}

}  // namespace

template <int Dim>
ChordDemand find_chord_demand(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& levels,
                              const VectorX& x, int age) {
  if (!has_chords(setup, mesh)) return {levels, 0};
  ChordDemand demand = ChordBound<Dim>(setup, mesh, levels, refine_chords(mesh, levels), x, age).demand();
  demand.levels = normalized(std::move(demand.levels));
  return demand;
}

template <int Dim>
bool are_curves_apart(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& levels, const VectorX& x) {
  return !has_chords(setup, mesh) ||
         ChordBound<Dim>(setup, mesh, levels, refine_chords(mesh, levels), x, 0).are_curves_apart();
}

template <int Dim>
ChordLevels settled_chords(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, ChordLevels levels,
                           std::span<const VectorX> positions) {
  for (int age = 0; age < static_cast<int>(positions.size()); ++age)
    for (int round = 0; round < kMostRounds; ++round) {
      ChordLevels more = find_chord_demand(setup, mesh, levels, positions[age], age).levels;
      if (more == levels) break;
      levels = std::move(more);
    }
  return levels;
}

template <int Dim>
ChordLevels lowered_chords(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& levels,
                           std::span<const VectorX> positions) {
  if (levels.empty() || !has_chords(setup, mesh)) return levels;
  std::vector<char> lowerable(levels.size(), 1);
  const RefinedChords<Dim> chords = refine_chords(mesh, levels);
  for (int age = 0; age < static_cast<int>(positions.size()); ++age) {
    const std::vector<char> here = ChordBound<Dim>(setup, mesh, levels, chords, positions[age], age).find_lowerable();
    for (std::size_t edge = 0; edge < levels.size(); ++edge) lowerable[edge] &= here[edge];
    if (std::none_of(lowerable.begin(), lowerable.end(), [](char is) { return is; })) return levels;
  }
  ChordLevels fewer = levels;
  for (std::size_t edge = 0; edge < levels.size(); ++edge)
    if (lowerable[edge]) --fewer[edge];
  fewer = normalized(std::move(fewer));
  if (fewer == levels) return levels;
  const ContactSurface<Dim> contact = contact_surface(setup, mesh, fewer, static_cast<int>(positions.size()));
  const bool is_free = std::none_of(positions.begin(), positions.end(), [&](const VectorX& x) {
    return has_intersection<Dim>(contact.surface, contact.positions(x));
  });
  return is_free ? fewer : levels;
}

#define ITR_INSTANTIATE(Dim)                                                                                                \
  template ChordDemand find_chord_demand(const StepSetup<Dim>&, const Mesh<Dim>&, const ChordLevels&, const VectorX&, int); \
  template bool are_curves_apart(const StepSetup<Dim>&, const Mesh<Dim>&, const ChordLevels&, const VectorX&);              \
  template ChordLevels settled_chords(const StepSetup<Dim>&, const Mesh<Dim>&, ChordLevels, std::span<const VectorX>);      \
  template ChordLevels lowered_chords(const StepSetup<Dim>&, const Mesh<Dim>&, const ChordLevels&, std::span<const VectorX>);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
