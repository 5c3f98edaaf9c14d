// SPDX-License-Identifier: MIT
// Amesos2: KLU2 (LU for sparse patterns, solves indefinite systems) and Tacho (Cholesky).
#include <Amesos2.hpp>

#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>

#include "itr/linear/module_adapter.hpp"
#include "trilinos.hpp"

namespace itr::backends {

namespace {

enum class Kind { klu2, tacho };

// From here on Tacho's own factorisation takes over from LAPACK's, and Amesos2 13.2 forgets to initialise it.
constexpr int kTachoBelow = 1024;

template <Kind kind>
class Amesos2Engine {
 public:
  Amesos2Engine() = default;
  ~Amesos2Engine() {
    const std::scoped_lock guard(trilinos_lock());
    if (trilinos_is_running()) {
      reset();
      return;
    }
    // Kokkos has taken its memory back: what is left must not be destroyed.
    solver_.release();
    matrix_.release();
    map_.release();
  }
  Amesos2Engine(const Amesos2Engine&) = delete;
  Amesos2Engine& operator=(const Amesos2Engine&) = delete;

  int set_option(std::string_view, std::string_view) { return ITR_FAILED; }

  int analyze(const itr_pattern& pattern, const itr_hints&) {
    const std::scoped_lock guard(trilinos_lock());
    if (!start_kokkos()) return fail("MPI does not run");
    reset();
    if (kind == Kind::tacho && pattern.order >= kTachoBelow)
      return fail("Amesos2 of Trilinos 13.2 crashes with Tacho from 1024 unknowns on");
    full_.set_pattern(pattern);
    map_ = make_map(full_.order);
    matrix_ = make_matrix(map_, full_);
    solver_ = Amesos2::create<Matrix, Vectors>(kind == Kind::klu2 ? "KLU2" : "Tacho", matrix_);
    solver_->symbolicFactorization();
    return ITR_OK;
  }

  int factorize(const double* values, size_t count) {
    const std::scoped_lock guard(trilinos_lock());
    if (!trilinos_is_running()) return fail("MPI was finalised");
    full_.set_values(values, count);
    set_values(*matrix_, full_);
    try {
      solver_->setA(matrix_, Amesos2::SYMBFACT);
      solver_->numericFactorization();
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& error) {  // Amesos2 tells failures apart by text only
      fail(error.what());
      return kind == Kind::klu2 ? ITR_SINGULAR : ITR_NOT_POSITIVE_DEFINITE;
    }
    return ITR_OK;
  }

  int solve(const double* rhs, double* solution, int columns) {
    const std::scoped_lock guard(trilinos_lock());
    if (!trilinos_is_running()) return fail("MPI was finalised");
    const auto b = make_vectors(map_, columns), x = make_vectors(map_, columns);
    const auto length = static_cast<size_t>(full_.order);
    for (int c = 0; c < columns; ++c) {
      auto column = b->getDataNonConst(c);
      std::copy(rhs + c * length, rhs + (c + 1) * length, column.begin());
    }
    solver_->setX(x);
    solver_->setB(b);
    solver_->solve();
    for (int c = 0; c < columns; ++c) {
      const auto column = x->getData(c);
      std::copy(column.begin(), column.end(), solution + c * length);
    }
    return ITR_OK;
  }

  itr_statistics statistics() const {
    itr_statistics result{};
    const std::scoped_lock guard(trilinos_lock());
    if (trilinos_is_running() && !solver_.is_null() && kind == Kind::klu2) {
      result.factor_nonzeros = static_cast<double>(solver_->getStatus().getNnzLU());
      result.factor_bytes = result.largest_bytes = 12 * result.factor_nonzeros;
    }
    return result;
  }
  const char* message() const { return text_.data(); }

 private:
  int fail(const char* why) {
    std::snprintf(text_.data(), text_.size(), "%s", why);
    return ITR_FAILED;
  }
  void reset() {
    solver_ = Teuchos::null;
    matrix_ = Teuchos::null;
    map_ = Teuchos::null;
  }

  FullMatrix full_;
  RCP<const Map> map_;
  RCP<Matrix> matrix_;
  RCP<Amesos2::Solver<Matrix, Vectors>> solver_;
  std::array<char, 200> text_{};
};

}  // namespace

itr_engine klu2_row(const char* version) {
  return on_mpi(
      linear::ModuleAdapter<Amesos2Engine<Kind::klu2>>::row("amesos2:klu2", version, "LGPL-2.1+", ITR_INDEFINITE, ""));
}
itr_engine tacho_row(const char* version) {
  return on_mpi(linear::ModuleAdapter<Amesos2Engine<Kind::tacho>>::row("amesos2:tacho", version, "BSD-3-Clause", 0, ""));
}

}  // namespace itr::backends
