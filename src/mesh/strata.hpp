// SPDX-License-Identifier: MIT
// Strata: the part of a mesh's shape that each vertex, edge and facet belongs to: the inside, a flat patch of the surface or
// of an interface between bodies, a straight feature, a corner. Found once a simulation and carried by edits from then on,
// over steps and saved states, so that what an edit may do does not hang on the round-off of earlier ones.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "itr/mesh.hpp"

namespace itr {

/// In ascending order of how much they are held.
enum class Stratum : unsigned char {
  volume,   ///< inside one body
  surface,  ///< inside a patch: facets of one plane with one body and tag, or between the same two bodies (2D: of a line)
  feature,  ///< on a straight stretch where the same patches meet (in 3D only)
  corner,   ///< none of the others, or with a tag of its own: cannot move without changing the shape or what is held
  non_manifold  ///< the cells around are no ball, no half ball: bodies that hang together by this vertex or edge
};
std::string_view name(Stratum stratum);

template <int Dim>
class Strata {
 public:
  using Facet = typename MeshTypes<Dim>::Facet;
  /// How far a vertex may lie off the plane or line of its neighbours, in units of the mesh's bounding box's diagonal, to
  /// count as lying on it: coordinates of about 16 digits that were rotated and moved.
  static constexpr double kFlatness = 1e-10;

  struct Plane {
    Vec<Dim> point, normal;
  };
  /// All that there is, as lists.
  struct Record {
    std::vector<Stratum> vertices;                     ///< by node slot; of nodes of curved edges `volume`
    std::vector<int> patches;                          ///< by facet slot
    std::vector<std::array<int, Dim + 1>> interfaces;  ///< facets between bodies, each ascending, and its patch; ascending
    std::vector<Plane> planes;                         ///< by patch
    double tolerance = 0;                              ///< [m]
  };

  Strata() = default;  ///< not found yet
  explicit Strata(const Mesh<Dim>& mesh, double flatness = kFlatness);
  /// Takes a record over; find_misfit() says whether it fits the mesh.
  explicit Strata(const Record& record);
  Record record() const;
  bool empty() const { return vertices_.empty(); }

  Stratum vertex(VertexId v) const { return vertices_[v]; }
  /// In 2D `surface` are all edges of the boundary and of interfaces.
  Stratum edge(const Mesh<Dim>& mesh, const EdgeKey& edge) const;
  /// The patch of a boundary facet.
  int patch(FacetId facet) const { return patches_[facet]; }
  /// The patch of the facet on these vertices (in any order) between two bodies; kNone where there is none.
  int interface_patch(const Facet& vertices) const;
  int num_patches() const { return static_cast<int>(planes_.size()); }

  /// A boundary or interface facet and its patch.
  struct Sheet {
    Facet vertices;
    int patch;
    bool is_boundary;
  };
  std::vector<Sheet> sheets_of(const Mesh<Dim>& mesh, VertexId v) const;
  std::vector<Sheet> sheets_of_edge(const Mesh<Dim>& mesh, const EdgeKey& edge) const;
  /// The ends of the features at a vertex: two where it is of the kind `feature`.
  std::vector<VertexId> feature_neighbours(const Mesh<Dim>& mesh, VertexId v) const;
  /// Projects a displacement of the vertex's rest position onto those that leave the shape as it is: identity in the volume,
  /// onto the patch's plane, onto the feature's direction, zero at a corner.
  Mat<Dim> tangent_projector(const Mesh<Dim>& mesh, VertexId v) const;

  /// Follows an edit that was just applied and created `created` (or kNone).
  void follow(const Edit<Dim>& edit, VertexId created);
  /// Takes in that the mesh got so many nodes of curved edges.
  void add_nodes(int count) { vertices_.insert(vertices_.end(), count, Stratum::volume); }
  void compact(const MeshRenumbering& map);
  /// First disagreement with what the mesh consists of, in words: a vertex or facet too many or without a patch.
  std::string find_misfit(const Mesh<Dim>& mesh) const;
  /// Finds a misfit, or a vertex off its patch's plane, or a facet folded over.
  std::string find_defect(const Mesh<Dim>& mesh) const;

 private:
  struct FacetHash {
    std::size_t operator()(const Facet& facet) const {
      std::size_t hash = 0;
      for (const int v : facet) hash = (hash ^ static_cast<std::size_t>(v)) * 0x9e3779b97f4a7c15ull;
      return hash ^ (hash >> 32);
    }
  };
  void append_interfaces(const typename MeshTypes<Dim>::Cell& cell, std::span<const VertexId> held,
                         std::vector<Sheet>& to) const;
  Stratum classify(const Mesh<Dim>& mesh, VertexId v) const;

  std::vector<Stratum> vertices_;
  std::vector<int> patches_;  ///< by facet slot
  std::unordered_map<Facet, int, FacetHash> interfaces_;
  std::vector<Plane> planes_;  ///< by patch
  double tolerance_ = 0;       ///< [m]
};

extern template class Strata<2>;
extern template class Strata<3>;

}  // namespace itr
