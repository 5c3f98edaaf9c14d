// SPDX-License-Identifier: MIT
#include "muelu_part.hpp"

#include <BelosPseudoBlockCGSolMgr.hpp>
#include <BelosTpetraAdapter.hpp>
#include <MueLu_CreateTpetraPreconditioner.hpp>
#include <Teuchos_DefaultMpiComm.hpp>
#include <Tpetra_CrsMatrix.hpp>
#include <Tpetra_MultiVector.hpp>

#include <algorithm>
#include <array>
#include <type_traits>

#include "itr/module.h"

namespace itr::backends {

namespace {

using Map = Tpetra::Map<>;
using Matrix = Tpetra::CrsMatrix<double>;
using Vectors = Tpetra::MultiVector<double>;
using Operator = Tpetra::Operator<double>;
using Global = Map::global_ordinal_type;
using Teuchos::RCP;

/// Positive definite wherever the diagonal is positive, whatever the rest of the matrix.
class Jacobi final : public Operator {
 public:
  explicit Jacobi(const Matrix& matrix) : inverse_(matrix.getRowMap()) {
    Tpetra::Vector<double> diagonal(matrix.getRowMap());
    matrix.getLocalDiagCopy(diagonal);
    inverse_.reciprocal(diagonal);
  }
  RCP<const Map> getDomainMap() const override { return inverse_.getMap(); }
  RCP<const Map> getRangeMap() const override { return inverse_.getMap(); }
  void apply(const Vectors& X, Vectors& Y, Teuchos::ETransp, double, double) const override {
    Y.elementWiseMultiply(1, inverse_, X, 0);
  }

 private:
  Tpetra::Vector<double> inverse_;
};

template <typename T>
MPI_Datatype mpi_type() {
  return std::is_same_v<T, int> ? MPI_INT : MPI_DOUBLE;
}

}  // namespace

struct MueluPart::Impl {
  MPI_Comm communicator;
  RCP<const Teuchos::Comm<int>> comm;
  int rank = 0, ranks = 1;
  int block = 1;
  std::vector<int> nodes, rows, entries;  ///< on rank 0: of each rank
  RCP<const Map> map;
  RCP<Matrix> matrix;
  RCP<Vectors> null_space, coordinates;
  RCP<Operator> preconditioner;
  std::vector<int> starts, columns;     ///< of this rank's rows, by local column
  std::vector<int> own_begin, own_end;  ///< by row: which of its entries, as rank 0 has them, are of own columns
  int iterations = 0;
  std::string message;

  explicit Impl(MPI_Comm c) : communicator(c), comm(Teuchos::rcp(new Teuchos::MpiComm<int>(c))) {
    MPI_Comm_rank(c, &rank);
    MPI_Comm_size(c, &ranks);
  }

  /// This rank's part of what rank 0 has, whose parts have these sizes.
  template <typename T>
  std::vector<T> scatter(const std::vector<T>& all, const std::vector<int>& sizes) const {
    int size = 0;
    MPI_Scatter(sizes.data(), 1, MPI_INT, &size, 1, MPI_INT, 0, communicator);
    std::vector<T> part(size);
    const std::vector<int> offsets = offsets_of(sizes);
    MPI_Scatterv(all.data(), sizes.data(), offsets.data(), mpi_type<T>(), part.data(), size, mpi_type<T>(), 0, communicator);
    return part;
  }
  /// The other way round; `all` must be of its length on rank 0.
  void gather(const double* part, int size, std::vector<double>& all, const std::vector<int>& sizes) const {
    const std::vector<int> offsets = offsets_of(sizes);
    MPI_Gatherv(part, size, MPI_DOUBLE, all.data(), sizes.data(), offsets.data(), MPI_DOUBLE, 0, communicator);
  }
  static std::vector<int> offsets_of(const std::vector<int>& sizes) {
    std::vector<int> offsets(sizes.size());
    for (size_t r = 1; r < sizes.size(); ++r) offsets[r] = offsets[r - 1] + sizes[r - 1];
    return offsets;
  }

  void divide(const MueluSystem& system) {
    nodes.clear(), rows.clear(), entries.clear();
    if (rank > 0) return;
    const long long all = static_cast<long long>(system.starts.size() - 1) / system.block;
    for (int r = 0; r < ranks; ++r) {
      const auto begin = static_cast<int>(all * r / ranks), end = static_cast<int>(all * (r + 1) / ranks);
      nodes.push_back(end - begin);
      rows.push_back(system.block * (end - begin));
      entries.push_back(system.starts[system.block * end] - system.starts[system.block * begin]);
    }
  }

  RCP<const Map> make_map(int size) const {
    return Teuchos::rcp(new Map(Teuchos::OrdinalTraits<Tpetra::global_size_t>::invalid(), size, 0, comm));
  }

