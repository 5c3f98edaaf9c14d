// SPDX-License-Identifier: MIT
// Points that are coupled to surfaces of bodies (docs/theory.md, "Coupled points"). A point has no unknowns: where it is
// follows from means over its surface, as do the forces by which it acts there.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "energy/constraint.hpp"
#include "energy/energy.hpp"
#include "energy/nearest_rotation.hpp"
#include "energy/support.hpp"

namespace itr {

/// Means over the facets of a surface at rest, as functions of nodal displacements.
template <int Dim>
struct SurfaceMean {
  SurfaceMean(const CellSet<Dim>& cells, std::span<const int> surfaces);
  /// Columns: displacements of its nodes at positions x, or values of a field there.
  MatrixX displacements(ConstVectorView x) const { return values(x) - rest; }
  MatrixX values(ConstVectorView field) const;

  std::vector<int> nodes;  ///< ascending
  MatrixX rest;            ///< of the nodes, as columns [m]
  MatrixX weights;         ///< a row a node: of the mean, and of the mean times each component of X - centroid [m]
  Vec<Dim> centroid = Vec<Dim>::Zero();
  Mat<3> moments = Mat<3>::Zero();  ///< mean of (X - centroid)(X - centroid)^T [m^2]
  double area = 0;                  ///< [m^(Dim-1)]
  int part = kNone;                 ///< the connected part that it is of
};

/// A point that moves with the mean of a surface: by its mean displacement and its mean rotation, which is the nearest one
/// to the mean of x (X - centroid)^T.
template <int Dim>
class CoupledPoint {
 public:
  using Means = Eigen::Matrix<double, Dim, Dim + 1>;
  /// `mean` must outlive this.
  CoupledPoint(const SurfaceMean<Dim>& mean, const Vec<3>& point);

  NearestRotation<Dim> rotation(const Means& means) const;
  Vec<Dim> displacement(const Means& means, const Mat<3>& R) const {
    return means.col(0) + ((R - Mat<3>::Identity()) * arm_).template head<Dim>();
  }
  Means means_of(const MatrixX& displacements) const { return displacements * mean_.weights; }
  /// Motion of the point where the nodes are at x and move with v and a.
  Vec<Dim> displacement(ConstVectorView x) const;
  Vec<Dim> velocity(ConstVectorView x, ConstVectorView v) const;
  Vec<Dim> acceleration(ConstVectorView x, ConstVectorView v, ConstVectorView a) const;

  const SurfaceMean<Dim>& mean() const { return mean_; }
  const Vec<3>& arm() const { return arm_; }

 private:
  const SurfaceMean<Dim>& mean_;
  Vec<3> arm_ = Vec<3>::Zero();  ///< of the point about the centroid [m]
};

/// The parts of a coupling's energy, as functions of the displacement u and the turn R of its point.
template <int Dim>
struct PointTerms {
  Vec<Dim> force = Vec<Dim>::Zero();      ///< -force . u
  Mat<Dim> stiffness = Mat<Dim>::Zero();  ///< 1/2 (u - origin) . stiffness (u - origin)
  Vec<Dim> origin = Vec<Dim>::Zero();
  Mat<3> couple = Mat<3>::Zero();  ///< -couple : R
  double moment = 0, turn = 0;     ///< in 2D -moment times the angle from `turn` on
};

/// Prescribed components of the motion of a coupling's point.
template <int Dim>
struct HeldPoint {
  bool is_rigid = false;  ///< nodes move as the point's frame does
  std::array<bool, 3> position{}, rotation{};
  Vec<Dim> displacement = Vec<Dim>::Zero();
  Mat<3> turned = Mat<3>::Identity();
  double stiffness = 1;  ///< k of the augmented Lagrangian [N/m]
  std::string name{};    ///< for messages
};

/// scale * (PointTerms + sum over held components c of lambda c + k/2 c^2). Of a rigid surface the displacements of nodes
/// from where the frame has them are held, too.
template <int Dim>
class CouplingEnergy final : public Energy, public IncrementalTerm, public Constraint {
 public:
  using Means = typename CoupledPoint<Dim>::Means;
  CouplingEnergy(const CoupledPoint<Dim>& point, const PointTerms<Dim>& terms, HeldPoint<Dim> held, double scale);
  std::string_view name() const override { return "coupling"; }
  double value(ConstVectorView x, Workspace&) const override { return value_of(mean_.displacements(x)); }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override {
    add_gradient_of(mean_.displacements(x), gradient);
  }
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace&) const override;
  double value_at(const Increment& at, Workspace&) const override { return value_of(displacements_at(at)); }
  void add_gradient_at(const Increment& at, VectorView gradient, Workspace&) const override {
    add_gradient_of(displacements_at(at), gradient);
  }
  double value_round_off_at(const Increment& at, Workspace& workspace) const override;
  double error_at(const Increment& at) const override;
  void update(const Increment& at) override;
  void stiffen(double factor) override { held_.stiffness *= factor; }
  std::string describe(const Increment& at, const Units& units) const override;

  /// The gradient by the means, of which a traction -(first column + others (X - centroid)) / (scale area) comes.
  Means gradient_of_means(ConstVectorView x) const { return forces_at(mean_.displacements(x)).by_means; }
  /// Adds J^T stiffness J v with the derivative J of u: of a mass, its product.
  void add_product(ConstVectorView x, ConstVectorView v, VectorView product) const;

 private:
  /// Held components: of the displacement, of the turn, and of nodes as columns.
  struct Open {
    Vec<Dim> position = Vec<Dim>::Zero();
    Vec<3> rotation = Vec<3>::Zero();
    MatrixX nodes;
  };
  struct Forces {
    Means by_means = Means::Zero();  ///< gradient
    MatrixX by_nodes;                ///< as columns, of rigid surfaces
    Mat<3> by_rotation;              ///< gradient by R
    Vec<Dim> by_position;
  };
  MatrixX displacements_at(const Increment& at) const { return mean_.displacements(at.base) + mean_.values(at.d); }
  double rotation_stiffness() const { return held_.stiffness * mean_.moments.trace(); }
  Open open_at(const MatrixX& U, const Means& means, const Mat<3>& R) const;
  Forces forces_at(const MatrixX& U) const;
  double value_of(const MatrixX& U) const;
  void add_gradient_of(const MatrixX& U, VectorView gradient) const;
  double largest_open(const Open& open) const;
  bool is_linear() const;

  CoupledPoint<Dim> point_;
  const SurfaceMean<Dim>& mean_;
  PointTerms<Dim> terms_;
  HeldPoint<Dim> held_;
  Open multiplier_;
  MatrixX arms_;  ///< of nodes about the centroid, as columns
  double scale_;
};

}  // namespace itr
