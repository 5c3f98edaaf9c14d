// SPDX-License-Identifier: MIT
#include "linear/reuse.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "conjugate_gradients.hpp"
#include "core/profile.hpp"
#include "linear/choice.hpp"

namespace itr::linear {

namespace {

// Rates of present machines, a second on one core (verification/solvers): flops of a factorisation, its entries beside their
// flops, and memory that a solve streams. Only their ratios matter.
constexpr double kFlops = 3e10, kEntries = 1e8, kBytes = 2.5e10;

constexpr double kWorthTrying = 0.7;  ///< fraction of a factorisation that iterations may cost
constexpr int kFewest = 4;            ///< iterations without which none is tried
constexpr int kLongestPause = 8;
constexpr double kWholeSystem = 1e-8;  ///< residual of a system that counts as one
constexpr double kNoResidual = std::numeric_limits<double>::infinity();

}  // namespace

struct ReusingSolver::Iteration : ConjugateGradients {
  LowRankCorrection correction;  ///< of the factor
};

/// Seconds, by counts.
struct ReusingSolver::Costs {
  double factorization, iteration;
  int most_iterations() const { return static_cast<int>(std::min(1e6, kWorthTrying * factorization / iteration)); }
};

bool is_lower_triangle(const SparsityPattern& pattern) {
  const auto& [order, starts, rows] = pattern;
  if (order < 0 || starts.front() != 0 || starts.back() != static_cast<int>(rows.size())) return false;
  for (int j = 0; j < order; ++j) {
    if (starts[j] < 0 || starts[j] >= starts[j + 1] || starts[j + 1] > starts.back() || rows[starts[j]] != j) return false;
    for (int p = starts[j] + 1; p < starts[j + 1]; ++p)
      if (rows[p] <= rows[p - 1] || rows[p] >= order) return false;
  }
  return true;
}

std::shared_ptr<const FactoredMatrix> make_factored_matrix(SparsityPattern pattern, std::vector<double> values,
                                                           int block_size) {
  if (!is_lower_triangle(pattern) || values.size() != pattern.nonzeros()) return nullptr;
  auto shared = std::make_shared<const SparsityPattern>(std::move(pattern));
  return std::make_shared<const FactoredMatrix>(std::move(shared), std::move(values), block_size);
}

ReusingSolver::ReusingSolver(Solver& solver) : solver_(solver), iteration_(std::make_unique<Iteration>()) {}

ReusingSolver::~ReusingSolver() = default;

Outcome ReusingSolver::analyze(const SparsityPattern& pattern, const AnalyzeHints& hints) {
  const bool is_same = pattern_ && *pattern_ == pattern;
  if (!is_same) pattern_ = std::make_shared<const SparsityPattern>(pattern);
  block_size_ = hints.block_size;
  dofs_.assign(hints.dofs.begin(), hints.dofs.end());
  coordinates_.assign(hints.coordinates.begin(), hints.coordinates.end());
  may_keep_order_ = may_keep_order_ && hints.may_keep_order;
  is_analyzed_ = is_analyzed_ && is_same && (has_own_order_ || hints.may_keep_order) && !capabilities().iterative;
  // If the old factor may serve the new pattern, the analysis waits, because it would discard that factor.
  if (is_analyzed_ || factor_.matrix) return Outcome::ok;
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

void ReusingSolver::take_in(std::span<const double> values) {
  iterations_ = 0;
  const bool is_factors = factor_.matrix && (factor_.matrix->pattern == pattern_ || *factor_.matrix->pattern == *pattern_) &&
                          std::ranges::equal(factor_.matrix->values, values);
  last_ = is_factors ? Last::found : Last::none;
}

Outcome ReusingSolver::factorize(std::span<const double> values) {
  if (!pattern_) return solver_.factorize(values);  // says what is missing
  take_in(values);
  return last_ == Last::found ? Outcome::ok : factorize_now(values);
}

Outcome ReusingSolver::factorize_now(std::span<const double> values) {
  last_ = Last::none;
  factor_.matrix.reset();
  if (!is_analyzed_)
    if (const Outcome outcome = analyze_now(); outcome != Outcome::ok) return outcome;
  ++counts_.factorizations;
  const Outcome outcome = solver_.factorize(values);
  if (outcome != Outcome::ok) return outcome;
  last_ = Last::factorized;
  if (capabilities().iterative || describe(outcome, solver_).negative_eigenvalues > 0) return outcome;
  factor_.matrix = std::make_shared<const FactoredMatrix>(pattern_, std::vector(values.begin(), values.end()), block_size_);
  factor_.spent = costs().factorization;
  factor_.served = factor_.iterations = 1;
  return outcome;
}

SolveReport ReusingSolver::solve(std::span<const double> B, std::span<double> X, int columns, double asked) {
  if (last_ == Last::iterated || last_ == Last::refused) return {Outcome::failed, kNoResidual};
  const SolveReport report = solver_.solve(B, X, columns, asked);
  iterations_ = solver_.statistics().iterations;
  ++counts_.solves;
  if (last_ == Last::found) ++counts_.reused;
  return report;
}

SystemReport ReusingSolver::solve_system(std::span<const double> values, std::span<const double> b, const Asked& asked,
                                         std::span<double> x, const MatrixX* U) {
  const ScopedPhase phase("iterate");
  if (!pattern_) return describe(solver_.factorize(values), solver_);  // says what is missing
  const SystemView system{*pattern_, values, b, U};
  const bool goes_on = asked.goes_on && last_ == Last::iterated;
  if (!goes_on) take_in(values);
  if (goes_on ? iteration_->residual() > asked.loose : last_ != Last::found && may_iterate(values, b))
    iterate(system, asked.loose);
  if (last_ == Last::refused) return {Outcome::not_positive_definite, kNoResidual, Definiteness::indefinite};
  if (last_ != Last::iterated) return solve_by_factor(system, asked, x);
  if (!x.empty()) {
    std::ranges::copy(iteration_->solution(), x.begin());
    counts_.solves += !goes_on;
    counts_.reused += !goes_on;
  }
  const double residual = iteration_->residual();
  return {Outcome::ok, residual, residual <= kWholeSystem ? Definiteness::positive : Definiteness::unknown};
}

SystemReport ReusingSolver::solve_by_factor(const SystemView& system, const Asked& asked, std::span<double> x) {
  const SystemReport report = describe(last_ == Last::found ? Outcome::ok : factorize_now(system.values), solver_);
  if (x.empty()) return report;
  return with_solution(report, asked, [&]() -> SolveReport {
    const SolveReport of_A = solve(system.b, x, 1, asked.residual);
    if (!has_solution(of_A.outcome) || !system.U) return of_A;
    const bool is_found = iteration_->correction.compute(*system.U, [&](const auto& u, auto&& z) {
      return has_solution(solver_.solve(as_span(u), as_span(z), 1, asked.residual).outcome);
    });
    if (!is_found) return {Outcome::failed, kNoResidual};
    iteration_->correction.correct(as_vector(x));
    std::vector<double> product(x.size());
    multiply(system, x, product);
    return {of_A.outcome, (as_vector(system.b) - as_vector(std::span(product))).norm() / as_vector(system.b).norm()};
  });
}

bool ReusingSolver::precondition(std::span<const double> residual, std::span<double> z) {
  return factor_.matrix && static_cast<std::size_t>(factor_.matrix->pattern->order) == residual.size() &&
         solver_.solve(residual, z, 1, kNoResidual).outcome == Outcome::ok;
}

std::string ReusingSolver::message() const {
  return last_ == Last::refused ? "iterations met a direction of negative curvature" : solver_.message();
}

Statistics ReusingSolver::statistics() const {
  Statistics statistics = solver_.statistics();
  statistics.iterations = iterations_;
  return statistics;
}

/// Whether to try iterations with the old factor. They grow in number as it ages. A new one is made when the next system
/// would cost more than the mean of the systems since the last factorisation, its cost included: the mean is least then.
bool ReusingSolver::may_iterate(std::span<const double> values, std::span<const double> b) {
  if (values.size() != pattern_->nonzeros() || b.size() != static_cast<std::size_t>(pattern_->order)) return false;
  if (!factor_.matrix || factor_.matrix->pattern->order != pattern_->order) return false;
  if (factor_.pause > 0) {
    --factor_.pause;
    return false;
  }
  const Costs cost = costs();
  return cost.most_iterations() >= kFewest && factor_.iterations * cost.iteration <= factor_.spent / factor_.served;
}

ReusingSolver::Costs ReusingSolver::costs() const {
  constexpr double kBytesOfFactor = 16, kBytesOfMatrix = 24, kBytesOfVectors = 80;
  const Statistics statistics = solver_.statistics();
  const MatrixTraits traits{pattern_->order, pattern_->nonzeros(), block_size_};
  const double factor =
      statistics.factor_nonzeros > 0 ? statistics.factor_nonzeros : estimate_factor_bytes(traits) / sizeof(double);
  // Where the library does not tell: the sum over columns of their squared entries is about twice that of equal ones.
  const double flops = statistics.flops > 0 ? statistics.flops : 2 * factor * factor / std::max(1, traits.order);
  const double bytes = kBytesOfFactor * factor + kBytesOfMatrix * static_cast<double>(traits.nonzeros) +
                       kBytesOfVectors * static_cast<double>(traits.order);
  return {flops / kFlops + factor / kEntries, bytes / kBytes};
}

/// Solves the system by iterations with the factor that is there, or goes on with it. Where they do not get there, `last_`
/// stays none, or is refused.
void ReusingSolver::iterate(const SystemView& system, double asked) {
  const bool goes_on = std::exchange(last_, Last::none) == Last::iterated;
  const double scale = ConjugateGradients::norm(system.b), from = goes_on ? iteration_->residual() : 1;
  if (!(scale > 0) || !std::isfinite(scale)) return;
  LowRankCorrection& correction = iteration_->correction;
  const auto by_factor = [&](std::span<const double> residual, std::span<double> z) {
    if (!precondition(residual, z)) return false;
    if (system.U) correction.correct(as_vector(z));
    return true;
  };
  if (system.U && !goes_on &&
      !correction.compute(*system.U, [&](const auto& u, auto&& z) { return precondition(as_span(u), as_span(z)); }))
    return pause();
  if (!goes_on && !iteration_->begin(system, by_factor)) return pause();
  const Costs cost = costs();
  const auto end = iteration_->run(system, by_factor, asked, cost.most_iterations() - iterations_);
  const int used = iteration_->iterations();
  iterations_ += used;
  counts_.iterations += used;
  // A Cholesky factorisation would find the same. With other engines the matrix is factorised all the same.
  if (end == ConjugateGradients::End::negative && !capabilities().indefinite) {
    last_ = Last::refused;
    return;
  }
  if (end != ConjugateGradients::End::reached) return pause();
  const double part = std::log(asked / from) / std::log(kWholeSystem);
  factor_.spent += used * cost.iteration;
  factor_.served += part;
  factor_.iterations = used / part;
  factor_.next_pause = 1;
  last_ = Last::iterated;
}

/// The longer, the more often iterations have failed in a row.
void ReusingSolver::pause() {
  factor_.pause = factor_.next_pause;
  factor_.next_pause = std::min(2 * factor_.next_pause, kLongestPause);
}

FactorRecord ReusingSolver::record() const {
  FactorRecord record = factor_;
  if (!has_own_order_) record.matrix.reset();
  return record;
}

void ReusingSolver::restore(const FactorRecord& record) {
  if (record.matrix == factor_.matrix) {
    factor_ = record;
    return;
  }
  factor_ = {};
  last_ = Last::none;
  if (record.matrix) {
    pattern_ = record.matrix->pattern;
    block_size_ = record.matrix->block_size;
    dofs_.clear();
    coordinates_.clear();
    is_analyzed_ = may_keep_order_ = false;
    const SolveCounts before = counts_;
    if (factorize_now(record.matrix->values) != Outcome::ok) factor_.matrix.reset();
    counts_ = before;  // it was counted when it was made first
  }
  auto matrix = factor_.matrix ? record.matrix : nullptr;
  factor_ = record;
  factor_.matrix = std::move(matrix);
}

}  // namespace itr::linear
