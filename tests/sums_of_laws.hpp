// SPDX-License-Identifier: MIT
// Examples of all laws of the table, for tests that all laws have to pass.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "energy/elastic/law_table.hpp"

namespace itr {

/// Coefficients by type, as the row lists them.
inline const std::map<std::string, LawValues>& examples_of_laws() {
  static const std::map<std::string, LawValues> examples = {
      {"Yeoh", {{20, 3, 0.4}, {200}}},
      {"Ogden", {{30, 2, -5}, {1.3, 5, -2}, {200}}},
      {"ArrudaBoyce", {{35}, {2.5}, {200}}},
      {"IsochoricMooneyRivlin", {{12}, {5}, {200}}},
      {"Hyperfoam", {{20, 15}, {3, -2}, {0.1, 0.35}}},
      {"Hencky", {{140}, {35}}},
      {"NeoHookean", {{140}, {35}}},
      {"UnconstrainedOgden", {{15, 20}, {2.5, -3}, {0.01, 0.02}}},
      {"IncompressibleOgden", {{30, 40}, {2.5, -3}, {200}}},
      {"IsochoricNeoHookean", {{0}, {35}}},
      {"VolumePenalty", {{150}}},
      {"InversionBarrier", {{140}, {35}, {0.9}}},
      {"AMIPS", {{17}}},
      {"HGOFiber", {{30}, {0.7}, {0.1}}},
      {"ActiveFiber", {{12}, {0.5}}},
  };
  return examples;
}

/// One law, with others that give a sum shear and bulk stiffness where it has none itself. Fibres are along (1, 2, 2) / 3.
inline LawSum sum_of(const LawRow& row, int dimension, bool is_plane_stress) {
  LawSum sum;
  sum.dimension = dimension;
  sum.is_plane_stress = is_plane_stress;
  const auto add = [&](const std::string& type) {
    for (const LawRow& other : law_rows())
      if (other.type == type) {
        sum.terms.push_back({&other, examples_of_laws().at(type)});
        if (other.fibre) sum.terms.back().direction = [](const Vec<3>&) { return Vec<3>(Vec<3>(1, 2, 2) / 3); };
      }
  };
  const std::string type = row.type;
  const bool is_added = row.fibre || type == "InversionBarrier";
  if (type == "VolumePenalty" || is_added) add("IsochoricNeoHookean");
  if (type == "IsochoricNeoHookean" || type == "AMIPS" || is_added) add("VolumePenalty");
  add(type);
  return sum;
}

/// All laws of the table but for fibres; in 2D in plane strain, in plane stress, and with PolyFEM's invariants.
template <int Dim>
std::vector<LawSum> sums_of_all_laws() {
  std::vector<LawSum> sums;
  for (const LawRow& row : law_rows()) {
    if (row.fibre) continue;
    sums.push_back(sum_of(row, 3, false));
    if (Dim == 3) continue;
    sums.push_back(sum_of(row, 3, true));
    sums.push_back(sum_of(row, 2, false));
  }
  return sums;
}

inline std::string name_of(const Material& material) {
  if (!sum_of(material)) return std::to_string(static_cast<int>(material.law));
  return sum_of(material)->name() + ", " + std::to_string(sum_of(material)->dimension) + " stretches" +
         (sum_of(material)->is_plane_stress ? ", plane stress" : "");
}

}  // namespace itr
