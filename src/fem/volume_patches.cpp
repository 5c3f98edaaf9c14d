// SPDX-License-Identifier: MIT
#include "fem/volume_patches.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

#include "fem/cell_set.hpp"
#include "fem/quadrature.hpp"

namespace itr {

namespace {

template <int Dim>
class PatchBuilder {
 public:
  PatchBuilder(const CellSet<Dim>& cells, const std::function<bool(int)>& is_averaged)
      : cells_(cells), elements_of_(cells.rest.size()), patches_(std::make_shared<VolumePatches<Dim>>()) {
    typename std::remove_cvref_t<decltype(patches_->patch_of[0])> none;
    none.fill(kNone);
    patches_->patch_of.assign(cells.elements.size(), none);
    for (std::size_t e = 0; e < cells.elements.size(); ++e) {
      if (!is_averaged(cells.elements[e].body)) continue;
      averaged_.push_back(static_cast<int>(e));
      for (const int v : cells.elements[e].vertices) elements_of_[v].push_back(static_cast<int>(e));
    }
  }

  std::shared_ptr<const VolumePatches<Dim>> build() {
    find_hats();
    find_stars();
    while (adopt_orphans()) {
    }
    for (const int e : averaged_)  // touch others in edges or vertices only
      if (left_of(e) > 0 && star(e) == kNone) star(e) = new_patch(e);
    drop_empty();
    list_members();
    return patches_;
  }

 private:
  static constexpr int kLeft = VolumePatches<Dim>::kLeft;

  int& star(int e) { return patches_->patch_of[e][kLeft]; }
  int new_patch(int e) {
    patches_->body.push_back(cells_.elements[e].body);
    patches_->volume.push_back(0);
    return static_cast<int>(patches_->body.size()) - 1;
  }
  /// How many (Dim + 1)-th parts of an element the hats of its corners leave.
  int left_of(int e) const {
    const auto& parts = patches_->patch_of[e];
    return static_cast<int>(std::count(parts.begin(), parts.begin() + kLeft, kNone));
  }

  void find_hats() {
    for (std::size_t v = 0; v < elements_of_.size(); ++v) {
      std::map<int, bool> has_hat;  // by body
      for (const int e : elements_of_[v]) {
        bool& has = has_hat.emplace(cells_.elements[e].body, true).first->second;
        has = has && cells_.elements[e].curved == kAllCurved<Dim>;
      }
      std::map<int, int> patch;
      for (const int e : elements_of_[v]) {
        const auto& element = cells_.elements[e];
        if (!has_hat[element.body]) continue;
        const auto [it, is_first] = patch.emplace(element.body, kNone);
        if (is_first) it->second = new_patch(e);
        const auto corner = std::find(element.vertices.begin(), element.vertices.end(), static_cast<int>(v));
        patches_->patch_of[e][static_cast<std::size_t>(corner - element.vertices.begin())] = it->second;
      }
    }
  }

  /// A maximal independent set: no two centres share an edge, and each vertex is one or sees one. Inner vertices come first:
  /// conditions hold much of the patches at the surface.
  void find_stars() {
    std::vector<char> sees(elements_of_.size(), 0), is_outer(elements_of_.size(), 0);
    for (const auto& facet : cells_.facets)
      for (const int v : facet.vertices) is_outer[v] = 1;
    std::vector<std::size_t> order(elements_of_.size());
    std::iota(order.begin(), order.end(), 0);
    std::ranges::stable_partition(order, [&](std::size_t v) { return !is_outer[v]; });
    for (const std::size_t v : order) {
      if (sees[v] || elements_of_[v].empty()) continue;
      std::map<int, int> patch;  // by body
      for (const int e : elements_of_[v]) {
        for (const int w : cells_.elements[e].vertices) sees[w] = 1;
        const auto [it, is_first] = patch.emplace(cells_.elements[e].body, kNone);
        if (is_first) it->second = new_patch(e);
        star(e) = it->second;
        patches_->volume[it->second] += cells_.elements[e].volume;
      }
    }
  }

