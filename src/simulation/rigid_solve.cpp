// SPDX-License-Identifier: MIT
#include "simulation/rigid_solve.hpp"

#include <memory>
#include <utility>

#include "energy/arcs.hpp"
#include "energy/increment.hpp"
#include "energy/mapped.hpp"

namespace itr {

namespace {

/// The energy of an increment as a function of its coordinates.
template <int Dim>
class EnergyByCoordinates final : public MappedEnergy<Dim>, public Arcs {
 public:
  /// `rigid` must outlive this; `base`: where increments begin.
  EnergyByCoordinates(std::shared_ptr<const Energy> energy, const RigidCoordinates<Dim>& rigid, ConstVectorView base)
      : MappedEnergy<Dim>(std::move(energy), rigid.map()), rigid_(rigid), base_(rigid.coordinates_of(base)) {}
  double bend(ConstVectorView x, VectorView step) const override { return rigid_.bend(base_ + x, step); }
  /// Tells of none: a step that bounds turn lets tools tilt that nothing but contact holds.
  bool find_blocking(ConstVectorView, ConstVectorView, double, BlockingPairs&, Workspace&) const override { return false; }

 private:
  const RigidCoordinates<Dim>& rigid_;
  VectorX base_;
};

}  // namespace

template <int Dim>
NewtonSummary RigidSolve<Dim>::minimize(const EnergySum& sum, VectorX& d, VectorX target, NewtonSystem& system,
                                        const NewtonOptions& options, NewtonExtras extras, Workspace& workspace) const {
  const auto motion = [this](ConstVectorView of) { return rigid_.map()->motion(of); };
  VectorX z = rigid_.of_motion(d);
  for (int b = 0; b < rigid_.count(); ++b)
    for (const int node : rigid_.nodes(b)) target.template segment<Dim>(Dim * node).setZero();
  if (extras.step_to_start.size() > 0) {
    const VectorX gradient = std::exchange(extras.gradient_of_step, VectorX::Zero(d.size()));
    rigid_.map()->add_gradient(gradient, extras.gradient_of_step);
    extras.step_to_start = rigid_.of_motion(extras.step_to_start);
  }
  if (extras.after_step)
    extras.after_step = [&, before = extras.after_step](const VectorX& iterate) { return before(motion(iterate)); };
  extras.on_iteration = [&, before = extras.on_iteration](const NewtonProgress& progress) {
    d = motion(z);
    return !before || before(progress);
  };
  const EnergyByCoordinates<Dim> energy(std::make_shared<EnergyOfIncrement>(sum, base_), rigid_, base_);
  NewtonSummary summary = itr::minimize(energy, z, dofs_, target, system, options, workspace, extras);
  d = motion(z);
  for (VectorX* of : {&summary.blocked_from, &summary.blocked_step, &summary.failed_step})
    if (of->size() > 0) *of = motion(*of);
  return summary;
}

template <int Dim>
VectorX RigidSolve<Dim>::along_arcs(const VectorX& x) const {
  VectorX step = rigid_.of_motion(x - base_);
  rigid_.bend(rigid_.coordinates_of(base_), step);
  return base_ + rigid_.map()->motion(step);
}

template <int Dim>
MatrixX RigidSolve<Dim>::free_motions(MatrixX motions) const {
  for (Eigen::Index k = 0; k < motions.cols(); ++k) {
    VectorX motion = motions.col(k);
    for (int b = 0; b < rigid_.count(); ++b)
      if (rigid_.body(b).is_held())
        for (const int node : rigid_.nodes(b)) motion.template segment<Dim>(Dim * node).setZero();
    motions.col(k) = rigid_.of_motion(motion);
  }
  return motions;
}

template class RigidSolve<2>;
template class RigidSolve<3>;

}  // namespace itr
