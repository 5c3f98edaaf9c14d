// SPDX-License-Identifier: MIT
#include "tessellation.hpp"

#include <algorithm>
#include <set>

#include "core/sorted.hpp"

namespace itr::scene {

namespace {

using Triangle = std::array<int, 3>;
using Edge = std::array<int, 2>;
/// Barycentric coordinates of a point in a facet, by vertex; those of 0 are left out.
using Place = std::map<VertexId, double>;

class Tessellator {
 public:
  explicit Tessellator(const Mesh<3>& mesh) : mesh_(mesh) {
    for (const FacetId f : mesh.live_facets()) {
      Triangle triangle;
      for (int k = 0; k < 3; ++k) triangle[k] = vertex({{mesh.facet(f)[k], 1.0}});
      triangles_.push_back(triangle);
    }
  }

  /// Cuts each edge into so many equal parts.
  void cut_evenly(int parts) {
    std::vector<Triangle> made;
    for (const auto& [a, b, c] : triangles_) {
      const auto at = [&](int i, int j) {
        Place place;
        const int counts[] = {parts - i - j, i, j}, corners[] = {a, b, c};
        for (int k = 0; k < 3; ++k)
          if (counts[k] > 0) place[places_[corners[k]].begin()->first] = static_cast<double>(counts[k]) / parts;
        return vertex(place);
      };
      for (int i = 0; i < parts; ++i)
        for (int j = 0; i + j < parts; ++j) {
          made.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
          if (i + j + 1 < parts) made.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    }
    triangles_ = std::move(made);
  }

  /// Halves edges, the longest of a triangle first, until none is longer. Both triangles at an edge see it as equally long,
  /// so that they agree about its middle.
  void cut_down_to(double longest) {
    std::vector<Triangle> open = std::move(triangles_);
    triangles_.clear();
    while (!open.empty()) {
      const Triangle triangle = open.back();
      open.pop_back();
      int most = 0;
      std::array<double, 3> lengths;
      for (int k = 0; k < 3; ++k) {
        lengths[k] = (rest_[triangle[k]] - rest_[triangle[(k + 1) % 3]]).norm();
        if (lengths[k] > lengths[most]) most = k;
      }
      if (lengths[most] <= longest) {
        triangles_.push_back(triangle);
        continue;
      }
      const int a = triangle[most], b = triangle[(most + 1) % 3], c = triangle[(most + 2) % 3], middle = middle_of(a, b);
      open.push_back({a, middle, c});
      open.push_back({middle, b, c});
    }
  }

  CollisionProxy<3> finish(const std::map<int, int>& order) {
    std::set<Edge> edges;
    for (const auto& [a, b, c] : triangles_)
      for (const Edge& edge : {Edge{a, b}, Edge{b, c}, Edge{c, a}}) edges.insert(sorted(edge));
    return {rest_, {edges.begin(), edges.end()}, triangles_, weights(edges_of_order_2(mesh_, order))};
  }

 private:
  int vertex(const Place& place) {
    const auto [found, is_new] = vertices_.try_emplace(place, static_cast<int>(rest_.size()));
    if (!is_new) return found->second;
    Vec<3> X = Vec<3>::Zero();
    for (const auto& [v, weight] : place) X += weight * mesh_.rest(v);
    rest_.push_back(X);
    places_.push_back(place);
    return found->second;
  }

  int middle_of(int a, int b) {
    Place place;
    for (const int end : {a, b})
      for (const auto& [v, weight] : places_[end]) place[v] += weight / 2;
    return vertex(place);
  }

  /// Shape functions of linear facets, of which a curved edge takes from both ends what it gives to its node.
  Eigen::SparseMatrix<double, Eigen::RowMajor> weights(const std::vector<EdgeKey>& curved) const {
    std::vector<Eigen::Triplet<double>> triplets;
    for (int row = 0; row < static_cast<int>(rest_.size()); ++row) {
      const Place& place = places_[row];
      for (const auto& [v, weight] : place) triplets.emplace_back(row, v, weight);
      for (auto i = place.begin(); i != place.end(); ++i)
        for (auto j = std::next(i); j != place.end(); ++j) {
          const EdgeKey edge{i->first, j->first};
          const auto found = std::ranges::lower_bound(curved, edge);
          if (found == curved.end() || *found != edge) continue;
          const double product = 2 * i->second * j->second;
          triplets.emplace_back(row, i->first, -product);
          triplets.emplace_back(row, j->first, -product);
          triplets.emplace_back(row, mesh_.node_slots() + static_cast<int>(found - curved.begin()), 2 * product);
        }
    }
    Eigen::SparseMatrix<double, Eigen::RowMajor> result(std::ssize(rest_), mesh_.node_slots() + std::ssize(curved));
    result.setFromTriplets(triplets.begin(), triplets.end());
    return result;
  }

  const Mesh<3>& mesh_;
  std::vector<Triangle> triangles_;
  std::vector<Vec<3>> rest_;
  std::vector<Place> places_;
  std::map<Place, int> vertices_;
};

}  // namespace

CollisionProxy<3> tessellate(const Mesh<3>& mesh, const std::map<int, int>& order, const Cuts& cuts) {
  Tessellator tessellator(mesh);
  if (cuts.parts > 0)
    tessellator.cut_evenly(cuts.parts);
  else
    tessellator.cut_down_to(cuts.longest);
  return tessellator.finish(order);
}

}  // namespace itr::scene
