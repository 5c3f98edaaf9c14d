// SPDX-License-Identifier: MIT
#include "diagnosis.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <sstream>
#include <string_view>

#include "fem/quadrature.hpp"
#include "geometry/rotation.hpp"
#include "simulation/held_turn.hpp"
#include "simulation/named.hpp"

namespace itr {

namespace {

std::span<const int> vertices_of(const ContactStencil& stencil) {
  return {stencil.vertices.data(), static_cast<std::size_t>(stencil.size())};
}

bool has(std::span<const int> vertices, int vertex) {
  return std::find(vertices.begin(), vertices.end(), vertex) != vertices.end();
}

template <int Dim>
Vec<Dim> middle_of(std::span<const int> vertices, const VectorX& x) {
  Vec<Dim> middle = Vec<Dim>::Zero();
  for (const int v : vertices) middle += x.template segment<Dim>(Dim * v) / static_cast<double>(vertices.size());
  return middle;
}

/// Between the closest points of a pair.
template <int Dim>
Vec<Dim> place_of_pair(PairKind kind, std::span<const int> vertices, const VectorX& x) {
  std::array<Vec<Dim>, 4> positions, closest;
  for (std::size_t i = 0; i < vertices.size(); ++i) positions[i] = x.template segment<Dim>(Dim * vertices[i]);
  const ClosestFeatures features = closest_features<Dim>(kind, positions.data());
  for (int i = 0; i < pair_size(features.kind); ++i) closest[i] = positions[features.local[i]];
  const PairDistance<Dim> distance = pair_distance<Dim>(features.kind, closest.data());
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (int i = 0; i < pair_size(features.kind); ++i) sum += std::abs(distance.coefficients[i]) * closest[i];
  return sum / distance.coefficients.template lpNorm<1>();
}

PairKind kind_of_pair(const StepLimit& limit) {
  if (limit.vertices.size() == 3) return PairKind::edge_vertex;
  if (limit.vertices.size() == 2) return PairKind::vertex_vertex;
  return limit.kind == "edge-edge pair" ? PairKind::edge_edge : PairKind::face_vertex;
}

/// The least det F of an element at x.
template <int Dim>
double volume_ratio(const typename CellSet<Dim>::Element& element, const VectorX& x) {
  if (!element.curved) return deformation_gradient<Dim>(element, x).determinant();
  double least = std::numeric_limits<double>::infinity();
  const auto nodes = at_nodes<Dim>(element.nodes(), x);
  for (const auto& point : closed_quadrature<Dim>(1))
    least = std::min(least, Mat<Dim>(nodes * shape_gradients<Dim>(element, point.weights).transpose()).determinant());
  return least;
}

/// The name of a law whose forces stay finite where a cell becomes flat; null: they do not, or may not.
const char* law_that_gives_way(const Material& material) {
  switch (material.law) {
    case MaterialLaw::linear:
      return "linear elasticity";
    case MaterialLaw::saint_venant_kirchhoff:
      return "SaintVenant";
    case MaterialLaw::fixed_corotated:
      return "FixedCorotational";
    default:
      return nullptr;
  }
}

template <int Dim>
class Diagnosis {
 public:
  Diagnosis(const SolveScope<Dim>& scope, const VectorX& x, Workspace& workspace)
      : scope_(scope), x_(x), on_surface_(scope.surface.positions(x)), workspace_(workspace) {}