  /// Elements without a centre join the star that most of their facets touch, of these the smallest. Says whether any did.
  bool adopt_orphans() {
    using Facet = std::array<int, Dim>;
    std::map<Facet, std::vector<int>> beside;  // of orphans' facets
    std::vector<int> orphans;
    const auto facets_of = [&](int e) {
      std::array<Facet, Dim + 1> facets;
      for (int k = 0; k <= Dim; ++k) facets[k] = ascending(opposite_facet<Dim>(cells_.elements[e].vertices, k));
      return facets;
    };
    for (const int e : averaged_) {
      if (star(e) != kNone) continue;
      orphans.push_back(e);
      for (const Facet& facet : facets_of(e)) beside[facet];
    }
    for (const int e : averaged_)
      if (star(e) != kNone)
        for (const Facet& facet : facets_of(e))
          if (const auto it = beside.find(facet); it != beside.end()) it->second.push_back(e);
    std::vector<std::pair<int, int>> adopted;
    for (const int e : orphans) {
      std::map<int, int> touching;
      for (const Facet& facet : facets_of(e))
        for (const int other : beside[facet])
          if (cells_.elements[other].body == cells_.elements[e].body) ++touching[star(other)];
      const auto rank = [&](const auto& entry) {
        return std::tuple(-entry.second, patches_->volume[entry.first], entry.first);
      };
      const auto best = std::ranges::min_element(touching, {}, rank);
      if (best != touching.end()) adopted.emplace_back(e, best->first);
    }
    for (const auto& [e, patch] : adopted) {
      star(e) = patch;
      patches_->volume[patch] += cells_.elements[e].volume;
    }
    return !adopted.empty();
  }

  /// Integrates the weight of a part of an element over the full turn: weights and radii are linear.
  double turned_volume(int e, int part) const {
    const auto& element = cells_.elements[e];
    double sum = 0;
    for (const auto& point : quadrature<Dim>(2))
      sum += point.fraction * patches_->weight(e, part, point.weights) *
             cells_.turn(rest_position<Dim>(cells_, element, point.weights));
    return element.volume * sum;
  }
  /// Sets the volumes, and renumbers patches that have some.
  void drop_empty() {
    std::vector<double> volume(patches_->body.size(), 0.0);
    for (const int e : averaged_) {
      if (left_of(e) == 0) star(e) = kNone;
      for (int part = 0; part <= kLeft; ++part)
        if (const int patch = patches_->patch_of[e][part]; patch != kNone)
          volume[patch] += cells_.axisymmetric ? turned_volume(e, part)
                                               : cells_.elements[e].volume * (part == kLeft ? left_of(e) : 1) / (Dim + 1);
    }
    std::vector<int> number(volume.size(), kNone), body;
    patches_->volume.clear();
    for (std::size_t i = 0; i < volume.size(); ++i) {
      if (volume[i] == 0) continue;
      number[i] = static_cast<int>(body.size());
      body.push_back(patches_->body[i]);
      patches_->volume.push_back(volume[i]);
    }
    patches_->body = std::move(body);
    for (auto& parts : patches_->patch_of)
      for (int& patch : parts)
        if (patch != kNone) patch = number[patch];
  }

  void list_members() {
    std::vector<std::vector<typename VolumePatches<Dim>::Member>> members(patches_->count());
    for (const int e : averaged_)
      for (int part = 0; part <= kLeft; ++part)
        if (const int patch = patches_->patch_of[e][part]; patch != kNone) members[patch].push_back({e, part});
    for (const auto& of_patch : members) {
      patches_->first_member.push_back(patches_->members.size());
      patches_->first_node.push_back(patches_->nodes.size());
      std::vector<int> nodes;
      for (const auto& member : of_patch) {
        const auto of_element = cells_.elements[member.element].nodes();  // at straight edges vertices
        nodes.insert(nodes.end(), of_element.begin(), of_element.end());
      }
      std::sort(nodes.begin(), nodes.end());
      nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
      patches_->members.insert(patches_->members.end(), of_patch.begin(), of_patch.end());
      patches_->nodes.insert(patches_->nodes.end(), nodes.begin(), nodes.end());
    }
    patches_->first_member.push_back(patches_->members.size());
    patches_->first_node.push_back(patches_->nodes.size());
  }

  const CellSet<Dim>& cells_;
  std::vector<int> averaged_;                  ///< elements
  std::vector<std::vector<int>> elements_of_;  ///< by vertex
  std::shared_ptr<VolumePatches<Dim>> patches_;
};

}  // namespace

template <int Dim>
std::shared_ptr<const VolumePatches<Dim>> volume_patches(const CellSet<Dim>& cells,
                                                         const std::function<bool(int)>& is_averaged) {
  return PatchBuilder<Dim>(cells, is_averaged).build();
}

template std::shared_ptr<const VolumePatches<2>> volume_patches(const CellSet<2>&, const std::function<bool(int)>&);
template std::shared_ptr<const VolumePatches<3>> volume_patches(const CellSet<3>&, const std::function<bool(int)>&);

}  // namespace itr
