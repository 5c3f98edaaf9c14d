// SPDX-License-Identifier: MIT
// f0(y) = y^2 (1 - y / (3 eps)) / eps + eps / 3 below eps, y above: the potential whose derivative f1 rises smoothly from 0
// to 1 over the slip speeds below eps (IPC, Li et al. 2020, eq. 15).
#include "energy/contact/friction.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "energy/contact/friction_directions.hpp"
#include "energy/contact/pairs.hpp"
#include "mesh/cell_of_facet.hpp"

namespace itr {

namespace {

/// Derivative by the slip velocity v of w(v), where y / f1(y) w = v for y = |v|, linearised at any w (Chan, Golub & Mulet
/// 1999); of f1(y) v / y where w is that. Symmetrised; its eigenvalues are >= 0 for |w| <= 1: what the fall from static to
/// kinetic friction would make of them is left out.
template <int N>
Mat<N> linearised_ratio(const Vec<N>& v, const Vec<N>& w, const SlipLaw& law) {
  const double y = v.norm(), isotropic = law.by_speed(y);
  if (isotropic == 0) return Mat<N>::Zero();
  Mat<N> inner = Mat<N>::Identity();
  if (y > 0) {
    double slope = 1;  // of y / f1(y)
    if (y < law.eps)
      slope = 1 / (law.eps * law.eps * isotropic * isotropic);
    else if (law.kinetic < 1)
      slope = std::min((isotropic - law.derivative(y)) / (isotropic * isotropic * y), 1 / std::max(w.norm(), isotropic * y));
    const Mat<N> turn = slope / (2 * y) * w * v.transpose();
    inner -= turn + turn.transpose();
  }
  return isotropic * inner;
}

/// Coefficients of friction of an active pair.
struct Coefficients {
  double statics, kinetic;                     ///< the larger ones of two
  const FrictionPair* by_direction = nullptr;  ///< where there are two
  bool is_first_a = true;                      ///< whether the first primitive is of its side a
};
Coefficients coefficients_of(const ContactStencil& pair, const ContactOptions& options, const CollisionSurface& surface) {
  if (!surface.friction_sides.empty()) {
    const int first = size_of_first(pair.kind);
    std::array<std::uint64_t, 2> sides{~std::uint64_t{0}, ~std::uint64_t{0}};
    for (int k = 0; k < pair.size(); ++k) sides[k < first ? 0 : 1] &= surface.friction_sides[pair.vertices[k]];
    for (std::size_t i = 0; i < options.friction_pairs.size(); ++i) {
      const auto is_of = [&](int end, int side) { return sides[end] >> (2 * i + side) & 1; };
      const bool is_first_a = is_of(0, 0) && is_of(1, 1);
      if (!is_first_a && !(is_of(0, 1) && is_of(1, 0))) continue;
      const FrictionPair& found = options.friction_pairs[i];
      if (!found.has_two()) return {found.statics, found.kinetic};
      return {found.largest(), std::max(found.kinetic, found.across->kinetic), &found, is_first_a};
    }
  }
  return {options.friction_coefficient, options.friction_coefficient};
}

template <typename IsOf>
std::uint64_t sides_of(const std::vector<FrictionPair>& pairs, const IsOf& is_of) {
  std::uint64_t sides = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i)
    sides |= std::uint64_t{is_of(pairs[i].a)} << 2 * i | std::uint64_t{is_of(pairs[i].b)} << (2 * i + 1);
  return sides;
}

bool has(const std::vector<int>& ids, int id) { return std::find(ids.begin(), ids.end(), id) != ids.end(); }

Eigen::Matrix<double, 2, 1> tangent_basis(const Vec<2>& normal) { return {-normal[1], normal[0]}; }
Eigen::Matrix<double, 3, 2> tangent_basis(const Vec<3>& normal) {
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = normal.unitOrthogonal();
  basis.col(1) = normal.cross(basis.col(0));
  return basis;
}

}  // namespace