  void name_limit_of(const VectorX& step, std::string_view which = "the last") {
    double fraction = 1;
    const std::string limit = limit_of(step, fraction);
    if (!limit.empty()) text_ << "; " << fraction << " of " << which << " Newton step is free, limited " << limit;
  }
  /// "by the vertex-edge pair 3 4 5 near (0.1, 0.2) m"; empty where the step is free.
  std::string limit_of(const VectorX& step, double& fraction) {
    const StepLimit cell = scope_.potential.elastic()->step_limit(x_, step);
    StepLimit pair;
    if (contact()) pair = contact()->step_limit(on_surface_, scope_.surface.motion(step), workspace_);
    const bool is_pair = pair.step < cell.step;
    const StepLimit& limit = is_pair ? pair : cell;
    fraction = limit.step;
    if (limit.step >= 1) return {};
    return std::string("by the ") + std::string(limit.kind) + ' ' +
           (is_pair ? named_pair(kind_of_pair(limit), limit.vertices) : named_cell(limit.vertices));
  }
  void name_residual_at(int vertex, const EnergySum& sum) {
    Vec<Dim> total = Vec<Dim>::Zero();
    double largest = -1;
    std::string_view name;
    for (const auto& term : sum.terms()) {
      VectorX gradient = VectorX::Zero(x_.size());
      term->add_gradient(x_, gradient, workspace_);
      const Vec<Dim> force = gradient.template segment<Dim>(Dim * vertex) / scope_.scaling;
      total += force;
      if (force.norm() <= largest) continue;
      largest = force.norm();
      name = term->name();
    }
    text_ << "; the largest residual, " << scope_.units.text(total.norm(), "N") << ", is at vertex "
          << named_cell(std::array{vertex}) << ", where the largest force, " << scope_.units.text(largest, "N")
          << ", is that of the term '" << name << '\'';
  }
  void name_worst_cell_at(int vertex) {
    double least = std::numeric_limits<double>::infinity();
    std::span<const int> worst;
    for (const auto& element : scope_.cells.elements) {
      bool has_it = false;
      for_each_node(element, [&](int node) { has_it = has_it || node == vertex; });
      if (!has_it) continue;
      const double ratio = volume_ratio<Dim>(element, x_);
      if (!(ratio < least)) continue;
      least = ratio;
      worst = element.vertices;
    }
    if (!worst.empty()) text_ << "; its cell " << named_cell(worst) << " has the volume ratio " << least;
  }
  void name_nearest_pair_at(int vertex) {
    if (!contact()) return;
    const auto acts_on_it = [&](std::span<const int> pair) {
      const auto* map = scope_.surface.map.get();
      if (!map) return has(pair, vertex);
      return std::any_of(pair.begin(), pair.end(), [&](int w) { return has(map->sources(w), vertex); });
    };
    double least = std::numeric_limits<double>::infinity();
    ContactStencil nearest{};
    for (const ContactStencil& stencil : contact()->active(on_surface_, workspace_)) {
      if (!acts_on_it(vertices_of(stencil))) continue;
      const double distance = std::sqrt(contact()->distance(stencil, on_surface_).squared);
      if (distance >= least) continue;
      least = distance;
      nearest = stencil;
    }
    if (std::isfinite(least))
      text_ << "; its contact pair " << named_pair(nearest.kind, vertices_of(nearest)) << " has the distance "
            << scope_.units.text(least, "m");
  }
  /// Whether something in the bodies gives way that the loads press flat.
  std::string collapse() const {
    constexpr double kFlat = 0.01;
    double least = kFlat;
    const typename CellSet<Dim>::Element* flattest = nullptr;
    for (const auto& element : scope_.cells.elements) {
      if (!law_that_gives_way(scope_.materials.at(element.body))) continue;
      const double ratio = volume_ratio<Dim>(element, x_);
      if (!(ratio < least)) continue;
      least = ratio;
      flattest = &element;
    }
    if (!flattest) return {};
    return fmt::format(
        "cells are pressed flat, one near {} {} to {:.1g} of its volume, which {} does not resist by more than finite "
        "forces: "
        "the loads exceed what the body can carry; smaller loads, or NeoHookean, which resists",
        point_text<Dim>(middle_of<Dim>(flattest->vertices, x_), scope_.units, 4), scope_.units.length(), least,
        law_that_gives_way(scope_.materials.at(flattest->body)));
  }
  void append(const std::string& text) { text_ << text; }
  std::string text() const { return text_.str(); }

 private:
  /// "12 13 obstacle 4 near (0.1, 0.2) m": vertices at `positions`, the cells' (or, of a proxy's surface, "proxy 12").
  std::string named(std::span<const int> vertices, const VectorX& positions, const Vec<Dim>& place, const char* own) const {
    const int bodies = static_cast<int>(positions.size() / Dim) - scope_.num_obstacles;
    std::ostringstream text;
    for (const int v : vertices) text << (v < bodies ? own : "obstacle ") << (v < bodies ? v : v - bodies) << ' ';
    text << "near " << point_text<Dim>(place, scope_.units, 6) << ' ' << scope_.units.length();
    return text.str();
  }
  std::string named_cell(std::span<const int> vertices) const {
    return named(vertices, x_, middle_of<Dim>(vertices, x_), "");
  }
  std::string named_pair(PairKind kind, std::span<const int> vertices) const {
    return named(vertices, on_surface_, place_of_pair<Dim>(kind, vertices, on_surface_),
                 scope_.surface.is_proxy ? "proxy " : "");
  }
  const ContactEnergy<Dim>* contact() const { return scope_.potential.contact().get(); }

