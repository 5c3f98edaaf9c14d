// SPDX-License-Identifier: MIT
// The units that a scene's numbers are in, and its results. Everything that computes is in SI units.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace itr {

/// SI units unless made by names. A unit is asked for by its SI name, such as "m/s^2", "N", "Pa", "kg/m^3" or "J s^2"; the
/// force, stress and energy of a system follow from length, mass and time. In 2D, numbers in SI units are for a thickness of
/// 1 m, and those of a scene for a thickness of its unit of length.
class Units {
 public:
  Units() = default;
  /// Names of length_names() and so on.
  Units(const std::string& length, const std::string& mass, const std::string& time);

  static std::vector<std::string> length_names();
  static std::vector<std::string> mass_names();
  static std::vector<std::string> time_names();
  /// Length of one of length_names() [m].
  static double length_in_metres(const std::string& name);

  int dim = 3;            ///< of the scene
  bool has_steps = true;  ///< false in statics, where t is 1 and "s" counts for nothing
  bool is_si() const { return is_si_; }
  const std::string& length() const { return length_.name; }
  const std::string& mass() const { return mass_.name; }
  const std::string& time() const { return time_.name; }

  /// Factor from the scene's unit of this kind to SI units; 1 for "" and "deg".
  double factor(std::string_view unit) const;
  double to_si(double value, std::string_view unit) const { return is_si_ ? value : value * factor(unit); }
  double from_si(double value, std::string_view unit) const { return is_si_ ? value : value / factor(unit); }
  /// The scene's unit of this kind: "MPa" for "Pa" in mm, t, s.
  std::string name(std::string_view unit) const;
  /// A value in SI units as a scene's user reads it, such as "3.2 mm".
  std::string text(double value, std::string_view unit, int digits = 4) const;

 private:
  struct Base {
    std::string name;
    double factor = 1;  ///< in SI units
  };
  Base length_{"m"}, mass_{"kg"}, time_{"s"};
  bool is_si_ = true;
};

}  // namespace itr
