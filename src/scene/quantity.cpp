// SPDX-License-Identifier: MIT
// Values with units of their own, {"value": 20, "unit": "kPa"} or "20 kPa": they become numbers in the units of the scene
// before anybody reads them.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>

#include "defaults.hpp"
#include "key_table.hpp"
#include "readers.hpp"

namespace itr::scene {

namespace {

/// A unit: its value in SI units, and exponents of length, mass and time.
struct Unit {
  double factor = 1;
  std::array<int, 3> exponents{};
  void multiply(const Unit& other, int power) {
    factor *= std::pow(other.factor, power);
    for (int i = 0; i < 3; ++i) exponents[i] += power * other.exponents[i];
  }
};

struct NamedUnit {
  std::string_view name;
  Unit unit;
  bool takes_prefixes;
};
constexpr double kDegrees = 57.29577951308232;  // of a radian
constexpr NamedUnit kUnits[] = {{"m", {1, {1, 0, 0}}, true},
                                {"g", {1e-3, {0, 1, 0}}, true},
                                {"s", {1, {0, 0, 1}}, true},
                                {"N", {1, {1, 1, -2}}, true},
                                {"Pa", {1, {-1, 1, -2}}, true},
                                {"J", {1, {2, 1, -2}}, true},
                                {"W", {1, {2, 1, -3}}, true},
                                {"Hz", {1, {0, 0, -1}}, true},
                                {"bar", {1e5, {-1, 1, -2}}, true},
                                {"t", {1e3, {0, 1, 0}}, false},
                                {"min", {60, {0, 0, 1}}, false},
                                {"h", {3600, {0, 0, 1}}, false},
                                {"hr", {3600, {0, 0, 1}}, false},
                                {"in", {0.0254, {1, 0, 0}}, false},
                                {"ft", {0.3048, {1, 0, 0}}, false},
                                {"yd", {0.9144, {1, 0, 0}}, false},
                                {"lb", {0.45359237, {0, 1, 0}}, false},
                                {"lbf", {4.4482216152605, {1, 1, -2}}, false},
                                {"psi", {6894.757293168361, {-1, 1, -2}}, false},
                                {"deg", {1, {}}, false},
                                {"rad", {kDegrees, {}}, false},
                                {"1", {1, {}}, false}};
constexpr std::pair<std::string_view, double> kPrefixes[] = {{"n", 1e-9}, {"u", 1e-6}, {"µ", 1e-6}, {"m", 1e-3}, {"c", 1e-2},
                                                             {"d", 1e-1}, {"k", 1e3},  {"M", 1e6},  {"G", 1e9}};

std::optional<Unit> find_unit(std::string_view name) {
  for (const NamedUnit& known : kUnits)
    if (name == known.name) return known.unit;
  for (const auto& [prefix, factor] : kPrefixes)
    for (const NamedUnit& known : kUnits)
      if (known.takes_prefixes && name.starts_with(prefix) && name.substr(prefix.size()) == known.name)
        return Unit{factor * known.unit.factor, known.unit.exponents};
  return std::nullopt;
}

/// Products and quotients of powers of units: "mN/mm^2", "kg*m/s^2". Each "/" divides by the one unit after it.
std::optional<Unit> parse_unit(std::string_view text) {
  Unit product;
  int sign = 1;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find_first_of("*/ "), text.size());
    std::string_view name = text.substr(0, end);
    int power = 1;
    if (const std::size_t caret = name.find('^'); caret != std::string_view::npos) {
      const std::string digits(name.substr(caret + 1));
      const bool is_negative = digits.starts_with('-');
      if (digits.size() != 1U + is_negative || digits.back() < '0' || digits.back() > '9') return std::nullopt;
      power = (is_negative ? -1 : 1) * (digits.back() - '0');
      name = name.substr(0, caret);
    }
    const std::optional<Unit> unit = find_unit(name);
    if (!unit) return std::nullopt;
    product.multiply(*unit, sign * power);
    if (end == text.size()) break;
    sign = text[end] == '/' ? -1 : 1;
    text.remove_prefix(end + 1);
    if (text.empty()) return std::nullopt;
  }
  return product;
}

/// Exponents of a unit of the table of keys, by what it is in units that differ in one of them.
std::array<int, 3> exponents_of(const std::string& unit) {
  const auto exponent = [&](const Units& units, double base) {
    return static_cast<int>(std::lround(std::log(units.factor(unit)) / std::log(base)));
  };
  return {exponent(Units("km", "kg", "s"), 1e3), exponent(Units("m", "t", "s"), 1e3),
          exponent(Units("m", "kg", "ms"), 1e-3)};
}

bool is_quantity(const Json& json) {
  return json.is_object() && json.size() == 2 && json.contains("unit") && json.contains("value") &&
         json["unit"].is_string() && (json["value"].is_number() || json["value"].is_string());
}

/// "20 kPa" as the object that it stands for; nothing of other texts.
std::optional<Json> read_quantity(const std::string& text) {
  double number = 0;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, number);
  const std::string_view left(rest, static_cast<std::size_t>(end - rest));
  const std::size_t start = left.find_first_not_of(' ');
  if (error != std::errc() || start == std::string_view::npos || left[start] == '1' || !parse_unit(left.substr(start)))
    return std::nullopt;
  return Json{{"value", number}, {"unit", std::string(left.substr(start))}};
}

void convert(Json& json, const std::string& pointer, const Document& document) {
  if (json.is_string()) {
    const Entry* entry = key_table().find_place(pointer);
    if (!entry || entry->key->unit.empty()) return;
    if (const auto quantity = read_quantity(json.get<std::string>())) json = *quantity;
  }
  if (json.is_array())
    for (std::size_t i = 0; i < json.size(); ++i) convert(json[i], pointer + "/" + std::to_string(i), document);
  if (!json.is_object()) return;
  if (!is_quantity(json)) {
    for (auto& [key, value] : json.items()) convert(value, pointer + "/" + escape_token(key), document);
    return;
  }
  const Entry* entry = key_table().find_place(pointer);
  if (!entry) return;  // an unknown key, which is refused as one
  const auto fail = [&](const std::string& expected) {
    throw InputError({document.file.string(), pointer, abbreviate(json), expected});
  };
  const std::string& wanted = entry->key->unit;
  const std::optional<Unit> unit = parse_unit(json["unit"].get<std::string>());
  if (!unit) fail("a unit made of m, g, s, N, Pa, J and the like by * / ^, as \"mN/mm^2\"");
  const bool is_as_wanted = unit->exponents == exponents_of(wanted);
  // PolyFEM takes the numbers of Ds, which are inverse stiffnesses, as ones in units of stress.
  const bool is_of_polyfem = !is_as_wanted && pointer.find("/Ds") != pointer.npos && is_polyfem_set(Node(document)) &&
                             unit->exponents == exponents_of("Pa");
  if (!is_as_wanted && !is_of_polyfem) fail(wanted.empty() ? "a number: the value has no unit" : "a unit of " + wanted);
  const double factor = unit->factor / document.units.factor(is_of_polyfem ? "Pa" : wanted);
  const Json value = json["value"];
  if (value.is_string())
    json = factor == 1 ? value.get<std::string>() : fmt::format("{} * ({})", factor, value.get<std::string>());
  else
    json = factor == 1 ? value : Json(factor * value.get<double>());
}

}  // namespace

void convert_quantities(Document& document) { convert(document.json, "", document); }

}  // namespace itr::scene
