// SPDX-License-Identifier: MIT
#include "simulation/overlap.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include "energy/elastic/elastic.hpp"
#include "energy/mapped.hpp"
#include "energy/polyfem/lagged_regularization.hpp"
#include "energy/rigid_body.hpp"
#include "itr/core.hpp"
#include "newton/newton.hpp"
#include "simulation/named.hpp"
#include "simulation/rigid_coordinates.hpp"
#include "simulation/sizes.hpp"
#include "simulation/solids.hpp"

namespace itr {

namespace {

constexpr int kDigits = 4;          ///< of lengths and places
constexpr double kNoDepth = 1e-6;   ///< of the thickness: bodies touch
constexpr double kDeepest = 0.5;    ///< of the thickness
constexpr double kTouching = 1e-3;  ///< of d-hat: what is nearer is pushed apart, too
constexpr double kGap = 0.5;        ///< of d-hat: between surfaces that are pushed apart
constexpr double kLargeSag = 0.1;   ///< of the depth: pressures are worth a warning
constexpr const char* kKey = "/contact/initial_overlap";

[[noreturn]] void refuse(const std::string& found, const std::string& expected) {
  throw InputError({"", kKey, "\"resolve\" with " + found, expected});
}

/// stiffness/2 max(0, gap - n . r)^2 of points and their feet on other surfaces, r between the two and n the way out.
template <int Dim>
class Parting final : public Energy {
 public:
  Parting(double gap, double stiffness) : gap_(gap), stiffness_(stiffness) {}

  void add(const FacetPoint<Dim>& point, const Nearest<Dim>& nearest) {
    Pair pair{{}, {}, nearest.normal};
    for (int k = 0; k < Dim; ++k) {
      pair.vertices[k] = point.vertices[k];
      pair.vertices[Dim + k] = nearest.foot.vertices[k];
      pair.coefficients[k] = point.weights[k];
      pair.coefficients[Dim + k] = -nearest.foot.weights[k];
    }
    pairs_.push_back(pair);
  }
  bool empty() const { return pairs_.empty(); }

  std::string_view name() const override { return "parting"; }
  double value(ConstVectorView y, Workspace&) const override {
    double sum = 0;
    for (const Pair& pair : pairs_) sum += stiffness_ / 2 * square(missing(pair, y));
    return sum;
  }
  void add_gradient(ConstVectorView y, VectorView gradient, Workspace&) const override {
    for (const Pair& pair : pairs_)
      for (int k = 0; k < 2 * Dim; ++k)
        gradient.segment<Dim>(Dim * pair.vertices[k]) -= stiffness_ * missing(pair, y) * pair.coefficients[k] * pair.normal;
  }
  void add_hessian(ConstVectorView y, PsdProjection, HessianSink& sink, Workspace&) const override {
    for (const Pair& pair : pairs_) {
      if (missing(pair, y) == 0) continue;
      Vec<2 * Dim * Dim> way;
      for (int k = 0; k < 2 * Dim; ++k) way.template segment<Dim>(Dim * k) = pair.coefficients[k] * pair.normal;
      const Mat<2 * Dim* Dim> block = stiffness_ * way * way.transpose();
      sink.add<Dim>(pair.vertices, block.data());
    }
  }

 private:
  struct Pair {
    std::array<int, 2 * Dim> vertices;
    std::array<double, 2 * Dim> coefficients;
    Vec<Dim> normal;
  };
  static double square(double x) { return x * x; }
  double missing(const Pair& pair, ConstVectorView y) const {
    double distance = 0;
    for (int k = 0; k < 2 * Dim; ++k)
      distance += pair.coefficients[k] * pair.normal.dot(y.segment<Dim>(Dim * pair.vertices[k]));
    return std::max(0.0, gap_ - distance);
  }

  double gap_, stiffness_;
  std::vector<Pair> pairs_;
};

/// The largest sag of facets that are in other solids or have these, below an arc through their corners [m].
template <int Dim>
double largest_sag(const Solids<Dim>& solids, ConstVectorView y) {
  std::set<std::array<int, Dim>> facets;
  solids.for_each_near(0, [&](const FacetPoint<Dim>& point, const Nearest<Dim>& nearest) {
    facets.insert(point.vertices);
    facets.insert(nearest.foot.vertices);
  });
  double largest = 0;
  for (const auto& ridge :
       smooth_ridges<Dim>({facets.begin(), facets.end()}, [&](int v) { return Vec<Dim>(y.segment<Dim>(Dim * v)); }))
    largest = std::max(largest, ridge.height * ridge.turn / 8);
  return largest;
}

template <int Dim>
class OverlapResolver {
 public:
  OverlapResolver(const StepTools<Dim>& tools, State<Dim>& state)
      : tools_(tools),
        setup_(tools.setup),
        state_(state),
        contact_(contact_surface(setup_, state.mesh, state.chords)),
        y_(contact_.positions(state.history.x[0])),
        solids_(find_solids(setup_, state.mesh, state.chords), y_) {}

