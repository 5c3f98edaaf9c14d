// SPDX-License-Identifier: MIT
#include "itr/itr.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <set>

#include "arrays.hpp"
#include "core/parallel.hpp"
#include "energy/energy.hpp"
#include "energy/rigid_body.hpp"
#include "fem/cell_set.hpp"
#include "fem/locator.hpp"
#include "host_term.hpp"
#include "itr/energy.hpp"
#include "named_parts.hpp"
#include "simulation/cell_stress.hpp"
#include "simulation/contact_pressure.hpp"
#include "simulation/force_target.hpp"
#include "simulation/resultant.hpp"

namespace itr {

namespace {

/// `place` is for its errors.
template <int Dim, int Components>
std::function<Vec<Components>(const Vec<Dim>& X, double t)> as_function(std::string place, HostFunction f) {
  if (!f) return nullptr;
  return [place = std::move(place), f = std::move(f)](const Vec<Dim>& X, double t) {
    Vec<Components> value = Vec<Components>::Zero();
    f(X.data(), t, value.data());
    if (!value.allFinite())
      refuse(fmt::format("{} at X = ({}), t = {}", place, fmt::join(X, ", "), t), fmt::format("{}", fmt::join(value, ", ")),
             "finite numbers");
    return value;
  };
}
template <int Dim>
SpaceTimeFunction<Dim> as_vector(std::string place, HostFunction f) {
  return as_function<Dim, Dim>(std::move(place), std::move(f));
}

std::string of(const std::string& quantity, const std::string& part) { return quantity + " of '" + part + "'"; }

template <int Dim>
VectorX rest_of(const Mesh<Dim>& mesh) {
  const std::vector<Vec<Dim>>& nodes = mesh.rest();
  VectorX X(Dim * static_cast<Eigen::Index>(nodes.size()));
  for (std::size_t i = 0; i < nodes.size(); ++i) vertex_of<Dim>(X, static_cast<int>(i)) = nodes[i];
  return X;
}

/// Puts a condition in the place of the one with its tag; a null one goes.
template <typename Condition>
void replace(std::vector<Condition>& conditions, Condition condition, bool is_null) {
  std::erase_if(conditions, [&](const Condition& c) { return c.tag == condition.tag; });
  if (!is_null) conditions.push_back(std::move(condition));
}

}  // namespace

struct AnySimulation::Impl {
  /// Simulation and locators of one dimension.
  template <int Dim>
  struct Of {
    Simulation<Dim> simulation;
    std::map<int, std::shared_ptr<const Locator<Dim>>> locators;  ///< by body; kNone: of the whole mesh
    std::uint64_t locator_revision = 0;                           ///< of the mesh that they are of
    std::map<std::string, std::vector<int>> obstacle_vertices;
    std::map<std::string, std::size_t> term_places;  ///< in Setup::terms

    const Mesh<Dim>& mesh() const { return simulation.mesh(); }
    /// Also what a simulation that `remeshes` may curve later, be its mesh frozen now or not.
    void refuse_curved(const std::string& place, bool remeshes) const {
      if (mesh().has_nodes()) refuse(place, "curved edges", "a mesh with straight edges alone (discr_order 1)");
      if (remeshes && simulation.setup().remesh.curve.enabled)
        refuse(place, "/space/remesh/curve/enabled", "a mesh of which the edges stay straight");
    }
    /// Finds cells of a body, as others may have the same points at rest; kNone: of all.
    const std::shared_ptr<const Locator<Dim>>& locator_of(int body) {
      if (locator_revision != mesh().revision()) locators.clear();
      locator_revision = mesh().revision();
      auto& locator = locators[body];
      if (locator) return locator;
      std::vector<CellId> cells;
      for (const CellId c : mesh().live_cells())
        if (body == kNone || mesh().body(c) == body) cells.push_back(c);
      return locator = std::make_shared<Locator<Dim>>(mesh(), cells);
    }
    template <int Components = Dim>
    void check_nodal(const std::string& name, std::span<const double> values) const {
      const auto by_node = static_cast<std::size_t>(Components * mesh().num_nodes());
      const bool is_by_node = values.size() == by_node;
      check_array(name, values, is_by_node ? by_node : static_cast<std::size_t>(Components * mesh().num_vertices()));
    }
    /// Makes the function of values by vertex, linear on the cells of the present mesh, or by node, quadratic along its
    /// curved edges.
    template <int Components = Dim>
    std::function<Vec<Components>(const RestPoint<Dim>& X, double t)> nodal(const std::string& name,
                                                                            std::span<const double> values,
                                                                            int body = kNone) {
      check_nodal<Components>(name, values);
      return [f = nodal_function<Dim>(locator_of(body), as_field(values), Components)](const RestPoint<Dim>& X, double) {
        return Vec<Components>(f(X));
      };
    }
    /// Puts a term in the place of the one of its name; a null one goes.
    void set_term(const std::string& name, TermFactory<Dim> term) {
      auto& terms = simulation.conditions().terms;
      const auto place = term_places.find(name);
      if (term && place != term_places.end()) {
        terms.at(place->second) = std::move(term);
      } else if (term) {
        term_places.emplace(name, terms.size());
        terms.push_back(std::move(term));
      } else if (place != term_places.end()) {
        const std::size_t gone = place->second;
        terms.erase(terms.begin() + static_cast<std::ptrdiff_t>(gone));
        term_places.erase(place);
        for (auto& [other, index] : term_places) index -= index > gone;
      }
    }
  };

