// SPDX-License-Identifier: MIT
#include <utility>

#include "forwarding.hpp"
#include "linear/choice.hpp"

namespace itr::linear {

namespace {

/// A Cholesky factorisation, with L D L^T for the matrices that it refuses.
class WithIndefinite final : public Forwarding {
 public:
  WithIndefinite(std::unique_ptr<Solver> first, std::unique_ptr<Solver> second)
      : first_(std::move(first)), second_(std::move(second)) {}
  std::string_view name() const override { return first_->name(); }
  Capabilities capabilities() const override {
    Capabilities capabilities = first_->capabilities();
    capabilities.indefinite = true;
    return capabilities;
  }

  Outcome analyze(const SparsityPattern& pattern, const AnalyzeHints& hints) override {
    is_second_ = is_second_ready_ = false;
    pattern_ = pattern;
    block_size_ = hints.block_size;
    return first_->analyze(pattern, hints);
  }

  Outcome factorize(std::span<const double> values) override {
    is_second_ = false;
    const Outcome outcome = first_->factorize(values);
    if (outcome != Outcome::not_positive_definite) return outcome;
    if (!is_second_ready_) is_second_ready_ = second_->analyze(pattern_, {.block_size = block_size_}) == Outcome::ok;
    is_second_ = is_second_ready_ && second_->factorize(values) == Outcome::ok;
    return is_second_ ? Outcome::ok : outcome;
  }

  SolveReport solve(std::span<const double> B, std::span<double> X, int columns, double asked) override {
    return (is_second_ ? second_ : first_)->solve(B, X, columns, asked);
  }

 private:
  const Solver& current() const override { return is_second_ ? *second_ : *first_; }

  std::unique_ptr<Solver> first_, second_;
  bool is_second_ = false;        ///< factorised last
  bool is_second_ready_ = false;  ///< knows the pattern
  SparsityPattern pattern_;
  int block_size_ = 1;
};

}  // namespace

std::unique_ptr<Solver> with_indefinite(std::unique_ptr<Solver> solver, Registry& registry) {
  if (solver->capabilities().indefinite) return solver;
  return std::make_unique<WithIndefinite>(std::move(solver), registry.create("eigen:ldlt"));
}

}  // namespace itr::linear
