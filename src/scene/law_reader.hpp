// SPDX-License-Identifier: MIT
// Laws of `materials`: which there are, sums of laws, and stiffnesses of any anisotropy.
#pragma once

#include <string>
#include <vector>

#include "energy/elastic/law_table.hpp"
#include "function.hpp"
#include "node.hpp"

namespace itr::scene {

/// How the laws are called, and which keys beside type, id and rho they have.
struct LawName {
  std::string type;
  MaterialLaw law;
  std::vector<std::string> keys;
  const LawRow* row = nullptr;  ///< of a law that may be summed
};

/// Reads the law of an entry, one of the terms of a sum if it is `in_sum`. Throws InputError for keys of other laws.
const LawName& read_law(const Node& node, bool in_sum);

/// A scalar of a material and what it must be. It outlives the scene that it was read from.
struct Requirement {
  ScalarValue value;
  bool (*is_met)(double);
  InputError::Parts parts;  ///< file, pointer, the value's text, and what is expected
  double unit, length;      ///< of the value, of places, in SI units

  /// Throws InputError where the value at X is not finite or does not meet it.
  void check(const Vec<3>& X) const;
};

/// The value must meet `is_met`: at once if it is constant, else wherever it is used.
Requirement requirement_of(const Node& node, ScalarValue value, bool (*is_met)(double), const char* expected);

inline bool is_positive(double value) { return value > 0; }
inline bool is_poisson_ratio(double value) { return value > -1 && value < 0.5; }

/// The scene, where laws are those of space.
std::string in_space(const Node& node);

/// Reads laws of the table, alone or in a MaterialSum. `invariants`: their dimension where the sum is not in plane stress.
/// Adds what its directions must be.
LawSum read_sum_of_laws(const Node& node, const LawName& law, int dimension, int invariants,
                        std::vector<Requirement>& requirements);

/// The stiffness `elasticity_tensor` of a material in the notation of Voigt, in its own axes. In PolyFEM's set of defaults
/// shear moduli of the orthotropic form count twice.
MatrixX read_stiffness(const Node& material, int dimension, bool is_polyfem);

bool has_axes(const Node& material);
/// The axes of an anisotropic material, as columns of an orthogonal matrix.
MatrixX read_axes(const Node& material, int dimension);

}  // namespace itr::scene
