// SPDX-License-Identifier: MIT
// One stored step: frames/NNNNNN.h5 (design §5).
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "hdf5.hpp"
#include "itr/simulation/frame.hpp"

namespace itr::output {

/// Writes the frame under a temporary name and renames it.
template <int Dim>
void write_frame(const std::filesystem::path& path, const FrameView<Dim>& frame, int step, double t);

/// What a certificate needs of a stored frame. Indices are checked: all within range.
struct StoredFrame {
  int dim = 0;
  std::vector<double> x;                     ///< n x dim, row-major [m]
  std::vector<std::int64_t> simplices;       ///< m x (dim + 1)
  std::vector<double> obstacle_x;            ///< k x dim
  std::vector<std::int64_t> obstacle_edges;  ///< e x 2
  std::vector<std::int64_t> obstacle_faces;  ///< f x 3
};

/// Throws InputError where the file is unreadable or inconsistent.
StoredFrame read_frame(const std::filesystem::path& path);

}  // namespace itr::output
