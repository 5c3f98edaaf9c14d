// SPDX-License-Identifier: MIT
// PolyFEM's AMIPS without a rest pose: its law, the corners that it depends on, and the norms of PolyFEM's own scene.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "advance.hpp"
#include "energy/elastic/law_sum.hpp"
#include "energy/polyfem/ideal_cell.hpp"
#include "itr/simulation.hpp"
#include "itr/solver.hpp"
#include "law_derivatives.hpp"
#include "scene_folder.hpp"
#include "simulation/state.hpp"

namespace itr {
namespace {

Material amips(double weight, int dim) {
  LawSum sum;
  sum.terms.push_back({&ideal_cell_law(), {{weight}}});
  sum.dimension = dim;
  return material_of(sum, dim);
}

/// Edges of the ideal cell from its first corner.
template <int Dim>
Mat<Dim> ideal_cell() {
  const double height = std::sqrt(3.0) / 2;
  if constexpr (Dim == 2) {
    return (Mat<2>() << 1, 0.5, 0, height).finished();
  } else {
    return (Mat<3>() << 1, 0.5, 0.5, 0, height, 0.5 / std::sqrt(3.0), 0, 0, height).finished();
  }
}

template <int Dim>
void expect_law(unsigned seed) {
  std::mt19937 random(seed);
  const Material material = amips(3, Dim);
  EXPECT_TRUE(is_of_ideal_cell(material));
  const Mat<Dim> edges = random_upright<Dim>(random, 0.3), F = random_upright<Dim>(random, 0.2, 0.3);
  ElasticModuli moduli = elastic_moduli<Dim>(material, Vec<Dim>(Vec<Dim>::Zero()));
  set_ideal_cell<Dim>(edges.inverse(), moduli);
  expect_law_derivatives<Dim>(F, moduli);
  const Mat<Dim> from_ideal = F * edges * ideal_cell<Dim>().inverse();
  const double J = from_ideal.determinant();
  EXPECT_NEAR(elastic_density<Dim>(F, moduli), 3 * (from_ideal.squaredNorm() * std::pow(J, -1 - 2.0 / Dim) - Dim), 1e-11);
  Mat<Dim> turned_over = F;
  turned_over.col(0) *= -1;
  EXPECT_TRUE(std::isinf(elastic_density<Dim>(turned_over, moduli)));
  set_ideal_cell<Dim>(Mat<Dim>(ideal_cell<Dim>().inverse()), moduli);
  EXPECT_NEAR(elastic_density<Dim>(Mat<Dim>(Mat<Dim>::Identity()), moduli), 0, 1e-13);
}

TEST(IdealCell, DensityIsThatOfItsFormWithItsDerivatives) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    expect_law<2>(seed);
    expect_law<3>(seed);
  }
}

/// The last corner stands out in space, as the ideal tetrahedron is higher than a regular one.
TEST(IdealCell, LawDependsOnTheLastCornerAlone) {
  const Material material = amips(1, 3);
  const auto density = [&](std::array<int, 4> order) {
    const std::array<Vec<3>, 4> corners = {Vec<3>(0, 0, 0), Vec<3>(1, 0.1, 0), Vec<3>(0.2, 0.9, 0.1), Vec<3>(0.3, 0.2, 0.7)};
    Mat<3> edges;
    for (int k = 0; k < 3; ++k) edges.col(k) = corners[order[k + 1]] - corners[order[0]];
    ElasticModuli moduli = elastic_moduli<3>(material, Vec<3>(Vec<3>::Zero()));
    set_ideal_cell<3>(edges.inverse(), moduli);
    return elastic_density<3>(Mat<3>(Mat<3>::Identity()), moduli);
  };
  EXPECT_NEAR(density({1, 2, 0, 3}), density({0, 1, 2, 3}), 1e-12);
  EXPECT_GT(std::abs(density({1, 0, 3, 2}) - density({0, 1, 2, 3})), 1e-2);
}

}  // namespace

