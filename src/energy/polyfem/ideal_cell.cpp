// SPDX-License-Identifier: MIT
#include "ideal_cell.hpp"

#include <Eigen/LU>
#include <cmath>

#include "energy/elastic/stretch_response.hpp"

namespace itr {

namespace {

/// As columns. PolyFEM's tetrahedron is not regular: that would be sqrt(2/3) high.
template <int Dim>
Mat<Dim> ideal_edges() {
  const double height = std::sqrt(3.0) / 2;
  Mat<Dim> S = Mat<Dim>::Identity();
  S(0, 1) = 0.5;
  S(1, 1) = height;
  if constexpr (Dim == 3) S.col(2) = Vec<3>(0.5, height / 3, height);
  return S;
}

}  // namespace

const LawRow& ideal_cell_law() {
  static const LawRow row = {
      "AMIPS", {{"weight", LawCoefficient::Range::positive, false, 1}}, [](const LawValues& values, StretchResponse& at) {
        at.add(values[0][0], at.powers_by_volume(2, 1 + at.dimension() / 2.0));
      }};
  return row;
}

bool is_of_ideal_cell(const Material& material) {
  const LawSum* sum = sum_of(material);
  return sum && !sum->terms.empty() && sum->terms.front().row == &ideal_cell_law();
}

template <int Dim>
void set_ideal_cell(const Mat<Dim>& inverse_edges, ElasticModuli& moduli) {
  const Mat<Dim> inverse = ideal_edges<Dim>() * inverse_edges;  // A^-1
  moduli.growth = {.dimension = Dim};
  moduli.growth.strain.template topLeftCorner<Dim, Dim>() = inverse - Mat<Dim>::Identity();
  moduli.growth.inverse.template topLeftCorner<Dim, Dim>() = inverse.inverse();
}

template void set_ideal_cell<2>(const Mat<2>&, ElasticModuli&);
template void set_ideal_cell<3>(const Mat<3>&, ElasticModuli&);

}  // namespace itr
