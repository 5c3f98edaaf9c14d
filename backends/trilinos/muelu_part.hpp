// SPDX-License-Identifier: MIT
// A rank's part of a system that MueLu solves: rows of the nodes that are its own. Calls are collective over the ranks.
#pragma once

#include <mpi.h>

#include <memory>
#include <string>
#include <vector>

#include "itr/module.h"

namespace itr::backends {

/// The whole system, nodes with `block` rows each one after another: filled on rank 0, empty on the others.
struct MueluSystem {
  int block = 1;
  std::vector<int> starts, columns;                     ///< by row, both triangles
  std::vector<std::vector<double>> modes, coordinates;  ///< near-null space by row; positions by node, or none [m]
};

class MueluPart {
 public:
  explicit MueluPart(MPI_Comm communicator);
  ~MueluPart();
  MueluPart(const MueluPart&) = delete;
  MueluPart& operator=(const MueluPart&) = delete;

  void analyze(const MueluSystem& system);
  /// Values of all entries on rank 0.
  void factorize(const std::vector<double>& values);
  /// An outcome of itr_engine::solve; right-hand side and solution by row on rank 0.
  int solve(const std::vector<double>& b, std::vector<double>& x, const linear::IterationOptions& options);
  int iterations() const;              ///< of the last solve
  const std::string& message() const;  ///< why it failed

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace itr::backends
