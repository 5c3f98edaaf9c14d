// SPDX-License-Identifier: MIT
#include "energy/energy.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/profile.hpp"
#include "core/scratch_vector.hpp"
#include "round_off.hpp"

namespace itr {

namespace {
constexpr std::string_view kAssembly = "assembly";

struct SecondSteps {  // which say that two terms can tell
  ScratchVector steps;
};
struct PartOfStep {
  ScratchVector dx;
};
struct TermScratch {
  ScratchVector gradient;
};
struct RoundOffScratch {
  ScratchVector x, gradient;
};
}  // namespace

void Energy::add_gradient_and_sizes(ConstVectorView x, VectorView gradient, VectorView sizes, Workspace& workspace) const {
  VectorView own = workspace.get<TermScratch>().gradient.resize(x.size());
  own.setZero();
  add_gradient(x, own, workspace);
  gradient += own;
  sizes += own.cwiseAbs();
}

double Energy::value_round_off(ConstVectorView x, Workspace& workspace) const {
  VectorView gradient = workspace.get<TermScratch>().gradient.resize(x.size());
  gradient.setZero();
  add_gradient(x, gradient, workspace);
  return kEpsilon * (std::abs(value(x, workspace)) + gradient.cwiseAbs().dot(x.cwiseAbs()));
}

void Energy::add_gradient_round_off(ConstVectorView x, VectorView round_off, Workspace& workspace) const {
  auto& scratch = workspace.get<RoundOffScratch>();
  VectorView other = scratch.x.resize(x.size()), change = scratch.gradient.resize(x.size());
  change.setZero();
  add_gradient(x, change, workspace);
  change = -change;
  change_last_bits(x, other);
  add_gradient(other, change, workspace);
  round_off += change.cwiseAbs();
}

double Energy::max_step(ConstVectorView, ConstVectorView, Workspace&) const { return 1; }

bool Energy::get_vertex_steps(ConstVectorView, ConstVectorView, VectorView, Workspace&) const { return false; }

bool Energy::find_blocking(ConstVectorView, ConstVectorView, double, BlockingPairs&, Workspace&) const { return false; }

void Energy::add_rank_ones(ConstVectorView, std::vector<RankOne>&) const {}

double EnergySum::value(ConstVectorView x, Workspace& workspace) const {
  double sum = 0;
  for (const auto& term : terms_) {
    const ScopedPhase phase("energy", term->name());
    sum += term->value(x, workspace);
    if (!std::isfinite(sum)) return sum;
  }
  return sum;
}

void EnergySum::add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const {
  for (const auto& term : terms_) {
    const ScopedPhase phase(kAssembly, term->name());
    term->add_gradient(x, gradient, workspace);
  }
}

void EnergySum::add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const {
  for (const auto& term : terms_) {
    const ScopedPhase phase(kAssembly, term->name());
    term->add_hessian(x, psd, sink, workspace);
  }
}

void EnergySum::add_gradient_and_sizes(ConstVectorView x, VectorView gradient, VectorView sizes,
                                       Workspace& workspace) const {
  for (const auto& term : terms_) {
    const ScopedPhase phase(kAssembly, term->name());
    term->add_gradient_and_sizes(x, gradient, sizes, workspace);
  }
}

double EnergySum::value_round_off(ConstVectorView x, Workspace& workspace) const {
  double sum = 0;
  for (const auto& term : terms_) sum += term->value_round_off(x, workspace);
  return sum;
}

double EnergySum::max_step(ConstVectorView x, ConstVectorView dx, Workspace& workspace) const {
  const ScopedPhase phase("ccd");
  double step = 1;
  auto& kept = workspace.get<PartOfStep>().dx;
  ScratchVector part = std::move(kept);  // a term may be a sum itself
  for (const auto& term : terms_) {      // each is asked only about the part of the way that those before it leave
    const double fraction = step < 1 ? term->max_step(x, part.view(), workspace) : term->max_step(x, dx, workspace);
    if (fraction == 1) continue;
    step *= fraction;
    part.resize(dx.size()) = step * dx;
  }
  kept = std::move(part);
  return step;
}

bool EnergySum::get_vertex_steps(ConstVectorView x, ConstVectorView dx, VectorView steps, Workspace& workspace) const {
  const ScopedPhase phase("ccd");
  bool has_told = false;
  for (const auto& term : terms_) {
    VectorView own = has_told ? workspace.get<SecondSteps>().steps.resize(dx.size()) : steps;
    const bool tells = term->get_vertex_steps(x, dx, own, workspace);
    if (!tells && term->max_step(x, dx, workspace) == 1) continue;
    if (!tells || has_told) return false;
    has_told = true;
  }
  return has_told;
}

bool EnergySum::find_blocking(ConstVectorView x, ConstVectorView dx, double fraction, BlockingPairs& blocking,
                              Workspace& workspace) const {
  const ScopedPhase phase("ccd");
  return std::any_of(terms_.begin(), terms_.end(),
                     [&](const auto& term) { return term->find_blocking(x, dx, fraction, blocking, workspace); });
}

}  // namespace itr