  RCP<Vectors> scatter_vectors(const RCP<const Map>& of, const std::vector<std::vector<double>>& all,
                               const std::vector<int>& sizes) const {
    int columns_there = static_cast<int>(all.size());
    MPI_Bcast(&columns_there, 1, MPI_INT, 0, communicator);
    if (columns_there == 0) return Teuchos::null;
    const auto vectors = Teuchos::rcp(new Vectors(of, columns_there));
    static const std::vector<double> kNothing;
    for (int c = 0; c < columns_there; ++c) {
      const std::vector<double> part = scatter(rank == 0 ? all[c] : kNothing, sizes);
      std::copy(part.begin(), part.end(), vectors->getDataNonConst(c).begin());
    }
    return vectors;
  }

  /// Columns of other ranks come behind the own ones, so that each row has its own first.
  void set_pattern(const MueluSystem& system) {
    std::vector<int> lengths;
    for (size_t i = 0; i + 1 < system.starts.size(); ++i) lengths.push_back(system.starts[i + 1] - system.starts[i]);
    const std::vector<int> length = scatter(lengths, rows);
    columns = scatter(system.columns, entries);
    const auto size = static_cast<int>(length.size());
    const int first = size > 0 ? static_cast<int>(map->getMinGlobalIndex()) : 0;
    const auto is_own = [&](int column) { return column >= first && column < first + size; };
    std::vector<int> others;
    std::copy_if(columns.begin(), columns.end(), std::back_inserter(others), [&](int c) { return !is_own(c); });
    std::sort(others.begin(), others.end());
    others.erase(std::unique(others.begin(), others.end()), others.end());
    Teuchos::Array<Global> globals;
    for (int i = 0; i < size; ++i) globals.push_back(first + i);
    globals.insert(globals.end(), others.begin(), others.end());
    const auto column_map =
        Teuchos::rcp(new Map(Teuchos::OrdinalTraits<Tpetra::global_size_t>::invalid(), globals(), 0, comm));
    starts.assign(1, 0), own_begin.clear(), own_end.clear();
    for (const int entries_of_row : length) {
      const auto begin = columns.begin() + starts.back(), end = begin + entries_of_row;
      const auto own = std::find_if(begin, end, is_own), behind = std::find_if_not(own, end, is_own);
      own_begin.push_back(static_cast<int>(own - begin));
      own_end.push_back(static_cast<int>(behind - begin));
      for (auto c = begin; c != end; ++c)
        *c = is_own(*c) ? *c - first
                        : size + static_cast<int>(std::lower_bound(others.begin(), others.end(), *c) - others.begin());
      std::rotate(begin, own, behind);
      starts.push_back(starts.back() + entries_of_row);
    }
    Teuchos::ArrayRCP<size_t> row_starts(static_cast<Teuchos_Ordinal>(starts.size()));
    Teuchos::ArrayRCP<int> indices(static_cast<Teuchos_Ordinal>(columns.size()));
    Teuchos::ArrayRCP<double> zeros(static_cast<Teuchos_Ordinal>(columns.size()));
    std::copy(starts.begin(), starts.end(), row_starts.begin());
    std::copy(columns.begin(), columns.end(), indices.begin());
    matrix = Teuchos::rcp(new Matrix(map, column_map, row_starts, indices, zeros));
    matrix->fillComplete(map, map);
  }

  void set_values(std::vector<double> values) {
    matrix->resumeFill();
    for (size_t i = 0; i + 1 < starts.size(); ++i) {
      double* const row = values.data() + starts[i];
      std::rotate(row, row + own_begin[i], row + own_end[i]);
      matrix->replaceLocalValues(static_cast<int>(i), starts[i + 1] - starts[i], row, &columns[starts[i]]);
    }
    matrix->fillComplete(map, map);
  }

  void make_preconditioner() {
    Teuchos::ParameterList list;
    list.set("verbosity", "none");
    list.set("number of equations", block);
    list.set("max levels", 10);
    list.set("coarse: max size", 1000);
    list.set("smoother: type", "CHEBYSHEV");
    list.sublist("smoother: params").set("chebyshev: degree", 3);
    list.sublist("smoother: params").set("chebyshev: ratio eigenvalue", 20.0);
    // Ten power iterations, Ifpack2's default, fall short of the largest eigenvalue by more than its margin of 10 % where a
    // few contacts or twisted elements have it; beyond it the polynomial may be negative, and the preconditioner indefinite.
    list.sublist("smoother: params").set("chebyshev: eigenvalue max iterations", 50);
    if (ranks > 1) {  // the direct solvers of Amesos2 fail there
      list.set("coarse: type", "CHEBYSHEV");
      list.sublist("coarse: params").set("chebyshev: degree", 20);
      list.sublist("coarse: params").set("chebyshev: ratio eigenvalue", 200.0);
      list.sublist("coarse: params").set("chebyshev: eigenvalue max iterations", 50);
    }
    auto& user = list.sublist("user data");
    user.set("Nullspace", null_space);
    if (!coordinates.is_null()) user.set("Coordinates", coordinates);
    preconditioner = Teuchos::null;
    preconditioner = MueLu::CreateTpetraPreconditioner(RCP<Operator>(matrix), list);
  }

