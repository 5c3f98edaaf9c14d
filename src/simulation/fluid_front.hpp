// SPDX-License-Identifier: MIT
// Fluids that penetrate between surfaces. Tags of facets say where they are, so that pressure, edits and saved states know
// it.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "itr/frame.hpp"
#include "itr/setup.hpp"

namespace itr {

/// Tags of the facets of a mesh, and those that they get as fluids come and go.
template <int Dim>
std::set<int> known_tags(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh);

/// The tag that facets with `tag` have where there is no fluid.
int tag_without_fluid(const std::vector<Fluid>& fluids, int tag);

/// Wets the facets where fluids are from the start.
template <int Dim>
void wet_sources(const StepSetup<Dim>& setup, Mesh<Dim>& mesh);

/// Throws InputError for fluids that nothing can shut out, that cannot come in, or that cannot leak to where they may.
template <int Dim>
void refuse_idle_fluids(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh);

/// Finds where fluids are at the end of a step, in rounds of solves.
template <int Dim>
class FluidFront {
 public:
  /// `setup` must outlive this; t is the time at the end of the step [s].
  FluidFront(const StepSetup<Dim>& setup, double t)
      : setup_(setup), t_(t), rounds_left_(setup.fluids.size(), kDryingRounds) {}
  /// Moves fluids to where the contact `force` on the nodes of `mesh` at x [N] lets them be. Returns whether one has moved,
  /// so that a solve has to follow. Each fluid leaves facets in its first rounds, then it only gains them: rounds come to an
  /// end.
  bool move(Mesh<Dim>& mesh, ConstVectorView x, ConstVectorView force);

 private:
  static constexpr int kDryingRounds = 8;

  const StepSetup<Dim>& setup_;
  double t_;
  std::vector<int> rounds_left_;  ///< by fluid: in which it may leave facets
};

/// Reports where fluids are on `mesh` after a step to t that began on `before`. Returns warnings of those that begin to
/// leak.
template <int Dim>
std::vector<std::string> report_fluids(const StepSetup<Dim>& setup, const Mesh<Dim>& before, const Mesh<Dim>& mesh, double t,
                                       StepReport& report);

}  // namespace itr
