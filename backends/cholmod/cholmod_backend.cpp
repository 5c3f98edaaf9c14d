// SPDX-License-Identifier: MIT
// CHOLMOD as a loadable module: supernodal and simplicial Cholesky of the lower triangle, and supernodal Cholesky by tasks.
#include <cholmod.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <numeric>
#include <span>
#include <string_view>
#include <vector>

#include "../common/blas.hpp"
#include "../common/openmp.hpp"
#include "../common/ordering.hpp"
#include "itr/module.h"
#include "task_cholesky.hpp"

namespace {

/// Numeric phase of supernodal factors.
enum class Numeric { cholmod, tasks };

template <int Supernodal, Numeric By = Numeric::cholmod>
class Cholmod {
 public:
  Cholmod() {
    cholmod_start(&common_);
    common_.print = 0;
    common_.error_handler = nullptr;
    common_.supernodal = Supernodal;
    common_.final_ll = 1;
    common_.nmethods = 1;
    common_.postorder = 1;
    common_.quick_return_if_not_posdef = 1;
  }
  ~Cholmod() {
    cholmod_free_factor(&factor_, &common_);
    cholmod_free_dense(&solution_, &common_);
    cholmod_free_dense(&workspace_y_, &common_);
    cholmod_free_dense(&workspace_e_, &common_);
    cholmod_finish(&common_);
  }
  Cholmod(const Cholmod&) = delete;
  Cholmod& operator=(const Cholmod&) = delete;

  int set_option(std::string_view key, std::string_view value) {
    static constexpr itr::backends::Ordering kOrderings[] = {
        {"auto", CHOLMOD_AMD}, {"amd", CHOLMOD_AMD}, {"metis", CHOLMOD_METIS}, {"natural", CHOLMOD_NATURAL}};
    const auto ordering = itr::backends::find_ordering(kOrderings, key, value);
    if (!ordering) return ITR_FAILED;
    may_try_metis_ = value == "auto";
    ordering_ = *ordering;
    return ITR_OK;
  }

  int analyze(const itr_pattern& pattern, const itr_hints& hints) {
    const int n = pattern.order;
    starts_.assign(pattern.column_starts, pattern.column_starts + n + 1);
    rows_.assign(pattern.row_indices, pattern.row_indices + starts_[n]);
    values_.assign(rows_.size(), 0.0);
    matrix_ = {};
    matrix_.nrow = matrix_.ncol = n;
    matrix_.nzmax = rows_.size();
    matrix_.p = starts_.data();
    matrix_.i = rows_.data();
    matrix_.x = values_.data();
    matrix_.stype = -1;  // symmetric, the lower triangle is stored
    matrix_.itype = CHOLMOD_INT;
    matrix_.xtype = CHOLMOD_REAL;
    matrix_.dtype = CHOLMOD_DOUBLE;
    matrix_.sorted = matrix_.packed = 1;
    const bool has_order = order_.recall(pattern, hints);
    if (!has_order) tried_metis_ = false;
    const bool is_long = has_order && may_try_metis_ && !tried_metis_ && factorizations_ >= kManyFactorizations;
    if (has_order && !(is_long && common_.fl > kMetisFromFlopsIfLong * n)) {
      analyze_by(CHOLMOD_GIVEN);
      if (!factor_ || order_.is_good(common_.fl)) return status();
    }
    factorizations_ = 0;
    analyze_by(ordering_);
    if (may_try_metis_ && factor_ && common_.fl > (is_long ? kMetisFromFlopsIfLong : kMetisFromFlops) * n) {
      tried_metis_ = true;
      const double flops_by_amd = common_.fl;
      analyze_by(CHOLMOD_METIS);
      if (!factor_ || common_.fl > flops_by_amd) analyze_by(CHOLMOD_AMD);
    }
    if (factor_) order_.keep(static_cast<const int*>(factor_->Perm), n, common_.fl);
    return status();
  }

