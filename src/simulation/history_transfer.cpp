// SPDX-License-Identifier: MIT
#include "itr/simulation/history_transfer.hpp"

#include <string>

#include "itr/projection/safe_projection.hpp"
#include "itr/projection/transfer.hpp"

namespace itr {

namespace {

constexpr int kFreeRings = 4;  ///< rings around the touched cells that a projection with barriers may move

struct MeshArrays {
  std::vector<Vec<2>> rest;
  std::vector<std::array<int, 3>> cells;
  std::vector<double> density;
  MeshArrays(const Mesh<2>& mesh, const std::map<int, Material>& materials) {
    for (int v = 0; v < mesh.vertex_slots(); ++v) rest.push_back(mesh.rest(v));
    for (int c = 0; c < mesh.cell_slots(); ++c) {
      cells.push_back(mesh.cell(c));
      density.push_back(materials.at(mesh.body(c)).density);
    }
  }
  TransferMesh<2> view() const { return {rest, cells, density}; }
};

MatrixX as_columns(const VectorX& field, int vertices) {
  MatrixX columns(vertices, 2);
  for (int v = 0; v < vertices; ++v) columns.row(v) = field.segment<2>(2 * v).transpose();
  return columns;
}

void set_from_columns(const MatrixX& columns, VectorX& field) {
  for (Eigen::Index v = 0; v < columns.rows(); ++v) field.segment<2>(2 * v) = columns.row(v).transpose();
}

std::vector<char> vertices_near(const Mesh<2>& mesh, const std::vector<int>& cells, int total) {
  std::vector<char> near(total, 0);
  for (const int c : cells)
    for (const int v : mesh.cell(c)) near[v] = 1;
  for (int ring = 0; ring < kFreeRings; ++ring) {
    const std::vector<char> last = near;
    for (int c = 0; c < mesh.cell_slots(); ++c) {
      const auto& cell = mesh.cell(c);
      if (last[cell[0]] || last[cell[1]] || last[cell[2]])
        for (const int v : cell) near[v] = 1;
    }
  }
  return near;
}

}  // namespace

void transfer_history(const Setup<2>& setup, const Mesh<2>& old_mesh, const History& old_history, const Mesh<2>& mesh,
                      const TouchedCells& touched, const StepProblem<2>& step, linear::Solver& solver, const Logger& logger,
                      History& history) {
  const MeshArrays from(old_mesh, setup.materials), to(mesh, setup.materials);
  const int old_vertices = old_mesh.vertex_slots(), vertices = mesh.vertex_slots();
  const std::vector<char> held = held_dofs(setup, mesh, setup.time.t0).held;
  std::vector<char> none(vertices, 0), held_vertices(vertices, 0);
  for (int v = 0; v < vertices; ++v) held_vertices[v] = held[2 * v] || held[2 * v + 1];
  TransferReport report;
  const auto project = [&](const VectorX& old_field, const VectorX& interpolant, std::span<const char> fixed) {
    const MatrixX projected = project_l2<2>(from.view(), to.view(), touched, as_columns(old_field, old_vertices),
                                            as_columns(interpolant, vertices), fixed, report);
    VectorX field = interpolant;
    set_from_columns(projected, field);
    return field;
  };
  for (std::size_t i = 0; i < history.v.size(); ++i) history.v[i] = project(old_history.v[i], history.v[i], none);
  for (std::size_t i = 0; i < history.a.size(); ++i) history.a[i] = project(old_history.a[i], history.a[i], none);

  const CellSet<2> cells = whole_mesh(mesh, setup.obstacles.rest);
  const CollisionSurface surface = collision_surface(mesh, setup.obstacles);
  ContactOptions contact = setup.contact;
  contact.barrier_stiffness = step.stiffness().value;
  const SafeProjectionProblem<2> problem{cells,
                                         setup.contact.enabled ? &surface : nullptr,
                                         setup.materials,
                                         contact,
                                         step.scaling(),
                                         vertices_near(mesh, touched.new_cells, cells.num_vertices),
                                         held};
  for (std::size_t i = 0; i < history.x.size(); ++i) {
    SafeProjectionReport safe;
    history.x[i] =
        project_safely(problem, history.x[i], project(old_history.x[i], history.x[i], held_vertices), solver, safe);
    if (!safe.converged) logger.debug("safe projection stopped after " + std::to_string(safe.iterations) + " iterations");
  }
}

}  // namespace itr
