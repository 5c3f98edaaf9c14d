// SPDX-License-Identifier: MIT
#include "frame_file.hpp"

#include <algorithm>
#include <sstream>
#include <string>

#include "core/check.hpp"
#include "drawn_cells.hpp"
#include "fem/quadratic.hpp"
#include "file_list.hpp"
#include "itr/core.hpp"
#include "set_members.hpp"
#include "units.hpp"

namespace itr::output {

namespace {

using Integers = std::vector<std::int64_t>;

/// Four rows a curve: contact, friction, reaction, all.
const std::string kForceSums = "/totals/forces";
const std::string kCavities = "/totals/cavities";  // volume and pressure by curve
/// Names of length, mass and time; absent: SI units.
const std::string kUnits = "/units";
const std::string kDhat = "/mesh/dhat";

std::span<const double> as_span(ConstVectorView v) { return {v.data(), static_cast<std::size_t>(v.size())}; }

template <int Dim>
VectorX rest_positions(const Mesh<Dim>& mesh) {
  const std::vector<Vec<Dim>>& nodes = mesh.rest();
  VectorX rest(Dim * static_cast<Eigen::Index>(nodes.size()));
  for (std::size_t i = 0; i < nodes.size(); ++i) vertex_of<Dim>(rest, static_cast<int>(i)) = nodes[i];
  return rest;
}

/// A file whose numbers are in a scene's units.
struct Target {
  hdf5::File& file;
  const Units& units;