  std::shared_ptr<linear::Registry> registry;
  std::vector<std::string> warnings;  ///< before `of`, which fills it
  NamedParts parts;
  std::variant<Of<2>, Of<3>> of;
  bool remeshes = false;
  int max_threads = 0;

  template <int Dim>
  static Of<Dim> make(const Model& model, linear::Registry& registry, const Logger& logger,
                      std::vector<std::string>& warnings) {
    Setup<Dim> setup = model.setup<Dim>(warnings);
    return {Simulation<Dim>(std::move(setup), registry, logger), {}, 0, {}, {}};
  }
  using Either = std::variant<Of<2>, Of<3>>;

  template <typename F>
  decltype(auto) visit(F&& f) {
    return std::visit(std::forward<F>(f), of);
  }
  template <typename F>
  decltype(auto) visit(F&& f) const {
    return std::visit(std::forward<F>(f), of);
  }

  Impl(const Model& model, const Logger& logger, std::shared_ptr<linear::Registry> given)
      : registry(given ? std::move(given) : std::make_shared<linear::Registry>()),
        of(model.dimension_ == 2 ? Either(make<2>(model, *registry, logger, warnings))
                                 : Either(make<3>(model, *registry, logger, warnings))),
        max_threads(model.max_threads()) {
    std::map<std::string, std::vector<int>> boundaries;
    visit([&](auto& d) {
      const auto& tags = d.simulation.setup().names.surfaces;
      for (const auto& part : model.boundaries_)
        boundaries[part.name] = tags.contains(part.name) ? tags.at(part.name) : std::vector{part.id};
    });
    scene::PartNames named = model.scene_ ? model.scene_->parts : scene::PartNames();
    if (!model.scene_) named.bodies = model.body_names_;
    int first = 0;
    for (const auto& part : model.obstacles_) {
      const int count = static_cast<int>(part.vertices.size()) / model.dimension_;
      std::vector<int> vertices(count);
      std::iota(vertices.begin(), vertices.end(), first);
      visit([&](auto& d) { d.obstacle_vertices[part.name] = vertices; });
      named.obstacles[part.name] = named.obstacles_by_id[part.id] = std::move(vertices);
      first += count;
    }
    visit([&](auto& d) {
      remeshes = d.simulation.setup().remesh.enabled;
      parts = NamedParts(d.mesh(), boundaries, named, model.scene_.has_value());
    });
  }

  Resultants sum(ForceTarget target, std::span<const double> about) const;

