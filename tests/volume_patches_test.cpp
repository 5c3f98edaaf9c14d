// SPDX-License-Identifier: MIT
// Near-incompressible bodies whose volume is averaged over patches: derivatives, what averaging leaves alone, stability by
// the numerical inf-sup test, and statics against closed forms and fine meshes.
#include "fem/volume_patches.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>
#include <set>

#include "derivatives.hpp"
#include "energy/elastic/elastic.hpp"
#include "energy/elastic/patched_volume.hpp"
#include "itr/core.hpp"
#include "itr/solver.hpp"
#include "random_cube.hpp"
#include "random_mesh.hpp"
#include "simulation_scenes.hpp"
#include "sums_of_laws.hpp"

namespace itr {
namespace {

enum class Curved { none, some, half, all };

template <int Dim>
void curve(Curved curved, std::mt19937& random, Mesh<Dim>& mesh) {
  std::vector<EdgeKey> edges;
  for (const EdgeKey& edge : mesh.edges())
    if (curved == Curved::all || (curved == Curved::some && random() % 10 < 3) ||
        (curved == Curved::half && mesh.rest(edge[0])[1] <= 0.5 && mesh.rest(edge[1])[1] <= 0.5))
      edges.push_back(edge);
  mesh.set_curved_edges(edges);
}

template <int Dim>
Mesh<Dim> random_body(int n, Curved curved, std::mt19937& random) {
  Mesh<Dim> mesh = [&] {
    if constexpr (Dim == 2)
      return random_mesh(n, random);
    else
      return make_cube(n, random, 0.15);
  }();
  curve(curved, random, mesh);
  return mesh;
}

template <int Dim>
CellSet<Dim> patched(const Mesh<Dim>& mesh, const std::map<int, Material>& materials) {
  CellSet<Dim> cells = whole_mesh(mesh, {});
  add_patches(materials, cells);
  return cells;
}

template <int Dim>
std::map<int, Material> for_both_bodies(Material material) {
  material.volume = VolumeForm::patches;
  return {{1, material}, {2, material}};
}

/// All laws that have a part U(J); bulk moduli of some tens of the shear modulus.
template <int Dim>
std::vector<Material> laws() {
  std::vector<Material> laws{{.youngs_modulus = 100, .poisson_ratio = 0.48, .plane_strain = Dim == 2},
                             {.law = MaterialLaw::mooney_rivlin,
                              .youngs_modulus = 105,
                              .poisson_ratio = 0.48,
                              .mooney_rivlin = {.c1 = 15, .c2 = 3, .c3 = 0.4, .log_k = 300, .volume_d = 400}}};
  for (LawSum sum : sums_of_all_laws<Dim>()) {
    if (sum.is_plane_stress) continue;
    const Material material = material_of(sum, Dim);
    if (may_average_volume(material, Dim)) laws.push_back(material);
  }
  return laws;
}

/// Positions near F X, all cells upright.
template <int Dim>
VectorX placed(const CellSet<Dim>& cells, const Mat<Dim>& F, double noise, std::mt19937& random) {
  std::uniform_real_distribution<double> shift(-noise, noise);
  VectorX x(Dim * cells.num_vertices);
  for (int v = 0; v < cells.num_vertices; ++v)
    for (int c = 0; c < Dim; ++c) x[Dim * v + c] = (F * cells.rest[v])[c] + shift(random);
  return x;
}

template <int Dim>
Mat<Dim> some_stretch() {
  Mat<Dim> F = Mat<Dim>::Identity() * 1.02;
  F(0, 1) = 0.2;
  F(0, 0) = 0.9;
  return F;
}

template <typename T>
class Patches : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Patches, Dimensions);

TYPED_TEST(Patches, EachPointHasWeightsThatAddUpToOne) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(3);
  for (const Curved curved : {Curved::none, Curved::some, Curved::half, Curved::all}) {
    const CellSet<Dim> cells = patched(random_body<Dim>(Dim == 2 ? 8 : 4, curved, random), for_both_bodies<Dim>({}));
    const VolumePatches<Dim>& patches = *cells.patches;
    double rest = 0, total = 0;
    for (const auto& element : cells.elements) rest += element.volume;
    for (const double volume : patches.volume) total += volume;
    EXPECT_NEAR(total, rest, 1e-13);
    const std::array<double, Dim + 1> middle = [] {
      std::array<double, Dim + 1> l{};
      l[0] = 0.7;
      l[1] = 0.3;
      return l;
    }();
    for (int e = 0; e < static_cast<int>(cells.elements.size()); ++e) {
      double sum = 0;
      for (int part = 0; part < patches.kParts; ++part) {
        if (patches.patch_of[e][part] == kNone) continue;
        sum += patches.weight(e, part, middle);
        EXPECT_EQ(patches.body[patches.patch_of[e][part]], cells.elements[e].body);
      }
      EXPECT_NEAR(sum, 1, 1e-15);
    }
    // Fewer than one constraint for the motion of each vertex, where P1 locks with about two (2D) or five (3D).
    if (curved == Curved::none) {
      EXPECT_LT(patches.count(), 0.5 * cells.num_vertices);
    }
    if (curved == Curved::all && Dim == 3) {
      EXPECT_EQ(static_cast<int>(patches.count()), 125);
    }
  }
}

