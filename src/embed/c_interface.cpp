// SPDX-License-Identifier: MIT
// itr.h over AnySimulation: no exception leaves it.
#include <algorithm>
#include <exception>
#include <limits>
#include <new>
#include <nlohmann/json.hpp>

#include "c_callbacks.hpp"
#include "itr/core.hpp"
#include "itr/itr.h"
#include "itr/itr.hpp"
#include "simulation/report_fields.hpp"

struct itr_model {
  itr::Model model;
  std::string message;
};
struct itr_simulation {
  itr::AnySimulation simulation;
  std::string message;
};
struct itr_snapshot {
  itr::AnySimulation::Saved saved;
};

namespace {

void note(std::string& message, const char* text) noexcept {
  try {
    message = text;
  } catch (const std::bad_alloc&) {
    message.clear();
  }
}

/// Runs f, which returns a status or nothing.
template <typename F>
itr_status guarded(std::string& message, F&& f) noexcept {
  try {
    if constexpr (std::is_void_v<decltype(f())>) {
      f();
      return ITR_SUCCESS;
    } else {
      return f();
    }
  } catch (const itr::InputError& error) {
    note(message, error.what());
    return ITR_BAD_INPUT;
  } catch (const std::exception& error) {
    note(message, error.what());
  } catch (...) {
    note(message, "an unknown error");
  }
  return ITR_ERROR;
}

template <typename T>
void require(const T* pointer, const char* name) {
  if (!pointer) throw itr::InputError({"", name, "NULL", "an argument"});
}

template <typename T>
std::span<const T> array(const char* name, const T* values, std::size_t size) {
  if (size > 0) require(values, name);
  return {values, size};
}

itr::HostFunction as_function(itr_function function, void* user) {
  if (!function) return nullptr;
  return [=](const double* X, double t, double* value) { function(X, t, value, user); };
}

std::size_t dimension_of(const itr_simulation* s) { return static_cast<std::size_t>(s->simulation.dimension()); }
/// f on the simulation below; a NULL handle is an error without a place for its message.
template <typename F>
itr_status with(itr_simulation* s, F&& f) noexcept {
  if (!s) return ITR_BAD_INPUT;
  return guarded(s->message, [&] { return f(s->simulation); });
}
template <typename F>
itr_status with(itr_model* m, F&& f) noexcept {
  if (!m) return ITR_BAD_INPUT;
  return guarded(m->message, [&] { return f(m->model); });
}
template <typename F>
itr_status with_boundary(itr_simulation* s, const char* boundary, F&& f) noexcept {
  return with(s, [&](itr::AnySimulation& simulation) {
    require(boundary, "boundary");
    f(simulation);
  });
}

itr_status status_of(const itr::StepResult& result, std::string& message) {
  if (result.ok) return ITR_SUCCESS;
  message = result.reason;
  return result.cancelled ? ITR_CANCELLED : ITR_STOPPED;
}

template <typename T>
void copy(const std::vector<T>& values, const char* name, T* result) {
  require(result, name);
  std::copy(values.begin(), values.end(), result);
}
template <typename T>
void copy(const std::vector<T>& values, const char* name, std::size_t length, T* result) {
  if (length != values.size())
    throw itr::InputError({"", name, "a length of " + std::to_string(length), std::to_string(values.size())});
  copy(values, name, result);
}

void copy_resultant(const itr::AnySimulation::Resultants& sum, double* force, double* moment) {
  copy(sum.force, "force", force);
  copy(sum.moment, "moment", moment);
}

/// get() of the simulation, `none` without one.
template <typename T, typename F>
T value_of(const itr_simulation* s, T none, F&& get) {
  return s ? static_cast<T>(get(s->simulation)) : none;
}

}  // namespace

const char* itr_version(void) { return ITR_VERSION; }

itr_model* itr_model_create(int dimension) {
  try {
    return new itr_model{itr::Model(dimension), {}};
  } catch (...) {
    return nullptr;
  }
}
void itr_model_destroy(itr_model* model) { delete model; }
const char* itr_model_message(const itr_model* model) { return model ? model->message.c_str() : "no model"; }

