// SPDX-License-Identifier: MIT
#include "geometry.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <set>
#include <sstream>
#include <utility>

#include "mesh/refine.hpp"
#include "selection.hpp"
#include "transformation.hpp"

namespace itr::scene {

namespace {

constexpr double kFlat = 1e-5;         ///< extent in z of a flat mesh, relative to its size: at most
constexpr double kLeastShape = 1e-13;  ///< cells with less volume, relative to longest edge^Dim, are degenerate
constexpr std::size_t kMostCells = 200'000'000;

/// Bodies as they are collected, before one mesh is made of them.
template <int Dim>
struct Collected {
  std::vector<Vec<Dim>> rest;
  std::vector<typename Mesh<Dim>::Cell> cells;
  std::vector<int> body;
  std::vector<std::pair<typename Mesh<Dim>::Facet, int>> tagged;
  std::vector<int> point_tags;  ///< by vertex, inner ones included
};

template <int Dim>
std::string corner_text(const Vec<Dim>& p) {
  std::string text;
  for (int c = 0; c < Dim; ++c) text += fmt::format("{}{:.4g}", c ? ", " : "", p[c]);
  return "(" + text + ")";
}

const std::vector<std::array<int, 3>>& cells_of(const MeshFile& file, const Vec<2>&) { return file.triangles; }
const std::vector<std::array<int, 4>>& cells_of(const MeshFile& file, const Vec<3>&) { return file.tetrahedra; }
const std::vector<int>& bodies_of(const MeshFile& file, const Vec<2>&) { return file.triangle_body; }
const std::vector<int>& bodies_of(const MeshFile& file, const Vec<3>&) { return file.tetrahedron_body; }

template <int Dim>
double signed_volume(const std::vector<Vec<Dim>>& points, const typename Mesh<Dim>::Cell& cell) {
  Mat<Dim> edges;
  for (int k = 0; k < Dim; ++k) edges.col(k) = points[cell[k + 1]] - points[cell[0]];
  return edges.determinant() / (Dim == 2 ? 2 : 6);
}

template <int Dim>
double longest_edge(const std::vector<Vec<Dim>>& points, const typename Mesh<Dim>::Cell& cell) {
  double longest = 0;
  for (int i = 0; i <= Dim; ++i)
    for (int j = 0; j < i; ++j) longest = std::max(longest, (points[cell[i]] - points[cell[j]]).norm());
  return longest;
}

/// Triangles are turned to positive area; tetrahedra only if the transformation is a mirror: a file with inverted ones is
/// wrong.
template <int Dim>
void orient_cells(const Node& geometry, const std::vector<Vec<Dim>>& points, bool is_mirror,
                  std::vector<typename Mesh<Dim>::Cell>& cells) {
  std::vector<int> degenerate, inverted;
  for (int c = 0; c < static_cast<int>(cells.size()); ++c) {
    auto& cell = cells[c];
    if (is_mirror) std::swap(cell[0], cell[1]);
    double volume = signed_volume<Dim>(points, cell);
    if (Dim == 2 && volume < 0) {
      std::swap(cell[0], cell[1]);
      volume = -volume;
    }
    if (!(std::abs(volume) > kLeastShape * std::pow(longest_edge<Dim>(points, cell), Dim)))
      degenerate.push_back(c);
    else if (volume < 0)
      inverted.push_back(c);
  }
  const auto refuse = [&](const char* what, const std::vector<int>& ids) {
    if (!ids.empty())
      geometry["mesh"].fail(abbreviate(geometry["mesh"].json()) + " with " + what + " elements " + list_ids(ids),
                            "elements of positive volume");
  };
  refuse("degenerate", degenerate);
  refuse("inverted", inverted);
}

/// Refuses what formats without indices leave: every cell with vertices of its own, where others have theirs.
template <int Dim>
void check_connected(const Node& geometry, const std::vector<Vec<Dim>>& points,
                     const std::vector<typename Mesh<Dim>::Cell>& cells) {
  if (cells.size() < 2) return;
  std::vector<char> is_used(points.size(), 0);
  for (const auto& cell : cells)
    for (const int v : cell)
      if (std::exchange(is_used[v], 1)) return;
  const auto less = [](const Vec<Dim>& a, const Vec<Dim>& b) {
    return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
  };
  const std::set<Vec<Dim>, decltype(less)> places(points.begin(), points.end(), less);
  if (places.size() < points.size())
    geometry["mesh"].fail(abbreviate(geometry["mesh"].json()) + " whose elements share no vertices: " +
                              std::to_string(points.size()) + " of them at " + std::to_string(places.size()) + " places",
                          "a mesh whose elements share vertices (merge those that coincide)");
}

/// Removes points that no cell uses; returns how many there were.
template <int Dim>
std::size_t drop_unused(std::vector<Vec<Dim>>& points, std::vector<typename Mesh<Dim>::Cell>& cells) {
  std::vector<int> renumbered(points.size(), kNone);
  for (const auto& cell : cells)
    for (const int v : cell) renumbered[v] = 0;
  int used = 0;
  for (std::size_t v = 0; v < points.size(); ++v) {
    if (renumbered[v] == kNone) continue;
    points[used] = points[v];
    renumbered[v] = used++;
  }
  const std::size_t unused = points.size() - static_cast<std::size_t>(used);
  points.resize(used);
  for (auto& cell : cells)
    for (int& v : cell) v = renumbered[v];
  return unused;
}

template <int Dim>
Mesh<Dim> make_mesh(const Node& geometry, std::vector<Vec<Dim>> points, std::vector<typename Mesh<Dim>::Cell> cells,
                    std::vector<int> body) {
  try {
    return Mesh<Dim>(std::move(points), std::move(cells), std::move(body));
  } catch (const InputError& error) {
    geometry["mesh"].fail(error.parts().place + " with " + error.parts().found, error.parts().expected);
  }
}

template <int Dim>
Mesh<Dim> refine(Mesh<Dim> mesh, const Node& node) {
  const int times = node.integer_at_least(0, 0);
  for (int i = 0; i < times; ++i) {
    if (static_cast<std::size_t>(mesh.num_cells()) << Dim > kMostCells) node.fail("less refinement: too many cells");
    mesh = refine_uniformly(mesh);
  }
  return mesh;
}

/// Adds the mesh, with ids by the geometry's selections, and its copies.
template <int Dim>
void collect(const Node& geometry, const Mesh<Dim>& mesh, const Box<Dim>& box, Collected<Dim>& all,
             std::vector<std::string>& warnings) {
  const auto barycenter = [&](const auto& vertices) {
    Vec<Dim> sum = Vec<Dim>::Zero();
    for (const int v : vertices) sum += mesh.rest(v);
    return (sum / static_cast<double>(vertices.size())).eval();
  };
  const Selection<Dim> volumes(geometry["volume_selection"], box), surfaces(geometry["surface_selection"], box);
  const Selection<Dim> points(geometry["point_selection"], box);
  std::vector<int> body(mesh.num_cells()), tag(mesh.num_facets());
  for (CellId c = 0; c < mesh.num_cells(); ++c)
    body[c] = volumes(barycenter(mesh.cell(c)), mesh.body(c)).value_or(mesh.body(c));
  for (FacetId f = 0; f < mesh.num_facets(); ++f) tag[f] = surfaces(barycenter(mesh.facet(f))).value_or(kNoTag);

  for (const Vec<Dim>& shift : read_copies<Dim>(geometry, box.sizes())) {
    const int first = static_cast<int>(all.rest.size());
    const auto shifted = [first](auto vertices) {
      for (int& v : vertices) v += first;
      return vertices;
    };
    for (VertexId v = 0; v < mesh.num_vertices(); ++v) {
      all.rest.push_back(mesh.rest(v) + shift);
      all.point_tags.push_back(points(mesh.rest(v)).value_or(kNoTag));
    }
    for (CellId c = 0; c < mesh.num_cells(); ++c) all.cells.push_back(shifted(mesh.cell(c)));
    all.body.insert(all.body.end(), body.begin(), body.end());
    for (FacetId f = 0; f < mesh.num_facets(); ++f)
      if (tag[f] != kNoTag) all.tagged.emplace_back(shifted(mesh.facet(f)), tag[f]);
  }
  const Units& units = geometry.document().units;
  const Vec<Dim> low = box.min() / units.factor("m"), high = box.max() / units.factor("m");
  const auto note_empty = [&](const Selection<Dim>& selection, const char* what) {
    for (const std::string& pointer : selection.unmatched())
      warnings.push_back(
          fmt::format("{}: selects nothing: no {} is in it, or rules before it took them; the mesh spans {} to {} {}",
                      pointer, what, corner_text<Dim>(low), corner_text<Dim>(high), units.name("m")));
  };
  note_empty(volumes, "barycentre of a cell");
  note_empty(surfaces, "barycentre of a boundary facet");
  note_empty(points, "vertex");
}

template <int Dim>
void read_body(const Node& geometry, const MeshFile& file, Collected<Dim>& all, std::vector<std::string>& warnings) {
  std::vector<Vec<Dim>> points = points_of<Dim>(file);
  std::vector<typename Mesh<Dim>::Cell> cells = cells_of(file, Vec<Dim>());
  const bool is_mirror = transform<Dim>(points, geometry);
  const Box<Dim> box = bounding_box<Dim>(points);
  check_connected<Dim>(geometry, points, cells);
  orient_cells<Dim>(geometry, points, is_mirror, cells);
  if (const std::size_t unused = drop_unused<Dim>(points, cells); unused > 0)
    warnings.push_back(geometry["mesh"].pointer() + ": " + std::to_string(unused) + " vertices in no cell are left out");
  const Mesh<Dim> mesh = make_mesh<Dim>(geometry, std::move(points), std::move(cells), bodies_of(file, Vec<Dim>()));
  collect<Dim>(geometry, refine<Dim>(mesh, geometry["n_refs"]), box, all, warnings);
}

int dimension_of(const Node& geometry, const MeshFile& file) {
  if (!file.tetrahedra.empty()) return 3;
  if (file.triangles.empty()) geometry["mesh"].fail("a mesh without cells", "triangles (2D) or tetrahedra (3D)");
  if (!is_flat(file))
    geometry["mesh"].fail("a surface mesh, " + abbreviate(geometry["mesh"].json()),
                          "tetrahedra, or a flat mesh: all vertices at one z (2D)");
  return 2;
}

}  // namespace

bool is_flat(const MeshFile& file) {
  const Vec<3> extent = bounding_box<3>(file.vertices).sizes();
  return extent[2] <= kFlat * extent.maxCoeff();
}

std::filesystem::path MeshFiles::find(const Node& name, const char* what) {
  if (!name.exists()) name.fail(what);
  std::filesystem::path path = name.document().resolve(name.string(""));
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) {
    const auto here = std::filesystem::current_path(ignored) / name.string("");
    name.fail(abbreviate(name.json()) + ", but there is no file '" + path.string() + "'" +
                  (here == path ? "" : ", nor '" + here.lexically_normal().string() + "'"),
              what);
  }
  return path;
}