  int factorize(const double* values, size_t count) {
    const itr::backends::OneOpenMpThread one_thread;
    ++factorizations_;
    if (factor_ && factor_->is_super) {
      if (sources_.empty()) prepare_numeric();
      if (is_by_tasks_) {
        const int done = tasks_.factorize(values, sources_);
        return done < tasks_.order() ? refuse(done) : ITR_OK;
      }
      for (size_t k = 0; k < count; ++k) permuted_values_[k] = values[sources_[k]];
      double shift[2] = {0, 0};
      cholmod_super_numeric(&permuted_, nullptr, shift, factor_, &common_);
    } else {
      std::copy(values, values + count, values_.begin());
      cholmod_factorize(&matrix_, factor_, &common_);
    }
    if (common_.status == CHOLMOD_NOT_POSDEF || (factor_ && factor_->minor < factor_->n)) {
      common_.status = CHOLMOD_OK;
      return refuse(factor_ ? factor_->minor : 0);
    }
    return status();
  }

  int solve(const double* rhs, double* solution, int columns) {
    if (is_by_tasks_) {
      tasks_.solve(rhs, solution, columns, static_cast<const int*>(factor_->Perm));
      return ITR_OK;
    }
    cholmod_dense b{};
    b.nrow = b.d = matrix_.nrow;
    b.ncol = columns;
    b.nzmax = b.nrow * b.ncol;
    b.x = const_cast<double*>(rhs);  // CHOLMOD does not write to it
    b.xtype = CHOLMOD_REAL;
    b.dtype = CHOLMOD_DOUBLE;
    if (!cholmod_solve2(CHOLMOD_A, factor_, &b, nullptr, &solution_, nullptr, &workspace_y_, &workspace_e_, &common_))
      return status() == ITR_OK ? ITR_FAILED : status();
    std::copy_n(static_cast<const double*>(solution_->x), b.nzmax, solution);
    return ITR_OK;
  }

  itr_statistics statistics() const {
    itr_statistics result{};
    if (!factor_) return result;
    result.factor_nonzeros = common_.lnz;
    result.factor_bytes = result.largest_bytes =
        factor_->is_super ? 8.0 * factor_->xsize + 4.0 * factor_->ssize : 12.0 * factor_->nzmax;
    if (is_by_tasks_) {
      result.largest_bytes += sizeof(double) * static_cast<double>(tasks_.work_size());
      result.tasks_wall = tasks_.times().wall;
      result.tasks_work = tasks_.times().work;
      result.tasks_span = tasks_.times().span;
    }
    result.flops = common_.fl;
    return result;
  }
  const char* message() const { return text_.data(); }

 private:
  void analyze_by(int ordering) {
    cholmod_free_factor(&factor_, &common_);
    sources_.clear();
    is_by_tasks_ = false;
    common_.method[0].ordering = ordering;
    int* const given = ordering == CHOLMOD_GIVEN ? order_.permutation() : nullptr;
    factor_ = cholmod_analyze_p(&matrix_, given, nullptr, 0, &common_);
  }

  /// Where memory is out, the next factorisation begins anew.
  void prepare_numeric() {
    try {
      permute_pattern();
    } catch (...) {
      sources_.clear();
      throw;
    }
  }

  /// The lower triangle in the factor's order. cholmod_factorize would find it anew each time, by two transpositions.
  void permute_pattern() {
    const int n = static_cast<int>(matrix_.nrow);
    const auto* order = static_cast<const int*>(factor_->Perm);
    std::vector<int> place(n);
    for (int k = 0; k < n; ++k) place[order[k]] = k;
    permuted_starts_.assign(n + 1, 0);
    const auto visit = [&](auto&& use) {
      for (int j = 0; j < n; ++j)
        for (int p = starts_[j]; p < starts_[j + 1]; ++p)
          use(p, std::max(place[rows_[p]], place[j]), std::min(place[rows_[p]], place[j]));
    };
    visit([&](int, int, int column) { ++permuted_starts_[column + 1]; });
    std::partial_sum(permuted_starts_.begin(), permuted_starts_.end(), permuted_starts_.begin());
    std::vector<int> next(permuted_starts_.begin(), permuted_starts_.end() - 1);
    sources_.resize(rows_.size());
    permuted_rows_.resize(rows_.size());
    permuted_values_.resize(rows_.size());
    visit([&](int p, int row, int column) {
      const int at = next[column]++;
      sources_[at] = p;
      permuted_rows_[at] = row;
    });
    if constexpr (By == Numeric::tasks) {
      const auto ints = [](const void* of, std::size_t count) { return std::span(static_cast<const int*>(of), count); };
      const cholmod_factor& l = *factor_;
      is_by_tasks_ = tasks_.analyze(
          {ints(l.super, l.nsuper + 1), ints(l.pi, l.nsuper + 1), ints(l.s, l.ssize), permuted_starts_, permuted_rows_});
    }
    permuted_ = matrix_;
    permuted_.sorted = 0;
    permuted_.p = permuted_starts_.data();
    permuted_.i = permuted_rows_.data();
    permuted_.x = permuted_values_.data();
  }