  double resolve() {
    const std::vector<Penetration<Dim>> penetrations = solids_.penetrations();
    refuse_obstacles();
    for (const Penetration<Dim>& penetration : penetrations) {
      refuse_deep(penetration);
      if (is_rigid(penetration.solid) && is_rigid(penetration.in)) rigid_pair_ = describe(penetration);
    }
    refuse_self_crossing();
    bool is_touching = !penetrations.empty() || has_intersection<Dim>(contact_.surface, y_);
    solids_.for_each_near(kTouching * setup_.contact.dhat, [&](const auto&, const auto&) { is_touching = true; });
    if (!is_touching) return 0;
    push_apart();
    const StepReport report = settle();
    refuse_bent_bodies();
    const double energy = report.energy.elastic + report.energy.contact;
    tell(penetrations, energy);
    return energy;
  }

 private:
  std::string place(const Vec<Dim>& p) const {
    return fmt::format("at {} {}", point_text<Dim>(p, setup_.units, kDigits), setup_.units.length());
  }
  std::string name_of(const Solid<Dim>& solid) const {
    return solid.part == kNone ? "an obstacle" : fmt::format("body {}", solid.body);
  }

  void refuse_obstacles() const {
    if (const auto crossing = solids_.find_crossing_obstacles())
      refuse("obstacles that overlap, " + place(*crossing), "obstacles apart from each other: nothing moves them");
  }

  void refuse_deep(const Penetration<Dim>& penetration) const {
    const Solid<Dim>&one = solids_.all()[penetration.solid], &other = solids_.all()[penetration.in];
    if (penetration.is_whole)
      refuse(name_of(one) + " inside of " + name_of(other) + ", " + place(penetration.place), "bodies beside each other");
    const double thickness = std::min(one.thickness, other.thickness);
    if (penetration.depth <= kDeepest * thickness) return;
    refuse(describe(penetration),
           fmt::format("at most half of the smaller thickness, which is {}", setup_.units.text(thickness, "m", kDigits)));
  }

  std::string describe(const Penetration<Dim>& penetration) const {
    return fmt::format("an overlap of {} and {} of {}, {}", name_of(solids_.all()[penetration.solid]),
                       name_of(solids_.all()[penetration.in]), setup_.units.text(penetration.depth, "m", kDigits),
                       place(penetration.place));
  }
  bool is_rigid(std::size_t solid) const {
    const Solid<Dim>& of = solids_.all()[solid];
    return of.part != kNone && rigid_body_of(setup_.materials.at(of.body));
  }
  /// Names the rigid bodies that overlap, if any do, in place of why they were not parted.
  void refuse_rigid_pair() const {
    if (!rigid_pair_.empty())
      refuse(rigid_pair_ + ", which are rigid and are not free to part",
             "rigid bodies apart, or one of them that deforms or that nothing holds");
  }

  /// Refuses a start at which rigid bodies have changed their shapes.
  void refuse_bent_bodies() const {
    constexpr double kBent = 1e-6;  // of an edge's length
    const Mesh<Dim>& mesh = state_.mesh;
    const auto length = [](const Vec<Dim>& from, const Vec<Dim>& to) { return (to - from).norm(); };
    for (const CellId c : mesh.live_cells()) {
      if (!rigid_body_of(setup_.materials.at(mesh.body(c)))) continue;
      const auto at = [&](VertexId v) -> Vec<Dim> { return state_.history.x[0].template segment<Dim>(Dim * v); };
      for (const VertexId v : mesh.cell(c))
        for (const VertexId w : mesh.cell(c)) {
          const double rest = length(mesh.rest(v), mesh.rest(w));
          if (std::abs(length(at(v), at(w)) - rest) <= kBent * rest) continue;
          refuse_rigid_pair();
          refuse(fmt::format("body {}, which is rigid and is not free to part from what it overlaps", mesh.body(c)),
                 "a rigid body apart from others, or one that nothing holds");
        }
    }
  }

