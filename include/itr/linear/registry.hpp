// SPDX-License-Identifier: MIT
// The table of linear solvers: built-in ones, loadable modules found on ITR_BACKEND_PATH, in the install tree and in the
// build tree, and factories that a program registers itself. Absent ones stay in the table with the reason.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "itr/linear/engine.hpp"

namespace itr::linear {

struct BackendInfo {
  std::string name;             ///< "cholmod:supernodal"
  std::string library_version;  ///< "CHOLMOD 3.0.14, OpenBLAS 0.3.21 for SkylakeX": what its kernels are made for
  std::string license;
  std::string options;  ///< that create() takes: "ordering=amd|metis tolerance=NUMBER"
  Capabilities capabilities;
  bool available = false;
  std::string reason;    ///< where absent: why, and the package to install
  std::string advice{};  ///< where it is slower than it need be: what to do about that
};

/// Throws InputError for options that the solver does not have (see apply_options).
using SolverFactory = std::function<std::unique_ptr<Solver>(const SolverOptions&)>;

using EngineFactory = std::function<std::unique_ptr<Engine>(const SolverOptions&)>;

/// An ordinary object: make one per program or per simulation. Loading a module twice is harmless (modules stay loaded).
class Registry {
 public:
  /// Knows the built-in solvers; searches for modules on first use of a name that is not built in, or on list().
  Registry();
  /// Searches in these folders instead.
  explicit Registry(std::vector<std::filesystem::path> folders);
  ~Registry();
  Registry(Registry&&) noexcept;
  Registry& operator=(Registry&&) noexcept;

  /// Adds or replaces a solver of the program's own.
  void add(BackendInfo info, SolverFactory factory);
  /// All rows, present and absent, sorted by name, built-in ones first.
  std::vector<BackendInfo> list();
  /// Our name for a name of ours or of PolyFEM's ("amesos2" -> "amesos2:klu2", "Eigen::SimplicialLDLT" ->
  /// "eigen:ldlt"); empty where there is no equal.
  static std::string canonical_name(const std::string& name);
  /// A new solver; "auto" picks at each analysis (choice.hpp). Throws InputError (lists present and absent ones) if there is
  /// none of that name or it does not load, for options that it does not have, and for MPI that it needs and that does not
  /// run.
  std::unique_ptr<Solver> create(const std::string& name, const SolverOptions& options = {});
  /// What stands behind that solver, without checks, residuals and refinement: to measure what they cost. Null for one that
  /// a program added. Throws as create().
  std::unique_ptr<Engine> create_engine(const std::string& name, const SolverOptions& options = {});
  /// The row of a name or alias, present or absent. Throws InputError if there is none.
  BackendInfo find(const std::string& name);

  /// Lets solvers that run on MPI, be it on one rank, initialise it where nobody has; it is finalised at exit. This is the
  /// program's word, never the library's: without it, and before the program's own MPI_Init, create() refuses them.
  void allow_mpi_start();
  /// Is that solver there, and does MPI run, or may it be started, where the solver needs it?
  bool is_ready(const std::string& name);

  /// On rank 0: solvers of that backend created from now on factorise over all ranks of `communicator`, a pointer to an
  /// MPI_Comm of a program that has initialised MPI, or null for all ranks of the launch (then the module initialises MPI
  /// where nobody has, and finalises what it initialised). Throws InputError if the backend does not use MPI.
  void connect(const std::string& name, const void* communicator = nullptr);
  /// On rank 0, after the last of those solvers is gone: lets the other ranks go on.
  void disconnect(const std::string& name);
  /// On every other rank: takes part in rank 0's factorisations until it disconnects.
  void serve(const std::string& name, const void* communicator = nullptr);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Hands options to an engine of the solver `name`. Throws InputError that lists `known` where it refuses one.
void apply_options(Engine& engine, const std::string& name, const std::string& known, const SolverOptions& options);

/// Relative residual that a solver reaches on a small elasticity-like test matrix; negative where it fails.
double self_test_residual(Solver& solver);

}  // namespace itr::linear
