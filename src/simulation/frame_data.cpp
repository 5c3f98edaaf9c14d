// SPDX-License-Identifier: MIT
#include "simulation/frame_data.hpp"

// Data of a frame: energy densities and stresses by cell, sums of forces, energy and momentum.
#include <Eigen/SVD>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <span>
#include <utility>

#include "cell_stress.hpp"
#include "energy/cavity.hpp"
#include "energy/elastic/jacobian_barrier.hpp"
#include "energy/elastic/law_sum.hpp"
#include "energy/elastic/patched_volume.hpp"
#include "energy/elastic/turned.hpp"
#include "energy/inertia.hpp"
#include "energy/rigid_body.hpp"
#include "energy/softening.hpp"
#include "energy/support.hpp"
#include "energy/viscous.hpp"
#include "fem/locator.hpp"
#include "mesh/cell_of_facet.hpp"
#include "simulation/contact_pressure.hpp"
#include "simulation/contact_surface.hpp"
#include "simulation/coupled_points.hpp"
#include "simulation/force_target.hpp"
#include "simulation/step_terms.hpp"

namespace itr {

namespace {

/// Where output samples a cell: its mean has the weights `fraction`, with the turn in axisymmetric ones.
template <int Dim>
struct CellPoint {
  Mat<Dim> F;
  Vec<Dim> X;
  std::array<double, Dim + 1> weights;  ///< barycentric coordinates
  double fraction;
  double hoop = 0;  ///< F33 of a turned cell, else 0
};

/// The points of a turned cell, at those of its elastic energy's quadrature.
void sample_turned(const CellSet<2>& cells, const CellSet<2>::Element& element, const VectorX& x, int level, int degree,
                   std::vector<CellPoint<2>>& points) {
  const Nodal<2> positions = at_nodes<2>(element.nodes(), x);
  double total = 0;
  for (const auto& point : cell_quadrature<2>(level, degree_with_turn(degree, true))) {
    const ElasticSite<2, 3> site(cells, element, point);
    if (site.turn == 0) continue;
    const Mat<3> F = site.deformation_gradient(positions);
    const Vec<2> X = rest_position<2>(cells, element, point.weights);
    points.push_back({F.topLeftCorner<2, 2>(), X, point.weights, site.weight(1), F(2, 2)});
    total += site.weight(1);
  }
  for (auto& point : points) point.fraction /= total;
}

/// F and place of a point in space; F33 is 1 where the cell is not turned.
template <int Dim>
std::pair<Mat<3>, Vec<3>> in_space(const CellPoint<Dim>& point) {
  Mat<3> F = Mat<3>::Identity();
  F.template topLeftCorner<Dim, Dim>() = point.F;
  if (point.hoop != 0) F(2, 2) = point.hoop;
  Vec<3> X = Vec<3>::Zero();
  X.template head<Dim>() = point.X;
  return {F, X};
}

/// f(element, points) for each cell in the mesh's order: one point where F is constant, those of the elastic energy's
/// quadrature in cells with curved edges, of which `levels` are those of the state.
template <int Dim, typename Function>
void for_each_cell_in_order(const CellSet<Dim>& cells, const VectorX& x, const QuadratureLevels& levels, int degree,
                            const Function& f) {
  std::vector<const typename CellSet<Dim>::Element*> ordered(cells.elements.size());
  for (const auto& element : cells.elements) ordered[element.cell] = &element;
  std::vector<CellPoint<Dim>> points;
  std::array<double, Dim + 1> middle;
  middle.fill(1.0 / (Dim + 1));
  for (std::size_t e = 0; const auto* element : ordered) {
    points.clear();
    if constexpr (Dim == 2)
      if (cells.axisymmetric) {
        sample_turned(cells, *element, x, levels.empty() ? 0 : levels[e++], degree, points);
        f(*element, std::span<const CellPoint<Dim>>(points));
        continue;
      }
    if (element->curved)
      for (const auto& point : cell_quadrature<Dim>(levels.empty() ? 0 : levels[e++], degree))
        points.push_back({at_nodes<Dim>(element->nodes(), x) * shape_gradients<Dim>(*element, point.weights).transpose(),
                          rest_position<Dim>(cells, *element, point.weights), point.weights, point.fraction, 0});
    else
      points.push_back({deformation_gradient<Dim>(*element, x), rest_barycenter(cells, *element), middle, 1, 0});
    f(*element, std::span<const CellPoint<Dim>>(points));
  }
}

/// The mesh as the elastic energy has it: with patches, and their pressures and densities at x.
template <int Dim>
struct FrameCells {
  std::map<int, Material> materials;  ///< at the time of the state
  CellSet<Dim> cells;
  PatchPressures<Dim> pressures;
  std::vector<double> densities;
  std::shared_ptr<const CellField<Dim>> viscous;    ///< null: no body is viscoelastic
  std::shared_ptr<const CellField<Dim>> softening;  ///< null: no body softens

