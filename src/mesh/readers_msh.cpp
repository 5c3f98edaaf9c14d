// SPDX-License-Identifier: MIT
// Gmsh .msh, versions 2.2 and 4.1, text and binary (https://gmsh.info/doc/texinfo/gmsh.html#MSH-file-format).
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <set>
#include <utility>

#include "cursor.hpp"
#include "mesh_builder.hpp"
#include "readers.hpp"

namespace itr {

namespace {

struct ElementType {
  int type, dim;
  bool is_second_order;
};
constexpr ElementType kTypes[] = {{15, 0, false}, {1, 1, false}, {2, 2, false}, {4, 3, false},
                                  {8, 1, true},   {9, 2, true},  {11, 3, true}};

/// Names other types.
std::string name_of(std::int64_t type) {
  constexpr std::pair<int, const char*> kNames[] = {{3, "quadrilateral"}, {5, "hexahedron"},     {6, "prism"},
                                                    {7, "pyramid"},       {10, "quadrilateral"}, {12, "hexahedron"},
                                                    {13, "prism"},        {14, "pyramid"},       {16, "quadrilateral"},
                                                    {17, "hexahedron"},   {18, "prism"},         {19, "pyramid"}};
  for (const auto& [known, name] : kNames)
    if (known == type) return name;
  return "";
}

class MshReader {
 public:
  MshReader(std::string_view bytes, const std::filesystem::path& file) : in_(bytes, file), mesh_(file), file_(file) {}

  MeshFile read() {
    if (in_.word() != "$MeshFormat") in_.fail("another beginning", "$MeshFormat");
    read_format();
    for (std::string_view section = in_.word(); !section.empty(); section = in_.word()) read_section(section);
    if (mesh_.num_nodes() == 0) in_.fail("no nodes", "a $Nodes section");
    mesh_.lists_elements_again = !is_new_;
    return mesh_.finish();
  }

 private:
  void read_format() {
    const std::string version(in_.word());
    if (version != "2.2" && version != "4.1")
      in_.fail("version '" + version + "'",
               "2.2 or 4.1 (`gmsh " + file_.filename().string() + " -save -format msh41 -o new.msh` writes that)");
    is_new_ = version == "4.1";
    const std::int64_t binary = in_.small(), size = in_.small();
    if (binary < 0 || binary > 1) in_.fail("file type " + std::to_string(binary), "0 (text) or 1 (binary)");
    if (size != 8) in_.fail("data size " + std::to_string(size), "8");
    in_.end_line();
    in_.binary = binary == 1;
    if (in_.binary && in_.small() != 1) in_.fail("another byte order", "that of this computer");
    in_.expect_end("MeshFormat");
  }

  void read_section(std::string_view section) {
    if (section.front() != '$') in_.fail(quoted_start(section), "a section, such as $Nodes");
    const std::string name(section.substr(1));
    const bool is_of_entities = name == "Entities" || name == "PartitionedEntities";
    const bool is_of_nodes = name == "Nodes" || name == "ParametricNodes";
    const bool is_read = name == "PhysicalNames" || is_of_nodes || name == "Elements" || (is_of_entities && is_new_);
    if (!is_read) return in_.skip_section(name);
    if (name == "PhysicalNames") {
      read_names();
    } else {
      if (in_.binary && is_new_) in_.end_line();
      if (is_of_entities) read_entities(name == "PartitionedEntities");
      if (is_of_nodes) is_new_ ? read_nodes_4() : read_nodes_2(name == "ParametricNodes");
      if (name == "Elements") is_new_ ? read_elements_4() : read_elements_2();
    }
    in_.expect_end(name);
  }

  /// Text in binary files, too.
  void read_names() {
    const bool binary = std::exchange(in_.binary, false);
    const std::size_t count = in_.count(in_.size());
    for (std::size_t i = 0; i < count; ++i) {
      const std::int64_t dim = in_.small(), number = in_.small();
      if (dim < 0 || dim > 3) in_.fail("dimension " + std::to_string(dim), "0 to 3");
      names_[{static_cast<int>(dim), number}] = in_.quoted_text();
    }
    in_.binary = binary;
  }