itr_status itr_model_read_scene(itr_model* model, const char* file) {
  return with(model, [&](itr::Model& m) {
    require(file, "file");
    m = itr::Model::from_scene(file);
  });
}
itr_status itr_model_set_options(itr_model* model, const char* json) {
  return with(model, [&](itr::Model& m) {
    require(json, "json");
    m.set_options(json);
  });
}
itr_status itr_model_set_option(itr_model* model, const char* pointer, const char* value) {
  return with(model, [&](itr::Model& m) {
    require(pointer, "pointer");
    require(value, "value");
    m.set_option(pointer, value);
  });
}
itr_status itr_model_set_number(itr_model* model, const char* pointer, double value) {
  return with(model, [&](itr::Model& m) {
    require(pointer, "pointer");
    m.set_option(pointer, nlohmann::json(value).dump());
  });
}
itr_status itr_model_set_mesh(itr_model* model, size_t num_vertices, const double* vertices, size_t num_cells,
                              const int* cells, const int* bodies) {
  return with(model, [&](itr::Model& m) {
    const auto d = static_cast<std::size_t>(m.dimension());
    const auto points = array("vertices", vertices, d * num_vertices);
    m.set_mesh(points, array("cells", cells, (d + 1) * num_cells),
               bodies ? std::span(bodies, num_cells) : std::span<const int>());
  });
}
itr_status itr_model_set_quadratic_mesh(itr_model* model, size_t num_nodes, const double* nodes, size_t num_cells,
                                        const int* cells, const int* bodies) {
  return with(model, [&](itr::Model& m) {
    const auto d = static_cast<std::size_t>(m.dimension());
    const auto points = array("nodes", nodes, d * num_nodes);
    m.set_quadratic_mesh(points, array("cells", cells, (d + 1) * (d + 2) / 2 * num_cells),
                         bodies ? std::span(bodies, num_cells) : std::span<const int>());
  });
}
itr_status itr_model_add_boundary(itr_model* model, const char* name, size_t num_facets, const int* facets, int* id) {
  return with(model, [&](itr::Model& m) {
    require(name, "name");
    const int given = m.add_boundary(name, array("facets", facets, num_facets * static_cast<std::size_t>(m.dimension())));
    if (id) *id = given;
  });
}
itr_status itr_model_add_boundary_box(itr_model* model, const char* name, const double* box_min, const double* box_max,
                                      int* id) {
  return with(model, [&](itr::Model& m) {
    require(name, "name");
    const auto d = static_cast<std::size_t>(m.dimension());
    const int given = m.add_boundary(name, array("box_min", box_min, d), array("box_max", box_max, d));
    if (id) *id = given;
  });
}
itr_status itr_model_set_law(itr_model* model, int body, const itr_law* law, void* user) {
  return with(model, [&](itr::Model& m) {
    require(law, "law");
    m.set_law(body, itr::law_of(*law, user));
  });
}
itr_status itr_model_add_obstacle(itr_model* model, const char* name, size_t num_vertices, const double* vertices,
                                  size_t num_edges, const int* edges, size_t num_triangles, const int* triangles, int* id) {
  return with(model, [&](itr::Model& m) {
    require(name, "name");
    const int given =
        m.add_obstacle(name, array("vertices", vertices, num_vertices * static_cast<std::size_t>(m.dimension())),
                       array("edges", edges, 2 * num_edges), array("triangles", triangles, 3 * num_triangles));
    if (id) *id = given;
  });
}

itr_status itr_simulation_create(itr_model* model, itr_log_function log, void* user, itr_simulation** simulation) {
  return with(model, [&](itr::Model& m) {
    require(simulation, "simulation");
    *simulation = nullptr;
    itr::Logger logger;
    if (log)
      logger = itr::Logger([=](itr::LogLevel level, std::string_view text) {
        log(static_cast<int>(level), std::string(text).c_str(), user);
      });
    *simulation = new itr_simulation{itr::AnySimulation(m, std::move(logger)), {}};
  });
}
void itr_simulation_destroy(itr_simulation* simulation) { delete simulation; }
const char* itr_simulation_message(const itr_simulation* simulation) {
  return simulation ? simulation->message.c_str() : "no simulation";
}