  template <typename D>
  static const std::vector<int>& obstacle(const D& d, const std::string& name) {
    const auto found = d.obstacle_vertices.find(name);
    if (found != d.obstacle_vertices.end()) return found->second;
    std::string known;
    for (const auto& [other, ignored] : d.obstacle_vertices) known += (known.empty() ? "'" : ", '") + other + "'";
    refuse("obstacle", "'" + name + "'", known.empty() ? "none: the model has none that it added" : known);
  }
};

AnySimulation::AnySimulation(const Model& model, Logger logger, std::shared_ptr<linear::Registry> registry)
    : impl_(std::make_unique<Impl>(model, logger, std::move(registry))) {
  for (const std::string& warning : impl_->warnings) logger.warning(warning);
}
AnySimulation::~AnySimulation() = default;
AnySimulation::AnySimulation(AnySimulation&&) noexcept = default;

int AnySimulation::dimension() const { return impl_->of.index() == 0 ? 2 : 3; }

template <>
Simulation<2>& AnySimulation::as<2>() {
  return std::get<0>(impl_->of).simulation;
}
template <>
Simulation<3>& AnySimulation::as<3>() {
  return std::get<1>(impl_->of).simulation;
}

StepResult AnySimulation::step(double dt) {
  std::optional<ThreadLimit> limit;
  if (impl_->max_threads > 0) limit.emplace(impl_->max_threads);
  return impl_->visit([&](auto& d) { return dt == 0 ? d.simulation.advance() : d.simulation.advance(dt); });
}

StepResult AnySimulation::adapt(double dt) {
  std::optional<ThreadLimit> limit;
  if (impl_->max_threads > 0) limit.emplace(impl_->max_threads);
  return impl_->visit([&](auto& d) { return d.simulation.adapt(dt); });
}

double AnySimulation::step_length() const {
  return impl_->visit([](const auto& d) { return d.simulation.setup().time.dt; });
}
double AnySimulation::time() const {
  return impl_->visit([](const auto& d) { return d.simulation.time(); });
}
int AnySimulation::steps() const {
  return impl_->visit([](const auto& d) { return d.simulation.steps(); });
}
bool AnySimulation::finished() const {
  return impl_->visit([](const auto& d) { return d.simulation.finished(); });
}
const StepReport& AnySimulation::report() const {
  return impl_->visit([](const auto& d) -> const StepReport& { return d.simulation.report(); });
}
const std::vector<std::string>& AnySimulation::warnings() const { return impl_->warnings; }

namespace {

template <int Dim>
void hold(Setup<Dim>& setup, int tag, std::span<const int> mask, SpaceTimeFunction<Dim> displacement) {
  if (mask.size() != Dim) refuse("mask", fmt::format("{} numbers", mask.size()), std::to_string(Dim));
  DirichletCondition<Dim> condition{tag, {}, std::move(displacement)};
  for (int c = 0; c < Dim; ++c) condition.components[c] = mask[c] != 0;
  const bool is_free = std::none_of(mask.begin(), mask.end(), [](int flag) { return flag != 0; });
  if (!is_free && !condition.displacement) refuse("displacement", "no function", "one of position and time");
  replace(setup.dirichlet, std::move(condition), is_free);
}

}  // namespace

void AnySimulation::fix(const std::string& boundary, std::span<const int> mask, HostFunction displacement) {
  const std::vector<int> tags = impl_->parts.tags(boundary);
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    const SpaceTimeFunction<Dim> function = as_vector<Dim>(of("displacement", boundary), std::move(displacement));
    for (const int tag : tags) hold<Dim>(d.simulation.conditions(), tag, mask, function);
  });
}

void AnySimulation::fix(const std::string& boundary, std::span<const int> mask, std::span<const double> displacements) {
  const std::vector<int> tags = impl_->parts.tags(boundary);
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    const SpaceTimeFunction<Dim> function = d.nodal("displacements", displacements);
    for (const int tag : tags) hold<Dim>(d.simulation.conditions(), tag, mask, function);
  });
}

void AnySimulation::set_traction(const std::string& boundary, HostFunction traction) {
  const std::vector<int> tags = impl_->parts.tags(boundary);
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    const SpaceTimeFunction<Dim> function = as_vector<Dim>(of("traction", boundary), std::move(traction));
    for (const int tag : tags) replace(d.simulation.conditions().neumann, {tag, function}, !function);
  });
}

void AnySimulation::set_traction(const std::string& boundary, std::span<const double> tractions) {
  const std::vector<int> tags = impl_->parts.tags(boundary);
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    const SpaceTimeFunction<Dim> function = d.nodal("tractions", tractions);
    for (const int tag : tags) replace(d.simulation.conditions().neumann, {tag, function}, false);
  });
}

void AnySimulation::set_pressure(const std::string& boundary, HostFunction pressure) {
  const std::vector<int> tags = impl_->parts.tags(boundary);
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    const bool is_null = !pressure;
    const auto value = as_function<Dim, 1>(of("pressure", boundary), std::move(pressure));
    for (const int tag : tags)
      replace(d.simulation.conditions().pressure, {tag, [=](const Vec<Dim>& X, double t) { return value(X, t)[0]; }},
              is_null);
  });
}

