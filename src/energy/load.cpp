// SPDX-License-Identifier: MIT
#include "energy/load.hpp"

#include "energy/elastic/laws.hpp"
#include "fem/quadrature.hpp"
#include "load_points.hpp"

namespace itr {

namespace {

template <int Dim, std::size_t Vertices>
std::array<Vec<Dim>, Vertices> rest_of(const std::array<int, Vertices>& vertices, const CellSet<Dim>& cells) {
  std::array<Vec<Dim>, Vertices> rest;
  for (std::size_t k = 0; k < Vertices; ++k) rest[k] = cells.rest[vertices[k]];
  return rest;
}

/// Adds the forces of a load times a density on a cell or a facet: with curved edges by the rule for products of two
/// quadratic functions, without them by the points of linear ones, of the density in the middle. Turned ones take the first,
/// one degree higher.
template <int Dim, int SimplexDim, typename Simplex>
void add_forces(const Simplex& simplex, const CellSet<Dim>& cells, double measure, const auto& density,
                const std::function<Vec<Dim>(const RestPoint<Dim>&)>& load, VectorView forces) {
  const auto rest = rest_of(simplex.vertices, cells);
  if (!simplex.curved && !cells.axisymmetric) {
    using Point = LoadPoint<SimplexDim + 1>;
    Vec<Dim> sum = Vec<Dim>::Zero();
    for (const Vec<Dim>& X : rest) sum += X;
    const double weight = density(Vec<Dim>(sum / (SimplexDim + 1))) * measure;
    for_each_load_point<Dim>(rest, simplex.part, weight, load, [&](std::size_t q, const Vec<Dim>& f) {
      for (std::size_t k = 0; k < rest.size(); ++k)
        forces.segment<Dim>(Dim * simplex.vertices[k]) += (k == q ? Point::kNear : Point::kFar) * f;
    });
    return;
  }
  Vec<Dim> inward = Vec<Dim>::Zero();
  if constexpr (SimplexDim < Dim) inward = inward_normal(rest);
  const auto nodes = simplex.nodes();
  for (const auto& point : quadrature<SimplexDim>(degree_with_turn(kMassDegree, cells.axisymmetric))) {
    Vec<Dim> X = Vec<Dim>::Zero();
    for (int k = 0; k <= SimplexDim; ++k) X += point.weights[k] * rest[k];
    const Vec<Dim> f = point.fraction * measure * density(X) * cells.turn(X) * load(RestPoint<Dim>(X, inward, simplex.part));
    const auto shapes = quadratic_shapes<SimplexDim>(simplex.curved, point.weights);
    for (int k = 0; k < kQuadraticNodes<SimplexDim>; ++k) forces.segment<Dim>(Dim * nodes[k]) += shapes[k] * f;
  }
}

}  // namespace

template <int Dim>
LoadEnergy<Dim>::LoadEnergy(const CellSet<Dim>& cells, const std::map<int, Material>& materials, const Loads<Dim>& loads,
                            double scale)
    : cells_(cells) {
  renew(materials, loads, scale);
}

template <int Dim>
void LoadEnergy<Dim>::renew(const std::map<int, Material>& materials, const Loads<Dim>& loads, double scale) {
  scale_ = scale;
  rest_work_ = 0;
  VectorView forces = forces_.resize(Dim * cells_.num_vertices);
  forces.setZero();
  if (loads.acceleration)
    for (const auto& element : cells_.elements)
      add_forces<Dim, Dim>(
          element, cells_, element.volume,
          [&](const Vec<Dim>& X) { return mass_density<Dim>(materials.at(element.body), X); }, loads.acceleration, forces);
  for (const bool is_curved : {true, false})
    for (const auto& facet : cells_.facets)
      for (const auto& [tag, traction] : loads.tractions)
        if (tag == facet.tag && is_curved == (facet.curved != 0))
          add_forces<Dim, Dim - 1>(
              facet, cells_, facet_area(rest_of(facet.vertices, cells_)), [](const Vec<Dim>&) { return 1.0; }, traction,
              forces);
  for (int v = 0; v < cells_.num_vertices; ++v) rest_work_ += forces.segment<Dim>(Dim * v).dot(cells_.rest[v]);
}

template class LoadEnergy<2>;
template class LoadEnergy<3>;

}  // namespace itr
