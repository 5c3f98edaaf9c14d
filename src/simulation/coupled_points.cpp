// SPDX-License-Identifier: MIT
#include "simulation/coupled_points.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

namespace itr {

namespace {

constexpr double kStiffness = 1e3;  ///< of what holds a point, by that of the cells beside its surface

template <int Dim>
Vec<Dim> at_time(const std::function<Vec<3>(double t)>& f, double t) {
  return f ? Vec<Dim>(f(t).template head<Dim>()) : Vec<Dim>(Vec<Dim>::Zero());
}

Mat<3> rotation_by(const Vec<3>& turn) {
  const double angle = turn.norm();
  return angle == 0 ? Mat<3>(Mat<3>::Identity()) : Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
}

}  // namespace

template <int Dim>
std::vector<CoupledSurface<Dim>> coupled_surfaces(const StepSetup<Dim>& setup, const CellSet<Dim>& cells) {
  std::vector<CoupledSurface<Dim>> surfaces;
  for (const auto& coupling : couplings_of<Dim>(setup.nodal_loads)) {
    SurfaceMean<Dim> mean(cells, coupling->surfaces);
    double modulus = std::numeric_limits<double>::infinity(), density = modulus;
    for (const auto& element : cells.elements) {
      const auto is_on = [&](int v) { return std::ranges::binary_search(mean.nodes, v); };
      if (std::ranges::count_if(element.vertices, is_on) < Dim) continue;
      const Material& material = setup.materials.at(element.body);
      modulus = std::min(modulus, material.youngs_modulus);
      density = std::min(density, material.density);
    }
    surfaces.push_back({coupling, std::move(mean), modulus, density});
  }
  return surfaces;
}

template <int Dim>
CoupledPoints<Dim>::CoupledPoints(const StepSetup<Dim>& setup, const PotentialTerms<Dim>& terms,
                                  const std::vector<CoupledSurface<Dim>>& surfaces, const History& history)
    : setup_(setup), terms_(terms), surfaces_(surfaces) {
  for (const auto& surface : surfaces) {
    supports_.push_back(support_of(surface, history));
    masses_.push_back(mass_of(surface, history));
  }
}

/// The terms of one point.
template <int Dim>
auto CoupledPoints<Dim>::terms_of(std::size_t i, const VectorX& x) const -> std::vector<Term> {
  std::vector<Term> terms{supports_[i], masses_[i], load_of(surfaces_[i], x)};
  std::erase(terms, nullptr);
  return terms;
}

/// Conditions on a point, and its spring. By the trapezoidal rule half of a gap is left, as StepProblem::add_ties says.
template <int Dim>
auto CoupledPoints<Dim>::support_of(const CoupledSurface<Dim>& surface, const History& history) const -> Term {
  const Coupling& coupling = *surface.coupling;
  if (!coupling.has_conditions() && coupling.stiffness.isZero(0)) return nullptr;
  const CoupledPoint<Dim> point = surface.point();
  PointTerms<Dim> parts;
  parts.stiffness = coupling.stiffness.topLeftCorner<Dim, Dim>();
  HeldPoint<Dim> held{.is_rigid = coupling.is_rigid,
                      .position = coupling.held_position,
                      .rotation = coupling.held_rotation,
                      .displacement = at_time<Dim>(coupling.motion, terms_.t),
                      .turned = rotation_by(at_time<3>(coupling.turn, terms_.t)),
                      .name = coupling.name};
  const double size = std::pow(surface.mean.area, 1.0 / (Dim - 1));
  held.stiffness = kStiffness * std::pow(size, Dim - 2) * surface.modulus;
  if (terms_.has_inertia) held.stiffness += kStiffness * std::pow(size, Dim) * surface.density / terms_.scaling;
  if (terms_.has_inertia && TimeIntegrator(setup_.time).is_trapezoidal(history)) {
    const double h = setup_.time.dt;
    const Vec<Dim> before = at_time<Dim>(coupling.motion, terms_.t - h);
    const Vec<Dim> rate = point.velocity(history.x[0], history.v[0]) - (held.displacement - before) / h;
    held.displacement += (point.displacement(history.x[0]) - before + h / 2 * rate) / 2;
  }
  return std::make_shared<CouplingEnergy<Dim>>(point, parts, std::move(held), terms_.scaling);
}

/// Inertia of a point's mass. Velocities of nodes in implicit Euler's method are differences of positions, so that those of
/// points are, too: the derivative of where a point is would differ by as much as a step turns it.
template <int Dim>
auto CoupledPoints<Dim>::mass_of(const CoupledSurface<Dim>& surface, const History& history) const -> Term {
  const double mass = surface.coupling->mass;
  if (mass == 0 || !terms_.has_inertia) return nullptr;
  const CoupledPoint<Dim> point = surface.point();
  History of_point;
  of_point.dt = history.dt;
  of_point.damp_next = history.damp_next;
  for (std::size_t k = 0; k < history.x.size(); ++k) {
    const VectorX &x = history.x[k], &v = history.v[k];
    of_point.x.emplace_back(point.displacement(x));
    if (setup_.time.integrator == Integrator::implicit_euler && history.dt > 0)
      of_point.v.emplace_back((point.displacement(x) - point.displacement(VectorX(x - history.dt * v))) / history.dt);
    else
      of_point.v.emplace_back(point.velocity(x, v));
    if (k < history.a.size()) of_point.a.emplace_back(point.acceleration(x, v, history.a[k]));
  }
  PointTerms<Dim> parts;
  parts.stiffness = mass * Mat<Dim>::Identity();
  parts.origin = TimeIntegrator(setup_.time).predictor(of_point);
  return std::make_shared<CouplingEnergy<Dim>>(point, parts, HeldPoint<Dim>{}, 1);
}

/// Force, couple and weight of a point. In 3D the couple is lagged.
template <int Dim>
auto CoupledPoints<Dim>::load_of(const CoupledSurface<Dim>& surface, const VectorX& x) const -> Term {
  const Coupling& coupling = *surface.coupling;
  const bool has_weight = coupling.mass > 0 && setup_.body_acceleration;
  if (!coupling.force && !coupling.moment && !has_weight) return nullptr;
  const CoupledPoint<Dim> point = surface.point();
  const Vec<Dim> X = coupling.point.head<Dim>();
  PointTerms<Dim> parts;
  parts.force = at_time<Dim>(coupling.force, terms_.t);
  if (has_weight)
    parts.force += coupling.mass * setup_.body_acceleration(
                                       RestPoint<Dim>(X, Vec<Dim>(surface.mean.centroid - X), surface.mean.part), terms_.t);
  if (coupling.moment) {
    const Mat<3> R = point.rotation(point.means_of(surface.mean.displacements(x))).R();
    const Vec<3> moment = coupling.moment(terms_.t);
    if (Dim == 2)
      parts.moment = moment[2], parts.turn = std::atan2(R(1, 0), R(0, 0));
    else
      parts.couple = skew(moment) * R / 2;
  }
  return std::make_shared<CouplingEnergy<Dim>>(point, parts, HeldPoint<Dim>{}, terms_.scaling);
}

template <int Dim>
std::vector<std::shared_ptr<const Energy>> CoupledPoints<Dim>::terms(const VectorX& x) const {
  std::vector<std::shared_ptr<const Energy>> terms;
  for (std::size_t i = 0; i < surfaces_.size(); ++i) std::ranges::copy(terms_of(i, x), std::back_inserter(terms));
  return terms;
}

template <int Dim>
std::vector<Constraint*> CoupledPoints<Dim>::constraints() const {
  std::vector<Constraint*> found;
  for (std::size_t i = 0; i < surfaces_.size(); ++i)
    if (surfaces_[i].coupling->has_conditions()) found.push_back(supports_[i].get());
  return found;
}

template <int Dim>
std::vector<TractionOfTie<Dim>> CoupledPoints<Dim>::tractions(const VectorX& x) const {
  std::vector<TractionOfTie<Dim>> tractions;
  for (std::size_t i = 0; i < surfaces_.size(); ++i) {
    const SurfaceMean<Dim>& mean = surfaces_[i].mean;
    typename CouplingEnergy<Dim>::Means gradient = CouplingEnergy<Dim>::Means::Zero();
    for (const auto& term : terms_of(i, x)) gradient += term->gradient_of_means(x);
    gradient /= -terms_.scaling * mean.area;
    for (const int tag : surfaces_[i].coupling->surfaces)
      tractions.emplace_back(tag, [gradient, centroid = mean.centroid](const RestPoint<Dim>& X) {
        return Vec<Dim>(gradient.col(0) + gradient.template rightCols<Dim>() * (X - centroid));
      });
  }
  return tractions;
}

template <int Dim>
void CoupledPoints<Dim>::add_mass_product(const VectorX& x, const VectorX& v, VectorX& product) const {
  for (const Term& mass : masses_)
    if (mass) mass->add_product(x, v, product);
}

#define ITR_INSTANTIATE(Dim)                                                                                   \
  template std::vector<CoupledSurface<Dim>> coupled_surfaces<Dim>(const StepSetup<Dim>&, const CellSet<Dim>&); \
  template class CoupledPoints<Dim>;
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
