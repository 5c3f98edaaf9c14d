// SPDX-License-Identifier: MIT
// The energy of cells by the positions of their nodes: what predictions, bounds and indicators of remeshing are made of.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <memory>
#include <optional>

#include <boost/container/small_vector.hpp>
#include "energy/elastic/jacobian_barrier.hpp"
#include "energy/elastic/point.hpp"
#include "energy/load_points.hpp"
#include "geometry/measures.hpp"
#include "itr/energy/terms.hpp"
#include "itr/fem/mass.hpp"

namespace itr {

/// A cell at positions of its nodes.
template <int Dim>
struct PlacedCell {
  std::array<Vec<Dim>, Dim + 1> rest;  ///< corners [m]
  CurvedEdges curved = 0;
  QuadraticCell<Dim> x;    ///< columns are nodes, corners first; those of straight edges are not read [m]
  QuadraticCell<Dim> way;  ///< from the predictor, where there is inertia [m]
  int level = 0;           ///< of quadrature, where edges are curved
};

/// Sums elasticity with its validity barrier, inertia and dead loads over cells: value, gradient and Hessian by nodes that
/// move, exact but for the barrier, of which only the value is taken. Without curved edges all integrals are closed forms,
/// with them those of the rules of quadrature that the terms of the step have. [J, times the scaling]
template <int Dim>
class CellModel {
 public:
  static constexpr int kNodes = kQuadraticNodes<Dim>;
  /// By node of a cell: the number of what moves with it, or kNone.
  using Places = std::array<int, kNodes>;
  static constexpr Places still() {
    Places places{};
    places.fill(kNone);
    return places;
  }
  /// Moves one node of a cell.
  static constexpr Places moving(int node) {
    Places places = still();
    if (node != kNone) places[node] = 0;
    return places;
  }

  /// `part`: the connected part of all cells. Nodes move `together`, or each by itself: then there are no Hessians between
  /// them. `terms` must outlive this.
  CellModel(const PotentialTerms<Dim>& terms, int part, bool together = false)
      : terms_(terms), part_(part), together_(together) {}

  void add(const PlacedCell<Dim>& cell, int body, const Places& places = still()) {
    const Mat<Dim> edges = edge_matrix<Dim>(cell.rest);
    const Geometry geometry{cell, terms_.materials.at(body), edges.inverse(), simplex_volume<Dim>(edges)};
    make_room(places);
    if (cell.curved)
      add_curved(geometry, places);
    else
      add_straight(geometry, places);
  }

