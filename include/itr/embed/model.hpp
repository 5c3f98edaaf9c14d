// SPDX-License-Identifier: MIT
// The description of a problem in plain arrays. The dimension is chosen at run time.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "itr/scene/scene.hpp"

namespace itr {

/// The description of a problem, from which simulations are made by copy. Arrays are interleaved, positions are in metres,
/// vertices are numbered from 0. Wrong arguments throw an InputError, which names the array, the index, what was found and
/// what was expected.
class Model {
 public:
  /// An empty model of dimension 2 or 3.
  explicit Model(int dimension);
  /// Reads bodies, obstacles and options of a scene file. Its surfaces become boundaries by their names or ids: "1", "2",
  /// ...
  static Model from_scene(const std::string& file, const std::vector<scene::Override>& overrides = {});

  /// Merges a JSON object with keys of a scene, other than `geometry` and `output`, into the options. Materials refer to
  /// bodies by `id`. Conditions refer to boundaries and obstacles by their names, or the ids that their add functions
  /// return.
  void set_options(const std::string& json);
  /// Sets one key by its JSON pointer and JSON text. A scene that was read is read again, so any key may be set.
  void set_option(const std::string& pointer, const std::string& value);

  /// Sets the mesh: `dimension` numbers a vertex [m], dimension + 1 vertices a cell, cells of positive volume, and one body
  /// id a cell. Without ids all cells belong to body 0.
  void set_mesh(std::span<const double> vertices, std::span<const int> cells, std::span<const int> bodies = {});

  /// Sets quadratic cells, which have a node at the middle of each edge: 6 nodes in 2D (edges 01, 12, 20), 10 in 3D (01, 12,
  /// 20, 03, 13, 23), as in VTK and meshio; vertices keep their order, and /space/discr_order becomes 2. Throws InputError
  /// for a node off the middle of its edge.
  void set_quadratic_mesh(std::span<const double> nodes, std::span<const int> cells, std::span<const int> bodies = {});

  /// Names facets of the mesh's boundary, `dimension` vertices each in any order, and returns their id. A facet may
  /// belong to several boundaries. The mesh must be set before.
  int add_boundary(const std::string& name, std::span<const int> facets);
  /// Names the facets whose vertices are all in the closed box. Throws InputError if there are none.
  int add_boundary(const std::string& name, std::span<const double> box_min, std::span<const double> box_max);
  /// Names the facets whose middle X (`dimension` numbers) satisfies the rule.
  int add_boundary(const std::string& name, const std::function<bool(const double* X)>& rule);

  /// Gives bodies a name, which options may write instead of their ids; several bodies may have the same.
  void name_body(const std::string& name, int body) { body_names_[name].push_back(body); }

  /// Adds an obstacle of edges (two vertices each) and, in 3D, triangles (three vertices each), and returns its id. Vertices
  /// of no edge and no triangle collide as points.
  int add_obstacle(const std::string& name, std::span<const double> vertices, std::span<const int> edges,
                   std::span<const int> triangles = {});

  /// Sets a law of the program for a body. The options still give that body a material, for its density and as a scale.
  void set_law(int body, std::shared_ptr<const OwnLaw> law);

  int dimension() const { return dimension_; }  ///< 2 or 3

 private:
  friend class AnySimulation;
  struct Part {  ///< a boundary or an obstacle
    std::string name;
    int id;
    std::vector<double> vertices;
    std::vector<int> edges, triangles;
    std::vector<int> facets;  ///< of the mesh
  };
  template <int Dim>
  scene::Geometry<Dim> geometry() const;
  template <int Dim>
  Setup<Dim> setup(std::vector<std::string>& warnings) const;
  int max_threads() const;
  int next_id(const std::string& name) const;
  int add_facets(const std::string& name, const std::function<bool(const std::vector<int>& facet)>& takes);

  int dimension_;
  std::string options_ = "{}";
  std::string scene_file_;
  std::vector<scene::Override> overrides_;
  std::vector<double> vertices_;
  std::vector<int> cells_, bodies_;
  std::vector<Part> boundaries_, obstacles_;
  std::map<std::string, std::vector<int>> body_names_;
  std::map<int, std::shared_ptr<const OwnLaw>> laws_;  ///< by body
  std::optional<scene::Scene> scene_;
};

}  // namespace itr
