// SPDX-License-Identifier: MIT
#pragma once

#include <map>
#include <span>
#include <vector>

#include "energy/energy.hpp"
#include "fem/cell_set.hpp"
#include "itr/options.hpp"

namespace itr {

/// A connected part of bodies with a free rigid motion.
template <int Dim>
struct LoosePart {
  std::vector<int> nodes;
  double size = 0;       ///< diagonal of its box [m]
  double modulus = 0;    ///< largest, times size^(Dim - 2) [N/m]
  double acting = 0;     ///< sum of the forces that act on it, times the scaling [N]
  double stiffness = 0;  ///< sigma, times the scaling
  double hold = 0;       ///< that of the proximal term, times the scaling [N/m]
  double curvature() const { return stiffness + hold; }
};

/// The loose parts of a set of cells, and what each cell has of their mass.
template <int Dim>
struct LooseParts {
  std::vector<LoosePart<Dim>> parts;
  std::vector<int> of_element;  ///< index of the part, or kNone
  std::vector<double> mass;     ///< by element, of the part's mass; their sum over a part is 1
  bool empty() const { return parts.empty(); }
};

/// sigma / 2 |d - d_k|^2 in the mass norm about the iterate d_k itself, for bodies that conditions do not hold: no energy
/// and no force, only stiffness. A Newton step is then the one of least motion among those that lower the energy alike,
/// where the Hessian alone is singular. On request it is a proximal term, too, about positions that stay.
template <int Dim>
class LeastMotion final : public Energy {
 public:
  /// `cells` must outlive this.
  LeastMotion(const CellSet<Dim>& cells, LooseParts<Dim> loose, double scaling)
      : cells_(cells), loose_(std::move(loose)), scaling_(scaling) {}
  /// Sets sigma from the gradient and the absolute forces at the iterate. It fades with the forces that are left.
  void follow(ConstVectorView gradient, ConstVectorView sizes, const DofMap& dofs);
  const std::vector<LoosePart<Dim>>& parts() const { return loose_.parts; }
  /// The rigid motions of the parts at positions x, without their held dofs, as columns over all dofs; orthonormal in this
  /// term's Hessian.
  MatrixX rigid_motions(ConstVectorView x, const DofMap& dofs) const;

  /// Adds hold / 2 |x - anchor|^2, by which the forces that act, as last followed, carry a part by `reach` times its size.
  /// Infinite: nothing.
  void hold(ConstVectorView anchor, double reach);
  bool is_holding() const;  ///< any part: not where no force acts

  std::string_view name() const override { return "least motion"; }
  double value(ConstVectorView x, Workspace&) const override;
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override;
  void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const override;
  /// Asks for nothing: vertices that go alone would turn and shift the body.
  bool get_vertex_steps(ConstVectorView x, ConstVectorView dx, VectorView steps, Workspace& workspace) const override;

 private:
  const CellSet<Dim>& cells_;
  LooseParts<Dim> loose_;
  double scaling_;
  VectorX anchor_;  ///< empty: none
};

/// The connected parts of which `held` dofs leave a rigid motion free, at positions x. A rank of conditions, not a count:
/// rollers and single points hold what they hold. Each of `bonds` makes one part of those that its nodes are of.
template <int Dim>
LooseParts<Dim> find_loose_parts(const CellSet<Dim>& cells, ConstVectorView x, const std::vector<char>& held,
                                 const std::map<int, Material>& materials, std::span<const std::vector<int>> bonds = {});

}  // namespace itr
