// SPDX-License-Identifier: MIT
// UMFPACK as a loadable module: LU with its strategy for symmetric patterns; solves indefinite systems.
#include <umfpack.h>

#include <array>
#include <cstdio>
#include <string_view>
#include <vector>

#include "../common/blas.hpp"
#include "../common/full_matrix.hpp"
#include "../common/ordering.hpp"
#include "itr/module.h"

namespace {

class Umfpack {
 public:
  Umfpack() {
    umfpack_dl_defaults(control_.data());
    control_[UMFPACK_STRATEGY] = UMFPACK_STRATEGY_SYMMETRIC;
    control_[UMFPACK_SCALE] = UMFPACK_SCALE_NONE;  // that of rows would make a symmetric matrix unsymmetric
    control_[UMFPACK_IRSTEP] = 0;                  // residuals are checked and refined by our side for all backends
  }
  ~Umfpack() {
    umfpack_dl_free_symbolic(&symbolic_);
    umfpack_dl_free_numeric(&numeric_);
  }
  Umfpack(const Umfpack&) = delete;
  Umfpack& operator=(const Umfpack&) = delete;

  int set_option(std::string_view key, std::string_view value) {
    static constexpr itr::backends::Ordering kOrderings[] = {
        {"amd", UMFPACK_ORDERING_AMD}, {"metis", UMFPACK_ORDERING_METIS}, {"natural", UMFPACK_ORDERING_NONE}};
    const auto ordering = itr::backends::find_ordering(kOrderings, key, value);
    if (!ordering) return ITR_FAILED;
    control_[UMFPACK_ORDERING] = *ordering;
    return ITR_OK;
  }

  int analyze(const itr_pattern& pattern, const itr_hints&) {
    matrix_.set_pattern(pattern);
    starts_.assign(matrix_.starts.begin(), matrix_.starts.end());
    indices_.assign(matrix_.indices.begin(), matrix_.indices.end());
    umfpack_dl_free_numeric(&numeric_);
    umfpack_dl_free_symbolic(&symbolic_);
    return outcome(umfpack_dl_symbolic(matrix_.order, matrix_.order, starts_.data(), indices_.data(), nullptr, &symbolic_,
                                       control_.data(), info_.data()));
  }

  int factorize(const double* values, size_t count) {
    matrix_.set_values(values, count);
    umfpack_dl_free_numeric(&numeric_);
    return outcome(umfpack_dl_numeric(starts_.data(), indices_.data(), matrix_.values.data(), symbolic_, &numeric_,
                                      control_.data(), info_.data()));
  }

  int solve(const double* rhs, double* solution, int columns) {
    for (int c = 0; c < columns; ++c) {
      const auto offset = static_cast<size_t>(c) * matrix_.order;
      std::array<double, UMFPACK_INFO> info{};
      const auto status = umfpack_dl_solve(UMFPACK_A, starts_.data(), indices_.data(), matrix_.values.data(),
                                           solution + offset, rhs + offset, numeric_, control_.data(), info.data());
      if (const int result = outcome(status); result != ITR_OK) return result;
    }
    return ITR_OK;
  }

  itr_statistics statistics() const {
    itr_statistics result{};
    if (!numeric_) return result;
    result.factor_nonzeros = info_[UMFPACK_LNZ] + info_[UMFPACK_UNZ];
    result.factor_bytes = result.largest_bytes = info_[UMFPACK_NUMERIC_SIZE] * info_[UMFPACK_SIZE_OF_UNIT];
    result.flops = info_[UMFPACK_FLOPS];
    return result;
  }
  const char* message() const { return text_.data(); }

 private:
  int outcome(SuiteSparse_long status) {
    std::snprintf(text_.data(), text_.size(), "UMFPACK status %ld", static_cast<long>(status));
    switch (status) {
      case UMFPACK_OK:
        return ITR_OK;
      case UMFPACK_WARNING_singular_matrix:
        std::snprintf(text_.data(), text_.size(), "singular: %.0f of %d pivots are not zero", info_[UMFPACK_UDIAG_NZ],
                      matrix_.order);
        return ITR_SINGULAR;
      case UMFPACK_ERROR_out_of_memory:
        return ITR_OUT_OF_MEMORY;
      default:
        return ITR_FAILED;
    }
  }

  itr::backends::FullMatrix matrix_;
  std::vector<SuiteSparse_long> starts_, indices_;  ///< with 32 bits UMFPACK ends at 2 GB of factors
  void *symbolic_ = nullptr, *numeric_ = nullptr;
  std::array<double, UMFPACK_CONTROL> control_{};
  std::array<double, UMFPACK_INFO> info_{};
  std::array<char, 96> text_{};
};

const char* version() {
  static char text[160];
  std::snprintf(text, sizeof text, "UMFPACK %d.%d.%d, %s", UMFPACK_MAIN_VERSION, UMFPACK_SUB_VERSION, UMFPACK_SUBSUB_VERSION,
                itr::backends::pin_blas());
  return text;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const itr_module* itr_backend_module(void) {
  static const itr_engine engines[] = {itr::linear::ModuleAdapter<Umfpack>::row(
      "umfpack", version(), "GPL-2.0+", ITR_INDEFINITE, "ordering=amd|metis|natural")};
  static const itr_module module{ITR_BACKEND_ABI_VERSION, 1, engines};
  return &module;
}
