// SPDX-License-Identifier: MIT
// Frames as VTK's unstructured grids, for programs that read neither HDF5 nor XDMF.
#pragma once

#include <filesystem>
#include <string>

#include "itr/core.hpp"
#include "itr/frame.hpp"

namespace itr::output {

/// Relative to the run's folder.
std::string vtu_name(int step);

/// Writes DIR/vtu/NNNNNN.vtu: bodies at their present positions, with all fields of the frame. Vectors and tensors are of
/// space, with zeros out of the plane.
template <int Dim>
void write_vtu(const std::filesystem::path& directory, const FrameView<Dim>& frame, int step, const Units& units);

/// The parts of sim.pvd, the series of these files with their times.
extern const std::string kVtuSeriesHead, kVtuSeriesTail;
/// `t` in the units of the run.
std::string vtu_series_entry(int step, double t);

}  // namespace itr::output