itr_status itr_step(itr_simulation* simulation, double dt) {
  return with(simulation, [&](itr::AnySimulation& s) { return status_of(s.step(dt), simulation->message); });
}
itr_status itr_adapt(itr_simulation* simulation, double dt) {
  return with(simulation, [&](itr::AnySimulation& s) { return status_of(s.adapt(dt), simulation->message); });
}
// Functions that hand on one value of the simulation, or an array of it.
#define ITR_VALUE(TYPE, FUNCTION, NONE, VALUE)                                              \
  TYPE FUNCTION(const itr_simulation* simulation) {                                         \
    return value_of<TYPE>(simulation, NONE, [](const auto& s) -> TYPE { return s.VALUE; }); \
  }
ITR_VALUE(double, itr_time, std::numeric_limits<double>::quiet_NaN(), time())
ITR_VALUE(int, itr_steps, -1, steps())
ITR_VALUE(int, itr_finished, -1, finished())
ITR_VALUE(int, itr_dimension, -1, dimension())
ITR_VALUE(size_t, itr_num_vertices, 0, num_vertices())
ITR_VALUE(size_t, itr_num_nodes, 0, num_nodes())
ITR_VALUE(size_t, itr_num_cells, 0, num_cells())
ITR_VALUE(size_t, itr_num_facets, 0, num_facets())
ITR_VALUE(const double*, itr_positions, nullptr, positions().data())
ITR_VALUE(const double*, itr_velocities, nullptr, velocities().data())

