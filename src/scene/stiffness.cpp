// SPDX-License-Identifier: MIT
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <vector>

#include "law_reader.hpp"

namespace itr::scene {

namespace {

/// By the entries of the list.
MatrixX stiffness_of(const Node& list, const std::vector<double>& entries, int dimension, double shears) {
  const Eigen::Index rows = dimension == 2 ? 3 : 6;
  MatrixX C = MatrixX::Zero(rows, rows);
  if (static_cast<Eigen::Index>(entries.size()) == rows * (rows + 1) / 2) {  // row by row of the upper triangle
    for (Eigen::Index i = 0, k = 0; i < rows; ++i)
      for (Eigen::Index j = i; j < rows; ++j, ++k) C(i, j) = C(j, i) = entries[static_cast<std::size_t>(k)];
    return C;
  }
  if (dimension == 2 && entries.size() == 4) {
    const double E1 = entries[0], E2 = entries[1], nu12 = entries[2];
    C.topLeftCorner(2, 2) << 1 / E1, -nu12 / E1, -nu12 / E1, 1 / E2;
    C(2, 2) = 1 / (shears * entries[3]);
  } else if (dimension == 3 && entries.size() == 9) {
    const double E1 = entries[0], E2 = entries[1], E3 = entries[2], nu12 = entries[3], nu13 = entries[4], nu23 = entries[5];
    C.topLeftCorner(3, 3) << 1 / E1, -nu12 / E1, -nu13 / E1, -nu12 / E1, 1 / E2, -nu23 / E2, -nu13 / E1, -nu23 / E2, 1 / E3;
    for (int k = 0; k < 3; ++k) C(3 + k, 3 + k) = 1 / (shears * entries[static_cast<std::size_t>(6 + k)]);
  } else if (dimension == 3 && entries.size() == 5) {
    const double Et = entries[0], Ea = entries[1], nu_t = entries[2], nu_a = entries[3], Ga = entries[4];
    C.topLeftCorner(3, 3) << 1 / Et, -nu_t / Et, -nu_a / Ea, -nu_t / Et, 1 / Et, -nu_a / Ea, -nu_a / Ea, -nu_a / Ea, 1 / Ea;
    C(3, 3) = C(4, 4) = 1 / Ga;
    C(5, 5) = 2 * (1 + nu_t) / Et;
  } else {
    list.fail(dimension == 2 ? "6 entries of the stiffness row by row, or 4: E1, E2, nu12, G12"
                             : "21 entries of the stiffness row by row, or 9: E1, E2, E3, nu12, nu13, nu23, G23, G13, G12, "
                               "or 5: E across the axis 3, E along it, nu across, nu along, G along");
  }
  return C.inverse();
}

}  // namespace

MatrixX read_stiffness(const Node& material, int dimension, bool is_polyfem) {
  const Node list = material["elasticity_tensor"];
  for (const char* key : {"E", "nu", "lambda", "mu"})
    if (material.has(key)) material[key].fail("it beside elasticity_tensor", "one of the two");
  MatrixX C = stiffness_of(list, list.numbers(), dimension, is_polyfem ? 2 : 1);
  if (!(C.selfadjointView<Eigen::Upper>().eigenvalues().minCoeff() > 0))
    list.fail(abbreviate(list.json()) + ", of a stiffness that is not positive definite", "one that is");
  return C;
}

bool has_axes(const Node& material) {
  return material.has("fiber_direction") && !material["fiber_direction"].json().empty();
}

MatrixX read_axes(const Node& material, int dimension) {
  const Node list = material["fiber_direction"];
  std::vector<double> entries;
  for (const Node& row : list.items())
    for (const Node& entry : row.items()) {
      if (!entry.json().is_number()) entry.fail("a number: directions that vary are of HGOFiber and ActiveFiber only");
      entries.push_back(entry.number(0));
    }
  const Eigen::Index n = dimension;
  constexpr double kOrthogonal = 1e-6;
  if (static_cast<Eigen::Index>(entries.size()) == n * n) {
    const MatrixX R = Eigen::Map<const MatrixX>(entries.data(), n, n).transpose();
    if ((R * R.transpose() - MatrixX::Identity(n, n)).norm() < kOrthogonal) return R;
  }
  list.fail("the rows of an orthogonal matrix, of which the columns are the material's axes");
}

}  // namespace itr::scene
