// SPDX-License-Identifier: MIT
// Systems on disk, to study solvers with: one folder a system, NumPy files that any tool reads.
//   starts.npy, rows.npy (int32) and values.npy: lower triangle with the diagonal, by columns (scipy's csc_matrix)
//   rhs.npy; dofs.npy, coordinates.npy and block_size.npy: the hints of the analysis (solver.hpp)
#pragma once

#include <filesystem>
#include <memory>

#include "itr/linear/solver.hpp"

namespace itr::linear {

struct DumpedSystem {
  SparsityPattern pattern;
  std::vector<double> values, rhs;
  int block_size = 1;
  std::vector<int> dofs;
  std::vector<double> coordinates;
  AnalyzeHints hints() const { return {.block_size = block_size, .dofs = dofs, .coordinates = coordinates}; }
};

/// Columns one after another, each with its diagonal first and ascending rows below it: what was read from a file may be
/// anything.
bool is_lower_triangle(const SparsityPattern& pattern);

/// Both throw InputError for what cannot be written or read.
void write_system(const std::filesystem::path& folder, const DumpedSystem& system);
DumpedSystem read_system(const std::filesystem::path& folder);

/// Solves with `solver`, and writes every `every`-th system that it is given to a folder "000042" of its own in `folder`.
std::unique_ptr<Solver> make_dumping_solver(std::unique_ptr<Solver> solver, std::filesystem::path folder, int every);

}  // namespace itr::linear
