// SPDX-License-Identifier: MIT
// Time of one item of each kernel: element, contact pair, broad phase, collision query, assembly. They measure, and assert
// nothing. Arguments are numbers of threads where a kernel runs in parallel.
#include <benchmark/benchmark.h>

#include <Eigen/LU>

#include <algorithm>
#include <random>

#include "core/parallel.hpp"
#include "energy/contact/contact.hpp"
#include "energy/elastic/elastic.hpp"
#include "energy/inertia.hpp"
#include "geometry/ccd.hpp"
#include "geometry/intersection.hpp"
#include "itr/mesh.hpp"
#include "newton/newton.hpp"
#include "projection/transfer_patch.hpp"

namespace {

using namespace itr;

const std::map<int, Material> kMaterials = {{1, {.youngs_modulus = 1e5, .poisson_ratio = 0.4, .density = 1000}}};

/// A cube of n^3 cells of six tetrahedra each.
Mesh<3> make_cube(int n) {
  std::vector<Vec<3>> rest;
  std::vector<std::array<int, 4>> cells;
  const auto id = [n](int i, int j, int k) { return (k * (n + 1) + j) * (n + 1) + i; };
  for (int k = 0; k <= n; ++k)
    for (int j = 0; j <= n; ++j)
      for (int i = 0; i <= n; ++i) rest.emplace_back(Vec<3>(i, j, k) / n);
  constexpr int kOrders[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
  for (int k = 0; k < n; ++k)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i)
        for (const auto& order : kOrders) {
          std::array<int, 3> at{i, j, k};
          std::array<int, 4> cell{id(i, j, k)};
          for (int step = 0; step < 3; ++step) {
            ++at[order[step]];
            cell[step + 1] = id(at[0], at[1], at[2]);
          }
          Mat<3> edges;
          for (int c = 0; c < 3; ++c) edges.col(c) = rest[cell[c + 1]] - rest[cell[0]];
          if (edges.determinant() < 0) std::swap(cell[2], cell[3]);
          cells.push_back(cell);
        }
  return {rest, cells, std::vector<int>(cells.size(), 1)};
}

/// A compressed and perturbed cube.
struct Cube {
  Mesh<3> mesh;
  CellSet<3> cells;
  VectorX x;
  explicit Cube(int n) : mesh(make_cube(n)), cells(whole_mesh(mesh, {})), x(3 * cells.num_vertices) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> noise(-0.05 / n, 0.05 / n);
    for (int v = 0; v < cells.num_vertices; ++v)
      for (int c = 0; c < 3; ++c) x[3 * v + c] = (c == 0 ? 0.7 : 1.1) * cells.rest[v][c] + noise(random);
  }
};

/// Two rough sheets of n x n squares each, nearer than dhat = 0.02.
struct Sheets {
  CollisionSurface surface;
  VectorX x;
  ContactOptions options{.enabled = true, .dhat = 0.02, .convergent = true};
  explicit Sheets(int n) {
    std::mt19937 random(2);
    std::uniform_real_distribution<double> noise(-0.002, 0.002);
    std::vector<Vec<3>> rest;
    std::vector<std::array<int, 3>> triangles;
    for (int sheet = 0; sheet < 2; ++sheet)
      for (int i = 0; i <= n; ++i)
        for (int j = 0; j <= n; ++j) {
          const int v = static_cast<int>(rest.size());
          const double c = sheet ? 0.8 : 1, s = sheet ? 0.6 : 0, a = 0.1 * i, b = 0.1 * j;
          rest.emplace_back(c * a - s * b, s * a + c * b, 0.012 * sheet);
          if (i == n || j == n) continue;
          triangles.push_back({v, v + n + 1, v + n + 2});
          triangles.push_back({v, v + n + 2, v + 1});
        }
    x.resize(3 * static_cast<Eigen::Index>(rest.size()));
    for (std::size_t v = 0; v < rest.size(); ++v)
      x.segment<3>(3 * v) = rest[v] + Vec<3>(noise(random), noise(random), noise(random));
    surface = make_collision_surface<3>({}, triangles, {}, rest, std::vector<char>(rest.size(), 1));
  }
};

/// Takes blocks and forgets them: the time of the kernel without the matrix.
struct NoUnknowns {
  DofMap dofs;
  MatrixX none;
  HessianTarget target;
  HessianSink sink;
  explicit NoUnknowns(Eigen::Index n) : dofs{std::vector<int>(n, kNone), 0}, target(dofs, none), sink(target) {}
};

// Their names are those of the report: NOLINTBEGIN(readability-identifier-naming)

void ElementEnergy(benchmark::State& state) {
  const Cube cube(12);
  const ElasticEnergy<3> elastic(cube.cells, kMaterials, 1);
  const ThreadLimit limit(static_cast<int>(state.range(0)));
  Workspace workspace;
  for (auto _ : state) benchmark::DoNotOptimize(elastic.value(cube.x, workspace));
  state.SetItemsProcessed(state.iterations() * static_cast<long>(cube.cells.elements.size()));
}

