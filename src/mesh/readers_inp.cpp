// SPDX-License-Identifier: MIT
// Abaqus and CalculiX .inp (CalculiX CrunchiX User's Manual, "Input deck format"; Abaqus Keywords Guide): nodes, linear and
// quadratic simplices, and NSET, ELSET and SURFACE as groups with names. What a deck says of materials, loads and steps is
// passed over.
#include <algorithm>
#include <cctype>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <unordered_set>

#include "cursor.hpp"
#include "mesh_builder.hpp"
#include "readers.hpp"

namespace itr {

namespace {

struct ElementType {
  const char* base;  ///< letters may follow: hybrid, modified, ...
  int dim;
  bool is_second_order, is_shell = false;
};
constexpr ElementType kTypes[] = {
    {"C3D4", 3, false},        {"C3D10", 3, true},         {"CPS3", 2, false},        {"CPE3", 2, false},
    {"CPS6", 2, true},         {"CPE6", 2, true},          {"S3", 2, false, true},    {"S6", 2, true, true},
    {"STRI3", 2, false, true}, {"STRI65", 2, true, true},  {"M3D3", 2, false, true},  {"M3D6", 2, true, true},
    {"R3D3", 2, false, true},  {"SFM3D3", 2, false, true}, {"SFM3D6", 2, true, true}, {"T2D2", 1, false},
    {"T3D2", 1, false},        {"B21", 1, false},          {"B31", 1, false},         {"R2D2", 1, false},
    {"T2D3", 1, true},         {"T3D3", 1, true},          {"B22", 1, true},          {"B32", 1, true}};

std::string upper(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(), [](unsigned char c) { return std::toupper(c); });
  return result;
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kSpace = " \t\r";
  const auto begin = text.find_first_not_of(kSpace);
  if (begin == text.npos) return {};
  text = text.substr(begin, text.find_last_not_of(kSpace) + 1 - begin);
  const bool is_quoted = text.size() >= 2 && text.front() == '"' && text.back() == '"';
  return is_quoted ? text.substr(1, text.size() - 2) : text;
}

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> words;
  for (;;) {
    const auto comma = line.find(',');
    words.push_back(trimmed(line.substr(0, comma)));
    if (comma == line.npos) break;
    line = line.substr(comma + 1);
  }
  while (!words.empty() && words.back().empty()) words.pop_back();
  return words;
}

class InpReader {
 public:
  InpReader(std::string_view bytes, const std::filesystem::path& file) : lines_(bytes, file), mesh_(file), file_(file) {}

  MeshFile read() {
    next_line();
    if (!is_keyword()) fail("no keyword", "a deck that begins with one, such as *NODE");
    while (is_keyword()) read_keyword();
    add_lines_of_second_order();
    for (const std::string& key : order_) add_group(key);
    if (mesh_.num_nodes() == 0) fail("no nodes", "*NODE");
    return mesh_.finish();
  }

 private:
  struct Member {
    std::int64_t first, last, step;  ///< labels: one, or as GENERATE says
    std::string set;                 ///< or those of another set
    std::string face;                ///< of a SURFACE
    int line;
  };
  struct Set {
    std::string name;
    std::vector<Member> members;
  };
  struct Element {
    int dim;
    int index;  ///< in the mesh; -1: a line of second order that is not there yet
    bool is_shell;
  };
  static constexpr char kNodes = 'N', kElements = 'E', kSurface = 'S';

  /// Goes to the next line that is neither empty nor a comment.
  void next_line() {
    do {
      is_at_end_ = !lines_.next();
      line_ = trimmed(lines_.text);
    } while (!is_at_end_ && (line_.empty() || line_.starts_with("**")));
  }
  bool is_keyword() const { return !is_at_end_ && line_.starts_with('*'); }
  bool is_data() const { return !is_at_end_ && !line_.starts_with('*'); }

  void read_keyword() {
    keyword_.clear();
    parameters_.clear();
    for (bool goes_on = true; goes_on && !is_at_end_; next_line()) {
      goes_on = line_.ends_with(',');
      for (const std::string_view word : split(line_)) {
        const auto equals = word.find('=');
        const std::string key = upper(trimmed(word.substr(0, equals)));
        if (keyword_.empty())
          keyword_ = key;
        else
          parameters_[key] = equals == word.npos ? "" : trimmed(word.substr(equals + 1));
      }
    }
    if (keyword_ == "*NODE") {
      read_nodes();
    } else if (keyword_ == "*ELEMENT") {
      read_elements();
    } else if (keyword_ == "*NSET") {
      read_set(kNodes, parameter("NSET"));
    } else if (keyword_ == "*ELSET") {
      read_set(kElements, parameter("ELSET"));
    } else if (keyword_ == "*SURFACE") {
      read_surface();
    } else {
      follow_assembly();
    }
    while (is_data()) next_line();
  }