  /// Numbers in SI units as a dataset with the attribute `unit`.
  void write(const std::string& name, std::span<const double> values, int columns, const char* unit) const {
    const bool is_new = !file.has_written(name);
    if (units.is_si())
      file.write(name, values, columns);
    else
      file.write(name, in_units(values, units, unit), columns);
    if (is_new) file.write_attribute(name, "unit", units.name(unit));
  }
};

template <int Dim>
bool has_steps_apart(const Mesh<Dim>& mesh) {
  for (VertexId v = 0; v < mesh.num_vertices(); ++v)
    if (mesh.steps_apart(v) != kApart) return true;
  return false;
}

template <int Dim>
void write_mesh(const Target& target, const Mesh<Dim>& mesh, ConstVectorView rest) {
  hdf5::File& file = target.file;
  Integers simplices, body, surface;
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    simplices.insert(simplices.end(), mesh.cell(c).begin(), mesh.cell(c).end());
    body.push_back(mesh.body(c));
  }
  for (const FacetId f : mesh.live_facets()) {
    surface.insert(surface.end(), mesh.facet(f).begin(), mesh.facet(f).end());
  }
  target.write("/mesh/rest", as_span(rest), Dim, "m");
  file.write("/mesh/simplices", simplices, Dim + 1);
  file.write("/mesh/body", body, 0);
  file.write("/mesh/surface", surface, Dim);
  if (mesh.is_axisymmetric()) file.write(kAxisymmetric, std::array{std::int64_t{1}}, 0);
}

/// For how many steps vertices have been apart from what coincides with them at rest; nothing where none does.
template <int Dim>
void write_steps_apart(const Target& target, const FrameView<Dim>& frame) {
  if (!has_steps_apart(frame.mesh)) return;
  Integers steps;
  for (VertexId v = 0; v < frame.mesh.num_vertices(); ++v) steps.push_back(frame.mesh.steps_apart(v));
  target.file.write(kStepsApart, steps, 0);
  target.write(kDhat, std::array{frame.dhat}, 0, "m");
}

template <std::size_t N>
void write_index_rows(hdf5::File& file, const std::string& name, const std::vector<std::array<int, N>>& rows) {
  Integers flat;
  for (const auto& row : rows) flat.insert(flat.end(), row.begin(), row.end());
  file.write(name, flat, N);
}

/// The curved edges, and the cells as XDMF draws them; where only some edges are curved with nodal fields of their own,
/// since those of /fields have no rows for straight edges.
template <int Dim>
void write_curves(const Target& target, const FrameView<Dim>& frame, ConstVectorView u) {
  hdf5::File& file = target.file;
  if (!frame.mesh.has_nodes()) return;
  write_index_rows(file, "/mesh/curved_edges", frame.mesh.curved_edges());
  const DrawnCells<Dim> drawn = draw_cells(frame.mesh);
  file.write("/mesh/quadratic_cells", drawn.cells, kQuadraticNodes<Dim>);
  if (drawn.straight_edges.empty()) return;
  const auto write = [&](const char* name, ConstVectorView field, const char* unit) {
    const VectorX values = drawn.at_nodes(field);
    target.write(name, as_span(values), Dim, unit);
  };
  write("/drawn/x", frame.x, "m");
  write("/drawn/u", u, "m");
  write("/drawn/v", frame.v, "m/s");
  if (!frame.asked) return;
  // Forces belong to nodes: there are none on straight edges.
  const auto write_forces = [&](const char* name, ConstVectorView forces) {
    if (forces.size() == 0) return;
    VectorX all = VectorX::Zero(forces.size() + Dim * static_cast<Eigen::Index>(drawn.straight_edges.size()));
    all.head(forces.size()) = forces;
    target.write(name, as_span(all), Dim, "N");
  };
  write_forces("/drawn/contact_force", frame.asked->forces.contact);
  write_forces("/drawn/friction_force", frame.asked->forces.friction);
  write_forces("/drawn/reaction_force", frame.asked->forces.reaction);
  if (frame.asked->contact_pressure.size() > 0)
    target.write("/drawn/contact_pressure", as_span(numbers_at_nodes(drawn, frame.asked->contact_pressure)), 0, "Pa");
}

/// Cells, rows of /mesh/surface and vertices by name.
template <int Dim>
void write_sets(hdf5::File& file, const FrameView<Dim>& frame) {
  for (const SetMembers& set : set_members(frame)) {
    const std::string name = plain_name(set.name);
    if (!set.cells.empty()) file.write("/sets/cells/" + name, set.cells, 0);
    if (!set.facets.empty()) file.write("/sets/facets/" + name, set.facets, 0);
    if (!set.vertices.empty()) file.write("/sets/vertices/" + name, set.vertices, 0);
  }
}

template <int Dim>
void write_surface(const Target& target, const std::string& group, const std::vector<Vec<Dim>>& positions,
                   const std::vector<std::array<int, 2>>& edges, const std::vector<std::array<int, 3>>& triangles) {
  std::vector<double> x;
  for (const Vec<Dim>& p : positions) x.insert(x.end(), p.data(), p.data() + Dim);
  target.write(group + "/x", x, Dim, "m");
  write_index_rows(target.file, group + "/edges", edges);
  write_index_rows(target.file, group + "/faces", triangles);
}

void require_shape(const std::filesystem::path& path, const std::string& name, int columns, int expected) {
  if (columns == expected) return;
  throw InputError({path.string(), name, std::to_string(columns) + " columns", std::to_string(expected) + " columns"});
}

void require_range(const std::filesystem::path& path, const std::string& name, const Integers& ids, std::size_t n) {
  for (const std::int64_t id : ids) {
    if (id >= 0 && id < static_cast<std::int64_t>(n)) continue;
    throw InputError({path.string(), name, "index " + std::to_string(id), "0 to " + std::to_string(n) + " (exclusive)"});
  }
}

template <int Dim>
void write_asked(const Target& target, const AskedFields& asked) {
  const auto write = [&](const char* name, std::span<const double> values, int columns, const char* unit) {
    if (!values.empty()) target.write(name, values, columns, unit);
  };
  write("/fields/contact_force", as_span(asked.forces.contact), Dim, "N");
  write("/fields/friction_force", as_span(asked.forces.friction), Dim, "N");
  write("/fields/reaction_force", as_span(asked.forces.reaction), Dim, "N");
  write("/fields/von_mises", asked.von_mises, 0, "Pa");
  write("/fields/stress", asked.stress, Dim * Dim, "Pa");
  write("/fields/contact_pressure", as_span(asked.contact_pressure), 0, "Pa");
  write("/fields/hydrostatic_pressure", asked.pressure, 0, "Pa");
  write("/fields/principal_stretches", asked.stretches, 3, "");
  write("/totals/kinetic_energy", asked.kinetic_energy, 0, "J");
  write("/totals/momentum", asked.momentum, 0, "kg m/s");
  if (asked.curves.empty()) return;
  std::vector<double> sums, cavities;
  std::string names;
  hdf5::File& file = target.file;
  for (const ForceCurvePoint& curve : in_units(asked.curves, target.units)) {
    names += (names.empty() ? "" : ",") + curve.name;
    for (const auto& kind : curve.kinds) sums.insert(sums.end(), kind.begin(), kind.end());
    cavities.insert(cavities.end(), curve.cavity.begin(), curve.cavity.end());
  }
  const bool is_new = !file.has_written(kForceSums);
  file.write(kForceSums, sums, static_cast<int>(asked.curves.front().kinds.front().size()));
  if (is_new) file.write_attribute(kForceSums, "names", names);
  if (!cavities.empty()) file.write(kCavities, cavities, 2);
}

Integers read_indices(const std::filesystem::path& path, const hdf5::File& file, const std::string& name, int columns,
                      std::size_t vertices) {
  hdf5::Table<std::int64_t> table = file.read_integers(name);
  require_shape(path, name, table.columns, columns);
  require_range(path, name, table.values, vertices);
  return std::move(table.values);
}

StoredSurface read_surface(const std::filesystem::path& path, const hdf5::File& file, const std::string& group, int dim) {
  hdf5::Table<double> x = file.read_doubles(group + "/x");
  require_shape(path, group + "/x", x.columns, dim);
  StoredSurface surface;
  surface.edges = read_indices(path, file, group + "/edges", 2, x.rows());
  surface.faces = read_indices(path, file, group + "/faces", 3, x.rows());
  surface.x = std::move(x.values);
  return surface;
}

template <int Dim>
void fill(hdf5::File& file, const FrameView<Dim>& frame, int step, double t, const Units& units) {
  const Target target{file, units};
  const Mesh<Dim>& mesh = frame.mesh;
  ITR_CHECK(mesh.is_compact(), "mesh is not compact");
  ITR_CHECK(frame.x.size() == Dim * mesh.num_nodes(), frame.x.size(), mesh.num_vertices(), mesh.num_curved());
  const VectorX rest = rest_positions(mesh);
  const VectorX u = frame.x - rest;
  file.write_attribute("step", static_cast<std::int64_t>(step));
  file.write_attribute("t", units.from_si(t, "s"));
  if (!units.is_si() && !file.contains(kUnits))
    file.write_text(kUnits, units.length() + " " + units.mass() + " " + units.time());
  write_mesh(target, mesh, rest);
  write_sets(file, frame);
  write_steps_apart(target, frame);
  write_curves<Dim>(target, frame, u);
  target.write("/fields/x", as_span(frame.x), Dim, "m");
  target.write("/fields/u", as_span(u), Dim, "m");
  target.write("/fields/v", as_span(frame.v), Dim, "m/s");
  target.write("/fields/elastic_density", frame.elastic_density, 0, Dim == 2 && !mesh.is_axisymmetric() ? "J/m^2" : "J/m^3");
  if (frame.asked) write_asked<Dim>(target, *frame.asked);
  write_surface<Dim>(target, "/obstacles", frame.obstacle_x, frame.obstacle_edges, frame.obstacle_triangles);
  if (frame.proxy.x) write_surface<Dim>(target, "/proxy", *frame.proxy.x, *frame.proxy.edges, *frame.proxy.triangles);
}

}  // namespace