TYPED_TEST(Patches, DerivativesMatchDifferencesForAllLaws) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(5);
  for (const Material& law : laws<Dim>())
    for (const Curved curved : Dim == 2 ? std::vector{Curved::none, Curved::half, Curved::all} : std::vector{Curved::half}) {
      SCOPED_TRACE(name_of(law));
      const auto materials = for_both_bodies<Dim>(law);
      const CellSet<Dim> cells = patched(random_body<Dim>(2, curved, random), materials);
      const ElasticEnergy<Dim> elastic(cells, materials, 0.3);
      const VectorX x = placed<Dim>(cells, some_stretch<Dim>(), Dim == 2 ? 0.03 : 0.015, random);
      expect_derivatives(elastic, x, 1e-6, 1e-6);
      expect_psd(elastic, x);
    }
}

/// Homogeneous states have the energy and the stress of the law, whatever the patches.
TYPED_TEST(Patches, HomogeneousStatesKeepTheLaw) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(7);
  for (const Material& law : laws<Dim>())
    for (const Curved curved : {Curved::none, Curved::half, Curved::all}) {
      SCOPED_TRACE(name_of(law));
      const Mesh<Dim> mesh = random_body<Dim>(3, curved, random);
      const std::map<int, Material> pointwise{{1, law}, {2, law}}, materials = for_both_bodies<Dim>(law);
      const CellSet<Dim> plain = whole_mesh(mesh, {}), cells = patched(mesh, materials);
      const VectorX x = placed<Dim>(cells, some_stretch<Dim>(), 0, random);
      const ElasticEnergy<Dim> expected(plain, pointwise, 1), elastic(cells, materials, 1);
      Workspace workspace;
      const double energy = expected.value(x, workspace);
      EXPECT_NEAR(elastic.value(x, workspace), energy, 1e-12 * energy);
      const VectorX gradient = gradient_of(expected, x);
      EXPECT_LE((gradient_of(elastic, x) - gradient).norm(), 1e-11 * gradient.norm());
    }
}

/// A patch is coarser than its points, and U is convex there: averaging never adds energy.
TYPED_TEST(Patches, AveragingTakesEnergyAway) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(9);
  const Material law{.youngs_modulus = 100, .poisson_ratio = 0.499, .plane_strain = Dim == 2};
  for (const Curved curved : {Curved::none, Curved::some, Curved::half}) {
    const Mesh<Dim> mesh = random_body<Dim>(4, curved, random);
    const auto materials = for_both_bodies<Dim>(law);
    const CellSet<Dim> plain = whole_mesh(mesh, {}), cells = patched(mesh, materials);
    const VectorX x = placed<Dim>(cells, Mat<Dim>::Identity(), 0.02, random);
    Workspace workspace;
    EXPECT_LT(ElasticEnergy<Dim>(cells, materials, 1).value(x, workspace),
              0.5 * ElasticEnergy<Dim>(plain, {{1, law}, {2, law}}, 1).value(x, workspace));
  }
}

