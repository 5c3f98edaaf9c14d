// SPDX-License-Identifier: MIT
// A material of the program's own, stiffer the more it is stretched: W = mu/2 (g + g^2) + lambda/2 (ln J)^2 with
// g = |F|^2 - d - 2 ln J. Trials of the remesher use it as the solver does.
#include <Eigen/LU>
#include <cmath>
#include <cstdio>
#include <itr/itr.hpp>

namespace {

using itr::MatrixX;

class Stiffening final : public itr::OwnLaw {
 public:
  Stiffening(double mu, double lambda) : mu_(mu), lambda_(lambda) {}
  double density(const Eigen::Ref<const MatrixX>& F) const override {
    const double log_j = std::log(F.determinant()), g = F.squaredNorm() - double(F.rows()) - 2 * log_j;
    return mu_ / 2 * (g + g * g) + lambda_ / 2 * log_j * log_j;
  }
  void stress(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> P) const override {
    const MatrixX T = F.inverse().transpose();
    const double log_j = std::log(F.determinant()), g = F.squaredNorm() - double(F.rows()) - 2 * log_j;
    P = mu_ * (1 + 2 * g) * (F - T) + lambda_ * log_j * T;
  }
  void hessian(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> H) const override {
    const Eigen::Index d = F.rows();
    const MatrixX T = F.inverse().transpose(), dg = 2 * (F - T);
    const double log_j = std::log(F.determinant()), g = F.squaredNorm() - double(d) - 2 * log_j;
    const double a = mu_ * (1 + 2 * g), c = a - lambda_ * log_j;
    for (Eigen::Index j = 0; j < d; ++j)
      for (Eigen::Index i = 0; i < d; ++i)
        for (Eigen::Index l = 0; l < d; ++l)
          for (Eigen::Index k = 0; k < d; ++k)
            H(d * j + i, d * l + k) =
                (i == k && j == l ? a : 0) + c * T(k, j) * T(i, l) + lambda_ * T(i, j) * T(k, l) + mu_ * dg(i, j) * dg(k, l);
  }

 private:
  double mu_, lambda_;
};

/// How far a strip that hangs from its top is stretched by its weight.
double stretch(bool own) {
  itr::Setup<2> setup;
  std::vector<itr::Vec<2>> rest;
  std::vector<std::array<int, 3>> cells;
  for (int i = 0; i < 22; ++i) rest.emplace_back(0.1 * (i % 2), 0.1 * (i / 2));
  for (int i = 0; i < 20; i += 2) cells.insert(cells.end(), {{i, i + 1, i + 3}, {i, i + 3, i + 2}});
  setup.mesh = itr::Mesh<2>(rest, cells, std::vector<int>(cells.size(), 0));
  setup.mesh.set_facet_tag(setup.mesh.find_facet({20, 21}), 1);
  itr::Material& material = setup.materials[0];
  material = {.youngs_modulus = 2e4, .poisson_ratio = 0.3, .density = 1000};
  if (own) {
    material.law = itr::MaterialLaw::own;
    material.own = std::make_shared<Stiffening>(material.lame_mu(), material.lame_lambda(2));
  }
  setup.dirichlet.push_back({1, {true, true}, [](const itr::Vec<2>&, double) { return itr::Vec<2>(0, 0); }});
  setup.body_acceleration = [](const itr::Vec<2>&, double) { return itr::Vec<2>(0, -9.81); };
  setup.time.quasistatic = true;
  setup.remesh.enabled = true;
  setup.remesh.split.acceptance_tolerance = 0.05;
  itr::linear::Registry registry;
  itr::Simulation<2> simulation(std::move(setup), registry);
  const itr::StepResult result = simulation.advance();
  if (!result.ok) std::printf("%s\n", result.reason.c_str());
  return -simulation.positions().minCoeff();
}

}  // namespace

int main() {
  const double soft = stretch(false), stiff = stretch(true);
  std::printf("neo-Hookean: %.4f m, stiffening: %.4f m\n", soft, stiff);
  return stiff > 0 && stiff < 0.9 * soft ? 0 : 1;
}