template <int Dim>
int drawn_nodes(const FrameView<Dim>& frame) {
  if (!frame.mesh.has_nodes()) return 0;
  const int edges = static_cast<int>(frame.mesh.edges().size());
  return edges == frame.mesh.num_curved() ? 0 : frame.mesh.num_vertices() + edges;
}

namespace {

/// Lengths of all lists that a frame has: of frames with the same, files differ in numbers alone.
template <int Dim>
std::vector<std::size_t> shape_of(const FrameView<Dim>& frame) {
  const Mesh<Dim>& mesh = frame.mesh;
  const auto size = [](const auto& list) { return static_cast<std::size_t>(list.size()); };
  std::vector<std::size_t> shape = {Dim,
                                    static_cast<std::size_t>(mesh.num_vertices()),
                                    static_cast<std::size_t>(mesh.num_cells()),
                                    static_cast<std::size_t>(mesh.num_facets()),
                                    static_cast<std::size_t>(mesh.num_curved()),
                                    size(frame.v),
                                    size(frame.elastic_density),
                                    size(frame.obstacle_x),
                                    size(frame.obstacle_edges),
                                    size(frame.obstacle_triangles),
                                    has_steps_apart(mesh),
                                    frame.proxy.x != nullptr,
                                    frame.asked != nullptr};
  shape.push_back(static_cast<std::size_t>(drawn_nodes(frame)));
  if (frame.proxy.x)
    shape.insert(shape.end(), {size(*frame.proxy.x), size(*frame.proxy.edges), size(*frame.proxy.triangles)});
  for (const SetMembers& set : set_members(frame))
    shape.insert(shape.end(), {size(set.cells), size(set.facets), size(set.vertices)});
  if (frame.asked) {
    const AskedFields& asked = *frame.asked;
    shape.insert(shape.end(),
                 {size(asked.forces.contact), size(asked.forces.friction), size(asked.forces.reaction),
                  size(asked.von_mises), size(asked.stress), size(asked.pressure), size(asked.stretches),
                  size(asked.contact_pressure), size(asked.kinetic_energy), size(asked.momentum), size(asked.curves)});
  }
  return shape;
}

}  // namespace