void ElementGradient(benchmark::State& state) {
  const Cube cube(12);
  const ElasticEnergy<3> elastic(cube.cells, kMaterials, 1);
  const ThreadLimit limit(static_cast<int>(state.range(0)));
  Workspace workspace;
  VectorX gradient = VectorX::Zero(cube.x.size());
  for (auto _ : state) elastic.add_gradient(cube.x, gradient, workspace);
  state.SetItemsProcessed(state.iterations() * static_cast<long>(cube.cells.elements.size()));
}

void ElementHessian(benchmark::State& state) {
  const Cube cube(12);
  const ElasticEnergy<3> elastic(cube.cells, kMaterials, 1);
  const ThreadLimit limit(static_cast<int>(state.range(1)));
  Workspace workspace;
  NoUnknowns nowhere(cube.x.size());
  for (auto _ : state)
    elastic.add_hessian(cube.x, state.range(0) ? PsdProjection::clamp : PsdProjection::none, nowhere.sink, workspace);
  state.SetItemsProcessed(state.iterations() * static_cast<long>(cube.cells.elements.size()));
}

void Assembly(benchmark::State& state) {
  const Cube cube(12);
  EnergySum sum;
  sum.add(std::make_shared<ElasticEnergy<3>>(cube.cells, kMaterials, 1));
  sum.add(std::make_shared<InertiaEnergy<3>>(cube.cells, kMaterials, MassKind::consistent, cube.x));
  const DofMap dofs = DofMap::from_held(std::vector<char>(cube.x.size(), 0));
  SparseAssembler assembler;
  assembler.reset(dofs, 3, element_stencils(cube.cells));
  const ThreadLimit limit(static_cast<int>(state.range(0)));
  Workspace workspace;
  for (auto _ : state) {
    assembler.begin();
    HessianTarget target(dofs, assembler);
    HessianSink sink(target);
    sum.add_hessian(cube.x, PsdProjection::clamp, sink, workspace);
    assembler.finish();
  }
  state.SetItemsProcessed(state.iterations() * static_cast<long>(cube.cells.elements.size()));
}

void PairEnergy(benchmark::State& state) {
  const Sheets sheets(20);
  const ContactEnergy<3> contact(sheets.surface, sheets.options, 1, 1);
  const ThreadLimit limit(1);
  Workspace workspace;
  const auto count = static_cast<long>(contact.active(sheets.x, workspace).size());
  for (auto _ : state) benchmark::DoNotOptimize(contact.value(sheets.x, workspace));
  state.SetItemsProcessed(state.iterations() * count);
}

void PairHessian(benchmark::State& state) {
  const Sheets sheets(20);
  const ContactEnergy<3> contact(sheets.surface, sheets.options, 1, 1);
  const ThreadLimit limit(static_cast<int>(state.range(1)));
  Workspace workspace;
  const auto count = static_cast<long>(contact.active(sheets.x, workspace).size());
  NoUnknowns nowhere(sheets.x.size());
  for (auto _ : state)
    contact.add_hessian(sheets.x, state.range(0) ? PsdProjection::clamp : PsdProjection::none, nowhere.sink, workspace);
  state.SetItemsProcessed(state.iterations() * count);
}

/// From nothing: boxes, trees, candidates. Items are vertices and edges.
void BroadPhase(benchmark::State& state) {
  const Sheets sheets(60);
  const ContactEnergy<3> contact(sheets.surface, sheets.options, 1, 1);
  const ThreadLimit limit(static_cast<int>(state.range(0)));
  const VectorX still = VectorX::Zero(sheets.x.size());
  for (auto _ : state) {
    Workspace workspace;
    contact.predict_motion(sheets.x, still, workspace);
  }
  state.SetItemsProcessed(state.iterations() *
                          static_cast<long>(sheets.surface.vertices.size() + sheets.surface.edges.size()));
}

/// Active pairs of new positions whose candidates are known. Items are active pairs.
void ActiveSet(benchmark::State& state) {
  const Sheets sheets(60);
  const ContactEnergy<3> contact(sheets.surface, sheets.options, 1, 1);
  const ThreadLimit limit(static_cast<int>(state.range(0)));
  Workspace workspace;
  const auto count = static_cast<long>(contact.active(sheets.x, workspace).size());
  VectorX x = sheets.x;
  for (auto _ : state) {
    x[0] = x[0] == sheets.x[0] ? sheets.x[0] + 1e-9 : sheets.x[0];
    benchmark::DoNotOptimize(contact.active(x, workspace).size());
  }
  state.SetItemsProcessed(state.iterations() * count);
}

/// A motion that brings many pairs near each other; candidates known. Items are surface primitives.
void StepLimit(benchmark::State& state) {
  const Sheets sheets(60);
  const ContactEnergy<3> contact(sheets.surface, sheets.options, 1, 1);
  const ThreadLimit limit(static_cast<int>(state.range(0)));
  std::mt19937 random(3);
  std::uniform_real_distribution<double> noise(-0.004, 0.004);
  const VectorX dx = VectorX::NullaryExpr(sheets.x.size(), [&] { return noise(random); });
  Workspace workspace;
  for (auto _ : state) benchmark::DoNotOptimize(contact.max_step(sheets.x, dx, workspace));
  state.SetItemsProcessed(state.iterations() *
                          static_cast<long>(sheets.surface.vertices.size() + sheets.surface.edges.size()));
}

