// SPDX-License-Identifier: MIT
#include "mesh_sequence.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <memory>

#include "transformation.hpp"

namespace itr::scene {

namespace fs = std::filesystem;

namespace {

/// Whether a name comes before another one where digits count as the numbers that they are: a2 before a10.
bool is_before(const std::string& a, const std::string& b) {
  const auto is_digit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
  const auto digits_from = [&](const std::string& text, std::size_t begin) {
    std::size_t end = begin;
    while (end < text.size() && is_digit(text[end])) ++end;
    while (begin + 1 < end && text[begin] == '0') ++begin;
    return std::pair(text.substr(begin, end - begin), end);
  };
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      const auto [m, end_m] = digits_from(a, i);
      const auto [n, end_n] = digits_from(b, j);
      if (m.size() != n.size()) return m.size() < n.size();
      if (m != n) return m < n;
      i = end_m;
      j = end_n;
    } else if (a[i] != b[j]) {
      return a[i] < b[j];
    } else {
      ++i;
      ++j;
    }
  }
  return a.size() - i < b.size() - j || (a.size() - i == b.size() - j && a < b);
}

/// Whether a name matches a pattern in which * stands for any characters.
bool matches(std::string_view name, std::string_view pattern) {
  if (pattern.empty()) return name.empty();
  if (pattern.front() != '*')
    return !name.empty() && name.front() == pattern.front() && matches(name.substr(1), pattern.substr(1));
  for (std::size_t skipped = 0; skipped <= name.size(); ++skipped)
    if (matches(name.substr(skipped), pattern.substr(1))) return true;
  return false;
}

std::vector<std::string> files_of(const Node& node) {
  std::vector<std::string> files;
  if (node.json().is_array()) {
    for (const Node& item : node.items()) files.push_back(item.string(""));
  } else {
    const fs::path path = node.document().resolve(node.string(""));
    std::error_code ignored;
    const bool is_folder = fs::is_directory(path, ignored);
    const std::string pattern = path.filename().string();
    for (const auto& entry : fs::directory_iterator(is_folder ? path : path.parent_path(), ignored)) {
      const std::string name = entry.path().filename().string();
      if (entry.is_regular_file(ignored) && !name.starts_with('.') && (is_folder || matches(name, pattern)))
        files.push_back(entry.path().lexically_normal().string());
    }
    std::ranges::sort(files, is_before);
  }
  if (files.empty())
    node.fail(abbreviate(node.json()) + ", where there is no file", "a folder of mesh files, or their list");
  return files;
}

}  // namespace

bool is_mesh_sequence(const Node& geometry) { return geometry["type"].string("mesh") == "mesh_sequence"; }

void expand_mesh_sequences(Document& document) {
  const Node root(document);
  for (const Node& geometry : root["geometry"].items()) {
    const bool is_sequence = is_mesh_sequence(geometry);
    for (const char* key : {"mesh_sequence", "fps"})
      if (geometry.has(key) != is_sequence)
        geometry[key].fail(is_sequence ? "nothing" : "it beside this type",
                           is_sequence ? "it with \"mesh_sequence\": its files, and how many of them a unit of time"
                                       : "\"type\": \"mesh_sequence\"");
    if (!is_sequence || !geometry["enabled"].boolean(true)) continue;
    for (const char* key : {"mesh", "n_refs"})
      if (geometry.has(key)) geometry[key].fail("it beside mesh_sequence", "no such key");
    if (!geometry["is_obstacle"].boolean(false))
      geometry["is_obstacle"].fail("false with mesh_sequence", "true: bodies move by their forces");
    Json frames = Json::array();
    for (const std::string& file : files_of(geometry["mesh_sequence"])) frames.push_back({{"mesh", file}});
    Json& json = document.json.at(Json::json_pointer(geometry.pointer()));
    json["mesh"] = frames.front()["mesh"];
    json["mesh_sequence"] = std::move(frames);
  }
}

template <int Dim>
void add_sequence(const Node& geometry, MeshFiles& files, const std::vector<char>& is_used, std::size_t first,
                  Obstacles<Dim>& obstacles) {
  struct Frames {
    std::vector<std::vector<Vec<Dim>>> displacements;  ///< by vertex and frame
    double rate;                                       ///< frames by unit of time
  };
  const auto frames = std::make_shared<Frames>();
  frames->rate = geometry["fps"].positive(1);
  frames->displacements.resize(obstacles.rest.size() - first);
  const MeshFile& start = files.get(geometry);
  for (const Node& frame : geometry["mesh_sequence"].items()) {
    const MeshFile& file = files.get(frame);
    if (file.vertices.size() != start.vertices.size() || file.edges != start.edges || file.triangles != start.triangles ||
        file.tetrahedra != start.tetrahedra)
      frame["mesh"].fail(abbreviate(frame["mesh"].json()) + ", whose elements differ from those of the first file",
                         "files that differ in coordinates only");
    std::vector<Vec<Dim>> points = points_of<Dim>(file);
    transform<Dim>(points, geometry);
    std::size_t at = 0;
    for (std::size_t v = 0; v < points.size(); ++v) {
      if (!is_used[v]) continue;
      frames->displacements[at].push_back(points[v] - obstacles.rest[first + at]);
      ++at;
    }
  }
  for (std::size_t i = 0; i < frames->displacements.size(); ++i) {
    obstacles.motion[first + i] = static_cast<int>(obstacles.motions.size());
    obstacles.motions.push_back([frames, i](const RestPoint<Dim>&, double t) {
      const std::vector<Vec<Dim>>& of_vertex = frames->displacements[i];
      const double last = static_cast<double>(of_vertex.size() - 1), frame = std::clamp(t * frames->rate, 0.0, last);
      const auto before = static_cast<std::size_t>(frame);
      const std::size_t after = std::min(before + 1, of_vertex.size() - 1);
      const double part = frame - std::floor(frame);
      return Vec<Dim>((1 - part) * of_vertex[before] + part * of_vertex[after]);
    });
  }
}

#define ITR_INSTANTIATE(Dim) \
  template void add_sequence(const Node&, MeshFiles&, const std::vector<char>&, std::size_t, Obstacles<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr::scene