template <int Dim>
void write_frame(const std::filesystem::path& path, const FrameView<Dim>& frame, int step, double t, Durability durability,
                 const FrameExtra& extra, const Units& units) {
  const hdf5::Session session;
  hdf5::File file = hdf5::File::create(path);
  fill(file, frame, step, t, units);
  if (extra) extra(file);
  write_file(path, file.image(), durability);
}

FrameFiles::~FrameFiles() {
  const hdf5::Session session;
  file_.reset();
}

template <int Dim>
void FrameFiles::write(const std::filesystem::path& path, const FrameView<Dim>& frame, int step, double t,
                       const Units& units) {
  constexpr std::size_t kSmall = 1 << 20;  // [bytes]
  const hdf5::Session session;
  std::vector<std::size_t> shape = shape_of(frame);
  if (shape != shape_) file_.reset();
  if (!file_) file_.emplace(hdf5::File::create(path));
  shape_ = std::move(shape);
  std::string image;
  try {
    fill(*file_, frame, step, t, units);
    image = file_->image();
  } catch (...) {
    file_.reset();
    throw;
  }
  if (image.size() > kSmall) file_.reset();
  write_file(path, image);
}

std::vector<std::filesystem::path> stored_frames(const std::filesystem::path& directory) {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(directory / "frames", error)) {
    if (step_of_name("frames/" + entry.path().filename().string()) >= 0) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end(), [](const auto& a, const auto& b) { return step_of_frame(a) < step_of_frame(b); });
  return files;
}

int step_of_frame(const std::filesystem::path& path) { return std::stoi(path.stem().string()); }

FrameSizes read_frame_sizes(const std::filesystem::path& path) {
  const hdf5::Session session;
  const hdf5::File file = hdf5::File::open(path);
  const hdf5::Shape x = file.shape("/fields/x"), body = file.shape("/mesh/body");
  FrameSizes sizes{file.read_double_attribute("t"),
                   x.columns,
                   static_cast<int>(x.rows),
                   static_cast<int>(body.rows),
                   file.contains("/mesh/quadratic_cells"),
                   file.contains("/drawn/x") ? static_cast<int>(file.shape("/drawn/x").rows) : 0,
                   {}};
  for (const char* asked : kAskedFields) {
    const std::string name = asked;
    const bool is_drawn = sizes.drawn_nodes > 0 && (name.ends_with("_force") || name == "contact_pressure");
    if (file.contains((is_drawn ? "/drawn/" : "/fields/") + name)) sizes.asked.push_back(name);
  }
  return sizes;
}