const MeshFile& MeshFiles::get(const Node& geometry) {
  const std::filesystem::path path = find(geometry["mesh"], kMesh);
  const auto found = files_.find(path.string());
  return found != files_.end() ? found->second : files_.emplace(path.string(), read_mesh_file(path)).first->second;
}

std::string MeshFiles::hash(const Node& name, const char* what) {
  const std::filesystem::path path = find(name, what);
  std::string& text = hashes_[path.string()];
  if (!text.empty()) return text;
  std::ifstream file(path, std::ios::binary);
  std::uint64_t hash = 0xcbf29ce484222325;
  std::array<char, 1 << 16> buffer;
  while (file.read(buffer.data(), buffer.size()), file.gcount() > 0)
    for (std::streamsize i = 0; i < file.gcount(); ++i)
      hash = (hash ^ static_cast<unsigned char>(buffer[static_cast<std::size_t>(i)])) * 0x100000001b3;
  std::ostringstream out;
  out << std::hex << hash;
  return text = out.str();
}

bool is_flat_obstacle(const Node& geometry) {
  const std::string type = geometry["type"].string("mesh");
  return type == "plane" || type == "ground";
}

Geometries list_geometries(const Node& root) {
  if (!root.has("geometry")) root["geometry"].fail("the geometries of the scene");
  Geometries geometries;
  for (const Node& geometry : root["geometry"].items()) {
    if (!geometry["enabled"].boolean(true)) continue;
    const int type = geometry["type"].choice({"mesh", "mesh_array", "plane", "ground", "mesh_sequence"}, 0);
    if (type > 3) geometry["type"].fail("\"mesh\", \"mesh_array\", \"plane\" or \"ground\": it is not supported yet");
    const bool is_flat_obstacle = type > 1;
    for (const char* key : {"point", "normal", "height"})
      if (geometry.has(key) && (type != 2 + (key == std::string("height"))))
        geometry[key].fail("it beside this type", "point and normal with \"plane\", height with \"ground\"");
    if (is_flat_obstacle)
      for (const char* key : {"mesh", "transformation", "n_refs", "extract", "array"})
        if (geometry.has(key)) geometry[key].fail("it beside a plane or ground", "no such key");
    const bool is_array = type == 1;
    if (is_array != geometry.has("array")) geometry["array"].fail("an array if and only if type is \"mesh_array\"");
    const bool is_obstacle = is_flat_obstacle || geometry["is_obstacle"].boolean(false);
    if (!is_obstacle && geometry["extract"].string("volume") != "volume")
      geometry["extract"].fail("\"volume\" for what is no obstacle");
    (is_obstacle ? geometries.obstacles : geometries.bodies).push_back(geometry);
  }
  if (geometries.bodies.empty()) root["geometry"].fail("no enabled geometry but obstacles", "at least one body");
  return geometries;
}

