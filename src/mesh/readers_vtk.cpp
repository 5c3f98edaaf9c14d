// SPDX-License-Identifier: MIT
// VTK's legacy files, text and binary ("VTK File Formats", https://docs.vtk.org): unstructured grids and polygons.
#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "cursor.hpp"
#include "readers.hpp"
#include "vtk_cells.hpp"

namespace itr {

namespace {

/// One number, of big endian where the file is binary.
template <typename T>
double number(Cursor& in) {
  if (!in.binary) return in.text<double>();
  std::array<char, sizeof(T)> bytes = in.raw<std::array<char, sizeof(T)>>();
  std::reverse(bytes.begin(), bytes.end());
  T value;
  std::memcpy(&value, bytes.data(), sizeof(T));
  return static_cast<double>(value);
}

struct NumberType {
  std::string_view name;
  double (*read)(Cursor&);
};
constexpr NumberType kNumberTypes[] = {{"float", number<float>},
                                       {"double", number<double>},
                                       {"char", number<std::int8_t>},
                                       {"unsigned_char", number<std::uint8_t>},
                                       {"short", number<std::int16_t>},
                                       {"unsigned_short", number<std::uint16_t>},
                                       {"int", number<std::int32_t>},
                                       {"unsigned_int", number<std::uint32_t>},
                                       {"long", number<std::int64_t>},
                                       {"unsigned_long", number<std::uint64_t>},
                                       {"vtkIdType", number<std::int32_t>},
                                       {"vtktypeint64", number<std::int64_t>},
                                       {"vtktypeuint64", number<std::uint64_t>}};

/// Arrays of points and cells: how many numbers each has, and whether their type stands behind the name. 0: it says so.
struct Attribute {
  std::string_view keyword;
  int components;
};
constexpr Attribute kAttributes[] = {{"VECTORS", 3},    {"NORMALS", 3},      {"TENSORS", 9}, {"TENSORS6", 6},
                                     {"GLOBAL_IDS", 1}, {"PEDIGREE_IDS", 1}, {"SCALARS", 0}, {"TEXTURE_COORDINATES", 0}};

class VtkReader {
 public:
  VtkReader(std::string_view bytes, const std::filesystem::path& file) : in_(bytes, file), cells_(file) {}

  MeshFile read() {
    read_head();
    for (std::string_view keyword = word(); !keyword.empty(); keyword = word()) read_section(keyword);
    if (!has_points_) in_.fail("no points", "POINTS");
    cells_.begin_piece(points_);
    for (const auto& [type, points, ends] : lists_)
      cells_.add(points, ends, type == 0 ? types_ : std::vector<double>(ends.size(), type));
    for (const auto& [name, values] : cell_data_) cells_.add_cell_data(name, values);
    for (const auto& [name, values] : point_data_) cells_.add_point_data(name, values);
    return cells_.finish();
  }

 private:
  struct Lists {
    double type;  ///< of all of them; 0: CELL_TYPES has each
    std::vector<double> points{}, ends{};
  };

  std::string_view word() {
    const bool binary = std::exchange(in_.binary, false);
    const std::string_view result = in_.word();
    in_.binary = binary;
    return result;
  }
  std::int64_t integer() {
    const bool binary = std::exchange(in_.binary, false);
    const std::int64_t value = in_.text<std::int64_t>();
    in_.binary = binary;
    return value;
  }

  void read_head() {
    if (word() != "#" || word() != "vtk") in_.fail("another beginning", "# vtk DataFile Version");
    in_.end_line();
    in_.end_line();
    const std::string_view format = word();
    if (format != "ASCII" && format != "BINARY") in_.fail(quoted_start(format), "ASCII or BINARY");
    is_binary_ = format == "BINARY";
  }

  void read_section(std::string_view keyword) {
    constexpr double kVertices = 2, kLines = 4, kPolygons = 7;
    if (keyword == "DATASET") {
      const std::string_view type = word();
      if (type != "UNSTRUCTURED_GRID" && type != "POLYDATA")
        in_.fail("a dataset of type " + quoted_start(type), "UNSTRUCTURED_GRID or POLYDATA");
    } else if (keyword == "POINTS") {
      const std::size_t count = in_.count(integer());
      points_ = numbers(word(), 3 * count);
      has_points_ = true;
    } else if (keyword == "CELLS") {
      read_lists(0);
    } else if (keyword == "VERTICES") {
      read_lists(kVertices);
    } else if (keyword == "LINES") {
      read_lists(kLines);
    } else if (keyword == "POLYGONS") {
      read_lists(kPolygons);
    } else if (keyword == "CELL_TYPES") {
      types_ = numbers("int", in_.count(integer()));
    } else if (keyword == "POINT_DATA" || keyword == "CELL_DATA") {
      data_ = keyword == "POINT_DATA" ? &point_data_ : &cell_data_;
      data_count_ = in_.count(integer());
    } else if (keyword == "FIELD") {
      word();
      const std::size_t count = in_.count(integer());
      for (std::size_t i = 0; i < count; ++i) read_field_array();
    } else if (keyword == "METADATA") {
      in_.skip_paragraph();
    } else {
      read_attribute(keyword);
    }
  }

