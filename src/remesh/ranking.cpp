// SPDX-License-Identifier: MIT
#include "ranking.hpp"

#include <algorithm>

#include "itr/energy/elastic/laws.hpp"

namespace itr {

namespace {

/// Thresholds of one energy field over the edges, and ranks by them.
class Thresholds {
 public:
  Thresholds(std::vector<double> energies, const RemeshOptions& options) {
    if (energies.empty()) return;
    std::sort(energies.begin(), energies.end());
    const double low = energies.front(), range = energies.back() - low, s = options.split.culling_threshold;
    const auto index = std::min(energies.size() - 1, static_cast<std::size_t>(s * static_cast<double>(energies.size())));
    top_ = std::max(std::min(low + range * s, energies[index]), std::min(1e-12, options.split.acceptance_tolerance));
    bottom_ = low + range * options.collapse.culling_threshold;
  }
  Rank operator()(double energy) const {
    return energy >= top_ ? Rank::top : energy <= bottom_ ? Rank::bottom : Rank::middle;
  }

 private:
  double top_ = 0, bottom_ = 0;
};

/// Elastic energy times the scaling, a cell.
std::vector<double> cell_energies(const Mesh<2>& mesh, const RemeshFields<2>& fields, const StepContext<2>& context) {
  std::vector<double> energies(mesh.cell_slots(), 0);
  for (int c = 0; c < mesh.cell_slots(); ++c) {
    if (!mesh.is_cell_alive(c)) continue;
    const Material& material = context.materials.at(mesh.body(c));
    const CellSet<2>::Element element{mesh.cell(c), mesh.body(c), mesh.volume(c), mesh.inverse_rest_edges(c)};
    const Vec<2> barycenter = (mesh.rest(mesh.cell(c)[0]) + mesh.rest(mesh.cell(c)[1]) + mesh.rest(mesh.cell(c)[2])) / 3;
    energies[c] = context.scaling * mesh.volume(c) *
                  elastic_density<2>(deformation_gradient<2>(element, fields.x), elastic_moduli<2>(material, barycenter));
  }
  return energies;
}

/// Contact energy (stiffness left out) of each vertex: its share of the pairs that it is part of.
std::vector<double> vertex_contact_energies(const Mesh<2>& mesh, const RemeshFields<2>& fields,
                                            const StepContext<2>& context) {
  const auto& obstacles = context.obstacles;
  const int bodies = mesh.vertex_slots(), total = bodies + static_cast<int>(obstacles.x.size());
  std::vector<double> energies(total, 0);
  if (!context.contact.enabled) return energies;
  CollisionSurface surface;
  surface.area.assign(total, 0);
  surface.degree.assign(total, 0);
  surface.counts.assign(total, 0);
  const auto add_edge = [&](int a, int b) { surface.edges.push_back({std::min(a, b), std::max(a, b)}); };
  for (int f = 0; f < mesh.facet_slots(); ++f) {
    if (!mesh.is_facet_alive(f)) continue;
    const auto [a, b] = mesh.facet(f);
    add_edge(a, b);
    for (const int v : {a, b}) {
      surface.area[v] += (mesh.rest(b) - mesh.rest(a)).norm() / 2;
      ++surface.degree[v];
      surface.counts[v] = 1;
    }
  }
  for (int v = 0; v < bodies; ++v)
    if (surface.counts[v]) surface.vertices.push_back(v);
  for (const auto& [a, b] : obstacles.edges) {
    add_edge(bodies + a, bodies + b);
    for (const int o : {a, b}) {
      surface.area[bodies + o] += (obstacles.rest[b] - obstacles.rest[a]).norm() / 2;
      ++surface.degree[bodies + o];
    }
  }
  for (int v = bodies; v < total; ++v) {
    if (surface.degree[v] == 0) surface.area[v] = 1;
    surface.vertices.push_back(v);
  }
  std::sort(surface.edges.begin(), surface.edges.end());
  VectorX x(2 * total);
  x.head(2 * bodies) = fields.x;
  for (int o = 0; o < total - bodies; ++o) x.segment<2>(2 * (bodies + o)) = obstacles.x[o];
  const ContactEnergy<2> contact(surface, context.contact, 1, context.scaling);
  Workspace workspace;
  for (const auto& s : contact.active(x, workspace)) {
    const double share = context.scaling * contact.pair_energy(s, x) / s.size();
    for (int k = 0; k < s.size(); ++k) energies[s.vertices[k]] += share;
  }
  return energies;
}

}  // namespace

EdgeRanks rank_edges(const Mesh<2>& mesh, const RemeshFields<2>& fields, const StepContext<2>& context,
                     const RemeshOptions& options) {
  const auto edges = mesh.edges();
  if (options.screening == Screening::none) {  // every edge may be split and collapsed
    EdgeRanks ranks;
    for (const EdgeKey& edge : edges) ranks[edge] = Rank::top;
    return ranks;
  }
  const auto of_cells = cell_energies(mesh, fields, context);
  const auto of_vertices = vertex_contact_energies(mesh, fields, context);
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
    const bool on_surface = mesh.find_facet({edge[0], edge[1]}) != kNone;
    contact.push_back(on_surface ? (of_vertices[edge[0]] + of_vertices[edge[1]]) / 2 : 0);
  }
  const bool touching = std::any_of(contact.begin(), contact.end(), [](double e) { return e > 0; });
  const Thresholds by_elastic(elastic, options), by_contact(contact, options);
  EdgeRanks ranks;
  ranks.reserve(edges.size());
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const Rank a = by_elastic(elastic[i]), b = touching ? by_contact(contact[i]) : a;
    ranks[edges[i]] = a == Rank::top || b == Rank::top         ? Rank::top
                      : a == Rank::bottom && b == Rank::bottom ? Rank::bottom
                                                               : Rank::middle;
  }
  return ranks;
}

}  // namespace itr