  const SolveScope<Dim>& scope_;
  const VectorX& x_;
  VectorX on_surface_;
  Workspace& workspace_;
  std::ostringstream text_;
};

}  // namespace

template <int Dim>
std::string diagnosis(const SolveScope<Dim>& scope, const NewtonSummary& summary, const EnergySum& sum, const VectorX& x,
                      Workspace& workspace) {
  Diagnosis<Dim> result(scope, x, workspace);
  const std::string collapse = result.collapse();
  const VectorX& step = summary.failed_step;
  if (step.size() == x.size() && step.allFinite()) result.name_limit_of(step);
  if (result.text().empty() && summary.blocked_step.size() == x.size()) {
    Diagnosis<Dim> earlier(scope, summary.blocked_from, workspace);  // the last step may be free, and lead nowhere
    earlier.name_limit_of(summary.blocked_step, "an earlier");
    result.append(earlier.text());
  }
  if (summary.worst_dof != kNone) {
    const int vertex = summary.worst_dof / Dim;
    result.name_residual_at(vertex, sum);
    result.name_worst_cell_at(vertex);
    result.name_nearest_pair_at(vertex);
  }
  return (collapse.empty() ? "" : "; " + collapse) + result.text();
}

template <int Dim>
bool is_crushed(const SolveScope<Dim>& scope, const NewtonSummary& summary, const VectorX& x) {
  constexpr double kNothing = 1e-10;
  if (!summary.converged()) return false;
  return std::ranges::any_of(scope.cells.elements, [&](const auto& element) {
    return law_that_gives_way(scope.materials.at(element.body)) && volume_ratio<Dim>(element, x) < kNothing;
  });
}

template <int Dim>
std::string describe_turn(const SolveScope<Dim>& scope, const Loads<Dim>& loads, const DofMap& dofs, ConstVectorView from,
                          ConstVectorView to, const VectorX& x) {
  constexpr double kLarge = 5;  // degrees
  if (std::string held = describe_large_turn<Dim>(scope.cells, dofs, from, to); !held.empty()) return held;
  if (loads.pressures.empty() && loads.cavities.empty()) return {};
  std::map<int, Mat<Dim>> sums;  // of F by body, by volume
  for (const auto& element : scope.cells.elements)
    if (scope.materials.at(element.body).law == MaterialLaw::linear)
      sums.try_emplace(element.body, Mat<Dim>(Mat<Dim>::Zero())).first->second +=
          element.volume * deformation_gradient<Dim>(element, x);
  double most = 0;
  for (const auto& [body, sum] : sums) most = std::max(most, rotation_angle(sum));
  if (!(most > kLarge)) return {};
  return fmt::format(
      "pressure turns a body of linear elasticity by {:.3g} degrees, and rotations stretch it without stress: there is no "
      "equilibrium near; NeoHookean or SaintVenant do not mind rotations, or hold the body against turning",
      most);
}

template <int Dim>
std::string describe_effort(const SolveScope<Dim>& scope, const NewtonSummary& summary, int rounds, Workspace& workspace) {
  std::ostringstream blocked, indefinite, text;
  blocked << summary.blocked << " went less than half of their step";
  if (summary.blocked_step.size() == summary.blocked_from.size() && summary.blocked_step.size() > 0) {
    double fraction = 1;
    const std::string limit =
        Diagnosis<Dim>(scope, summary.blocked_from, workspace).limit_of(summary.blocked_step, fraction);
    if (!limit.empty()) blocked << ", the last " << fraction << " of it, stopped " << limit;
  }
  indefinite << summary.indefinite << " met an indefinite Hessian";
  text << summary.iterations << " Newton iterations: "
       << (summary.blocked >= summary.indefinite ? blocked.str() + "; " + indefinite.str()
                                                 : indefinite.str() + "; " + blocked.str());
  if (rounds > 1) text << "; friction and what else is lagged took " << rounds << " solves";
  return text.str();
}

template std::string describe_effort<2>(const SolveScope<2>&, const NewtonSummary&, int, Workspace&);
template std::string describe_effort<3>(const SolveScope<3>&, const NewtonSummary&, int, Workspace&);
template bool is_crushed<2>(const SolveScope<2>&, const NewtonSummary&, const VectorX&);
template bool is_crushed<3>(const SolveScope<3>&, const NewtonSummary&, const VectorX&);
template std::string describe_turn<2>(const SolveScope<2>&, const Loads<2>&, const DofMap&, ConstVectorView, ConstVectorView,
                                      const VectorX&);
template std::string describe_turn<3>(const SolveScope<3>&, const Loads<3>&, const DofMap&, ConstVectorView, ConstVectorView,
                                      const VectorX&);
template std::string diagnosis<2>(const SolveScope<2>&, const NewtonSummary&, const EnergySum&, const VectorX&, Workspace&);
template std::string diagnosis<3>(const SolveScope<3>&, const NewtonSummary&, const EnergySum&, const VectorX&, Workspace&);

}  // namespace itr