  /// Decks of Abaqus/CAE: one part that one instance takes as it is, else the numbers would not be those of the whole.
  void follow_assembly() {
    constexpr const char* kFlat =
        "a deck without parts: in Abaqus/CAE mdb.models[NAME].setValues(noPartsInputFile=ON) before it is written";
    if (keyword_ == "*PART" && ++num_parts_ > 1) fail("a second *PART", kFlat);
    if (keyword_ == "*ASSEMBLY") is_in_assembly_ = true;
    if (keyword_ == "*END ASSEMBLY") is_in_assembly_ = false;
    if (keyword_ == "*INSTANCE") {
      if (++num_instances_ > 1) fail("a second *INSTANCE", kFlat);
      if (is_data()) fail("an *INSTANCE that is moved", kFlat);
    }
    if (keyword_ == "*INCLUDE") fail("*INCLUDE", "the file that it names, as the mesh itself");
    for (const char* other : {"*NGEN", "*NFILL", "*NCOPY", "*NMAP", "*ELGEN", "*ELCOPY", "*SYSTEM"})
      if (keyword_ == other) fail(keyword_, "all nodes and elements written out, as pre-processors and Gmsh do");
  }

  /// Reference points of an assembly have numbers of their own, which no instance knows.
  bool is_of_assembly() const { return is_in_assembly_ && !parameters_.contains("INSTANCE"); }

  std::string parameter(const char* name) const {
    const auto found = parameters_.find(name);
    if (found == parameters_.end() || found->second.empty()) fail(keyword_ + " without " + name, std::string(name) + "=...");
    return found->second;
  }

  void read_nodes() {
    if (is_of_assembly()) return;
    if (parameters_.contains("SYSTEM") && upper(parameters_.at("SYSTEM")) != "R")
      fail("nodes in other coordinates", "SYSTEM=R");
    Set* set = parameters_.contains("NSET") ? &set_of(kNodes, parameter("NSET")) : nullptr;
    for (; is_data(); next_line()) {
      const std::vector<std::string_view> words = split(line_);
      if (words.size() < 3) fail(quoted_start(line_), "a number and 2 or 3 coordinates");
      const std::int64_t label = integer(words[0]);
      Vec<3> X = Vec<3>::Zero();
      for (std::size_t c = 0; c < 3 && c + 1 < words.size(); ++c) X[static_cast<int>(c)] = real(words[c + 1]);
      mesh_.add_node(label, X);
      labels_.insert(label);
      if (set) set->members.push_back({label, label, 1, "", "", lines_.number});
    }
  }

  ElementType find_type() const {
    const std::string type = upper(parameter("TYPE"));
    for (const ElementType& known : kTypes) {
      if (!type.starts_with(known.base)) continue;
      const std::string_view end = std::string_view(type).substr(std::string_view(known.base).size());
      if (std::all_of(end.begin(), end.end(), [](unsigned char c) { return std::isalpha(c); })) return known;
    }
    const std::string found = "elements of type " + type;
    const std::string expected = "C3D4, C3D10, CPS3, CPS6, CPE3 or CPE6, and triangles or lines on their surface";
    if (type.starts_with("CAX")) fail(found + " (axisymmetric)", expected);
    for (const char* other : {"C3D", "CPS", "CPE", "S4", "S8", "M3D", "R3D"})
      if (type.starts_with(other)) fail(found, expected + "; " + split_advice(file_));
    fail(found, expected + ": leave the block out if the model does without");
  }

