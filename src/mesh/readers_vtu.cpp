// SPDX-License-Identifier: MIT
// VTK's XML files .vtu and .vtp ("VTK XML Formats", https://docs.vtk.org): arrays as text, base64 or appended, compressed by
// zlib or not.
#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>

#include "cursor.hpp"
#include "readers.hpp"
#include "vtk_cells.hpp"

namespace itr {

namespace {

struct Tag {
  std::string name;  ///< with a slash where it ends an element
  std::map<std::string, std::string> attributes;
  bool is_empty = false;           ///< ends itself
  std::size_t begin = 0, end = 0;  ///< in the file: of the tag
};

/// Bytes of a data array: as they are, or in base64, where a group that is filled up with '=' ends a part.
class Source {
 public:
  Source(std::string_view text, bool is_base64) : text_(text), is_base64_(is_base64) {}

  /// The next bytes, or none where there are not so many.
  std::optional<std::string> take(std::size_t count) {
    if (count > text_.size() + bytes_.size()) return {};
    while (bytes_.size() < count)
      if (!decode()) return {};
    std::string result = bytes_.substr(0, count);
    bytes_.erase(0, count);
    return result;
  }

 private:
  /// Decodes some groups of four.
  bool decode() {
    constexpr std::size_t kAtOnce = 1 << 16;
    std::string more;
    if (!is_base64_) {
      more = text_.substr(0, kAtOnce);
      text_.remove_prefix(more.size());
    }
    while (is_base64_ && more.size() < kAtOnce) {
      std::uint32_t group = 0;
      int digits = 0, filled = 0;
      while (digits + filled < 4 && !text_.empty()) {
        const char c = text_.front();
        text_.remove_prefix(1);
        if (c == '=')
          ++filled;
        else if (const int value = digit(c); value >= 0)
          group = group << 6 | static_cast<std::uint32_t>(value), ++digits;
        else if (c != '\n' && c != ' ' && c != '\r' && c != '\t')
          text_ = {};
      }
      if (digits < 2 || digits + filled != 4) break;
      group <<= 6 * filled;
      for (int k = 0; k < digits - 1; ++k) more += static_cast<char>(group >> (16 - 8 * k) & 255);
    }
    bytes_ += more;
    return !more.empty();
  }

  static int digit(char c) {
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : -1;
  }

  std::string_view text_;
  bool is_base64_;
  std::string bytes_;  ///< decoded, not yet taken
};

template <typename T>
void append_numbers(const std::string& bytes, std::vector<double>& values) {
  for (std::size_t at = 0; at + sizeof(T) <= bytes.size(); at += sizeof(T)) {
    T value;
    std::memcpy(&value, bytes.data() + at, sizeof(T));
    values.push_back(static_cast<double>(value));
  }
}

struct NumberType {
  const char* name;
  void (*append)(const std::string&, std::vector<double>&);
};
constexpr NumberType kNumberTypes[] = {{"Float64", append_numbers<double>},       {"Float32", append_numbers<float>},
                                       {"Int64", append_numbers<std::int64_t>},   {"Int32", append_numbers<std::int32_t>},
                                       {"UInt8", append_numbers<std::uint8_t>},   {"Int8", append_numbers<std::int8_t>},
                                       {"Int16", append_numbers<std::int16_t>},   {"UInt16", append_numbers<std::uint16_t>},
                                       {"UInt32", append_numbers<std::uint32_t>}, {"UInt64", append_numbers<std::uint64_t>}};

class VtuReader {
 public:
  VtuReader(std::string_view bytes, const std::filesystem::path& file) : bytes_(bytes), cells_(file), file_(file) {}

  MeshFile read() {
    find_appended();
    bool is_vtk = false;
    for (std::optional<Tag> tag = next_tag(); tag; tag = next_tag()) {
      if (tag->name == "VTKFile") {
        read_head(*tag);
        is_vtk = true;
      } else if (tag->name == "Piece") {
        if (!is_vtk) fail("another beginning", "<VTKFile");
        read_piece();
        ++num_pieces_;
      }
    }
    if (num_pieces_ == 0) fail("no <Piece>", "a file of VTK's UnstructuredGrid or PolyData");
    return cells_.finish();
  }

 private:
  using Arrays = std::map<std::string, std::vector<double>>;

  /// The data behind all tags begin with an underscore.
  void find_appended() {
    const auto begin = bytes_.find("<AppendedData");
    const auto end = bytes_.find('_', begin == bytes_.npos ? bytes_.size() : begin);
    if (end == bytes_.npos) return;
    appended_ = bytes_.substr(end + 1);
    appended_is_base64_ = bytes_.substr(begin, end - begin).find("base64") != std::string_view::npos;
    bytes_ = bytes_.substr(0, begin);
  }

