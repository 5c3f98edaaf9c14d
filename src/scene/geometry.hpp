// SPDX-License-Identifier: MIT
// `geometry` of a scene: the bodies' mesh and the obstacles (docs/theory.md, "Meshes").
#pragma once

#include <map>
#include <optional>

#include "itr/setup.hpp"
#include "mesh/mesh_file.hpp"
#include "node.hpp"
#include "sets.hpp"

namespace itr::scene {

struct ShapeEntry;

/// Mesh files by path, each read once: a scene may name one file many times.
class MeshFiles {
 public:
  /// The file that `geometry/mesh` names; InputError there if it is missing.
  const MeshFile& get(const Node& geometry);
  /// Moves sentences on the files that were read since to the end of `warnings`.
  void take_notes(std::vector<std::string>& warnings);
  static constexpr const char* kMesh = "the path of a mesh file";
  static constexpr const char* kWeights = "the path of an HDF5 file with weights";
  /// Hashes the bytes of the file that a value names (FNV-1a), in hexadecimal.
  std::string hash(const Node& name, const char* what);
  /// Its path. InputError there, which expects `what`, if there is no such file.
  static std::filesystem::path find(const Node& name, const char* what);

 private:
  std::map<std::string, MeshFile> files_;
  std::map<std::string, std::string> hashes_;
  std::vector<std::string> notes_;
};

/// Enabled geometries, in the order of the file. The others are not looked at further.
struct Geometries {
  std::vector<Node> bodies, obstacles;
};
Geometries list_geometries(const Node& root);
/// Whether it is a plane or a ground, which no file describes.
bool is_flat_obstacle(const Node& geometry);

/// Whether all vertices are at one z: a mesh or surface of a 2D scene.
bool is_flat(const MeshFile& file);

/// 2 or 3: what all bodies' meshes agree on.
int find_dimension(const Geometries& geometries, MeshFiles& files);

/// All bodies in one mesh, transformed, refined, with body ids and tags of facets and vertices, to which `sets` gets the
/// labels; it gets those of obstacles, too.
template <int Dim>
Mesh<Dim> read_bodies(const Node& root, const Geometries& geometries, MeshFiles& files, Sets& sets,
                      std::vector<std::string>& warnings);

/// The label of an obstacle: its `surface_selection`, else its name.
std::optional<Label> read_obstacle_label(const Node& geometry);
/// The id of an obstacle; kNoTag if it has no label.
int read_obstacle_id(const Node& geometry, const Sets& sets);

template <int Dim>
struct ObstacleGeometry {
  Obstacles<Dim> obstacles;  ///< without motions
  std::vector<int> id;       ///< per vertex: `surface_selection`, which conditions refer to; kNoTag if there is none
  std::vector<int> part{};   ///< per vertex: which of Geometries::obstacles; empty where a program brings them
};

/// Obstacles with a shape are refined on it.
template <int Dim>
ObstacleGeometry<Dim> read_obstacles(const Geometries& geometries, MeshFiles& files, const Mesh<Dim>& bodies,
                                     const Sets& sets, const std::vector<ShapeEntry>& shapes,
                                     std::vector<std::string>& warnings);

/// The surface of the file that `holder` names as `mesh`, moved by the transformation of `geometry`. All points of the file
/// are its vertices, in their order.
template <int Dim>
Obstacles<Dim> read_surface(const Node& holder, const Node& geometry, MeshFiles& files);

/// Translations of the copies of a mesh_array, the zero one first; only that for other types.
template <int Dim>
std::vector<Vec<Dim>> read_copies(const Node& geometry, const Vec<Dim>& extent);

/// The coordinates of a file in the dimension of the scene.
template <int Dim>
std::vector<Vec<Dim>> points_of(const MeshFile& file);
/// In an axisymmetric scene takes points within round-off of the axis as on it, and refuses those beyond it.
template <int Dim>
void put_on_axis(const Node& geometry, std::vector<Vec<Dim>>& points);

}  // namespace itr::scene
