// SPDX-License-Identifier: MIT
// Mullins' softening of rubber after Ogden and Roxburgh (1999), docs/theory.md, "Softening": over a step the potential is
// that of the law, plus a function of the law's energy density of shape W where that is below its largest value of the past.
#pragma once

#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "energy/cell_field.hpp"
#include "energy/elastic/laws.hpp"
#include "energy/past_energy.hpp"

namespace itr {

/// A function of W with its derivatives [Pa, 1, 1/Pa].
struct SofteningResponse {
  double value = 0, first = 0, second = 0;
};
/// Integral of (1 - eta) from W to `largest`, which softening adds to W; 0 from there on.
SofteningResponse softening(const MullinsSoftening& mullins, double W, double largest);
/// The energy density that has been lost where the largest W was `largest` >= 0, and its derivative.
struct LostDensity {
  double value, slope;
};
LostDensity lost_density(const MullinsSoftening& mullins, double largest);

/// The state of softening bodies at one time: a record is the largest W of the past.
template <int Dim>
class SofteningField final : public CellField<Dim> {
 public:
  using CellField<Dim>::CellField;
};

/// The state of bodies that are at positions x and were nowhere else; null where none softens.
template <int Dim>
std::shared_ptr<const CellHistory> begin_softening(const Mesh<Dim>& mesh, const std::map<int, Material>& materials,
                                                   ConstVectorView x, double t);

/// A step of softening bodies.
template <int Dim>
class SofteningStep {
 public:
  using Records = typename CellField<Dim>::Records;

  SofteningStep(std::shared_ptr<const SofteningField<Dim>> start, const std::map<int, Material>& materials);
  bool acts_on(int body) const { return materials_.contains(body); }
  const Material& material(int body) const { return materials_.at(body); }
  /// The largest W of the past at the vertices of an element.
  Records largest(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element) const {
    return start_->on(cells, element);
  }
  /// Energy that has been lost at the end of a step to x, and before, without scale [J]: the potential's part that bodies do
  /// not get back.
  double lost(const CellSet<Dim>& cells, ConstVectorView x) const;
  /// The state at the end of a step to x at the time t, on a compact mesh. `loss` is the lost energy of which the mesh does
  /// not know the place.
  HistoryEnd end(const Mesh<Dim>& mesh, ConstVectorView x, double t) const;

 private:
  struct Cell;
  Cell update(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element, ConstVectorView x) const;

  std::shared_ptr<const SofteningField<Dim>> start_;
  std::map<int, Material> materials_;  ///< of bodies that soften
};

/// The past of the elements of `cells`, for PastEnergy of kStateDegree: where W is compared with its largest value.
template <int Dim>
class SofteningPast {
 public:
  SofteningPast(const CellSet<Dim>& cells, std::shared_ptr<const SofteningStep<Dim>> step);
  struct Point {
    const MullinsSoftening& mullins;
    ElasticModuli shape;  ///< of the law's part that resists changes of shape
    double largest;

    double density(const Mat<3>& G) const;
    Mat<3> stress(const Mat<3>& G) const;
    Mat<9> hessian(const Mat<3>& G) const;
  };
  bool acts_on(const typename CellSet<Dim>::Element& element) const { return step_->acts_on(element.body); }
  Point at(std::size_t e, const typename CellSet<Dim>::Element& element, const QuadraturePoint<Dim>& point) const;

 private:
  const CellSet<Dim>& cells_;
  std::shared_ptr<const SofteningStep<Dim>> step_;
  std::vector<typename SofteningStep<Dim>::Records> by_element_;
};

template <int Dim>
using SofteningEnergy = PastEnergy<Dim, SofteningPast<Dim>>;

/// Cauchy stress in space [Pa] and energy density that softening adds to those of the law of a body that has come to F, at
/// the point X with barycentric coordinates `weights` of a cell with these records.
template <int Dim>
std::pair<Mat<3>, double> softening_of_state(const typename CellField<Dim>::Records& records,
                                             const std::array<double, Dim + 1>& weights, const Material& material,
                                             const Vec<Dim>& X, const Mat<3>& F);

}  // namespace itr