  void read_elements() {
    const ElementType type = find_type();
    const std::size_t num_nodes = MeshBuilder::num_nodes_of(type.dim, type.is_second_order);
    Set* set = parameters_.contains("ELSET") ? &set_of(kElements, parameter("ELSET")) : nullptr;
    std::vector<std::int64_t> numbers;
    while (is_data()) {
      numbers.clear();
      const int first_line = lines_.number;
      while (is_data() && numbers.size() < num_nodes + 1) {
        for (const std::string_view word : split(line_)) numbers.push_back(integer(word));
        next_line();
      }
      if (numbers.size() != num_nodes + 1)
        lines_.fail_at(first_line, "an element of " + std::to_string(numbers.size() - 1) + " nodes",
                       std::to_string(num_nodes) + " of " + type.base);
      const std::int64_t label = numbers[0];
      const std::span<const std::int64_t> corners = std::span(numbers).subspan(1);
      if (type.is_second_order && type.dim > 1) middles_.insert(corners.begin() + type.dim + 1, corners.end());
      const bool is_late = type.dim == 1 && type.is_second_order;
      const int index = is_late ? -1 : mesh_.add_element(type.dim, corners, label);
      if (is_late) late_lines_.push_back({label, {corners[0], corners[1], corners[2]}});
      if (!elements_.try_emplace(label, Element{type.dim, index, type.is_shell}).second)
        lines_.fail_at(first_line, "element " + std::to_string(label) + " twice", "different element numbers");
      if (set) set->members.push_back({label, label, 1, "", "", first_line});
    }
  }

  /// Programs put the middle node of a line last or between its ends: it is the one that cells have in the middle.
  void add_lines_of_second_order() {
    for (auto& [label, line] : late_lines_) {
      if (middles_.contains(line[1])) std::swap(line[1], line[2]);
      const bool is_of_second_order = middles_.contains(line[2]);
      elements_.at(label).index = mesh_.add_element(1, std::span(line).first(is_of_second_order ? 3 : 2), label);
    }
  }

  void read_set(char kind, const std::string& name) {
    Set& set = set_of(kind, name);
    const bool is_generated = parameters_.contains("GENERATE"), is_left_out = is_of_assembly();
    for (; is_data(); next_line()) {
      const std::vector<std::string_view> words = split(line_);
      if (is_generated) {
        if (words.size() < 2 || words.size() > 3) fail(quoted_start(line_), "first, last and step");
        const std::int64_t step = words.size() > 2 ? integer(words[2]) : 1;
        if (step < 1) fail("a step of " + std::to_string(step), "at least 1");
        if (!is_left_out) set.members.push_back({integer(words[0]), integer(words[1]), step, "", "", lines_.number});
        continue;
      }
      for (const std::string_view word : words)
        if (!word.empty()) add_member(set, word, "", is_left_out);
    }
  }

  /// A label or the name of a set, after the name of an instance perhaps.
  void add_member(Set& set, std::string_view word, const std::string& face, bool is_left_out = false) {
    if (const auto dot = word.rfind('.'); dot != word.npos) word = word.substr(dot + 1);
    const bool is_label = !word.empty() && (std::isdigit(static_cast<unsigned char>(word.front())) || word.front() == '-');
    if (is_label && is_left_out) return;
    const std::int64_t label = is_label ? integer(word) : 0;
    set.members.push_back({label, label, 1, is_label ? "" : std::string(word), face, lines_.number});
  }

  void read_surface() {
    const std::string name = parameter("NAME");
    const std::string type = parameters_.contains("TYPE") ? upper(parameters_.at("TYPE")) : "ELEMENT";
    if (type != "ELEMENT" && type != "NODE") return;  // analytic ones, cut surfaces
    Set& set = set_of(type == "NODE" ? kNodes : kSurface, name);
    for (; is_data(); next_line()) {
      const std::vector<std::string_view> words = split(line_);
      if (words.empty()) continue;
      add_member(set, words[0], type == "NODE" || words.size() < 2 ? "" : upper(words[1]));
    }
  }

  static std::string key_of(char kind, std::string_view name) { return std::string(1, kind) + upper(name); }
  Set& set_of(char kind, const std::string& name) {
    const std::string key = key_of(kind, name);
    const auto [found, is_new] = sets_.try_emplace(key, Set{name, {}});
    if (is_new) order_.push_back(key);
    return found->second;
  }

  void add_group(const std::string& key) {
    const Set& set = sets_.at(key);
    if (key.front() == kNodes) {
      const int group = mesh_.group(0, 0, set.name);
      for_each_member(set, labels_, kNodes, [&](std::int64_t label, const Member&) { mesh_.add_member(group, label); });
    } else if (key.front() == kElements) {
      for_each_member(set, elements_, kElements, [&](const auto& entry, const Member&) {
        const Element& element = entry.second;
        mesh_.add_member(mesh_.group(element.dim, 0, set.name), element.index);
      });
    } else {
      for_each_member(set, elements_, kElements,
                      [&](const auto& entry, const Member& member) { add_face(set.name, entry.second, member); });
    }
  }

  static std::int64_t label_of(std::int64_t node) { return node; }
  static std::int64_t label_of(const std::pair<const std::int64_t, Element>& element) { return element.first; }