  FrameCells(const Setup<Dim>& setup, const State<Dim>& state, const VectorX& x)
      : materials(materials_at(setup, state.t)),
        cells(whole_mesh(state.mesh, {})),
        viscous(std::dynamic_pointer_cast<const CellField<Dim>>(state.history.viscous)),
        softening(std::dynamic_pointer_cast<const CellField<Dim>>(state.history.softening)) {
    add_patches(materials, cells);
    if (!cells.patches) return;
    const auto rule_of = [&](std::size_t e) -> const auto& {
      return cell_quadrature<Dim>(state.quadrature.empty() ? 0 : state.quadrature[e], setup.quadrature_degree);
    };
    const PatchedVolume<Dim> volume(cells, materials, 1, rule_of);
    const std::vector<double> changes = volume.changes({cells.rest, x});
    pressures = volume.pressures(changes);
    densities = volume.densities(changes);
  }
  std::size_t number(const typename CellSet<Dim>::Element& element) const {
    return static_cast<std::size_t>(&element - cells.elements.data());
  }
  /// The law at a point of an element.
  ElasticModuli moduli(const Material& material, const typename CellSet<Dim>::Element& element,
                       const CellPoint<Dim>& point) const {
    return pressures.in(cell_moduli<Dim>(cells, element, material, point.X), number(element), point.weights);
  }
  /// Stress in space and energy density that the past adds at a point of an element.
  std::pair<Mat<3>, double> past(const Material& material, const typename CellSet<Dim>::Element& element,
                                 const CellPoint<Dim>& point) const {
    const auto cell = static_cast<std::size_t>(element.cell);
    if (softening && material.mullins)
      return softening_of_state<Dim>(softening->by_cell()[cell], point.weights, material, point.X, in_space(point).first);
    if (!viscous || material.prony.empty()) return {Mat<3>::Zero(), 0};
    const auto [F, X] = in_space(point);
    return past_of_state<Dim>(viscous->by_cell()[cell], point.weights, material, X, F);
  }
  /// Mean energy density of the patches in an element.
  double density(const typename CellSet<Dim>::Element& element, std::span<const CellPoint<Dim>> points) const {
    double sum = 0;
    std::array<double, Dim + 1> middle;  // where linear weights are their means
    middle.fill(cells.axisymmetric ? 0 : 1.0 / (Dim + 1));
    for (std::size_t k = 0; cells.axisymmetric && k <= Dim; ++k)
      for (const CellPoint<Dim>& point : points) middle[k] += point.fraction * point.weights[k];
    const auto e = static_cast<int>(number(element));
    for (int part = 0; cells.patches && part < VolumePatches<Dim>::kParts; ++part)
      if (const int patch = cells.patches->patch_of[e][part]; patch != kNone)
        sum += cells.patches->weight(e, part, middle) * densities[patch];
    return sum;
  }
};

/// The first kinds of a ForceCurvePoint.
template <std::size_t N, int Dim>
std::array<std::vector<double>, N> kinds_of(const ForceSums<Dim>& sums) {
  const std::array<const Resultant<Dim>*, 7> all{&sums.contact, &sums.friction, &sums.reaction, &sums.all,
                                                 &sums.body,    &sums.residual, &sums.remeshing};
  std::array<std::vector<double>, N> kinds;
  for (std::size_t k = 0; k < N; ++k) {
    kinds[k].assign(all[k]->force.begin(), all[k]->force.end());
    kinds[k].insert(kinds[k].end(), all[k]->moment.begin(), all[k]->moment.end());
  }
  return kinds;
}

/// Sums of forces on a target, with those of their errors by source; NaN where these are asked for and unknown.
template <int Dim>
ForceCurvePoint curve_point(const Setup<Dim>& setup, const State<Dim>& state, const NodalForces& forces,
                            const ErrorFields& errors, const ForceTarget& target) {
  ForceCurvePoint point{target.name, kinds_of<7>(sum_forces(state, forces, target))};
  for (const auto& source : errors.sources) point.errors.push_back(kinds_of<4>(sum_forces(state, source.forces, target)));
  if (!setup.fields.error_bars || !point.errors.empty()) return point;
  std::array<std::vector<double>, 4> unknown;
  unknown.fill(std::vector<double>(point.kinds[0].size(), std::numeric_limits<double>::quiet_NaN()));
  point.errors.assign(kErrorSources, unknown);
  return point;
}

/// Names of the springs on rigid bodies.
template <int Dim>
std::set<std::string> springs_of_rigid(const Setup<Dim>& setup, const Mesh<Dim>& mesh) {
  std::set<std::string> names;
  if (!has_rigid_bodies(setup.materials)) return names;
  const auto springs = springs_of<Dim>(setup.nodal_loads);
  if (springs.empty()) return names;
  std::set<int> rigid;  // tags of their surfaces
  for (const FacetId f : mesh.live_facets())
    if (rigid_body_of(setup.materials.at(mesh.body(cell_of_facet(mesh, f))))) rigid.insert(mesh.facet_tag(f));
  for (const auto& spring : springs)
    if (std::ranges::any_of(spring->surfaces, [&](int tag) { return rigid.contains(tag); })) names.insert(spring->name);
  return names;
}

/// Forces without those on rigid bodies as wholes, which some of their nodes have in their place.
template <int Dim>
NodalForces without_wholes(NodalForces forces, const Setup<Dim>& setup, const Mesh<Dim>& mesh) {
  for (const CellId c : mesh.live_cells())
    if (rigid_body_of(setup.materials.at(mesh.body(c))))
      for (const VertexId v : mesh.cell(c))
        for (VectorX* kind : {&forces.reaction, &forces.body, &forces.residual}) kind->segment<Dim>(Dim * v).setZero();
  return forces;
}

/// Gives curves the volume and the pressure of the cavity of their name.
template <int Dim>
void add_cavities(const Setup<Dim>& setup, const CellSet<Dim>& cells, const State<Dim>& state,
                  std::vector<ForceCurvePoint>& curves) {
  if (setup.cavities.empty()) return;
  for (ForceCurvePoint& curve : curves) curve.cavity.assign(2, std::numeric_limits<double>::quiet_NaN());
  const ConstVectorView x = state.history.x[0].head(Dim * cells.num_vertices);
  const Loads<Dim> loads = loads_at(setup, state.t);
  for (std::size_t i = 0; i < setup.cavities.size(); ++i) {
    const auto curve = std::ranges::find(curves, setup.cavities[i].name, &ForceCurvePoint::name);
    if (curve == curves.end()) continue;
    const CavityEnergy<Dim> cavity(cells, loads.cavities[i], 1);
    curve->cavity = {cavity.volume(x), cavity.pressure(x)};
  }
}

/// Displacements of targets, with their errors by source; NaN where these are asked for and unknown.
template <int Dim>
std::vector<PointValue> points_of(const Setup<Dim>& setup, const State<Dim>& state, const ErrorFields& errors) {
  std::vector<PointValue> points;
  if (setup.fields.points.empty()) return points;
  const Locator<Dim> locator(state.mesh);
  for (const PointTarget& target : setup.fields.points) {
    const Vec<Dim> X(target.rest.data());
    const auto place = locator.find(X);
    const auto at = [&](const VectorX& field) {
      std::vector<double> sum(Dim, 0.0);
      for_each_weight<Dim>(place, [&](int node, double weight) {
        for (int c = 0; c < Dim; ++c) sum[c] += weight * field[Dim * node + c];
      });
      return sum;
    };
    PointValue& point = points.emplace_back();
    point.name = target.name;
    point.u = point.x = at(state.history.x[0]);
    // Beside chords of a round, and near them, the point that moves is the nearest one.
    for_each_weight<Dim>(place, [&](int node, double weight) {
      for (int c = 0; c < Dim; ++c) point.u[c] -= weight * state.mesh.rest(node)[c];
    });
    for (const auto& source : errors.sources) point.errors.push_back(at(source.displacement));
    if (setup.fields.error_bars && point.errors.empty())
      point.errors.assign(kErrorSources, std::vector<double>(Dim, std::numeric_limits<double>::quiet_NaN()));
  }
  return points;
}

/// Von Mises stress of the stress in space, of which `out_of_plane` is the third
/// normal component: zero in plane stress, that of F_zz = 1 in plane strain.
template <int Dim>
double von_mises(const Mat<Dim>& cauchy, double out_of_plane) {
  Mat<3> s = Mat<3>::Zero();
  s.template topLeftCorner<Dim, Dim>() = cauchy;
  if (Dim == 2) s(2, 2) = out_of_plane;
  const Mat<3> deviator = s - s.trace() / 3 * Mat<3>::Identity();
  return std::sqrt(1.5) * deviator.norm();
}

/// Principal stretches in the plane (3D: all), the largest first, then that across it.
template <int Dim>
Vec<3> stretches_of(const Mat<Dim>& F, double across) {
  Vec<3> stretches = Vec<3>::Constant(across);
  stretches.head<Dim>() = Eigen::JacobiSVD<Mat<Dim>>(F).singularValues();
  return stretches;
}

template <int Dim>
double out_of_plane_stress(const Material& material, const ElasticModuli& moduli, const Mat<Dim>& F) {
  if (Dim == 3 || !material.plane_strain || (sum_of(material) && sum_of(material)->dimension == 2)) return 0;
  Mat<3> in_space = Mat<3>::Identity();
  in_space.template topLeftCorner<Dim, Dim>() = F;
  return elastic_stress<3>(in_space, moduli)(2, 2) / F.determinant();
}

/// F33: not a number for laws of two dimensions, which do not know the thickness.
template <int Dim>
double stretch_across(const Material& material, const ElasticModuli& moduli, const Mat<Dim>& F) {
  const LawSum* sum = sum_of(material);
  const bool is_known = sum ? sum->dimension == 3 : material.plane_strain;
  return is_known ? thickness<Dim>(F, moduli) : std::numeric_limits<double>::quiet_NaN();
}

template <int Dim>
CellStress stress_of(const FrameCells<Dim>& frame, const VectorX& x, const QuadratureLevels& levels,
                     const Setup<Dim>& setup) {
  CellStress stress;
  for_each_cell_in_order<Dim>(frame.cells, x, levels, setup.quadrature_degree, [&](const auto& element, auto points) {
    const Material& material = frame.materials.at(element.body);
    Mat<Dim> cauchy = Mat<Dim>::Zero();
    double equivalent = 0, pressure = 0;
    Vec<3> stretches = Vec<3>::Zero();
    for (const CellPoint<Dim>& point : points) {
      const Mat<Dim>& F = point.F;
      const ElasticModuli moduli = frame.moduli(material, element, point);
      const Mat<3> past = frame.past(material, element, point).first;
      if (point.hoop != 0) {
        const Mat<3> F3 = in_space(point).first;
        const Mat<3> here = elastic_stress<3>(F3, moduli) * F3.transpose() / F3.determinant() + past;
        cauchy += point.fraction * here.template topLeftCorner<Dim, Dim>();
        equivalent += point.fraction * von_mises<3>(here, 0);
        pressure -= point.fraction * here.trace() / 3;
        stretches += point.fraction * stretches_of<Dim>(F, point.hoop);
        continue;
      }
      const Mat<Dim> here = elastic_stress<Dim>(F, moduli) * F.transpose() / (F.determinant() * thickness<Dim>(F, moduli)) +
                            past.template topLeftCorner<Dim, Dim>();
      cauchy += point.fraction * here;
      const double across = Dim == 3 ? 0 : out_of_plane_stress<Dim>(material, moduli, F) + past(2, 2);
      equivalent += point.fraction * von_mises<Dim>(here, across);
      pressure -= point.fraction * (here.trace() + across) / 3;
      stretches += point.fraction * stretches_of<Dim>(F, stretch_across<Dim>(material, moduli, F));
    }
    stress.von_mises.push_back(equivalent);
    stress.pressure.push_back(pressure);
    stress.stretches.insert(stress.stretches.end(), stretches.begin(), stretches.end());
    for (int i = 0; i < Dim; ++i)
      for (int j = 0; j < Dim; ++j) stress.cauchy.push_back(cauchy(i, j));
  });
  return stress;
}

/// Adds the fields that the setup asks for.
template <int Dim>
void add_asked(const Setup<Dim>& setup, const FrameCells<Dim>& frame, const State<Dim>& state, const ErrorFields& errors,
               FrameData<Dim>& data) {
  const FieldOptions& options = setup.fields;
  AskedFields& asked = data.asked;
  const NodalForces all = std::exchange(asked.forces, {});
  if (options.contact_forces) asked.forces.contact = all.contact;
  if (options.friction_forces) asked.forces.friction = all.friction;
  if (options.reaction_forces) asked.forces.reaction = all.reaction;
  if (options.applied_forces) asked.forces.applied = all.applied;
  const std::set<std::string> of_rigid = springs_of_rigid(setup, state.mesh);
  const NodalForces less = of_rigid.empty() ? NodalForces() : without_wholes(all, setup, state.mesh);
  for (const ForceTarget& target : options.curves)
    asked.curves.push_back(curve_point(setup, state, of_rigid.contains(target.name) ? less : all, errors, target));
  add_cavities(setup, frame.cells, state, asked.curves);
  asked.points = points_of(setup, state, errors);
  if (options.contact_pressure) asked.contact_pressure = contact_pressure(setup, state.mesh, data.x, all.contact);
  if (options.von_mises || options.stress || options.pressure || options.stretches) {
    CellStress stress = stress_of<Dim>(frame, data.x, state.quadrature, setup);
    if (options.von_mises) asked.von_mises = std::move(stress.von_mises);
    if (options.stress) asked.stress = std::move(stress.cauchy);
    if (options.pressure) asked.pressure = std::move(stress.pressure);
    if (options.stretches) asked.stretches = std::move(stress.stretches);
  }
  if (!options.kinetic_energy && !options.momentum) return;
  // Velocities of quasistatic steps are increments by time: no momentum belongs to them.
  const VectorX v = setup.time.has_inertia() ? data.v : VectorX::Zero(data.v.size());
  VectorX product = VectorX::Zero(v.size());
  InertiaEnergy<Dim>(frame.cells, setup.materials, setup.lump_mass ? MassKind::lumped : MassKind::consistent,
                     VectorX::Zero(v.size()))
      .add_mass_product(v, product);
  double energy = 0.5 * v.dot(product);
  Vec<Dim> momentum = Vec<Dim>::Zero();
  for (Eigen::Index i = 0; i < product.size(); ++i) momentum[i % Dim] += product[i];
  for (const auto& surface : coupled_surfaces<Dim>(setup, frame.cells)) {
    const Vec<Dim> of_point = surface.point().velocity(data.x, v);
    energy += surface.coupling->mass / 2 * of_point.squaredNorm();
    momentum += surface.coupling->mass * of_point;
  }
  if (options.kinetic_energy) asked.kinetic_energy = {energy};
  if (options.momentum) asked.momentum.assign(momentum.begin(), momentum.end());
}

}  // namespace

template <int Dim>
CellStress cell_stress(const Simulation<Dim>& simulation) {
  const State<Dim>& state = simulation.state();
  const VectorX x = state.history.x[0].head(Dim * state.mesh.num_nodes());
  return stress_of<Dim>({simulation.setup(), state, x}, x, state.quadrature, simulation.setup());
}

template CellStress cell_stress(const Simulation<2>&);
template CellStress cell_stress(const Simulation<3>&);

template <int Dim>
FrameData<Dim> frame_data(const Setup<Dim>& setup, const State<Dim>& state, const NodalForces& forces,
                          const ErrorFields& errors) {
  const int bodies = state.mesh.num_nodes();
  FrameData<Dim> data;
  data.x = state.history.x[0].head(Dim * bodies);
  data.v = state.history.v[0].head(Dim * bodies);
  const FrameCells<Dim> frame(setup, state, data.x);
  const CellSet<Dim>& cells = frame.cells;
  const auto add_density = [&](const auto& element, auto points) {
    const Material& material = frame.materials.at(element.body);
    double mean = frame.density(element, points);
    for (const CellPoint<Dim>& point : points) {
      mean += point.fraction * frame.past(material, element, point).second;
      const ElasticModuli moduli = cell_moduli<Dim>(cells, element, material, point.X);
      mean += point.fraction *
              (point.hoop != 0 ? elastic_density<3>(in_space(point).first, moduli) : elastic_density<Dim>(point.F, moduli));
    }
    if (element.curved && !cells.axisymmetric)
      mean += barrier_density<Dim>(JacobianBarrier<Dim>(element, at_nodes<Dim>(element.nodes(), data.x)),
                                   cell_moduli<Dim>(cells, element, material, rest_barycenter<Dim>(cells, element)));
    data.elastic_density.push_back(mean);
  };
  for_each_cell_in_order<Dim>(cells, data.x, state.quadrature, setup.quadrature_degree, add_density);
  data.asked.forces = forces;
  add_asked(setup, frame, state, errors, data);
  const VectorX& all = state.history.x[0];
  for (Eigen::Index i = Dim * bodies; i < all.size(); i += Dim) data.obstacle_x.emplace_back(all.segment<Dim>(i));
  if (setup.proxy) {
    const VectorX y = proxy_map(setup, state.mesh)->positions(all);
    for (std::size_t v = 0; v < setup.proxy->rest.size(); ++v)
      data.proxy_x.emplace_back(vertex_of<Dim>(y, static_cast<int>(v)));
  }
  return data;
}

template FrameData<2> frame_data(const Setup<2>&, const State<2>&, const NodalForces&, const ErrorFields&);
template FrameData<3> frame_data(const Setup<3>&, const State<3>&, const NodalForces&, const ErrorFields&);

}  // namespace itr
