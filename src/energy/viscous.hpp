// SPDX-License-Identifier: MIT
// Viscoelasticity of the deviator by a Prony series (docs/theory.md, "Viscoelasticity"). Over a step the potential is that
// of a law with other moduli, plus H : M(F) / 2 with a constant H of the past and a measure M of the change of shape.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "core/viscous_history.hpp"
#include "energy/elastic/laws.hpp"
#include "energy/energy.hpp"
#include "energy/increment.hpp"
#include "fem/cell_set.hpp"
#include "fem/displacement.hpp"
#include "fem/locator.hpp"

namespace itr {

/// M(F): J^(-2/3) C - 1 of laws with an isochoric part, C - 1 of other laws, 2 e of small strains.
enum class ShapeMeasure { isochoric, whole, small };
ShapeMeasure shape_measure(const Material& material);

/// H : M / 2 at a displacement gradient in space, and its derivatives by F (by columns).
double past_density(ShapeMeasure measure, const Mat<3>& G, const Mat<3>& H);
Mat<3> past_stress(ShapeMeasure measure, const Mat<3>& G, const Mat<3>& H);
Mat<9> past_hessian(ShapeMeasure measure, const Mat<3>& F, const Mat<3>& H);

/// The state of viscoelastic bodies at one time, linear on each cell: constant on straight cells that are not turned. A
/// record has of the instantaneous law the stress S = 2 dW/dM, the density W and S : M / 2, and of each term of the series
/// the stress Q that has relaxed, the energy E that the term stores and Q : M / 2.
template <int Dim>
class ViscousField final : public ViscousHistory {
 public:
  using Records = Eigen::Matrix<double, Eigen::Dynamic, Dim + 1>;  ///< at the vertices of a cell; no rows: it is elastic
  static constexpr int kOfLaw = 8, kOfTerm = 8, kDensity = 6, kProduct = 7;

  /// `by_cell` of a compact mesh.
  ViscousField(const Mesh<Dim>& mesh, double t, std::vector<Records> by_cell);
  double time() const { return t_; }
  const std::vector<Records>& by_cell() const { return by_cell_; }
  /// Records on an element of any mesh of the bodies: restricted exactly to one inside of a cell, else the nearest in L2.
  /// Adds to `variance` by record what that leaves out, the mean of the squares.
  Records on(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element, VectorX* variance = nullptr) const;

 private:
  bool has(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element) const;
  const Locator<Dim>& locator() const;
  std::array<double, Dim + 1> weights_in(CellId c, const Vec<Dim>& X) const;

  std::vector<Vec<Dim>> rest_;
  std::vector<std::array<VertexId, Dim + 1>> cells_;
  std::vector<int> body_;
  double t_;
  std::vector<Records> by_cell_;
  mutable std::once_flag once_;
  mutable std::unique_ptr<Locator<Dim>> locator_;
};

/// The state of bodies that come to positions x at once, or have long been there; null where none is viscoelastic.
template <int Dim>
std::shared_ptr<const ViscousHistory> begin_viscous(const Mesh<Dim>& mesh, const std::map<int, Material>& materials,
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

  /// `materials` are those of the setup, `dt` may be 0 or infinite [s].
  ViscousStep(std::shared_ptr<const ViscousField<Dim>> start, const std::map<int, Material>& materials, double dt);

  /// Share of the instantaneous moduli of shape that act on changes over the step.
  double factor(int body) const;
  ShapeMeasure measure(int body) const { return shape_measure(materials_.at(body)); }
  bool acts_on(int body) const { return materials_.contains(body); }
  /// H in an element.
  Stress past(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element) const;
  /// Energy that the bodies store at x beyond the potential's, without scale [J].
  double stored_excess(const CellSet<Dim>& cells, ConstVectorView x) const;

  struct End {
    std::shared_ptr<const ViscousHistory> state;
    double dissipation = 0;  ///< [J]
    double loss = 0;         ///< of energy by projection to the mesh, to second order in strains [J]
  };
  /// The state at the end of a step to x at the time t, on a compact mesh.
  End end(const Mesh<Dim>& mesh, ConstVectorView x, double t) const;

 private:
  struct Cell;
  Cell update(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element, ConstVectorView x) const;

  std::shared_ptr<const ViscousField<Dim>> start_;
  std::map<int, Material> materials_;  ///< viscoelastic ones
  std::map<int, std::vector<ViscousWeights>> weights_;
};

/// scale * integral of H : M(F) / 2 over the rest shape.
template <int Dim>
class ViscousEnergy final : public Energy, public IncrementalTerm {
 public:
  /// `cells` must outlive this; `degree` is that of the quadrature on curved elements.
  ViscousEnergy(const CellSet<Dim>& cells, std::shared_ptr<const ViscousStep<Dim>> step, double scale, int degree);
  std::string_view name() const override { return "viscous"; }
  double value(ConstVectorView x, Workspace&) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override;
  double value_at(const Increment& at, Workspace&) const override;
  void add_gradient_at(const Increment& at, VectorView gradient, Workspace&) const override;

 private:
  using Block = Mat<Dim * kQuadraticNodes<Dim>>;
  double value_of(const Displacement<Dim>& u) const;
  void add_gradient_of(const Displacement<Dim>& u, VectorView gradient) const;
  void add_block(std::size_t e, ConstVectorView x, PsdProjection psd, Block& block) const;
  template <typename F>
  void for_each_site(std::size_t e, const F& f) const;

  const CellSet<Dim>& cells_;
  std::shared_ptr<const ViscousStep<Dim>> step_;
  std::vector<typename ViscousStep<Dim>::Stress> past_;  ///< by element; 0 in elastic ones
  double scale_;
  int degree_;
};

/// Cauchy stress in space [Pa] and energy density that the past of a body adds to those of its instantaneous law, at a point
/// with barycentric coordinates `weights` of a cell with these records.
template <int Dim>
std::pair<Mat<3>, double> past_of_state(const typename ViscousField<Dim>::Records& records,
                                        const std::array<double, Dim + 1>& weights, const Material& material,
                                        const Mat<3>& F);

}  // namespace itr
