// SPDX-License-Identifier: MIT
#include "itr/core.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "core/check.hpp"

namespace itr {

namespace {

using Named = std::pair<const char*, double>;
constexpr Named kLengths[] = {{"nm", 1e-9}, {"um", 1e-6}, {"mm", 1e-3},   {"cm", 1e-2},  {"dm", 0.1},
                              {"m", 1},     {"km", 1e3},  {"in", 0.0254}, {"ft", 0.3048}};
constexpr Named kMasses[] = {{"ug", 1e-9}, {"mg", 1e-6}, {"g", 1e-3}, {"kg", 1}, {"t", 1e3}, {"lb", 0.45359237}};
constexpr Named kTimes[] = {{"ns", 1e-9}, {"us", 1e-6}, {"ms", 1e-3}, {"s", 1}, {"min", 60}, {"h", 3600}};

std::vector<std::string> names_of(std::span<const Named> list) {
  std::vector<std::string> names;
  for (const auto& [name, factor] : list) names.emplace_back(name);
  return names;
}

double factor_of(std::span<const Named> list, const std::string& name) {
  const auto found = std::find_if(list.begin(), list.end(), [&](const Named& n) { return name == n.first; });
  ITR_CHECK(found != list.end(), name);
  return found->second;
}

/// Exponents of length, mass and time.
struct Exponents {
  int length = 0, mass = 0, time = 0;
};

constexpr std::pair<std::string_view, Exponents> kDerived[] = {{"N", {1, 1, -2}}, {"J", {2, 1, -2}}, {"Pa", {-1, 1, -2}}};

/// A factor of a unit, such as "s^2" after a "/".
struct Part {
  std::string_view name;
  int exponent = 1;
  bool is_divisor = false;
};

std::vector<Part> parts_of(std::string_view unit) {
  std::vector<Part> parts;
  bool is_divisor = false;
  while (!unit.empty()) {
    const std::size_t end = std::min(unit.find_first_of(" /"), unit.size());
    Part part{unit.substr(0, end), 1, is_divisor};
    if (const std::size_t power = part.name.find('^'); power != std::string_view::npos) {
      part.exponent = part.name[power + 1] - '0';
      part.name = part.name.substr(0, power);
    }
    if (part.name != "1") parts.push_back(part);
    is_divisor = end < unit.size() && unit[end] == '/';
    unit.remove_prefix(std::min(end + 1, unit.size()));
  }
  return parts;
}

double power(double base, int exponent) {
  double result = 1;
  for (int i = 0; i < std::abs(exponent); ++i) result *= base;
  return exponent < 0 ? 1 / result : result;
}

/// A factor that a prefix says; null: none does.
const char* prefix_of(double factor) {
  constexpr std::pair<double, const char*> kPrefixes[] = {{1e-12, "p"}, {1e-9, "n"}, {1e-6, "u"}, {1e-3, "m"}, {1, ""},
                                                          {1e3, "k"},   {1e6, "M"},  {1e9, "G"},  {1e12, "T"}};
  constexpr double kRounding = 1e-9;
  for (const auto& [value, prefix] : kPrefixes)
    if (std::abs(factor - value) <= kRounding * value) return prefix;
  return nullptr;
}

std::string with_exponent(const std::string& name, int exponent) {
  return exponent == 1 ? name : name + "^" + std::to_string(exponent);
}

}  // namespace

Units::Units(const std::string& length, const std::string& mass, const std::string& time)
    : length_{length, factor_of(kLengths, length)},
      mass_{mass, factor_of(kMasses, mass)},
      time_{time, factor_of(kTimes, time)},
      is_si_(length == "m" && mass == "kg" && time == "s") {}

std::vector<std::string> Units::length_names() { return names_of(kLengths); }
std::vector<std::string> Units::mass_names() { return names_of(kMasses); }
std::vector<std::string> Units::time_names() { return names_of(kTimes); }
double Units::length_in_metres(const std::string& name) { return factor_of(kLengths, name); }

double Units::factor(std::string_view unit) const {
  // An acceleration is a force by mass: its seconds are not those of steps.
  const bool counts_seconds = has_steps || unit == "m/s^2";
  Exponents sum;
  for (const Part& part : parts_of(unit)) {
    const int exponent = part.is_divisor ? -part.exponent : part.exponent;
    if (part.name == "m") {
      sum.length += exponent;
    } else if (part.name == "kg") {
      sum.mass += exponent;
    } else if (part.name == "s") {
      if (counts_seconds) sum.time += exponent;
    } else if (part.name != "deg") {
      const auto found =
          std::find_if(std::begin(kDerived), std::end(kDerived), [&](auto& d) { return d.first == part.name; });
      ITR_CHECK(found != std::end(kDerived), std::string(unit));
      sum.length += exponent * found->second.length;
      sum.mass += exponent * found->second.mass;
      sum.time += exponent * found->second.time;
    }
  }
  // Forces, energies and masses of a body, other than what is by volume or area of space, are by thickness in 2D.
  if (dim == 2 && sum.mass == 1 && sum.length >= 0) --sum.length;
  return power(length_.factor, sum.length) * power(mass_.factor, sum.mass) * power(time_.factor, sum.time);
}

std::string Units::name(std::string_view unit) const {
  if (is_si_) return std::string(unit);
  const auto name_of = [&](std::string_view part) -> std::string {
    if (part == "m") return length_.name;
    if (part == "kg") return mass_.name;
    if (part == "s") return time_.name;
    for (const auto& [derived, e] : kDerived) {
      if (part != derived) continue;
      const double factor = power(length_.factor, e.length) * power(mass_.factor, e.mass) * power(time_.factor, e.time);
      if (const char* prefix = prefix_of(factor)) return fmt::format("{}{}", prefix, derived);
      const std::string above = with_exponent(length_.name, std::max(e.length, 1)), below = with_exponent(time_.name, 2);
      if (e.length < 0) return "(" + mass_.name + "/(" + length_.name + " " + below + "))";
      return "(" + mass_.name + " " + above + "/" + below + ")";
    }
    return std::string(part);
  };
  std::string text;
  for (const Part& part : parts_of(unit)) {
    if (part.is_divisor)
      text += text.empty() ? "1/" : "/";
    else if (!text.empty())
      text += " ";
    text += with_exponent(name_of(part.name), part.exponent);
  }
  return text;
}

std::string Units::text(double value, std::string_view unit, int digits) const {
  const std::string number = fmt::format("{:.{}g}", from_si(value, unit), digits);
  return unit == "s" && !has_steps ? number : number + " " + name(unit);
}

}  // namespace itr
