// SPDX-License-Identifier: MIT
#include "simulation/fluid_front.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <utility>

#include "geometry/measures.hpp"
#include "itr/core.hpp"
#include "mesh/facet_measure.hpp"
#include "mesh/facet_tags.hpp"
#include "simulation/contact_pressure.hpp"

namespace itr {

namespace {

constexpr double kOpen = 1e-3;    ///< of the critical pressure: contact of less is none
constexpr double kMargin = 0.05;  ///< of the fluid's pressure: contact that shuts a wet facet presses by more

template <int Dim>
std::array<Vec<Dim>, Dim> rest_of(const Mesh<Dim>& mesh, FacetId f) {
  std::array<Vec<Dim>, Dim> corners;
  for (int k = 0; k < Dim; ++k) corners[k] = mesh.rest(mesh.facet(f)[k]);
  return corners;
}

template <int Dim>
Vec<Dim> middle_of(const std::array<Vec<Dim>, Dim>& corners) {
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (const Vec<Dim>& corner : corners) sum += corner;
  return sum / Dim;
}

/// Calls visit(facet) for the facets that share an edge (2D: a vertex) with one.
template <typename Visit>
void for_each_neighbour(const Mesh<2>& mesh, FacetId f, const Visit& visit) {
  for (const VertexId v : mesh.facet(f))
    for (const FacetId other : mesh.facets_of(v))
      if (other != f) visit(other);
}
template <typename Visit>
void for_each_neighbour(const Mesh<3>& mesh, FacetId f, const Visit& visit) {
  const auto& corners = mesh.facet(f);
  for (int k = 0; k < 3; ++k)
    for (const FacetId other : mesh.facets_of_edge(edge_key(corners[k], corners[(k + 1) % 3])))
      if (other != f) visit(other);
}

/// The tag of a facet before the fluid wetted it.
int tag_without(const Fluid& fluid, int tag) {
  for (const auto& [before, wet] : fluid.wet)
    if (wet == tag) return before;
  return tag;
}

bool has(const std::vector<int>& tags, int tag) { return std::ranges::find(tags, tag) != tags.end(); }

/// The surface that a fluid may wet, on a mesh.
template <int Dim>
class FluidSurface {
 public:
  /// Follows the tags of the mesh, which must outlive this, as `setup` and its `fluid`.
  FluidSurface(const StepSetup<Dim>& setup, const Fluid& fluid, const Mesh<Dim>& mesh)
      : setup_(setup), fluid_(fluid), mesh_(mesh), tag_(mesh.facet_slots(), kNoTag) {
    for (const FacetId f : mesh.live_facets()) tag_[f] = tag_without_fluid(setup.fluids, mesh.facet_tag(f));
  }

  bool has(FacetId f) const { return fluid_.wet.contains(tag_[f]); }
  bool is_wet(FacetId f) const { return has(f) && mesh_.facet_tag(f) != tag_[f]; }
  bool is_dry(FacetId f) const { return has(f) && mesh_.facet_tag(f) == tag_[f]; }
  bool is_in(FacetId f, const std::vector<int>& tags) const { return itr::has(tags, tag_[f]); }
  /// Whether the fluid is there in any case.
  bool is_source(FacetId f) const { return is_in(f, fluid_.from); }
  int tag(FacetId f, bool wet) const { return wet ? fluid_.wet.at(tag_[f]) : tag_[f]; }

  /// By facet, whether it is wet and a way over wet facets leads to it from a source.
  std::vector<char> connected() const {
    std::vector<char> found(mesh_.facet_slots(), 0);
    spread(
        found, [&](FacetId f) { return is_wet(f); }, [](FacetId) { return true; });
    return found;
  }
  /// Adds facets to those that are `found`, from sources and from these on: all that `may_be` and that a facet touches from
  /// which the fluid `goes_on`. A fluid without a source is everywhere at once.
  template <typename MayBe, typename GoesOn>
  void spread(std::vector<char>& found, const MayBe& may_be, const GoesOn& goes_on) const {
    std::vector<FacetId> queue;
    for (const FacetId f : mesh_.live_facets()) {
      const bool begins = fluid_.from.empty() ? has(f) && may_be(f) : is_source(f);
      if (!begins && !found[f]) continue;
      if (has(f)) found[f] = 1;
      queue.push_back(f);
    }
    for (std::size_t i = 0; i < queue.size(); ++i)
      for_each_neighbour(mesh_, queue[i], [&](FacetId f) {
        if (found[f] || !has(f) || !may_be(f)) return;
        found[f] = 1;
        if (goes_on(f)) queue.push_back(f);
      });
  }

