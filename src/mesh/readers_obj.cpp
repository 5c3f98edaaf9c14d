// SPDX-License-Identifier: MIT
// Wavefront .obj: vertices, triangles, polylines. Texture coordinates, normals, groups and materials are passed over.
#include "cursor.hpp"
#include "readers.hpp"

namespace itr {

namespace {

class ObjReader {
 public:
  ObjReader(std::string_view bytes, const std::filesystem::path& file) : line_(bytes, file), file_(file) {}

  MeshFile read() {
    while (line_.next()) read_line();
    return std::move(mesh_);
  }

 private:
  void read_line() {
    const std::string_view keyword = word();
    if (keyword == "v") {
      read_vertex();
    } else if (keyword == "f") {
      const std::vector<int> corners = indices();
      if (corners.size() != 3)
        line_.fail("a face with " + std::to_string(corners.size()) + " corners",
                   "3: triangles only" + (corners.size() == 4 ? "; " + split_advice(file_) : ""));
      mesh_.triangles.push_back({corners[0], corners[1], corners[2]});
    } else if (keyword == "l") {
      const std::vector<int> points = indices();
      if (points.size() < 2) line_.fail("a line with fewer than 2 points", "at least 2");
      for (std::size_t i = 0; i + 1 < points.size(); ++i) mesh_.edges.push_back({points[i], points[i + 1]});
    }
  }

  void read_vertex() {
    Vec<3> vertex = Vec<3>::Zero();
    int count = 0;
    for (std::string_view token = word(); !token.empty() && count < 3; token = word()) {
      const std::optional<double> coordinate = number_of<double>(token);
      if (!coordinate) line_.fail(quoted(token), "a coordinate");
      vertex[count++] = *coordinate;
    }
    if (count < 2) line_.fail("a vertex with fewer than 2 coordinates", "2 or 3");
    mesh_.vertices.push_back(vertex);
  }

  /// The vertex of each corner `v`, `v/vt` or `v/vt/vn`; negative ones count back from the last vertex so far.
  std::vector<int> indices() {
    std::vector<int> result;
    for (std::string_view token = word(); !token.empty(); token = word()) {
      const int index = number_of<int>(token.substr(0, token.find('/'))).value_or(0);
      if (index == 0) line_.fail(quoted(token), "a vertex index, from 1");
      const int vertex = index > 0 ? index - 1 : static_cast<int>(mesh_.vertices.size()) + index;
      if (vertex < 0) line_.fail(quoted(token), "an index of a vertex before this line");
      result.push_back(vertex);
    }
    return result;
  }

  std::string_view word() {
    constexpr std::string_view kSpace = " \t\r";
    std::string_view& text = line_.text;
    const auto begin = text.find_first_not_of(kSpace);
    if (begin == std::string_view::npos || text[begin] == '#') return {};
    const auto end = std::min(text.find_first_of(kSpace, begin), text.size());
    const std::string_view result = text.substr(begin, end - begin);
    text = text.substr(end);
    return result;
  }

  Lines line_;
  std::filesystem::path file_;
  MeshFile mesh_;
};

}  // namespace

MeshFile read_obj(std::string_view bytes, const std::filesystem::path& file) { return ObjReader(bytes, file).read(); }

}  // namespace itr
