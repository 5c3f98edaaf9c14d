// SPDX-License-Identifier: MIT
// Viscoelasticity of the deviator by a Prony series (docs/theory.md, "Viscoelasticity"). Over a step the potential is that
// of a law with other moduli, plus H : M(F) / 2 with a constant H of the past and a measure M of the change of shape.
#pragma once

#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "energy/cell_field.hpp"
#include "energy/elastic/growth.hpp"
#include "energy/elastic/laws.hpp"
#include "energy/past_energy.hpp"

namespace itr {

/// M(F), of the elastic part of F: J^(-2/3) C - 1 of laws with an isochoric part, C - 1 of other laws, 2 e of small strains.
enum class ShapeMeasure { isochoric, whole, small };
ShapeMeasure shape_measure(const Material& material);

/// H : M / 2 at a displacement gradient in space, and its derivatives by F (by columns).
double past_density(ShapeMeasure measure, const Mat<3>& G, const Mat<3>& H);
Mat<3> past_stress(ShapeMeasure measure, const Mat<3>& G, const Mat<3>& H);
Mat<9> past_hessian(ShapeMeasure measure, const Mat<3>& F, const Mat<3>& H);

/// The state of viscoelastic bodies at one time. A record has of the instantaneous law the stress S = 2 dW/dM, the density W
/// and S : M / 2, and of each term of the series the stress Q that has relaxed, the energy E that the term stores and Q : M
/// / 2.
template <int Dim>
class ViscousField final : public CellField<Dim> {
 public:
  using CellField<Dim>::CellField;
  static constexpr int kOfLaw = 8, kOfTerm = 8, kDensity = 6, kProduct = 7;
};

/// The state of bodies that come to positions x at once, or have long been there; null where none is viscoelastic. Cells
/// that are where they are at rest have no stress: an eigenstrain there acts from the first step on.
template <int Dim>
std::shared_ptr<const CellHistory> begin_viscous(const Mesh<Dim>& mesh, const std::map<int, Material>& materials,
                                                 ConstVectorView x, double t, bool has_relaxed = false);

/// Weights of a term over a step of y = dt / tau in which stresses of the law change evenly: with its decay e = exp(-y) and
/// the share a = (1 - e) / y of a change of stress that is left at the end.
struct ViscousWeights {
  double g, decay, left;
  double relaxed, carried;  ///< 1 - a and a - e
  double work, stored;      ///< these by y

  ViscousWeights(const PronyTerm& term, double dt);
};

/// A step of viscoelastic bodies: stresses of the law change evenly over its length.
template <int Dim>
class ViscousStep {
 public:
  using Records = typename ViscousField<Dim>::Records;
  using Stress = Eigen::Matrix<double, 6, Dim + 1>;  ///< 00, 11, 22, 01, 02, 12 at the vertices of a cell [Pa]

  /// `materials` are those of the setup at the end of the step, `dt` may be 0 or infinite [s].
  ViscousStep(std::shared_ptr<const ViscousField<Dim>> start, const std::map<int, Material>& materials, double dt);

  /// Share of the instantaneous moduli of shape that act on changes over the step.
  double factor(int body) const;
  ShapeMeasure measure(int body) const { return shape_measure(material(body)); }
  const Material& material(int body) const { return materials_.at(body); }
  bool acts_on(int body) const { return materials_.contains(body); }
  /// H in an element.
  Stress past(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element) const;
  /// Energy that the bodies store at x beyond the potential's, without scale [J].
  double stored_excess(const CellSet<Dim>& cells, ConstVectorView x) const;

  /// The state at the end of a step to x at the time t, on a compact mesh; the loss is to second order in strains.
  HistoryEnd end(const Mesh<Dim>& mesh, ConstVectorView x, double t) const;

 private:
  struct Cell;
  Cell update(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element, ConstVectorView x) const;

  std::shared_ptr<const ViscousField<Dim>> start_;
  std::map<int, Material> materials_;  ///< viscoelastic ones
  std::map<int, std::vector<ViscousWeights>> weights_;
};

/// The past of the elements of `cells`, for PastEnergy: H : M(F) / 2.
template <int Dim>
class ViscousPast {
 public:
  ViscousPast(const CellSet<Dim>& cells, std::shared_ptr<const ViscousStep<Dim>> step);
  struct Point {
    ShapeMeasure measure;
    Mat<3> H;
    Growth growth;

    double density(const Mat<3>& G) const {
      return volume_ratio(growth) * past_density(measure, elastic_gradient(G, growth), H);
    }
    Mat<3> stress(const Mat<3>& G) const;
    Mat<9> hessian(const Mat<3>& G) const;
  };
  bool acts_on(const typename CellSet<Dim>::Element& element) const { return step_->acts_on(element.body); }
  Point at(std::size_t e, const typename CellSet<Dim>::Element& element, const QuadraturePoint<Dim>& point) const;

 private:
  const CellSet<Dim>* cells_;
  std::shared_ptr<const ViscousStep<Dim>> step_;
  std::vector<typename ViscousStep<Dim>::Stress> by_element_;  ///< 0 in elastic ones
};

template <int Dim>
using ViscousEnergy = PastEnergy<Dim, ViscousPast<Dim>>;

/// Cauchy stress in space [Pa] and energy density that the past of a body adds to those of its instantaneous law, at the
/// rest position X, a point with barycentric coordinates `weights` of a cell with these records.
template <int Dim>
std::pair<Mat<3>, double> past_of_state(const typename ViscousField<Dim>::Records& records,
                                        const std::array<double, Dim + 1>& weights, const Material& material,
                                        const Vec<3>& X, const Mat<3>& F);

}  // namespace itr
