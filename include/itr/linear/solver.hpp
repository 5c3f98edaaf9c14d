// SPDX-License-Identifier: MIT
// The interface of sparse direct and iterative solvers that Newton uses.
//
// A symmetric matrix of order n is stored as its lower triangle with the diagonal, by columns, rows ascending.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace itr::linear {

/// The positions of the entries of the lower triangle. column_starts has n + 1 entries; rows of column j are
/// row_indices[column_starts[j] .. column_starts[j+1]), ascending, the first one j itself.
struct SparsityPattern {
  int order = 0;
  std::vector<int> column_starts;
  std::vector<int> row_indices;
  std::size_t nonzeros() const { return row_indices.size(); }
  bool operator==(const SparsityPattern&) const = default;
};

enum class Outcome {
  ok,
  not_positive_definite,  ///< a Cholesky backend met a pivot that is not positive
  singular,               ///< no factorisation exists to working precision
  non_finite,             ///< a value or the result is NaN or infinite
  out_of_memory,
  not_converged,  ///< an iterative solver or the asked residual was not reached
  failed          ///< anything else; message() says what
};

const char* to_string(Outcome outcome);

struct Capabilities {
  bool indefinite = false;  ///< solves symmetric indefinite systems too
  bool iterative = false;
  bool threads = false;
  bool mpi = false;
  bool keeps_order = false;         ///< uses AnalyzeHints::may_keep_order
  bool tells_definiteness = false;  ///< reports indefinite matrices by the outcome or by Statistics::negative_pivots
};

/// Optional hints for an analysis.
struct AnalyzeHints {
  int block_size = 1;                        ///< unknowns of a free node, that is the dimension; 1: unknown
  std::span<const int> dofs = {};            ///< of each unknown: block_size * node + component, ascending
  std::span<const double> coordinates = {};  ///< block_size of each unknown: where its node is [m]
  /// Allows the fill-reducing order of an earlier analysis for a similar pattern. Without it the analysis depends on the
  /// pattern alone and can be repeated from a saved state.
  bool may_keep_order = false;
};

/// Costs of the last factorisation and solve, or those that the analysis predicts. Zero if the library does not report them.
struct Statistics {
  double factor_nonzeros = 0;
  double factor_bytes = 0;   ///< summed over MPI ranks
  double largest_bytes = 0;  ///< of any one rank
  double flops = 0;          ///< of the factorisation
  int iterations = 0;        ///< of the last solve
  int negative_pivots = 0;   ///< of the last factorisation L D L^T: the number of negative eigenvalues
};

/// Options of a backend by name, as `itr solvers` lists them: {"ordering", "metis"}.
using SolverOptions = std::map<std::string, std::string>;

struct SolveReport {
  Outcome outcome = Outcome::ok;
  double relative_residual = 0;  ///< max over right-hand sides of |b - A x| / |b| (Euclidean), as achieved
};

/// A solver of one matrix at a time. Not thread-safe; different objects are independent.
class Solver {
 public:
  virtual ~Solver() = default;
  virtual std::string_view name() const = 0;  ///< "eigen:ldlt"
  /// The solver in charge now: the pick of `auto`, or a fallback that took over.
  virtual std::string_view name_in_use() const { return name(); }
  virtual Capabilities capabilities() const = 0;
  /// Analyses a pattern. A direct solver does nothing if it analysed the same pattern last. Solvers that need the pattern
  /// later copy it.
  virtual Outcome analyze(const SparsityPattern& pattern, const AnalyzeHints& hints) = 0;
  /// Factorises the matrix with `values` in the order of the analysed pattern.
  virtual Outcome factorize(std::span<const double> values) = 0;
  /// Solves A X = B for `columns` right-hand sides, stored one after another, n numbers each. Refines until the relative
  /// residual is at most `asked_residual` or no longer falls. The report has the residual that was reached, which is not
  /// computed if infinity is asked.
  virtual SolveReport solve(std::span<const double> B, std::span<double> X, int columns, double asked_residual) = 0;
  virtual Statistics statistics() const = 0;
  virtual std::string message() const = 0;  ///< details of the last outcome that was not ok
};

}  // namespace itr::linear