double SlipLaw::on_fall(double y) const { return std::min(1.0, (y - eps) / ((kSlides - 1) * eps)); }
double SlipLaw::potential(double y) const {
  if (lets_go && y >= 2 * eps) return 4 * eps / 3;
  if (y < eps || lets_go) return y * y * (1 - y / (3 * eps)) / eps + (lets_go ? 0 : eps / 3);
  if (kinetic == 1) return y;
  const double t = on_fall(y), width = (kSlides - 1) * eps;
  return y - (1 - kinetic) * (width * t * t * t * (1 - t / 2) + std::max(0.0, y - eps - width));
}
double SlipLaw::by_speed(double y) const {
  if (y < (lets_go ? 2 * eps : eps)) return (2 - y / eps) / eps;
  if (lets_go) return 0;
  if (kinetic == 1) return 1 / y;
  const double t = on_fall(y);
  return (1 - (1 - kinetic) * t * t * (3 - 2 * t)) / y;
}
double SlipLaw::derivative(double y) const {
  if (y < (lets_go ? 2 * eps : eps)) return 2 * (1 - y / eps) / eps;
  if (lets_go || kinetic == 1) return 0;
  const double t = on_fall(y);
  return -(1 - kinetic) * 6 * t * (1 - t) / ((kSlides - 1) * eps);
}

template <int Dim>
std::uint64_t friction_sides_of_node(const Mesh<Dim>& mesh, VertexId node, const std::vector<FrictionPair>& pairs) {
  std::uint64_t sides = 0;
  const auto add = [&](FacetId f) {
    const int body = mesh.body(cell_of_facet(mesh, f)), tag = mesh.facet_tag(f);
    sides |= sides_of(pairs, [&](const FrictionSide& side) { return has(side.bodies, body) || has(side.surfaces, tag); });
  };
  if (const EdgeKey edge = mesh.edge_of_node(node); edge[0] != kNone)
    std::ranges::for_each(mesh.facets_of_edge(edge), add);
  else
    std::ranges::for_each(mesh.facets_of(node), add);
  return sides;
}
template std::uint64_t friction_sides_of_node(const Mesh<2>&, VertexId, const std::vector<FrictionPair>&);
template std::uint64_t friction_sides_of_node(const Mesh<3>&, VertexId, const std::vector<FrictionPair>&);

std::uint64_t friction_sides_of_obstacle(int vertex, const std::vector<FrictionPair>& pairs) {
  return sides_of(pairs, [&](const FrictionSide& side) { return has(side.obstacle_vertices, vertex); });
}

template <int Dim>
FrictionEnergy<Dim>::FrictionEnergy(const ContactEnergy<Dim>& contact, ConstVectorView x, Workspace& workspace,
                                    const ContactOptions& options, const VelocityRule& velocity, double scale) {
  renew(contact, x, workspace, options, velocity.rate, velocity.reference, scale);
}

template <int Dim>
void FrictionEnergy<Dim>::renew(const ContactEnergy<Dim>& contact, ConstVectorView x, Workspace& workspace,
                                const ContactOptions& options, double velocity_rate, ConstVectorView velocity_reference,
                                double scale, bool slips_from_touch) {
  rate_ = velocity_rate;
  reference_ = velocity_reference;
  epsv_ = contact.law() == ContactLaw::adhesion ? options.adhesion.velocity : options.friction_velocity;
  scale_ = scale;
  is_primal_dual_ = false;
  lets_go_ = contact.law() == ContactLaw::adhesion;
  pairs_.clear();
  FrictionDirections directions(contact.surface(), x);
  for (const auto& s : contact.active(x, workspace)) {
    if (s.is_mollified()) continue;
    const double held = options.adhesion.tangential_coefficient;
    const auto found = lets_go_ ? Coefficients{held, held} : coefficients_of(s, options, contact.surface());
    const double statics = found.statics;
    if (statics == 0) continue;
    const PairDistance<Dim> q = contact.distance(s, x);
    const double distance = std::sqrt(q.squared);
    Pair pair{.vertices = {},
              .size = s.size(),
              .coefficients = Vec<kMost>::Zero(),
              .tangents = tangent_basis(Vec<Dim>(q.separation / distance)),
              .force = 0,
              .kinetic = found.kinetic / statics};
    std::copy(s.vertices.begin(), s.vertices.end(), pair.vertices.begin());
    pair.coefficients.template head<4>() = q.coefficients;
    pair.force = lets_go_ ? held * s.weight * options.adhesion.lagged_pull()
                          : statics * s.weight * contact.stiffness() * -contact.barrier_first(q.squared) * 2 * distance;
    if constexpr (Dim == 3)
      if (found.by_direction)
        set_directions(pair, directions.at(s, q.coefficients, *found.by_direction, found.is_first_a),
                       q.separation / distance, *found.by_direction);
    if (slips_from_touch) {
      constexpr double kTogether = 0.5;  // cosine: what slides past turns its normal by more
      const Vec<Dim> before = contact.distance(s, velocity_reference).separation.normalized();
      if (before.dot(q.separation) > kTogether * distance) pair.approach = approach_of(pair, before, options.dhat);
    }
    pairs_.push_back(pair);
  }
}

