// SPDX-License-Identifier: MIT
// How far curved edges and faces may leave the chords that contact acts on: by a quarter of dhat where they are in contact,
// and by half of the gap, so that no point of a curve is inside of what its chords are apart from.
#pragma once

#include <span>

#include "fem/chord_levels.hpp"
#include "itr/setup.hpp"

namespace itr {

struct ChordDemand {
  ChordLevels levels;  ///< with those halvings that the bound asks for, and that dhat leaves room for
  double excess = 0;   ///< largest ratio of how far a curve leaves its chords to how far it may: the bound holds up to 1
};

/// Finds the levels that curves at positions x of `age` steps ago ask for, from chords of these levels on. No chord is made
/// longer.
template <int Dim>
ChordDemand find_chord_demand(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& levels,
                              const VectorX& x, int age = 0);

/// Whether curves at positions x, whose excess may be more than 1, are proven to be apart from what they may reach.
template <int Dim>
bool are_curves_apart(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& levels, const VectorX& x);

/// Adds as many halvings to `levels` as curves at all of these positions, newest first, ask for.
template <int Dim>
ChordLevels settled_chords(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, ChordLevels levels,
                           std::span<const VectorX> positions);

/// Takes one halving from `levels` where curves stay far within the bound at all of these positions, newest first, and
/// surfaces do not meet.
template <int Dim>
ChordLevels lowered_chords(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& levels,
                           std::span<const VectorX> positions);

}  // namespace itr
