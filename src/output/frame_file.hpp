// SPDX-License-Identifier: MIT
// One stored step: frames/NNNNNN.h5 (docs/theory.md, "Output").
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/hdf5.hpp"
#include "files.hpp"
#include "itr/core.hpp"
#include "itr/frame.hpp"
#include "output/distance.hpp"

namespace itr::output {

/// Adds what a frame holds beside the fields that every frame has.
using FrameExtra = std::function<void(hdf5::File&)>;

template <int Dim>
void write_frame(const std::filesystem::path& path, const FrameView<Dim>& frame, int step, double t,
                 Durability durability = Durability::process, const FrameExtra& extra = {}, const Units& units = {});

/// Writes frames one after another. While they are small and of one shape they are made in one file in memory: to make it
/// anew each time takes longer than a step.
class FrameFiles {
 public:
  FrameFiles() = default;
  ~FrameFiles();
  FrameFiles(const FrameFiles&) = delete;
  FrameFiles& operator=(const FrameFiles&) = delete;
  template <int Dim>
  void write(const std::filesystem::path& path, const FrameView<Dim>& frame, int step, double t, const Units& units);

 private:
  std::optional<hdf5::File> file_;
  std::vector<std::size_t> shape_;  ///< lengths of all that is in there
};

/// DIR/frames/NNNNNN.h5, by step.
std::vector<std::filesystem::path> stored_frames(const std::filesystem::path& directory);
int step_of_frame(const std::filesystem::path& path);

/// Mesh::steps_apart by vertex; only where faces coincide at rest.
constexpr const char* kStepsApart = "/mesh/steps_apart";
constexpr const char* kAxisymmetric = "/mesh/axisymmetric";  ///< there, and 1, in frames of axisymmetric scenes

/// Datasets of /fields that only a scene which asks for them has.
constexpr const char* kAskedFields[] = {"contact_force", "friction_force",   "reaction_force",       "von_mises",
                                        "stress",        "contact_pressure", "hydrostatic_pressure", "principal_stretches"};

/// Entry of an index for a frame.
struct FrameSizes {
  double t = 0;                          ///< [s]
  int dim = 0, vertices = 0, cells = 0;  ///< vertices: with the nodes of curved edges
  bool is_quadratic = false;             ///< some edges are curved
  int drawn_nodes = 0;                   ///< rows of /drawn/x, which is there where others are straight
  std::vector<std::string> asked;        ///< names of kAskedFields that it has
};
/// Rows of a frame's /drawn/x; 0: it has none.
template <int Dim>
int drawn_nodes(const FrameView<Dim>& frame);

FrameSizes read_frame_sizes(const std::filesystem::path& path);

FrameTotals read_frame_totals(const std::filesystem::path& path);

/// The sums of forces that a frame has, if any.
struct StoredForces {
  int step = 0;
  double t = 0;  ///< [s]
  std::vector<ForceCurvePoint> curves;
};
StoredForces read_frame_forces(const std::filesystem::path& path);

/// A surface of a stored frame.
struct StoredSurface {
  std::vector<double> x;            ///< k x dim, row-major [m]
  std::vector<std::int64_t> edges;  ///< e x 2
  std::vector<std::int64_t> faces;  ///< f x 3
};

/// Part of a stored frame that a certificate or a comparison needs. Indices are checked: all within range.
struct StoredFrame {
  int dim = 0;
  bool axisymmetric = false;
  Units units;                          ///< of all numbers here; below they are named as of SI units
  std::vector<double> rest;             ///< n x dim, row-major [m]: vertices, then nodes of curved edges
  std::vector<double> x;                ///< n x dim, row-major [m]
  std::vector<std::int64_t> simplices;  ///< m x (dim + 1)
  /// e x 2, ascending: the last e nodes are theirs, in this order; empty: all edges are straight.
  std::vector<std::int64_t> curved_edges;
  std::vector<std::int64_t> body;         ///< m, ids
  std::vector<std::int64_t> steps_apart;  ///< by vertex, 0: of closed faces; empty: there are none
  double dhat = 0;                        ///< of contact, where there are [m]
  std::vector<std::int64_t> surface;      ///< k x dim, facets of the boundary
  StoredSurface obstacles;
  bool has_proxy = false;
  StoredSurface proxy;  ///< what touches in place of the boundary
};

/// Units of the numbers in an open frame.
Units read_units(const std::filesystem::path& path, const hdf5::File& file);

/// Names of what is not as it was written. Throws InputError where the file is unreadable.
std::vector<std::string> find_damage(const std::filesystem::path& path);

/// Throws InputError where the file is unreadable, inconsistent, or what is read is not as it was written.
StoredFrame read_frame(const std::filesystem::path& path);

/// A dataset of /fields.
struct StoredField {
  std::string name, unit;
  int columns = 0;             ///< 0: a plain vector
  std::vector<double> values;  ///< row-major
};

/// Reads those of the fields v, elastic_density and kAskedFields that the frame has.
std::vector<StoredField> read_frame_fields(const std::filesystem::path& path);

}  // namespace itr::output
