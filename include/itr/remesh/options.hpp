// SPDX-License-Identifier: MIT
// Options of in-timestep remeshing, with the paper's defaults (docs/theory.md).
#pragma once

#include <optional>

namespace itr {

/// Which edges are tried, and how an operation is decided.
enum class Screening {
  energy_percentile,  ///< the paper's culling: splits at the top by energy, collapses at the bottom; patches decide
  bounds              ///< asks every edge; the gain of the new vertex alone decides, or else a patch
};

// Whatever is left open (std::nullopt) Setup::choose_defaults fills in, and nothing else does: `remesh` needs it filled in.

struct SplitOptions {
  bool enabled = true;
  std::optional<double> acceptance_tolerance;  ///< least energy decrease [J]
  double culling_threshold = 0.95;
  int max_depth = 3;                      ///< generations of one edge a step
  std::optional<double> min_edge_length;  ///< shorter rest edges are not split [m]
};

struct CurveOptions {
  bool enabled = false;
  std::optional<double> acceptance_tolerance;  ///< least energy decrease [J]; none: that of splits
  /// Curves edges in statics where straight ones keep up what would buckle, whether or not `enabled`.
  bool for_stability = true;
};

struct StraightenOptions {
  bool enabled = false;
  std::optional<double> acceptance_tolerance;  ///< [J]; negative: allowed increase; none: that of collapses
};

struct CollapseOptions {
  bool enabled = true;
  std::optional<double> acceptance_tolerance;  ///< least energy decrease [J]; negative: allowed increase
  double culling_threshold = 0.01;
  double rel_max_edge_length = 1;  ///< longest edge collapsed, in shortest edges of the initial mesh
};

struct SwapOptions {
  bool enabled = false;
  std::optional<double> acceptance_tolerance;  ///< [J], of swaps that better the shape
};

struct SmoothOptions {
  bool enabled = false;
  std::optional<double> acceptance_tolerance;  ///< [J], of moves that better the shape
};

struct LocalRelaxationOptions {
  int rings = 2;                   ///< rings of cells around the operation
  int max_cells = 100;             ///< no further ring where there are so many
  int max_iterations = 1;          ///< Newton iterations before the decision
  int max_contact_iterations = 4;  ///< the same where the patch touches contact
};

/// The baseline of docs/theory.md, "The sizing field": lengths of edges decide instead of energies.
struct SizingFieldOptions {
  bool enabled = false;
  /// Shorter rest edges are not split, in longest sides of the bodies' box. In contact nothing else ends the splitting.
  double rel_min_edge_length = 0.01;
};

struct RemeshOptions {
  bool enabled = false;
  SizingFieldOptions sizing_field;
  SplitOptions split;
  CurveOptions curve;
  StraightenOptions straighten;
  CollapseOptions collapse;
  SwapOptions swap;
  SmoothOptions smooth;
  LocalRelaxationOptions local;
  double relative_tolerance = 1e-4;  ///< fraction of the scene's energy that choose_defaults takes as tolerance of splits
  Screening screening = Screening::bounds;

  /// Tolerances of curves and of straightenings [J], filled in.
  double curve_tolerance() const { return curve.acceptance_tolerance.value_or(split.acceptance_tolerance.value()); }
  double straighten_tolerance() const {
    return straighten.acceptance_tolerance.value_or(collapse.acceptance_tolerance.value());
  }
};

}  // namespace itr