  void refuse_self_crossing() const {
    std::vector<int> solid_of(static_cast<std::size_t>(y_.size() / Dim), kNone);
    for (std::size_t i = 0; i < solids_.all().size(); ++i)
      for (const auto& facet : solids_.all()[i].facets)
        for (const int v : facet) solid_of[static_cast<std::size_t>(v)] = static_cast<int>(i);
    const CollisionSurface& surface = contact_.surface;
    for (const auto& [first, second] : find_intersections<Dim>(surface, y_, std::numeric_limits<std::size_t>::max())) {
      const int v = surface.edges[first][0], w = Dim == 2 ? surface.edges[second][0] : surface.triangles[second][0];
      if (solid_of[v] == solid_of[w])
        refuse(name_of(solids_.all()[solid_of[v]]) + " crossing itself, " + place(y_.segment<Dim>(Dim * v)),
               "bodies that touch or overlap others");
    }
  }

  /// Moves the surfaces by springs between points and the nearest ones of others, against the elasticity of the bodies,
  /// until exact predicates find them apart. Springs get stiffer, the gap wider where points alone do not part the facets,
  /// and bodies that nothing holds stay where they come to: else they might return to be pushed away again and again.
  void push_apart() {
    constexpr int kMostRounds = 24, kPatience = 4;
    constexpr double kStiffer = 10, kMostStiffness = 1e6, kEnough = 0.1;
    VectorX x = state_.history.x[0];
    const VectorX start = x;
    double gap = kGap * setup_.contact.dhat, stiffness = 10, worst = 0;
    for (int round = 0; round < kMostRounds; ++round) {
      const VectorX y = contact_.positions(x);
      const Solids<Dim> now(solids_, y);
      auto parting = std::make_shared<Parting<Dim>>(gap, stiffness * unit_stiffness());
      worst = 0;
      now.for_each_near(gap, [&](const FacetPoint<Dim>& point, const Nearest<Dim>& nearest) {
        parting->add(point, nearest);
        worst = std::max(worst, gap - nearest.gap);
      });
      const bool are_apart = worst < (1 - kEnough) * gap;
      if (are_apart && !has_intersection<Dim>(contact_.surface, y)) {
        state_.history.x[0] = x;
        return;
      }
      if (are_apart && round > kPatience) gap *= 2;
      if (!are_apart && round > 0) stiffness = std::min(kStiffer * stiffness, kMostStiffness);
      minimize_with(std::move(parting), round > kPatience ? VectorX(x) : start, x);
    }
    refuse_rigid_pair();
    refuse(fmt::format("surfaces that stay {} in each other however they are pushed", setup_.units.text(worst, "m", 2)),
           "an overlap of bodies that are not held there, on cells that are larger than the overlap");
  }

  /// The stiffness of a cell of the stiffest body that deforms, or of rigid ones where there are no others [N/m].
  double unit_stiffness() const {
    double deformable = 0, rigid = 0;
    for (const auto& [body, material] : setup_.materials) {
      double& modulus = rigid_body_of(material) ? rigid : deformable;
      modulus = std::max(modulus, material.youngs_modulus);
    }
    return (deformable > 0 ? deformable : rigid) * (Dim == 3 ? tools_.initial_edges.shortest : 1);
  }

  /// Bodies that nothing holds stay near x0.
  void minimize_with(std::shared_ptr<const Energy> parting, const VectorX& x0, VectorX& x) {
    constexpr double kHold = 1e-6;  // of the stiffness of a cell: far less than bodies have
    if (contact_.map) parting = std::make_shared<MappedEnergy<Dim>>(parting, contact_.map);
    const auto scope = tools_.cache.scope_of(setup_, state_.mesh, state_.chords);
    const RigidCoordinates<Dim>* const rigid = scope->rigid.get();
    const auto sum = std::make_shared<EnergySum>();
    sum->add(
        std::make_shared<ElasticEnergy<Dim>>(scope->cells, materials_at(setup_, state_.t), 1, setup_.quadrature_degree));
    sum->add(std::move(parting));
    sum->add(std::make_shared<LaggedRegularizationEnergy<Dim>>(x0, kHold * unit_stiffness()));
    const std::vector<char> held = held_dofs(setup_, state_.mesh, state_.t).held;
    const DofMap dofs = DofMap::from_held(rigid ? rigid->held(held) : held);
    SparseSystem& system = tools_.cache.system;
    system.reset(dofs, Dim, element_stencils(scope->cells));
    ++tools_.cache.served;
    NewtonOptions options;
    options.max_iterations = 50;
    options.cancel = setup_.newton.cancel;
    Workspace workspace;
    if (!rigid) {
      minimize(*sum, x, dofs, {}, system, options, workspace);
      return;
    }
    VectorX z = rigid->coordinates_of(x);
    minimize(MappedEnergy<Dim>(sum, rigid->map()), z, dofs, {}, system, options, workspace);
    x = rigid->map()->positions(z);
  }

