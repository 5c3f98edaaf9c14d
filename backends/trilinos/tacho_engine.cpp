// SPDX-License-Identifier: MIT
// Tacho (Cholesky), without the adapter of Amesos2: that of Trilinos 13.2 never calls Tacho's initialize(), and crashes from
// 1024 unknowns on, where Tacho's own factorisation takes over from LAPACK's.
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <Tacho.hpp>
#include <Tacho_Driver.hpp>
#include <algorithm>
#include <exception>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "../common/full_matrix.hpp"
#include "trilinos.hpp"

namespace itr::backends {

namespace {

using Device = Tacho::UseThisDevice<Kokkos::DefaultHostExecutionSpace>::type;
using Driver = Tacho::Driver<double, Device>;

struct Objects {
  Driver driver;
  Driver::value_type_array values;
  Objects() = default;
  ~Objects() { driver.release(); }
  Objects(const Objects&) = delete;
  Objects& operator=(const Objects&) = delete;
};

/// Unknowns below which LAPACK factorises. With Tacho's own limit of 1024 the masticator's linear solves take six times as
/// long.
constexpr int kDenseBelow = 100;

class TachoEngine {
 public:
  int set_option(std::string_view, std::string_view) { return ITR_FAILED; }

  int analyze(const itr_pattern& pattern, const itr_hints&) {
    objects_.reset();
    full_.set_pattern(pattern);
    prepare();
    return ITR_OK;
  }

  int factorize(const double* values, size_t count) {
    if (!objects_) prepare();
    full_.set_values(values, count);
    std::copy(full_.values.begin(), full_.values.end(), objects_->values.data());
    int outcome = ITR_OK;
    keep_unless_it_throws([&](Driver& driver) {
      try {
        driver.factorize(objects_->values);
      } catch (const std::exception& error) {  // LAPACK's number of the pivot is not handed on
        if (is_out_of_memory(error)) throw;
        message_ = error.what();
        outcome = ITR_NOT_POSITIVE_DEFINITE;
      }
    });
    return outcome;
  }

  int solve(const double* rhs, double* solution, int columns) {
    if (!objects_) throw std::runtime_error("memory was out before");
    const auto length = static_cast<size_t>(full_.order) * columns;
    Driver::value_type_matrix b("b", full_.order, columns), x("x", full_.order, columns), scratch("t", full_.order, columns);
    std::copy_n(rhs, length, b.data());
    keep_unless_it_throws([&](Driver& driver) { driver.solve(x, b, scratch); });
    std::copy_n(x.data(), length, solution);
    return ITR_OK;
  }

  itr_statistics statistics() const { return {}; }
  const char* message() const { return message_.c_str(); }

 private:
  /// Orders full_ and reserves memory for its factor.
  void prepare() {
    auto objects = std::make_unique<Objects>();
    Driver::size_type_array_host starts("starts", full_.starts.size());
    Driver::ordinal_type_array_host indices("indices", full_.indices.size());
    std::copy(full_.starts.begin(), full_.starts.end(), starts.data());
    std::copy(full_.indices.begin(), full_.indices.end(), indices.data());
    objects->values = Driver::value_type_array("values", full_.values.size());
    objects->driver.setMatrixType(2, true);  // symmetric, positive definite
    objects->driver.setSmallProblemThresholdsize(kDenseBelow);
    const auto order = fill_reducing_order();
    Driver::ordinal_type_array_host forth("forth", full_.order), back("back", full_.order);
    for (int k = 0; k < full_.order; ++k) {
      forth(k) = order.indices()[k];
      back(order.indices()[k]) = k;
    }
    objects_ = std::move(objects);
    keep_unless_it_throws([&](Driver& driver) {
      driver.analyze(full_.order, starts, indices, forth, back);
      driver.initialize();
    });
  }

  /// Where memory ends within a call, Tacho 13.2 would free twice what it has: it is left as it is, never to be destroyed.
  template <typename F>
  void keep_unless_it_throws(F&& f) {
    try {
      f(objects_->driver);
    } catch (...) {
      static_cast<void>(objects_.release());
      throw;
    }
  }

  /// Eigen's AMD: Debian's Tacho is built without METIS, and then takes the unknowns as they come.
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> fill_reducing_order() const {
    using Pattern = Eigen::SparseMatrix<double>;
    const Eigen::Map<const Pattern> pattern(full_.order, full_.order, static_cast<int>(full_.indices.size()),
                                            full_.starts.data(), full_.indices.data(), full_.values.data());
    Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
    Eigen::AMDOrdering<int>()(Pattern(pattern), order);
    return order;
  }

  FullMatrix full_;
  std::unique_ptr<Objects> objects_;  ///< none before the first analysis, and where memory was out
  std::string message_;
};

}  // namespace

itr_engine tacho_row(const char* version) {
  return kokkos_row<TachoEngine>("amesos2:tacho", version, "BSD-3-Clause", ITR_TELLS_DEFINITENESS, "");
}

}  // namespace itr::backends
