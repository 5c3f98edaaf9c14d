// SPDX-License-Identifier: MIT
#include "cell_order.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <map>
#include <queue>

#include "core/check.hpp"
#include "core/sorted.hpp"

namespace itr::scene {

namespace {

using Cell = Mesh<3>::Cell;
using Triangle = std::array<int, 3>;

/// PolyFEM's mesh: a cell's corners are sorted, and its last corner is the one that its first facet does not have. Which
/// corner that is after a refinement depends on how facets list their corners before it.
class Tetrahedra {
 public:
  Tetrahedra(std::vector<Vec<3>> points, const std::vector<Cell>& cells) : points_(std::move(points)) {
    constexpr std::array<Triangle, 4> kFacets = {{{1, 3, 2}, {0, 2, 3}, {3, 1, 0}, {0, 1, 2}}};
    std::map<Triangle, int> known;
    for (const Cell& cell : cells) {
      std::array<int, 4>& facets = facets_of_.emplace_back();
      for (std::size_t i = 0; i < 4; ++i) {
        const Triangle facet = {cell[kFacets[i][0]], cell[kFacets[i][1]], cell[kFacets[i][2]]};
        const auto [found, is_new] = known.try_emplace(sorted(facet), static_cast<int>(facets_.size()));
        if (is_new) facets_.push_back(facet);
        facets[i] = found->second;
      }
      cells_.push_back(sorted(cell));
    }
  }

  std::map<Cell, int> last_corners() const {
    std::map<Cell, int> last;
    for (std::size_t c = 0; c < cells_.size(); ++c) {
      const Triangle& facet = facets_[facets_of_[c][0]];
      last[cells_[c]] = *std::find_if(cells_[c].begin(), cells_[c].end(),
                                      [&](int v) { return std::find(facet.begin(), facet.end(), v) == facet.end(); });
    }
    return last;
  }

  void refine() {
    std::map<EdgeKey, int> midpoints;
    for (const Triangle& f : facets_)
      for (int i = 0; i < 3; ++i) midpoints[edge_key(f[i], f[(i + 1) % 3])] = 0;
    std::vector<Vec<3>> points = points_;
    for (auto& [edge, id] : midpoints) {
      id = static_cast<int>(points.size());
      points.push_back((points_[edge[0]] + points_[edge[1]]) / 2);
    }
    std::vector<Cell> children;
    for (std::size_t c = 0; c < cells_.size(); ++c) add_children(c, midpoints, children);
    const bool is_positive = is_right_handed(cells_.front());
    points_ = std::move(points);
    for (Cell& cell : children)
      if (is_right_handed(cell) != is_positive) std::swap(cell[1], cell[3]);
    list_facets(children);
    orient_boundary();
  }

 private:
  bool is_right_handed(const Cell& cell) const {
    Mat<3> edges;
    for (int k = 0; k < 3; ++k) edges.col(k) = points_[cell[k + 1]] - points_[cell[0]];
    return edges.determinant() > 0;
  }

  /// Four at the corners, four around the diagonal between the middles of the first and of the last edge, by facet.
  void add_children(std::size_t c, const std::map<EdgeKey, int>& midpoints, std::vector<Cell>& children) const {
    const Cell& cell = cells_[c];
    const auto middle = [&](int a, int b) { return midpoints.at(edge_key(a, b)); };
    for (int i = 0; i < 4; ++i) {
      Cell child = {cell[i]};
      for (int j = 0, k = 1; j < 4; ++j)
        if (j != i) child[k++] = middle(cell[i], cell[j]);
      children.push_back(child);
    }
    const int a = middle(cell[0], cell[1]), b = middle(cell[2], cell[3]);
    for (const int f : facets_of_[c]) {
      Cell child = {a, b};
      for (int i = 0, k = 2; i < 3; ++i)
        if (const int m = middle(facets_[f][i], facets_[f][(i + 1) % 3]); m != a && m != b) child[k++] = m;
      children.push_back(child);
    }
  }

