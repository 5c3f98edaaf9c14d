// SPDX-License-Identifier: MIT
// KLU2 (LU for sparse patterns, solves indefinite systems) without the adapter of Amesos2: that of Trilinos 13.2 does not
// hand on why a factorisation failed, and takes the matrix through Kokkos and MPI, which KLU2 does not need.
#include <Amesos2_KLU2_FunctionMap.hpp>
#include <algorithm>
#include <string_view>

#include "../common/full_matrix.hpp"
#include "trilinos.hpp"

namespace itr::backends {

namespace {

class Klu2 {
 public:
  Klu2() { KLU2::klu_defaults<double, int>(&common_); }
  ~Klu2() { forget(); }
  Klu2(const Klu2&) = delete;
  Klu2& operator=(const Klu2&) = delete;

  int set_option(std::string_view, std::string_view) { return ITR_FAILED; }

  int analyze(const itr_pattern& pattern, const itr_hints&) {
    forget();
    matrix_.set_pattern(pattern);
    const std::scoped_lock guard(trilinos_lock());  // it writes AMD's pointers to malloc, the same ones each time
    symbolic_ = KLU2::klu_analyze<double, int>(matrix_.order, matrix_.starts.data(), matrix_.indices.data(), &common_);
    return outcome();
  }

  int factorize(const double* values, size_t count) {
    matrix_.set_values(values, count);
    KLU2::klu_free_numeric<double, int>(&numeric_, &common_);
    numeric_ = KLU2::klu_factor<double, int>(matrix_.starts.data(), matrix_.indices.data(), matrix_.values.data(), symbolic_,
                                             &common_);
    return outcome();
  }

  int solve(const double* rhs, double* solution, int columns) {
    std::copy_n(rhs, static_cast<size_t>(matrix_.order) * columns, solution);
    // With the transpose, which is the same: klu_solve of Trilinos 13.2, compiled by g++ 12 -O1, gives wrong answers.
    KLU2::klu_tsolve<double, int>(symbolic_, numeric_, matrix_.order, columns, solution, &common_);
    return outcome();
  }

  itr_statistics statistics() const {
    itr_statistics result{};
    if (!numeric_) return result;
    result.factor_nonzeros = static_cast<double>(numeric_->lnz) + numeric_->unz;
    result.factor_bytes = result.largest_bytes = static_cast<double>(common_.memusage);
    return result;
  }

  const char* message() const {
    switch (common_.status) {
      case KLU_OK:
        return "";
      case KLU_SINGULAR:
        return "a pivot is zero";
      case KLU_OUT_OF_MEMORY:
        return "out of memory";
      case KLU_TOO_LARGE:
        return "the factor has too many entries for KLU2's 32-bit indices";
      default:
        return "KLU2 failed";
    }
  }

 private:
  int outcome() const {
    switch (common_.status) {
      case KLU_OK:
        return ITR_OK;
      case KLU_SINGULAR:
        return ITR_SINGULAR;
      case KLU_OUT_OF_MEMORY:
      case KLU_TOO_LARGE:
        return ITR_OUT_OF_MEMORY;
      default:
        return ITR_FAILED;
    }
  }
  void forget() {
    KLU2::klu_free_numeric<double, int>(&numeric_, &common_);
    KLU2::klu_free_symbolic<double, int>(&symbolic_, &common_);
  }

  KLU2::klu_common<double, int> common_{};
  KLU2::klu_symbolic<double, int>* symbolic_ = nullptr;
  KLU2::klu_numeric<double, int>* numeric_ = nullptr;
  FullMatrix matrix_;
};

}  // namespace

itr_engine klu2_row(const char* version) {
  return linear::ModuleAdapter<Klu2>::row("amesos2:klu2", version, "LGPL-2.1+", ITR_INDEFINITE, "");
}

}  // namespace itr::backends