#define ITR_ARRAY(FUNCTION, TYPE, NAME, VALUES)                                                     \
  itr_status FUNCTION(itr_simulation* simulation, size_t length, TYPE* NAME) {                      \
    return with(simulation, [&](itr::AnySimulation& s) { copy(s.VALUES(), #NAME, length, NAME); }); \
  }
ITR_ARRAY(itr_get_curved_edges, int, edges, curved_edges)
ITR_ARRAY(itr_get_rest_positions, double, X, rest_positions)
ITR_ARRAY(itr_get_cells, int, cells, cells)
ITR_ARRAY(itr_get_bodies, int, bodies, bodies)
ITR_ARRAY(itr_get_facets, int, facets, facets)
ITR_ARRAY(itr_get_facet_boundaries, int, ids, facet_boundaries)
ITR_ARRAY(itr_get_contact_pressure, double, pressure, contact_pressure)
ITR_ARRAY(itr_get_von_mises, double, von_mises, von_mises)
ITR_ARRAY(itr_get_stress, double, stress, stress)

itr_status itr_fix(itr_simulation* simulation, const char* boundary, const int* mask, itr_function displacement,
                   void* user) {
  return with_boundary(simulation, boundary, [&](itr::AnySimulation& s) {
    s.fix(boundary, array("mask", mask, dimension_of(simulation)), as_function(displacement, user));
  });
}
itr_status itr_fix_values(itr_simulation* simulation, const char* boundary, const int* mask, size_t length,
                          const double* displacements) {
  return with_boundary(simulation, boundary, [&](itr::AnySimulation& s) {
    s.fix(boundary, array("mask", mask, dimension_of(simulation)), array("displacements", displacements, length));
  });
}
// Loads on a boundary, by a function or by values at its vertices.
#define ITR_LOAD(FUNCTION, NAME, SET)                                                                       \
  itr_status FUNCTION(itr_simulation* simulation, const char* boundary, itr_function NAME, void* user) {    \
    return with_boundary(simulation, boundary, [&](auto& s) { s.SET(boundary, as_function(NAME, user)); }); \
  }
#define ITR_LOAD_VALUES(FUNCTION, NAME, SET)                                                                   \
  itr_status FUNCTION(itr_simulation* simulation, const char* boundary, size_t length, const double* NAME) {   \
    return with_boundary(simulation, boundary, [&](auto& s) { s.SET(boundary, array(#NAME, NAME, length)); }); \
  }
ITR_LOAD(itr_set_traction, traction, set_traction)
ITR_LOAD_VALUES(itr_set_traction_values, tractions, set_traction)
ITR_LOAD(itr_set_pressure, pressure, set_pressure)
ITR_LOAD_VALUES(itr_set_pressure_values, pressures, set_pressure)
itr_status itr_set_acceleration(itr_simulation* simulation, itr_function acceleration, void* user) {
  return with(simulation, [&](itr::AnySimulation& s) { s.set_acceleration(as_function(acceleration, user)); });
}
itr_status itr_set_acceleration_values(itr_simulation* simulation, size_t length, const double* accelerations) {
  return with(simulation, [&](itr::AnySimulation& s) { s.set_acceleration(array("accelerations", accelerations, length)); });
}
itr_status itr_move_obstacle(itr_simulation* simulation, const char* obstacle, itr_function displacement, void* user) {
  return with(simulation, [&](itr::AnySimulation& s) {
    require(obstacle, "obstacle");
    s.move_obstacle(obstacle, as_function(displacement, user));
  });
}
itr_status itr_move_obstacle_to(itr_simulation* simulation, const char* obstacle, size_t num_vertices,
                                const double* positions) {
  return with(simulation, [&](itr::AnySimulation& s) {
    require(obstacle, "obstacle");
    s.move_obstacle(obstacle, array("positions", positions, num_vertices * dimension_of(simulation)));
  });
}
// Values at all vertices, which NULL removes.
#define ITR_REMOVABLE_VALUES(FUNCTION, NAME, SET)                                                                 \
  itr_status FUNCTION(itr_simulation* simulation, size_t length, const double* NAME) {                            \
    return with(simulation, [&](itr::AnySimulation& s) {                                                          \
      if (NAME && length == 0) throw itr::InputError({"", #NAME, "a length of 0", "that of the array, or NULL"}); \
      s.SET(NAME ? std::span(NAME, length) : std::span<const double>());                                          \
    });                                                                                                           \
  }
ITR_REMOVABLE_VALUES(itr_set_forces, forces, set_forces)
ITR_REMOVABLE_VALUES(itr_set_eigenstrain, strains, set_eigenstrain)
itr_status itr_set_follower_forces(itr_simulation* simulation, itr_force_function forces, itr_stiffness_function stiffness,
                                   void* user) {
  return with(simulation, [&](itr::AnySimulation& s) {
    s.set_follower_forces(itr::forces_of(forces, s.dimension(), user), itr::stiffness_of(stiffness, s.dimension(), user));
  });
}
itr_status itr_set_term(itr_simulation* simulation, const char* name, const itr_term* term, void* user) {
  return with(simulation, [&](itr::AnySimulation& s) {
    require(name, "name");
    s.set_term(name, term ? itr::term_of(*term, user) : itr::HostTerm());
  });
}
itr_status itr_set_velocities(itr_simulation* simulation, size_t length, const double* velocities) {
  return with(simulation, [&](itr::AnySimulation& s) { s.set_velocities(array("velocities", velocities, length)); });
}
itr_status itr_freeze_mesh(itr_simulation* simulation, int frozen) {
  return with(simulation, [&](itr::AnySimulation& s) { s.freeze_mesh(frozen != 0); });
}

itr_status itr_watch_forces(itr_simulation* simulation, int watched) {
  return with(simulation, [&](itr::AnySimulation& s) { s.watch_forces(watched != 0); });
}
const double* itr_forces(const itr_simulation* simulation, itr_force kind) {
  if (!simulation || kind < ITR_CONTACT || kind > ITR_RESIDUAL) return nullptr;
  const itr::VectorX& forces = simulation->simulation.forces().*itr::kForcesOnBodies[kind];
  return forces.size() == 0 ? nullptr : forces.data();
}
itr_status itr_resultant(itr_simulation* simulation, const char* part, const double* about, double* force, double* moment) {
  return with(simulation, [&](itr::AnySimulation& s) {
    require(part, "part");
    const std::string name = part;
    copy_resultant(s.resultant(std::span(&name, 1), array("about", about, dimension_of(simulation))), force, moment);
  });
}
itr_status itr_resultant_of_id(itr_simulation* simulation, int id, const double* about, double* force, double* moment) {
  return with(simulation, [&](itr::AnySimulation& s) {
    copy_resultant(s.resultant(id, array("about", about, dimension_of(simulation))), force, moment);
  });
}

static_assert(sizeof(itr_energies) == std::tuple_size_v<decltype(itr::kEnergyFields)> * sizeof(double));
itr_status itr_get_energies(itr_simulation* simulation, itr_energies* energies) {
  return with(simulation, [&](itr::AnySimulation& s) {
    require(energies, "energies");
    double* next = &energies->inertia;  // members in the order of the table
    itr::for_each_field(itr::kEnergyFields, [&](const auto& field) { *next++ = s.report().energy.*field.member; });
  });
}
itr_status itr_get_statistics(itr_simulation* simulation, itr_step_statistics* statistics) {
  return with(simulation, [&](itr::AnySimulation& s) {
    require(statistics, "statistics");
    const itr::StepReport& r = s.report();
    *statistics = {r.newton_iterations,    r.linear_solves,      r.factorizations,   r.splits.accepted,  r.curves.accepted,
                   r.straightens.accepted, r.collapses.accepted, r.swaps.accepted,   r.smooths.accepted, r.cut_steps,
                   r.history_loss,         r.min_distance,       r.min_volume_ratio, r.seconds.total};
  });
}

itr_snapshot* itr_save(const itr_simulation* simulation) {
  if (!simulation) return nullptr;
  try {
    return new itr_snapshot{simulation->simulation.save()};
  } catch (...) {
    return nullptr;
  }
}
itr_status itr_restore(itr_simulation* simulation, const itr_snapshot* snapshot) {
  return with(simulation, [&](itr::AnySimulation& s) {
    require(snapshot, "snapshot");
    s.restore(snapshot->saved);
  });
}
void itr_snapshot_destroy(itr_snapshot* snapshot) { delete snapshot; }

itr_status itr_on_iteration(itr_simulation* simulation, itr_iteration_function listener, void* user) {
  return with(simulation, [&](itr::AnySimulation& s) {
    if (!listener) return s.on_iteration(nullptr);
    s.on_iteration([=](const itr::NewtonProgress& p) {
      return listener(p.iteration, p.energy, p.gradient_norm, p.step_norm, user) != 0;
    });
  });
}

itr_status itr_on_mesh_change(itr_simulation* simulation, itr_mesh_function listener, void* user) {
  return with(simulation, [&](itr::AnySimulation& s) {
    if (!listener) return s.on_mesh_change(nullptr);
    s.on_mesh_change([=](const itr::AnyMeshChange& change) {
      const auto& P = change.interpolation;
      const itr_mesh_change view{change.vertex.size(),
                                 change.cell.size(),
                                 change.facet.size(),
                                 static_cast<std::size_t>(P.rows()),
                                 change.facet_parent.size(),
                                 change.vertex.data(),
                                 change.cell.data(),
                                 change.facet.data(),
                                 change.facet_parent.data(),
                                 P.outerIndexPtr(),
                                 P.innerIndexPtr(),
                                 P.valuePtr(),
                                 &change};
      listener(&view, user);
    });
  });
}

itr_status itr_project(const itr_mesh_change* change, size_t components, const double* old_field, double* new_field) {
  if (!change || !old_field || !new_field || components == 0) return ITR_BAD_INPUT;
  std::string ignored;
  return guarded(ignored, [&] {
    using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const auto n = static_cast<Eigen::Index>(change->old_vertices), k = static_cast<Eigen::Index>(components);
    const itr::MatrixX fields = Eigen::Map<const Rows>(old_field, n, k);
    const itr::MatrixX result = static_cast<const itr::AnyMeshChange*>(change->projection)->project(fields);
    Eigen::Map<Rows>(new_field, result.rows(), k) = result;
  });
}