  int refuse(std::size_t pivot) {
    std::snprintf(text_.data(), text_.size(), "not positive definite at pivot %zu of %zu", pivot, matrix_.nrow);
    return ITR_NOT_POSITIVE_DEFINITE;
  }
  int status() {
    std::snprintf(text_.data(), text_.size(), "CHOLMOD status %d", common_.status);
    if (common_.status == CHOLMOD_OUT_OF_MEMORY || common_.status == CHOLMOD_TOO_LARGE) return ITR_OUT_OF_MEMORY;
    return common_.status >= CHOLMOD_OK && factor_ ? ITR_OK : ITR_FAILED;
  }

  /// Flops of AMD's factorisation an unknown, from which the half of them that METIS saves pays for its 3 to 25 microseconds
  /// an unknown in the few factorisations that its order lasts (verification/scaling, verification/solvers).
  static constexpr double kMetisFromFlops = 1.5e5;
  /// Threshold where an order has lasted for so many factorisations that it will last for many more.
  static constexpr double kMetisFromFlopsIfLong = 2.5e4;
  static constexpr int kManyFactorizations = 10;

  int ordering_ = CHOLMOD_AMD;
  bool may_try_metis_ = true, tried_metis_ = false;
  int factorizations_ = 0;  ///< in the present order
  itr::backends::KeptOrder order_;
  cholmod_common common_{};
  cholmod_sparse matrix_{};
  cholmod_factor* factor_ = nullptr;
  cholmod_dense* solution_ = nullptr;
  cholmod_dense *workspace_y_ = nullptr, *workspace_e_ = nullptr;
  std::vector<int> starts_, rows_;
  std::vector<double> values_;
  cholmod_sparse permuted_{};                                   ///< of supernodal factors
  std::vector<int> permuted_starts_, permuted_rows_, sources_;  ///< where in `values` an entry comes from
  std::vector<double> permuted_values_;
  itr::backends::TaskCholesky tasks_;
  bool is_by_tasks_ = false;
  std::array<char, 96> text_{};
};

const char* version() {
  static char text[160];
  int loaded[3] = {};  // of the library, which may be newer than the header
  cholmod_version(loaded);
  std::snprintf(text, sizeof text, "CHOLMOD %d.%d.%d, %s", loaded[0], loaded[1], loaded[2], itr::backends::pin_blas());
  return text;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const itr_module* itr_backend_module(void) {
  using Choice = itr::linear::ModuleAdapter<Cholmod<CHOLMOD_AUTO>>;
  using Tasks = itr::linear::ModuleAdapter<Cholmod<CHOLMOD_SUPERNODAL, Numeric::tasks>>;
  using Supernodal = itr::linear::ModuleAdapter<Cholmod<CHOLMOD_SUPERNODAL>>;
  using Simplicial = itr::linear::ModuleAdapter<Cholmod<CHOLMOD_SIMPLICIAL>>;
  constexpr uint32_t kCapabilities = ITR_KEEPS_ORDER | ITR_TELLS_DEFINITENESS;
  constexpr const char* kOptions = "ordering=auto|amd|metis|natural";
  static const itr_engine engines[] = {
      Choice::row("cholmod", version(), "GPL-2.0+", kCapabilities, kOptions),
      Tasks::row("cholmod:tasks", version(), "GPL-2.0+", kCapabilities | ITR_THREADS, kOptions),
      Supernodal::row("cholmod:supernodal", version(), "GPL-2.0+", kCapabilities, kOptions),
      Simplicial::row("cholmod:simplicial", version(), "LGPL-2.1+", kCapabilities, kOptions)};
  static const itr_module module{ITR_BACKEND_ABI_VERSION, sizeof engines / sizeof engines[0], engines};
  return &module;
}