void AnySimulation::set_pressure(const std::string& boundary, std::span<const double> pressures) {
  const std::vector<int> tags = impl_->parts.tags(boundary);
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    const auto value = d.template nodal<1>("pressures", pressures);
    for (const int tag : tags)
      replace(d.simulation.conditions().pressure, {tag, [=](const RestPoint<Dim>& X, double t) { return value(X, t)[0]; }},
              false);
  });
}

void AnySimulation::set_acceleration(HostFunction acceleration) {
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    d.simulation.conditions().body_acceleration = as_vector<Dim>("acceleration", std::move(acceleration));
  });
}

void AnySimulation::set_acceleration(std::span<const double> accelerations) {
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    d.simulation.conditions().body_acceleration = d.nodal("accelerations", accelerations);
  });
}

void AnySimulation::set_eigenstrain(std::span<const double> strains) {
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    if (!strains.empty()) d.template check_nodal<1>("strains", strains);
    std::set<int> bodies;
    for (const CellId c : d.mesh().live_cells()) bodies.insert(d.mesh().body(c));
    for (auto& [body, material] : d.simulation.conditions().materials) {
      if (rigid_body_of(material) || !bodies.contains(body)) continue;
      Eigenstrain eigenstrain;
      if (!strains.empty())
        eigenstrain = [strain = d.template nodal<1>("strains", strains, body)](const Vec<3>& X, double t) -> Mat<3> {
          return strain(Vec<Dim>(X.head<Dim>()), t)[0] * Mat<3>::Identity();
        };
      material.eigenstrain = std::move(eigenstrain);
      material.eigenstrain_varies = !strains.empty();
    }
  });
}

namespace {

/// Drops motions that no vertex has any more.
template <int Dim>
void tidy(Obstacles<Dim>& obstacles) {
  std::vector<int> place(obstacles.motions.size(), kNone);
  std::vector<SpaceTimeFunction<Dim>> used;
  for (int& motion : obstacles.motion) {
    if (motion == kNone) continue;
    if (place[motion] == kNone) {
      place[motion] = static_cast<int>(used.size());
      used.push_back(std::move(obstacles.motions[motion]));
    }
    motion = place[motion];
  }
  obstacles.motions = std::move(used);
}

}  // namespace

void AnySimulation::move_obstacle(const std::string& obstacle, HostFunction displacement) {
  if (!displacement) refuse("displacement", "no function", "one of position and time");
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    const std::vector<int>& vertices = Impl::obstacle(d, obstacle);
    auto& obstacles = d.simulation.conditions().obstacles;
    for (const int v : vertices) obstacles.motion[v] = static_cast<int>(obstacles.motions.size());
    obstacles.motions.push_back(as_vector<Dim>(of("displacement", obstacle), std::move(displacement)));
    tidy(obstacles);
  });
}

void AnySimulation::move_obstacle(const std::string& obstacle, std::span<const double> positions) {
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    const std::vector<int>& vertices = Impl::obstacle(d, obstacle);
    check_array("positions", positions, Dim * vertices.size());
    auto& obstacles = d.simulation.conditions().obstacles;
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      const Vec<Dim> motion = Eigen::Map<const Vec<Dim>>(positions.data() + Dim * i) - obstacles.rest[vertices[i]];
      obstacles.motion[vertices[i]] = static_cast<int>(obstacles.motions.size());
      obstacles.motions.push_back([motion](const Vec<Dim>&, double) { return motion; });
    }
    tidy(obstacles);
  });
}

void AnySimulation::set_forces(std::span<const double> forces) {
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    if (!forces.empty()) check_array("forces", forces, static_cast<std::size_t>(Dim * num_nodes()));
    d.set_term("", forces.empty() ? nullptr : point_forces<Dim>(d.mesh(), as_field(forces)));
  });
}

void AnySimulation::set_term(const std::string& name, HostTerm term) {
  if (name.empty()) refuse("name", "an empty one", "the name of a term");
  const bool is_null = !term.energy && !term.add_gradient && !term.add_hessian;
  if (!is_null && !(term.energy && term.add_gradient && term.add_hessian))
    refuse("term '" + name + "'", "only some of its functions", "energy, gradient and Hessian");
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    if (!is_null) d.refuse_curved("term '" + name + "'", impl_->remeshes);
    d.set_term(name, is_null ? nullptr : as_factory<Dim>(std::make_shared<const HostTerm>(std::move(term)), name));
  });
}

