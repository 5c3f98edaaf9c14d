// SPDX-License-Identifier: MIT
#include "fem/refined_chords.hpp"

#include <algorithm>
#include <unordered_map>
#include <utility>

#include "fem/chords.hpp"

namespace itr {

namespace {

/// Halves chords facet by facet. Points of an edge are made once, for both of its facets.
template <int Dim>
class ChordRefiner {
 public:
  using Facet = typename MeshTypes<Dim>::Facet;
  using Result = RefinedChords<Dim>;
  using Coordinates = typename Result::Coordinates;

  ChordRefiner(const Mesh<Dim>& mesh, const ChordLevels& levels) : mesh_(mesh), levels_(levels) {}

  void add(FacetId f) {
    root_ = mesh_.facet(f);
    coordinates_.clear();
    for (int i = 0; i < Dim; ++i) {
      coordinates_[root_[i]] = {};
      coordinates_[root_[i]][i] = 1;
    }
    for (int i = 0; i < Dim; ++i)
      for (int j = 0; j < i; ++j) {
        const EdgeKey edge = edge_key(root_[i], root_[j]);
        const int node = mesh_.node_of(edge);
        halvings_[edge] = node == kNone ? 0 : 1 + (levels_.empty() ? 0 : levels_[node - mesh_.num_vertices()]);
        if (node != kNone) middles_[edge] = node;
      }
    refine(root_, f);
  }
  Result result() && { return std::move(result_); }

 private:
  void refine(const Facet& facet, FacetId parent) {
    int most = 0;
    for_each_edge(facet, [&](const EdgeKey& edge) { most = std::max(most, halvings_.at(edge)); });
    if (most == 0) {
      result_.facets.push_back(facet);
      result_.parents.push_back(parent);
      auto& corners = result_.coordinates.emplace_back();
      for (int i = 0; i < Dim; ++i) corners[i] = coordinates_.at(facet[i]);
      return;
    }
    std::vector<Facet> parts;
    for_each_chord<Dim>(
        facet, [&](int a, int b) { return middle_of(edge_key(a, b)); }, [&](const Facet& part) { parts.push_back(part); });
    for (const Facet& part : parts)  // edges across the facet
      for_each_edge(part, [&](const EdgeKey& edge) { halvings_.try_emplace(edge, most - 1); });
    for (const Facet& part : parts) refine(part, parent);
  }

  template <typename Visit>
  static void for_each_edge(const Facet& facet, const Visit& visit) {
    for (int i = 0; i < Dim; ++i)
      for (int j = 0; j < i; ++j) visit(edge_key(facet[i], facet[j]));
  }

  /// The point halfway along an edge that is still to be halved, else kNone.
  int middle_of(const EdgeKey& edge) {
    const int halvings = halvings_.at(edge);
    if (halvings == 0) return kNone;
    Coordinates middle;
    for (int k = 0; k < Dim; ++k) middle[k] = (coordinates_.at(edge[0])[k] + coordinates_.at(edge[1])[k]) / 2;
    const auto [at, is_new] = middles_.try_emplace(edge, 0);
    if (is_new) {
      at->second = mesh_.num_nodes() + static_cast<int>(result_.points.size());
      result_.points.push_back(weights_at(middle));
    }
    const int point = at->second;
    coordinates_[point] = middle;
    for (const int end : edge) halvings_[edge_key(end, point)] = halvings - 1;
    return point;
  }

  typename Result::Weights weights_at(const Coordinates& at) const {
    typename Result::Weights weights;
    Coordinates of_corners;
    for (int i = 0; i < Dim; ++i) of_corners[i] = at[i] * (2 * at[i] - 1);
    for (int i = 0; i < Dim; ++i)
      for (int j = 0; j < i; ++j) {
        const double product = at[i] * at[j];
        const int node = mesh_.node_of(root_[i], root_[j]);
        if (product == 0) continue;
        if (node != kNone) {
          weights.emplace_back(node, 4 * product);
        } else {
          of_corners[i] += 2 * product;
          of_corners[j] += 2 * product;
        }
      }
    for (int i = 0; i < Dim; ++i)
      if (of_corners[i] != 0) weights.emplace_back(root_[i], of_corners[i]);
    return weights;
  }

  const Mesh<Dim>& mesh_;
  const ChordLevels& levels_;
  Facet root_{};
  std::unordered_map<int, Coordinates> coordinates_;        ///< in the root
  std::unordered_map<EdgeKey, int, EdgeKeyHash> halvings_;  ///< that are still to come
  std::unordered_map<EdgeKey, int, EdgeKeyHash> middles_;
  Result result_;
};

}  // namespace

template <int Dim>
RefinedChords<Dim> refine_chords(const Mesh<Dim>& mesh, const ChordLevels& levels) {
  ChordRefiner<Dim> refiner(mesh, levels);
  for (const FacetId f : mesh.live_facets()) refiner.add(f);
  return std::move(refiner).result();
}

template RefinedChords<2> refine_chords(const Mesh<2>&, const ChordLevels&);
template RefinedChords<3> refine_chords(const Mesh<3>&, const ChordLevels&);

}  // namespace itr
