// SPDX-License-Identifier: MIT
// Systems on disk, to study solvers with: one folder a system, NumPy files that any tool reads.
//   starts.npy, rows.npy (int32) and values.npy: lower triangle with the diagonal, by columns (scipy's csc_matrix)
//   rhs.npy; dofs.npy, coordinates.npy and block_size.npy: the hints of the analysis (solver.hpp)
#pragma once

#include <filesystem>
#include <memory>

#include "itr/solver.hpp"

namespace itr::linear {

struct DumpedSystem {
  SparsityPattern pattern;
  std::vector<double> values, rhs;
  int block_size = 1;
  std::vector<int> dofs;
  std::vector<double> coordinates;
  AnalyzeHints hints() const { return {.block_size = block_size, .dofs = dofs, .coordinates = coordinates}; }
};

/// Both throw InputError for what cannot be written or read.
void write_system(const std::filesystem::path& folder, const DumpedSystem& system);
DumpedSystem read_system(const std::filesystem::path& folder);

/// Solves with `solver`, and writes every `every`-th system that it is given to a folder "000042" of its own in `folder`. It
/// calls itself iterative, so that no factor serves another system and each system is given.
std::unique_ptr<Solver> make_dumping_solver(std::unique_ptr<Solver> solver, std::filesystem::path folder, int every);

}  // namespace itr::linear
