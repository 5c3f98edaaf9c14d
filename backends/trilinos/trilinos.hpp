// SPDX-License-Identifier: MIT
// What the engines over Trilinos share: its start, its one lock, and matrices of one rank.
#pragma once

#include <Teuchos_RCP.hpp>
#include <Tpetra_CrsMatrix.hpp>
#include <Tpetra_MultiVector.hpp>
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

/// Rows of the module's table. All need MPI, if only on their own rank: Debian's Trilinos is built on it.
itr_engine on_mpi(itr_engine engine);
itr_engine klu2_row(const char* version);
itr_engine tacho_row(const char* version);
itr_engine muelu_row(const char* version);

}  // namespace itr::backends