  void read_entities(bool is_partitioned) {
    if (is_partitioned) {
      in_.size();
      const std::size_t num_ghosts = in_.count(in_.size());
      for (std::size_t i = 0; i < 2 * num_ghosts; ++i) in_.small();
    }
    std::array<std::size_t, 4> counts;
    for (auto& count : counts) count = in_.count(in_.size());
    for (int dim = 0; dim < 4; ++dim)
      for (std::size_t i = 0; i < counts[dim]; ++i) read_entity(dim, is_partitioned);
  }

  void read_entity(int dim, bool is_partitioned) {
    const std::pair<int, std::int64_t> entity{dim, in_.small()};
    bool is_own = true;  // or what partitions of a larger one meet at, which has its groups
    if (is_partitioned) {
      const std::int64_t parent_dim = in_.small(), parent = in_.small();
      const std::size_t num_partitions = in_.count(in_.size());
      for (std::size_t i = 0; i < num_partitions; ++i) in_.small();
      if (parent_dim == dim) parent_[entity] = parent;
      is_own = parent_dim == dim;
      if (!is_own) is_between_partitions_.insert(entity);
    }
    for (int i = 0; i < (dim == 0 ? 3 : 6); ++i) in_.real();
    const std::size_t num_groups = in_.count(in_.size());
    for (std::size_t i = 0; i < num_groups; ++i) {
      const std::int64_t number = in_.small();
      if (is_own) groups_[entity].push_back(group(dim, number));
    }
    if (dim == 0) return;
    const std::size_t num_bounding = in_.count(in_.size());
    for (std::size_t i = 0; i < num_bounding; ++i) in_.small();
  }

  /// A number below 0 stands for the group, turned round.
  int group(int dim, std::int64_t number) {
    if (number < -2147483647 || number > 2147483647) in_.fail("the group " + std::to_string(number), "a smaller number");
    number = std::abs(number);
    const auto name = names_.find({dim, number});
    return mesh_.group(dim, static_cast<int>(number), name == names_.end() ? "" : name->second);
  }

  Vec<3> read_point() {
    Vec<3> point;
    for (int c = 0; c < 3; ++c) point[c] = in_.real();
    return point;
  }

  void read_nodes_2(bool is_parametric) {
    const std::size_t num_nodes = read_count_2();
    for (std::size_t i = 0; i < num_nodes; ++i) {
      const std::int64_t tag = in_.small();
      mesh_.add_node(tag, read_point());
      if (!is_parametric) continue;
      const std::int64_t dim = in_.small();
      in_.small();
      if (dim < 0 || dim > 3) in_.fail("entity dimension " + std::to_string(dim), "0 to 3");
      for (int c = 0; c < dim % 3; ++c) in_.real();  // on a curve one parameter, on a surface two
    }
  }

  void read_nodes_4() {
    const std::size_t num_blocks = in_.count(in_.size());
    for (int i = 0; i < 3; ++i) in_.size();
    std::vector<std::int64_t> tags;
    for (std::size_t block = 0; block < num_blocks; ++block) {
      const std::int64_t dim = in_.small();
      in_.small();
      const bool is_parametric = in_.small() != 0;
      if (dim < 0 || dim > 3) in_.fail("entity dimension " + std::to_string(dim), "0 to 3");
      tags.resize(in_.count(in_.size()));
      for (std::int64_t& tag : tags) tag = in_.size();
      for (const std::int64_t tag : tags) {
        mesh_.add_node(tag, read_point());
        for (int c = 0; is_parametric && c < dim; ++c) in_.real();
      }
    }
  }

  /// In 2.2 a section begins with its count in text, also in binary files.
  std::size_t read_count_2() {
    const bool binary = std::exchange(in_.binary, false);
    const std::size_t count = in_.count(in_.size());
    in_.end_line();
    in_.binary = binary;
    return count;
  }

