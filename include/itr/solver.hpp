// SPDX-License-Identifier: MIT
// Linear solvers: the interface that Newton uses, the one that a program implements to bring its own, and the table of those
// that there are.
//
// A symmetric matrix of order n is stored as its lower triangle with the diagonal, by columns, rows ascending.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "itr/core.hpp"

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

ITR_EXPORT const char* to_string(Outcome outcome);

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
class ITR_EXPORT Solver {
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

// The interface that a program implements to bring its own solver: factorise and solve. make_checked_solver adds the checks
// of input, trivial orders, residuals and refinement.

class ITR_EXPORT Engine {
 public:
  virtual ~Engine() = default;
  /// Sets an option. Returns false if the engine has no such option or refuses the value.
  virtual bool set_option(const std::string& key, const std::string& value) = 0;
  virtual Outcome analyze(const SparsityPattern& pattern, const AnalyzeHints& hints) = 0;
  virtual Outcome factorize(std::span<const double> values) = 0;
  /// B and X hold columns of length n one after another and do not overlap.
  virtual Outcome solve(std::span<const double> B, std::span<double> X, int columns) = 0;
  virtual Statistics statistics() const = 0;
  virtual std::string message() const = 0;  ///< of the last outcome that was not ok; may be empty
};

/// Makes the checked Solver over an engine.
ITR_EXPORT std::unique_ptr<Solver> make_checked_solver(std::string name, Capabilities capabilities,
                                                       std::unique_ptr<Engine> engine);

// The table of linear solvers: built-in ones, loadable modules found on ITR_BACKEND_PATH, in the install tree and in the
// build tree, and factories that a program registers itself. Absent ones stay in the table with the reason.

struct BackendInfo {
  std::string name;             ///< "cholmod:supernodal"
  std::string library_version;  ///< with the CPU that its kernels are for: "CHOLMOD 3.0.14, OpenBLAS 0.3.21 for SkylakeX"
  std::string license;
  std::string options;  ///< options of create(): "ordering=amd|metis tolerance=NUMBER"
  Capabilities capabilities;
  bool available = false;
  std::string reason;    ///< if absent: the reason and the package to install
  std::string advice{};  ///< if it is slower than it could be: the remedy
};

/// Throws InputError for options that the solver does not have (see apply_options).
using SolverFactory = std::function<std::unique_ptr<Solver>(const SolverOptions&)>;

using EngineFactory = std::function<std::unique_ptr<Engine>(const SolverOptions&)>;

/// A table of solvers, one per program or per simulation. Loading a module twice is harmless; modules stay loaded.
class ITR_EXPORT Registry {
 public:
  /// A table of the built-in solvers. Modules are searched for on first use of another name, and by list().
  Registry();
  /// Searches for modules in these folders only.
  explicit Registry(std::vector<std::filesystem::path> folders);
  ~Registry();
  Registry(Registry&&) noexcept;
  Registry& operator=(Registry&&) noexcept;

  /// Adds or replaces a solver of the program.
  void add(BackendInfo info, SolverFactory factory);
  /// All rows, present and absent, sorted by name, built-in ones first.
  std::vector<BackendInfo> list();
  /// The name in this table for a name or alias of ITR or PolyFEM: "amesos2" -> "amesos2:klu2", "Eigen::SimplicialLDLT" ->
  /// "eigen:ldlt". Empty if there is no equal.
  static std::string canonical_name(const std::string& name);
  /// Makes a solver; "auto" picks one at each analysis. Throws InputError, with lists of present and absent
  /// solvers, if the name is unknown, the module does not load, an option does not exist, or MPI is needed and does not run.
  std::unique_ptr<Solver> create(const std::string& name, const SolverOptions& options = {});
  /// Makes the bare engine of a solver, without checks, residuals and refinement, to measure their cost. Null for a solver
  /// that a program added. Throws as create().
  std::unique_ptr<Engine> create_engine(const std::string& name, const SolverOptions& options = {});
  /// The row of a name or alias, present or absent. Throws InputError if there is none.
  BackendInfo find(const std::string& name);

  /// Allows solvers on MPI to initialise it if nobody has; it is finalised at exit. Only a program calls this. Without it,
  /// and before the program's own MPI_Init, create() refuses such solvers.
  void allow_mpi_start();
  /// Whether the solver is present and, if it needs MPI, MPI runs or may be started.
  bool is_ready(const std::string& name);

  /// On rank 0: solvers of that backend created from now on factorise over all ranks of `communicator`, a pointer to the
  /// MPI_Comm of a program that has initialised MPI. Null means all ranks of the launch; the module then initialises and
  /// finalises MPI if nobody else does. Throws InputError if the backend does not use MPI.
  void connect(const std::string& name, const void* communicator = nullptr);
  /// On rank 0, after the last of those solvers is destroyed: releases the other ranks.
  void disconnect(const std::string& name);
  /// On every other rank: takes part in rank 0's factorisations until it disconnects.
  void serve(const std::string& name, const void* communicator = nullptr);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Sets options of an engine of the solver `name`. Throws InputError that lists `known` if the engine refuses one.
ITR_EXPORT void apply_options(Engine& engine, const std::string& name, const std::string& known,
                              const SolverOptions& options);

/// Returns the relative residual that a solver reaches on a small elasticity-like matrix, negative if it fails.
ITR_EXPORT double self_test_residual(Solver& solver);

}  // namespace itr::linear
