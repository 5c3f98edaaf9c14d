// SPDX-License-Identifier: MIT
// Amesos2's KLU2: LU for sparse patterns, solves indefinite systems.
#include <Amesos2.hpp>

#include <algorithm>
#include <string_view>

#include "itr/linear/module_adapter.hpp"
#include "trilinos.hpp"

namespace itr::backends {

namespace {

struct Klu2Objects {
  RCP<Amesos2::Solver<Matrix, Vectors>> solver;
};

class Klu2Engine : public TrilinosEngine<Klu2Objects> {
 public:
  int set_option(std::string_view, std::string_view) { return ITR_FAILED; }

  int analyze(const itr_pattern& pattern, const itr_hints&) {
    const std::scoped_lock guard(trilinos_lock());
    if (!start_kokkos()) return fail(ITR_FAILED, "MPI does not run");
    set_pattern(pattern);
    objects_->solver = Amesos2::create<Matrix, Vectors>("KLU2", objects_->matrix);
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
      return fail(ITR_SINGULAR, error.what());
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
    if (trilinos_is_running() && objects_ && !objects_->solver.is_null()) {
      result.factor_nonzeros = static_cast<double>(objects_->solver->getStatus().getNnzLU());
      result.factor_bytes = result.largest_bytes = 12 * result.factor_nonzeros;
    }
    return result;
  }
};

}  // namespace

itr_engine klu2_row(const char* version) {
  return on_mpi(linear::ModuleAdapter<Klu2Engine>::row("amesos2:klu2", version, "LGPL-2.1+", ITR_INDEFINITE, ""));
}

}  // namespace itr::backends
