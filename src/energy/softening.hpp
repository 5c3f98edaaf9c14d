// SPDX-License-Identifier: MIT
// Mullins' softening of rubber after Ogden and Roxburgh (1999), docs/theory.md, "Softening": over a step the potential is
// that of the law, plus a function of the law's energy density of shape W where that is below its largest value of the past.
#pragma once

#include <array>
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

/// The state of bodies that are at positions x and were nowhere else, a CellField of the largest W of the past; null where
/// none softens.
template <int Dim>
std::shared_ptr<const CellHistory> begin_softening(const Mesh<Dim>& mesh, const std::map<int, Material>& materials,
                                                   ConstVectorView x, double t);

/// The past at a point, for PastEnergy.
struct SofteningPoint {
  MullinsSoftening mullins{};
  ElasticModuli shape{};  ///< of the law's part that resists changes of shape
  double largest = 0;     ///< the largest W of the past

  double density(const Mat<3>& G) const;
  Mat<3> stress(const Mat<3>& G) const;
  Mat<9> hessian(const Mat<3>& G) const;
};

/// Takes the largest W at the vertices of the element of a rest position X.
template <int Dim>
SofteningPoint softening_point(const Material& material, const Vec<Dim>& X, const std::array<double, Dim + 1>& weights,
                               const typename CellField<Dim>::Records& largest);

/// A step of softening bodies.
template <int Dim>
class SofteningStep {
 public:
  using Records = typename CellField<Dim>::Records;

  SofteningStep(std::shared_ptr<const CellField<Dim>> start, const std::map<int, Material>& materials);
  bool acts_on(int body) const { return materials_.contains(body); }
  /// The largest W of the past at the vertices of an element.
  Records past(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element) const {
    return start_->on(cells, element);
  }
  /// The past of a body at its rest position X, by the past of its element.
  SofteningPoint point_at(int body, const Vec<Dim>& X, const std::array<double, Dim + 1>& weights,
                          const Records& past) const {
    return softening_point<Dim>(materials_.at(body), X, weights, past);
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

  std::shared_ptr<const CellField<Dim>> start_;
  std::map<int, Material> materials_;  ///< of bodies that soften
};

/// Compares W with its largest value at the points of kStateDegree.
template <int Dim>
using SofteningEnergy = PastEnergy<Dim, SofteningPoint>;
extern template class PastEnergy<2, SofteningPoint>;
extern template class PastEnergy<3, SofteningPoint>;

/// Cauchy stress in space [Pa] and energy density that softening adds to those of the law of a body that has come to F, at
/// the point X with barycentric coordinates `weights` of a cell with these records.
template <int Dim>
std::pair<Mat<3>, double> softening_of_state(const typename CellField<Dim>::Records& records,
                                             const std::array<double, Dim + 1>& weights, const Material& material,
                                             const Vec<Dim>& X, const Mat<3>& F);

}  // namespace itr
