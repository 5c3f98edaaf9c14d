// SPDX-License-Identifier: MIT
// Bodies and obstacles as solids that a point may be inside of: signed distances, and how deep they are in each other.
#pragma once

#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "fem/chord_levels.hpp"
#include "geometry/bvh.hpp"
#include "geometry/closed_surface.hpp"
#include "itr/setup.hpp"

namespace itr {

/// A point of a facet: a combination of its corners.
template <int Dim>
struct FacetPoint {
  std::array<int, Dim> vertices{};
  std::array<double, Dim> weights{};

  Vec<Dim> at(ConstVectorView y) const {
    Vec<Dim> p = Vec<Dim>::Zero();
    for (int k = 0; k < Dim; ++k) p += weights[k] * y.segment<Dim>(Dim * vertices[k]);
    return p;
  }
};

/// A connected part of the bodies, or of the obstacles.
template <int Dim>
struct Solid {
  int part = kNone;                                            ///< Mesh::part; kNone: of obstacles
  int body = kNone;                                            ///< id of one of its bodies
  bool is_flat = false;                                        ///< an obstacle without end
  double thickness = std::numeric_limits<double>::infinity();  ///< of its thinnest body [m]
  std::vector<std::array<int, Dim>> facets;  ///< vertices of the contact surface; those of bodies are oriented outward
  std::vector<FacetPoint<Dim>> points;       ///< of these: corners, middles of edges, and in 3D of facets
  std::vector<std::vector<int>> facets_at;   ///< by point: the facets that have it
};

/// The solids of a setup whose contact surface has no proxy.
template <int Dim>
std::vector<Solid<Dim>> find_solids(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& chords);

/// Where a point is from a solid. `beside`: the nearest facet faces none at the point, as where sides of two bodies are
/// flush, and the way out is through one that does; `none`: no such facet is there.
template <int Dim>
struct Nearest {
  enum class Way { out, beside, none };
  FacetPoint<Dim> foot;
  Vec<Dim> normal;  ///< of length 1: the way out
  double gap = 0;   ///< negative inside [m]
  Way way = Way::none;
};

/// How deep points of one solid are in another.
template <int Dim>
struct Penetration {
  std::size_t solid, in;
  double depth = 0;      ///< the largest [m]
  Vec<Dim> place;        ///< of that [m]
  bool is_whole = true;  ///< all points are inside
};

/// Solids at one configuration. A body is outside of other bodies, and on that side of an obstacle where most of its points
/// were in the first configuration: also inside of a closed obstacle.
template <int Dim>
class Solids {
 public:
  /// `y`: positions of the contact surface [m].
  Solids(std::vector<Solid<Dim>> solids, ConstVectorView y);
  /// Makes the solids of `first` elsewhere.
  Solids(const Solids& first, ConstVectorView y);

  const std::vector<Solid<Dim>>& all() const { return solids_; }
  /// Finds bodies in bodies, bodies in obstacles and obstacles in bodies.
  std::vector<Penetration<Dim>> penetrations() const;
  /// Where closed obstacles are in each other.
  std::optional<Vec<Dim>> find_crossing_obstacles() const;
  /// Calls visit(point, nearest) for the points that are less than `gap` apart from another solid, or inside of it, and have
  /// a way out.
  template <typename Visit>
  void for_each_near(double gap, const Visit& visit) const {
    for (std::size_t i = 0; i < solids_.size(); ++i)
      for (std::size_t j = 0; j < solids_.size(); ++j)
        for (const auto& [point, nearest] : find_near_points(i, j, gap)) visit(solids_[i].points[point], nearest);
  }

 private:
  struct Shape {
    Box<Dim> box;
    Bvh<Dim> tree;
    std::vector<Vec<Dim>> normals;             ///< by facet: of length 1, outward of bodies
    std::optional<ClosedSurface<Dim>> closed;  ///< none: it has no inside
  };

  void make_shapes();
  /// On which side of the solid j the solid i has to be: 1 outside, -1 inside, 0 where nothing is asked.
  double side_of(std::size_t i, std::size_t j) const { return sides_[i * solids_.size() + j]; }
  double find_side(std::size_t i, std::size_t j) const;
  /// Whether a facet of the solid j faces one at a point of the solid i. Obstacles, which have no orientation, always do.
  bool is_facing(std::size_t i, std::size_t point, std::size_t j, int facet) const;
  Nearest<Dim> find_nearest(std::size_t i, std::size_t point, std::size_t j) const;
  /// The nearest of the facets that face the point, by the distance of its plane; way none where the point is not before it.
  Nearest<Dim> find_facing(std::size_t i, std::size_t point, std::size_t j, double gap) const;
  std::optional<Nearest<Dim>> find_near(std::size_t i, std::size_t point, std::size_t j, double gap) const;
  std::vector<std::pair<std::size_t, Nearest<Dim>>> find_near_points(std::size_t i, std::size_t j, double gap) const;

  VectorX y_;
  std::vector<Solid<Dim>> solids_;
  std::vector<Shape> shapes_;
  std::vector<double> sides_;
};

}  // namespace itr
