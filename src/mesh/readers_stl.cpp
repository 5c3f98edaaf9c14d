// SPDX-License-Identifier: MIT
// .stl, text and binary (3D Systems, "StereoLithography Interface Specification", 1989): triangles with corners of their
// own, which are welded here.
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstdint>
#include <map>

#include "cursor.hpp"
#include "readers.hpp"

namespace itr {

namespace {

constexpr std::size_t kHead = 80, kTriangle = 50;  ///< bytes

/// Corners that are farther apart than this are different vertices, relative to the diagonal of all: single precision has
/// seven digits.
constexpr double kWeld = 1e-6;

class StlReader {
 public:
  StlReader(std::string_view bytes, const std::filesystem::path& file) : bytes_(bytes), in_(bytes, file) {}

  MeshFile read() {
    is_binary() ? read_binary() : read_text();
    weld();
    note_open_edges();
    return std::move(mesh_);
  }

 private:
  /// By the length, since heads of binary files may begin with "solid", too.
  bool is_binary() const {
    if (bytes_.size() < kHead + 4) return false;
    std::uint32_t count = 0;
    std::memcpy(&count, bytes_.data() + kHead, sizeof(count));
    return bytes_.size() == kHead + 4 + kTriangle * std::size_t{count};
  }

  void read_binary() {
    in_.binary = true;
    for (std::size_t i = 0; i < kHead + 4; i += 4) in_.raw<float>();
    while (!in_.is_at_end()) {
      for (int c = 0; c < 3; ++c) in_.raw<float>();
      for (int corner = 0; corner < 3; ++corner) {
        const float x = in_.raw<float>(), y = in_.raw<float>(), z = in_.raw<float>();
        corners_.emplace_back(x, y, z);
      }
      in_.raw<std::uint16_t>();
    }
  }

  void read_text() {
    if (in_.word() != "solid") in_.fail("another beginning", "'solid', or as many triangles as a binary file says");
    in_.end_line();
    for (std::string_view word = in_.word(); !word.empty(); word = in_.word()) {
      if (word == "solid" || word == "endsolid") {
        in_.end_line();
        continue;
      }
      if (word != "facet") in_.fail(quoted_start(word), "'facet' or 'endsolid'");
      expect("normal");
      for (int c = 0; c < 3; ++c) in_.word();  // some programs write nan
      expect("outer"), expect("loop");
      for (int corner = 0; corner < 3; ++corner) {
        expect("vertex");
        Vec<3> X;
        for (int c = 0; c < 3; ++c) X[c] = in_.text<double>();
        corners_.push_back(X);
      }
      expect("endloop"), expect("endfacet");
    }
  }

  void expect(std::string_view word) {
    const std::string_view found = in_.word();
    if (found != word) in_.fail(found.empty() ? "the end of the file" : quoted_start(found), quoted(word));
  }

  /// Corners near an earlier one become that; triangles that nothing is left of go.
  void weld() {
    Box3 box;
    for (const Vec<3>& X : corners_) {
      if (!X.allFinite()) in_.fail("a coordinate that is not finite", "finite ones");
      box.extend(X);
    }
    const double length = corners_.empty() ? 1 : std::max(kWeld * box.diagonal().norm(), 1e-300);
    Grid grid;
    std::map<std::array<double, 3>, int> known;  // by exact place, since most corners are equal
    std::vector<int> vertex_of;
    for (const Vec<3>& X : corners_) {
      const auto [found, is_new] = known.try_emplace({X[0], X[1], X[2]}, 0);
      if (is_new) found->second = find_or_add(X, length, grid);
      vertex_of.push_back(found->second);
    }
    std::size_t lost = 0;
    for (std::size_t t = 0; t + 2 < vertex_of.size(); t += 3) {
      const std::array<int, 3> triangle = {vertex_of[t], vertex_of[t + 1], vertex_of[t + 2]};
      const auto [a, b, c] = triangle;
      if (a == b || b == c || c == a)
        ++lost;
      else
        mesh_.triangles.push_back(triangle);
    }
    if (lost > 0) mesh_.notes.push_back(fmt::format("{} triangles without area are left out", lost));
  }

  using Box3 = Eigen::AlignedBox<double, 3>;
  using Grid = std::map<std::array<double, 3>, std::vector<int>>;  ///< vertices by place, in units of a length

  int find_or_add(const Vec<3>& X, double length, Grid& vertices) {
    const Vec<3> place = (X / length).array().floor();
    for (int i = -1; i <= 1; ++i)
      for (int j = -1; j <= 1; ++j)
        for (int k = -1; k <= 1; ++k) {
          const auto found = vertices.find({place[0] + i, place[1] + j, place[2] + k});
          if (found == vertices.end()) continue;
          for (const int v : found->second)
            if ((mesh_.vertices[v] - X).norm() <= length) return v;
        }
    const int vertex = static_cast<int>(mesh_.vertices.size());
    mesh_.vertices.push_back(X);
    vertices[{place[0], place[1], place[2]}].push_back(vertex);
    return vertex;
  }

  void note_open_edges() {
    std::map<std::array<int, 2>, int> count;
    for (const auto& [a, b, c] : mesh_.triangles)
      for (const auto& [p, q] : {std::array{a, b}, std::array{b, c}, std::array{c, a}})
        ++count[{std::min(p, q), std::max(p, q)}];
    int open = 0;
    const std::array<int, 2>* first = nullptr;
    for (const auto& [edge, triangles] : count)
      if (triangles == 1 && ++open == 1) first = &edge;
    if (!first) return;
    const Vec<3>& X = mesh_.vertices[(*first)[0]];
    mesh_.notes.push_back(
        fmt::format("is an open shell: {} edges belong to one triangle only, the first at ({:.4g}, {:.4g}, {:.4g})", open,
                    X[0], X[1], X[2]));
  }

  std::string_view bytes_;
  Cursor in_;
  std::vector<Vec<3>> corners_;  ///< of the triangles, one after another
  MeshFile mesh_;
};

}  // namespace

MeshFile read_stl(std::string_view bytes, const std::filesystem::path& file) { return StlReader(bytes, file).read(); }

}  // namespace itr
