// SPDX-License-Identifier: MIT
// Belos' conjugate gradients preconditioned by MueLu's smoothed aggregation, for systems too large to factorise. The
// near-null space is that of the rigid body modes at the positions that the analysis is given (Vanek, Mandel & Brezina
// 1996); nodes with held components are filled up with unit rows, so that every node has the same number of unknowns.
#include <BelosPseudoBlockCGSolMgr.hpp>
#include <BelosTpetraAdapter.hpp>
#include <MueLu_CreateTpetraPreconditioner.hpp>
#include <Teuchos_DefaultMpiComm.hpp>
#include <Tpetra_CrsMatrix.hpp>
#include <Tpetra_MultiVector.hpp>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "../common/full_matrix.hpp"
#include "itr/linear/iteration_options.hpp"
#include "trilinos.hpp"

namespace itr::backends {

namespace {

using Map = Tpetra::Map<>;
using Matrix = Tpetra::CrsMatrix<double>;
using Vectors = Tpetra::MultiVector<double>;
using Operator = Tpetra::Operator<double>;
using Teuchos::RCP;

/// Rows 0 .. order-1, all on this rank (MPI_COMM_SELF).
RCP<const Map> make_map(int order) {
  const auto self = Teuchos::rcp(new Teuchos::MpiComm<int>(MPI_COMM_SELF));
  return Teuchos::rcp(new Map(order, 0, self));
}

RCP<Matrix> make_matrix(const RCP<const Map>& map, const FullMatrix& full) {
  const auto entries = static_cast<Teuchos_Ordinal>(full.indices.size());
  Teuchos::ArrayRCP<size_t> starts(static_cast<Teuchos_Ordinal>(full.starts.size()));
  Teuchos::ArrayRCP<int> indices(entries);
  Teuchos::ArrayRCP<double> values(entries);
  std::copy(full.starts.begin(), full.starts.end(), starts.begin());
  std::copy(full.indices.begin(), full.indices.end(), indices.begin());
  std::copy(full.values.begin(), full.values.end(), values.begin());
  const auto matrix = Teuchos::rcp(new Matrix(map, map, starts, indices, values));
  matrix->fillComplete(map, map);
  return matrix;
}

void set_values(Matrix& matrix, const FullMatrix& full) {
  matrix.resumeFill();
  for (int i = 0; i < full.order; ++i) {
    const int first = full.starts[i], count = full.starts[i + 1] - first;
    matrix.replaceLocalValues(i, count, &full.values[first], &full.indices[first]);
  }
  matrix.fillComplete(matrix.getDomainMap(), matrix.getRangeMap());
}

RCP<Vectors> make_vectors(const RCP<const Map>& map, int columns) { return Teuchos::rcp(new Vectors(map, columns)); }

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

class Muelu {
 public:
  int set_option(std::string_view key, std::string_view value) { return options_.set(key, value) ? ITR_OK : ITR_FAILED; }

  int analyze(const itr_pattern& pattern, const itr_hints& hints) {
    preconditioner_ = Teuchos::null;
    coordinates_ = null_space_ = Teuchos::null;
    matrix_ = Teuchos::null;
    fill_up(pattern, hints);
    const itr_pattern padded{static_cast<int32_t>(starts_.size() - 1), starts_.data(), rows_.data()};
    full_.set_pattern(padded);
    map_ = make_map(full_.order);
    matrix_ = make_matrix(map_, full_);
    set_near_null_space(hints);
    return ITR_OK;
  }

