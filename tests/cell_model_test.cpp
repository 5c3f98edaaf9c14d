// SPDX-License-Identifier: MIT
// The model of a cell that predictions are made of against the terms of the step, of which it is the sum.
#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "curved_mesh.hpp"
#include "derivatives.hpp"
#include "energy/cell_model.hpp"
#include "energy/elastic/elastic.hpp"
#include "energy/inertia.hpp"
#include "energy/load.hpp"

namespace itr {
namespace {

/// W = E/2 |F^T F - I|^2, which is nowhere in the library.
class ToyLaw final : public OwnLaw {
 public:
  double density(const Eigen::Ref<const MatrixX>& F) const override { return kModulus / 2 * strain(F).squaredNorm(); }
  void stress(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> P) const override { P = 2 * kModulus * F * strain(F); }
  void hessian(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> H) const override {
    MatrixX change = MatrixX::Zero(F.rows(), F.cols());
    for (Eigen::Index k = 0; k < F.size(); ++k) {
      change.reshaped()[k] = 1;
      const MatrixX of_strain = change.transpose() * F + F.transpose() * change;
      H.col(k) = (2 * kModulus * (change * strain(F) + F * of_strain)).reshaped();
      change.reshaped()[k] = 0;
    }
  }

 private:
  static constexpr double kModulus = 20;
  static MatrixX strain(const MatrixX& F) { return F.transpose() * F - MatrixX::Identity(F.cols(), F.cols()); }
};

template <int Dim>
Mesh<Dim> one_cell() {
  if constexpr (Dim == 2)
    return Mesh<2>({{0, 0}, {1.1, 0.1}, {0.2, 0.9}}, {{0, 1, 2}}, {1});
  else
    return Mesh<3>({{0, 0, 0}, {1.1, 0.1, 0}, {0.2, 0.9, 0.1}, {0, 0.2, 1.2}}, {{0, 1, 2, 3}}, {1});
}

template <typename T>
class CellModelTest : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(CellModelTest, Dimensions);

TYPED_TEST(CellModelTest, IsTheSumOfTheTerms) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> noise(-0.05, 0.05);
  for (int round = 0; round < 60; ++round) {
    Mesh<Dim> mesh = one_cell<Dim>();
    std::vector<EdgeKey> edges;
    for (const EdgeKey& edge : mesh.edges())
      if (round % 3 == 1 || (round % 3 == 2 && random() % 2)) edges.push_back(edge);
    mesh.set_curved_edges(edges);
    PotentialTerms<Dim> terms;
    Material& material = terms.materials[1];
    material = {.youngs_modulus = 30, .poisson_ratio = 0.3, .density = 2};
    material.law = static_cast<MaterialLaw>(round % 6);
    if (material.law == MaterialLaw::own) material.own = std::make_shared<ToyLaw>();
    material.mooney_rivlin = {.c1 = 5, .c2 = 3, .log_k = 20};
    terms.scaling = 0.3;
    terms.loads.acceleration = [](const Vec<Dim>& X) { return Vec<Dim>(X + Vec<Dim>::Ones()); };
    const CellSet<Dim> cells = whole_mesh(mesh, {});
    const auto& element = cells.elements[0];
    VectorX x(Dim * cells.num_vertices), predictor = x;
    for (int v = 0; v < cells.num_vertices; ++v)
      for (int c = 0; c < Dim; ++c) {
        x[Dim * v + c] = 1.1 * cells.rest[v][c] + noise(random);
        predictor[Dim * v + c] = cells.rest[v][c] + noise(random);
      }

    EnergySum sum;
    sum.add(std::make_shared<ElasticEnergy<Dim>>(cells, terms.materials, terms.scaling));
    sum.add(std::make_shared<InertiaEnergy<Dim>>(cells, terms.materials, terms.mass, predictor));
    sum.add(std::make_shared<LoadEnergy<Dim>>(cells, terms.materials, terms.loads, terms.scaling));
    Workspace workspace;
    const double value = sum.value(x, workspace);
    const VectorX gradient = gradient_of(sum, x);
    const MatrixX hessian = hessian_of(sum, x, PsdProjection::none);

    const auto nodes = element.nodes();
    PlacedCell<Dim> placed{.rest = {}, .curved = element.curved, .x = at_nodes<Dim>(nodes, x), .step = {}, .level = 0};
    placed.step = placed.x - at_nodes<Dim>(nodes, predictor);
    for (int k = 0; k <= Dim; ++k) placed.rest[k] = cells.rest[nodes[k]];
    auto places = CellModel<Dim>::still();
    for (int k = 0; k < kQuadraticNodes<Dim>; ++k)
      if (has_node<Dim>(element.curved, k)) places[k] = nodes[k];
    CellModel<Dim> still(terms, 0), each(terms, 0), together(terms, 0, true);
    still.add(placed, 1);
    each.add(placed, 1, places);
    together.add(placed, 1, places);
    ASSERT_FALSE(still.has_barrier());
    for (const CellModel<Dim>* model : {&still, &each, &together}) {
      EXPECT_NEAR(model->energy(), value, 1e-12 * std::abs(value)) << round;
      EXPECT_NEAR(model->elastic_energy(), sum.terms()[0]->value(x, workspace), 1e-12 * std::abs(value)) << round;
    }
    for (int v = 0; v < cells.num_vertices; ++v) {
      EXPECT_LT((each.gradient(v) - gradient.segment<Dim>(Dim * v)).norm(), 1e-12 * gradient.norm()) << round;
      EXPECT_LT((each.hessian(v) - hessian.block<Dim, Dim>(Dim * v, Dim * v)).norm(), 1e-11 * hessian.norm()) << round;
    }
    const Eigen::LLT<MatrixX> llt(hessian);
    if (llt.info() != Eigen::Success) continue;
    const double gain = 0.5 * gradient.dot(llt.solve(gradient));
    EXPECT_NEAR(together.relaxation(), gain, 1e-8 * gain) << round;
  }
}

/// Held components do not move.
TYPED_TEST(CellModelTest, HoldsComponents) {
  constexpr int Dim = TypeParam::value;
  const Mesh<Dim> mesh = one_cell<Dim>();
  PotentialTerms<Dim> terms;
  terms.materials[1] = {.youngs_modulus = 30, .poisson_ratio = 0.3, .density = 2};
  terms.has_inertia = false;
  PlacedCell<Dim> placed;
  for (int k = 0; k <= Dim; ++k) {
    placed.rest[k] = mesh.rest(k);
    placed.x.col(k) = 1.2 * mesh.rest(k);
  }
  CellModel<Dim> model(terms, 0);
  model.add(placed, 1, CellModel<Dim>::moving(1));
  std::array<int, Dim> tags;
  tags.fill(kNoTag);
  tags[0] = 5;
  model.hold(0, tags);
  EXPECT_EQ(model.gradient(0)[0], 0);
  EXPECT_NE(model.gradient(0)[1], 0);
  tags.fill(5);
  EXPECT_GT(model.relaxation_of(0), 0);
  model.hold(0, tags);
  EXPECT_EQ(model.relaxation_of(0), 0);
}

}  // namespace
}  // namespace itr
