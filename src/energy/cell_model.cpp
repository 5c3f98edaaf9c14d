// SPDX-License-Identifier: MIT
#include "energy/cell_model.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <limits>
#include <optional>

#include "energy/elastic/jacobian_barrier.hpp"
#include "energy/elastic/point.hpp"
#include "energy/load_points.hpp"
#include "fem/mass.hpp"
#include "geometry/measures.hpp"

namespace itr {

namespace {

template <int Dim>
Mat<Dim> corners_of(const QuadraticCell<Dim>& x) {
  Mat<Dim> edges;
  for (int k = 0; k < Dim; ++k) edges.col(k) = x.col(k + 1) - x.col(0);
  return edges;
}

/// Whether F is the same all over the cell: its nodes are in the middle of their edges.
template <int Dim>
bool is_affine(const PlacedCell<Dim>& cell) {
  bool is = true;
  for_each_edge<Dim>([&](int edge, int i, int j) {
    if (cell.curved >> edge & 1) is = is && cell.x.col(Dim + 1 + edge) == (cell.x.col(i) + cell.x.col(j)) / 2;
  });
  return is;
}

}  // namespace

template <int Dim>
struct CellModel<Dim>::Geometry {
  const PlacedCell<Dim>& cell;
  const Material& material;
  Mat<Dim> inverse;
  double volume;

