// SPDX-License-Identifier: MIT
#include "prospect.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "energy/elastic/jacobian_barrier.hpp"
#include "energy/elastic/point.hpp"
#include "itr/fem/mass.hpp"
#include "mesh/connected_parts.hpp"
#include "remesh/curved_cell.hpp"

namespace itr {

namespace {

/// The acceleration of all vertices, if it is one.
template <int Dim>
std::optional<Vec<Dim>> uniform_acceleration(const Mesh<Dim>& mesh, const Loads<Dim>& loads) {
  std::optional<Vec<Dim>> all;
  if (!loads.acceleration) return Vec<Dim>::Zero();
  for (VertexId v = 0; v < mesh.vertex_slots(); ++v) {
    if (!mesh.is_vertex_alive(v)) continue;
    const Vec<Dim> own = loads.acceleration(mesh.point(v));
    if (all && *all != own) return std::nullopt;
    all = own;
  }
  return all;
}

/// By vertex slot, the number of its connected part.
template <int Dim>
std::vector<int> parts_of(const Mesh<Dim>& mesh) {
  std::vector<typename Mesh<Dim>::Cell> cells;
  cells.reserve(mesh.cell_slots());
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    if (mesh.is_cell_alive(c)) cells.push_back(mesh.cell(c));
  return connected_parts<Dim + 1>(mesh.vertex_slots(), cells);
}

/// Elastic energy and inertia of a cell with curved edges, by the rules of quadrature that the step has.
template <int Dim>
double energy_at_curves(const Mesh<Dim>& mesh, const RemeshFields<Dim>& fields, const StepContext<Dim>& context, CellId c,
                        const CurvedCell<Dim>& cell, const Vec<Dim>& fall) {
  const Material& material = context.materials.at(mesh.body(c));
  const auto linear = barycentric_gradients<Dim>(mesh.inverse_rest_edges(c));
  const auto moduli = elastic_moduli<Dim>(material, mesh.rest(cell.nodes[0]));
  const auto x = at_nodes<Dim>(cell.nodes, fields.x);
  const int level = fields.levels.empty() ? 0 : fields.levels[c];
  double density = barrier_density<Dim>(JacobianBarrier<Dim>(cell.edges, linear, x), moduli);
  for (const auto& point : cell_quadrature<Dim>(level, context.quadrature_degree))
    density += point.share * elastic_density<Dim>(
                                 x * quadratic_gradients<Dim, Dim>(cell.edges, point.weights, linear).transpose(), moduli);
  double energy = context.scaling * mesh.volume(c) * density;
  if (!context.has_inertia) return energy;
  const QuadraticCell<Dim> way = (x - at_nodes<Dim>(cell.nodes, fields.predictor)).colwise() - fall;
  const auto& mass = constant_quadratic_mass<Dim>(context.mass, cell.edges);
  energy += 0.5 * material.density * mesh.volume(c) * (way * mass).cwiseProduct(way).sum();
  return energy;
}

/// Volume of a cell whose edges are so long: isosceles and right-angled in 2D, regular in 3D.
template <int Dim>
double volume_of(double length) {
  return Dim == 2 ? length * length / 2 : length * length * length / (6 * std::sqrt(2.0));
}

}  // namespace

template <int Dim>
double available_energy(const Mesh<Dim>& mesh, const RemeshFields<Dim>& fields, const StepContext<Dim>& context) {
  constexpr double kUnknown = std::numeric_limits<double>::infinity();
  if (!is_bounded<Dim>(context) || !std::isfinite(context.coupling)) return kUnknown;
  const auto acceleration = uniform_acceleration(mesh, context.loads);
  if (!acceleration) return kUnknown;
  const Vec<Dim> fall = context.scaling * *acceleration;
  const std::vector<int> parts = parts_of(mesh);
  std::vector<double> energy(mesh.vertex_slots(), context.coupling);
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    if (!mesh.is_cell_alive(c)) continue;
    if (const CurvedCell<Dim> cell = cell_before(mesh, c); cell.edges) {
      energy[parts[cell.nodes[0]]] += energy_at_curves(mesh, fields, context, c, cell, fall);
      continue;
    }
    const auto element = element_of(mesh, c);
    const Material& material = context.materials.at(element.body);
    const auto moduli = elastic_moduli<Dim>(material, mesh.rest(element.vertices[0]));
    energy[parts[element.vertices[0]]] += context.scaling * elastic_energy<Dim>(element, fields.x, moduli);
    if (!context.has_inertia) continue;
    const ElementMass<Dim> mass(context.mass, material.density * element.volume);
    Vec<Dim> total = Vec<Dim>::Zero();
    double squares = 0;
    for (const int v : element.vertices) {
      const Vec<Dim> d = fields.x.template segment<Dim>(Dim * v) - fields.predictor.template segment<Dim>(Dim * v) - fall;
      total += d;
      squares += d.squaredNorm();
    }
    energy[parts[element.vertices[0]]] += mass.energy(total, squares);
  }
  return *std::max_element(energy.begin(), energy.end());
}

template <int Dim>
double longest_collapse(const CollapseOptions& options, const StepContext<Dim>& context) {
  constexpr double kBelow = 1 - 1e-9;  // edges of a regular mesh are as long as its shortest: round-off is not to choose
  return options.rel_max_edge_length * kBelow * context.shortest_edge;
}

template <int Dim>
bool is_small(const Mesh<Dim>& mesh, CellId cell, double longest) {
  return mesh.volume(cell) <= volume_of<Dim>(longest);
}

template <int Dim>
bool any_may_collapse(const Mesh<Dim>& mesh, const CollapseOptions& options, const StepContext<Dim>& context) {
  const double longest = longest_collapse(options, context);
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    if (!mesh.is_cell_alive(c) || !is_small(mesh, c, longest)) continue;
    for (int i = 0; i <= Dim; ++i)
      for (int j = i + 1; j <= Dim; ++j)
        if ((mesh.rest(mesh.cell(c)[i]) - mesh.rest(mesh.cell(c)[j])).norm() <= longest) return true;
  }
  return false;
}

#define ITR_INSTANTIATE(Dim)                                                                                  \
  template double available_energy<Dim>(const Mesh<Dim>&, const RemeshFields<Dim>&, const StepContext<Dim>&); \
  template double longest_collapse<Dim>(const CollapseOptions&, const StepContext<Dim>&);                     \
  template bool is_small<Dim>(const Mesh<Dim>&, CellId, double);                                              \
  template bool any_may_collapse<Dim>(const Mesh<Dim>&, const CollapseOptions&, const StepContext<Dim>&);
ITR_INSTANTIATE(2)
ITR_INSTANTIATE(3)
#undef ITR_INSTANTIATE

}  // namespace itr
