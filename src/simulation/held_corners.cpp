// SPDX-License-Identifier: MIT
#include "simulation/held_corners.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "itr/core.hpp"
#include "simulation/named.hpp"
#include "simulation/step_terms.hpp"

namespace itr {

namespace {

constexpr double kResolved = 1e-12;  ///< of the bodies' diagonal

template <int Dim>
using Conditions = std::vector<const DirichletCondition<Dim>*>;

/// Conditions that hold each vertex, the winner last.
template <int Dim>
std::vector<Conditions<Dim>> by_vertex(const Setup<Dim>& setup) {
  const Mesh<Dim>& mesh = setup.mesh;
  const ConditionsByTag<Dim> all = conditions_by_tag<Dim>(setup);
  std::vector<Conditions<Dim>> holding(mesh.node_slots());
  const auto add = [&](VertexId v, const DirichletCondition<Dim>* condition) {
    std::erase(holding[v], condition);
    holding[v].push_back(condition);
  };
  for (const auto& [tag, condition] : all)
    for (FacetId f = 0; f < mesh.facet_slots(); ++f)
      if (mesh.is_facet_alive(f) && mesh.facet_tag(f) == tag)
        for (const VertexId v : mesh.facet(f)) add(v, condition);
  for (const auto& [tag, condition] : all)
    for (VertexId v = 0; v < mesh.node_slots(); ++v)
      if (mesh.is_vertex_alive(v) && mesh.vertex_tag(v) == tag) add(v, condition);
  return holding;
}

/// Largest difference of the displacements that two conditions prescribe in a component that both hold, at the ends of the
/// first, the middle and the last step. Less than `resolved` [m] is none.
template <int Dim>
double difference(const DirichletCondition<Dim>& a, const DirichletCondition<Dim>& b, const RestPoint<Dim>& X,
                  const TimeOptions& time, double resolved) {
  constexpr double kRounding = 1e-9;
  double largest = 0;
  for (const int step : {1, (time.steps + 1) / 2, time.steps}) {
    const double t = time.time_after(time.first_step + step);
    const Vec<Dim> of_a = a.displacement(X, t), of_b = b.displacement(X, t);
    for (int c = 0; c < Dim; ++c) {
      if (!a.components[c] || !b.components[c]) continue;
      const double by = std::abs(of_a[c] - of_b[c]);
      if (by > std::max(resolved, kRounding * std::max(std::abs(of_a[c]), std::abs(of_b[c]))))
        largest = std::max(largest, by);
    }
  }
  return largest;
}

struct Contradiction {
  int vertices = 0;
  VertexId worst = kNone;
  double by = 0;  ///< [m]
};

}  // namespace

template <int Dim>
void find_contradictions(const Setup<Dim>& setup, std::vector<std::string>& found) {
  std::map<std::pair<int, int>, Contradiction> all;  // of the id that loses and of the one that wins
  const std::vector<Conditions<Dim>> holding = by_vertex(setup);
  const double resolved = kResolved * rest_diagonal(setup.mesh);
  for (VertexId v = 0; v < setup.mesh.node_slots(); ++v)
    for (std::size_t i = 0; i < holding[v].size(); ++i)
      for (std::size_t j = i + 1; j < holding[v].size(); ++j) {
        const auto &loser = *holding[v][i], &winner = *holding[v][j];
        double by = 0;
        try {
          by = difference<Dim>(loser, winner, setup.mesh.point(v), setup.time, resolved);
        } catch (const InputError&) {  // the step that asks for it says so
          continue;
        }
        if (!(by > 0)) continue;
        Contradiction& here = all[{loser.tag, winner.tag}];
        ++here.vertices;
        if (by > here.by) here = {here.vertices, v, by};
      }
  for (const auto& [ids, here] : all) {
    const std::string winner = set_text(setup.names.surfaces, ids.second);
    found.push_back(fmt::format(
        "the Dirichlet conditions of the ids {} and {} contradict each other at {} vertices that both hold, by up to {} at "
        "{}: that of {} counts there",
        set_text(setup.names.surfaces, ids.first), winner, here.vertices, setup.units.text(here.by, "m", 3),
        point_text<Dim>(setup.mesh.rest(here.worst), setup.units, 4), winner));
  }
}

template void find_contradictions(const Setup<2>&, std::vector<std::string>&);
template void find_contradictions(const Setup<3>&, std::vector<std::string>&);

}  // namespace itr
