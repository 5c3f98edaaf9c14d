// SPDX-License-Identifier: MIT
#include <Eigen/Cholesky>
#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseLU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "eigen_engines.hpp"
#include "itr/module.h"

// Eigen 3.4's SparseLU frees its factors when they have to grow, and goes on with the freed memory if no more is left. This
// specialisation keeps them, so that std::bad_alloc leaves a solver that can be destroyed, and moves pages instead of
// copying factors. It has an index type of its own: others use SparseLU too, and a program must have one version of a
// function.
namespace Eigen::internal {
template <>
template <typename Vector>
Index SparseLUImpl<double, std::ptrdiff_t>::expand(Vector& entries, Index& length, Index, Index length_is_new,
                                                   Index& expansions) {
  constexpr double kGrowth = 1.5;
  const bool first = expansions == 0;
  if (first) {
    entries.resize(0);  // of an earlier factorisation
  } else {
    if (length_is_new == 0) length = std::max(length + 1, static_cast<Index>(kGrowth * static_cast<double>(length)));
    ++expansions;
  }
  entries.conservativeResize(length);
  return 0;
}
}  // namespace Eigen::internal

namespace itr::linear {

namespace {

using Sparse = Eigen::SparseMatrix<double>;
using ConstColumns = Eigen::Map<const Eigen::MatrixXd>;
using Columns = Eigen::Map<Eigen::MatrixXd>;

constexpr double kSingular = 1e-15;  ///< pivot over the largest entry of its row, below which it is round-off

/// Keeps the lower triangle as Eigen's matrix; factorisations of one pattern only copy values.
class LowerTriangleEngine : public Engine {
 public:
  bool set_option(const std::string&, const std::string&) override { return false; }
  std::string message() const override { return {}; }
  Outcome analyze(const SparsityPattern& pattern, const AnalyzeHints&) override {
    const std::vector<double> zeros(pattern.nonzeros(), 0.0);
    factorized_ = false;
    forget();
    matrix_ = Eigen::Map<const Sparse>(pattern.order, pattern.order, static_cast<int>(pattern.nonzeros()),
                                       pattern.column_starts.data(), pattern.row_indices.data(), zeros.data());
    return analyze_matrix();
  }
  Outcome factorize(std::span<const double> values) override {
    std::copy(values.begin(), values.end(), matrix_.valuePtr());
    factorized_ = false;
    const Outcome outcome = factorize_matrix();
    factorized_ = outcome == Outcome::ok;
    return outcome;
  }
  /// Eigen's solvers answer only after a factorisation.
  Statistics statistics() const final { return factorized_ ? factor_statistics() : Statistics(); }

 protected:
  virtual void forget() = 0;  ///< all of the analysis before
  virtual Outcome analyze_matrix() = 0;
  virtual Outcome factorize_matrix() = 0;
  virtual Statistics factor_statistics() const = 0;
  ConstColumns in(std::span<const double> B, int columns) const { return {B.data(), matrix_.rows(), columns}; }
  Columns out(std::span<double> X, int columns) const { return {X.data(), matrix_.rows(), columns}; }
  /// Statistics of factors that are stored as values with 32-bit row indices.
  static Statistics sparse_factor(double nonzeros) { return {nonzeros, 12 * nonzeros, 12 * nonzeros}; }
  Sparse matrix_;
  bool factorized_ = false;
};

/// Compares each pivot with its own row of the lower triangle `matrix`. Compared with the largest of all pivots, a soft body
/// beside a very stiff one would count as singular although its factorisation is accurate.
Outcome check_pivots(const Sparse& matrix, const Eigen::SimplicialLDLT<Sparse>& factors) {
  Eigen::VectorXd row_scale = Eigen::VectorXd::Zero(matrix.rows());
  for (int j = 0; j < matrix.outerSize(); ++j)
    for (Sparse::InnerIterator entry(matrix, j); entry; ++entry) {
      const double size = std::abs(entry.value());
      row_scale[j] = std::max(row_scale[j], size);
      row_scale[entry.row()] = std::max(row_scale[entry.row()], size);
    }
  const auto pivots = factors.vectorD();
  const auto& place = factors.permutationP().indices();
  for (Eigen::Index i = 0; i < row_scale.size(); ++i) {
    const double pivot = std::abs(pivots[place[i]]);
    if (!std::isfinite(pivot) || pivot <= kSingular * row_scale[i]) return Outcome::singular;
  }
  return Outcome::ok;
}

/// Common part of Eigen's solvers. Each analysis begins with a new one: a vector of Eigen 3.4 that finds no memory when it
/// is resized frees its old memory twice, unless it was empty.
template <typename EigenSolver>
class EigenEngine : public LowerTriangleEngine {
 public:
  Outcome solve(std::span<const double> B, std::span<double> X, int columns) override {
    out(X, columns) = solver_->solve(in(B, columns));
    return success_or(Outcome::not_converged);
  }

