// SPDX-License-Identifier: MIT
// Shows the inside of the library to the verification suite: matrices and forces of a scene at a given state, and fields
// projected between two scenes' meshes, as Matrix Market files. Uses public headers only.
//
//   itr_probe matrices SCENE DISPLACEMENT.mtx DIR   writes mass.mtx, tangent.mtx, force.mtx, load.mtx (t = 1), energy.mtx
//   itr_probe project OLD_SCENE NEW_SCENE FIELD.mtx RESULT.mtx
//
// Fields are dense arrays with a row a vertex; matrices act on interleaved fields.
#include <cstdio>
#include <fstream>
#include <limits>
#include <map>
#include <string>

#include "energy/elastic/elastic.hpp"
#include "energy/inertia.hpp"
#include "energy/load.hpp"
#include "itr/core.hpp"
#include "itr/scene.hpp"
#include "itr/transfer.hpp"
#include "simulation/step_problem.hpp"

namespace {

using namespace itr;

[[noreturn]] void fail(const std::string& message) {
  std::fprintf(stderr, "itr_probe: %s\n", message.c_str());
  std::exit(2);
}

std::ofstream create(const std::string& path) {
  std::ofstream file(path);
  if (!file) fail("cannot write " + path);
  file.precision(std::numeric_limits<double>::max_digits10);
  return file;
}

MatrixX read_array(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line) && line.starts_with("%")) {
  }
  int rows = 0, columns = 0;
  if (std::sscanf(line.c_str(), "%d %d", &rows, &columns) != 2) fail(path + ": no sizes of an array");
  MatrixX array(rows, columns);
  for (double& value : array.reshaped())
    if (!(file >> value)) fail(path + ": fewer numbers than " + std::to_string(array.size()));
  return array;
}

void write_array(const std::string& path, const MatrixX& array) {
  std::ofstream file = create(path);
  file << "%%MatrixMarket matrix array real general\n" << array.rows() << " " << array.cols() << "\n";
  for (const double value : array.reshaped()) file << value << "\n";
}

void write_symmetric(const std::string& path, const SparseAssembler& assembler) {
  const auto& pattern = assembler.pattern();
  std::ofstream file = create(path);
  file << "%%MatrixMarket matrix coordinate real symmetric\n"
       << pattern.order << " " << pattern.order << " " << pattern.nonzeros() << "\n";
  for (int j = 0; j < pattern.order; ++j)
    for (int k = pattern.column_starts[j]; k < pattern.column_starts[j + 1]; ++k)
      file << pattern.row_indices[k] + 1 << " " << j + 1 << " " << assembler.values()[k] << "\n";
}

/// The exact Hessian of an energy over all dofs of the cells.
template <int Dim>
SparseAssembler hessian(const Energy& energy, const CellSet<Dim>& cells, const VectorX& x, Workspace& workspace) {
  const DofMap dofs = DofMap::from_held(std::vector<char>(Dim * cells.num_vertices, 0));
  SparseAssembler assembler;
  assembler.reset(dofs, Dim, element_stencils(cells));
  assembler.begin();
  HessianTarget target(dofs, assembler);
  HessianSink sink(target);
  energy.add_hessian(x, PsdProjection::none, sink, workspace);
  assembler.finish();
  return assembler;
}

template <int Dim>
void write_matrices(const Setup<Dim>& setup, const MatrixX& displacement, const std::string& folder) {
  Mesh<Dim> mesh = setup.mesh;
  mesh.set_curved_edges(edges_of_order_2(mesh, setup.order));
  const CellSet<Dim> cells = whole_mesh<Dim>(mesh, {});
  if (displacement.rows() != cells.num_vertices || displacement.cols() != Dim) fail("the displacement has another shape");
  VectorX x(Dim * cells.num_vertices);
  for (int v = 0; v < cells.num_vertices; ++v) x.segment<Dim>(Dim * v) = cells.rest[v] + displacement.row(v).transpose();

  Workspace workspace;
  const MassKind kind = setup.lump_mass ? MassKind::lumped : MassKind::consistent;
  const InertiaEnergy<Dim> inertia(cells, setup.materials, kind, x);
  const ElasticEnergy<Dim> elastic(cells, setup.materials, 1, setup.quadrature_degree);
  const LoadEnergy<Dim> loads(cells, setup.materials, loads_at(setup, 1), 1);
  VectorX force = VectorX::Zero(x.size());
  elastic.add_gradient(x, force, workspace);
  write_symmetric(folder + "/mass.mtx", hessian<Dim>(inertia, cells, x, workspace));
  write_symmetric(folder + "/tangent.mtx", hessian<Dim>(elastic, cells, x, workspace));
  write_array(folder + "/force.mtx", force);
  write_array(folder + "/load.mtx", loads.forces());
  write_array(folder + "/energy.mtx", MatrixX::Constant(1, 1, elastic.value(x, workspace)));
}

