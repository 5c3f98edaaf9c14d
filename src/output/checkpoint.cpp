// SPDX-License-Identifier: MIT
#include "checkpoint.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "frame_file.hpp"
#include "itr/core.hpp"
#include "report_json.hpp"
#include "simulation/state.hpp"

namespace itr::output {

namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kFormat = 9;
constexpr std::int64_t kOldestFormat = 7;  ///< of itr 0.1
/// In SI units, where the frame is in others: of the vertices, and of the state.
constexpr const char* kRest = "/checkpoint/rest";
constexpr const char* kTime = "/checkpoint/t";
constexpr const char* kQuadratureLevels = "/checkpoint/quadrature_levels";
constexpr const char* kChordLevels = "/checkpoint/chord_levels";
constexpr const char* kStepControl = "/checkpoint/step_control";  ///< StepControl and History::dt, of adaptive steps
constexpr const char* kDoublings = "/checkpoint/doublings";       ///< of flat obstacles

/// Groups of a CellField: its time t, the number of `rows` of each cell, and these as `records`.
constexpr const char* kViscous = "/checkpoint/viscous";
constexpr const char* kSoftening = "/checkpoint/softening";

std::string field_name(const char* kind, std::size_t age) {
  return std::string("/checkpoint/history/") + kind + "/" + std::to_string(age);
}

std::vector<VectorX> read_fields(const hdf5::File& file, const char* kind) {
  std::vector<VectorX> fields;
  while (file.contains(std::string("/checkpoint/history/") + kind) && file.contains(field_name(kind, fields.size()))) {
    const auto table = file.read_doubles(field_name(kind, fields.size()));
    fields.emplace_back(Eigen::Map<const VectorX>(table.values.data(), static_cast<Eigen::Index>(table.values.size())));
  }
  return fields;
}

/// `value`, of a dataset, as an int.
template <typename T>
int as_int(const fs::path& path, const std::string& name, T value) {
  if (value >= std::numeric_limits<int>::min() && value <= std::numeric_limits<int>::max()) return static_cast<int>(value);
  throw InputError({path.string(), name, std::to_string(value), "a number of 32 bits"});
}

template <std::size_t N>
std::vector<std::array<int, N>> read_rows(const fs::path& path, const hdf5::File& file, const std::string& name) {
  const auto table = file.read_integers(name);
  if (table.columns != N)
    throw InputError({path.string(), name, std::to_string(table.columns) + " columns", std::to_string(N)});
  std::vector<std::array<int, N>> rows(table.rows());
  for (std::size_t i = 0; i < table.values.size(); ++i) rows[i / N][i % N] = as_int(path, name, table.values[i]);
  return rows;
}

std::vector<int> read_ints(const fs::path& path, const hdf5::File& file, const std::string& name) {
  std::vector<int> numbers;
  for (const std::int64_t value : file.read_integers(name).values) numbers.push_back(as_int(path, name, value));
  return numbers;
}

/// Levels from 0 to `most`, or none where the file has none.
std::vector<int> read_levels(const fs::path& path, const hdf5::File& file, const char* name, int most) {
  if (!file.contains(name)) return {};
  std::vector<int> levels = read_ints(path, file, name);
  for (const int level : levels)
    if (level < 0 || level > most)
      throw InputError({path.string(), name, std::to_string(level), "0 to " + std::to_string(most)});
  return levels;
}

std::vector<EdgeKey> read_curved_edges(const fs::path& path, const hdf5::File& file) {
  if (!file.contains("/mesh/curved_edges")) return {};
  return read_rows<2>(path, file, "/mesh/curved_edges");
}

template <int Dim>
Mesh<Dim> read_mesh(const fs::path& path, const hdf5::File& file) {
  const bool is_apart = file.contains(kRest);
  const std::string name = is_apart ? kRest : "/mesh/rest";
  const auto rest = file.read_doubles(name);
  if (rest.columns != Dim)
    throw InputError({path.string(), name, std::to_string(rest.columns) + " columns", std::to_string(Dim)});
  for (const double X : rest.values)
    if (!std::isfinite(X)) throw InputError({path.string(), name, std::to_string(X), "finite positions"});
  const std::vector<EdgeKey> curved_edges = read_curved_edges(path, file);
  const std::size_t curved = is_apart ? 0 : curved_edges.size();  // nodes that come after the vertices
  if (rest.rows() < curved)
    throw InputError(
        {path.string(), name, std::to_string(rest.rows()) + " rows", "more than curved edges, " + std::to_string(curved)});
  std::vector<Vec<Dim>> points(rest.rows() - curved);
  for (std::size_t v = 0; v < points.size(); ++v) points[v] = Eigen::Map<const Vec<Dim>>(rest.values.data() + Dim * v);
  auto cells = read_rows<Dim + 1>(path, file, "/mesh/simplices");
  auto body = read_ints(path, file, "/mesh/body");
  const auto facets = read_rows<Dim>(path, file, "/mesh/surface");
  const auto tags = read_ints(path, file, "/checkpoint/facet_tag");
  if (body.size() != cells.size() || tags.size() != facets.size())
    throw InputError({path.string(), "/mesh", "lists of different lengths", "one entry for every cell and facet"});
  Mesh<Dim> mesh(std::move(points), std::move(cells), std::move(body));
  mesh.set_facets(facets, tags);
  if constexpr (Dim == 2) mesh.set_axisymmetric(file.contains(kAxisymmetric));
  if (file.contains(kStepsApart)) {
    const auto steps = read_ints(path, file, kStepsApart);
    if (static_cast<int>(steps.size()) != mesh.num_vertices())
      throw InputError({path.string(), kStepsApart, std::to_string(steps.size()) + " numbers", "one for every vertex"});
    for (VertexId v = 0; v < mesh.num_vertices(); ++v) {
      if (steps[v] < 0 || steps[v] > kApart)
        throw InputError({path.string(), kStepsApart, std::to_string(steps[v]), "0 to " + std::to_string(kApart)});
      mesh.set_steps_apart(v, static_cast<std::uint8_t>(steps[v]));
    }
  }
  mesh.set_curved_edges(curved_edges);
  if (!file.contains("/checkpoint/vertex_tag")) return mesh;
  const auto vertex_tags = read_rows<2>(path, file, "/checkpoint/vertex_tag");
  for (const auto& [v, tag] : vertex_tags) {
    if (v < 0 || v >= mesh.num_vertices())
      throw InputError({path.string(), "/checkpoint/vertex_tag", "vertex " + std::to_string(v),
                        "numbers below " + std::to_string(mesh.num_vertices())});
    mesh.set_vertex_tag(v, tag);
  }
  return mesh;
}

/// Two vertices (one and kNone) or those of a facet, then least and most refusal key, and whether in contact.
int refusal_columns(OperationKind kind) { return kind == OperationKind::remove_facet ? 6 : 5; }

constexpr const char* kRefusalTolerances = "/checkpoint/refusal_tolerances";  ///< [J], by operation

std::string refusals_name(OperationKind kind) {
  return std::string("/checkpoint/refusals/") + kOperationNames[static_cast<int>(kind)];
}

void write_memory(hdf5::File& file, const RemeshMemory& memory) {
  std::array<std::vector<double>, kOperationKinds> tables;
  for (const auto& [candidate, range] : memory.refusals) {
    auto& rows = tables[static_cast<int>(candidate.kind())];
    const auto& ids = candidate.facet();
    rows.insert(rows.end(), ids.begin(), ids.begin() + refusal_columns(candidate.kind()) - 3);
    rows.insert(rows.end(), {range.least, range.most, range.in_contact ? 1.0 : 0.0});
  }
  for (int i = 0; i < kOperationKinds; ++i)
    if (const auto kind = static_cast<OperationKind>(i); !tables[i].empty())
      file.write(refusals_name(kind), tables[i], refusal_columns(kind));
  std::vector<double> tolerances;
  for (const auto& tolerance : memory.tolerances)
    tolerances.push_back(tolerance.value_or(std::numeric_limits<double>::quiet_NaN()));
  if (!std::isnan(tolerances[0])) file.write(kRefusalTolerances, tolerances, 1);
}

RemeshMemory read_memory(const fs::path& path, const hdf5::File& file, int num_vertices) {
  RemeshMemory memory;
  if (file.contains(kRefusalTolerances)) {
    const auto table = file.read_doubles(kRefusalTolerances);
    if (table.values.size() > kOperationKinds)
      throw InputError({path.string(), kRefusalTolerances, std::to_string(table.values.size()) + " numbers",
                        "at most " + std::to_string(kOperationKinds)});
    std::copy(table.values.begin(), table.values.end(), memory.tolerances.begin());
  }
  if (!file.contains("/checkpoint/refusals")) return memory;
  for (int i = 0; i < kOperationKinds; ++i) {
    const auto kind = static_cast<OperationKind>(i);
    const std::string name = refusals_name(kind);
    if (!file.contains(name)) continue;
    const auto table = file.read_doubles(name);
    const int columns = refusal_columns(kind), vertices = columns - 3;
    if (table.columns != columns)
      throw InputError({path.string(), name, std::to_string(table.columns) + " columns", std::to_string(columns)});
    for (std::size_t first = 0; first < table.values.size(); first += columns) {
      const double* row = &table.values[first];
      MeshTypes<3>::Facet ids{kNone, kNone, kNone};
      for (int k = 0; k < vertices; ++k) {
        ids[k] = as_int(path, name, row[k]);
        if (ids[k] < (k == 0 ? 0 : kNone) || ids[k] >= num_vertices)
          throw InputError(
              {path.string(), name, "a vertex " + std::to_string(ids[k]), "numbers below " + std::to_string(num_vertices)});
      }
      const Candidate candidate = vertices == 3     ? Candidate(kind, ids)
                                  : ids[1] == kNone ? Candidate(kind, ids[0])
                                                    : Candidate(kind, EdgeKey{ids[0], ids[1]});
      memory.refusals.push_back({candidate, {row[vertices], row[vertices + 1], row[vertices + 2] != 0}});
    }
  }
  std::ranges::sort(memory.refusals, {}, &RemeshMemory::Entry::candidate);
  return memory;
}

template <int Dim>
void write_strata(hdf5::File& file, const Strata<Dim>& strata, int num_vertices) {
  if (strata.empty()) return;
  const auto record = strata.record();
  std::vector<std::int64_t> vertices, interfaces;
  for (int v = 0; v < num_vertices; ++v) vertices.push_back(static_cast<std::int64_t>(record.vertices[v]));
  for (const auto& row : record.interfaces) interfaces.insert(interfaces.end(), row.begin(), row.end());
  std::vector<double> planes;
  for (const auto& [point, normal] : record.planes) {
    planes.insert(planes.end(), point.data(), point.data() + Dim);
    planes.insert(planes.end(), normal.data(), normal.data() + Dim);
  }
  file.write("/checkpoint/strata/vertices", vertices, 0);
  file.write("/checkpoint/strata/patches", std::vector<std::int64_t>(record.patches.begin(), record.patches.end()), 0);
  if (!interfaces.empty()) file.write("/checkpoint/strata/interfaces", interfaces, Dim + 1);
  file.write("/checkpoint/strata/planes", planes, 2 * Dim);
  file.write("/checkpoint/strata/tolerance", std::array{record.tolerance}, 0);
}

template <int Dim>
Strata<Dim> read_strata(const fs::path& path, const hdf5::File& file, const Mesh<Dim>& mesh) {
  if (!file.contains("/checkpoint/strata")) return {};  // none found yet, or by an older version
  const auto refuse = [&](const std::string& name, const std::string& found, const std::string& expected) {
    throw InputError({path.string(), "/checkpoint/strata" + name, found, expected});
  };
  typename Strata<Dim>::Record record;
  for (const int stratum : read_ints(path, file, "/checkpoint/strata/vertices")) {
    if (stratum < 0 || stratum > static_cast<int>(Stratum::non_manifold))
      refuse("/vertices", "stratum " + std::to_string(stratum), "0 to 4");
    record.vertices.push_back(static_cast<Stratum>(stratum));
  }
  record.patches = read_ints(path, file, "/checkpoint/strata/patches");
  if (file.contains("/checkpoint/strata/interfaces"))
    record.interfaces = read_rows<Dim + 1>(path, file, "/checkpoint/strata/interfaces");
  for (const auto& row : record.interfaces)
    for (int i = 0; i < Dim; ++i)
      if (row[i] < 0 || row[i] >= mesh.num_vertices())
        refuse("/interfaces", "vertex " + std::to_string(row[i]), "numbers below " + std::to_string(mesh.num_vertices()));
  const auto planes = file.read_doubles("/checkpoint/strata/planes");
  if (planes.columns != 2 * Dim) refuse("/planes", std::to_string(planes.columns) + " columns", std::to_string(2 * Dim));
  for (std::size_t i = 0; i < planes.values.size(); i += 2 * Dim) {
    const double* row = &planes.values[i];
    record.planes.push_back({Vec<Dim>(row), Vec<Dim>(row + Dim)});
    const double length = record.planes.back().normal.norm();
    if (!(std::abs(length - 1) < 1e-9)) refuse("/planes", "a normal of length " + std::to_string(length), "1");
  }
  const auto tolerance = file.read_doubles("/checkpoint/strata/tolerance").values;
  if (tolerance.size() != 1) refuse("/tolerance", std::to_string(tolerance.size()) + " numbers", "1");
  record.tolerance = tolerance[0];
  record.vertices.insert(record.vertices.end(), mesh.num_curved(), Stratum::volume);
  Strata<Dim> strata(record);
  if (const std::string misfit = strata.find_misfit(mesh); !misfit.empty()) refuse("", misfit, "strata of the frame's mesh");
  return strata;
}

void write_factor(hdf5::File& file, const linear::FactorRecord& factor) {
  file.write("/checkpoint/factor_record",
             std::array{factor.spent, factor.served, factor.iterations, double(factor.pause), double(factor.next_pause)}, 0);
  if (!factor.matrix) return;
  const auto& pattern = *factor.matrix->pattern;
  const auto write = [&](const char* name, const std::vector<int>& numbers) {
    file.write(name, std::vector<std::int64_t>(numbers.begin(), numbers.end()), 0);
  };
  write("/checkpoint/factor/starts", pattern.column_starts);
  write("/checkpoint/factor/rows", pattern.row_indices);
  file.write("/checkpoint/factor/values", factor.matrix->values, 0);
  file.write("/checkpoint/factor/block_size", std::array{std::int64_t{factor.matrix->block_size}}, 0);
}

linear::FactorRecord read_factor(const fs::path& path, const hdf5::File& file) {
  const auto numbers = file.read_doubles("/checkpoint/factor_record").values;
  if (numbers.size() != 5)
    throw InputError({path.string(), "/checkpoint/factor_record", std::to_string(numbers.size()) + " numbers", "5"});
  linear::FactorRecord factor;
  factor.spent = numbers[0];
  factor.served = numbers[1];
  factor.iterations = numbers[2];
  factor.pause = as_int(path, "/checkpoint/factor_record", numbers[3]);
  factor.next_pause = as_int(path, "/checkpoint/factor_record", numbers[4]);
  if (!file.contains("/checkpoint/factor")) return factor;
  linear::SparsityPattern pattern;
  pattern.column_starts = read_ints(path, file, "/checkpoint/factor/starts");
  pattern.row_indices = read_ints(path, file, "/checkpoint/factor/rows");
  pattern.order = static_cast<int>(pattern.column_starts.size()) - 1;
  const auto block_size = read_ints(path, file, "/checkpoint/factor/block_size");
  if (block_size.size() == 1)
    factor.matrix = linear::make_factored_matrix(std::move(pattern), file.read_doubles("/checkpoint/factor/values").values,
                                                 block_size[0]);
  if (!factor.matrix)
    throw InputError({path.string(), "/checkpoint/factor", "arrays that are no lower triangle", "the matrix of a factor"});
  return factor;
}

template <int Dim>
void write_cells(hdf5::File& file, const std::string& group, const std::shared_ptr<const CellHistory>& history) {
  const auto field = std::dynamic_pointer_cast<const CellField<Dim>>(history);
  if (!field) return;
  std::vector<std::int64_t> rows;
  std::vector<double> records;
  for (const auto& of_cell : field->by_cell()) {
    rows.push_back(of_cell.rows());
    records.insert(records.end(), of_cell.data(), of_cell.data() + of_cell.size());
  }
  file.write(group + "/t", std::array{field->time()}, 0);
  file.write(group + "/rows", rows, 0);
  file.write(group + "/records", records, 0);
}

/// Null where the file has none.
template <int Dim>
std::shared_ptr<const CellHistory> read_cells(const fs::path& path, const hdf5::File& file, const std::string& group,
                                              const State<Dim>& state) {
  using Records = typename CellField<Dim>::Records;
  const std::string of_time = group + "/t", of_rows = group + "/rows", of_records = group + "/records";
  if (!file.contains(of_time)) return nullptr;
  const auto refuse = [&](const std::string& name, const std::string& found, const std::string& expected) {
    throw InputError({path.string(), name, found, expected});
  };
  const std::vector<double> t = file.read_doubles(of_time).values, records = file.read_doubles(of_records).values;
  const std::vector<int> rows = read_ints(path, file, of_rows);
  if (t.size() != 1) refuse(of_time, std::to_string(t.size()) + " numbers", "1");
  if (static_cast<int>(rows.size()) != state.mesh.cell_slots())
    refuse(of_rows, std::to_string(rows.size()) + " numbers", "one for every cell");
  std::vector<Records> by_cell;
  std::size_t begin = 0;
  for (const int n : rows) {
    const std::size_t size = n < 0 ? records.size() : static_cast<std::size_t>(n) * (Dim + 1);
    if (n < 0 || size > records.size() - begin) refuse(of_records, std::to_string(records.size()) + " numbers", "more");
    by_cell.emplace_back(Eigen::Map<const Records>(records.data() + begin, n, Dim + 1));
    begin += size;
  }
  return std::make_shared<CellField<Dim>>(state.mesh, t[0], std::move(by_cell));
}

template <int Dim>
void read_step_control(const fs::path& path, const hdf5::File& file, State<Dim>& state) {
  const std::vector<double> control = file.read_doubles(kStepControl).values;
  if (control.size() != 4 ||
      !std::all_of(control.begin(), control.end(), [](double c) { return c >= 0 && std::isfinite(c); }))
    throw InputError({path.string(), kStepControl, std::to_string(control.size()) + " numbers", "4, none of them negative"});
  state.control = {control[0], control[1], control[2]};
  state.history.dt = control[3];
}

/// The scene as this version writes it; those of itr 0.1 (formats 7 and 8) named no set of defaults.
std::string read_scene(const hdf5::File& file) {
  std::string scene = file.read_text("/checkpoint/scene");
  if (file.read_integer_attribute("checkpoint_format") == kFormat) return scene;
  if (auto json = nlohmann::json::parse(scene, nullptr, false); json.is_object()) {
    json["defaults"] = "itr-0";
    scene = json.dump();
  }
  return scene;
}

/// Totals as this version writes them; those of itr 0.1 were numbers without names.
std::string read_totals(const hdf5::File& file) {
  if (file.read_integer_attribute("checkpoint_format") == kFormat) return file.read_text("/checkpoint/totals");
  return totals_of_list(file.read_doubles("/checkpoint/totals").values);
}

}  // namespace

