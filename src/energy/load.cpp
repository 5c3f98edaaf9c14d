// SPDX-License-Identifier: MIT
#include "itr/energy/load.hpp"

#include <algorithm>
#include <cmath>

#include "itr/energy/elastic/laws.hpp"
#include "itr/fem/quadrature.hpp"
#include "load_points.hpp"

namespace itr {

namespace {

template <int Dim, std::size_t Vertices>
std::array<Vec<Dim>, Vertices> rest_of(const std::array<int, Vertices>& vertices, const CellSet<Dim>& cells) {
  std::array<Vec<Dim>, Vertices> rest;
  for (std::size_t k = 0; k < Vertices; ++k) rest[k] = cells.rest[vertices[k]];
  return rest;
}

template <int Dim, std::size_t Vertices>
void add_forces(const std::array<int, Vertices>& vertices, const CellSet<Dim>& cells, int part, double weight,
                const std::function<Vec<Dim>(const RestPoint<Dim>&)>& load, VectorView forces) {
  using Point = LoadPoint<Vertices>;
  for_each_load_point<Dim>(rest_of(vertices, cells), part, weight, load, [&](std::size_t q, const Vec<Dim>& f) {
    for (std::size_t k = 0; k < Vertices; ++k)
      forces.segment<Dim>(Dim * vertices[k]) += (k == q ? Point::kNear : Point::kFar) * f;
  });
}

/// Adds forces on a simplex with curved edges, by the rule for products of two quadratic functions.
template <int Dim, int SimplexDim>
void add_curved_forces(const std::array<int, kQuadraticNodes<SimplexDim>>& nodes, CurvedEdges curved,
                       const CellSet<Dim>& cells, int part, double measure,
                       const std::function<double(const Vec<Dim>&)>& density,
                       const std::function<Vec<Dim>(const RestPoint<Dim>&)>& load, VectorView forces) {
  Vec<Dim> inward = Vec<Dim>::Zero();
  if constexpr (SimplexDim < Dim) {
    std::array<int, Dim> corners;
    std::copy_n(nodes.begin(), Dim, corners.begin());
    inward = inward_normal(rest_of(corners, cells));
  }
  for (const auto& point : quadrature<SimplexDim>(kMassDegree)) {
    Vec<Dim> X = Vec<Dim>::Zero();
    for (int k = 0; k <= SimplexDim; ++k) X += point.weights[k] * cells.rest[nodes[k]];
    const Vec<Dim> f = point.share * measure * density(X) * load(RestPoint<Dim>(X, inward, part));
    const auto shapes = quadratic_shapes<SimplexDim>(curved, point.weights);
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
    for (const auto& element : cells_.elements) {
      const double density = mass_density<Dim>(materials.at(element.body), rest_barycenter(cells_, element));
      add_forces<Dim>(element.vertices, cells_, element.part, density * element.volume, loads.acceleration, forces);
    }
  if (loads.acceleration)
    for (const auto& element : cells_.curved_elements) {
      const auto density = [&](const Vec<Dim>& X) { return mass_density<Dim>(materials.at(element.body), X); };
      add_curved_forces<Dim, Dim>(element.nodes, element.curved, cells_, element.part, element.volume, density,
                                  loads.acceleration, forces);
    }
  for (const auto& facet : cells_.curved_facets)
    for (const auto& [tag, traction] : loads.tractions) {
      if (tag != facet.tag) continue;
      std::array<int, Dim> corners;
      std::copy_n(facet.nodes.begin(), Dim, corners.begin());
      add_curved_forces<Dim, Dim - 1>(
          facet.nodes, facet.curved, cells_, facet.part, facet_area(rest_of(corners, cells_)),
          [](const Vec<Dim>&) { return 1.0; }, traction, forces);
    }
  for (const auto& facet : cells_.facets)
    for (const auto& [tag, traction] : loads.tractions)
      if (tag == facet.tag)
        add_forces<Dim>(facet.vertices, cells_, facet.part, facet_area(rest_of(facet.vertices, cells_)), traction, forces);
  for (int v = 0; v < cells_.num_vertices; ++v) rest_work_ += forces.segment<Dim>(Dim * v).dot(cells_.rest[v]);
}

template class LoadEnergy<2>;
template class LoadEnergy<3>;

}  // namespace itr