namespace scene {
namespace {

class IdealCells : public SceneTest {
 protected:
  /// A cube of six tetrahedra, with all of its boundary held.
  json cube(int refinements) {
    write("cube.msh",
          "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n1 -0.5 -0.5 -0.5\n2 0.5 -0.5 -0.5\n3 0.5 -0.5 0.5\n"
          "4 -0.5 -0.5 0.5\n5 -0.5 0.5 -0.5\n6 0.5 0.5 -0.5\n7 0.5 0.5 0.5\n8 -0.5 0.5 0.5\n$EndNodes\n$Elements\n6\n"
          "1 4 2 1 1 1 5 7 6\n2 4 2 1 1 4 7 3 1\n3 4 2 1 1 1 5 8 7\n4 4 2 1 1 4 7 1 8\n5 4 2 1 1 3 1 7 2\n"
          "6 4 2 1 1 7 1 6 2\n$EndElements\n");
    return {{"defaults", "polyfem"},
            {"geometry",
             {{"mesh", "cube.msh"},
              {"n_refs", refinements},
              {"surface_selection", 1},
              {"advanced", {{"normalize_mesh", true}}}}},
            {"materials", {{"type", "AMIPS"}, {"use_rest_pose", false}}},
            {"boundary_conditions", {{"dirichlet_boundary", {{"id", 1}, {"value", {0, 0, 0}}}}}}};
  }
};

/// PolyFEM's norms of its scene standard/amips.json, which depend on how it orders the corners of refined cells.
TEST_F(IdealCells, CubeHasTheDisplacementsThatPolyfemHas) {
  const itr::Setup<3> setup = std::get<itr::Setup<3>>(read_scene(cube(2)).setup);
  linear::Registry registry;
  Simulation<3> simulation(setup, registry);
  advance(simulation);
  const Mesh<3>& mesh = simulation.mesh();
  const VectorX& x = simulation.state().history.x[0];
  double l2 = 0, h1_semi = 0;
  for (const CellId c : mesh.live_cells()) {
    Vec<3> mean = Vec<3>::Zero();
    for (const int v : mesh.cell(c)) mean += (x.segment<3>(3 * v) - mesh.rest(v)) / 4;
    const Mat<3> F = deformation_gradient<3>(element_of(mesh, c), x);
    l2 += mesh.volume(c) * mean.squaredNorm();
    h1_semi += mesh.volume(c) * (F - Mat<3>::Identity()).squaredNorm();
  }
  EXPECT_NEAR(std::sqrt(l2), 0.029900112509256453, 1e-5 * 0.03);
  EXPECT_NEAR(std::sqrt(h1_semi), 0.6410180791983018, 1e-5 * 0.64);
}

/// Without refinement PolyFEM's last corner is the file's first.
TEST_F(IdealCells, LastCornerIsTheFirstOfTheFile) {
  const json scene = cube(0);
  const Mesh<3> mesh = std::get<itr::Setup<3>>(read_scene(scene).setup).mesh;
  constexpr std::array<int, 6> kFirst = {0, 3, 0, 3, 2, 6};
  for (CellId c = 0; c < 6; ++c) {
    EXPECT_EQ(mesh.cell(c)[3], kFirst[static_cast<std::size_t>(c)]);
    EXPECT_GT(mesh.volume(c), 0);
  }
}

TEST_F(IdealCells, AreRefusedWhereTheyMakeNoSense) {
  const auto refused = [&](const json& changes) {
    json scene = cube(0);
    scene.merge_patch(changes);
    return failure(scene);
  };
  EXPECT_EQ(refused({{"defaults", "itr"}}).place, "/materials/use_rest_pose");
  EXPECT_EQ(refused({{"materials", {{"eigenstrain", 0.1}}}}).place, "/materials/eigenstrain");
  EXPECT_EQ(refused({{"materials", {{"prony", {{"g", {0.1}}, {"tau", {1}}}}}}}).place, "/materials/prony");
  const auto unsupported = [&](const json& changes) {
    json scene = cube(0);
    scene.merge_patch(changes);
    itr::Setup<3> setup = std::get<itr::Setup<3>>(read_scene(scene).setup);
    linear::Registry registry;
    try {
      Simulation<3> simulation(std::move(setup), registry);
    } catch (const InputError& error) {
      return error.parts().place;
    }
    return std::string();
  };
  EXPECT_EQ(unsupported({{"space", {{"remesh", {{"enabled", true}}}}}}), "/materials/*/use_rest_pose");
  EXPECT_EQ(unsupported({{"output", {{"error_bars", true}}}}), "/output/error_bars");
}

}  // namespace
}  // namespace scene
}  // namespace itr