TYPED_TEST(Patches, BitsDoNotDependOnThreads) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(11);
  const auto materials = for_both_bodies<Dim>({.youngs_modulus = 100, .poisson_ratio = 0.499, .plane_strain = Dim == 2});
  const CellSet<Dim> cells = patched(random_body<Dim>(Dim == 2 ? 30 : 8, Curved::half, random), materials);
  const ElasticEnergy<Dim> elastic(cells, materials, 1);
  const VectorX x = placed<Dim>(cells, Mat<Dim>::Identity(), 0.001, random);
  Workspace workspace;
  const auto bits = [&](int threads) {
    const ThreadLimit limit(threads);
    SparseAssembler sparse;
    const DofMap dofs = all_free(x.size());
    sparse.reset(dofs, Dim, element_stencils(cells));
    sparse.begin();
    HessianTarget target(dofs, sparse);
    HessianSink sink(target);
    elastic.add_hessian(x, PsdProjection::clamp, sink, workspace);
    EXPECT_TRUE(sparse.finish());  // it is new
    VectorX all(1 + x.size() + static_cast<Eigen::Index>(sparse.values().size()));
    all << elastic.value(x, workspace), gradient_of(elastic, x),
        Eigen::Map<const VectorX>(sparse.values().data(), static_cast<Eigen::Index>(sparse.values().size()));
    sparse.begin();
    elastic.add_hessian(x, PsdProjection::none, sink, workspace);
    EXPECT_FALSE(sparse.finish());  // patches are part of the base pattern
    return all;
  };
  EXPECT_EQ(bits(1), bits(3));
}

/// Whether a component of the displacement is held: all where X_0 = 0, of turned bodies those at their feet and r on the
/// axis.
template <int Dim>
bool is_held(const CellSet<Dim>& cells, Eigen::Index v, int component) {
  const Vec<Dim>& X = cells.rest[v];
  return cells.axisymmetric ? X[1] == 0 || (component == 0 && X[0] == 0) : X[0] == 0;
}

/// The inf-sup value of displacements and the patches' pressures, in the norms of H1 (with u_r/r where bodies are turned)
/// and L2.
template <int Dim>
double inf_sup(const Mesh<Dim>& mesh) {
  const auto materials = for_both_bodies<Dim>({.plane_strain = Dim == 2});
  const CellSet<Dim> cells = patched(mesh, materials);
  const VolumePatches<Dim>& patches = *cells.patches;
  const auto rule = [](std::size_t) -> const auto& { return quadrature<Dim>(kElasticDegree); };
  const Eigen::Index n = cells.num_vertices;
  std::array<MatrixX, Dim> A;  // by component
  A.fill(MatrixX::Zero(n, n));
  for (const auto& element : cells.elements) {
    const auto nodes = element.nodes();
    for (const auto& point : quadrature<Dim>(kElasticDegree)) {
      const auto g = shape_gradients<Dim>(element, point.weights);
      const auto shapes = quadratic_shapes<Dim>(element.curved, point.weights);
      const Vec<Dim> X = rest_position<Dim>(cells, element, point.weights);
      for (int c = 0; c < Dim; ++c)
        for (int a = 0; a < kQuadraticNodes<Dim>; ++a)
          for (int b = 0; b < kQuadraticNodes<Dim>; ++b) {
            const double hoop = cells.axisymmetric && c == 0 ? shapes[a] * shapes[b] / (X[0] * X[0]) : 0;
            A[c](nodes[a], nodes[b]) += element.volume * point.fraction * cells.turn(X) * (g.col(a).dot(g.col(b)) + hoop);
          }
    }
  }
  VectorX x(Dim * n);
  for (Eigen::Index v = 0; v < n; ++v) x.segment<Dim>(Dim * v) = cells.rest[v];
  MatrixX B = MatrixX::Zero(n, Dim * static_cast<Eigen::Index>(patches.count()));  // by direction and patch
  const PatchedVolume<Dim> volume(cells, materials, 1, rule);
  for (std::size_t i = 0; i < patches.count(); ++i) {
    const VectorX of_patch = volume.gradient_of(i, x);
    for (std::size_t k = 0; k < patches.nodes_of(i).size(); ++k)
      for (int c = 0; c < Dim; ++c)
        B(patches.nodes_of(i)[k], Dim * i + c) += of_patch[Dim * k + c] / std::sqrt(patches.volume[i]);
  }
  MatrixX S = MatrixX::Zero(patches.count(), patches.count());
  for (int c = 0; c < Dim; ++c) {
    MatrixX of_direction(n, patches.count());
    for (std::size_t i = 0; i < patches.count(); ++i) of_direction.col(i) = B.col(Dim * i + c);
    for (Eigen::Index v = 0; v < n; ++v)
      if (is_held(cells, v, c)) {
        A[c].row(v).setZero();
        A[c].col(v).setZero();
        A[c](v, v) = 1;
        of_direction.row(v).setZero();
      }
    const MatrixX half = Eigen::LLT<MatrixX>(A[c]).matrixL().solve(of_direction);
    S += half.transpose() * half;
  }
  return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<MatrixX>(S, Eigen::EigenvaluesOnly).eigenvalues()[0]));
}