void AnySimulation::set_follower_forces(ForceFunction forces, StiffnessFunction stiffness) {
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    if (forces) d.refuse_curved("follower forces", impl_->remeshes);
    FollowerForces<Dim>& follower = d.simulation.conditions().follower;
    follower = {};
    if (forces)
      follower.forces = [f = std::move(forces)](const Mesh<Dim>& mesh, ConstVectorView x, double t, VectorView result) {
        f(rest_of(mesh), x, t, result);
        check_finite("follower forces", {result.data(), static_cast<std::size_t>(result.size())});
      };
    if (stiffness)
      follower.stiffness = [f = std::move(stiffness)](const Mesh<Dim>& mesh, ConstVectorView x, double t,
                                                      const StiffnessReceiver& add) {
        f(rest_of(mesh), x, t, [&](std::span<const int> vertices, const double* block) {
          const std::size_t side = Dim * vertices.size();
          check_block("follower stiffness", vertices, {block, side * side}, mesh.num_nodes());
          add(vertices, block);
        });
      };
  });
}

void AnySimulation::set_velocities(std::span<const double> velocities) {
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    check_array("velocities", velocities, static_cast<std::size_t>(Dim * num_nodes()));
    State<Dim> state = d.simulation.state();
    state.history.v[0].head(static_cast<Eigen::Index>(velocities.size())) = as_field(velocities);
    d.simulation.restore(std::move(state));
  });
}

void AnySimulation::freeze_mesh(bool frozen) {
  impl_->visit([&](auto& d) { d.simulation.conditions().remesh.enabled = impl_->remeshes && !frozen; });
}

int AnySimulation::num_vertices() const {
  return impl_->visit([](const auto& d) { return d.mesh().num_vertices(); });
}
int AnySimulation::num_nodes() const {
  return impl_->visit([](const auto& d) { return d.mesh().num_nodes(); });
}
std::vector<int> AnySimulation::curved_edges() const {
  return impl_->visit([](const auto& d) {
    const std::vector<EdgeKey> edges = d.mesh().curved_edges();
    return joined(
        static_cast<int>(edges.size()), [&](int i) -> auto& { return edges[i]; });
  });
}
int AnySimulation::num_cells() const {
  return impl_->visit([](const auto& d) { return d.mesh().num_cells(); });
}
int AnySimulation::num_facets() const {
  return impl_->visit([](const auto& d) { return d.mesh().num_facets(); });
}
std::span<const double> AnySimulation::positions() const {
  return impl_->visit([&](const auto& d) {
    return std::span(d.simulation.state().history.x[0].data(), static_cast<std::size_t>(dimension() * num_nodes()));
  });
}
std::span<const double> AnySimulation::velocities() const {
  return impl_->visit([&](const auto& d) {
    return std::span(d.simulation.state().history.v[0].data(), static_cast<std::size_t>(dimension() * num_nodes()));
  });
}
std::vector<double> AnySimulation::rest_positions() const {
  return impl_->visit([](const auto& d) {
    const VectorX X = rest_of(d.mesh());
    return std::vector<double>(X.begin(), X.end());
  });
}

std::vector<int> AnySimulation::cells() const {
  return impl_->visit([](const auto& d) {
    return joined(
        d.mesh().cell_slots(), [&](CellId c) -> auto& { return d.mesh().cell(c); });
  });
}
std::vector<int> AnySimulation::bodies() const {
  return impl_->visit(
      [](const auto& d) { return listed(d.mesh().cell_slots(), [&](CellId c) { return d.mesh().body(c); }); });
}
std::vector<int> AnySimulation::facets() const {
  return impl_->visit([](const auto& d) {
    return joined(
        d.mesh().facet_slots(), [&](FacetId f) -> auto& { return d.mesh().facet(f); });
  });
}
std::vector<int> AnySimulation::facet_boundaries() const {
  return impl_->visit([](const auto& d) {
    return listed(d.mesh().facet_slots(), [&](FacetId f) {
      const int tag = d.mesh().facet_tag(f);
      return tag == kNoTag ? -1 : tag;
    });
  });
}
std::vector<double> AnySimulation::obstacle_positions() const {
  return impl_->visit([&](const auto& d) {
    const VectorX& x = d.simulation.state().history.x[0];
    return std::vector<double>(x.begin() + dimension() * num_nodes(), x.end());
  });
}

