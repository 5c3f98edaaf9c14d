// SPDX-License-Identifier: MIT
// Wavefront .obj: vertices, triangles, polylines. Texture coordinates, normals, groups and materials are passed over.
#include <charconv>

#include "core/quoted.hpp"
#include "readers.hpp"

namespace itr {

namespace {

class ObjReader {
 public:
  ObjReader(std::string_view bytes, const std::filesystem::path& file) : rest_(bytes), file_(file) {}

  MeshFile read() {
    while (!rest_.empty()) {
      const auto end = rest_.find('\n');
      line_ = rest_.substr(0, end);
      rest_ = end == std::string_view::npos ? std::string_view() : rest_.substr(end + 1);
      ++line_number_;
      read_line();
    }
    mesh_.triangle_body.assign(mesh_.triangles.size(), 0);
    return std::move(mesh_);
  }

 private:
  void read_line() {
    const std::string_view keyword = word();
    if (keyword == "v") {
      read_vertex();
    } else if (keyword == "f") {
      const std::vector<int> corners = indices();
      if (corners.size() != 3) fail("a face with " + std::to_string(corners.size()) + " corners", "3: triangles only");
      mesh_.triangles.push_back({corners[0], corners[1], corners[2]});
    } else if (keyword == "l") {
      const std::vector<int> points = indices();
      if (points.size() < 2) fail("a line with fewer than 2 points", "at least 2");
      for (std::size_t i = 0; i + 1 < points.size(); ++i) mesh_.edges.push_back({points[i], points[i + 1]});
    }
  }

  void read_vertex() {
    Vec<3> vertex = Vec<3>::Zero();
    int count = 0;
    for (std::string_view token = word(); !token.empty() && count < 3; token = word()) {
      const std::string_view digits = token.front() == '+' ? token.substr(1) : token;
      const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), vertex[count++]);
      if (error != std::errc() || end != digits.data() + digits.size()) fail(quoted(token), "a coordinate");
    }
    if (count < 2) fail("a vertex with fewer than 2 coordinates", "2 or 3");
    mesh_.vertices.push_back(vertex);
  }

  /// The vertex of each corner `v`, `v/vt` or `v/vt/vn`; negative ones count back from the last vertex so far.
  std::vector<int> indices() {
    std::vector<int> result;
    for (std::string_view token = word(); !token.empty(); token = word()) {
      const std::string_view digits = token.substr(0, token.find('/'));
      int index = 0;
      const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), index);
      if (error != std::errc() || end != digits.data() + digits.size() || index == 0)
        fail(quoted(token), "a vertex index, from 1");
      const int vertex = index > 0 ? index - 1 : static_cast<int>(mesh_.vertices.size()) + index;
      if (vertex < 0) fail(quoted(token), "an index of a vertex before this line");
      result.push_back(vertex);
    }
    return result;
  }

  std::string_view word() {
    constexpr std::string_view kSpace = " \t\r";
    const auto begin = line_.find_first_not_of(kSpace);
    if (begin == std::string_view::npos || line_[begin] == '#') return {};
    const auto end = std::min(line_.find_first_of(kSpace, begin), line_.size());
    const std::string_view result = line_.substr(begin, end - begin);
    line_ = line_.substr(end);
    return result;
  }

  [[noreturn]] void fail(const std::string& found, const std::string& expected) const {
    throw InputError({file_.string(), "line " + std::to_string(line_number_), found, expected});
  }

  std::string_view rest_, line_;
  const std::filesystem::path& file_;
  int line_number_ = 0;
  MeshFile mesh_;
};

}  // namespace

MeshFile read_obj(std::string_view bytes, const std::filesystem::path& file) { return ObjReader(bytes, file).read(); }

}  // namespace itr
