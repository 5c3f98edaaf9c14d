// SPDX-License-Identifier: MIT
// A solver of one's own as a loadable module: conjugate gradients with the diagonal as preconditioner (Hestenes & Stiefel
// 1952). Input checks, residuals, refinement and fallbacks are the library's business; this is only the mathematics.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>
#include <vector>

#include "itr/module.h"

namespace {

class ConjugateGradients {
 public:
  int set_option(std::string_view key, std::string_view value) {
    double number = 0;
    const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
    if (key != "tolerance" || error != std::errc() || end != value.data() + value.size()) return ITR_FAILED;
    if (!(number > 0 && number < 1)) return ITR_FAILED;
    tolerance_ = number;
    return ITR_OK;
  }

  int analyze(const itr_pattern& pattern, const itr_hints&) {
    order_ = pattern.order;
    starts_.assign(pattern.column_starts, pattern.column_starts + order_ + 1);
    rows_.assign(pattern.row_indices, pattern.row_indices + starts_[order_]);
    return ITR_OK;
  }

  int factorize(const double* values, size_t count) {
    values_.assign(values, values + count);
    for (int j = 0; j < order_; ++j)  // the diagonal is the first entry of its column
      if (!(values_[starts_[j]] > 0)) return fail(ITR_NOT_POSITIVE_DEFINITE, "a diagonal entry is not positive");
    return ITR_OK;
  }

  int solve(const double* rhs, double* solution, int columns) {
    iterations_ = 0;
    for (int c = 0; c < columns; ++c) {
      const size_t offset = static_cast<size_t>(c) * order_;
      if (const int outcome = solve_one(rhs + offset, solution + offset); outcome != ITR_OK) return outcome;
    }
    return ITR_OK;
  }

  itr_statistics statistics() const {
    itr_statistics result{};
    result.iterations = iterations_;
    return result;
  }
  const char* message() const { return message_; }

 private:
  int fail(int outcome, const char* why) {
    message_ = why;
    return outcome;
  }

  /// y = A x, from the lower triangle.
  void multiply(const double* x, std::vector<double>& y) const {
    y.assign(order_, 0.0);
    for (int j = 0; j < order_; ++j) {
      y[j] += values_[starts_[j]] * x[j];
      for (int p = starts_[j] + 1; p < starts_[j + 1]; ++p) {
        y[rows_[p]] += values_[p] * x[j];
        y[j] += values_[p] * x[rows_[p]];
      }
    }
  }

  static double dot(const std::vector<double>& a, const std::vector<double>& b) {
    double sum = 0;
    for (size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
    return sum;
  }

  int solve_one(const double* b, double* x) {
    std::vector<double> r(b, b + order_), z(order_), p(order_, 0.0), Ap;
    std::fill(x, x + order_, 0.0);
    const double target = tolerance_ * tolerance_ * dot(r, r);
    double rz_before = 1;
    const int most = 1000 + 20 * order_;
    for (int k = 0; k < most; ++k, ++iterations_) {
      if (dot(r, r) <= target) return ITR_OK;
      for (int i = 0; i < order_; ++i) z[i] = r[i] / values_[starts_[i]];
      const double rz = dot(r, z), beta = k == 0 ? 0 : rz / rz_before;
      rz_before = rz;
      for (int i = 0; i < order_; ++i) p[i] = z[i] + beta * p[i];
      multiply(p.data(), Ap);
      const double curvature = dot(p, Ap);
      if (!(curvature > 0)) return fail(ITR_NOT_POSITIVE_DEFINITE, "a direction of no positive curvature");
      const double alpha = rz / curvature;
      for (int i = 0; i < order_; ++i) {
        x[i] += alpha * p[i];
        r[i] -= alpha * Ap[i];
      }
    }
    return fail(ITR_NOT_CONVERGED, "the iterations did not converge");
  }

  double tolerance_ = 1e-10;  ///< of |b - A x| / |b|
  int order_ = 0, iterations_ = 0;
  std::vector<int32_t> starts_, rows_;
  std::vector<double> values_;
  const char* message_ = "";
};

}  // namespace

extern "C" __attribute__((visibility("default"))) const itr_module* itr_backend_module(void) {
  static const itr_engine engines[] = {
      itr::linear::ModuleAdapter<ConjugateGradients>::row("example:cg", "1.0", "MIT", ITR_ITERATIVE, "tolerance=NUMBER")};
  static const itr_module module{ITR_BACKEND_ABI_VERSION, 1, engines};
  return &module;
}
