// SPDX-License-Identifier: MIT
// Small scenes that a writer stores, and the text of files.
#pragma once

#include <array>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "itr/output.hpp"

namespace itr::output {

inline std::string text_of(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

/// Two unit squares one above the other, a gap between them, and a line obstacle below: all that a frame refers to.
struct Plane {
  Mesh<2> mesh = Mesh<2>({{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 2}, {1, 2}, {1, 3}, {0, 3}},
                         {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}}, {1, 1, 2, 2});
  VectorX x, v;
  std::vector<double> density = {1, 2, 3, 4};
  std::vector<Vec<2>> obstacle_x = {{-1, -0.5}, {2, -0.5}};
  std::vector<std::array<int, 2>> obstacle_edges = {{0, 1}};
  std::vector<std::array<int, 3>> obstacle_triangles;

  Plane() {
    x.resize(16);
    for (int i = 0; i < 8; ++i) vertex_of<2>(x, i) = mesh.rest(i);
    v = VectorX::LinSpaced(16, 0, 1);
  }
  FrameView<2> view() const { return {mesh, x, v, density, obstacle_x, obstacle_edges, obstacle_triangles}; }
};

struct Solid {
  Mesh<3> mesh = Mesh<3>({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2, 3}}, {1});
  VectorX x, v = VectorX::Zero(12);
  std::vector<double> density = {0};
  std::vector<Vec<3>> obstacle_x = {{-9, -9, -1}, {9, -9, -1}, {0, 9, -1}};
  std::vector<std::array<int, 2>> obstacle_edges = {{0, 1}, {1, 2}, {0, 2}};
  std::vector<std::array<int, 3>> obstacle_triangles = {{0, 1, 2}};

  Solid() {
    x.resize(12);
    for (int i = 0; i < 4; ++i) vertex_of<3>(x, i) = mesh.rest(i);
  }
  FrameView<3> view() const { return {mesh, x, v, density, obstacle_x, obstacle_edges, obstacle_triangles}; }
};

}  // namespace itr::output