void AnySimulation::watch_forces(bool watched) {
  impl_->visit([&](auto& d) {
    FieldOptions& fields = d.simulation.conditions().fields;
    fields.contact_forces = fields.friction_forces = fields.reaction_forces = fields.applied_forces = watched;
  });
}
const NodalForces& AnySimulation::forces() const {
  return impl_->visit([](const auto& d) -> const NodalForces& { return d.simulation.forces(); });
}

AnySimulation::Resultants AnySimulation::Impl::sum(ForceTarget target, std::span<const double> about) const {
  return visit([&]<int Dim>(const Of<Dim>& d) {
    check_array("about", about, Dim);
    std::copy(about.begin(), about.end(), target.about.begin());
    if (d.simulation.forces().contact.size() == 0) refuse("forces", "none", "forces that are watched, and a step since");
    const auto sum = sum_forces<Dim>(d.simulation.state(), d.simulation.forces(), target).all;
    return Resultants{{sum.force.begin(), sum.force.end()}, {sum.moment.begin(), sum.moment.end()}};
  });
}
AnySimulation::Resultants AnySimulation::resultant(std::span<const std::string> parts, std::span<const double> about) const {
  return impl_->sum(impl_->parts.target(parts), about);
}
AnySimulation::Resultants AnySimulation::resultant(const std::string& part) const {
  const std::array<double, 3> origin{};
  return resultant(std::span(&part, 1), std::span(origin).first(static_cast<std::size_t>(dimension())));
}
AnySimulation::Resultants AnySimulation::resultant(int id, std::span<const double> about) const {
  const std::array<double, 3> origin{};
  return impl_->sum(impl_->parts.target(id),
                    about.empty() ? std::span(origin).first(static_cast<std::size_t>(dimension())) : about);
}

std::vector<double> AnySimulation::contact_pressure() const {
  return impl_->visit([]<int Dim>(const Impl::Of<Dim>& d) {
    const VectorX& contact = d.simulation.forces().contact;
    if (contact.size() == 0) refuse("forces", "none", "forces that are watched, and a step since");
    const VectorX pressure = itr::contact_pressure<Dim>(d.simulation.setup(), d.mesh(), d.simulation.positions(), contact);
    return std::vector<double>(pressure.begin(), pressure.end());
  });
}
std::vector<double> AnySimulation::elastic_density() const {
  std::vector<double> values;
  impl_->visit([&](const auto& d) { d.simulation.observe([&](const auto& frame) { values = frame.elastic_density; }); });
  return values;
}
std::vector<double> AnySimulation::von_mises() const {
  std::vector<double> values;
  impl_->visit([&](const auto& d) { values = cell_stress(d.simulation).von_mises; });
  return values;
}
std::vector<double> AnySimulation::stress() const {
  std::vector<double> values;
  impl_->visit([&](const auto& d) { values = cell_stress(d.simulation).cauchy; });
  return values;
}
AnySimulation::Saved AnySimulation::save() const {
  return impl_->visit([](const auto& d) { return Saved(d.simulation.save()); });
}
void AnySimulation::restore(const Saved& saved) {
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    const auto* snapshot = std::get_if<Snapshot<Dim>>(&saved);
    if (!snapshot) refuse("saved state", "one of another simulation", "one that this simulation has saved");
    d.simulation.restore(*snapshot);
  });
}

void AnySimulation::on_iteration(std::function<bool(const NewtonProgress&)> listener) {
  impl_->visit([&](auto& d) { d.simulation.conditions().on_iteration = std::move(listener); });
}

void AnySimulation::on_mesh_change(std::function<void(const AnyMeshChange&)> listener) {
  impl_->visit([&]<int Dim>(Impl::Of<Dim>& d) {
    if (!listener) return d.simulation.on_mesh_change(nullptr);
    // The simulation may be moved, its implementation not.
    d.simulation.on_mesh_change(
        [listener = std::move(listener), &d](const MeshChange<Dim>& change, const Mesh<Dim>& before) {
          const auto call = std::make_shared<char>();  // ends with this one
          listener({change.vertex, change.cell, change.facet, change.facet_parent, change.interpolation,
                    [&d, &change, &before, call = std::weak_ptr(call)](const MatrixX& fields) {
                      if (call.expired())
                        refuse("project", "a call after that of the listener", "one from inside of the listener");
                      if (fields.rows() != before.num_vertices())
                        refuse("fields", fmt::format("{} rows", fields.rows()),
                               fmt::format("{}, one a vertex of the mesh before", before.num_vertices()));
                      return project_fields(before, d.mesh(), change, fields);
                    }});
        });
  });
}

}  // namespace itr
