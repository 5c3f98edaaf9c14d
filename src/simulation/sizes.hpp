// SPDX-License-Identifier: MIT
// How large and how thick bodies are, and how finely they are cut.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <vector>

#include "itr/mesh.hpp"

namespace itr {

struct BodySize {
  double volume = 0, surface = 0;  ///< [m^Dim], [m^(Dim-1)]
  double thickness = 0;            ///< 2 volume / surface: of a plate that, of a ball a third of its diameter [m]
  double diagonal = 0;             ///< of its box [m]
  double mean_edge = 0;            ///< of a cell of mean volume [m]
};

/// Edge lengths of a mesh at rest [m].
struct EdgeLengths {
  double shortest = 0, longest = 0;
};
template <int Dim>
EdgeLengths edge_lengths(const Mesh<Dim>& mesh);

/// By id, at rest.
template <int Dim>
std::map<int, BodySize> body_sizes(const Mesh<Dim>& mesh);

/// A vertex (2D) or edge (3D) between two facets that turn by less than 60 degrees: it may stand for a round.
template <int Dim>
struct SmoothRidge {
  std::array<int, 2> facets;
  double length = 1;  ///< of the edge [m]; 2D: 1
  double height = 0;  ///< mean of the facets' over it; 2D: their lengths [m]
  double turn = 0;    ///< [rad]
};

/// `facets` are oriented; `at(v)`: where the vertex v is [m]. By the ascending vertices of the ridges.
template <int Dim>
std::vector<SmoothRidge<Dim>> smooth_ridges(const std::vector<std::array<int, Dim>>& facets,
                                            const std::function<Vec<Dim>(int v)>& at);

/// The volume between the boundary and rounds that its corners may stand for, as a fraction of the volume, by body. A corner
/// of more than 60 degrees is one. Exact to the order of the corners for circles and spheres of regular facets.
template <int Dim>
std::map<int, double> fractions_of_rounds(const Mesh<Dim>& mesh);

}  // namespace itr