FrameTotals read_frame_totals(const std::filesystem::path& path) {
  const hdf5::Session session;
  const hdf5::File file = hdf5::File::open(path);
  FrameTotals totals{step_of_frame(path), read_units(path, file), file.read_double_attribute("t"), {}, {}};
  totals.units.dim = file.contains(kAxisymmetric) ? 3 : file.shape("/fields/x").columns;
  if (const char* name = "/totals/kinetic_energy"; file.contains(name)) {
    const auto values = file.read_doubles(name).values;
    if (values.size() != 1) throw InputError({path.string(), name, std::to_string(values.size()) + " numbers", "1"});
    totals.kinetic_energy = values[0];
  }
  if (const char* name = "/totals/momentum"; file.contains(name)) totals.momentum = file.read_doubles(name).values;
  return totals;
}

std::vector<std::string> find_damage(const std::filesystem::path& path) {
  const hdf5::Session session;
  return hdf5::File::open(path).find_damage();
}

StoredForces read_frame_forces(const std::filesystem::path& path) {
  const hdf5::Session session;
  const hdf5::File file = hdf5::File::open(path);
  StoredForces forces{step_of_frame(path), file.read_double_attribute("t"), {}};
  if (!file.contains(kForceSums)) return forces;
  const hdf5::Table<double> sums = file.read_doubles(kForceSums);
  std::istringstream names(file.read_text_attribute(kForceSums, "names"));
  for (std::string name; std::getline(names, name, ',');) forces.curves.push_back({name, {}});
  constexpr std::size_t kOfFirstVersion = 4, kKinds = std::tuple_size_v<decltype(ForceCurvePoint::kinds)>;
  const auto rows = static_cast<std::size_t>(sums.rows());
  const std::size_t kinds = rows == kOfFirstVersion * forces.curves.size() ? kOfFirstVersion : kKinds;
  if (rows != kinds * forces.curves.size())
    throw InputError({path.string(), kForceSums, std::to_string(rows) + " rows", std::to_string(kKinds) + " a name"});
  auto next = sums.values.begin();
  for (ForceCurvePoint& curve : forces.curves)
    for (std::size_t k = 0; k < kinds; ++k, next += sums.columns) curve.kinds[k].assign(next, next + sums.columns);
  if (!file.contains(kCavities)) return forces;
  const std::vector<double> cavities = file.read_doubles(kCavities).values;
  if (cavities.size() != 2 * forces.curves.size())
    throw InputError({path.string(), kCavities, std::to_string(cavities.size()) + " numbers", "2 a name"});
  for (std::size_t i = 0; i < forces.curves.size(); ++i) forces.curves[i].cavity = {cavities[2 * i], cavities[2 * i + 1]};
  return forces;
}

Units read_units(const std::filesystem::path& path, const hdf5::File& file) {
  if (!file.contains(kUnits)) return {};
  const std::string text = file.read_text(kUnits);
  std::istringstream names(text);
  std::string length, mass, time;
  names >> length >> mass >> time;
  const auto has = [](const std::vector<std::string>& list, const std::string& name) {
    return std::find(list.begin(), list.end(), name) != list.end();
  };
  if (!has(Units::length_names(), length) || !has(Units::mass_names(), mass) || !has(Units::time_names(), time))
    throw InputError({path.string(), kUnits, "'" + text + "'", "units of length, mass and time, such as 'mm t s'"});
  return {length, mass, time};
}

