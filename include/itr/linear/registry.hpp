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
class Registry {
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
  /// Makes a solver; "auto" picks one at each analysis (choice.hpp). Throws InputError, with lists of present and absent
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
void apply_options(Engine& engine, const std::string& name, const std::string& known, const SolverOptions& options);

/// Returns the relative residual that a solver reaches on a small elasticity-like matrix, negative if it fails.
double self_test_residual(Solver& solver);

}  // namespace itr::linear