/// Mesh and nodes that a TransferMesh refers to.
template <int Dim>
struct Body {
  std::vector<Vec<Dim>> rest;
  std::vector<std::array<int, Dim + 1>> cells;
  std::vector<double> density;

  explicit Body(const Setup<Dim>& setup) {
    const CellSet<Dim> set = whole_mesh<Dim>(setup.mesh, {});
    rest = set.rest;
    for (const auto& element : set.elements) cells.push_back(element.vertices);
    for (const auto& element : set.elements)
      density.push_back(mass_density<Dim>(setup.materials.at(element.body), rest_barycenter(set, element)));
  }
  TransferMesh<Dim> view() const { return {rest, cells, density}; }
};

using Coordinates = std::vector<double>;

template <int Dim>
Coordinates coordinates(const Vec<Dim>& p) {
  return {p.data(), p.data() + Dim};
}

/// A cell by the rest positions of its vertices, whatever their order.
template <int Dim>
std::vector<Coordinates> cell_key(const Body<Dim>& body, int cell) {
  std::vector<Coordinates> key;
  for (const int v : body.cells[cell]) key.push_back(coordinates<Dim>(body.rest[v]));
  std::sort(key.begin(), key.end());
  return key;
}

template <int Dim>
void write_projection(const Setup<Dim>& from, const Setup<Dim>& to, const MatrixX& field, const std::string& path) {
  const Body<Dim> old_body(from), new_body(to);
  if (field.rows() != static_cast<int>(old_body.rest.size())) fail("the field has another number of rows");
  std::map<std::vector<Coordinates>, int> shared;
  for (std::size_t c = 0; c < old_body.cells.size(); ++c) shared[cell_key(old_body, c)] = static_cast<int>(c);
  TouchedCells touched;
  for (std::size_t c = 0; c < new_body.cells.size(); ++c)
    if (!shared.erase(cell_key(new_body, c))) touched.new_cells.push_back(static_cast<int>(c));
  for (const auto& [key, cell] : shared) touched.old_cells.push_back(cell);
  std::sort(touched.old_cells.begin(), touched.old_cells.end());

  std::map<Coordinates, int> old_vertex;
  for (std::size_t v = 0; v < old_body.rest.size(); ++v)
    old_vertex[coordinates<Dim>(old_body.rest[v])] = static_cast<int>(v);
  MatrixX start = MatrixX::Zero(new_body.rest.size(), field.cols());
  for (std::size_t v = 0; v < new_body.rest.size(); ++v)
    if (const auto found = old_vertex.find(coordinates<Dim>(new_body.rest[v])); found != old_vertex.end())
      start.row(v) = field.row(found->second);
  TransferReport report;
  write_array(path, project_l2<Dim>(old_body.view(), new_body.view(), touched, field, start, {}, report));
  std::printf("touched cells %zu -> %zu, %d iterations, residual %.3g\n", touched.old_cells.size(), touched.new_cells.size(),
              report.iterations, report.relative_residual);
}

template <int Dim>
void project(const Setup<Dim>& from, const scene::Scene& to, const MatrixX& field, const std::string& path) {
  const auto* setup = std::get_if<Setup<Dim>>(&to.setup);
  if (!setup) fail("the two scenes have different dimensions");
  write_projection(from, *setup, field, path);
}

}  // namespace

int main(int argc, char** argv) try {
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() == 4 && words[0] == "matrices") {
    const scene::Scene scene = scene::read(words[1]);
    std::visit([&](const auto& setup) { write_matrices(setup, read_array(words[2]), words[3]); }, scene.setup);
  } else if (words.size() == 5 && words[0] == "project") {
    const scene::Scene from = scene::read(words[1]), to = scene::read(words[2]);
    std::visit([&](const auto& setup) { project(setup, to, read_array(words[3]), words[4]); }, from.setup);
  } else {
    fail("matrices SCENE DISPLACEMENT.mtx DIR, or project OLD_SCENE NEW_SCENE FIELD.mtx RESULT.mtx");
  }
  return 0;
} catch (const std::exception& error) {
  fail(error.what());
}
