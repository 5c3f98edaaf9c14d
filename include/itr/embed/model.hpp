// SPDX-License-Identifier: MIT
// What a program simulates, in plain arrays, with the dimension chosen at run time.
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

/// A description: a value that simulations are made from, and that they copy. Arrays are interleaved, positions in metres,
/// vertices are numbered from 0. Errors are InputErrors that name the array, the index, what was found and what was
/// expected.
class Model {
 public:
  /// 2 or 3.
  explicit Model(int dimension);
  /// Bodies, obstacles and options of a scene file; its surfaces are boundaries of the names "1", "2", ...: their ids.
  static Model from_scene(const std::string& file, const std::vector<scene::Override>& overrides = {});

  /// Keys of a scene file but for `geometry` and `output`, as JSON: an object that is merged into what was given before.
  /// Materials by body; boundaries and obstacles have as `id` the number that their add function returns.
  void set_options(const std::string& json);
  /// One of them: a JSON pointer and JSON text. Of a scene that was read, any key: it is read again.
  void set_option(const std::string& pointer, const std::string& value);

  /// `vertices`: dimension numbers each; `cells`: dimension + 1 vertices each, positive volume; `bodies`: one id a cell,
  /// empty: all are body 0.
  void set_mesh(std::span<const double> vertices, std::span<const int> cells, std::span<const int> bodies = {});

  /// The same of cells with a node at the middle of each edge, which then are curved: in 2D 6 nodes a cell, the edges 01,
  /// 12, 20, in 3D 10, the edges 01, 12, 20, 03, 13, 23 (as of VTK and meshio). Vertices keep their order; nodes at rest off
  /// the middle of their edge are refused. Sets the option /space/discr_order to 2.
  void set_quadratic_mesh(std::span<const double> nodes, std::span<const int> cells, std::span<const int> bodies = {});

  /// Names facets of the mesh's boundary: dimension vertices each, in any order. Returns its id. A facet is part of one
  /// boundary only. The mesh is to be set before.
  int add_boundary(const std::string& name, std::span<const int> facets);
  /// Those facets whose vertices are all in the box, its faces included. Throws where there are none.
  int add_boundary(const std::string& name, std::span<const double> box_min, std::span<const double> box_max);
  /// Those whose middle the rule takes (X: dimension numbers).
  int add_boundary(const std::string& name, const std::function<bool(const double* X)>& rule);

  /// Geometry that only collides: edges of two vertices each, in 3D triangles of three; vertices of neither are points.
  /// Returns its id.
  int add_obstacle(const std::string& name, std::span<const double> vertices, std::span<const int> edges,
                   std::span<const int> triangles = {});

  /// A law of the program's own for a body that the options give a material: its E, nu (a scale) and density stay.
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
  std::map<int, std::shared_ptr<const OwnLaw>> laws_;  ///< by body
  std::optional<scene::Scene> scene_;
};

}  // namespace itr