template <int Dim>
void FrictionEnergy<Dim>::add(const std::vector<AveragedContact::PressedPoint>& points, double coefficient) {
  if constexpr (Dim == 2)
    for (const auto& point : points) {
      pairs_.push_back({.vertices = point.vertices,
                        .size = point.size,
                        .coefficients = point.coefficients,
                        .tangents = tangent_basis(point.normal),
                        .force = coefficient * point.force});
    }
}

/// Gives a pair the directions of two coefficients, and their parts of the larger one.
template <int Dim>
void FrictionEnergy<Dim>::set_directions(Pair& pair, const Vec<3>& direction, const Vec<3>& normal,
                                         const FrictionPair& by_direction) const {
  constexpr double kNormal = 1e-6;
  const double along = by_direction.statics / by_direction.largest();
  const double across = by_direction.across->statics / by_direction.largest();
  const Vec<3> in_plane = direction - normal.dot(direction) * normal;
  if (in_plane.norm() <= kNormal * direction.norm()) {
    pair.force *= across;
    return;
  }
  if constexpr (Dim == 3) {
    pair.tangents.col(0) = along * in_plane.normalized();
    pair.tangents.col(1) = across * normal.cross(in_plane).normalized();
  }
  pair.least = std::max(kLeastPart, std::min(along, across));
}

/// Relative motion of a pair along its `normal` at the reference, from there to where it is as near as dhat.
template <int Dim>
Vec<Dim> FrictionEnergy<Dim>::approach_of(const Pair& pair, const Vec<Dim>& normal, double dhat) const {
  double distance = 0;
  for (int k = 0; k < pair.size; ++k)
    distance += pair.coefficients[k] * normal.dot(reference_.view().template segment<Dim>(Dim * pair.vertices[k]));
  return -std::max(0.0, distance - dhat) * normal;
}

template <int Dim>
auto FrictionEnergy<Dim>::slip_velocity(const Pair& pair, ConstVectorView x) const -> Vec<kTangents> {
  Vec<Dim> relative = Vec<Dim>::Zero();
  const ConstVectorView reference = reference_.view();
  for (int k = 0; k < pair.size; ++k) {
    const int dof = Dim * pair.vertices[k];
    relative += pair.coefficients[k] * (x.segment<Dim>(dof) - reference.segment<Dim>(dof));
  }
  return rate_ * (pair.tangents.transpose() * (relative - pair.approach));
}

template <int Dim>
int FrictionEnergy<Dim>::count_let_go(ConstVectorView v, ConstVectorView x) const {
  return static_cast<int>(std::count_if(pairs_.begin(), pairs_.end(), [&](const Pair& pair) {
    const double eps = law_of(pair).eps;
    if (pair.kinetic == 1 || slip_velocity(pair, x).norm() < SlipLaw::kSlides * eps) return false;
    Vec<Dim> relative = Vec<Dim>::Zero();
    for (int k = 0; k < pair.size; ++k) relative += pair.coefficients[k] * v.segment<Dim>(Dim * pair.vertices[k]);
    return (pair.tangents.transpose() * relative).norm() < eps;
  }));
}

template <int Dim>
void FrictionEnergy<Dim>::begin_solve(ConstVectorView x, bool is_near) {
  is_primal_dual_ = true;
  for (Pair& pair : pairs_) {
    pair.slip = slip_velocity(pair, x);
    pair.ratio.setZero();
    if (is_near) pair.ratio = law_of(pair).by_speed(pair.slip.norm()) * pair.slip;
  }
}

