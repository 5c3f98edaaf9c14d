// SPDX-License-Identifier: MIT
// Frames as VTK's unstructured grids, for programs that read neither HDF5 nor XDMF.
#pragma once

#include <filesystem>
#include <string>

#include "itr/core/units.hpp"
#include "itr/simulation/frame.hpp"

namespace itr::output {

/// Relative to the run's folder.
std::string vtu_name(int step);

/// Writes DIR/vtu/NNNNNN.vtu: bodies at their present positions, with all fields of the frame. Vectors and tensors are of
/// space, with zeros out of the plane.
template <int Dim>
void write_vtu(const std::filesystem::path& directory, const FrameView<Dim>& frame, int step, const Units& units);

/// Writes DIR/sim.pvd: the files of DIR/vtu with the times of DIR/frames.
void write_vtu_series(const std::filesystem::path& directory);

}  // namespace itr::output