  /// Reads a count and points a cell in files before 5.1, later their ends and all points.
  void read_lists(double type) {
    const std::int64_t rows = integer(), size = integer();
    Lists lists{type};
    if (in_.peek() == "OFFSETS") {
      word();
      lists.ends = numbers(word(), in_.count(rows));
      if (!lists.ends.empty()) {
        if (lists.ends[0] != 0) in_.fail("OFFSETS that begin with " + std::to_string(lists.ends[0]), "0");
        lists.ends.erase(lists.ends.begin());
      }
      if (word() != "CONNECTIVITY") in_.fail("no CONNECTIVITY", "it behind OFFSETS");
      lists.points = numbers(word(), in_.count(size));
    } else {
      const std::vector<double> all = numbers("int", in_.count(size));
      for (std::size_t at = 0; at < all.size();) {
        const double length = all[at];
        if (!(length >= 0 && length < static_cast<double>(all.size() - at)))
          in_.fail("a cell of " + std::to_string(length) + " points", "as many as there are");
        const auto begin = all.begin() + static_cast<std::ptrdiff_t>(at) + 1;
        lists.points.insert(lists.points.end(), begin, begin + static_cast<std::ptrdiff_t>(length));
        lists.ends.push_back(static_cast<double>(lists.points.size()));
        at += 1 + static_cast<std::size_t>(length);
      }
    }
    lists_.push_back(std::move(lists));
  }

  void read_attribute(std::string_view keyword) {
    const auto known = std::find_if(std::begin(kAttributes), std::end(kAttributes),
                                    [&](const Attribute& attribute) { return attribute.keyword == keyword; });
    if (keyword == "LOOKUP_TABLE" || keyword == "COLOR_SCALARS") {
      word();
      const std::size_t count = in_.count(integer());
      skip_colors(keyword == "LOOKUP_TABLE" ? 4 * count : data_count_ * count);
      return;
    }
    if (known == std::end(kAttributes)) in_.fail(quoted_start(keyword), "a keyword of VTK, such as CELL_DATA");
    const std::string name(word());
    std::size_t components = static_cast<std::size_t>(known->components);
    if (keyword == "TEXTURE_COORDINATES") components = in_.count(integer());
    const std::string type(word());
    if (keyword == "SCALARS") {
      components = in_.peek() == "LOOKUP_TABLE" ? 1 : in_.count(integer());
      if (word() != "LOOKUP_TABLE") in_.fail("SCALARS without LOOKUP_TABLE", "it");
      word();
    }
    keep(name, numbers(type, in_.count(static_cast<std::int64_t>(components * data_count_))));
  }

  void skip_colors(std::size_t count) {
    numbers(is_binary_ ? "unsigned_char" : "float", in_.count(static_cast<std::int64_t>(count)));
  }

  void read_field_array() {
    const std::string name(word());
    const std::size_t components = in_.count(integer()), rows = in_.count(integer());
    const std::string type(word());
    keep(name, numbers(type, in_.count(static_cast<std::int64_t>(components * rows))));
  }

  void keep(const std::string& name, std::vector<double> values) {
    if (data_) data_->emplace_back(name, std::move(values));
  }

  std::vector<double> numbers(std::string_view type, std::size_t count) {
    const auto known =
        std::find_if(std::begin(kNumberTypes), std::end(kNumberTypes), [&](const NumberType& t) { return t.name == type; });
    if (known == std::end(kNumberTypes)) in_.fail("numbers of type " + quoted_start(type), "float, double, int, ...");
    std::vector<double> values(in_.count(static_cast<std::int64_t>(count)));
    if (is_binary_) in_.end_line();
    in_.binary = is_binary_;
    for (double& value : values) value = known->read(in_);
    in_.binary = false;
    return values;
  }

  Cursor in_;
  VtkCells cells_;
  bool is_binary_ = false, has_points_ = false;
  std::vector<double> points_, types_;
  std::vector<Lists> lists_;
  using Data = std::vector<std::pair<std::string, std::vector<double>>>;
  Data cell_data_, point_data_;
  Data* data_ = nullptr;  ///< which of them is read
  std::size_t data_count_ = 0;
};

}  // namespace

MeshFile read_vtk(std::string_view bytes, const std::filesystem::path& file) { return VtkReader(bytes, file).read(); }

}  // namespace itr
