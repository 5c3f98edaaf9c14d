// SPDX-License-Identifier: MIT
#include "mesh_builder.hpp"

#include <algorithm>
#include <utility>

#include "itr/core.hpp"

namespace itr {

namespace {

constexpr int kEdges[][2] = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};
constexpr const char* kKinds[] = {"point", "edge", "triangle", "tetrahedron"};

}  // namespace

void MeshBuilder::add_node(std::int64_t tag, const Vec<3>& X) {
  tags_.push_back(tag);
  mesh_.vertices.push_back(X);
}

int MeshBuilder::add_element(int dim, std::span<const std::int64_t> nodes, std::int64_t number) {
  const auto num_corners = static_cast<std::size_t>(dim + 1);
  const auto corners = nodes.first(num_corners);
  const int index = static_cast<int>(numbers_[dim].size());
  corners_[dim].insert(corners_[dim].end(), corners.begin(), corners.end());
  numbers_[dim].push_back(number);
  first_number_[dim].push_back(0);
  for (std::size_t e = 0; e + num_corners < nodes.size(); ++e)
    middles_.push_back({{corners[kEdges[e][0]], corners[kEdges[e][1]], nodes[num_corners + e]}, index, dim});
  return index;
}

int MeshBuilder::group(int dim, int number, std::string_view name) {
  const auto [found, is_new] = group_.try_emplace({dim, number, std::string(name)}, static_cast<int>(mesh_.groups.size()));
  if (is_new) {
    mesh_.groups.push_back({dim, number, std::string(name)});
    members_.emplace_back();
  }
  return found->second;
}

void MeshBuilder::add_member(int group, std::int64_t member) {
  members_[group].push_back(member);
  const auto& [dim, number, name, members] = mesh_.groups[group];
  if (dim > 0 && first_number_[dim][member] == 0) first_number_[dim][member] = number;
}

MeshFile MeshBuilder::finish() {
  number_nodes();
  take_elements(mesh_.edges);
  take_elements(mesh_.triangles);
  take_elements(mesh_.tetrahedra);
  take_groups();
  if (!middles_.empty()) drop_middles();
  if (lists_elements_again) {
    merge_repeated(mesh_.edges, 1);
    merge_repeated(mesh_.triangles, 2);
    merge_repeated(mesh_.tetrahedra, 3);
  }
  mesh_.triangle_body = std::move(first_number_[2]);
  mesh_.tetrahedron_body = std::move(first_number_[3]);
  for (MeshGroup& group : mesh_.groups) {
    std::sort(group.members.begin(), group.members.end());
    group.members.erase(std::unique(group.members.begin(), group.members.end()), group.members.end());
  }
  return std::move(mesh_);
}

void MeshBuilder::number_nodes() {
  const auto n = static_cast<std::int64_t>(tags_.size());
  if (n == 0) return;
  const auto [least, greatest] = std::minmax_element(tags_.begin(), tags_.end());
  const bool is_dense = *least == 1 && *greatest == n;
  index_.reserve(tags_.size());
  for (std::int64_t i = 0; i < n; ++i)
    if (!index_.emplace(tags_[i], static_cast<int>(is_dense ? tags_[i] - 1 : i)).second)
      throw InputError({file_.string(), "node " + std::to_string(tags_[i]), "the number twice", "different node numbers"});
  if (!is_dense) return;
  std::vector<Vec<3>> sorted(mesh_.vertices.size());
  for (std::size_t i = 0; i < sorted.size(); ++i) sorted[static_cast<std::size_t>(tags_[i] - 1)] = mesh_.vertices[i];
  mesh_.vertices = std::move(sorted);
}

std::string MeshBuilder::place_of(int dim, std::int64_t element) const {
  return std::string(kKinds[dim]) + " " + std::to_string(numbers_[dim][element]);
}

int MeshBuilder::index_of(std::int64_t tag, const std::string& place) const {
  const auto found = index_.find(tag);
  if (found == index_.end()) throw InputError({file_.string(), place, "node " + std::to_string(tag), "a node of the file"});
  return found->second;
}

template <std::size_t N>
void MeshBuilder::take_elements(std::vector<std::array<int, N>>& to) {
  constexpr int kDim = N - 1;
  const auto& tags = corners_[kDim];
  to.resize(numbers_[kDim].size());
  for (std::size_t i = 0; i < to.size(); ++i)
    for (std::size_t k = 0; k < N; ++k) {
      const auto found = index_.find(tags[N * i + k]);
      to[i][k] = found != index_.end() ? found->second : index_of(tags[N * i + k], place_of(kDim, static_cast<int>(i)));
    }
}

