// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>

#include "core/timer.hpp"
#include "direction.hpp"
#include "lanczos.hpp"
#include "search.hpp"

namespace itr {

/// The quadratic model with the true Hessian H, in a space that the projected step and H span: that of P^-1 g and P^-1 H
/// with the projected Hessian P. Its minimum within a trust region, by Lanczos' method (Gould, Lucidi, Roma & Toint 1999).
class KrylovModel {
 public:
  KrylovModel(NewtonSystem& system, const NewtonSystem::Product& H, const NewtonSystem::Product& P)
      : lanczos_(system, H, P) {}

  /// Begins with the projected step. `rhs` is -g.
  bool begin(ConstVectorView rhs) { return lanczos_.begin(rhs); }
  /// Extends the space until it has the minimum within a radius.
  bool extend(double radius) {
    constexpr int kMostVectors = 30;
    constexpr double kEnough = 0.1;  ///< residual of the minimum, of the right-hand side's
    for (int k = 0; k < kMostVectors; ++k) {
      const bool goes_on = lanczos_.extend();
      if (lanczos_.eigenvalues().size() == 0) return false;
      minimize(radius);
      if (!goes_on || lanczos_.residual_of(coefficients_) < kEnough * shortest()) break;
    }
    return true;
  }
  /// Norm in P of the projected step.
  double shortest() const { return lanczos_.first_norm(); }
  /// Finds the minimum within a radius, both in P, of the vectors of which the right-hand side has more than round-off: that
  /// would choose a side where a symmetric state is a saddle.
  void minimize(double radius) {
    constexpr int kMostHalvings = 60;
    constexpr double kNothing = 1e-6;  // of the right-hand side
    const auto has = [&](Eigen::Index i) { return std::abs(lanczos_.eigenvectors()(0, i)) > kNothing; };
    const VectorX& theta = lanczos_.eigenvalues();
    const VectorX b = shortest() * lanczos_.eigenvectors().row(0).transpose();
    const auto of_shift = [&](double shift) -> VectorX {
      return VectorX::NullaryExpr(b.size(), [&](Eigen::Index i) { return has(i) ? b[i] / (theta[i] + shift) : 0; });
    };
    Eigen::Index first = 0;
    while (first + 1 < b.size() && !has(first)) ++first;
    double low = std::max(0.0, -theta[first]), high = low + shortest() / radius;
    if (theta[first] > 0 && of_shift(0).norm() <= radius) high = 0;
    for (int i = 0; i < kMostHalvings && high > low; ++i) {
      const double middle = 0.5 * (low + high);
      (of_shift(middle).norm() > radius ? low : high) = middle;
    }
    const VectorX z = of_shift(high);
    coefficients_ = lanczos_.eigenvectors() * z;
    change_ = -b.dot(z) + 0.5 * z.dot(theta.cwiseProduct(z));
  }
  VectorX step() const { return lanczos_.sum_of(coefficients_); }
  /// Change of the energy along step(), by the model.
  double change() const { return change_; }
  double norm() const { return coefficients_.norm(); }
  bool is_convex() const { return lanczos_.least() > 0; }

 private:
  Lanczos lanczos_;
  VectorX coefficients_;
  double change_ = 0;
};

/// Makes a projected step longer where the true Hessian lets it. Beside a saddle the projected one is much stiffer, and
/// Newton would creep towards the saddle and away from it.
class LongStep {
 public:
  LongStep(const Task& task, Iterate& at, Direction& direction, Search& search)
      : task_(task),
        at_(at),
        direction_(direction),
        search_(search),
        candidate_(task.workspace.get<Scratch>().candidate.resize(at.x().size())) {}

  /// Moves along a longer step; false where there is none whose whole way is free and lowers the energy as the model says.
  bool take() {
    const NewtonSystem::Product& H = direction_.true_hessian();
    if (!H) return false;
    const NewtonSystem::Product P = task_.system.product();
    KrylovModel model(task_.system, H, P);
    {
      const ScopedTimer timer(task_.summary.linear_seconds);
      if (!model.begin(direction_.right_hand_side())) return false;
      radius_ = std::max(radius_, kFirst * model.shortest());
      if (!model.extend(radius_)) return false;
    }
    if (model.is_convex()) direction_.end_projection();
    VectorView direction = direction_.step().direction;
    const VectorX projected = direction;
    for (int trial = 0; trial < kMostTrials && radius_ >= model.shortest(); ++trial, radius_ /= 2) {
      model.minimize(radius_);
      const VectorX step = model.step();
      for (Eigen::Index i = 0; i < direction.size(); ++i)
        if (task_.dofs.unknown[i] != kNone) direction[i] = step[task_.dofs.unknown[i]];
      if (at_.free_fraction(direction) < 1) continue;
      candidate_ = at_.x() + direction;
      const double value = at_.value_at(candidate_), change = value - at_.value();
      if (!(change < kAcceptable * model.change())) continue;
      const bool is_too_short = change < kGood * model.change() && model.norm() > kAtEdge * radius_;
      at_.move_to(candidate_, value);
      if (is_too_short) {
        radius_ *= kFirst;
        search_.go_on(direction);
      }
      return true;
    }
    direction = projected;
    return false;
  }

 private:
  static constexpr double kFirst = 4;    ///< radius by the projected step, and by the one before after a good step
  static constexpr int kMostTrials = 4;  ///< each of half the radius
  static constexpr double kAcceptable = 0.25, kGood = 0.75;  ///< of the change of energy that the model promises
  static constexpr double kAtEdge = 0.9;                     ///< of the radius: a step that it bounds

  struct Scratch {
    ScratchVector candidate;
  };
  const Task& task_;
  Iterate& at_;
  Direction& direction_;
  Search& search_;
  VectorView candidate_;
  double radius_ = 0;  ///< in P
};

}  // namespace itr
