// SPDX-License-Identifier: MIT
// Gmsh .msh, versions 2.2 and 4.1, text and binary (https://gmsh.info/doc/texinfo/gmsh.html#MSH-file-format).
#include <algorithm>
#include <cstdint>
#include <map>
#include <unordered_map>
#include <utility>

#include "cursor.hpp"
#include "readers.hpp"

namespace itr {

namespace {

/// " (quadrilateral)" of types that other programs mesh with.
std::string name_of(int type) {
  constexpr std::pair<int, const char*> kNames[] = {{3, "quadrilateral"},  {5, "hexahedron"},     {6, "prism"},
                                                    {7, "pyramid"},        {10, "quadrilateral"}, {12, "hexahedron"},
                                                    {16, "quadrilateral"}, {17, "hexahedron"}};
  for (const auto& [known, name] : kNames)
    if (known == type) return std::string(" (") + name + ")";
  return "";
}

class MshReader {
 public:
  MshReader(std::string_view bytes, const std::filesystem::path& file) : in_(bytes, file), file_(file) {}

  MeshFile read() {
    if (in_.word() != "$MeshFormat") in_.fail("another beginning", "$MeshFormat");
    read_format();
    for (std::string_view section = in_.word(); !section.empty(); section = in_.word()) read_section(section);
    if (tags_.empty()) in_.fail("no nodes", "a $Nodes section");
    number_nodes();
    return std::move(mesh_);
  }

 private:
  void read_format() {
    const std::string version(in_.word());
    if (version != "2.2" && version != "4.1") in_.fail("version '" + version + "'", "2.2 or 4.1");
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
    if (section.front() != '$') in_.fail(quoted(section.substr(0, 40)), "a section, such as $Nodes");
    const std::string name(section.substr(1));
    if (name != "Entities" && name != "Nodes" && name != "Elements") return in_.skip_section(name);
    if (name == "Entities" && !is_new_) return in_.skip_section(name);
    if (in_.binary && is_new_) in_.end_line();
    if (name == "Entities") read_entities();
    if (name == "Nodes") is_new_ ? read_nodes_4() : read_nodes_2();
    if (name == "Elements") is_new_ ? read_elements_4() : read_elements_2();
    in_.expect_end(name);
  }

  void read_entities() {
    std::array<std::size_t, 4> counts;
    for (auto& count : counts) count = in_.count(in_.size());
    for (int dim = 0; dim < 4; ++dim)
      for (std::size_t i = 0; i < counts[dim]; ++i) read_entity(dim);
  }

  void read_entity(int dim) {
    const std::int64_t tag = in_.small();
    for (int i = 0; i < (dim == 0 ? 3 : 6); ++i) in_.real();
    const std::size_t num_groups = in_.count(in_.size());
    for (std::size_t i = 0; i < num_groups; ++i) {
      const std::int64_t group = in_.small();
      if (i == 0) group_[{dim, tag}] = static_cast<int>(group);
    }
    if (dim == 0) return;
    const std::size_t num_bounding = in_.count(in_.size());
    for (std::size_t i = 0; i < num_bounding; ++i) in_.small();
  }

  void read_point() {
    for (int c = 0; c < 3; ++c) point_[c] = in_.real();
    mesh_.vertices.push_back(point_);
  }

  void read_nodes_2() {
    const std::size_t num_nodes = read_count_2();
    for (std::size_t i = 0; i < num_nodes; ++i) {
      tags_.push_back(in_.small());
      read_point();
    }
  }

  void read_nodes_4() {
    const std::size_t num_blocks = in_.count(in_.size());
    for (int i = 0; i < 3; ++i) in_.size();
    for (std::size_t block = 0; block < num_blocks; ++block) {
      const std::int64_t dim = in_.small();
      in_.small();
      const bool is_parametric = in_.small() != 0;
      if (dim < 0 || dim > 3) in_.fail("entity dimension " + std::to_string(dim), "0 to 3");
      const std::size_t num_nodes = in_.count(in_.size());
      for (std::size_t i = 0; i < num_nodes; ++i) tags_.push_back(in_.size());
      for (std::size_t i = 0; i < num_nodes; ++i) {
        read_point();
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
        read_element(type, number, static_cast<int>(body));
      }
      done += num_here;
    }
  }

  void read_elements_4() {
    const std::size_t num_blocks = in_.count(in_.size());
    for (int i = 0; i < 3; ++i) in_.size();
    for (std::size_t block = 0; block < num_blocks; ++block) {
      const std::int64_t dim = in_.small(), entity = in_.small(), type = in_.small();
      const std::size_t num_elements = in_.count(in_.size());
      const auto group = group_.find({static_cast<int>(dim), entity});
      const int body = group == group_.end() ? 0 : group->second;
      for (std::size_t i = 0; i < num_elements; ++i) {
        const std::int64_t number = in_.size();
        read_element(type, number, body);
      }
    }
  }

  void read_element(std::int64_t type, std::int64_t number, int body) {
    switch (type) {
      case 15:
        read_node_tags<1>();
        return;
      case 1:
        edges_.push_back(read_node_tags<2>());
        return;
      case 2:
        triangles_.push_back(read_node_tags<3>()), mesh_.triangle_body.push_back(body);
        return;
      case 4:
        tetrahedra_.push_back(read_node_tags<4>()), mesh_.tetrahedron_body.push_back(body);
        return;
      case 8:
        edges_.push_back(read_second_order<2, 1>({{{0, 1}}}));
        return;
      case 9:
        triangles_.push_back(read_second_order<3, 3>({{{0, 1}, {1, 2}, {2, 0}}}));
        mesh_.triangle_body.push_back(body);
        return;
      case 11:
        tetrahedra_.push_back(read_second_order<4, 6>({{{0, 1}, {1, 2}, {2, 0}, {3, 0}, {2, 3}, {1, 3}}}));
        mesh_.tetrahedron_body.push_back(body);
        return;
      default:
        in_.fail("element " + std::to_string(number) + " of type " + std::to_string(type) + name_of(type),
                 "1 (line), 2 (triangle), 4 (tetrahedron), 15 (point), or 8, 9, 11 (the same of second order)");
    }
  }