void MeshBuilder::take_groups() {
  for (std::size_t g = 0; g < members_.size(); ++g) {
    MeshGroup& group = mesh_.groups[g];
    const std::string place = "group '" + (group.name.empty() ? std::to_string(group.number) : group.name) + "'";
    for (const std::int64_t member : members_[g])
      group.members.push_back(group.dim == 0 ? index_of(member, place) : static_cast<int>(member));
  }
}

template <std::size_t N>
void MeshBuilder::merge_repeated(std::vector<std::array<int, N>>& elements, int dim) {
  const auto is_of_dim = [dim](const MeshGroup& group) { return group.dim == dim; };
  if (std::count_if(mesh_.groups.begin(), mesh_.groups.end(), is_of_dim) < 2) return;
  std::map<std::array<int, N>, int> first;
  std::vector<int> place(elements.size());
  std::vector<std::vector<int>> groups_of(elements.size());
  for (std::size_t g = 0; g < mesh_.groups.size(); ++g)
    if (mesh_.groups[g].dim == dim)
      for (const int member : mesh_.groups[g].members) groups_of[member].push_back(static_cast<int>(g));
  std::size_t kept = 0;
  for (std::size_t i = 0; i < elements.size(); ++i) {
    std::array<int, N> key = elements[i];
    std::sort(key.begin(), key.end());
    const auto [found, is_new] = first.try_emplace(key, static_cast<int>(kept));
    const bool is_again =
        !is_new && !groups_of[i].empty() && !groups_of[found->second].empty() && groups_of[i] != groups_of[found->second];
    place[i] = is_again ? found->second : static_cast<int>(kept);
    if (is_again) {
      auto& all = groups_of[found->second];
      all.insert(all.end(), groups_of[i].begin(), groups_of[i].end());
      continue;
    }
    groups_of[kept] = groups_of[i];
    first_number_[dim][kept] = first_number_[dim][i];
    elements[kept++] = elements[i];
  }
  if (kept == elements.size()) return;
  elements.resize(kept);
  first_number_[dim].resize(kept);
  for (MeshGroup& group : mesh_.groups)
    if (group.dim == dim)
      for (int& member : group.members) member = place[member];
}

/// Measures how far a node is from the middle of its edge, where it is in meshes that are straight at rest. Returns whether
/// that is more than rounding.
bool MeshBuilder::measure_sag(const Middle& middle, int a, int b, int m) {
  constexpr double kRounding = 1e-6;  // of the edge's length: digits of text files
  const Vec<3>&A = mesh_.vertices[a], &B = mesh_.vertices[b];
  const double off = (mesh_.vertices[m] - (A + B) / 2).norm(), length = (B - A).norm();
  if (off <= kRounding * length) return false;
  if (const double sag = off / length; !(sag <= mesh_.sag)) {
    mesh_.sag = sag;
    mesh_.sag_place = "node " + std::to_string(middle.tags[2]);
  }
  return true;
}

void MeshBuilder::drop_middles() {
  std::vector<char> is_middle(mesh_.vertices.size(), 0);
  for (const Middle& middle : middles_) {
    const auto& [a, b, m] = middle.tags;
    const std::string place = index_.contains(m) ? "" : place_of(middle.dim, middle.element);
    const int node = index_of(m, place);
    const bool is_curved = measure_sag(middle, index_.at(a), index_.at(b), node);
    if (!std::exchange(is_middle[node], 1) && is_curved) ++mesh_.sagging_edges;
  }
  std::vector<int> place(mesh_.vertices.size(), -1);
  std::size_t kept = 0;
  for (std::size_t v = 0; v < place.size(); ++v) {
    if (is_middle[v]) continue;
    place[v] = static_cast<int>(kept);
    mesh_.vertices[kept++] = mesh_.vertices[v];
  }
  mesh_.vertices.resize(kept);
  const auto move = [&](auto& rows, int dim) {
    for (std::size_t i = 0; i < rows.size(); ++i)
      for (int& v : rows[i]) {
        if (place[v] < 0)
          throw InputError({file_.string(), place_of(dim, static_cast<int>(i)),
                            "a corner that is a node in the middle of an edge elsewhere", "one of both"});
        v = place[v];
      }
  };
  move(mesh_.edges, 1);
  move(mesh_.triangles, 2);
  move(mesh_.tetrahedra, 3);
  for (MeshGroup& group : mesh_.groups) {
    if (group.dim != 0) continue;
    for (int& v : group.members) v = place[v];
    std::erase(group.members, -1);
  }
}

}  // namespace itr
