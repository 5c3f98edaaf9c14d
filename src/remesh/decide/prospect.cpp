// SPDX-License-Identifier: MIT
#include "prospect.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "remesh/placed_cell.hpp"

namespace itr {

namespace {

/// The acceleration of all vertices, if it is one.
template <int Dim>
std::optional<Vec<Dim>> uniform_acceleration(const Mesh<Dim>& mesh, const Loads<Dim>& loads) {
  std::optional<Vec<Dim>> all;
  if (!loads.acceleration) return Vec<Dim>::Zero();
  for (const VertexId v : mesh.live_vertices()) {
    const Vec<Dim> own = loads.acceleration(mesh.point(v));
    if (all && *all != own) return std::nullopt;
    all = own;
  }
  return all;
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
  if (context.axisymmetric || !is_bounded<Dim>(context) || !std::isfinite(context.coupling)) return kUnknown;
  const auto acceleration = uniform_acceleration(mesh, context.loads);
  if (!acceleration) return kUnknown;
  const Vec<Dim> fall = context.scaling * *acceleration;
  PotentialTerms<Dim> terms = context;
  terms.loads = {};  // they complete squares
  std::vector<double> of_part(mesh.node_slots(), context.coupling);
  for (const CellId c : mesh.live_cells()) {
    PlacedCell<Dim> cell = place(mesh, fields, terms, cell_before(mesh, c), no_edit<Dim>());
    if (!fields.levels.empty()) cell.level = fields.levels[c];
    cell.step.colwise() -= fall;
    CellModel<Dim> model(terms, mesh.part(c));
    model.add(cell, mesh.body(c));
    of_part[mesh.part(c)] += model.energy();
  }
  return *std::max_element(of_part.begin(), of_part.end());
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
  for (const CellId c : mesh.live_cells()) {
    if (!is_small(mesh, c, longest)) continue;
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
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