  /// The corners of an element of second order; its other nodes are kept aside.
  template <std::size_t Corners, std::size_t Edges>
  std::array<std::int64_t, Corners> read_second_order(const std::array<std::array<int, 2>, Edges>& edges) {
    const auto tags = read_node_tags<Corners>();
    const auto middles = read_node_tags<Edges>();
    for (std::size_t e = 0; e < Edges; ++e) middles_.push_back({tags[edges[e][0]], tags[edges[e][1]], middles[e]});
    return tags;
  }

  template <std::size_t N>
  std::array<std::int64_t, N> read_node_tags() {
    std::array<std::int64_t, N> tags;
    for (auto& tag : tags) tag = is_new_ ? in_.size() : in_.small();
    return tags;
  }

  /// Node tags 1..n are positions; otherwise nodes are numbered as they come.
  void number_nodes() {
    const auto n = static_cast<std::int64_t>(tags_.size());
    const auto [least, greatest] = std::minmax_element(tags_.begin(), tags_.end());
    const bool is_dense = *least == 1 && *greatest == n;
    std::unordered_map<std::int64_t, int> index;
    index.reserve(tags_.size());
    for (std::int64_t i = 0; i < n; ++i)
      if (!index.emplace(tags_[i], static_cast<int>(is_dense ? tags_[i] - 1 : i)).second)
        throw InputError(
            {file_.string(), "$Nodes", "node " + std::to_string(tags_[i]) + " twice", "different node numbers"});
    if (is_dense) sort_vertices();
    renumber(edges_, mesh_.edges, index);
    renumber(triangles_, mesh_.triangles, index);
    renumber(tetrahedra_, mesh_.tetrahedra, index);
    if (!middles_.empty()) drop_middles(index);
  }

  /// The library's meshes are straight at rest: of a file of second order the corners say all, or it is refused.
  void drop_middles(const std::unordered_map<std::int64_t, int>& index) {
    constexpr double kTolerance = 1e-6;  // of the edge's length: digits of text files
    std::vector<std::array<int, 3>> middles;
    renumber(middles_, middles, index);
    std::vector<char> is_middle(mesh_.vertices.size(), 0);
    for (std::size_t i = 0; i < middles.size(); ++i) {
      const auto [a, b, m] = middles[i];
      const Vec<3>&A = mesh_.vertices[a], &B = mesh_.vertices[b];
      is_middle[m] = 1;
      if (const double off = (mesh_.vertices[m] - (A + B) / 2).norm(); !(off <= kTolerance * (B - A).norm()))
        throw InputError({file_.string(), "node " + std::to_string(middles_[i][2]),
                          std::to_string(off) + " off the middle of its edge",
                          "a mesh whose edges are straight at rest (curved ones are not supported)"});
    }
    std::vector<int> place(mesh_.vertices.size(), -1);
    std::size_t kept = 0;
    for (std::size_t v = 0; v < place.size(); ++v) {
      if (is_middle[v]) continue;
      place[v] = static_cast<int>(kept);
      mesh_.vertices[kept++] = mesh_.vertices[v];
    }
    mesh_.vertices.resize(kept);
    move_ids(mesh_.edges, place);
    move_ids(mesh_.triangles, place);
    move_ids(mesh_.tetrahedra, place);
  }

  template <std::size_t N>
  void move_ids(std::vector<std::array<int, N>>& rows, const std::vector<int>& place) const {
    for (auto& row : rows)
      for (int& v : row) {
        if (place[v] < 0)
          throw InputError({file_.string(), "$Elements", "a node that is a corner here and in the middle of an edge there",
                            "one of both"});
        v = place[v];
      }
  }

  void sort_vertices() {
    std::vector<Vec<3>> sorted(mesh_.vertices.size());
    for (std::size_t i = 0; i < sorted.size(); ++i) sorted[static_cast<std::size_t>(tags_[i] - 1)] = mesh_.vertices[i];
    mesh_.vertices = std::move(sorted);
  }

  template <std::size_t N>
  void renumber(const std::vector<std::array<std::int64_t, N>>& from, std::vector<std::array<int, N>>& to,
                const std::unordered_map<std::int64_t, int>& index) {
    to.resize(from.size());
    for (std::size_t i = 0; i < from.size(); ++i)
      for (std::size_t k = 0; k < N; ++k) {
        const auto found = index.find(from[i][k]);
        if (found == index.end())
          throw InputError(
              {file_.string(), "$Elements", "node " + std::to_string(from[i][k]), "a node of the $Nodes section"});
        to[i][k] = found->second;
      }
  }

  Cursor in_;
  const std::filesystem::path& file_;
  bool is_new_ = false;
  Vec<3> point_;
  MeshFile mesh_;
  std::vector<std::int64_t> tags_;  ///< of the nodes, as they come
  std::vector<std::array<std::int64_t, 2>> edges_;
  std::vector<std::array<std::int64_t, 3>> triangles_;
  std::vector<std::array<std::int64_t, 4>> tetrahedra_;
  std::vector<std::array<std::int64_t, 3>> middles_;   ///< of elements of second order: ends of an edge, its node
  std::map<std::pair<int, std::int64_t>, int> group_;  ///< (dimension, entity) -> first physical group
};

}  // namespace

MeshFile read_msh(std::string_view bytes, const std::filesystem::path& file) { return MshReader(bytes, file).read(); }

}  // namespace itr
