// SPDX-License-Identifier: MIT
// What the engines over Trilinos share: its start, its one lock, and matrices of one rank.
#pragma once

#include <Teuchos_RCP.hpp>
#include <Tpetra_CrsMatrix.hpp>
#include <Tpetra_MultiVector.hpp>
#include <array>
#include <cstdio>
#include <memory>
#include <mutex>
#include <vector>

#include "../common/full_matrix.hpp"
#include "itr/linear/abi.h"

namespace itr::backends {

using Map = Tpetra::Map<>;
using Matrix = Tpetra::CrsMatrix<double>;
using Vectors = Tpetra::MultiVector<double>;
using Teuchos::RCP;

/// Kokkos is not re-entrant: every call into Trilinos, destructors included, happens under this.
std::mutex& trilinos_lock();

/// Starts Kokkos where nobody has, finalised at exit by whoever started it. False where MPI does not run.
bool start_kokkos();
/// False after Kokkos or MPI was finalised: what is left of an engine must not be touched then.
bool trilinos_is_running();

/// Rows 0 .. order-1, all on this rank (MPI_COMM_SELF: on two ranks klu2 of Trilinos 13.2 was wrong and tacho crashed).
RCP<const Map> make_map(int order);
RCP<Matrix> make_matrix(const RCP<const Map>& map, const FullMatrix& full);
/// The same pattern, other values.
void set_values(Matrix& matrix, const FullMatrix& full);
RCP<Vectors> make_vectors(const RCP<const Map>& map, int columns);

/// What an engine over Trilinos is made of. Own: the objects that it needs beside the matrix, as RCPs.
template <typename Own>
class TrilinosEngine {
 public:
  TrilinosEngine(const TrilinosEngine&) = delete;
  TrilinosEngine& operator=(const TrilinosEngine&) = delete;
  const char* message() const { return text_.data(); }

 protected:
  struct Objects : Own {
    RCP<const Map> map;
    RCP<Matrix> matrix;
  };
  TrilinosEngine() = default;
  ~TrilinosEngine() {
    const std::scoped_lock guard(trilinos_lock());
    // After Kokkos has taken its memory back, what is left must not be destroyed.
    if (!trilinos_is_running()) static_cast<void>(objects_.release());
    objects_.reset();
  }
  /// Forgets everything, and begins with zeros in this lower triangle.
  void set_pattern(const itr_pattern& lower) {
    objects_.reset(new Objects());
    full_.set_pattern(lower);
    objects_->map = make_map(full_.order);
    objects_->matrix = make_matrix(objects_->map, full_);
  }
  void set_matrix(const double* values, size_t count) {
    full_.set_values(values, count);
    set_values(*objects_->matrix, full_);
  }
  int fail(int outcome, const char* why) {
    std::snprintf(text_.data(), text_.size(), "%s", why);
    return outcome;
  }

  FullMatrix full_;
  std::unique_ptr<Objects> objects_;  ///< none before the first analysis

 private:
  std::array<char, 200> text_{};
};

/// Rows of the module's table. All need MPI, if only on their own rank: Debian's Trilinos is built on it.
itr_engine on_mpi(itr_engine engine);
itr_engine klu2_row(const char* version);
itr_engine tacho_row(const char* version);
itr_engine muelu_row(const char* version);

}  // namespace itr::backends