template <int Dim>
void write_checkpoint(hdf5::File& file, const State<Dim>& state, const Progress& progress, const Units& units) {
  std::vector<std::int64_t> tags;
  tags.reserve(state.mesh.facet_slots());
  for (FacetId f = 0; f < state.mesh.facet_slots(); ++f) tags.push_back(state.mesh.facet_tag(f));
  file.write("/checkpoint/facet_tag", tags, 0);
  std::vector<std::int64_t> points;  // rows of a vertex and its tag
  for (VertexId v = 0; v < state.mesh.num_vertices(); ++v)
    if (state.mesh.vertex_tag(v) != kNoTag) points.insert(points.end(), {v, state.mesh.vertex_tag(v)});
  if (!points.empty()) file.write("/checkpoint/vertex_tag", points, 2);
  if (!units.is_si()) {
    std::vector<double> rest;
    for (VertexId v = 0; v < state.mesh.num_vertices(); ++v)
      rest.insert(rest.end(), state.mesh.rest(v).begin(), state.mesh.rest(v).end());
    file.write(kRest, rest, Dim);
    file.write(kTime, std::array{state.t}, 0);
  }
  const auto write_fields = [&](const char* kind, const std::vector<VectorX>& fields) {
    for (std::size_t age = 0; age < fields.size(); ++age)
      file.write(field_name(kind, age), std::span(fields[age].data(), static_cast<std::size_t>(fields[age].size())), 0);
  };
  write_fields("x", state.history.x);
  write_fields("v", state.history.v);
  write_fields("a", state.history.a);
  if (state.deviation.size() > 0) write_fields("deviation", {state.deviation});
  if (!state.quadrature.empty())
    file.write(kQuadratureLevels, std::vector<std::int64_t>(state.quadrature.begin(), state.quadrature.end()), 0);
  if (!state.doublings.empty())
    file.write(kDoublings, std::vector<std::int64_t>(state.doublings.begin(), state.doublings.end()), 0);
  if (!state.chords.empty())
    file.write(kChordLevels, std::vector<std::int64_t>(state.chords.begin(), state.chords.end()), 0);
  const BarrierStiffness& stiffness = state.stiffness;
  file.write("/checkpoint/barrier_stiffness",
             std::array{stiffness.value, stiffness.largest, stiffness.previous_squared_distance}, 0);
  file.write("/checkpoint/energy_guard",
             std::array{state.created_energy, state.history.damp_next ? 1.0 : 0.0, state.stored_energy}, 0);
  if (const StepControl& control = state.control; control.dt > 0)
    file.write(kStepControl, std::array{control.dt, control.error, control.energy, state.history.dt}, 0);
  write_cells<Dim>(file, kViscous, state.history.viscous);
  write_cells<Dim>(file, kSoftening, state.history.softening);
  write_memory(file, state.remesh_memory);
  write_strata(file, state.strata, state.mesh.num_vertices());
  write_factor(file, state.factor);
  file.write_text("/checkpoint/totals", std::string(progress.totals));
  file.write_text("/checkpoint/scene", std::string(progress.scene));
  file.write_text("/checkpoint/backend", std::string(progress.backend));
  file.write_attribute("checkpoint_format", kFormat);
  file.write_attribute("checkpoint_log_bytes", static_cast<std::int64_t>(progress.log_bytes));
}

