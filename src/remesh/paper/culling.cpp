// SPDX-License-Identifier: MIT
#include <algorithm>

#include "baseline.hpp"
#include "energy/contact/surface_builder.hpp"
#include "energy/elastic/point.hpp"
#include "fem/chords.hpp"
#include "remesh/curved_cell.hpp"
#include "remesh/decide/queries.hpp"

namespace itr {

namespace {

/// Elastic energy times the scaling, a cell.
template <int Dim>
std::vector<double> cell_energies(const Mesh<Dim>& mesh, const RemeshFields<Dim>& fields, const StepContext<Dim>& context) {
  std::vector<double> energies(mesh.cell_slots(), 0);
  for (const CellId c : mesh.live_cells()) {
    const Material& material = context.materials.at(mesh.body(c));
    const auto moduli = elastic_moduli<Dim>(material, mesh.barycenter(c));
    const auto element = element_of(mesh, c);
    for_each_gradient<Dim>(element, fields.x, [&](const Mat<Dim>& F, double fraction) {
      energies[c] += context.scaling * (element.volume * (fraction * elastic_density<Dim>(F, moduli)));
    });
  }
  return energies;
}

/// Contact energy (stiffness left out) of each vertex: its part of the pairs that it is part of.
template <int Dim>
std::vector<double> vertex_contact_energies(const Mesh<Dim>& mesh, const RemeshFields<Dim>& fields,
                                            const StepContext<Dim>& context) {
  const auto& obstacles = context.obstacles;
  const int bodies = mesh.node_slots(), total = bodies + static_cast<int>(obstacles.x.size());
  std::vector<double> energies(total, 0);
  if (!context.contact.enabled) return energies;
  std::vector<typename MeshTypes<Dim>::Facet> chords;
  for (const FacetId f : mesh.live_facets()) {
    for_each_chord<Dim>(mesh.facet(f), nodes_of_edges(mesh), [&](const auto& chord) { chords.push_back(chord); });
  }
  VectorX x(Dim * total);
  x.head(Dim * bodies) = fields.x.head(Dim * bodies);
  for (int o = 0; o < total - bodies; ++o) x.segment<Dim>(Dim * (bodies + o)) = obstacles.x[o];
  std::vector<Vec<Dim>> rest = mesh.rest();
  CollisionSurface surface = surface_of_facets<Dim>(chords, rest, obstacles, mesh.is_axisymmetric());
  rest.insert(rest.end(), obstacles.rest.begin(), obstacles.rest.end());
  surface.closed = closed_faces<Dim>(rest, context.contact.reach_of_closed(), 0,
                                     [&](int v) { return v < bodies && mesh.steps_apart(v) == 0; });
  const ContactEnergy<Dim> contact(surface, context.contact, 1, context.scaling);
  Workspace workspace;
  for (const auto& s : contact.active(x, workspace)) {
    const double part = context.scaling * contact.pair_energy(s, x) / s.size();
    for (int k = 0; k < s.size(); ++k) energies[s.vertices[k]] += part;
  }
  for (const EdgeKey& edge : mesh.curved_edges())
    for (const VertexId end : edge) energies[end] += energies[mesh.node_of(edge)] / 2;
  return energies;
}

}  // namespace

/// Thresholds of one energy field over the edges, and ranks by them.
template <int Dim>
class Baseline<Dim>::Thresholds {
 public:
  Thresholds(std::vector<double> energies, const RemeshOptions& options) {
    if (energies.empty()) return;
    std::sort(energies.begin(), energies.end());
    const double low = energies.front(), range = energies.back() - low, s = options.split.culling_threshold;
    const auto index = std::min(energies.size() - 1, static_cast<std::size_t>(s * static_cast<double>(energies.size())));
    top_ = std::max(std::min(low + range * s, energies[index]), std::min(1e-12, options.split.acceptance_tolerance.value()));
    bottom_ = low + range * options.collapse.culling_threshold;
  }
  Rank operator()(double energy) const {
    return energy >= top_ ? Rank::top : energy <= bottom_ ? Rank::bottom : Rank::middle;
  }

 private:
  double top_ = 0, bottom_ = 0;
};

template <int Dim>
std::unique_ptr<Baseline<Dim>> Baseline<Dim>::chosen_by(const RemeshOptions& options) {
  const bool chosen = options.sizing_field.enabled || options.screening != Screening::bounds;
  return chosen ? std::make_unique<Baseline>(options) : nullptr;
}

template <int Dim>
void Baseline<Dim>::rank(const RemeshQueries<Dim>& queries) {
  if (!culls()) return;
  const Mesh<Dim>& mesh = queries.mesh();
  const auto edges = mesh.edges();
  const auto of_cells = cell_energies(mesh, queries.fields(), queries.context());
  const auto of_vertices = vertex_contact_energies(mesh, queries.fields(), queries.context());
  std::vector<double> elastic, contact;
  for (const EdgeKey& edge : edges) {
    double sum = 0;
    int count = 0;
    for (const CellId c : mesh.cells_of(edge[0]))
      if (const auto& cell = mesh.cell(c); std::find(cell.begin(), cell.end(), edge[1]) != cell.end()) {
        sum += of_cells[c];
        ++count;
      }
    elastic.push_back(sum / count);
    contact.push_back(queries.is_surface(edge) ? (of_vertices[edge[0]] + of_vertices[edge[1]]) / 2 : 0);
  }
  const bool touching = std::any_of(contact.begin(), contact.end(), [](double e) { return e > 0; });
  const Thresholds by_elastic(elastic, queries.options()), by_contact(contact, queries.options());
  ranks_.clear();
  ranks_.reserve(edges.size());
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const Rank a = by_elastic(elastic[i]), b = touching ? by_contact(contact[i]) : a;
    ranks_[edges[i]] = a == Rank::top || b == Rank::top         ? Rank::top
                       : a == Rank::bottom && b == Rank::bottom ? Rank::bottom
                                                                : Rank::middle;
  }
}

template class Baseline<2>;
template class Baseline<3>;

}  // namespace itr
