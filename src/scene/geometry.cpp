// SPDX-License-Identifier: MIT
#include "geometry.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>
#include <utility>

#include "file_parts.hpp"
#include "mesh/refine.hpp"
#include "polyfem/cell_order.hpp"
#include "readers.hpp"
#include "rigid.hpp"
#include "selection.hpp"
#include "selection_file.hpp"
#include "transformation.hpp"

namespace itr::scene {

namespace fs = std::filesystem;

namespace {

constexpr double kFlat = 1e-5;         ///< extent in z of a flat mesh, relative to its size: at most
constexpr double kLeastShape = 1e-13;  ///< cells with less volume, relative to longest edge^Dim, are degenerate
constexpr std::size_t kMostCells = 200'000'000;

/// Bodies as they are collected, before one mesh is made of them.
template <int Dim>
struct Collected {
  std::vector<Vec<Dim>> rest;
  std::vector<typename Mesh<Dim>::Cell> cells;
  std::vector<int> body;                                          ///< keys of Sets::bodies
  std::vector<std::pair<typename Mesh<Dim>::Facet, int>> tagged;  ///< facets with keys of Sets::surfaces
  std::vector<int> point_tags;                                    ///< such keys by vertex, inner ones included
};

const std::vector<std::array<int, 3>>& cells_of(const MeshFile& file, const Vec<2>&) { return file.triangles; }
const std::vector<std::array<int, 4>>& cells_of(const MeshFile& file, const Vec<3>&) { return file.tetrahedra; }

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

/// Cells are turned to positive volume. Triangles have no side that is right, so nothing is said of theirs.
template <int Dim>
void orient_cells(const Node& geometry, const std::vector<Vec<Dim>>& points, bool is_mirror,
                  std::vector<typename Mesh<Dim>::Cell>& cells, std::vector<std::string>& warnings) {
  std::vector<int> degenerate;
  std::size_t turned = 0;
  for (int c = 0; c < static_cast<int>(cells.size()); ++c) {
    auto& cell = cells[c];
    if (is_mirror) std::swap(cell[0], cell[1]);
    const double volume = signed_volume<Dim>(points, cell);
    if (!(std::abs(volume) > kLeastShape * std::pow(longest_edge<Dim>(points, cell), Dim))) degenerate.push_back(c);
    if (volume >= 0) continue;
    std::swap(cell[0], cell[1]);
    ++turned;
  }
  if (!degenerate.empty())
    geometry["mesh"].fail(abbreviate(geometry["mesh"].json()) + " with degenerate elements " + list_ids(degenerate),
                          "elements of positive volume");
  if (Dim == 3 && turned > 0)
    warnings.push_back(fmt::format("{}: {} of {} elements list their corners the other way round: turned",
                                   geometry["mesh"].pointer(), turned, cells.size()));
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

/// Removes points that no cell uses; returns the new ids by the old ones.
template <int Dim>
std::vector<int> drop_unused(std::vector<Vec<Dim>>& points, std::vector<typename Mesh<Dim>::Cell>& cells) {
  std::vector<int> renumbered(points.size(), kNone);
  for (const auto& cell : cells)
    for (const int v : cell) renumbered[v] = 0;
  int used = 0;
  for (std::size_t v = 0; v < points.size(); ++v) {
    if (renumbered[v] == kNone) continue;
    points[used] = points[v];
    renumbered[v] = used++;
  }
  points.resize(used);
  for (auto& cell : cells)
    for (int& v : cell) v = renumbered[v];
  return renumbered;
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

template <int Dim, std::size_t N>
Vec<Dim> barycenter(const Mesh<Dim>& mesh, const std::array<VertexId, N>& vertices) {
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (const int v : vertices) sum += mesh.rest(v);
  return sum / static_cast<double>(N);
}

/// Keys of the cells, facets and vertices of one geometry: by its selections, and by the groups of its file.
template <int Dim>
class Keys {
 public:
  Keys(const Node& geometry, const Box<Dim>& box, const FileParts<Dim>& parts, const References& references, Sets& sets)
      : volumes(geometry["volume_selection"], box),
        surfaces(geometry["surface_selection"], box),
        points(geometry["point_selection"], box),
        parts_(parts),
        sets_(sets) {
    if (const Label name{0, geometry["name"].string("")}; references.bodies.contains(name)) name_.insert(name);
    if (is_rigid(geometry)) name_.insert(rigid_label(geometry));
  }

  /// A selection decides the number; names of the file, and that of the geometry, stay.
  int of_cell(const Vec<Dim>& p, int part) {
    const FilePart& stored = parts_.part(part);
    const std::optional<Label> selected = volumes(p, stored.number);
    const Label label = selected.value_or(Label{stored.number});
    const auto [found, is_new] = cells_.try_emplace({part, label}, 0);
    if (is_new) {
      std::set<Label> labels = stored.labels;
      labels.insert(name_.begin(), name_.end());
      labels.insert(label);
      const int number = selected || stored.preferred == kNone ? label.number : stored.preferred;
      found->second = sets_.bodies.key(labels, number > 0 ? number : kNone);
      sets_.bodies.imply(found->second, selected ? "" : stored.name);
    }
    return found->second;
  }
  int of_facet(const Vec<Dim>& p, int part) { return of_surface(surfaces(p, number_of(part)), part); }
  int of_vertex(const Vec<Dim>& p, int part) { return of_surface(points(p, number_of(part)), part); }

  /// Whether groups of the file do not count where they have this number, since a selection gives it.
  bool hides(int number) const { return surfaces.gives(number) || points.gives(number); }

  Selection<Dim> volumes, surfaces, points;

 private:
  int number_of(int part) const { return part == kNoTag ? 0 : parts_.part(part).number; }
  int of_surface(const std::optional<Label>& selected, int part) {
    if (!selected && part == kNoTag) return kNoTag;
    const auto [found, is_new] = facets_.try_emplace({part, selected}, kNoTag);
    if (!is_new) return found->second;
    std::set<Label> labels;
    if (part != kNoTag)
      for (const Label& label : parts_.part(part).labels)
        if (!label.name.empty() || !hides(label.number)) labels.insert(label);
    if (selected) labels.insert(*selected);
    if (labels.empty()) return kNoTag;
    found->second = sets_.surfaces.key(labels, part == kNoTag ? kNone : parts_.part(part).preferred);
    const bool is_of_file = !selected && labels.size() == 1 && labels.begin()->number == parts_.part(part).number;
    sets_.surfaces.imply(found->second, is_of_file ? parts_.part(part).name : "");
    return found->second;
  }

  const FileParts<Dim>& parts_;
  Sets& sets_;
  std::set<Label> name_;  ///< of the geometry, if the scene asks for it, and of a rigid body
  std::map<std::pair<int, Label>, int> cells_;
  std::map<std::pair<int, std::optional<Label>>, int> facets_;
};

/// Warns of numbers that a selection and a group of the file give to different facets: the selection's counts.
template <int Dim>
void warn_of_hidden_groups(const Node& geometry, const Mesh<Dim>& mesh, const FileParts<Dim>& parts, const Keys<Dim>& keys,
                           const References& references, std::vector<std::string>& warnings) {
  for (const Label& label : references.surfaces) {
    if (!label.name.empty() || !keys.hides(label.number)) continue;
    bool is_there = false, differs = false;
    for (FacetId f = 0; f < mesh.num_facets(); ++f) {
      const bool is_of_file = parts.has_number(mesh.facet_tag(f), label.number);
      is_there |= is_of_file;
      differs |= is_of_file != (keys.surfaces(barycenter(mesh, mesh.facet(f))) == label);
    }
    if (is_there && differs)
      warnings.push_back(fmt::format("{}: gives the id {}, which a group of the mesh file has too: the selection's counts",
                                     geometry["surface_selection"].pointer(), label.number));
  }
}

/// Adds the mesh, with ids by the geometry's selections and by its file, and its copies.
template <int Dim>
void collect(const Node& geometry, const Mesh<Dim>& mesh, const Box<Dim>& box, Keys<Dim>& keys, Collected<Dim>& all,
             std::vector<std::string>& warnings) {
  std::vector<int> body(mesh.num_cells()), tag(mesh.num_facets()), point_tag(mesh.num_vertices());
  for (CellId c = 0; c < mesh.num_cells(); ++c) body[c] = keys.of_cell(barycenter(mesh, mesh.cell(c)), mesh.body(c));
  for (FacetId f = 0; f < mesh.num_facets(); ++f) tag[f] = keys.of_facet(barycenter(mesh, mesh.facet(f)), mesh.facet_tag(f));
  for (VertexId v = 0; v < mesh.num_vertices(); ++v) point_tag[v] = keys.of_vertex(mesh.rest(v), mesh.vertex_tag(v));

  for (const Vec<Dim>& shift : read_copies<Dim>(geometry, box.sizes())) {
    const int first = static_cast<int>(all.rest.size());
    const auto shifted = [first](auto vertices) {
      for (int& v : vertices) v += first;
      return vertices;
    };
    for (VertexId v = 0; v < mesh.num_vertices(); ++v) all.rest.push_back(mesh.rest(v) + shift);
    all.point_tags.insert(all.point_tags.end(), point_tag.begin(), point_tag.end());
    for (CellId c = 0; c < mesh.num_cells(); ++c) all.cells.push_back(shifted(mesh.cell(c)));
    all.body.insert(all.body.end(), body.begin(), body.end());
    for (FacetId f = 0; f < mesh.num_facets(); ++f)
      if (tag[f] != kNoTag) all.tagged.emplace_back(shifted(mesh.facet(f)), tag[f]);
  }
  const Units& units = geometry.document().units;
  const Vec<Dim> low = box.min() / units.factor("m"), high = box.max() / units.factor("m");
  const auto note_empty = [&](const Selection<Dim>& selection, const char* what) {
    for (const std::string& pointer : selection.unmatched())
      warnings.push_back(fmt::format(
          "{}: selects nothing: no {} is in it, or rules before it took them; the mesh spans ({:.4g}) to ({:.4g}) {}",
          pointer, what, fmt::join(low, ", "), fmt::join(high, ", "), units.name("m")));
  };
  note_empty(keys.volumes, "barycentre of a cell");
  note_empty(keys.surfaces, "barycentre of a boundary facet");
  note_empty(keys.points, "vertex");
}

}  // namespace

template <int Dim>
void put_on_axis(const Node& geometry, std::vector<Vec<Dim>>& points) {
  constexpr double kRoundOff = 1e-12;  // of the largest coordinate
  if (Dim != 2 || !is_axisymmetric(geometry)) return;
  double size = 0;
  for (const Vec<Dim>& X : points) size = std::max(size, X.template lpNorm<Eigen::Infinity>());
  for (std::size_t v = 0; v < points.size(); ++v) {
    double& r = points[v][0];
    if (std::abs(r) <= kRoundOff * size)
      r = 0;
    else if (r < 0)
      geometry["mesh"].fail(fmt::format("{} with vertex {} at r = {:g}", abbreviate(geometry["mesh"].json()), v,
                                        r / geometry.document().units.factor("m")),
                            "r >= 0 in an axisymmetric scene (x is r, y is z)");
  }
}

namespace {

template <int Dim>
void read_body(const Node& geometry, const MeshFile& of_file, const References& references, Sets& sets, Collected<Dim>& all,
               std::vector<std::string>& warnings) {
  const bool is_filled = Dim == 3 && is_rigid(geometry) && of_file.tetrahedra.empty();
  const MeshFile filled = is_filled ? filled_surface(geometry, of_file) : MeshFile();
  const MeshFile& of_mesh = is_filled ? filled : of_file;
  const bool has_files = has_selection_files(geometry);
  MeshFile with_selections;
  if (has_files) add_selection_files(geometry, Dim, with_selections = of_mesh);
  const MeshFile& file = has_files ? with_selections : of_mesh;
  std::vector<Vec<Dim>> points = points_of<Dim>(file);
  std::vector<typename Mesh<Dim>::Cell> cells = cells_of(file, Vec<Dim>());
  const std::vector<int> renumbered = drop_unused<Dim>(points, cells);  // so that no box reaches to them
  const bool is_mirror = transform<Dim>(points, geometry);
  put_on_axis<Dim>(geometry, points);
  const Box<Dim> box = bounding_box<Dim>(points);
  check_connected<Dim>(geometry, points, cells);
  const bool is_ordered = Dim == 3 && has_ideal_cells(Node(geometry.document()));
  const auto points_before = is_ordered ? points : std::vector<Vec<Dim>>();
  const auto cells_before = is_ordered ? cells : std::vector<typename Mesh<Dim>::Cell>();
  orient_cells<Dim>(geometry, points, is_mirror, cells, warnings);
  const std::string pointer = geometry["mesh"].pointer();
  if (const auto unused = std::count(renumbered.begin(), renumbered.end(), kNone); unused > 0)
    warnings.push_back(pointer + ": " + std::to_string(unused) + " vertices in no cell are left out");
  FileParts<Dim> parts(file, references, sets);
  Mesh<Dim> mesh = make_mesh<Dim>(geometry, std::move(points), std::move(cells), parts.cell_parts());
  for (const std::string& note : parts.tag(mesh, renumbered)) warnings.push_back(pointer + ": " + note);
  mesh = refine<Dim>(std::move(mesh), geometry["n_refs"]);
  Keys<Dim> keys(geometry, box, parts, references, sets);
  warn_of_hidden_groups<Dim>(geometry, mesh, parts, keys, references, warnings);
  const std::size_t first = all.cells.size();
  collect<Dim>(geometry, mesh, box, keys, all, warnings);
  if constexpr (Dim == 3)
    if (is_ordered)
      order_cells(points_before, cells_before, geometry["n_refs"].integer_at_least(0, 0), mesh, all.cells, first);
}

int dimension_of(const Node& geometry, const MeshFile& file) {
  if (!file.tetrahedra.empty()) return 3;
  if (file.triangles.empty()) geometry["mesh"].fail("a mesh without cells", "triangles (2D) or tetrahedra (3D)");
  if (is_rigid(geometry) && !is_flat(file)) return 3;
  if (!is_flat(file))
    geometry["mesh"].fail("a surface mesh, " + abbreviate(geometry["mesh"].json()),
                          "tetrahedra, or a flat mesh: all vertices at one z (2D)");
  return 2;
}

}  // namespace

bool is_flat(const MeshFile& file) {
  Box<3> box;  // of what is used, or of points alone
  for (const auto& triangle : file.triangles)
    for (const int v : triangle) box.extend(file.vertices[v]);
  for (const auto& edge : file.edges)
    for (const int v : edge) box.extend(file.vertices[v]);
  const Vec<3> extent = (box.isEmpty() ? bounding_box<3>(file.vertices) : box).sizes();
  return extent[2] <= kFlat * extent.maxCoeff();
}

std::filesystem::path MeshFiles::find(const Node& name, const char* what) {
  if (!name.exists()) name.fail(what);
  std::filesystem::path path = name.document().resolve(name.string(""));
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) {
    const auto here = std::filesystem::current_path(ignored) / name.string("");
    if (std::filesystem::is_directory(path, ignored)) name.fail(abbreviate(name.json()) + ", which is a folder", what);
    name.fail(abbreviate(name.json()) + ", but there is no file '" + path.string() + "'" +
                  (here == path ? "" : ", nor '" + here.lexically_normal().string() + "'"),
              what);
  }
  return path;
}

namespace {

/// Cells are straight at rest: edges that are curved by little are taken as straight, others if the scene says so.
void straighten(const Node& geometry, const fs::path& path, const MeshFile& file, std::vector<std::string>& notes) {
  constexpr double kMostSag = 0.01;
  if (file.sagging_edges == 0) return;
  const Node mesh = geometry["mesh"];
  const std::string curved = fmt::format("{} edges that are curved at rest, by up to {:.2g} % of their length ({})",
                                         file.sagging_edges, 100 * file.sag, file.sag_place);
  const std::string name = path.filename().string();
  if (!(file.sag <= kMostSag) && !geometry["advanced"]["force_linear_geometry"].boolean(false))
    mesh.fail(abbreviate(mesh.json()) + " with " + curved,
              "at most 1 %: more elements there, or the corners alone, by \"advanced\": {\"force_linear_geometry\": true} "
              "beside \"mesh\"" +
                  (path.extension() == ".msh"
                       ? ", or by `echo 'Merge \"" + name +
                             "\"; SetOrder 1; Save \"straight.msh\";' > straight.geo && gmsh straight.geo -`"
                       : ""));
  notes.push_back(mesh.pointer() + ": " + curved + ": taken as straight");
}

}  // namespace

const MeshFile& MeshFiles::get(const Node& geometry) {
  const fs::path path = find(geometry["mesh"], kMesh);
  const auto [found, is_new] = files_.try_emplace(path.string());
  if (!is_new) return found->second;
  MeshFile& file = found->second;
  file = read_mesh_file(path);
  straighten(geometry, path, file, notes_);
  for (const std::string& note : file.notes) notes_.push_back(geometry["mesh"].pointer() + ": " + note);
  return file;
}

void MeshFiles::take_notes(std::vector<std::string>& warnings) {
  warnings.insert(warnings.end(), notes_.begin(), notes_.end());
  notes_.clear();
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
    const bool is_flat_obstacle = type == 2 || type == 3;
    for (const char* key : {"point", "normal", "height"})
      if (geometry.has(key) && (type != 2 + (key == std::string("height"))))
        geometry[key].fail("it beside this type", "point and normal with \"plane\", height with \"ground\"");
    if (is_flat_obstacle)
      for (const char* key : {"mesh", "unit", "transformation", "n_refs", "extract", "array"})
        if (geometry.has(key)) geometry[key].fail("it beside a plane or ground", "no such key");
    const bool is_array = type == 1;
    if (is_array != geometry.has("array")) geometry["array"].fail("an array if and only if type is \"mesh_array\"");
    const bool is_obstacle = is_flat_obstacle || geometry["is_obstacle"].boolean(false);
    if (geometry.has("rigid") && (is_obstacle || is_array))
      geometry["rigid"].fail(is_obstacle ? "a rigid body that is an obstacle" : "a rigid body that is an array of copies",
                             is_obstacle ? "one of both" : "one geometry for each rigid body");
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
Mesh<Dim> read_bodies(const Node& root, const Geometries& geometries, MeshFiles& files, Sets& sets,
                      std::vector<std::string>& warnings) {
  const References references = collect_references(root);
  Collected<Dim> all;
  for (const Node& geometry : geometries.bodies)
    read_body<Dim>(geometry, files.get(geometry), references, sets, all, warnings);
  for (const Node& geometry : geometries.obstacles)
    if (const auto label = read_obstacle_label(geometry);
        label && (geometry.has("surface_selection") || references.surfaces.contains(*label)))
      sets.surfaces.key({*label});
  add_penetrated(root, sets.surfaces);
  sets.bodies.choose();
  sets.surfaces.choose();
  for (int& body : all.body) body = sets.bodies.id(body);
  Mesh<Dim> mesh = make_mesh<Dim>(geometries.bodies.front(), std::move(all.rest), std::move(all.cells), std::move(all.body));
  for (const auto& [facet, key] : all.tagged) mesh.set_facet_tag(mesh.find_facet(facet), sets.surfaces.id(key));
  for (VertexId v = 0; v < mesh.num_vertices(); ++v)
    if (mesh.is_boundary(v) && all.point_tags[v] != kNoTag) mesh.set_vertex_tag(v, sets.surfaces.id(all.point_tags[v]));
  files.take_notes(warnings);
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

#define ITR_INSTANTIATE(Dim)                                                                                    \
  template Mesh<Dim> read_bodies(const Node&, const Geometries&, MeshFiles&, Sets&, std::vector<std::string>&); \
  template std::vector<Vec<Dim>> read_copies(const Node&, const Vec<Dim>&);                                     \
  template std::vector<Vec<Dim>> points_of(const MeshFile&);                                                    \
  template void put_on_axis(const Node&, std::vector<Vec<Dim>>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr::scene