template <int Dim>
void FrictionEnergy<Dim>::follow(ConstVectorView x, double fraction) {
  for (Pair& pair : pairs_) {
    const Vec<kTangents> slip = slip_velocity(pair, x);
    const Mat<kTangents> derivative = linearised_ratio<kTangents>(pair.slip, pair.ratio, law_of(pair));
    const Vec<kTangents> at_slip = law_of(pair).by_speed(pair.slip.norm()) * pair.slip;
    pair.ratio += fraction * (at_slip - pair.ratio) + derivative * (slip - pair.slip);
    pair.ratio /= std::max(1.0, pair.ratio.norm());
    pair.slip = slip;
  }
}

template <int Dim>
void FrictionEnergy<Dim>::relax(const FrictionEnergy& before, double factor) {
  const auto is_before = [](const Pair& a, const Pair& b) { return a.vertices < b.vertices; };
  std::vector<Pair> old = before.pairs_, relaxed;
  std::stable_sort(old.begin(), old.end(), is_before);
  std::stable_sort(pairs_.begin(), pairs_.end(), is_before);
  const double rest = std::max(0.0, 1 - factor);  // of pairs that are no more
  const auto keep = [&](const Pair& gone) {
    relaxed.push_back(gone);
    relaxed.back().force *= rest;
  };
  auto next = old.begin();
  for (Pair pair : pairs_) {
    for (; next != old.end() && is_before(*next, pair); ++next)
      if (rest > 0) keep(*next);
    if (next != old.end() && !is_before(pair, *next)) {
      pair.force = std::max(0.0, next->force + factor * (pair.force - next->force));
      ++next;
    } else {
      pair.force *= std::min(1.0, factor);
    }
    relaxed.push_back(pair);
  }
  for (; next != old.end() && rest > 0; ++next) keep(*next);
  pairs_ = std::move(relaxed);
}

template <int Dim>
double FrictionEnergy<Dim>::value(ConstVectorView x, Workspace&) const {
  double sum = 0;
  for (const auto& pair : pairs_) sum += pair.force * law_of(pair).potential(slip_velocity(pair, x).norm());
  return scale_ / rate_ * sum;
}

template <int Dim>
void FrictionEnergy<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const {
  for (const auto& pair : pairs_) {
    const Vec<kTangents> v = slip_velocity(pair, x);
    const Vec<Dim> force = scale_ * pair.force * law_of(pair).by_speed(v.norm()) * (pair.tangents * v);
    for (int k = 0; k < pair.size; ++k) gradient.segment<Dim>(Dim * pair.vertices[k]) += pair.coefficients[k] * force;
  }
}

template <int Dim>
void FrictionEnergy<Dim>::add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const {
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMost * Dim, kMost * Dim> block;
  for (const auto& pair : pairs_) {
    const Vec<kTangents> v = slip_velocity(pair, x);
    const SlipLaw law = law_of(pair);
    const double y = v.norm(), isotropic = law.by_speed(y);
    // Along v the second derivative is that of the law, across it f1 / y >= 0.
    Mat<kTangents> inner = isotropic * Mat<kTangents>::Identity();
    if (is_primal_dual_)
      inner = linearised_ratio<kTangents>(v, pair.ratio, law);
    else if (y > 0)
      inner += (projected(law.derivative(y), psd) - isotropic) / (y * y) * v * v.transpose();
    const double force = projected(pair.force, psd);
    if (force == 0) continue;
    const Mat<Dim> world = scale_ * rate_ * force * pair.tangents * inner * pair.tangents.transpose();
    const int dofs = Dim * pair.size;
    block.resize(dofs, dofs);
    for (int i = 0; i < pair.size; ++i)
      for (int j = 0; j < pair.size; ++j)
        block.template block<Dim, Dim>(Dim * i, Dim * j) = pair.coefficients[i] * pair.coefficients[j] * world;
    sink.add<Dim>(std::span(pair.vertices.data(), pair.size), block.data());
  }
}

template class FrictionEnergy<2>;
template class FrictionEnergy<3>;

}  // namespace itr