std::optional<SavedState> find_saved_state(const fs::path& directory, int before) {
  std::vector<fs::path> files = stored_frames(directory);
  std::reverse(files.begin(), files.end());
  std::vector<std::string> passed_over;
  for (const fs::path& path : files) {
    if (step_of_frame(path) >= before) continue;
    try {
      const hdf5::Session session;
      const hdf5::File file = hdf5::File::open(path);
      if (!file.contains("/checkpoint")) continue;
      const std::int64_t format = file.read_integer_attribute("checkpoint_format");
      if (format < kOldestFormat || format > kFormat) continue;
      return SavedState{path,
                        read_scene(file),
                        file.read_text("/checkpoint/backend"),
                        file.shape("/mesh/rest").columns,
                        step_of_frame(path),
                        read_units(path, file),
                        passed_over};
    } catch (const InputError& error) {  // damaged, by a loss of power, say: the one before it is the newest
      passed_over.push_back(error.what());
    }
  }
  if (!files.empty())
    throw InputError({directory.string(), "saved states",
                      "frames but no state that can be read" + (passed_over.empty() ? "" : " (" + passed_over[0] + ")"),
                      "a folder that this version of itr wrote"});
  return std::nullopt;
}

template <int Dim>
Checkpoint<Dim> read_checkpoint(const SavedState& saved) {
  const hdf5::Session session;
  const hdf5::File file = hdf5::File::open(saved.file);
  if (!file.has_digests()) throw InputError({saved.file.string(), "/digests", "none", "those of what was saved"});
  Checkpoint<Dim> checkpoint;
  const auto made = std::make_shared<State<Dim>>();
  checkpoint.state = made;
  State<Dim>& state = *made;
  try {
    state.mesh = read_mesh<Dim>(saved.file, file);
  } catch (const InputError& error) {
    throw InputError({saved.file.string(), "/mesh " + error.parts().place, error.parts().found, error.parts().expected});
  }
  state.history.x = read_fields(file, "x");
  state.history.v = read_fields(file, "v");
  state.history.a = read_fields(file, "a");
  if (auto deviation = read_fields(file, "deviation"); !deviation.empty()) state.deviation = std::move(deviation[0]);
  const std::vector<int> quadrature = read_levels(saved.file, file, kQuadratureLevels, kMostClosedLevel);
  state.quadrature.assign(quadrature.begin(), quadrature.end());
  if (file.contains(kDoublings)) state.doublings = read_ints(saved.file, file, kDoublings);
  const std::vector<int> chords = read_levels(saved.file, file, kChordLevels, kMostHalvings<Dim>);
  state.chords.assign(chords.begin(), chords.end());
  const std::vector<double> stiffness = file.read_doubles("/checkpoint/barrier_stiffness").values;
  if (stiffness.size() != 3)
    throw InputError(
        {saved.file.string(), "/checkpoint/barrier_stiffness", std::to_string(stiffness.size()) + " numbers", "3"});
  state.stiffness = {stiffness[0], stiffness[1], stiffness[2]};
  const std::vector<double> guard = file.read_doubles("/checkpoint/energy_guard").values;
  if (guard.size() != 3)
    throw InputError({saved.file.string(), "/checkpoint/energy_guard", std::to_string(guard.size()) + " numbers", "3"});
  state.created_energy = guard[0];
  state.history.damp_next = guard[1] != 0;
  state.stored_energy = guard[2];
  if (file.contains(kStepControl)) read_step_control(saved.file, file, state);
  state.history.viscous = read_cells(saved.file, file, kViscous, state);
  state.history.softening = read_cells(saved.file, file, kSoftening, state);
  state.remesh_memory = read_memory(saved.file, file, state.mesh.num_vertices());
  state.strata = read_strata<Dim>(saved.file, file, state.mesh);
  state.factor = read_factor(saved.file, file);
  state.step = as_int(saved.file, "attribute step", file.read_integer_attribute("step"));
  if (!file.contains(kTime)) {
    state.t = file.read_double_attribute("t");
  } else if (const auto t = file.read_doubles(kTime).values; t.size() == 1) {
    state.t = t[0];
  } else {
    throw InputError({saved.file.string(), kTime, std::to_string(t.size()) + " numbers", "1"});
  }
  checkpoint.totals = read_totals(file);
  const std::int64_t log_bytes = file.read_integer_attribute("checkpoint_log_bytes");
  if (log_bytes < 0)
    throw InputError({saved.file.string(), "attribute checkpoint_log_bytes", std::to_string(log_bytes), "0 or more"});
  checkpoint.log_bytes = static_cast<std::size_t>(log_bytes);
  return checkpoint;
}

#define ITR_INSTANTIATE(Dim)                                                                          \
  template void write_checkpoint<Dim>(hdf5::File&, const State<Dim>&, const Progress&, const Units&); \
  template Checkpoint<Dim> read_checkpoint<Dim>(const SavedState&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr::output