 protected:
  void forget() override { solver_.emplace(); }
  Outcome analyze_matrix() override { return Outcome::ok; }
  Outcome success_or(Outcome failure) const { return solver_->info() == Eigen::Success ? Outcome::ok : failure; }
  std::optional<EigenSolver> solver_;
};

class Ldlt final : public EigenEngine<Eigen::SimplicialLDLT<Sparse>> {
  Outcome analyze_matrix() override {
    solver_->analyzePattern(matrix_);
    return Outcome::ok;
  }
  Outcome factorize_matrix() override {
    solver_->factorize(matrix_);
    return solver_->info() == Eigen::Success ? check_pivots(matrix_, *solver_) : Outcome::singular;
  }
  Statistics factor_statistics() const override {
    Statistics statistics = sparse_factor(solver_->matrixL().nestedExpression().nonZeros());
    statistics.negative_pivots = static_cast<int>((solver_->vectorD().array() < 0).count());
    return statistics;
  }
};

class Llt final : public EigenEngine<Eigen::SimplicialLLT<Sparse>> {
  Outcome analyze_matrix() override {
    solver_->analyzePattern(matrix_);
    return Outcome::ok;
  }
  Outcome factorize_matrix() override {
    solver_->factorize(matrix_);
    return success_or(Outcome::not_positive_definite);
  }
  Statistics factor_statistics() const override { return sparse_factor(solver_->matrixL().nestedExpression().nonZeros()); }
};

using WideSparse = Eigen::SparseMatrix<double, Eigen::ColMajor, std::ptrdiff_t>;

class Lu final : public EigenEngine<Eigen::SparseLU<WideSparse>> {
  // SparseLU may drop entries that cancel when it is given a pattern of zeros, so it analyses with the first values.
  Outcome analyze_matrix() override {
    analyzed_ = false;
    return Outcome::ok;
  }
  Outcome factorize_matrix() override {
    const WideSparse full = Sparse(matrix_.selfadjointView<Eigen::Lower>());
    if (!analyzed_) solver_->analyzePattern(full);
    analyzed_ = true;
    solver_->factorize(full);
    return success_or(Outcome::singular);
  }
  Statistics factor_statistics() const override { return sparse_factor(double(solver_->nnzL()) + double(solver_->nnzU())); }
  bool analyzed_ = false;
};

class ConjugateGradients final : public EigenEngine<Eigen::ConjugateGradient<Sparse, Eigen::Lower>> {
 public:
  bool set_option(const std::string& key, const std::string& value) override { return options_.set(key, value); }
  Outcome solve(std::span<const double> B, std::span<double> X, int columns) override {
    iterations_ = 0;
    Outcome worst = Outcome::ok;
    for (int c = 0; c < columns; ++c) {  // Eigen counts the iterations of the last column only
      out(X, columns).col(c) = solver_->solve(in(B, columns).col(c));
      iterations_ += static_cast<int>(solver_->iterations());
      if (solver_->info() != Eigen::Success) worst = Outcome::not_converged;
    }
    return worst;
  }

 private:
  Outcome factorize_matrix() override {
    if ((matrix_.diagonal().array() <= 0).any()) return Outcome::not_positive_definite;
    solver_->setTolerance(options_.tolerance);
    solver_->setMaxIterations(options_.max_iterations > 0 ? options_.max_iterations
                                                          : std::max<Eigen::Index>(1000, 10 * matrix_.rows()));
    solver_->compute(matrix_);
    iterations_ = 0;
    return success_or(Outcome::failed);
  }
  Statistics factor_statistics() const override { return {.iterations = iterations_}; }
  IterationOptions options_{.tolerance = 1e-12};
  int iterations_ = 0;  ///< of all columns of the last solve
};

class Dense final : public EigenEngine<Eigen::LLT<Eigen::MatrixXd, Eigen::Lower>> {
  Outcome factorize_matrix() override {
    solver_->compute(Eigen::MatrixXd(matrix_));
    return success_or(Outcome::not_positive_definite);
  }
  Statistics factor_statistics() const override {
    const double n = static_cast<double>(matrix_.rows()), bytes = 8 * n * n;
    return {n * (n + 1) / 2, bytes, bytes, n * n * n / 3};
  }
};

}  // namespace

std::unique_ptr<Engine> make_eigen_ldlt() { return std::make_unique<Ldlt>(); }
std::unique_ptr<Engine> make_eigen_llt() { return std::make_unique<Llt>(); }
std::unique_ptr<Engine> make_eigen_lu() { return std::make_unique<Lu>(); }
std::unique_ptr<Engine> make_eigen_cg() { return std::make_unique<ConjugateGradients>(); }
std::unique_ptr<Engine> make_dense() { return std::make_unique<Dense>(); }

}  // namespace itr::linear
