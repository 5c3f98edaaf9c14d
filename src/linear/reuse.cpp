// SPDX-License-Identifier: MIT
#include "itr/linear/reuse.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "itr/linear/choice.hpp"
#include "itr/linear/dump.hpp"

namespace itr::linear {

namespace {

// Rates of present machines, a second on one core (verification/solvers): flops of a factorisation, its entries beside their
// flops, and memory that a solve streams. Only their ratios matter.
constexpr double kFlops = 3e10, kEntries = 1e8, kBytes = 2.5e10;

constexpr double kWorthTrying = 0.7;  ///< share of a factorisation that iterations may cost
constexpr int kFewest = 4;            ///< iterations without which none is tried
constexpr int kTellsRate = 6;         ///< iterations after which their rate is known roughly, to a factor of two
constexpr int kLongestPause = 8;
constexpr double kCertain = 1e-12;     ///< negative curvature, relative, that is no round-off
constexpr double kWholeSystem = 1e-8;  ///< residual of a system that counts as one
constexpr double kNoise = 1e-2;        ///< of the right-hand side: what iterations start from in every direction

double dot(std::span<const double> a, std::span<const double> b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

double norm(std::span<const double> a) { return std::sqrt(dot(a, a)); }

/// Fixed numbers in [-1, 1] without a pattern (splitmix64).
double noise(std::uint64_t i) {
  std::uint64_t bits = (i + 1) * 0x9e3779b97f4a7c15;
  bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9;
  bits = (bits ^ (bits >> 27)) * 0x94d049bb133111eb;
  return static_cast<double>(static_cast<std::int64_t>(bits ^ (bits >> 31))) * 0x1p-63;
}

/// y = A x, of a lower triangle.
void multiply(const SparsityPattern& pattern, std::span<const double> values, std::span<const double> x,
              std::span<double> y) {
  std::ranges::fill(y, 0.0);
  for (int j = 0; j < pattern.order; ++j) {
    const int diagonal = pattern.column_starts[j], end = pattern.column_starts[j + 1];
    double row = values[diagonal] * x[j];
    for (int p = diagonal + 1; p < end; ++p) {
      const int i = pattern.row_indices[p];
      y[i] += values[p] * x[j];
      row += values[p] * x[i];
    }
    y[j] += row;
  }
}

}  // namespace

std::shared_ptr<const FactoredMatrix> make_factored_matrix(SparsityPattern pattern, std::vector<double> values,
                                                           int block_size) {
  if (!is_lower_triangle(pattern) || values.size() != pattern.nonzeros()) return nullptr;
  auto shared = std::make_shared<const SparsityPattern>(std::move(pattern));
  return std::make_shared<const FactoredMatrix>(std::move(shared), std::move(values), block_size);
}

Outcome ReusingSolver::analyze(const SparsityPattern& pattern, const AnalyzeHints& hints) {
  const bool is_same = pattern_ && *pattern_ == pattern;
  if (!is_same) pattern_ = std::make_shared<const SparsityPattern>(pattern);
  block_size_ = hints.block_size;
  dofs_.assign(hints.dofs.begin(), hints.dofs.end());
  coordinates_.assign(hints.coordinates.begin(), hints.coordinates.end());
  may_keep_order_ = may_keep_order_ && hints.may_keep_order;
  is_analyzed_ = is_analyzed_ && is_same && (has_own_order_ || hints.may_keep_order) && !capabilities().iterative;
  // If the old factor may serve the new pattern, the analysis waits, because it would discard that factor.
  if (is_analyzed_ || (factor_.matrix && (reuses_ || is_same))) return Outcome::ok;
  return analyze_now();
}

Outcome ReusingSolver::analyze_now() {
  factor_.matrix.reset();
  const Outcome outcome = solver_.analyze(
      *pattern_, {.block_size = block_size_, .dofs = dofs_, .coordinates = coordinates_, .may_keep_order = may_keep_order_});
  is_analyzed_ = outcome == Outcome::ok;
  has_own_order_ = !may_keep_order_ || !capabilities().keeps_order;
  may_keep_order_ = true;
  return outcome;
}

/// False where they are those of the factor.
bool ReusingSolver::take_in(std::span<const double> values) {
  values_.assign(values.begin(), values.end());
  b_.clear();
  iterations_ = 0;
  is_counted_ = is_refused_ = false;
  is_old_ = factor_.matrix && *factor_.matrix->pattern == *pattern_ && factor_.matrix->values == values_;
  return !is_old_;
}

Outcome ReusingSolver::factorize(std::span<const double> values) {
  if (!pattern_) return solver_.factorize(values);  // says what is missing
  return take_in(values) ? factorize_now() : Outcome::ok;
}

Outcome ReusingSolver::prepare(std::span<const double> values, std::span<const double> b, double asked) {
  if (!pattern_) return solver_.factorize(values);
  const bool goes_on = !b_.empty() && std::ranges::equal(b, b_) && std::ranges::equal(values, values_);
  if (!goes_on && !take_in(values)) return Outcome::ok;
  const auto n = static_cast<std::size_t>(pattern_->order);
  if (values.size() == pattern_->nonzeros() && b.size() == n && (goes_on || is_worth_trying())) {
    b_.assign(b.begin(), b.end());
    if (iterate(b_, asked, goes_on)) return Outcome::ok;
    b_.clear();
    if (is_refused_) return Outcome::not_positive_definite;
  }
  return factorize_now();
}

Outcome ReusingSolver::factorize_now() {
  is_old_ = false;
  factor_.matrix.reset();
  if (!is_analyzed_)
    if (const Outcome outcome = analyze_now(); outcome != Outcome::ok) return outcome;
  ++counts_.factorizations;
  const Outcome outcome = solver_.factorize(values_);
  if (outcome != Outcome::ok || capabilities().iterative) return outcome;
  factor_.matrix = std::make_shared<const FactoredMatrix>(pattern_, values_, block_size_);
  factor_.spent = factorization_cost();
  factor_.served = factor_.iterations = 1;
  return outcome;
}

SolveReport ReusingSolver::solve(std::span<const double> B, std::span<double> X, int columns, double asked) {
  if (is_refused_) return {Outcome::not_positive_definite, std::numeric_limits<double>::infinity()};
  if (!b_.empty()) {
    if (columns == 1 && X.size() == x_.size() && std::ranges::equal(B, b_)) {
      std::ranges::copy(x_, X.begin());
      const bool is_new = !std::exchange(is_counted_, true);
      counts_.solves += is_new;
      counts_.reused += is_new;
      return report_;
    }
    b_.clear();
    if (const Outcome outcome = factorize_now(); outcome != Outcome::ok)
      return {outcome, std::numeric_limits<double>::infinity()};
  }
  const SolveReport report = solver_.solve(B, X, columns, asked);
  iterations_ = solver_.statistics().iterations;
  ++counts_.solves;
  if (is_old_) ++counts_.reused;
  return report;
}

std::string ReusingSolver::message() const {
  return is_refused_ ? "iterations met a direction of negative curvature" : solver_.message();
}

Statistics ReusingSolver::statistics() const {
  Statistics statistics = solver_.statistics();
  statistics.iterations = iterations_;
  if (!b_.empty()) statistics.negative_pivots = 0;  // of the matrix, not of the factor
  return statistics;
}

/// Whether to try iterations with the old factor. They grow in number as it ages. A new one is made when the next system
/// would cost more than the mean of the systems since the last factorisation, its cost included: the mean is least then.
bool ReusingSolver::is_worth_trying() {
  if (!reuses_ || !factor_.matrix || factor_.matrix->pattern->order != pattern_->order) return false;
  if (factor_.pause > 0) {
    --factor_.pause;
    return false;
  }
  return most_iterations() >= kFewest && factor_.iterations * iteration_cost() <= factor_.spent / factor_.served;
}

int ReusingSolver::most_iterations() const {
  return static_cast<int>(std::min(1e6, kWorthTrying * factorization_cost() / iteration_cost()));
}

double ReusingSolver::iteration_cost() const {
  constexpr double kBytesOfFactor = 16, kBytesOfMatrix = 24, kBytesOfVectors = 80;
  const Statistics statistics = solver_.statistics();
  const MatrixTraits traits{pattern_->order, pattern_->nonzeros(), block_size_};
  const double factor =
      statistics.factor_nonzeros > 0 ? statistics.factor_nonzeros : estimate_factor_bytes(traits) / sizeof(double);
  return (kBytesOfFactor * factor + kBytesOfMatrix * static_cast<double>(traits.nonzeros) +
          kBytesOfVectors * static_cast<double>(traits.order)) /
         kBytes;
}

double ReusingSolver::factorization_cost() const {
  const Statistics statistics = solver_.statistics();
  const MatrixTraits traits{pattern_->order, pattern_->nonzeros(), block_size_};
  const double factor =
      statistics.factor_nonzeros > 0 ? statistics.factor_nonzeros : estimate_factor_bytes(traits) / sizeof(double);
  // Where the library does not tell: the sum over columns of their squared entries is about twice that of equal ones.
  const double flops = statistics.flops > 0 ? statistics.flops : 2 * factor * factor / std::max(1, traits.order);
  return flops / kFlops + factor / kEntries;
}

/// Without a residual, which is that of the old matrix.
bool ReusingSolver::precondition(std::span<const double> residual, std::span<double> z) {
  return solver_.solve(residual, z, 1, std::numeric_limits<double>::infinity()).outcome == Outcome::ok;
}

/// False where the system is to be factorised. `goes_on`: from what was reached for the same system.
bool ReusingSolver::iterate(std::span<const double> b, double asked, bool goes_on) {
  const double scale = norm(b), from = goes_on ? report_.relative_residual : 1;
  if (!(scale > 0) || !std::isfinite(scale)) return false;
  if (goes_on && from <= asked) return true;
  const int before = iterations_;
  const bool is_there = (goes_on || begin()) && run(asked * scale, most_iterations() - before);
  if (is_there) {
    compute_residual();
    report_ = {Outcome::ok, norm(r_) / scale};
  }
  if (is_refused_) return false;
  if (!is_there || !(report_.relative_residual <= asked)) {
    factor_.pause = factor_.next_pause;
    factor_.next_pause = std::min(2 * factor_.next_pause, kLongestPause);
    return false;
  }
  const int used = iterations_ - before;
  const double part = std::log(asked / from) / std::log(kWholeSystem);
  factor_.spent += used * iteration_cost();
  factor_.served += part;
  factor_.iterations = used / part;
  factor_.next_pause = 1;
  return true;
}

void ReusingSolver::compute_residual() {
  multiply(*pattern_, values_, x_, q_);
  for (std::size_t i = 0; i < r_.size(); ++i) r_[i] = b_[i] - q_[i];
}

/// x from a right-hand side with something of every direction, and its residual.
bool ReusingSolver::begin() {
  const std::size_t n = b_.size();
  for (auto* vector : {&x_, &r_, &z_, &p_, &q_}) vector->resize(n);
  const double scale = kNoise * norm(b_) / std::sqrt(static_cast<double>(n));
  for (std::size_t i = 0; i < n; ++i) r_[i] = b_[i] + scale * noise(i);
  if (!precondition(r_, x_)) return false;
  compute_residual();
  return true;
}

/// Conjugate gradients from x to a residual of `target`; false where they did not get there in `most`, are not going to, or
/// met what is not positive.
bool ReusingSolver::run(double target, int most) {
  const std::size_t n = b_.size();
  const double first = norm(r_);
  double product = 0;
  for (int k = 1; k <= most; ++k) {
    ++counts_.iterations;
    ++iterations_;
    if (!precondition(r_, z_)) return false;
    const double before = std::exchange(product, dot(r_, z_));
    const double share = k == 1 ? 0 : product / before;
    for (std::size_t i = 0; i < n; ++i) p_[i] = z_[i] + share * p_[i];
    multiply(*pattern_, values_, p_, q_);
    const double curvature = dot(p_, q_);
    // A Cholesky factorisation would find the same. With other engines the caller factorises all the same.
    is_refused_ = product > 0 && curvature < -kCertain * norm(p_) * norm(q_) && !capabilities().indefinite;
    if (!(product > 0) || !(curvature > 0)) return false;
    const double length = product / curvature;
    for (std::size_t i = 0; i < n; ++i) {
      x_[i] += length * p_[i];
      r_[i] -= length * q_[i];
    }
    const double now = norm(r_);
    if (now <= target) return true;
    const double by_rate = k * std::log(target / first) / std::min(-1e-3, std::log(now / first));
    if (k >= kTellsRate && by_rate > 2.0 * most) return false;
  }
  return false;
}

FactorRecord ReusingSolver::record() const {
  FactorRecord record = factor_;
  if (!has_own_order_ || !reuses_) record.matrix.reset();
  return record;
}

void ReusingSolver::restore(const FactorRecord& record) {
  if (record.matrix == factor_.matrix) {
    factor_ = record;
    return;
  }
  factor_ = {};
  is_refused_ = false;
  if (record.matrix) {
    pattern_ = record.matrix->pattern;
    values_ = record.matrix->values;
    block_size_ = record.matrix->block_size;
    dofs_.clear();
    coordinates_.clear();
    b_.clear();
    is_analyzed_ = may_keep_order_ = false;
    const SolveCounts before = counts_;
    if (factorize_now() != Outcome::ok) factor_.matrix.reset();
    counts_ = before;  // it was counted when it was made first
  }
  auto matrix = factor_.matrix ? record.matrix : nullptr;
  factor_ = record;
  factor_.matrix = std::move(matrix);
}

}  // namespace itr::linear