template <bool kEdges>
void CcdQuery(benchmark::State& state) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> unit(-1, 1);
  constexpr int kQueries = 1000;
  std::vector<std::array<Vec<3>, 8>> queries(kQueries);
  for (auto& query : queries)
    for (auto& p : query) p = Vec<3>::NullaryExpr([&] { return unit(random); });
  for (auto _ : state)
    for (const auto& [a, b, c, d, e, f, g, h] : queries)
      benchmark::DoNotOptimize(kEdges ? edge_edge_ccd(a, b, c, d, e, f, g, h) : point_triangle_ccd(a, b, c, d, e, f, g, h));
  state.SetItemsProcessed(state.iterations() * kQueries);
}

/// Integrals over the intersections of one tetrahedron with those around it, a pair each.
void OverlapPair(benchmark::State& state) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> number(0, 1);
  std::vector<Simplex<3>> simplices;
  while (simplices.size() < 64) {
    std::array<Vec<3>, 4> p;
    for (auto& q : p) q = Vec<3>(number(random), number(random), number(random));
    if (simplex_volume<3>(p) > 0.02) simplices.emplace_back(p);
  }
  OverlapIntegrals<3> overlap;
  for (auto _ : state)
    for (std::size_t i = 1; i < simplices.size(); ++i)
      benchmark::DoNotOptimize(integrate_overlap(simplices[i - 1], simplices[i], overlap));
  state.SetItemsProcessed(state.iterations() * static_cast<long>(simplices.size() - 1));
}

/// An interior vertex of a cube of 6 n^3 tetrahedra is collapsed onto its neighbour; two vector fields are projected.
void ProjectCoarsening(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const Mesh<3> before = make_cube(n);
  Mesh<3> mesh = before;
  const int gone = (n / 2 * (n + 1) + n / 2) * (n + 1) + n / 2, kept = gone + 1;
  Edit<3> edit{.kind = Edit<3>::Kind::collapse, .edge = {gone, kept}};
  edit.removed_cells.assign(mesh.cells_of(gone).begin(), mesh.cells_of(gone).end());
  edit.removed_vertex = gone;
  for (const CellId c : edit.removed_cells) {
    auto cell = mesh.cell(c);
    if (std::find(cell.begin(), cell.end(), kept) != cell.end()) continue;
    std::replace(cell.begin(), cell.end(), gone, kept);
    edit.inserted_cells.push_back({cell, 1});
  }
  mesh.apply(edit);
  TouchedCells touched{edit.removed_cells, {}};
  for (int c = before.cell_slots(); c < mesh.cell_slots(); ++c) touched.new_cells.push_back(c);
  const VectorX field = VectorX::Random(3 * before.node_slots());
  for (auto _ : state) {
    const TransferPatch<3> patch = make_transfer_patch(before, mesh, touched, kMaterials, 3);
    MatrixX u_old(patch.old_cells.vertices.size(), 6), u_bar(patch.new_cells.vertices.size(), 6);
    u_old << patch.old_cells.gather(field), patch.old_cells.gather(field);
    u_bar << patch.new_cells.gather(field), patch.new_cells.gather(field);
    std::vector<char> fixed;
    for (const char at_rim : patch.at_rim) fixed.insert(fixed.end(), 6, at_rim);
    TransferReport report;
    benchmark::DoNotOptimize(
        project_l2<3>(patch.old_cells.view(), patch.new_cells.view(), patch.touched, u_old, u_bar, fixed, report));
  }
  state.counters["tetrahedra"] = static_cast<double>(before.num_cells());
}

BENCHMARK(ElementEnergy)->Arg(1)->Arg(2)->UseRealTime();
BENCHMARK(ElementGradient)->Arg(1)->Arg(2)->UseRealTime();
BENCHMARK(ElementHessian)->ArgNames({"psd", "threads"})->Args({0, 1})->Args({1, 1})->Args({1, 2})->UseRealTime();
BENCHMARK(Assembly)->Arg(1)->Arg(2)->UseRealTime();
BENCHMARK(PairEnergy)->UseRealTime();
BENCHMARK(PairHessian)->ArgNames({"psd", "threads"})->Args({0, 1})->Args({1, 1})->Args({1, 2})->UseRealTime();
BENCHMARK(BroadPhase)->Arg(1)->Arg(2)->UseRealTime();
BENCHMARK(ActiveSet)->Arg(1)->Arg(2)->UseRealTime();
BENCHMARK(StepLimit)->Arg(1)->Arg(2)->UseRealTime();
BENCHMARK(CcdQuery<false>)->UseRealTime();
BENCHMARK(CcdQuery<true>)->UseRealTime();
BENCHMARK(OverlapPair)->UseRealTime();
BENCHMARK(ProjectCoarsening)->Arg(12)->Arg(25)->Arg(55)->Unit(benchmark::kMicrosecond);

// NOLINTEND(readability-identifier-naming)

}  // namespace

BENCHMARK_MAIN();