  void list_facets(const std::vector<Cell>& cells) {
    constexpr std::array<Triangle, 4> kFacets = {{{1, 0, 2}, {3, 2, 0}, {1, 2, 3}, {0, 1, 3}}};
    std::map<Triangle, int> numbers;
    for (const Cell& cell : cells)
      for (const Triangle& f : kFacets) numbers.try_emplace(sorted(Triangle{cell[f[0]], cell[f[1]], cell[f[2]]}), kNone);
    int count = 0;
    for (auto& [facet, number] : numbers) number = count++;
    facets_.assign(numbers.size(), Triangle{kNone, kNone, kNone});
    num_cells_.assign(numbers.size(), 0);
    cells_.clear();
    facets_of_.clear();
    for (const Cell& cell : cells) {
      std::array<int, 4>& facets = facets_of_.emplace_back();
      for (std::size_t i = 0; i < 4; ++i) {
        const Triangle facet = {cell[kFacets[i][0]], cell[kFacets[i][1]], cell[kFacets[i][2]]};
        facets[i] = numbers.at(sorted(facet));
        if (num_cells_[facets[i]]++ == 0) facets_[facets[i]] = facet;
      }
      cells_.push_back(sorted(cell));
    }
  }

  /// Turns facets of the boundary to one side, from the first on, and all of them if they then bound a negative volume.
  void orient_boundary() {
    std::map<EdgeKey, std::vector<int>> around;
    std::vector<int> boundary;
    for (int f = 0; f < static_cast<int>(facets_.size()); ++f) {
      if (num_cells_[f] != 1) continue;
      boundary.push_back(f);
      for (int i = 0; i < 3; ++i) around[edge_key(facets_[f][i], facets_[f][(i + 1) % 3])].push_back(f);
    }
    const auto runs = [](const Triangle& f, int a, int b) {
      for (int i = 0; i < 3; ++i)
        if (f[i] == a && f[(i + 1) % 3] == b) return true;
      return false;
    };
    std::vector<char> is_done(facets_.size(), 0);
    std::queue<int> front({boundary.front()});
    is_done[boundary.front()] = 1;
    for (; !front.empty(); front.pop()) {
      const Triangle f = facets_[front.front()];
      for (int i = 0; i < 3; ++i)
        for (const int other : around[edge_key(f[i], f[(i + 1) % 3])]) {
          if (is_done[other]) continue;
          is_done[other] = 1;
          if (runs(facets_[other], f[i], f[(i + 1) % 3])) std::reverse(facets_[other].begin(), facets_[other].end());
          front.push(other);
        }
    }
    double volume = 0;
    for (const int f : boundary) volume += points_[facets_[f][0]].dot(points_[facets_[f][1]].cross(points_[facets_[f][2]]));
    if (volume < 0)
      for (const int f : boundary) std::reverse(facets_[f].begin(), facets_[f].end());
  }

  std::vector<Vec<3>> points_;
  std::vector<Cell> cells_;  ///< sorted
  std::vector<std::array<int, 4>> facets_of_;
  std::vector<Triangle> facets_;
  std::vector<int> num_cells_;  ///< by facet, of refined meshes
};

}  // namespace

bool has_ideal_cells(const Node& root) {
  const std::vector<Node> materials = root["materials"].items();
  return std::any_of(materials.begin(), materials.end(), [](const Node& material) {
    return material.json().is_object() && material.has("type") && material["type"].json() == "AMIPS" &&
           !(material.has("use_rest_pose") && material["use_rest_pose"].json() == true);
  });
}

void order_cells(const std::vector<Vec<3>>& points, const std::vector<Cell>& cells, int times, const Mesh<3>& refined,
                 std::vector<Cell>& list, std::size_t first) {
  Tetrahedra mesh(points, cells);
  for (int i = 0; i < times; ++i) mesh.refine();
  const std::map<Cell, int> last = mesh.last_corners();
  for (std::size_t k = first; k < list.size(); ++k) {
    const Cell& cell = refined.cell(static_cast<CellId>((k - first) % static_cast<std::size_t>(refined.num_cells())));
    const auto found = last.find(sorted(cell));
    ITR_CHECK(found != last.end(), "a cell that PolyFEM does not have", cell[0], cell[1], cell[2], cell[3]);
    const auto at = std::find(cell.begin(), cell.end(), found->second) - cell.begin();
    if (at == 3) continue;
    // Rotating three corners keeps the orientation.
    const auto next = at == 2 ? 0 : at + 1;
    const int moved = list[k][at];
    list[k][at] = list[k][next];
    list[k][next] = list[k][3];
    list[k][3] = moved;
  }
}

}  // namespace itr::scene