  /// f(entry of `all`, member that names it) for what the set and those in it contain.
  template <typename All, typename Function>
  void for_each_member(const Set& set, const All& all, char kind, const Function& f, const Member* outer = nullptr,
                       int depth = 0) const {
    constexpr int kMostDepth = 16;
    for (const Member& member : set.members) {
      if (!member.set.empty()) {
        const auto inner = sets_.find(key_of(kind, member.set));
        if (inner == sets_.end() || depth == kMostDepth)
          lines_.fail_at(member.line, itr::quoted(member.set),
                         kind == kNodes ? "the name of an NSET" : "the name of an ELSET");
        for_each_member(inner->second, all, kind, f, outer ? outer : &member, depth + 1);
        continue;
      }
      auto entry = all.lower_bound(member.first);
      if (member.first == member.last && (entry == all.end() || label_of(*entry) != member.first))
        lines_.fail_at(member.line, (kind == kNodes ? "node " : "element ") + std::to_string(member.first),
                       "one of the file");
      for (; entry != all.end() && label_of(*entry) <= member.last; ++entry)
        if ((label_of(*entry) - member.first) % member.step == 0) f(*entry, outer ? *outer : member);
    }
  }

  /// Faces of tetrahedra and triangles by corners. Without a face, all of them: the inner ones are no boundary.
  void add_face(const std::string& name, const Element& element, const Member& member) {
    static const std::vector<std::vector<int>> kFaces[] = {
        {}, {}, {{0, 1}, {1, 2}, {2, 0}}, {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}}};
    const auto refuse = [&] {
      lines_.fail_at(member.line, "the face " + itr::quoted(member.face),
                     element.is_shell   ? "SPOS or SNEG"
                     : element.dim == 3 ? "S1 to S4"
                                        : "S1 to S3");
    };
    const bool is_whole = element.is_shell && (member.face == "SPOS" || member.face == "SNEG" || member.face.empty());
    if (is_whole) return mesh_.add_member(mesh_.group(element.dim, 0, name), element.index);
    const auto& faces = kFaces[element.dim];
    const bool is_number = member.face.size() == 2 && member.face[0] == 'S' && member.face[1] >= '1' &&
                           member.face[1] - '1' < static_cast<int>(faces.size());
    if (faces.empty() || element.is_shell || !(is_number || member.face.empty())) refuse();
    for (std::size_t face = 0; face < faces.size(); ++face) {
      if (is_number && static_cast<int>(face) != member.face[1] - '1') continue;
      std::vector<std::int64_t> corners;
      for (const int corner : faces[face]) corners.push_back(mesh_.corners(element.dim, element.index)[corner]);
      mesh_.add_member(mesh_.group(element.dim - 1, 0, name), mesh_.add_element(element.dim - 1, corners, 0));
    }
  }

  std::int64_t integer(std::string_view word) const {
    const std::optional<std::int32_t> value = number_of<std::int32_t>(word);
    if (!value) fail(quoted_start(word), "an integer");
    return *value;
  }

  /// FORTRAN's exponents have a D.
  double real(std::string_view word) const {
    std::string text(word);
    std::replace_if(
        text.begin(), text.end(), [](char c) { return c == 'D' || c == 'd'; }, 'e');
    const std::optional<double> value = number_of<double>(text);
    if (!value) fail(quoted_start(word), "a number");
    return *value;
  }

  [[noreturn]] void fail(const std::string& found, const std::string& expected) const { lines_.fail(found, expected); }

  Lines lines_;
  std::string_view line_;  ///< without spaces around it
  MeshBuilder mesh_;
  const std::filesystem::path& file_;
  bool is_at_end_ = false, is_in_assembly_ = false;
  int num_parts_ = 0, num_instances_ = 0;
  std::string keyword_;
  std::map<std::string, std::string> parameters_;
  std::set<std::int64_t> labels_;  ///< of nodes
  std::map<std::int64_t, Element> elements_;
  std::unordered_set<std::int64_t> middles_;  ///< nodes at edges of cells of second order
  std::vector<std::pair<std::int64_t, std::array<std::int64_t, 3>>> late_lines_;
  std::map<std::string, Set> sets_;  ///< by kind and name in capitals
  std::vector<std::string> order_;   ///< keys of `sets_`, as they come
};

}  // namespace

MeshFile read_inp(std::string_view bytes, const std::filesystem::path& file) { return InpReader(bytes, file).read(); }

}  // namespace itr
