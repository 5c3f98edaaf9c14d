// SPDX-License-Identifier: MIT
// Medit's .mesh, text (P. Frey, "Medit", INRIA RT-0253): a keyword, a count, and rows that end with a reference number.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>

#include "cursor.hpp"
#include "readers.hpp"

namespace itr {

namespace {

/// A section with rows of so many vertices; those that are not read are passed over.
struct Section {
  std::string_view keyword;
  int vertices;
};
constexpr Section kSections[] = {{"Edges", 2}, {"Triangles", 3}, {"Tetrahedra", 4}};
constexpr std::string_view kOtherCells[] = {"Quadrilaterals", "Hexahedra", "Hexaedra", "Prisms", "Pyramids"};
constexpr Section kOthers[] = {
    {"Corners", 1}, {"RequiredVertices", 1}, {"Ridges", 1}, {"RequiredEdges", 1}, {"RequiredTriangles", 1}};

class MeditReader {
 public:
  MeditReader(std::string_view bytes, const std::filesystem::path& file) : in_(bytes, file), file_(file) {}

  MeshFile read() {
    if (in_.word() != "MeshVersionFormatted") in_.fail("another beginning", "MeshVersionFormatted (a text file)");
    in_.size();
    for (std::string_view keyword = next(); !keyword.empty() && keyword != "End"; keyword = next()) read_section(keyword);
    return std::move(mesh_);
  }

 private:
  /// The next keyword, behind comments.
  std::string_view next() {
    std::string_view word = in_.word();
    while (word.starts_with('#')) {
      in_.end_line();
      word = in_.word();
    }
    return word;
  }

  void read_section(std::string_view keyword) {
    if (keyword == "Dimension") {
      dimension_ = in_.size();
      if (dimension_ != 2 && dimension_ != 3) in_.fail(fmt::format("dimension {}", dimension_), "2 or 3");
      return;
    }
    if (keyword == "Vertices") return read_vertices();
    if (std::ranges::find(kOtherCells, keyword) != std::end(kOtherCells)) {
      if (in_.size() > 0) in_.fail(quoted(keyword), "triangles or tetrahedra; " + split_advice(file_));
      return;
    }
    for (const Section& section : kSections)
      if (keyword == section.keyword) return read_cells(section);
    for (const Section& other : kOthers)
      if (keyword == other.keyword) {
        const std::size_t count = in_.count(in_.size());
        for (std::size_t i = 0; i < count * static_cast<std::size_t>(other.vertices); ++i) in_.size();
        return;
      }
    in_.fail(quoted(keyword), "Dimension, Vertices, Edges, Triangles, Tetrahedra or End");
  }

  void read_vertices() {
    const std::size_t count = in_.count(in_.size());
    for (std::size_t v = 0; v < count; ++v) {
      Vec<3>& vertex = mesh_.vertices.emplace_back(Vec<3>::Zero());
      for (std::int64_t c = 0; c < dimension_; ++c) vertex[c] = in_.real();
      in_.real();  // its reference number
    }
  }

  void read_cells(const Section& section) {
    const std::size_t count = in_.count(in_.size());
    for (std::size_t i = 0; i < count; ++i) {
      std::array<int, 4> cell{};
      for (int k = 0; k < section.vertices; ++k) {
        const std::int64_t vertex = in_.size();
        if (vertex < 1 || vertex > std::int64_t{1} << 30) in_.fail(fmt::format("vertex {}", vertex), "an index, from 1");
        cell[static_cast<std::size_t>(k)] = static_cast<int>(vertex - 1);
      }
      add(section.vertices, cell, in_.text<std::int64_t>());
    }
  }

  void add(int vertices, const std::array<int, 4>& cell, std::int64_t reference) {
    const int number = reference > 0 && reference < std::int64_t{1} << 30 ? static_cast<int>(reference) : 0;
    int member = 0;
    if (vertices == 2) {
      member = static_cast<int>(mesh_.edges.size());
      mesh_.edges.push_back({cell[0], cell[1]});
    } else if (vertices == 3) {
      member = static_cast<int>(mesh_.triangles.size());
      mesh_.triangles.push_back({cell[0], cell[1], cell[2]});
      mesh_.triangle_body.push_back(number);
    } else {
      member = static_cast<int>(mesh_.tetrahedra.size());
      mesh_.tetrahedra.push_back(cell);
      mesh_.tetrahedron_body.push_back(number);
    }
    if (number == 0) return;
    for (MeshGroup& group : mesh_.groups)
      if (group.dim == vertices - 1 && group.number == number) return group.members.push_back(member);
    mesh_.groups.push_back({vertices - 1, number, {}, {member}});
  }

  Cursor in_;
  const std::filesystem::path& file_;
  std::int64_t dimension_ = 3;
  MeshFile mesh_;
};

}  // namespace

MeshFile read_medit(std::string_view bytes, const std::filesystem::path& file) { return MeditReader(bytes, file).read(); }

}  // namespace itr
