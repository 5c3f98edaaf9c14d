// SPDX-License-Identifier: MIT
#include "energy/increment.hpp"

#include <cmath>

#include "core/profile.hpp"
#include "round_off.hpp"

namespace itr {

namespace {
struct PositionScratch {
  ScratchVector x;
};
struct TermScratch {
  ScratchVector gradient;
};
struct RoundOffScratch {
  ScratchVector base, d, gradient;
};
}  // namespace

double IncrementalTerm::value_round_off_at(const Increment& at, Workspace& workspace) const {
  VectorView gradient = workspace.get<TermScratch>().gradient.resize(at.d.size());
  gradient.setZero();
  add_gradient_at(at, gradient, workspace);
  return kEpsilon * (std::abs(value_at(at, workspace)) + gradient.cwiseAbs().dot(at.d.cwiseAbs()));
}

EnergyOfIncrement::EnergyOfIncrement(const EnergySum& sum, ConstVectorView base) : sum_(sum), base_(base) {
  for (const auto& term : sum.terms()) terms_.push_back({term, dynamic_cast<const IncrementalTerm*>(term.get())});
}

ConstVectorView EnergyOfIncrement::positions(ConstVectorView d, Workspace& workspace) const {
  VectorView x = workspace.get<PositionScratch>().x.resize(d.size());
  x = base_ + d;
  return x;
}

double EnergyOfIncrement::value(ConstVectorView d, Workspace& workspace) const {
  const ConstVectorView x = positions(d, workspace);
  double sum = 0;
  for (const Term& term : terms_) {
    const ScopedPhase phase("energy", term.energy->name());
    sum += term.incremental ? term.incremental->value_at({base_, d}, workspace) : term.energy->value(x, workspace);
    if (!std::isfinite(sum)) return sum;
  }
  return sum;
}

void EnergyOfIncrement::add_gradient_of(const Term& term, const Increment& at, ConstVectorView x, VectorView gradient,
                                        Workspace& workspace) const {
  const ScopedPhase phase("assembly", term.energy->name());
  if (term.incremental)
    term.incremental->add_gradient_at(at, gradient, workspace);
  else
    term.energy->add_gradient(x, gradient, workspace);
}

void EnergyOfIncrement::add_gradient(ConstVectorView d, VectorView gradient, Workspace& workspace) const {
  const ConstVectorView x = positions(d, workspace);
  for (const Term& term : terms_) add_gradient_of(term, {base_, d}, x, gradient, workspace);
}

void EnergyOfIncrement::add_gradient_and_sizes(ConstVectorView d, VectorView gradient, VectorView sizes,
                                               Workspace& workspace) const {
  const ConstVectorView x = positions(d, workspace);
  for (const Term& term : terms_) {
    VectorView own = workspace.get<TermScratch>().gradient.resize(d.size());
    own.setZero();
    add_gradient_of(term, {base_, d}, x, own, workspace);
    gradient += own;
    sizes += own.cwiseAbs();
  }
}

void EnergyOfIncrement::add_hessian(ConstVectorView d, PsdProjection psd, HessianSink& sink, Workspace& workspace) const {
  sum_.add_hessian(positions(d, workspace), psd, sink, workspace);
}

double EnergyOfIncrement::value_round_off(ConstVectorView d, Workspace& workspace) const {
  const auto phase = ScopedPhase::coarse("round-off");
  const ConstVectorView x = positions(d, workspace);
  double sum = 0;
  for (const Term& term : terms_)
    sum += term.incremental ? term.incremental->value_round_off_at({base_, d}, workspace)
                            : term.energy->value_round_off(x, workspace);
  return sum;
}

void EnergyOfIncrement::add_gradient_round_off(ConstVectorView d, VectorView round_off, Workspace& workspace) const {
  const auto phase = ScopedPhase::coarse("round-off");
  auto& scratch = workspace.get<RoundOffScratch>();
  VectorView base = scratch.base.resize(d.size()), other = scratch.d.resize(d.size());
  VectorView change = scratch.gradient.resize(d.size());
  change.setZero();
  add_gradient(d, change, workspace);
  change = -change;
  change_last_bits(base_, base);
  change_last_bits(d, other);
  EnergyOfIncrement(sum_, base).add_gradient(other, change, workspace);
  round_off += change.cwiseAbs();
}

double EnergyOfIncrement::max_step(ConstVectorView d, ConstVectorView dx, Workspace& workspace) const {
  return sum_.max_step(positions(d, workspace), dx, workspace);
}

bool EnergyOfIncrement::get_vertex_steps(ConstVectorView d, ConstVectorView dx, VectorView steps,
                                         Workspace& workspace) const {
  return sum_.get_vertex_steps(positions(d, workspace), dx, steps, workspace);
}

bool EnergyOfIncrement::find_blocking(ConstVectorView d, ConstVectorView dx, double fraction, BlockingPairs& blocking,
                                      Workspace& workspace) const {
  return sum_.find_blocking(positions(d, workspace), dx, fraction, blocking, workspace);
}

}  // namespace itr