  /// Pressure of the fluid in the middle of a facet, where it is or comes to [Pa].
  double pressure(FacetId f, double t) const {
    const auto corners = rest_of(mesh_, f);
    const RestPoint<Dim> X(middle_of<Dim>(corners), inward_normal(corners), mesh_.part_of_vertex(mesh_.facet(f)[0]));
    double sum = 0;
    for (const auto& condition : setup_.pressure)
      if (condition.tag == tag(f, true)) sum += condition.pressure(X, t);
    return sum;
  }
  double critical_pressure(double pressure) const { return fluid_.critical_pressure.value_or(std::max(pressure, 0.0)); }
  /// At rest, up to a factor.
  double rest_area(FacetId f) const {
    return facet_measure(mesh_, f) * (mesh_.is_axisymmetric() ? middle_of<Dim>(rest_of(mesh_, f))[0] : 1);
  }

 private:
  const StepSetup<Dim>& setup_;
  const Fluid& fluid_;
  const Mesh<Dim>& mesh_;
  std::vector<int> tag_;  ///< by facet, as it is without any fluid
};

/// Leaves the facets that contact shuts, and those that are cut off from the source. Returns whether there are any.
template <int Dim>
bool dry(const FluidSurface<Dim>& surface, Mesh<Dim>& mesh, const std::vector<double>& contact, double t) {
  std::vector<FacetId> left;
  for (const FacetId f : mesh.live_facets()) {
    if (!surface.is_wet(f) || surface.is_source(f)) continue;
    const double pressure = surface.pressure(f, t);
    const double shuts = std::max(surface.critical_pressure(pressure) - pressure, 0.0) + kMargin * std::abs(pressure);
    if (contact[f] > shuts) left.push_back(f);
  }
  if (left.empty()) return false;
  for (const FacetId f : left) mesh.set_facet_tag(f, surface.tag(f, false));
  const std::vector<char> connected = surface.connected();
  for (const FacetId f : mesh.live_facets())
    if (surface.is_wet(f) && !connected[f]) mesh.set_facet_tag(f, surface.tag(f, false));
  return true;
}

/// Takes all open facets that the fluid comes to, and of those that are pressed by less than the critical pressure the next
/// ones: behind them the pressure is another once they are wet. Returns whether there are any.
template <int Dim>
bool wet(const FluidSurface<Dim>& surface, Mesh<Dim>& mesh, const std::vector<double>& contact, double t) {
  std::vector<char> may_be(mesh.facet_slots(), 0), is_open(mesh.facet_slots(), 0), found(mesh.facet_slots(), 0);
  for (const FacetId f : mesh.live_facets()) {
    if (!surface.has(f)) continue;
    const double critical = surface.critical_pressure(surface.pressure(f, t));
    may_be[f] = surface.is_wet(f) || contact[f] <= critical;
    is_open[f] = surface.is_wet(f) || contact[f] <= kOpen * critical;
  }
  surface.spread(
      found, [&](FacetId f) { return may_be[f] != 0; }, [&](FacetId f) { return is_open[f] != 0; });
  bool is_new = false;
  for (const FacetId f : mesh.live_facets()) {
    if (!found[f] || surface.is_wet(f)) continue;
    mesh.set_facet_tag(f, surface.tag(f, true));
    is_new = true;
  }
  return is_new;
}

/// Whether one of the facets with these tags is on the surface, or touches it.
template <int Dim>
bool touches(const FluidSurface<Dim>& surface, const Mesh<Dim>& mesh, const std::vector<int>& tags) {
  for (const FacetId f : mesh.live_facets()) {
    if (!surface.is_in(f, tags)) continue;
    bool is_on = surface.has(f);
    for_each_neighbour(mesh, f, [&](FacetId other) { is_on = is_on || surface.has(other); });
    if (is_on) return true;
  }
  return false;
}

/// Whether the fluid has come to a facet with these tags, or next to one.
template <int Dim>
bool has_reached(const FluidSurface<Dim>& surface, const Mesh<Dim>& mesh, const std::vector<int>& tags) {
  for (const FacetId f : mesh.live_facets()) {
    if (!surface.is_wet(f)) continue;
    bool is_there = surface.is_in(f, tags);
    for_each_neighbour(mesh, f, [&](FacetId other) { is_there = is_there || surface.is_in(other, tags); });
    if (is_there) return true;
  }
  return false;
}

}  // namespace

int tag_without_fluid(const std::vector<Fluid>& fluids, int tag) {
  for (const Fluid& fluid : fluids) tag = tag_without(fluid, tag);
  return tag;
}

template <int Dim>
std::set<int> known_tags(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh) {
  std::set<int> tags = facet_tags(mesh);
  for (const Fluid& fluid : setup.fluids)
    for (const auto& [before, wet] : fluid.wet) tags.insert({before, wet});
  return tags;
}

template <int Dim>
void wet_sources(const StepSetup<Dim>& setup, Mesh<Dim>& mesh) {
  for (const Fluid& fluid : setup.fluids) {
    const FluidSurface<Dim> surface(setup, fluid, mesh);
    for (const FacetId f : mesh.live_facets())
      if (surface.is_dry(f) && surface.is_source(f)) mesh.set_facet_tag(f, surface.tag(f, true));
  }
}

template <int Dim>
void refuse_idle_fluids(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh) {
  for (const Fluid& fluid : setup.fluids) {
    if (!setup.contact.enabled)
      throw InputError({"", fluid.place + "/penetrates", "true without contact, which nothing shuts",
                        "\"contact\": {\"enabled\": true}, or no such key"});
    const FluidSurface<Dim> surface(setup, fluid, mesh);
    for (const auto& [key, tags] : {std::pair{"/from", &fluid.from}, std::pair{"/leaks_to", &fluid.leaks_to}})
      if (!tags->empty() && !touches(surface, mesh, *tags))
        throw InputError({"", fluid.place + key, "a surface apart from the one that the fluid penetrates",
                          "a part of it, or a surface next to it"});
  }
}

template <int Dim>
bool FluidFront<Dim>::move(Mesh<Dim>& mesh, ConstVectorView x, ConstVectorView force) {
  bool has_moved = false;
  for (std::size_t i = 0; i < setup_.fluids.size(); ++i) {
    const FluidSurface<Dim> surface(setup_, setup_.fluids[i], mesh);
    const std::vector<double> contact =
        contact_pressure_on_facets<Dim>(mesh, x, force, [&](FacetId f) { return surface.is_dry(f); });
    bool moves = false;
    if (rounds_left_[i] > 0) {
      moves = dry(surface, mesh, contact, t_);
      rounds_left_[i] = moves ? rounds_left_[i] - 1 : 0;
    }
    moves = moves || wet(surface, mesh, contact, t_);
    has_moved = has_moved || moves;
  }
  return has_moved;
}

template <int Dim>
std::vector<std::string> report_fluids(const StepSetup<Dim>& setup, const Mesh<Dim>& before, const Mesh<Dim>& mesh, double t,
                                       StepReport& report) {
  std::vector<std::string> warnings;
  double wet = 0, all = 0;
  for (const Fluid& fluid : setup.fluids) {
    const FluidSurface<Dim> surface(setup, fluid, mesh);
    for (const FacetId f : mesh.live_facets()) {
      if (!surface.has(f)) continue;
      all += surface.rest_area(f);
      if (surface.is_wet(f)) wet += surface.rest_area(f);
    }
    if (!has_reached(surface, mesh, fluid.leaks_to)) continue;
    ++report.leaks;
    if (!has_reached(FluidSurface<Dim>(setup, fluid, before), before, fluid.leaks_to))
      warnings.push_back(fmt::format("the fluid of {} leaks from t = {} on: it has come to the surface of leaks_to",
                                     fluid.place, setup.units.text(t, "s")));
  }
  if (all > 0) report.wetted = wet / all;
  return warnings;
}

#define ITR_INSTANTIATE(Dim)                                                                                         \
  template std::set<int> known_tags(const StepSetup<Dim>&, const Mesh<Dim>&);                                        \
  template void wet_sources(const StepSetup<Dim>&, Mesh<Dim>&);                                                      \
  template void refuse_idle_fluids(const StepSetup<Dim>&, const Mesh<Dim>&);                                         \
  template class FluidFront<Dim>;                                                                                    \
  template std::vector<std::string> report_fluids(const StepSetup<Dim>&, const Mesh<Dim>&, const Mesh<Dim>&, double, \
                                                  StepReport&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