StoredFrame read_frame(const std::filesystem::path& path) {
  const hdf5::Session session;
  const hdf5::File file = hdf5::File::open(path);
  StoredFrame frame;
  hdf5::Table<double> x = file.read_doubles("/fields/x");
  if (x.columns != 2 && x.columns != 3) require_shape(path, "/fields/x", x.columns, 2);
  frame.dim = x.columns;
  frame.units = read_units(path, file);
  frame.axisymmetric = file.contains(kAxisymmetric);
  frame.units.dim = frame.axisymmetric ? 3 : frame.dim;
  frame.simplices = read_indices(path, file, "/mesh/simplices", frame.dim + 1, x.rows());
  frame.body = file.read_integers("/mesh/body").values;
  if (const std::size_t cells = frame.simplices.size() / (frame.dim + 1); frame.body.size() != cells)
    throw InputError({path.string(), "/mesh/body", std::to_string(frame.body.size()) + " ids", std::to_string(cells)});
  frame.surface = read_indices(path, file, "/mesh/surface", frame.dim, x.rows());
  hdf5::Table<double> rest = file.read_doubles("/mesh/rest");
  require_shape(path, "/mesh/rest", rest.columns, frame.dim);
  if (rest.rows() != x.rows())
    throw InputError({path.string(), "/mesh/rest", std::to_string(rest.rows()) + " rows", std::to_string(x.rows())});
  if (file.contains("/mesh/curved_edges")) {
    frame.curved_edges = read_indices(path, file, "/mesh/curved_edges", 2, x.rows());
    if (frame.curved_edges.size() / 2 > x.rows())
      throw InputError({path.string(), "/mesh/curved_edges", std::to_string(frame.curved_edges.size() / 2) + " rows",
                        "fewer than nodes, " + std::to_string(x.rows())});
  }
  const std::size_t vertices = x.rows() - frame.curved_edges.size() / 2;
  require_range(path, "/mesh/simplices", frame.simplices, vertices);
  require_range(path, "/mesh/surface", frame.surface, vertices);
  require_range(path, "/mesh/curved_edges", frame.curved_edges, vertices);
  for (std::size_t i = 2; i < frame.curved_edges.size(); i += 2)
    if (const std::int64_t* edge = &frame.curved_edges[i];
        std::lexicographical_compare(edge, edge + 2, edge - 2, edge) || std::equal(edge, edge + 2, edge - 2))
      throw InputError({path.string(), "/mesh/curved_edges", "rows in another order", "ascending rows"});
  if (file.contains(kStepsApart)) {
    frame.steps_apart = file.read_integers(kStepsApart).values;
    const std::vector<double> dhat = file.read_doubles(kDhat).values;
    if (frame.steps_apart.size() != vertices || dhat.size() != 1)
      throw InputError(
          {path.string(), kStepsApart,
           std::to_string(frame.steps_apart.size()) + " numbers, and " + std::to_string(dhat.size()) + " of d-hat",
           std::to_string(vertices) + ", and one"});
    frame.dhat = dhat[0];
  }
  frame.rest = std::move(rest.values);
  frame.x = std::move(x.values);
  frame.obstacles = read_surface(path, file, "/obstacles", frame.dim);
  frame.has_proxy = file.contains("/proxy");
  if (frame.has_proxy) frame.proxy = read_surface(path, file, "/proxy", frame.dim);
  return frame;
}

std::vector<StoredField> read_frame_fields(const std::filesystem::path& path) {
  const hdf5::Session session;
  const hdf5::File file = hdf5::File::open(path);
  std::vector<std::string> names = {"v", "elastic_density"};
  names.insert(names.end(), std::begin(kAskedFields), std::end(kAskedFields));
  std::vector<StoredField> fields;
  for (const std::string& name : names) {
    const std::string set = "/fields/" + name;
    if (!file.contains(set)) continue;
    hdf5::Table<double> table = file.read_doubles(set);
    fields.push_back({name, file.read_text_attribute(set, "unit"), table.columns, std::move(table.values)});
  }
  return fields;
}

#define ITR_INSTANTIATE(Dim)                                                                                   \
  template void write_frame<Dim>(const std::filesystem::path&, const FrameView<Dim>&, int, double, Durability, \
                                 const FrameExtra&, const Units&);                                             \
  template int drawn_nodes<Dim>(const FrameView<Dim>&);                                                        \
  template void FrameFiles::write<Dim>(const std::filesystem::path&, const FrameView<Dim>&, int, double, const Units&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr::output
