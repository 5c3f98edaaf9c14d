// SPDX-License-Identifier: MIT
// From what a scene asks for to a solver: the first one that is there, one that picks by itself, one with others behind it.
#pragma once

#include <functional>
#include <memory>

#include "itr/core.hpp"
#include "itr/options.hpp"
#include "itr/solver.hpp"

namespace itr::linear {

/// Properties of a matrix that decide between solvers.
struct MatrixTraits {
  int order = 0;
  std::size_t nonzeros = 0;  ///< of the lower triangle
  int block_size = 1;        ///< 2: a 2D mesh, 3: a 3D mesh, 1: unknown
  bool may_be_indefinite = false;
  double memory_bytes = 0;  ///< that factors may take; 0: half of this machine's
  double factor_bytes = 0;  ///< that they take, from an analysis; 0: as estimate_factor_bytes says
};

struct Pick {
  std::string name;
  std::string reason;  ///< "3D and large: supernodal factorisation"
};

/// Solver that `auto` takes among those that are there; asks `is_there` about candidates only. Depends on its arguments
/// alone, but for `memory_bytes` = 0.
Pick pick_solver(const MatrixTraits& traits, const std::function<bool(const char* name)>& is_there);
/// Among those of the registry that are ready: those that would be refused because MPI does not run count as absent.
Pick pick_solver(const MatrixTraits& traits, Registry& registry);

/// Bytes that the factors of such a matrix take with a nested-dissection ordering, fitted to verification/scaling.
double estimate_factor_bytes(const MatrixTraits& traits);

/// Picks at each analysis, and tells the logger when the pick changes. Where factors are estimated not to fit, CHOLMOD's
/// analysis has the last word, once a time step: the estimate is that of a cube. `options` by canonical name. A pick that
/// cannot be created is an analysis that failed. `registry` must outlive it.
std::unique_ptr<Solver> make_auto_solver(Registry& registry, bool may_be_indefinite, Logger logger,
                                         std::map<std::string, SolverOptions> options = {});

/// The solver that stands first: a name of ours or "auto". Throws InputError for unknown names (present or absent is told)
/// and where none of `solvers` is there. Other programs' names that we have no equal of ("Eigen::PardisoLDLT") are passed
/// over.
std::string choose_name(const LinearOptions& options, Registry& registry);

/// `solver`, with eigen:ldlt for matrices that it refuses as not positive definite; itself where it refuses none.
std::unique_ptr<Solver> with_indefinite(std::unique_ptr<Solver> solver, Registry& registry);

/// The solver that `options` ask for, with its fallbacks behind it; one that solves indefinite systems too where they
/// `may_be_indefinite`. Throws InputError as choose_name, and for options that
/// a solver which may run does not have. `registry` must outlive the solver.
std::unique_ptr<Solver> choose_solver(const LinearOptions& options, bool may_be_indefinite, Registry& registry,
                                      const Logger& logger);

}  // namespace itr::linear