  /// The static equilibrium without loads from the state, as one step.
  StepReport settle() {
    StepSetup<Dim> alone = setup_;
    alone.neumann.clear();
    alone.pressure.clear();
    alone.fluids.clear();
    alone.cavities.clear();
    alone.body_acceleration = nullptr;
    alone.nodal_loads.clear();
    alone.terms.clear();
    alone.follower = {};
    alone.damping.clear();
    alone.on_iteration = nullptr;
    alone.fields = {};
    alone.remesh = {};
    alone.remesh.curve.for_stability = false;
    alone.contact.friction_coefficient = 0;
    alone.contact.friction_pairs.clear();
    alone.lagged_regularization = {};
    alone.lagging_tolerance = 0;
    alone.newton = {.indefinite = setup_.newton.indefinite, .cancel = setup_.newton.cancel};
    alone.time = {.is_static = true, .t0 = state_.t - 1};
    State<Dim> before = state_, after;
    before.t = alone.time.t0;
    before.history.a.clear();
    before.history.v[0].setZero();
    const StepResult result = take_step(tools_.with(alone), before, after);
    if (!result.ok) refuse_rigid_pair();
    if (!result.ok)
      refuse("an equilibrium of the interference that was not found: " + result.reason, "held bodies, or a smaller overlap");
    state_.history.x[0] = after.history.x[0];
    state_.mesh = std::move(after.mesh);
    state_.quadrature = after.quadrature;
    state_.chords = after.chords;
    if (setup_.contact.adaptive_stiffness) state_.stiffness = after.stiffness;
    state_.stored_energy = after.stored_energy;
    state_.history.viscous = std::move(after.history.viscous);
    state_.history.softening = std::move(after.history.softening);
    return result.report;
  }

  void tell(const std::vector<Penetration<Dim>>& penetrations, double energy) const {
    const Units& units = setup_.units;
    const std::string begins =
        fmt::format("the run begins at their equilibrium, at rest, where they store {}", units.text(energy, "J", kDigits));
    const auto deepest = std::ranges::max_element(penetrations, {}, &Penetration<Dim>::depth);
    if (deepest == penetrations.end()) return tools_.logger.info("initial overlap: surfaces touch; " + begins);
    const double sag = largest_sag(solids_, y_);
    const std::string text = fmt::format(
        "initial overlap: surfaces overlap by up to {}, {}; {}. Of this overlap d-hat is {:.2g} %, and facets sag by up to "
        "{:.2g} %: pressures are off by about as much",
        units.text(deepest->depth, "m", kDigits), place(deepest->place), begins, 100 * setup_.contact.dhat / deepest->depth,
        100 * sag / deepest->depth);
    if (sag > kLargeSag * deepest->depth)
      tools_.logger.warning(text + "; mesh the round finer: half as long facets sag a fourth");
    else
      tools_.logger.info(text);
  }

  const StepTools<Dim>& tools_;
  const StepSetup<Dim>& setup_;
  State<Dim>& state_;
  ContactSurface<Dim> contact_;
  VectorX y_;               ///< positions at the start
  std::string rigid_pair_;  ///< two rigid bodies that overlap
  Solids<Dim> solids_;
};

}  // namespace

template <int Dim>
double least_overlap(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh) {
  VectorX x = held_dofs(setup, mesh, setup.time.t0).target;
  for (VertexId v = 0; v < mesh.node_slots(); ++v) x.segment<Dim>(Dim * v) = mesh.point_of_node(v);
  const Solids<Dim> solids(find_solids(setup, mesh, {}), x);
  std::map<std::pair<std::size_t, std::size_t>, double> by_pair;
  for (const Penetration<Dim>& penetration : solids.penetrations()) {
    const auto [one, other] = std::minmax(penetration.solid, penetration.in);
    double& depth = by_pair[{one, other}];
    depth = std::max(depth, penetration.depth);
  }
  double least = std::numeric_limits<double>::infinity();
  for (const auto& [pair, depth] : by_pair) {
    const double thickness = std::min(solids.all()[pair.first].thickness, solids.all()[pair.second].thickness);
    if (depth > kNoDepth * thickness) least = std::min(least, depth);
  }
  return least;
}

template <int Dim>
double resolve_overlap(const StepTools<Dim>& tools, State<Dim>& state) {
  return OverlapResolver<Dim>(tools, state).resolve();
}

#define ITR_INSTANTIATE(Dim)                                                   \
  template double least_overlap<Dim>(const StepSetup<Dim>&, const Mesh<Dim>&); \
  template double resolve_overlap<Dim>(const StepTools<Dim>&, State<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