  int factorize(const double* values, size_t count) {
    double diagonal = 0;
    for (const int p : diagonals_) {
      if (!(values[p] > 0)) return fail(ITR_NOT_POSITIVE_DEFINITE, "a diagonal entry is not positive");
      diagonal += values[p] / diagonals_.size();
    }
    lower_.assign(rows_.size(), diagonal);  // also of the unknowns that fill up nodes
    for (size_t k = 0; k < count; ++k) lower_[place_[k]] = values[k];
    full_.set_values(lower_.data(), lower_.size());
    set_values(*matrix_, full_);

    Teuchos::ParameterList list;
    list.set("verbosity", "none");
    list.set("number of equations", block_);
    list.set("max levels", 10);
    list.set("coarse: max size", 1000);
    list.set("smoother: type", "CHEBYSHEV");
    list.sublist("smoother: params").set("chebyshev: degree", 3);
    list.sublist("smoother: params").set("chebyshev: ratio eigenvalue", 20.0);
    // Ten power iterations, Ifpack2's default, fall short of the largest eigenvalue by more than its margin of 10 % where a
    // few contacts or twisted elements have it; beyond it the polynomial may be negative, and the preconditioner indefinite.
    list.sublist("smoother: params").set("chebyshev: eigenvalue max iterations", 50);
    auto& user = list.sublist("user data");
    user.set("Nullspace", null_space_);
    if (!coordinates_.is_null()) user.set("Coordinates", coordinates_);
    preconditioner_ = Teuchos::null;
    preconditioner_ = MueLu::CreateTpetraPreconditioner(RCP<Operator>(matrix_), list);
    return ITR_OK;
  }

  int solve(const double* rhs, double* solution, int columns) {
    iterations_ = 0;
    int outcome = ITR_OK;
    for (int c = 0; c < columns; ++c) {
      const auto offset = static_cast<size_t>(c) * dofs_.size();
      const int of_column = solve_one(rhs + offset, solution + offset);
      if (of_column != ITR_OK && outcome != ITR_NOT_POSITIVE_DEFINITE) outcome = of_column;
    }
    return outcome;
  }

  itr_statistics statistics() const {
    itr_statistics result{};
    result.iterations = iterations_;
    return result;
  }
  const char* message() const { return message_.c_str(); }

 private:
  /// Numbers the unknowns so that each node has block_ of them, one after another.
  void fill_up(const itr_pattern& pattern, const itr_hints& hints) {
    block_ = hints.dofs ? hints.block_size : 1;
    dofs_.resize(pattern.order);
    int nodes = 0;
    for (int i = 0, last = -1; i < pattern.order; ++i) {
      const int dof = hints.dofs ? hints.dofs[i] : i, node = dof / block_;
      nodes += node != last;
      last = node;
      dofs_[i] = (nodes - 1) * block_ + dof % block_;
    }
    std::vector<int> unknown(static_cast<size_t>(nodes) * block_, -1);
    for (int i = 0; i < pattern.order; ++i) unknown[dofs_[i]] = i;
    starts_.assign(1, 0);
    rows_.clear();
    place_.resize(pattern.column_starts[pattern.order]);
    diagonals_.clear();
    for (size_t j = 0; j < unknown.size(); ++j) {
      const int column = unknown[j];
      if (column < 0) {
        rows_.push_back(static_cast<int>(j));
      } else {
        diagonals_.push_back(pattern.column_starts[column]);
        for (int p = pattern.column_starts[column]; p < pattern.column_starts[column + 1]; ++p) {
          place_[p] = static_cast<int>(rows_.size());
          rows_.push_back(dofs_[pattern.row_indices[p]]);
        }
      }
      starts_.push_back(static_cast<int>(rows_.size()));
    }
  }

  /// Translations, and rotations about the mean position where positions are known.
  void set_near_null_space(const itr_hints& hints) {
    const bool has_positions = hints.coordinates && (block_ == 2 || block_ == 3);
    const int modes = !has_positions ? block_ : block_ == 2 ? 3 : 6;
    null_space_ = make_vectors(map_, modes);
    std::vector<Teuchos::ArrayRCP<double>> mode(modes);
    for (int m = 0; m < modes; ++m) mode[m] = null_space_->getDataNonConst(m);
    const auto order = static_cast<int>(dofs_.size());
    std::array<double, 3> center{};
    if (has_positions)
      for (int i = 0; i < order; ++i)
        for (int c = 0; c < block_; ++c) center[c] += hints.coordinates[static_cast<size_t>(i) * block_ + c] / order;
    for (int i = 0; i < order; ++i) {
      const int row = dofs_[i], component = row % block_;
      mode[component][row] = 1;
      if (!has_positions) continue;
      std::array<double, 3> r{};
      for (int c = 0; c < block_; ++c) r[c] = hints.coordinates[static_cast<size_t>(i) * block_ + c] - center[c];
      if (block_ == 2) {
        mode[2][row] = component == 0 ? -r[1] : r[0];
      } else {  // e_k x r
        for (int k = 0; k < 3; ++k) {
          const std::array<double, 3> axis{double(k == 0), double(k == 1), double(k == 2)};
          const int a = (component + 1) % 3, b = (component + 2) % 3;
          mode[3 + k][row] = axis[a] * r[b] - axis[b] * r[a];
        }
      }
    }
    if (!has_positions) return;
    const auto nodes = make_map(full_.order / block_);
    coordinates_ = make_vectors(nodes, block_);
    for (int c = 0; c < block_; ++c) {
      auto column = coordinates_->getDataNonConst(c);
      for (int i = 0; i < order; ++i) column[dofs_[i] / block_] = hints.coordinates[static_cast<size_t>(i) * block_ + c];
    }
  }

