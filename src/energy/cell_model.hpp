// SPDX-License-Identifier: MIT
// The energy of cells by the positions of their nodes: what predictions, bounds and indicators of remeshing are made of.
#pragma once

#include <array>
#include <functional>
#include <memory>

#include <boost/container/small_vector.hpp>
#include "energy/terms.hpp"
#include "geometry/quadratic_validity.hpp"

namespace itr {

/// A cell at positions of its nodes.
template <int Dim>
struct PlacedCell {
  std::array<Vec<Dim>, Dim + 1> rest;  ///< corners [m]
  CurvedEdges curved = 0;
  QuadraticCell<Dim> x;     ///< columns are nodes, corners first; those of straight edges are not read [m]
  QuadraticCell<Dim> step;  ///< from the predictor, where there is inertia [m]
  int level = 0;            ///< of quadrature, where edges are curved
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

  void add(const PlacedCell<Dim>& cell, int body, const Places& places = still());

  /// Adds the split of a cell without curved edges, of constant moduli and consistent mass, at the middle of its edge from
  /// corner `a` to `b`, by one evaluation: both halves deform and move as the whole did. `inverse`, `volume`: of the cell.
  void add_halves(const PlacedCell<Dim>& cell, int body, const Mat<Dim>& inverse, double volume, int a, int b);

  /// Adds the tractions on a facet without curved edges. `places` are those of its corners.
  void add_facet(const std::array<Vec<Dim>, Dim>& rest, const std::array<Vec<Dim>, Dim>& x, int tag, const Places& places);
  /// Adds the forces of tractions, as in its middle, on the node of an edge that a facet has curved.
  void add_facet_of_node(const std::array<Vec<Dim>, Dim>& rest, const Vec<Dim>& middle, int tag);

  double energy() const { return energy_; }
  double elastic_energy() const { return elastic_; }
  /// Whether a JacobianBarrier acts in one of the cells.
  bool has_barrier() const { return has_barrier_; }
  Vec<Dim> gradient(std::size_t i) const { return i < moving_.size() ? moving_[i].gradient : Vec<Dim>(Vec<Dim>::Zero()); }
  const Mat<Dim>& hessian(std::size_t i) const { return moving_[i].hessian; }

  /// Holds components of what moves with a number, of which conditions have these tags.
  void hold(std::size_t i, const std::array<int, Dim>& tags);
  /// By how much the energy falls where what moves with a number finds its minimum by itself; infinity where there is none.
  double relaxation_of(std::size_t i) const;
  /// By how much the energy falls where all that move together find its minimum; NaN where there is none.
  double relaxation() const;

 private:
  struct Moving {
    Vec<Dim> gradient = Vec<Dim>::Zero();
    Mat<Dim> hessian = Mat<Dim>::Zero();
  };
  struct Geometry;

  void make_room(const Places& places);
  void add_energy(double elastic) {
    energy_ += elastic;
    elastic_ += elastic;
  }

  void add_straight(const Geometry& geometry, const Places& places);
  void add_inertia(const PlacedCell<Dim>& cell, double mass, const Places& places);
  template <std::size_t N>
  void add_load(const std::array<Vec<Dim>, N>& rest, const std::array<Vec<Dim>, N>& x, double weight,
                const std::function<Vec<Dim>(const RestPoint<Dim>&)>& load, const Places& places);
  void add_curved(const Geometry& geometry, const Places& places);
  void add_elasticity(const Geometry& geometry, const Places& places);
  void add_mass_and_weight(const Geometry& geometry, const Places& places);

  auto between(int i, int j) { return between_.template block<Dim, Dim>(Dim * i, Dim * j); }

  const PotentialTerms<Dim>& terms_;
  int part_;
  bool together_;
  double energy_ = 0, elastic_ = 0;
  bool has_barrier_ = false;
  boost::container::small_vector<Moving, 4, std::allocator<Moving>> moving_;  ///< Boost's own allocator does not align
  MatrixX between_;  ///< Hessians between different ones, where they move together
};

extern template class CellModel<2>;
extern template class CellModel<3>;

}  // namespace itr
