// SPDX-License-Identifier: MIT
// The table of linear solvers: built-in ones, loadable modules found on ITR_BACKEND_PATH, in the install tree and in the
// build tree, and factories that a program registers itself. Absent ones stay in the table with the reason.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "itr/linear/solver.hpp"

namespace itr::linear {

struct BackendInfo {
  std::string name;             ///< "cholmod:supernodal"
  std::string library_version;  ///< "CHOLMOD 3.0.14, OpenBLAS 0.3.21"
  std::string license;
  Capabilities capabilities;
  bool available = false;
  std::string reason;  ///< where absent: why, and the package to install
};

using SolverFactory = std::function<std::unique_ptr<Solver>()>;

/// An ordinary object: make one per program or per simulation. Loading a module twice is harmless (modules stay loaded).
class Registry {
 public:
  /// Knows the built-in solvers; searches for modules on first use of a name that is not built in, or on list().
  Registry();
  ~Registry();
  Registry(Registry&&) noexcept;
  Registry& operator=(Registry&&) noexcept;

  /// Adds or replaces a solver of the program's own.
  void add(BackendInfo info, SolverFactory factory);
  /// All rows, present and absent, sorted by name, built-in ones first.
  std::vector<BackendInfo> list();
  /// Our name for a name of ours or of PolyFEM's ("cholmod" -> "cholmod:supernodal", "Eigen::SimplicialLDLT" ->
  /// "eigen:ldlt"); empty where there is no equal.
  static std::string canonical_name(const std::string& name);
  /// A new solver. Throws InputError (lists present and absent ones) if there is none of that name or it does not load.
  std::unique_ptr<Solver> create(const std::string& name);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Relative residual that a solver reaches on a small elasticity-like test matrix; negative where it fails.
double self_test_residual(Solver& solver);

}  // namespace itr::linear
