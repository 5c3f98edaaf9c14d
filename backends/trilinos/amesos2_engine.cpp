// SPDX-License-Identifier: MIT
// Amesos2: KLU2 (LU for sparse patterns, solves indefinite systems) and Tacho (Cholesky).
#include <Amesos2.hpp>

#include <algorithm>
#include <string_view>

#include "itr/linear/module_adapter.hpp"
#include "trilinos.hpp"

namespace itr::backends {

namespace {

enum class Kind { klu2, tacho };

// From here on Tacho's own factorisation takes over from LAPACK's, and Amesos2 13.2 forgets to initialise it.
constexpr int kTachoBelow = 1024;

struct Amesos2Objects {
  RCP<Amesos2::Solver<Matrix, Vectors>> solver;
};

template <Kind kind>
class Amesos2Engine : public TrilinosEngine<Amesos2Objects> {
 public:
  int set_option(std::string_view, std::string_view) { return ITR_FAILED; }

  int analyze(const itr_pattern& pattern, const itr_hints&) {
    const std::scoped_lock guard(trilinos_lock());
    if (!start_kokkos()) return fail(ITR_FAILED, "MPI does not run");
    if (kind == Kind::tacho && pattern.order >= kTachoBelow)
      return fail(ITR_FAILED, "Amesos2 of Trilinos 13.2 crashes with Tacho from 1024 unknowns on");
    set_pattern(pattern);
    objects_->solver = Amesos2::create<Matrix, Vectors>(kind == Kind::klu2 ? "KLU2" : "Tacho", objects_->matrix);
    objects_->solver->symbolicFactorization();
    return ITR_OK;
  }

  int factorize(const double* values, size_t count) {
    const std::scoped_lock guard(trilinos_lock());
    if (!trilinos_is_running()) return fail(ITR_FAILED, "MPI was finalised");
    set_matrix(values, count);
    try {
      objects_->solver->setA(objects_->matrix, Amesos2::SYMBFACT);
      objects_->solver->numericFactorization();
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& error) {  // Amesos2 tells failures apart by text only
      return fail(kind == Kind::klu2 ? ITR_SINGULAR : ITR_NOT_POSITIVE_DEFINITE, error.what());
    }
    return ITR_OK;
  }

  int solve(const double* rhs, double* solution, int columns) {
    const std::scoped_lock guard(trilinos_lock());
    if (!trilinos_is_running()) return fail(ITR_FAILED, "MPI was finalised");
    const auto b = make_vectors(objects_->map, columns), x = make_vectors(objects_->map, columns);
    const auto length = static_cast<size_t>(full_.order);
    for (int c = 0; c < columns; ++c) {
      auto column = b->getDataNonConst(c);
      std::copy(rhs + c * length, rhs + (c + 1) * length, column.begin());
    }
    objects_->solver->setX(x);
    objects_->solver->setB(b);
    objects_->solver->solve();
    for (int c = 0; c < columns; ++c) {
      const auto column = x->getData(c);
      std::copy(column.begin(), column.end(), solution + c * length);
    }
    return ITR_OK;
  }

  itr_statistics statistics() const {
    itr_statistics result{};
    const std::scoped_lock guard(trilinos_lock());
    if (trilinos_is_running() && objects_ && !objects_->solver.is_null() && kind == Kind::klu2) {
      result.factor_nonzeros = static_cast<double>(objects_->solver->getStatus().getNnzLU());
      result.factor_bytes = result.largest_bytes = 12 * result.factor_nonzeros;
    }
    return result;
  }
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