  /// Conjugate gradients; ITR_NOT_POSITIVE_DEFINITE where the matrix or the preconditioner turns out not to be.
  int iterate(const RCP<Vectors>& b, const RCP<Vectors>& x, const RCP<Operator>& by,
              const linear::IterationOptions& options) {
    const auto problem = Teuchos::rcp(new Belos::LinearProblem<double, Vectors, Operator>(matrix, x, b));
    problem->setLeftPrec(by);
    problem->setHermitian();
    problem->setProblem();
    const auto list = Teuchos::parameterList();
    list->set("Convergence Tolerance", options.tolerance);
    list->set("Maximum Iterations", options.max_iterations);
    list->set("Implicit Residual Scaling", "Norm of RHS");
    list->set("Verbosity", 0);
    Belos::PseudoBlockCGSolMgr<double, Vectors, Operator> solver(problem, list);
    const auto fail = [&](int outcome, const char* why) {
      message = why;
      return outcome;
    };
    try {
      const bool converged = solver.solve() == Belos::Converged;
      iterations += solver.getNumIters();
      return converged ? ITR_OK : fail(ITR_NOT_CONVERGED, "the iterations did not converge");
    } catch (const Belos::StatusTestError& error) {
      return fail(ITR_NOT_CONVERGED, error.what());
    } catch (const Belos::CGIterateFailure& error) {
      return fail(ITR_NOT_POSITIVE_DEFINITE, error.what());
    }
  }
};

MueluPart::MueluPart(MPI_Comm communicator) : impl_(std::make_unique<Impl>(communicator)) {}
MueluPart::~MueluPart() = default;

void MueluPart::analyze(const MueluSystem& system) {
  impl_->preconditioner = Teuchos::null;
  impl_->coordinates = impl_->null_space = Teuchos::null;
  impl_->matrix = Teuchos::null;
  impl_->divide(system);
  impl_->block = system.block;
  MPI_Bcast(&impl_->block, 1, MPI_INT, 0, impl_->communicator);
  int nodes = 0;
  MPI_Scatter(impl_->nodes.data(), 1, MPI_INT, &nodes, 1, MPI_INT, 0, impl_->communicator);
  impl_->map = impl_->make_map(impl_->block * nodes);
  impl_->set_pattern(system);
  impl_->null_space = impl_->scatter_vectors(impl_->map, system.modes, impl_->rows);
  impl_->coordinates = impl_->scatter_vectors(impl_->make_map(nodes), system.coordinates, impl_->nodes);
}

void MueluPart::factorize(const std::vector<double>& values) {
  impl_->set_values(impl_->scatter(values, impl_->entries));
  impl_->make_preconditioner();
}

int MueluPart::solve(const std::vector<double>& b, std::vector<double>& x, const linear::IterationOptions& options) {
  Impl& my = *impl_;
  linear::IterationOptions asked = options;
  MPI_Bcast(&asked.tolerance, 1, MPI_DOUBLE, 0, my.communicator);
  MPI_Bcast(&asked.max_iterations, 1, MPI_INT, 0, my.communicator);
  my.iterations = 0;
  const std::vector<double> part = my.scatter(b, my.rows);
  const auto rhs = Teuchos::rcp(new Vectors(my.map, 1)), solution = Teuchos::rcp(new Vectors(my.map, 1));
  std::copy(part.begin(), part.end(), rhs->getDataNonConst(0).begin());
  int outcome = my.iterate(rhs, solution, my.preconditioner, asked);
  // Belos says the same of an indefinite matrix and of an indefinite preconditioner. Jacobi's cannot be that.
  if (outcome == ITR_NOT_POSITIVE_DEFINITE) {
    solution->putScalar(0);
    outcome = my.iterate(rhs, solution, Teuchos::rcp(new Jacobi(*my.matrix)), asked);
  }
  x.resize(b.size());
  const auto values = solution->getData(0);
  my.gather(values.getRawPtr(), static_cast<int>(values.size()), x, my.rows);
  return outcome;
}

int MueluPart::iterations() const { return impl_->iterations; }
const std::string& MueluPart::message() const { return impl_->message; }

}  // namespace itr::backends
