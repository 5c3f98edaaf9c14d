// SPDX-License-Identifier: MIT
// Vertices and facets that coincide at rest are told apart by the body that they belong to: random cracks in 2D and 3D.
#include <gtest/gtest.h>

#include <cmath>

#include "cracked_mesh.hpp"
#include "energy/load_points.hpp"
#include "fem/locator.hpp"
#include "geometry/intersection.hpp"
#include "itr/core/error.hpp"
#include "itr/embed/any_simulation.hpp"
#include "itr/energy/load.hpp"
#include "itr/energy/point_forces.hpp"
#include "itr/energy/pressure.hpp"
#include "itr/linear/registry.hpp"
#include "itr/simulation/mesh_change.hpp"
#include "itr/simulation/simulation.hpp"
#include "random_mesh.hpp"
#include "random_tets.hpp"
#include "simulation/step_problem.hpp"

namespace itr {
namespace {

constexpr int kMeshes = 12;  ///< a dimension

template <int Dim>
Mesh<Dim> whole(std::mt19937& random) {
  if constexpr (Dim == 2)
    return random_mesh(6, random);
  else
    return random_tets(3, random, false);
}
template <int Dim>
Mesh<Dim> cracked(std::mt19937& random) {
  return cracked_at_random(whole<Dim>(random), 3, Dim == 2 ? 5 : 12, random);
}
template <int Dim>
class Cracks : public testing::Test {};

template <int Dim>
std::array<Vec<Dim>, Dim + 1> corners_of(const Mesh<Dim>& mesh, CellId c) {
  std::array<Vec<Dim>, Dim + 1> p;
  for (int k = 0; k <= Dim; ++k) p[k] = mesh.rest(mesh.cell(c)[k]);
  return p;
}

/// Values that have nothing to do with each other from one vertex to the next.
VectorX scattered(Eigen::Index size, std::mt19937& random) {
  std::uniform_real_distribution<double> value(-1, 1);
  VectorX values(size);
  for (double& v : values) v = value(random);
  return values;
}

template <int Dim>
SpaceTimeFunction<Dim> as_function(const Mesh<Dim>& mesh, const VectorX& values) {
  return [f = nodal_function<Dim>(std::make_shared<Locator<Dim>>(mesh), values, Dim)](const RestPoint<Dim>& X, double) {
    return Vec<Dim>(f(X));
  };
}

template <int Dim>
void check_values_at_vertices() {
  int doubled = 0;
  for (unsigned seed = 0; seed < kMeshes; ++seed) {
    std::mt19937 random(seed);
    Mesh<Dim> mesh = cracked<Dim>(random);
    doubled += num_doubled(mesh);
    if (seed % 2) mesh.set_curved_edges(mesh.edges());
    const VectorX values = scattered(Dim * mesh.num_nodes(), random);
    StepSetup<Dim> setup;
    Mesh<Dim> held = mesh;
    for (FacetId f = 0; f < held.facet_slots(); ++f) held.set_facet_tag(f, 1);
    std::array<bool, Dim> all;
    all.fill(true);
    setup.dirichlet = {{1, all, as_function<Dim>(mesh, values)}};
    const HeldDofs<Dim> result = held_dofs(setup, held, 0);
    const std::vector<Vec<Dim>>& rest = mesh.rest();
    for (int n = 0; n < mesh.num_nodes(); ++n) {
      if (!result.held[Dim * n]) continue;
      const Vec<Dim> asked = values.segment<Dim>(Dim * n), got = result.target.template segment<Dim>(Dim * n) - rest[n];
      ASSERT_LT((got - asked).norm(), 1e-12) << "seed " << seed << ", node " << n;
    }
  }
  EXPECT_GT(doubled, 10 * kMeshes);
}
TEST(Cracks, VerticesAndNodesAreHeldWhereTheyAreAsked2D) { check_values_at_vertices<2>(); }
TEST(Cracks, VerticesAndNodesAreHeldWhereTheyAreAsked3D) { check_values_at_vertices<3>(); }

/// Tractions, pressures and accelerations by vertex against those of functions that know their facet or cell.
template <int Dim>
void check_loads() {
  for (unsigned seed = 0; seed < kMeshes; ++seed) {
    std::mt19937 random(seed);
    Mesh<Dim> mesh = cracked<Dim>(random);
    for (FacetId f = 0; f < mesh.facet_slots(); ++f) mesh.set_facet_tag(f, 1);
    const VectorX values = scattered(Dim * mesh.node_slots(), random);
    StepSetup<Dim> setup;
    setup.neumann = {{1, as_function<Dim>(mesh, values)}};
    setup.body_acceleration = as_function<Dim>(mesh, values);
    const Loads<Dim> loads = loads_at<Dim>(setup, 0);
    const CellSet<Dim> cells = whole_mesh<Dim>(mesh, {});
    std::map<int, Material> materials;
    for (CellId c = 0; c < mesh.cell_slots(); ++c) materials[mesh.body(c)].density = 1;
    const VectorX forces = LoadEnergy<Dim>(cells, materials, loads, 1).forces();
    // Consistent forces of linear loads: measure / (n (n + 1)) (sum of all + own).
    VectorX expected = VectorX::Zero(forces.size());
    const auto add = [&](const auto& ids, double measure) {
      const auto n = static_cast<double>(ids.size());
      Vec<Dim> sum = Vec<Dim>::Zero();
      for (const int v : ids) sum += values.segment<Dim>(Dim * v);
      for (const int v : ids)
        expected.segment<Dim>(Dim * v) += measure / (n * (n + 1)) * (sum + values.segment<Dim>(Dim * v));
    };
    for (CellId c = 0; c < mesh.cell_slots(); ++c) add(mesh.cell(c), mesh.volume(c));
    for (FacetId f = 0; f < mesh.facet_slots(); ++f) {
      std::array<Vec<Dim>, Dim> p;
      for (int k = 0; k < Dim; ++k) p[k] = mesh.rest(mesh.facet(f)[k]);
      add(mesh.facet(f), facet_area(p));
    }
    ASSERT_LT((forces - expected).norm(), 1e-11 * expected.norm()) << "seed " << seed;
  }
}
TEST(Cracks, LoadsActOnTheirFaces2D) { check_loads<2>(); }
TEST(Cracks, LoadsActOnTheirFaces3D) { check_loads<3>(); }

template <int Dim>
std::optional<Edit<Dim>> any_edit(const Mesh<Dim>& mesh, std::mt19937& random) {
  if constexpr (Dim == 2)
    return random_edit(mesh, random);
  else
    return propose_at_random(mesh, Strata<3>(mesh), static_cast<Operation>(random() % 5), random).edit;
}

template <int Dim>
MeshRenumbering changed_at_random(Mesh<Dim>& mesh, int edits, std::mt19937& random) {
  for (int i = 0; i < edits;)
    if (const auto edit = any_edit(mesh, random)) mesh.apply(*edit), ++i;
  auto [vertex, cell, facet] = mesh.compact();
  return {std::move(vertex), std::move(cell), std::move(facet)};
}

/// Whether cell c of `a` overlaps a cell at v of `b`.
template <int Dim>
bool share_volume(const Mesh<Dim>& a, CellId c, const Mesh<Dim>& b, VertexId v) {
  OverlapIntegrals<Dim> integrals;
  return std::ranges::any_of(b.cells_of(v), [&](CellId d) {
    return integrate_overlap<Dim>(Simplex<Dim>(corners_of(a, c)), Simplex<Dim>(corners_of(b, d)), integrals) &&
           integrals.volume() > 1e-9 * std::min(a.volume(c), b.volume(d));
  });
}

template <int Dim>
void check_interpolation() {
  int new_ones = 0;
  for (unsigned seed = 0; seed < kMeshes; ++seed) {
    std::mt19937 random(seed);
    const Mesh<Dim> before = cracked<Dim>(random);
    Mesh<Dim> mesh = before;
    const MeshRenumbering renumbering = changed_at_random(mesh, 60, random);
    const MeshChange<Dim> change = describe_change(before, mesh, renumbering);
    for (VertexId v = 0; v < mesh.node_slots(); ++v) {
      if (!mesh.is_boundary(v)) continue;
      std::vector<int> parents;
      for (typename Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(change.interpolation, v); it; ++it)
        parents.push_back(static_cast<int>(it.col()));
      if (parents.size() > 1) ++new_ones;
      const auto around = before.cells_of(parents[0]);
      const bool is_of_body = std::ranges::any_of(around, [&](CellId c) {
        const auto& cell = before.cell(c);
        return std::ranges::all_of(parents, [&](int p) { return std::ranges::count(cell, p); }) &&
               share_volume(before, c, mesh, v);
      });
      ASSERT_TRUE(is_of_body) << "seed " << seed << ", vertex " << v << " at " << mesh.rest(v).transpose();
    }
    for (FacetId f = 0; f < mesh.facet_slots(); ++f) {
      const FacetId parent = change.facet_parent[f];
      ASSERT_NE(parent, kNone);
      const auto normal = [](const Mesh<Dim>& of, FacetId g) {
        std::array<Vec<Dim>, Dim> p;
        for (int k = 0; k < Dim; ++k) p[k] = of.rest(of.facet(g)[k]);
        return inward_normal(p).normalized();
      };
      ASSERT_GT(normal(mesh, f).dot(normal(before, parent)), 0.9) << "seed " << seed << ", facet " << f;
    }
  }
  EXPECT_GT(new_ones, 5 * kMeshes);
}
TEST(Cracks, NewVerticesAndFacetsComeFromTheirBody2D) { check_interpolation<2>(); }
TEST(Cracks, NewVerticesAndFacetsComeFromTheirBody3D) { check_interpolation<3>(); }

/// Forces stay where they are when the mesh changes: on vertices that stay, they are what was asked.
template <int Dim>
void check_forces() {
  for (unsigned seed = 0; seed < kMeshes; ++seed) {
    std::mt19937 random(seed);
    const Mesh<Dim> before = cracked<Dim>(random);
    Mesh<Dim> mesh = before;
    const MeshRenumbering renumbering = changed_at_random(mesh, 60, random);
    for (VertexId v = 0; v < before.node_slots(); ++v) {
      if (!before.is_boundary(v)) continue;
      VectorX asked = VectorX::Zero(Dim * before.node_slots());
      asked.segment<Dim>(Dim * v) = Vec<Dim>::Ones();
      const CellSet<Dim> cells = whole_mesh<Dim>(mesh, {});
      const auto term = point_forces<Dim>(before, asked)(cells, 0, 1);
      ASSERT_TRUE(term) << "seed " << seed << ", vertex " << v;
      VectorX gradient = VectorX::Zero(Dim * mesh.node_slots());
      Workspace workspace;
      term->add_gradient(gradient, gradient, workspace);
      double sum = 0;
      Vec<Dim> moment = Vec<Dim>::Zero();
      bool has_any = false;
      for (VertexId w = 0; w < mesh.node_slots(); ++w) {
        const double share = -gradient[Dim * w];
        if (share == 0) continue;
        sum += share;
        moment += share * mesh.rest(w);
        has_any =
            has_any || std::ranges::any_of(before.cells_of(v), [&](CellId c) { return share_volume(before, c, mesh, w); });
      }
      ASSERT_NEAR(sum, 1, 1e-12);
      ASSERT_LT((moment - before.rest(v)).norm(), 1e-9);
      ASSERT_TRUE(has_any) << "seed " << seed << ", vertex " << v;
      if (const VertexId now = renumbering.vertex[v]; now != kNone && mesh.rest(now) == before.rest(v)) {
        ASSERT_NEAR(-gradient[Dim * now], 1, 1e-12) << "seed " << seed << ", vertex " << v;
      }
    }
  }
}
TEST(Cracks, ForcesStayOnTheirBody2D) { check_forces<2>(); }
TEST(Cracks, ForcesStayOnTheirBody3D) { check_forces<3>(); }

TEST(Cracks, NeedAGapWhereFacesMayTouch) {
  std::mt19937 random(2);
  for (int k = 0; k < kMeshes; ++k) {
    itr::Setup<2> setup;
    for (const int body : {1, 2, 3}) setup.materials[body] = {.youngs_modulus = 1e5, .poisson_ratio = 0.3, .density = 1000};
    setup.mesh = cracked<2>(random);
    setup.contact.enabled = true;
    try {
      linear::Registry registry;
      const Simulation<2> simulation(setup, registry);
      ADD_FAILURE() << "touching faces are taken for contact";
    } catch (const InputError& error) {
      EXPECT_NE(error.parts().expected.find("a gap between the faces of a crack"), std::string::npos) << error.what();
    }
  }
}

/// Two squares of one body id that lie on each other: parts that share no vertex.
TEST(Cracks, PartsThatOverlapAreToldApart) {
  std::mt19937 random(1);
  const Mesh<2> one = random_mesh(3, random);
  std::vector<Vec<2>> rest;
  std::vector<Mesh<2>::Cell> cells;
  for (int copy = 0; copy < 2; ++copy) {
    const int first = static_cast<int>(rest.size());
    for (VertexId v = 0; v < one.node_slots(); ++v) rest.push_back(one.rest(v));
    for (CellId c = 0; c < one.cell_slots(); ++c) {
      cells.push_back(one.cell(c));
      for (int& v : cells.back()) v += first;
    }
  }
  const std::vector<int> bodies(cells.size(), 1);
  const Mesh<2> before(rest, cells, bodies);
  const VectorX values = scattered(2 * before.node_slots(), random);
  const auto f = as_function<2>(before, values);
  for (VertexId v = 0; v < before.node_slots(); ++v) EXPECT_EQ(f(before.point(v), 0), values.segment<2>(2 * v));
  Mesh<2> mesh = before;
  const MeshRenumbering renumbering = changed_at_random(mesh, 40, random);
  const MeshChange<2> change = describe_change(before, mesh, renumbering);
  for (VertexId v = 0; v < mesh.node_slots(); ++v)
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(change.interpolation, v); it; ++it)
      EXPECT_EQ(before.part_of_vertex(static_cast<int>(it.col())), mesh.part_of_vertex(v));
  for (FacetId g = 0; g < mesh.facet_slots(); ++g)
    EXPECT_EQ(before.part_of_vertex(before.facet(change.facet_parent[g])[0]), mesh.part_of_vertex(mesh.facet(g)[0]));
}

}  // namespace
}  // namespace itr
