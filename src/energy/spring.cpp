// SPDX-License-Identifier: MIT
#include "energy/spring.hpp"

#include <algorithm>
#include <array>

#include "energy/facet_shapes.hpp"
#include "fem/cell_set.hpp"

namespace itr {

template <int Dim>
SpringEnergy<Dim>::SpringEnergy(const CellSet<Dim>& cells, const Spring& spring, double scale)
    : rest_(rest_positions<Dim>(cells)), none_(VectorX::Zero(rest_.size())), scale_(scale) {
  for (const auto& facet : cells.facets) {
    if (std::ranges::find(spring.surfaces, facet.tag) == spring.surfaces.end()) continue;
    const auto nodes = facet.nodes();
    const auto used = static_cast<Eigen::Index>(facet.curved ? nodes.size() : facet.vertices.size());
    Mat<kQuadraticNodes<Dim - 1>> mass = Mat<kQuadraticNodes<Dim - 1>>::Zero();
    for_each_facet_point<Dim>(
        cells, facet, [&](const Vec<Dim>&, double part, const auto& shapes) { mass += part * shapes * shapes.transpose(); });
    MatrixX block(Dim * used, Dim * used);
    for (Eigen::Index i = 0; i < used; ++i)
      for (Eigen::Index j = 0; j < used; ++j)
        block.block<Dim, Dim>(Dim * i, Dim * j) = mass(i, j) * spring.stiffness.topLeftCorner<Dim, Dim>();
    blocks_.add(std::span(nodes).first(static_cast<std::size_t>(used)), block.data());
    is_empty_ = false;
  }
}

template <int Dim>
std::shared_ptr<const Energy> SpringEntry<Dim>::operator()(const CellSet<Dim>& cells, double, double scale) const {
  auto energy = std::make_shared<SpringEnergy<Dim>>(cells, *value, scale);
  return energy->empty() ? nullptr : energy;
}

template <int Dim>
void SpringEnergy<Dim>::add_hessian(ConstVectorView, PsdProjection, HessianSink& sink, Workspace&) const {
  MatrixX scaled;
  blocks_.for_each([&](std::span<const int> nodes, const auto& block) {
    scaled = scale_ * block;
    sink.add<Dim>(nodes, scaled.data());
  });
}

template <int Dim>
double SpringEnergy<Dim>::value_at(const Increment& at, Workspace& workspace) const {
  VectorX at_base = VectorX::Zero(at.d.size());
  add_gradient(at.base, at_base, workspace);
  return at_base.dot(at.d) + scale_ * blocks_.value(at.d, none_);
}

template <int Dim>
void SpringEnergy<Dim>::add_gradient_at(const Increment& at, VectorView gradient, Workspace& workspace) const {
  add_gradient(at.base, gradient, workspace);
  blocks_.add_gradient(at.d, none_, scale_, gradient);
}

template class SpringEnergy<2>;
template class SpringEnergy<3>;
template struct SpringEntry<2>;
template struct SpringEntry<3>;

}  // namespace itr