TYPED_TEST(Patches, InfSupValuesAreBoundedBelowOverFourRefinements) {
  constexpr int Dim = TypeParam::value;
  constexpr double kLeast[2][4] = {{0.5, 0.55, 0.34, 0.34}, {0.44, 0.52, 0.21, 0.27}};
  for (const Curved curved : {Curved::none, Curved::some, Curved::half, Curved::all})
    for (const int n : Dim == 2 ? std::vector{4, 8, 12, 16} : std::vector{2, 3, 4, 6}) {
      double least = 1;
      for (unsigned seed = 1; seed <= (n < 16 && n * Dim < 18 ? 3 : 1); ++seed) {
        std::mt19937 random(seed);
        least = std::min(least, inf_sup<Dim>(random_body<Dim>(n, curved, random)));
      }
      const int kind = static_cast<int>(curved);
      EXPECT_GE(least, kLeast[Dim - 2][kind]) << Dim << "D, curved " << kind << ", n " << n;
    }
}

/// Bodies of revolution: solid ones and tubes.
TEST(PatchesOfTurnedMeshes, InfSupValuesAreBoundedBelow) {
  for (const double inner : {0.0, 0.5})
    for (const Curved curved : {Curved::none, Curved::half, Curved::all})
      for (const int n : {4, 8, 12, 16}) {
        std::mt19937 random(static_cast<unsigned>(n));
        const Mesh<2> square = random_mesh(n, random);
        std::vector<Vec<2>> rest;
        for (const Vec<2>& X : square.rest()) rest.emplace_back(inner + X[0], X[1]);
        std::vector<MeshTypes<2>::Cell> cells;
        for (const CellId c : square.live_cells()) cells.push_back(square.cell(c));
        Mesh<2> mesh(rest, cells, std::vector<int>(cells.size(), 1));
        mesh.set_axisymmetric(true);
        curve(curved, random, mesh);
        EXPECT_GE(inf_sup<2>(mesh), 0.29) << inner << ", curved " << static_cast<int>(curved) << ", n " << n;
      }
}

/// Takes the same test on what operations of remeshing leave behind.
TEST(PatchesOfRemeshedMeshes, InfSupValuesAreBoundedBelow) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    std::mt19937 random(seed);
    Mesh<2> mesh = random_mesh(6, random);
    for (int i = 0; i < 150; ++i) {
      if (const auto edit = random_edit(mesh, random)) mesh.apply(*edit);
      mesh.compact();
    }
    EXPECT_GE(inf_sup<2>(mesh), 0.4) << seed;
  }
}

TEST(PatchesOfRemeshedMeshes, InfSupValuesOfTetrahedraAreBoundedBelow) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    std::mt19937 random(seed);
    Mesh<3> mesh = make_cube(3, random, 0.15);
    int collapses = 0;
    for (int i = 0; i < 120; ++i) {
      const auto edges = mesh.edges();
      const EdgeKey edge = edges[random() % edges.size()];
      const auto edit =
          i % 3 == 0 ? std::optional(make_split(mesh, edge)) : propose_collapse(mesh, Strata<3>(mesh), edge).edit;
      if (edit) mesh.apply(*edit);
      collapses += edit && i % 3 != 0;
      mesh.compact();
    }
    EXPECT_GT(collapses, 10);
    EXPECT_GE(inf_sup<3>(mesh), 0.2) << seed;
  }
}

}  // namespace
}  // namespace itr