int find_dimension(const Geometries& geometries, MeshFiles& files) {
  int dimension = 0;
  for (const Node& geometry : geometries.bodies) {
    const int here = dimension_of(geometry, files.get(geometry));
    if (dimension != 0 && here != dimension)
      geometry["mesh"].fail("a " + std::to_string(here) + "D mesh", std::to_string(dimension) + "D, as the ones before");
    dimension = here;
  }
  return dimension;
}

template <int Dim>
Mesh<Dim> read_bodies(const Geometries& geometries, MeshFiles& files, std::vector<std::string>& warnings) {
  Collected<Dim> all;
  for (const Node& geometry : geometries.bodies) read_body<Dim>(geometry, files.get(geometry), all, warnings);
  Mesh<Dim> mesh = make_mesh<Dim>(geometries.bodies.front(), std::move(all.rest), std::move(all.cells), std::move(all.body));
  for (const auto& [facet, tag] : all.tagged) mesh.set_facet_tag(mesh.find_facet(facet), tag);
  for (VertexId v = 0; v < mesh.num_vertices(); ++v)
    if (mesh.is_boundary(v)) mesh.set_vertex_tag(v, all.point_tags[v]);
  return mesh;
}

template <int Dim>
std::vector<Vec<Dim>> read_copies(const Node& geometry, const Vec<Dim>& extent) {
  std::vector<Vec<Dim>> shifts = {Vec<Dim>::Zero()};
  const Node array = geometry["array"];
  if (!array.exists()) return shifts;
  if (!array.has("offset")) array["offset"].fail("the distance between copies");
  const bool is_relative = array["relative"].boolean(false);
  const double offset = (is_relative ? array["offset"].without_units() : array["offset"]).number(0);
  const Vec<Dim> step = is_relative ? (offset * extent).eval() : Vec<Dim>::Constant(offset).eval();
  const std::vector<Node> sizes = array["size"].items();
  if (sizes.size() < Dim) array["size"].fail(std::to_string(Dim) + " integers");
  std::array<int, 3> size = {1, 1, 1};
  for (int c = 0; c < Dim; ++c) size[c] = sizes[c].integer_at_least(1, 1);
  for (int i = 0; i < size[0]; ++i)
    for (int j = 0; j < size[1]; ++j)
      for (int k = 0; k < size[2]; ++k)
        if (i + j + k > 0) shifts.push_back(step.cwiseProduct(Vec<3>(i, j, k).template head<Dim>()));
  return shifts;
}

template <int Dim>
std::vector<Vec<Dim>> points_of(const MeshFile& file) {
  std::vector<Vec<Dim>> points;
  points.reserve(file.vertices.size());
  for (const Vec<3>& vertex : file.vertices) points.push_back(vertex.template head<Dim>());
  return points;
}

template Mesh<2> read_bodies(const Geometries&, MeshFiles&, std::vector<std::string>&);
template Mesh<3> read_bodies(const Geometries&, MeshFiles&, std::vector<std::string>&);
template std::vector<Vec<2>> read_copies(const Node&, const Vec<2>&);
template std::vector<Vec<3>> read_copies(const Node&, const Vec<3>&);
template std::vector<Vec<2>> points_of(const MeshFile&);
template std::vector<Vec<3>> points_of(const MeshFile&);

}  // namespace itr::scene
