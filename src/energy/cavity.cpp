// SPDX-License-Identifier: MIT
#include "energy/cavity.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace itr {

double CavityLoad::pressure_at(double ratio) const {
  if (bulk_modulus > 0) return pressure - bulk_modulus * std::log(ratio);
  return (pressure + external_pressure) * std::pow(ratio, -exponent) - external_pressure;
}

double CavityLoad::energy_at(double ratio) const {
  const double logarithm = std::log(ratio), growth = ratio - 1;
  if (bulk_modulus > 0) return bulk_modulus * (ratio * logarithm - growth) - pressure * growth;
  const double of_unit = exponent == 1 ? logarithm : std::expm1((1 - exponent) * logarithm) / (1 - exponent);
  return external_pressure * growth - (pressure + external_pressure) * of_unit;
}

double CavityLoad::stiffness_at(double ratio) const {
  if (bulk_modulus > 0) return bulk_modulus / ratio;
  return exponent * (pressure + external_pressure) * std::pow(ratio, -exponent - 1);
}

template <int Dim>
CavityEnergy<Dim>::CavityEnergy(const CellSet<Dim>& cells, CavityLoad load, double scale)
    : cones_(cells.axisymmetric), load_(std::move(load)), scale_(scale) {
  Vec<Dim> middle = Vec<Dim>::Zero();
  for (const auto& facet : cells.facets) {
    if (std::ranges::find(load_.surfaces, facet.tag) == load_.surfaces.end()) continue;
    cones_.add(facet, -1);
    middle += cells.rest[facet.vertices[0]];
  }
  if (cones_.empty()) return;
  cones_.set_origin(middle / static_cast<double>(cones_.size()));
  VectorX rest(Dim * cells.num_vertices);
  for (int v = 0; v < cells.num_vertices; ++v) rest.segment<Dim>(Dim * v) = cells.rest[v];
  rest_volume_ = volume(rest);
}

template <int Dim>
void CavityEnergy<Dim>::add_rank_ones(ConstVectorView x, std::vector<RankOne>& parts) const {
  RankOne& part = parts.emplace_back(RankOne{VectorX::Zero(x.size()), 0});
  cones_.add_gradient(x, 1, part.vector);
  part.factor = scale_ * load_.stiffness_at(ratio_at(x)) / rest_volume_;
}

template class CavityEnergy<2>;
template class CavityEnergy<3>;

}  // namespace itr