  std::optional<Tag> next_tag() {
    for (;;) {
      const auto begin = bytes_.find('<', position_);
      if (begin == bytes_.npos) return {};
      const bool is_comment = bytes_.substr(begin).starts_with("<!--");
      const auto end = bytes_.find(is_comment ? "-->" : ">", begin);
      if (end == bytes_.npos) fail_at(begin, "a tag without end", is_comment ? "-->" : ">");
      position_ = end + (is_comment ? 3 : 1);
      if (!is_comment && bytes_[begin + 1] != '?') return parse_tag(begin, end);
    }
  }

  Tag parse_tag(std::size_t begin, std::size_t end) const {
    constexpr std::string_view kSpace = " \t\r\n";
    std::string_view text = bytes_.substr(begin + 1, end - begin - 1);
    Tag tag;
    tag.begin = begin, tag.end = end + 1;
    tag.is_empty = text.ends_with('/');
    if (tag.is_empty) text.remove_suffix(1);
    tag.name = text.substr(0, text.find_first_of(kSpace));
    text.remove_prefix(tag.name.size());
    for (auto at = text.find('='); at != text.npos; at = text.find('=')) {
      std::string_view key = text.substr(0, at);
      key.remove_prefix(std::min(key.find_first_not_of(kSpace), key.size()));
      key = key.substr(0, key.find_first_of(kSpace));
      const auto open = text.find_first_of("\"'", at);
      const auto close = open == text.npos ? open : text.find(text[open], open + 1);
      if (close == text.npos) fail_at(begin, quoted(key), "a value between quotes");
      tag.attributes[std::string(key)] = text.substr(open + 1, close - open - 1);
      text.remove_prefix(close + 1);
    }
    return tag;
  }

  void read_head(const Tag& tag) {
    const std::string type = attribute(tag, "type", "");
    if (type != "UnstructuredGrid" && type != "PolyData")
      fail_at(tag.begin, "a file of type " + quoted_start(type), "UnstructuredGrid or PolyData");
    if (attribute(tag, "byte_order", "LittleEndian") != "LittleEndian") fail_at(tag.begin, "big endian", "LittleEndian");
    size_of_head_ = attribute(tag, "header_type", "UInt32") == "UInt64" ? 8 : 4;
    const std::string compressor = attribute(tag, "compressor", "");
    is_compressed_ = !compressor.empty();
    if (is_compressed_ && compressor != "vtkZLibDataCompressor")
      fail_at(tag.begin, compressor, "vtkZLibDataCompressor or none (in ParaView, Save Data asks for the compressor)");
  }

  static std::string attribute(const Tag& tag, const char* name, const char* fallback) {
    const auto found = tag.attributes.find(name);
    return found == tag.attributes.end() ? fallback : found->second;
  }

  void read_piece() {
    std::map<std::string, Arrays> sections;
    std::string section;
    for (std::optional<Tag> tag = next_tag(); tag && tag->name != "/Piece"; tag = next_tag()) {
      if (tag->name == "DataArray") {
        const bool is_needed = section != "PointData" || attribute(*tag, "Name", "").starts_with("set:");
        if (is_needed) sections[section][attribute(*tag, "Name", "")] = read_array(*tag);
        skip_content(*tag);
      } else if (!tag->name.starts_with('/')) {
        section = tag->name;
      }
    }
    const Arrays& points = sections["Points"];
    if (points.size() != 1 || points.begin()->second.size() % 3 != 0) fail("no <Points>", "three coordinates a point");
    cells_.begin_piece(points.begin()->second);
    constexpr std::pair<const char*, double> kOfPolygons[] = {{"Verts", 2}, {"Lines", 4}, {"Polys", 7}, {"Strips", 6}};
    for (const auto& [name, type] : kOfPolygons) {
      const std::vector<double>& ends = sections[name]["offsets"];
      cells_.add(sections[name]["connectivity"], ends, std::vector<double>(ends.size(), type));
    }
    Arrays& cells = sections["Cells"];
    cells_.add(cells["connectivity"], cells["offsets"], cells["types"]);
    for (const auto& [name, values] : sections["CellData"]) cells_.add_cell_data(name, values);
    for (const auto& [name, values] : sections["PointData"]) cells_.add_point_data(name, values);
  }