  /// Adds the split of a cell without curved edges, of constant moduli and consistent mass, at the middle of its edge from
  /// corner `a` to `b`, by one evaluation: both halves deform and move as the whole did. `inverse`, `volume`: of the cell.
  void add_halves(const PlacedCell<Dim>& cell, int body, const Mat<Dim>& inverse, double volume, int a, int b) {
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
      for (int k = 0; k <= Dim; ++k) total += cell.way.col(k);
      middle.gradient += matrix.product(total, Vec<Dim>((cell.way.col(a) + cell.way.col(b)) / 2));
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

  /// Adds the tractions on a facet without curved edges. `places` are those of its corners.
  void add_facet(const std::array<Vec<Dim>, Dim>& rest, const std::array<Vec<Dim>, Dim>& x, int tag, const Places& places) {
    make_room(places);
    for (const auto& [loaded, traction] : terms_.loads.tractions)
      if (loaded == tag) add_load(rest, x, terms_.scaling * facet_area(rest), traction, places);
  }
  /// Adds the forces of tractions, as in its middle, on the node of an edge that a facet has curved.
  void add_facet_of_node(const std::array<Vec<Dim>, Dim>& rest, const Vec<Dim>& middle, int tag) {
    constexpr double kSecond = 1.0 / (Dim * (Dim + 1));  // integral of the product of two coordinates, by the area
    make_room(moving(0));
    for (const auto& [loaded, traction] : terms_.loads.tractions)
      if (loaded == tag)
        moving_[0].gradient -=
            terms_.scaling * 4 * kSecond * facet_area(rest) * traction(RestPoint<Dim>(middle, inward_normal(rest), part_));
  }

  double energy() const { return energy_; }
  double elastic_energy() const { return elastic_; }
  /// Whether a JacobianBarrier acts in one of the cells.
  bool has_barrier() const { return has_barrier_; }
  Vec<Dim> gradient(std::size_t i) const { return i < moving_.size() ? moving_[i].gradient : Vec<Dim>(Vec<Dim>::Zero()); }
  const Mat<Dim>& hessian(std::size_t i) const { return moving_[i].hessian; }

  /// Holds components of what moves with a number, of which conditions have these tags.
  void hold(std::size_t i, const std::array<int, Dim>& tags) {
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
  /// By how much the energy falls where what moves with a number finds its minimum by itself; infinity where there is none.
  double relaxation_of(std::size_t i) const {
    const Eigen::LLT<Mat<Dim>> llt(moving_[i].hessian);
    if (llt.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
    return 0.5 * moving_[i].gradient.dot(llt.solve(moving_[i].gradient));
  }
  /// By how much the energy falls where all that move together find its minimum; NaN where there is none.
  double relaxation() const {
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

 private:
  struct Moving {
    Vec<Dim> gradient = Vec<Dim>::Zero();
    Mat<Dim> hessian = Mat<Dim>::Zero();
  };
  struct Geometry {
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

  static Mat<Dim> corners_of(const QuadraticCell<Dim>& x) {
    Mat<Dim> edges;
    for (int k = 0; k < Dim; ++k) edges.col(k) = x.col(k + 1) - x.col(0);
    return edges;
  }

  void make_room(const Places& places) {
    const auto needed = static_cast<std::size_t>(*std::max_element(places.begin(), places.end()) + 1);
    if (needed <= moving_.size()) return;
    moving_.resize(needed);
    if (!together_) return;
    const auto size = static_cast<Eigen::Index>(Dim * needed);
    between_.conservativeResizeLike(MatrixX::Zero(size, size));
  }
  void add_energy(double elastic) {
    energy_ += elastic;
    elastic_ += elastic;
  }

  void add_straight(const Geometry& geometry, const Places& places) {
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

  void add_inertia(const PlacedCell<Dim>& cell, double mass, const Places& places) {
    Vec<Dim> total = Vec<Dim>::Zero();
    double squares = 0;
    for (int k = 0; k <= Dim; ++k) {
      total += cell.way.col(k);
      squares += cell.way.col(k).squaredNorm();
    }
    const ElementMass<Dim> matrix(terms_.mass, mass);
    energy_ += matrix.energy(total, squares);
    for (int k = 0; k <= Dim; ++k) {
      if (places[k] == kNone) continue;
      moving_[places[k]].gradient += matrix.product(total, Vec<Dim>(cell.way.col(k)));
      moving_[places[k]].hessian.diagonal().array() += matrix.diagonal();
      for (int l = 0; together_ && l <= Dim; ++l)
        if (places[l] != kNone && places[l] != places[k]) between(places[k], places[l]).diagonal().array() += matrix.off;
    }
  }

  template <std::size_t N>
  void add_load(const std::array<Vec<Dim>, N>& rest, const std::array<Vec<Dim>, N>& x, double weight,
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

  /// Whether F is the same all over the cell: its nodes are in the middle of their edges.
  static bool is_affine(const PlacedCell<Dim>& cell) {
    bool is = true;
    for_each_edge<Dim>([&](int edge, int i, int j) {
      if (cell.curved >> edge & 1) is = is && cell.x.col(Dim + 1 + edge) == (cell.x.col(i) + cell.x.col(j)) / 2;
    });
    return is;
  }

  void add_curved(const Geometry& geometry, const Places& places) {
    const PlacedCell<Dim>& cell = geometry.cell;
    PlacedCell<Dim> all = cell;  // with what is not read set to 0, of shape functions 0
    for (int k = Dim + 1; k < kNodes; ++k)
      if (!has_node<Dim>(cell.curved, k)) {
        all.x.col(k).setZero();
        all.way.col(k).setZero();
      }
    add_elasticity({all, geometry.material, geometry.inverse, geometry.volume}, places);
    if (terms_.has_inertia || terms_.loads.acceleration)
      add_mass_and_weight({all, geometry.material, geometry.inverse, geometry.volume}, places);
  }

  void add_elasticity(const Geometry& geometry, const Places& places) {
    const PlacedCell<Dim>& cell = geometry.cell;
    const auto linear = barycentric_gradients<Dim>(geometry.inverse);
    const bool is_uniform = is_affine(cell) && !geometry.material.has_varying_moduli();
    std::optional<ElasticPoint<Dim>> response;
    for (const auto& point : cell_quadrature<Dim>(cell.level, terms_.quadrature_degree)) {
      const auto shapes = quadratic_gradients<Dim, Dim>(cell.curved, point.weights, linear);
      const double weight = terms_.scaling * geometry.volume * point.share;
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

  void add_mass_and_weight(const Geometry& geometry, const Places& places) {
    const PlacedCell<Dim>& cell = geometry.cell;
    for (const auto& point : quadrature<Dim>(kMassDegree)) {
      const auto shapes = quadratic_shapes<Dim>(cell.curved, point.weights);
      const Vec<Dim> X = geometry.place(point.weights);
      const double weight = point.share * mass_density<Dim>(geometry.material, X) * geometry.volume;
      Vec<Dim> force = Vec<Dim>::Zero();
      if (terms_.has_inertia) {
        const Vec<Dim> here = cell.way * shapes;
        force = weight * here;
        energy_ += 0.5 * force.dot(here);
      }
      if (terms_.loads.acceleration) {
        const Vec<Dim> load =
            terms_.scaling * weight * terms_.loads.acceleration(RestPoint<Dim>(X, Vec<Dim>::Zero(), part_));
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

  auto between(int i, int j) { return between_.template block<Dim, Dim>(Dim * i, Dim * j); }

  const PotentialTerms<Dim>& terms_;
  int part_;
  bool together_;
  double energy_ = 0, elastic_ = 0;
  bool has_barrier_ = false;
  boost::container::small_vector<Moving, 4, std::allocator<Moving>> moving_;  ///< Boost's own allocator does not align
  MatrixX between_;  ///< Hessians between different ones, where they move together
};

}  // namespace itr