  void read_elements_2() {
    const std::size_t num_elements = read_count_2();
    for (std::size_t done = 0; done < num_elements;) {
      std::size_t num_here = 1, num_tags = 0;
      std::int64_t type = 0, number = 0;
      if (in_.binary) {
        type = in_.small(), num_here = in_.count(in_.small()), num_tags = in_.count(in_.small());
        if (num_here == 0) in_.fail("an empty block of elements", "at least one");
      }
      for (std::size_t i = 0; i < num_here; ++i) {
        number = in_.small();
        if (!in_.binary) type = in_.small(), num_tags = in_.count(in_.small());
        std::int64_t body = 0;
        for (std::size_t tag = 0; tag < num_tags; ++tag) {
          const std::int64_t value = in_.small();
          if (tag == 0) body = value;
        }
        const ElementType& known = find_type(type, number);
        here_.clear();
        if (body != 0) here_.push_back(group(known.dim, body));
        read_element(known, number);
      }
      done += num_here;
    }
  }

  void read_elements_4() {
    const std::size_t num_blocks = in_.count(in_.size());
    for (int i = 0; i < 3; ++i) in_.size();
    for (std::size_t block = 0; block < num_blocks; ++block) {
      const std::int64_t dim = in_.small(), tag = in_.small(), type = in_.small();
      const std::size_t num_elements = in_.count(in_.size());
      const std::pair<int, std::int64_t> entity{static_cast<int>(dim), tag};
      here_ = groups_of(entity);
      for (std::size_t i = 0; i < num_elements; ++i) {
        const std::int64_t number = in_.size();
        const ElementType& known = find_type(type, number);
        if (!here_.empty() && known.dim != dim)
          in_.fail("element " + std::to_string(number) + " of type " + std::to_string(type) + " in an entity of dimension " +
                       std::to_string(dim),
                   "elements of that dimension");
        read_element(known, number, is_between_partitions_.contains(entity));
      }
    }
  }

  /// Takes those of the whole for a part of an entity.
  const std::vector<int>& groups_of(const std::pair<int, std::int64_t>& entity) const {
    static const std::vector<int> none;
    auto found = groups_.find(entity);
    if (const auto whole = parent_.find(entity); found == groups_.end() && whole != parent_.end())
      found = groups_.find({entity.first, whole->second});
    return found == groups_.end() ? none : found->second;
  }

  const ElementType& find_type(std::int64_t type, std::int64_t number) const {
    const auto found =
        std::find_if(std::begin(kTypes), std::end(kTypes), [&](const ElementType& t) { return t.type == type; });
    if (found != std::end(kTypes)) return *found;
    const std::string name = name_of(type);
    in_.fail(
        "element " + std::to_string(number) + " of type " + std::to_string(type) + (name.empty() ? "" : " (" + name + ")"),
        "1 (line), 2 (triangle), 4 (tetrahedron), 15 (point), or 8, 9, 11 (the same of second order)" +
            (name.empty() ? "" : "; " + split_advice(file_)));
  }

  /// An element belongs to the groups `here_`. What partitions meet at is left out: no entity of the model is there.
  void read_element(const ElementType& type, std::int64_t number, bool is_left_out = false) {
    nodes_.resize(MeshBuilder::num_nodes_of(type.dim, type.is_second_order));
    for (std::int64_t& tag : nodes_) tag = is_new_ ? in_.size() : in_.small();
    if (is_left_out) return;
    if (nodes_.size() == 10) std::swap(nodes_[8], nodes_[9]);
    const std::int64_t member = type.dim == 0 ? nodes_[0] : mesh_.add_element(type.dim, nodes_, number);
    for (const int group : here_) mesh_.add_member(group, member);
  }

  Cursor in_;
  MeshBuilder mesh_;
  const std::filesystem::path& file_;
  bool is_new_ = false;
  std::vector<std::int64_t> nodes_;  ///< of the element that is read
  std::vector<int> here_;            ///< groups that it belongs to
  using Entity = std::pair<int, std::int64_t>;
  std::map<Entity, std::string> names_;        ///< by dimension and number of a group
  std::map<Entity, std::vector<int>> groups_;  ///< by dimension and tag of an entity
  std::map<Entity, std::int64_t> parent_;      ///< of the parts of entities
  std::set<Entity> is_between_partitions_;
};

}  // namespace

MeshFile read_msh(std::string_view bytes, const std::filesystem::path& file) { return MshReader(bytes, file).read(); }

}  // namespace itr
