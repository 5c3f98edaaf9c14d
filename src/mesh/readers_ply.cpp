// SPDX-License-Identifier: MIT
// Stanford .ply, text and little endian (Turk, "The PLY Polygon File Format", 1994): vertices, triangles, edges. Other
// elements and properties are passed over.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>

#include "cursor.hpp"
#include "readers.hpp"

namespace itr {

namespace {

/// How a number is stored in binary files.
using Number = double (*)(Cursor&);
template <typename T>
double raw_number(Cursor& in) {
  return static_cast<double>(in.raw<T>());
}

Number number_type(std::string_view name) {
  static const std::map<std::string_view, Number> kTypes = {
      {"char", raw_number<std::int8_t>},     {"int8", raw_number<std::int8_t>},     {"uchar", raw_number<std::uint8_t>},
      {"uint8", raw_number<std::uint8_t>},   {"short", raw_number<std::int16_t>},   {"int16", raw_number<std::int16_t>},
      {"ushort", raw_number<std::uint16_t>}, {"uint16", raw_number<std::uint16_t>}, {"int", raw_number<std::int32_t>},
      {"int32", raw_number<std::int32_t>},   {"uint", raw_number<std::uint32_t>},   {"uint32", raw_number<std::uint32_t>},
      {"float", raw_number<float>},          {"float32", raw_number<float>},        {"double", raw_number<double>},
      {"float64", raw_number<double>}};
  const auto found = kTypes.find(name);
  return found == kTypes.end() ? nullptr : found->second;
}

struct Property {
  std::string name;
  Number type;
  Number count_type = nullptr;  ///< of a list: how its length is stored
};

struct Element {
  std::string name;
  std::int64_t count = 0;
  std::vector<Property> properties;
};

class PlyReader {
 public:
  PlyReader(std::string_view bytes, const std::filesystem::path& file) : in_(bytes, file), file_(file) {}

  MeshFile read() {
    for (const Element& element : read_header()) read_element(element);
    return std::move(mesh_);
  }

 private:
  std::vector<Element> read_header() {
    if (in_.word() != "ply") in_.fail("another beginning", "ply");
    std::vector<Element> elements;
    std::string_view format;
    for (std::string_view keyword = in_.word(); keyword != "end_header"; keyword = in_.word()) {
      if (keyword.empty()) in_.fail("the end of the file", "end_header");
      if (keyword == "format") format = in_.word();
      if (keyword == "element") {
        const std::string name(in_.word());
        elements.push_back({name, in_.text<std::int64_t>(), {}});
      }
      if (keyword == "property") {
        if (elements.empty()) in_.fail("a property", "an element before it");
        elements.back().properties.push_back(read_property());
      }
      in_.end_line();
    }
    if (format != "ascii" && format != "binary_little_endian")
      in_.fail("the format '" + std::string(format) + "'", "ascii or binary_little_endian");
    in_.end_line();
    in_.binary = format != "ascii";
    return elements;
  }

  Property read_property() {
    const std::string_view first = in_.word();
    const bool is_list = first == "list";
    const Number count_type = is_list ? type_named(in_.word()) : nullptr;
    const Number type = type_named(is_list ? in_.word() : first);
    return {std::string(in_.word()), type, count_type};
  }

  Number type_named(std::string_view name) const {
    const Number type = number_type(name);
    if (!type) in_.fail("the type '" + std::string(name.substr(0, 40)) + "'", "that of a number: int, float, double, ...");
    return type;
  }

  void read_element(const Element& element) {
    if (element.name == "tristrips") in_.fail("strips of triangles", "faces");
    const bool is_vertex = element.name == "vertex", is_face = element.name == "face", is_edge = element.name == "edge";
    std::vector<std::string> wanted;
    if (is_vertex) wanted = {"x", "y", "z"};
    if (is_edge) wanted = {"vertex1", "vertex2"};
    if (is_face) wanted = {has_property(element, "vertex_index") ? "vertex_index" : "vertex_indices"};
    for (const std::string& name : wanted)
      if (!has_property(element, name)) in_.fail("'" + element.name + "' without '" + name + "'", "it");
    const std::size_t count = in_.count(element.count);
    for (std::size_t i = 0; i < count; ++i) {
      std::array<double, 3> values = {0, 0, 0};
      for (const Property& property : element.properties) {
        const auto slot = std::find(wanted.begin(), wanted.end(), property.name) - wanted.begin();
        const bool is_wanted = slot < static_cast<std::ptrdiff_t>(wanted.size());
        std::size_t length = 1;
        if (property.count_type) length = in_.count(integer(number(property.count_type)));
        if (is_wanted && length != (is_face ? 3 : 1))
          in_.fail("'" + property.name + "' with " + std::to_string(length) + " numbers",
                   is_face ? "3: triangles only" + (length == 4 ? "; " + split_advice(file_) : "") : "one number");
        for (std::size_t k = 0; k < length; ++k) {
          const double value = number(property.type);
          if (is_wanted) values[is_face ? k : static_cast<std::size_t>(slot)] = value;
        }
      }
      if (is_vertex) mesh_.vertices.emplace_back(values[0], values[1], values[2]);
      if (is_edge) mesh_.edges.push_back({integer(values[0]), integer(values[1])});
      if (is_face) mesh_.triangles.push_back({integer(values[0]), integer(values[1]), integer(values[2])});
    }
  }

  static bool has_property(const Element& element, const std::string& name) {
    return std::any_of(element.properties.begin(), element.properties.end(),
                       [&](const Property& property) { return property.name == name; });
  }

  double number(Number type) { return in_.binary ? type(in_) : in_.text<double>(); }

  int integer(double value) const {
    if (!(std::abs(value) <= std::numeric_limits<int>::max()) || value != std::floor(value))
      in_.fail("the number " + std::to_string(value), "an integer");
    return static_cast<int>(value);
  }

  Cursor in_;
  std::filesystem::path file_;
  MeshFile mesh_;
};

}  // namespace

MeshFile read_ply(std::string_view bytes, const std::filesystem::path& file) { return PlyReader(bytes, file).read(); }

}  // namespace itr