  int solve_one(const double* rhs, double* solution) {
    const auto b = make_vectors(map_, 1), x = make_vectors(map_, 1);
    {
      auto column = b->getDataNonConst(0);
      for (size_t i = 0; i < dofs_.size(); ++i) column[dofs_[i]] = rhs[i];
    }
    int outcome = iterate(b, x, preconditioner_);
    // Belos says the same of an indefinite matrix and of an indefinite preconditioner. Jacobi's cannot be that.
    if (outcome == ITR_NOT_POSITIVE_DEFINITE) {
      x->putScalar(0);
      outcome = iterate(b, x, Teuchos::rcp(new Jacobi(*matrix_)));
    }
    const auto column = x->getData(0);
    for (size_t i = 0; i < dofs_.size(); ++i) solution[i] = column[dofs_[i]];
    return outcome;
  }

  /// Conjugate gradients; ITR_NOT_POSITIVE_DEFINITE where the matrix or the preconditioner turns out not to be.
  int iterate(const RCP<Vectors>& b, const RCP<Vectors>& x, const RCP<Operator>& preconditioner) {
    const auto problem = Teuchos::rcp(new Belos::LinearProblem<double, Vectors, Operator>(matrix_, x, b));
    problem->setLeftPrec(preconditioner);
    problem->setHermitian();
    problem->setProblem();
    const auto list = Teuchos::parameterList();
    list->set("Convergence Tolerance", options_.tolerance);
    list->set("Maximum Iterations", options_.max_iterations);
    list->set("Implicit Residual Scaling", "Norm of RHS");
    list->set("Verbosity", 0);
    Belos::PseudoBlockCGSolMgr<double, Vectors, Operator> solver(problem, list);
    try {
      const bool converged = solver.solve() == Belos::Converged;
      iterations_ += solver.getNumIters();
      return converged ? ITR_OK : fail(ITR_NOT_CONVERGED, "the iterations did not converge");
    } catch (const Belos::StatusTestError& error) {
      return fail(ITR_NOT_CONVERGED, error.what());
    } catch (const Belos::CGIterateFailure& error) {
      return fail(ITR_NOT_POSITIVE_DEFINITE, error.what());
    }
  }

  int fail(int outcome, const char* why) {
    message_ = why;
    return outcome;
  }

  linear::IterationOptions options_{1e-10, 1000};
  FullMatrix full_;
  RCP<const Map> map_;
  RCP<Matrix> matrix_;
  RCP<Vectors> null_space_, coordinates_;
  RCP<Operator> preconditioner_;
  int block_ = 1;
  int iterations_ = 0;
  std::vector<int> dofs_;           ///< row of each unknown in the filled-up system
  std::vector<int> starts_, rows_;  ///< lower triangle of the filled-up system
  std::vector<int> place_;          ///< where each entry of the given triangle goes in it
  std::vector<int> diagonals_;      ///< of the given triangle
  std::vector<double> lower_;
  std::string message_;
};

}  // namespace

itr_engine muelu_row(const char* version) {
  return kokkos_row<Muelu>("belos:muelu", version, "BSD-3-Clause", ITR_ITERATIVE | ITR_TELLS_DEFINITENESS,
                           linear::IterationOptions::kNames);
}

}  // namespace itr::backends
