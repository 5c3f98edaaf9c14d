// SPDX-License-Identifier: MIT
// No backend is trusted: input is checked, the residual of every solve is computed, poor ones are refined.
#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <utility>

#include "core/profile.hpp"
#include "itr/solver.hpp"

namespace itr::linear {

const char* to_string(Outcome outcome) {
  switch (outcome) {
    case Outcome::ok:
      return "ok";
    case Outcome::not_positive_definite:
      return "not positive definite";
    case Outcome::singular:
      return "singular";
    case Outcome::non_finite:
      return "not finite";
    case Outcome::out_of_memory:
      return "out of memory";
    case Outcome::not_converged:
      return "not converged";
    case Outcome::failed:
      return "failed";
  }
  return "";
}

namespace {

constexpr int kRefinements = 2;
constexpr double kUnitRoundOff = 1.1e-16;
constexpr double kUnknown = std::numeric_limits<double>::infinity();  ///< residual where there is no solution

bool is_finite(std::span<const double> values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

double norm(std::span<const double> v) {
  double sum = 0;
  for (const double x : v) sum += x * x;
  if (sum > 1e-280 && std::isfinite(sum)) return std::sqrt(sum);
  // The sum of squares is out of double's range: divided by such a norm, any residual would be 0 or not a number.
  double largest = 0;
  for (const double x : v) largest = std::isnan(x) ? x : std::max(largest, std::abs(x));
  if (largest == 0 || !std::isfinite(largest)) return largest;
  sum = 0;
  for (const double x : v) sum += (x / largest) * (x / largest);
  return largest * std::sqrt(sum);
}

class CheckedSolver final : public Solver {
 public:
  CheckedSolver(std::string name, Capabilities capabilities, std::unique_ptr<Engine> engine)
      : name_(std::move(name)), capabilities_(capabilities), engine_(std::move(engine)) {}
  std::string_view name() const override { return name_; }
  Capabilities capabilities() const override { return capabilities_; }
  Statistics statistics() const override {
    Statistics statistics = engine_->statistics();
    statistics.iterations = iterations_;
    return statistics;
  }
  std::string message() const override { return message_; }

  Outcome analyze(const SparsityPattern& pattern, const AnalyzeHints& hints) override {
    const ScopedPhase phase("analyse");
    ready_ = false;
    // An analysis of a direct solver sees the pattern alone. (An iterative one may use where the nodes are, and a result
    // that depended on where they once were could not be repeated from a saved state.)
    const bool serves = hints.may_keep_order || !order_may_be_old_;
    if (analyzed_ && !capabilities_.iterative && serves && pattern == pattern_) return Outcome::ok;
    order_may_be_old_ = hints.may_keep_order && capabilities_.keeps_order;
    analyzed_ = false;
    const Outcome outcome = guarded([&] {
      pattern_ = pattern;
      values_.clear();
      return pattern.order == 0 ? Outcome::ok : note(engine_->analyze(pattern_, hints));
    });
    analyzed_ = outcome == Outcome::ok;
    return outcome;
  }

  Outcome factorize(std::span<const double> values) override {
    const ScopedPhase phase("factorise");
    ready_ = false;
    if (!analyzed_) return note(Outcome::failed, "no analysis to factorise with");
    if (values.size() != pattern_.nonzeros())
      return note(Outcome::failed, "the number of values is not that of the pattern");
    if (!is_finite(values)) return note(Outcome::non_finite, "a matrix entry is not finite");
    const Outcome outcome = guarded([&] {
      values_.assign(values.begin(), values.end());
      return pattern_.order == 0 ? Outcome::ok : note(engine_->factorize(values));
    });
    ready_ = outcome == Outcome::ok;
    if (Profile::active()) add_bytes(engine_->statistics().factor_bytes);
    return outcome;
  }

  SolveReport solve(std::span<const double> B, std::span<double> X, int columns, double asked) override {
    const ScopedPhase phase("solve");
    const std::size_t n = pattern_.order;
    iterations_ = 0;
    if (!ready_) return {note(Outcome::failed, "no factorisation to solve with"), kUnknown};
    if (columns < 0 || B.size() != n * columns || X.size() != B.size())
      return {note(Outcome::failed, "wrong length of a vector"), kUnknown};
    if (n == 0 || columns == 0) return {};
    if (!is_finite(B)) return {note(Outcome::non_finite, "a right-hand side is not finite"), kUnknown};
    if (Profile::active()) add_bytes(2 * columns * engine_->statistics().factor_bytes);
    SolveReport report{Outcome::ok, kUnknown};
    report.outcome = guarded([&] {
      report = solve_checked(B, X, columns, asked);
      return report.outcome;
    });
    return report;
  }

 private:
  SolveReport solve_checked(std::span<const double> B, std::span<double> X, int columns, double asked) {
    const std::size_t n = pattern_.order;
    SolveReport report{solve_once(B, X, columns), 0};
    if (report.outcome != Outcome::ok && report.outcome != Outcome::not_converged) return {note(report.outcome), kUnknown};
    if (std::isinf(asked)) {  // nobody asks for the residual
      report.relative_residual = kUnknown;
      report.outcome = is_finite(X) ? Outcome::ok : note(Outcome::not_converged, "the solution is not finite");
      return report;
    }
    bool finite = true;
    for (int c = 0; c < columns; ++c) {
      const double residual = refine(B.subspan(c * n, n), X.subspan(c * n, n), asked);
      finite = finite && std::isfinite(residual);  // std::max would swallow a NaN
      report.relative_residual = std::max(report.relative_residual, residual);
    }
    // The matrix and the right-hand sides are finite: another solver may do better.
    if (!finite || !is_finite(X)) return {note(Outcome::not_converged, "the solution is not finite"), kUnknown};
    report.outcome =
        report.relative_residual <= asked ? Outcome::ok : note(Outcome::not_converged, "the asked residual was not reached");
    return report;
  }

  Outcome solve_once(std::span<const double> B, std::span<double> X, int columns) {
    const Outcome outcome = engine_->solve(B, X, columns);
    iterations_ += engine_->statistics().iterations;
    return outcome;
  }

  /// Exceptions end here: large systems do run out of memory, and Newton has an answer to that.
  template <typename F>
  Outcome guarded(F&& f) {
    try {
      return f();
    } catch (const std::bad_alloc&) {
      return note(Outcome::out_of_memory, "out of memory");
    }
  }

  Outcome note(Outcome outcome, std::string message = {}) {
    if (outcome != Outcome::ok) message_ = message.empty() ? engine_->message() : std::move(message);
    if (outcome != Outcome::ok && message_.empty()) message_ = to_string(outcome);
    return outcome;
  }

  /// residual = b - A x; also the largest product in it, whose round-off bounds how well the residual is known.
  void residual(std::span<const double> b, std::span<const double> x) {
    residual_.assign(b.begin(), b.end());
    double largest = 0;
    for (int j = 0; j < pattern_.order; ++j) {
      const int diagonal = pattern_.column_starts[j], end = pattern_.column_starts[j + 1];
      double row = values_[diagonal] * x[j];  // kept in a register: through residual_[j] every sum would wait for the last
      largest = std::max(largest, std::abs(row));
      for (int p = diagonal + 1; p < end; ++p) {
        const int i = pattern_.row_indices[p];
        const double product = values_[p] * x[j];
        residual_[i] -= product;
        largest = std::max(largest, std::abs(product));
        row += values_[p] * x[i];
      }
      residual_[j] -= row;
    }
    largest_product_ = largest;
  }

  /// Iterative refinement of one column; returns the relative residual that it ends with.
  double refine(std::span<const double> b, std::span<double> x, double asked) {
    const double scale = norm(b);
    residual(b, x);
    double now = norm(residual_);
    if (scale == 0) return now == 0 ? 0 : 1;
    for (int i = 0; i < kRefinements && now > asked * scale; ++i) {
      correction_.resize(b.size());
      if (solve_once(residual_, correction_, 1) != Outcome::ok) break;
      previous_.assign(x.begin(), x.end());
      for (std::size_t k = 0; k < b.size(); ++k) x[k] += correction_[k];
      residual(b, x);
      const double next = norm(residual_);
      if (!(next < now)) {
        std::copy(previous_.begin(), previous_.end(), x.begin());
        break;
      }
      now = next;
    }
    return std::max(now, kUnitRoundOff * largest_product_) / scale;
  }

  std::string name_;
  Capabilities capabilities_;
  std::unique_ptr<Engine> engine_;
  SparsityPattern pattern_;
  std::vector<double> values_, residual_, correction_, previous_;
  double largest_product_ = 0;
  bool analyzed_ = false, ready_ = false, order_may_be_old_ = false;
  int iterations_ = 0;  ///< of the last solve with its refinements
  std::string message_;
};

}  // namespace

std::unique_ptr<Solver> make_checked_solver(std::string name, Capabilities capabilities, std::unique_ptr<Engine> engine) {
  return std::make_unique<CheckedSolver>(std::move(name), capabilities, std::move(engine));
}

double self_test_residual(Solver& solver) {
  // A chain of springs with alternating stiffness, held at one end.
  constexpr int kOrder = 50;
  SparsityPattern pattern;
  pattern.order = kOrder;
  std::vector<double> values;
  for (int j = 0; j < kOrder; ++j) {
    pattern.column_starts.push_back(static_cast<int>(values.size()));
    pattern.row_indices.push_back(j);
    values.push_back(j + 1 < kOrder ? 3 + j % 2 : 2);
    if (j + 1 == kOrder) continue;
    pattern.row_indices.push_back(j + 1);
    values.push_back(-1 - j % 2);
  }
  pattern.column_starts.push_back(static_cast<int>(values.size()));
  std::vector<double> b(kOrder), x(kOrder);
  for (int i = 0; i < kOrder; ++i) b[i] = std::cos(i);
  if (solver.analyze(pattern, {}) != Outcome::ok || solver.factorize(values) != Outcome::ok) return -1;
  const SolveReport report = solver.solve(b, x, 1, 1e-10);
  return report.outcome == Outcome::ok ? report.relative_residual : -1;
}

}  // namespace itr::linear
