// SPDX-License-Identifier: MIT
#include "selection_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <map>
#include <sstream>

namespace itr::scene {

namespace {

constexpr const char* kSelections[] = {"volume_selection", "surface_selection", "point_selection"};
constexpr const char* kExpected = "a file of ids";
constexpr int kLargestId = 2147483646;

/// Vertices of the elements of a file with so many corners; none for points, which are their own.
std::vector<std::vector<int>> corners_of(const MeshFile& file, int corners) {
  std::vector<std::vector<int>> elements;
  const auto add = [&](const auto& list) {
    for (const auto& element : list) elements.emplace_back(element.begin(), element.end());
  };
  if (corners == 2) add(file.edges);
  if (corners == 3) add(file.triangles);
  if (corners == 4) add(file.tetrahedra);
  if (corners == 1)
    for (int v = 0; v < static_cast<int>(file.vertices.size()); ++v) elements.push_back({v});
  for (auto& element : elements) std::sort(element.begin(), element.end());
  return elements;
}

/// Appends an element that the file of ids has and the mesh file has not.
int append(const std::vector<int>& corners, MeshFile& file) {
  if (corners.size() == 2) {
    file.edges.push_back({corners[0], corners[1]});
    return static_cast<int>(file.edges.size()) - 1;
  }
  file.triangles.push_back({corners[0], corners[1], corners[2]});
  file.triangle_body.push_back(0);
  return static_cast<int>(file.triangles.size()) - 1;
}

struct Line {
  std::string text;
  int number;
};

/// Removes the facets of the cells of a file, which have these corners.
void remove_facets_of_cells(const MeshFile& file, int corners, std::map<std::vector<int>, Line>& facets) {
  if (facets.empty()) return;
  for (const auto& cell : corners_of(file, corners + 1))
    for (int skipped = 0; skipped <= corners; ++skipped) {
      std::vector<int> facet = cell;
      facet.erase(facet.begin() + skipped);
      facets.erase(facet);
    }
}

/// `corners`: of a cell, a facet or a point; `dim`: that of the group.
void add_file(const Node& name, int offset, int corners, int dim, bool is_facet, MeshFile& file) {
  std::map<std::vector<int>, int> by_corners;
  const auto elements = corners_of(file, corners);
  for (std::size_t e = 0; e < elements.size(); ++e) by_corners.emplace(elements[e], static_cast<int>(e));
  std::map<int, std::vector<int>> members;
  std::map<std::vector<int>, Line> added;
  const auto refuse_line = [&](const Line& line, const std::string& expected) {
    name.fail(fmt::format("{}, with \"{}\" in line {}", abbreviate(name.json()), line.text, line.number), expected);
  };
  std::ifstream stream(MeshFiles::find(name, kExpected));
  int element = 0, number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    std::istringstream words(line);
    int id = 0;
    if (!(words >> id)) {
      if (words.eof()) continue;
      id = -1;
    }
    std::vector<int> vertices;
    for (int v = 0; words >> v;) vertices.push_back(v);
    const auto refuse = [&](const std::string& expected) { refuse_line({line, number}, expected); };
    const auto is_vertex = [&](int v) { return v >= 0 && v < static_cast<int>(file.vertices.size()); };
    if (id < 0 || std::int64_t{id} + offset > kLargestId || !words.eof() ||
        !std::all_of(vertices.begin(), vertices.end(), is_vertex))
      refuse("an id >= 0, or one and vertices of the mesh file, which are counted from 0");
    std::sort(vertices.begin(), vertices.end());
    if (vertices.empty()) {
      if (is_facet) refuse("the facet's vertices after the id: facets have no order of their own");
      if (element == static_cast<int>(elements.size())) refuse("a line for each element of the mesh file");
      members[id + offset].push_back(element++);
    } else if (static_cast<int>(vertices.size()) != corners) {
      refuse(std::to_string(corners) + " vertices");
    } else {
      auto [found, is_new] = by_corners.try_emplace(vertices, 0);
      if (is_new && !is_facet) refuse("the vertices of an element of the mesh file");
      if (is_new) {
        found->second = append(vertices, file);
        added.emplace(vertices, Line{line, number});
      }
      members[id + offset].push_back(found->second);
    }
  }
  if (element > 0 && element < static_cast<int>(elements.size()))
    name.fail(fmt::format("{}, with {} lines without vertices", abbreviate(name.json()), element),
              fmt::format("one for each of the {} elements of the mesh file", elements.size()));
  remove_facets_of_cells(file, corners, added);
  if (!added.empty()) refuse_line(added.begin()->second, "the vertices of a facet of the mesh file's cells");
  for (auto& [id, list] : members) {
    if (id <= 0) continue;
    std::sort(list.begin(), list.end());
    if (is_facet || dim == 0) {
      file.groups.push_back({dim, id, "", list});
    } else {
      for (const int cell : list)
        (dim == 2 ? file.triangle_body : file.tetrahedron_body)[static_cast<std::size_t>(cell)] = id;
    }
  }
}

}  // namespace

Node find_selection_file(const Node& selection) {
  const Node none = selection["no such key"];
  if (!selection.exists()) return none;
  const bool is_rule = selection.json().is_object() && selection.json().size() == 1U + selection.has("id_offset");
  const Node name = is_rule ? selection["id"] : selection;
  if (!name.exists() || !name.json().is_string()) return none;
  if (is_rule && selection.has("id_offset")) MeshFiles::find(name, kExpected);
  std::error_code ignored;
  return std::filesystem::is_regular_file(name.document().resolve(name.string("")), ignored) ? name : none;
}

bool has_selection_files(const Node& geometry) {
  return std::any_of(std::begin(kSelections), std::end(kSelections),
                     [&](const char* selection) { return find_selection_file(geometry[selection]).exists(); });
}

void add_selection_files(const Node& geometry, int dim, MeshFile& file) {
  const auto add = [&](const char* selection, int corners, int group_dim, bool is_facet) {
    if (const Node name = find_selection_file(geometry[selection]); name.exists())
      add_file(name, geometry[selection]["id_offset"].integer(0), corners, group_dim, is_facet, file);
  };
  add("volume_selection", dim + 1, dim, false);
  add("surface_selection", dim, dim - 1, true);
  add("point_selection", 1, 0, false);
}

}  // namespace itr::scene