  Vec<Dim> place(const std::array<double, Dim + 1>& l) const {
    Vec<Dim> X = Vec<Dim>::Zero();
    for (int k = 0; k <= Dim; ++k) X += l[k] * cell.rest[k];
    return X;
  }
};

template <int Dim>
void CellModel<Dim>::add(const PlacedCell<Dim>& cell, int body, const Places& places) {
  const Mat<Dim> edges = edge_matrix<Dim>(cell.rest);
  const Geometry geometry{cell, terms_.materials.at(body), edges.inverse(), simplex_volume<Dim>(edges)};
  make_room(places);
  if (cell.curved)
    add_curved(geometry, places);
  else
    add_straight(geometry, places);
}

template <int Dim>
void CellModel<Dim>::add_halves(const PlacedCell<Dim>& cell, int body, const Mat<Dim>& inverse, double volume, int a,
                                int b) {
  make_room(moving(a));
  Moving& middle = moving_[0];
  const Material& material = terms_.materials.at(body);
  const Mat<Dim> F = corners_of(cell.x) * inverse;
  const ElasticPoint<Dim> response(F, elastic_moduli<Dim>(material, cell.rest[0]));
  const Vec<Dim> ga = barycentric_gradient<Dim>(inverse, a), gb = barycentric_gradient<Dim>(inverse, b);
  const double sV = terms_.scaling * volume, mass = material.density * volume;
  middle.gradient += sV * response.gradient(ga + gb);
  middle.hessian += 2 * sV * (response.hessian(ga) + response.hessian(gb));
  if (terms_.has_inertia) {
    const ElementMass<Dim> matrix(terms_.mass, mass);
    Vec<Dim> total = Vec<Dim>::Zero();
    for (int k = 0; k <= Dim; ++k) total += cell.step.col(k);
    middle.gradient += matrix.product(total, Vec<Dim>((cell.step.col(a) + cell.step.col(b)) / 2));
    middle.hessian.diagonal().array() += matrix.diagonal();
  }
  if (!terms_.loads.acceleration) return;
  std::array<Vec<Dim>, Dim + 1> x;
  for (int k = 0; k <= Dim; ++k) x[k] = cell.x.col(k);
  add_load(cell.rest, x, -terms_.scaling * mass, terms_.loads.acceleration, still());
  for (const int end : {a, b}) {
    auto rest = cell.rest, half = x;
    rest[end] = (rest[a] + rest[b]) / 2;
    half[end] = (half[a] + half[b]) / 2;
    add_load(rest, half, terms_.scaling * mass / 2, terms_.loads.acceleration, moving(end));
  }
}

template <int Dim>
void CellModel<Dim>::add_facet(const std::array<Vec<Dim>, Dim>& rest, const std::array<Vec<Dim>, Dim>& x, int tag,
                               const Places& places) {
  make_room(places);
  for (const auto& [loaded, traction] : terms_.loads.tractions)
    if (loaded == tag) add_load(rest, x, terms_.scaling * facet_area(rest), traction, places);
}

template <int Dim>
void CellModel<Dim>::add_facet_of_node(const std::array<Vec<Dim>, Dim>& rest, const Vec<Dim>& middle, int tag) {
  constexpr double kSecond = 1.0 / (Dim * (Dim + 1));  // integral of the product of two coordinates, by the area
  make_room(moving(0));
  for (const auto& [loaded, traction] : terms_.loads.tractions)
    if (loaded == tag)
      moving_[0].gradient -=
          terms_.scaling * 4 * kSecond * facet_area(rest) * traction(RestPoint<Dim>(middle, inward_normal(rest), part_));
}

template <int Dim>
void CellModel<Dim>::hold(std::size_t i, const std::array<int, Dim>& tags) {
  for (int c = 0; c < Dim; ++c) {
    if (tags[c] == kNoTag || i >= moving_.size()) continue;
    moving_[i].gradient[c] = 0;
    moving_[i].hessian.row(c).setZero();
    moving_[i].hessian.col(c).setZero();
    moving_[i].hessian(c, c) = 1;
    if (!together_) continue;
    between_.row(static_cast<Eigen::Index>(Dim * i) + c).setZero();
    between_.col(static_cast<Eigen::Index>(Dim * i) + c).setZero();
  }
}

template <int Dim>
double CellModel<Dim>::relaxation_of(std::size_t i) const {
  const Eigen::LLT<Mat<Dim>> llt(moving_[i].hessian);
  if (llt.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
  return 0.5 * moving_[i].gradient.dot(llt.solve(moving_[i].gradient));
}

template <int Dim>
double CellModel<Dim>::relaxation() const {
  const auto size = static_cast<Eigen::Index>(Dim * moving_.size());
  VectorX gradient(size);
  MatrixX hessian = between_;
  for (Eigen::Index i = 0; i < size; i += Dim) {
    gradient.segment<Dim>(i) = moving_[i / Dim].gradient;
    hessian.block<Dim, Dim>(i, i) = moving_[i / Dim].hessian;
  }
  const Eigen::LLT<MatrixX> llt(hessian);
  if (llt.info() != Eigen::Success) return std::numeric_limits<double>::quiet_NaN();
  return 0.5 * gradient.dot(llt.solve(gradient));
}

template <int Dim>
void CellModel<Dim>::make_room(const Places& places) {
  const auto needed = static_cast<std::size_t>(*std::max_element(places.begin(), places.end()) + 1);
  if (needed <= moving_.size()) return;
  moving_.resize(needed);
  if (!together_) return;
  const auto size = static_cast<Eigen::Index>(Dim * needed);
  between_.conservativeResizeLike(MatrixX::Zero(size, size));
}

template <int Dim>
void CellModel<Dim>::add_straight(const Geometry& geometry, const Places& places) {
  const PlacedCell<Dim>& cell = geometry.cell;
  Vec<Dim> center = Vec<Dim>::Zero();
  for (const auto& p : cell.rest) center += p / (Dim + 1);
  const ElasticModuli moduli = elastic_moduli<Dim>(geometry.material, center);
  const Mat<Dim> F = corners_of(cell.x) * geometry.inverse;
  const double s = terms_.scaling, V = geometry.volume;
  const double mass = mass_density<Dim>(geometry.material, center) * V;
  if (places == still()) {
    add_energy(s * V * elastic_density<Dim>(F, moduli));
  } else {
    const ElasticPoint<Dim> response(F, moduli);
    add_energy(s * V * response.density());
    for (int k = 0; k <= Dim; ++k) {
      if (places[k] == kNone) continue;
      const Vec<Dim> shape = barycentric_gradient<Dim>(geometry.inverse, k);
      moving_[places[k]].gradient += s * V * response.gradient(shape);
      moving_[places[k]].hessian += s * V * response.hessian(shape);
      for (int l = 0; together_ && l <= Dim; ++l)
        if (places[l] != kNone && places[l] != places[k])
          between(places[k], places[l]) += s * V * response.hessian(shape, barycentric_gradient<Dim>(geometry.inverse, l));
    }
  }
  if (terms_.has_inertia) add_inertia(cell, mass, places);
  if (!terms_.loads.acceleration) return;
  std::array<Vec<Dim>, Dim + 1> x;
  for (int k = 0; k <= Dim; ++k) x[k] = cell.x.col(k);
  add_load(cell.rest, x, s * mass, terms_.loads.acceleration, places);
}

template <int Dim>
void CellModel<Dim>::add_inertia(const PlacedCell<Dim>& cell, double mass, const Places& places) {
  Vec<Dim> total = Vec<Dim>::Zero();
  double squares = 0;
  for (int k = 0; k <= Dim; ++k) {
    total += cell.step.col(k);
    squares += cell.step.col(k).squaredNorm();
  }
  const ElementMass<Dim> matrix(terms_.mass, mass);
  energy_ += matrix.energy(total, squares);
  for (int k = 0; k <= Dim; ++k) {
    if (places[k] == kNone) continue;
    moving_[places[k]].gradient += matrix.product(total, Vec<Dim>(cell.step.col(k)));
    moving_[places[k]].hessian.diagonal().array() += matrix.diagonal();
    for (int l = 0; together_ && l <= Dim; ++l)
      if (places[l] != kNone && places[l] != places[k]) between(places[k], places[l]).diagonal().array() += matrix.off;
  }
}

template <int Dim>
template <std::size_t N>
void CellModel<Dim>::add_load(const std::array<Vec<Dim>, N>& rest, const std::array<Vec<Dim>, N>& x, double weight,
                              const std::function<Vec<Dim>(const RestPoint<Dim>&)>& load, const Places& places) {
  using Point = LoadPoint<N>;
  std::array<Vec<Dim>, N> u;
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (std::size_t k = 0; k < N; ++k) {
    u[k] = x[k] - rest[k];
    sum += u[k];
  }
  for_each_load_point<Dim>(rest, part_, weight, load, [&](std::size_t q, const Vec<Dim>& force) {
    energy_ -= force.dot(Point::at(q, u, sum));
    for (std::size_t k = 0; k < N; ++k)
      if (places[k] != kNone) moving_[places[k]].gradient -= (q == k ? Point::kNear : Point::kFar) * force;
  });
}

template <int Dim>
void CellModel<Dim>::add_curved(const Geometry& geometry, const Places& places) {
  const PlacedCell<Dim>& cell = geometry.cell;
  PlacedCell<Dim> all = cell;  // with what is not read set to 0, of shape functions 0
  for (int k = Dim + 1; k < kNodes; ++k)
    if (!has_node<Dim>(cell.curved, k)) {
      all.x.col(k).setZero();
      all.step.col(k).setZero();
    }
  add_elasticity({all, geometry.material, geometry.inverse, geometry.volume}, places);
  if (terms_.has_inertia || terms_.loads.acceleration)
    add_mass_and_weight({all, geometry.material, geometry.inverse, geometry.volume}, places);
}

template <int Dim>
void CellModel<Dim>::add_elasticity(const Geometry& geometry, const Places& places) {
  const PlacedCell<Dim>& cell = geometry.cell;
  const auto linear = barycentric_gradients<Dim>(geometry.inverse);
  const bool is_uniform = is_affine(cell) && !geometry.material.has_varying_moduli();
  std::optional<ElasticPoint<Dim>> response;
  for (const auto& point : cell_quadrature<Dim>(cell.level, terms_.quadrature_degree)) {
    const auto shapes = quadratic_gradients<Dim, Dim>(cell.curved, point.weights, linear);
    const double weight = terms_.scaling * geometry.volume * point.fraction;
    if (!response || !is_uniform)
      response.emplace(Mat<Dim>(cell.x * shapes.transpose()),
                       elastic_moduli<Dim>(geometry.material, geometry.place(point.weights)));
    add_energy(weight * response->density());
    for (int k = 0; k < kNodes; ++k) {
      if (places[k] == kNone) continue;
      moving_[places[k]].gradient += weight * response->gradient(shapes.col(k));
      moving_[places[k]].hessian += weight * response->hessian(shapes.col(k));
      for (int l = 0; together_ && l < kNodes; ++l)
        if (places[l] != kNone && places[l] != places[k])
          between(places[k], places[l]) += weight * response->hessian(shapes.col(k), shapes.col(l));
    }
  }
  const JacobianBarrier<Dim> barrier(cell.curved, linear, cell.x);
  if (!barrier.is_active()) return;
  has_barrier_ = true;
  std::array<double, Dim + 1> barycenter;
  barycenter.fill(1.0 / (Dim + 1));
  add_energy(terms_.scaling * geometry.volume *
             barrier_density<Dim>(barrier, elastic_moduli<Dim>(geometry.material, geometry.place(barycenter))));
}

template <int Dim>
void CellModel<Dim>::add_mass_and_weight(const Geometry& geometry, const Places& places) {
  const PlacedCell<Dim>& cell = geometry.cell;
  for (const auto& point : quadrature<Dim>(kMassDegree)) {
    const auto shapes = quadratic_shapes<Dim>(cell.curved, point.weights);
    const Vec<Dim> X = geometry.place(point.weights);
    const double weight = point.fraction * mass_density<Dim>(geometry.material, X) * geometry.volume;
    Vec<Dim> force = Vec<Dim>::Zero();
    if (terms_.has_inertia) {
      const Vec<Dim> here = cell.step * shapes;
      force = weight * here;
      energy_ += 0.5 * force.dot(here);
    }
    if (terms_.loads.acceleration) {
      const Vec<Dim> load = terms_.scaling * weight * terms_.loads.acceleration(RestPoint<Dim>(X, Vec<Dim>::Zero(), part_));
      energy_ -= load.dot(cell.x * shapes - X);
      force -= load;
    }
    for (int k = 0; k < kNodes; ++k) {
      if (places[k] == kNone) continue;
      moving_[places[k]].gradient += shapes[k] * force;
      if (!terms_.has_inertia) continue;
      moving_[places[k]].hessian.diagonal().array() += weight * shapes[k] * shapes[k];
      for (int l = 0; together_ && l < kNodes; ++l)
        if (places[l] != kNone && places[l] != places[k])
          between(places[k], places[l]).diagonal().array() += weight * shapes[k] * shapes[l];
    }
  }
}

template class CellModel<2>;
template class CellModel<3>;

}  // namespace itr