  /// Goes behind the end of an array, which may hold tags of its own.
  void skip_content(const Tag& tag) {
    if (tag.is_empty) return;
    const auto end = bytes_.find("</DataArray", tag.end);
    if (end == bytes_.npos) fail_at(tag.begin, "an array without end", "</DataArray>");
    position_ = bytes_.find('>', end);
    if (position_ == bytes_.npos) position_ = bytes_.size();
  }

  std::vector<double> read_array(const Tag& tag) const {
    const std::string type = attribute(tag, "type", ""), format = attribute(tag, "format", "ascii");
    const auto known =
        std::find_if(std::begin(kNumberTypes), std::end(kNumberTypes), [&](const NumberType& t) { return type == t.name; });
    if (known == std::end(kNumberTypes)) return {};  // texts
    std::string_view content = bytes_.substr(tag.end);
    content = content.substr(0, content.find('<'));
    if (format == "ascii") return read_text(tag, content);
    std::vector<double> values;
    if (format == "appended") {
      const std::string text = attribute(tag, "offset", "");
      const std::optional<std::size_t> offset = number_of<std::size_t>(text);
      if (!offset || *offset > appended_.size())
        fail_at(tag.begin, "the offset " + quoted_start(text), "one in <AppendedData>");
      known->append(read_bytes(tag, Source(appended_.substr(*offset), appended_is_base64_)), values);
    } else {
      if (format != "binary") fail_at(tag.begin, "the format " + quoted_start(format), "ascii, binary or appended");
      known->append(read_bytes(tag, Source(content, true)), values);
    }
    return values;
  }

  std::vector<double> read_text(const Tag& tag, std::string_view text) const {
    std::vector<double> values;
    Cursor in(text, file_);
    for (std::string_view word = in.word(); !word.empty(); word = in.word()) {
      const std::optional<double> value = number_of<double>(word);
      if (!value) fail_at(tag.begin, quoted_start(word), "a number");
      values.push_back(*value);
    }
    return values;
  }

  std::string read_bytes(const Tag& tag, Source source) const {
    const auto take = [&](std::size_t count) {
      std::optional<std::string> bytes = source.take(count);
      if (!bytes) fail_at(tag.begin, "an array that ends too early", std::to_string(count) + " bytes more");
      return *std::move(bytes);
    };
    const auto take_size = [&] {
      const std::string bytes = take(size_of_head_);
      std::uint64_t value = 0;
      std::memcpy(&value, bytes.data(), bytes.size());
      return value;
    };
    if (!is_compressed_) return take(take_size());
    const std::uint64_t num_blocks = take_size(), size = take_size(), size_of_last = take_size();
    std::vector<std::uint64_t> compressed;
    for (std::uint64_t i = 0; i < num_blocks; ++i) compressed.push_back(take_size());
    std::string all;
    for (std::uint64_t i = 0; i < num_blocks; ++i) {
      constexpr std::uint64_t kMostRatio = 1040;  // of zlib
      const std::string block = take(compressed[i]);
      const std::uint64_t here = i + 1 == num_blocks && size_of_last > 0 ? size_of_last : size;
      if (here > kMostRatio * block.size() + 64)
        fail_at(tag.begin, "a block of " + std::to_string(here) + " bytes", "fewer");
      std::string plain(here, '\0');
      uLongf length = here;
      const int outcome = uncompress(reinterpret_cast<Bytef*>(plain.data()), &length,
                                     reinterpret_cast<const Bytef*>(block.data()), block.size());
      if (outcome != Z_OK || length != here) fail_at(tag.begin, "a block that zlib cannot read", "an undamaged one");
      all += plain;
    }
    return all;
  }

  [[noreturn]] void fail(const std::string& found, const std::string& expected) const {
    fail_at(position_, found, expected);
  }
  [[noreturn]] void fail_at(std::size_t place, const std::string& found, const std::string& expected) const {
    const auto end = bytes_.begin() + static_cast<std::ptrdiff_t>(std::min(place, bytes_.size()));
    throw InputError({file_.string(), "line " + std::to_string(std::count(bytes_.begin(), end, '\n') + 1), found, expected});
  }

  std::string_view bytes_, appended_;
  VtkCells cells_;
  const std::filesystem::path& file_;
  std::size_t position_ = 0, size_of_head_ = 4;
  bool appended_is_base64_ = false, is_compressed_ = false;
  int num_pieces_ = 0;
};

}  // namespace

MeshFile read_vtu(std::string_view bytes, const std::filesystem::path& file) { return VtuReader(bytes, file).read(); }

}  // namespace itr
