// SPDX-License-Identifier: MIT
// One body, written in all formats of mesh files.
#pragma once

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace itr {

template <typename T>
std::string raw(T value) {
  return {reinterpret_cast<const char*>(&value), sizeof(value)};
}
template <typename T>
std::string big(T value) {
  std::string bytes = raw(value);
  return {bytes.rbegin(), bytes.rend()};
}

inline std::string base64(const std::string& bytes) {
  constexpr const char* kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < count ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) text += k <= count ? kDigits[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

/// Two cubes side by side, of six tetrahedra each: bodies "left" (1) and "right" (2), surfaces "foot" (11) at x = 0 and
/// "head" (12) at x = 2. Corners of cells and facets are counted from 0.
struct Bar {
  std::vector<std::array<double, 3>> points;
  std::vector<std::array<int, 4>> cells;
  std::vector<int> body;
  std::vector<std::array<int, 3>> facets;
  std::vector<int> side;

  Bar() {
    for (int x = 0; x < 3; ++x)
      for (int y = 0; y < 2; ++y)
        for (int z = 0; z < 2; ++z) points.push_back({x + 0.0, y + 0.125 * x, z + 0.0});
    for (int x = 0; x < 2; ++x)
      for (const auto& [a, b] : {std::array{1, 3}, {3, 2}, {2, 6}, {6, 4}, {4, 5}, {5, 1}}) {
        cells.push_back({4 * x, 4 * x + b, 4 * x + a, 4 * x + 7});
        body.push_back(x + 1);
      }
    for (const int x : {0, 2}) {
      const int diagonal = 4 * x + 3;
      for (const int corner : {1, 2}) {
        facets.push_back({4 * x, 4 * x + corner, diagonal});
        side.push_back(x == 0 ? 11 : 12);
      }
    }
  }
  /// Nodes at the middles of edges, after the vertices; by ends.
  std::map<std::array<int, 2>, int> middles() const {
    std::map<std::array<int, 2>, int> all;
    for (const auto& cell : cells)
      for (const int a : cell)
        for (const int b : cell)
          if (a < b) all.try_emplace({a, b}, 0);
    int next = static_cast<int>(points.size());
    for (auto& [edge, node] : all) node = next++;
    return all;
  }
};

inline std::string name_of(int number) {
  return number == 1 ? "left" : number == 2 ? "right" : number == 11 ? "foot" : "head";
}

inline std::string msh22(const Bar& bar, bool is_binary) {
  std::ostringstream out;
  const auto whole = [&](int value) { is_binary ? out << raw(std::int32_t{value}) : out << value << ' '; };
  const auto real = [&](double value) { is_binary ? out << raw(value) : out << value << ' '; };
  out << "$MeshFormat\n2.2 " << is_binary << " 8\n" << (is_binary ? raw(std::int32_t{1}) + "\n" : "") << "$EndMeshFormat\n";
  out << "$PhysicalNames\n4\n2 11 \"foot\"\n2 12 \"head\"\n3 1 \"left\"\n3 2 \"right\"\n$EndPhysicalNames\n";
  out << "$Nodes\n" << bar.points.size() << "\n";
  for (std::size_t i = 0; i < bar.points.size(); ++i) {
    whole(static_cast<int>(i) + 1);
    for (const double x : bar.points[i]) real(x);
    if (!is_binary) out << '\n';
  }
  out << "\n$EndNodes\n$Elements\n" << bar.cells.size() + bar.facets.size() << "\n";
  int number = 0;
  const auto write = [&](int type, int group, const auto& nodes) {
    if (is_binary) whole(type), whole(1), whole(2);
    whole(++number);
    if (!is_binary) whole(type), whole(2);
    whole(group), whole(1);
    for (const int v : nodes) whole(v + 1);
    if (!is_binary) out << '\n';
  };
  for (std::size_t f = 0; f < bar.facets.size(); ++f) write(2, bar.side[f], bar.facets[f]);
  for (std::size_t c = 0; c < bar.cells.size(); ++c) write(4, bar.body[c], bar.cells[c]);
  out << "\n$EndElements\n";
  return out.str();
}

/// In partitions, entity 3 and 4 are parts of the volumes 1 and 2.
inline std::string msh41(const Bar& bar, bool is_binary, bool is_partitioned = false) {
  std::ostringstream out;
  const auto whole = [&](int value) { is_binary ? out << raw(std::int32_t{value}) : out << value << ' '; };
  const auto size = [&](std::size_t value) { is_binary ? out << raw(std::uint64_t{value}) : out << value << ' '; };
  const auto real = [&](double value) { is_binary ? out << raw(value) : out << value << ' '; };
  const auto box = [&] {
    for (const double x : {0., 0., 0., 2., 1., 1.}) real(x);
  };
  const auto line = [&] {
    if (!is_binary) out << '\n';
  };
  out << "$MeshFormat\n4.1 " << is_binary << " 8\n" << (is_binary ? raw(std::int32_t{1}) + "\n" : "") << "$EndMeshFormat\n";
  out << "$PhysicalNames\n4\n2 11 \"foot\"\n2 12 \"head\"\n3 1 \"left\"\n3 2 \"right\"\n$EndPhysicalNames\n$Entities\n";
  size(0), size(0), size(2), size(2), line();
  for (const int side : {11, 12}) whole(side), box(), size(1), whole(-side), size(0), line();
  for (const int body : {1, 2}) whole(body), box(), size(1), whole(body), size(0), line();
  out << "\n$EndEntities\n";
  if (is_partitioned) {
    out << "$PartitionedEntities\n";
    size(2), size(0), size(0), size(0), size(1), size(2), line();
    whole(99), whole(3), whole(1), size(2), whole(1), whole(2), box(), size(0), size(0), line();  // between the partitions
    for (const int body : {1, 2})
      whole(body + 2), whole(3), whole(body), size(1), whole(body), box(), size(0), size(0), line();
    out << "\n$EndPartitionedEntities\n";
  }
  out << "$Nodes\n";
  size(1), size(bar.points.size()), size(1), size(bar.points.size()), line();
  whole(3), whole(1), whole(0), size(bar.points.size()), line();
  for (std::size_t i = 0; i < bar.points.size(); ++i) size(i + 1), line();
  for (const auto& X : bar.points) {
    for (const double x : X) real(x);
    line();
  }
  out << "\n$EndNodes\n$Elements\n";
  const std::size_t blocks = is_partitioned ? 5 : 4;
  size(blocks), size(bar.cells.size() + bar.facets.size()), size(1), size(99), line();
  std::size_t number = 0;
  for (const int entity : {11, 12, 1, 2}) {
    const int dim = entity > 10 ? 2 : 3;
    const auto count =
        std::count(dim == 2 ? bar.side.begin() : bar.body.begin(), dim == 2 ? bar.side.end() : bar.body.end(), entity);
    whole(dim), whole(dim == 3 && is_partitioned ? entity + 2 : entity), whole(dim == 2 ? 2 : 4), size(count), line();
    const auto write = [&](const auto& nodes) {
      size(++number);
      for (const int v : nodes) size(v + 1);
      line();
    };
    for (std::size_t i = 0; dim == 2 && i < bar.side.size(); ++i)
      if (bar.side[i] == entity) write(bar.facets[i]);
    for (std::size_t i = 0; dim == 3 && i < bar.body.size(); ++i)
      if (bar.body[i] == entity) write(bar.cells[i]);
  }
  if (is_partitioned) {
    whole(2), whole(99), whole(2), size(1), line();
    size(++number), size(5), size(6), size(7), line();
  }
  out << "\n$EndElements\n";
  return out.str();
}

inline std::string inp(const Bar& bar, bool is_second_order, const std::string& extra = "") {
  std::ostringstream out;
  out.precision(17);
  out << "*HEADING\n a bar\n** a comment\n*Node, NSET=Nall\n";
  for (std::size_t i = 0; i < bar.points.size(); ++i)
    out << i + 1 << ", " << bar.points[i][0] << ", " << bar.points[i][1] << ", " << bar.points[i][2] << "\n";
  const auto middles = bar.middles();
  if (is_second_order)
    for (const auto& [edge, node] : middles) {
      out << node + 1;
      for (int c = 0; c < 3; ++c) out << ", " << (bar.points[edge[0]][c] + bar.points[edge[1]][c]) / 2;
      out << "\n";
    }
  constexpr int kEdges[][2] = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};
  for (const int body : {1, 2}) {
    out << "*ELEMENT, TYPE=" << (is_second_order ? "C3D10" : "C3D4") << ",\n ELSET=" << name_of(body) << "\n";
    for (std::size_t c = 0; c < bar.cells.size(); ++c) {
      if (bar.body[c] != body) continue;
      out << c + 1;
      for (const int v : bar.cells[c]) out << ", " << v + 1;
      if (is_second_order) out << ",\n";
      for (int e = 0; is_second_order && e < 6; ++e) {
        const int a = bar.cells[c][kEdges[e][0]], b = bar.cells[c][kEdges[e][1]];
        out << (e ? ", " : "") << middles.at({std::min(a, b), std::max(a, b)}) + 1;
      }
      out << "\n";
    }
  }
  out << extra;
  return out.str();
}

/// The foot as a set of nodes and the head as faces of elements.
inline std::string inp_sets(const Bar& bar) {
  constexpr int kFaces[][3] = {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}};
  std::ostringstream out;
  out << "*NSET, NSET=foot, GENERATE\n1, 4, 1\n*ELSET, ELSET=last\n";
  std::string faces;
  for (std::size_t c = 0; c < bar.cells.size(); ++c)
    for (int face = 0; face < 4; ++face) {
      const bool is_at_head = std::all_of(kFaces[face], kFaces[face] + 3, [&](int k) { return bar.cells[c][k] >= 8; });
      if (is_at_head) faces += std::to_string(c + 1) + ", S" + std::to_string(face + 1) + "\n";
    }
  out << "1, 2,\n*SURFACE, NAME=head, TYPE=ELEMENT\n"
      << faces << "*MATERIAL, NAME=steel\n*ELASTIC\n210000., 0.3\n*STEP\n*END STEP\n";
  return out.str();
}

inline std::string vtk(const Bar& bar, bool is_binary, bool has_offsets) {
  std::ostringstream out;
  const auto whole = [&](int value) { is_binary ? out << big(std::int32_t{value}) : out << value << ' '; };
  const auto real = [&](double value) { is_binary ? out << big(value) : out << value << ' '; };
  const std::size_t count = bar.facets.size() + bar.cells.size();
  out << "# vtk DataFile Version " << (has_offsets ? "5.1" : "3.0") << "\na bar\n" << (is_binary ? "BINARY" : "ASCII");
  out << "\nDATASET UNSTRUCTURED_GRID\nPOINTS " << bar.points.size() << " double\n";
  for (const auto& X : bar.points)
    for (const double x : X) real(x);
  const std::size_t nodes = 3 * bar.facets.size() + 4 * bar.cells.size();
  if (has_offsets) {
    const auto id = [&](std::int64_t value) { is_binary ? out << big(value) : out << value << ' '; };
    out << "\nCELLS " << count + 1 << ' ' << nodes << "\nOFFSETS vtktypeint64\n";
    std::int64_t end = 0;
    id(0);
    for (std::size_t i = 0; i < count; ++i) id(end += i < bar.facets.size() ? 3 : 4);
    out << "\nCONNECTIVITY vtktypeint64\n";
    for (const auto& facet : bar.facets)
      for (const int v : facet) id(v);
    for (const auto& cell : bar.cells)
      for (const int v : cell) id(v);
  } else {
    out << "\nCELLS " << count << ' ' << nodes + count << "\n";
    for (const auto& facet : bar.facets) {
      whole(3);
      for (const int v : facet) whole(v);
    }
    for (const auto& cell : bar.cells) {
      whole(4);
      for (const int v : cell) whole(v);
    }
  }
  out << "\nCELL_TYPES " << count << "\n";
  for (std::size_t i = 0; i < count; ++i) whole(i < bar.facets.size() ? 5 : 10);
  out << "\nPOINT_DATA " << bar.points.size() << "\nVECTORS u double\n";
  for (std::size_t i = 0; i < 3 * bar.points.size(); ++i) real(0);
  out << "\nMETADATA\nINFORMATION 0\n\nCELL_DATA " << count << "\nSCALARS body int 1\nLOOKUP_TABLE default\n";
  for (const auto* ids : {&bar.side, &bar.body})
    for (const int id : *ids) whole(id);
  out << "\nFIELD FieldData 4\n";
  for (const int number : {1, 2, 11, 12}) {
    out << "set:" << name_of(number) << " 1 " << count << " int\n";
    for (const auto* ids : {&bar.side, &bar.body})
      for (const int id : *ids) whole(id == number);
    out << "\n";
  }
  return out.str();
}

enum class Xml { text, base64, compressed, appended, appended_base64 };

inline std::string vtu(const Bar& bar, Xml form) {
  std::string appended;
  const auto encoded = [&](const std::string& bytes) {
    if (form != Xml::compressed) return raw(static_cast<std::uint64_t>(bytes.size())) + bytes;
    constexpr std::size_t kBlock = 64;
    std::string head, blocks;
    std::uint64_t count = 0;
    for (std::size_t at = 0; at < bytes.size(); at += kBlock, ++count) {
      const std::string block = bytes.substr(at, kBlock);
      uLongf length = compressBound(block.size());
      std::string packed(length, '\0');
      compress(reinterpret_cast<Bytef*>(packed.data()), &length, reinterpret_cast<const Bytef*>(block.data()), block.size());
      blocks += packed.substr(0, length);
      head += raw(std::uint64_t{length});
    }
    const std::uint64_t last = bytes.size() % kBlock;
    return base64(raw(count) + raw(std::uint64_t{kBlock}) + raw(last) + head) + base64(blocks);
  };
  const auto array = [&]<typename T>(const std::string& name, const char* type, const std::vector<T>& values,
                                     int components) {
    std::ostringstream out;
    std::string bytes;
    for (const T& value : values) bytes += raw(value);
    out << "<DataArray type=\"" << type << "\" Name=\"" << name << "\" NumberOfComponents=\"" << components
        << "\" format=\"";
    if (form == Xml::text) {
      out << "ascii\">\n";
      for (const T& value : values) out << +value << '\n';
    } else if (form == Xml::base64) {
      out << "binary\">" << base64(encoded(bytes));
    } else if (form == Xml::compressed) {
      out << "binary\">\n" << encoded(bytes) << "\n";
    } else {
      out << "appended\" offset=\"" << appended.size() << "\">";
      appended += form == Xml::appended ? encoded(bytes) : base64(encoded(bytes));
    }
    out << "</DataArray>\n";
    return out.str();
  };
  std::vector<double> points;
  for (const auto& X : bar.points) points.insert(points.end(), X.begin(), X.end());
  std::vector<std::int64_t> nodes, ends;
  std::vector<std::uint8_t> types;
  for (const auto& facet : bar.facets) {
    nodes.insert(nodes.end(), facet.begin(), facet.end());
    ends.push_back(static_cast<std::int64_t>(nodes.size())), types.push_back(5);
  }
  for (const auto& cell : bar.cells) {
    nodes.insert(nodes.end(), cell.begin(), cell.end());
    ends.push_back(static_cast<std::int64_t>(nodes.size())), types.push_back(10);
  }
  std::string data;
  for (const int number : {1, 2, 11, 12}) {
    std::vector<std::uint8_t> is_in;
    for (const auto* ids : {&bar.side, &bar.body})
      for (const int id : *ids) is_in.push_back(id == number);
    data += array("set:" + name_of(number), "UInt8", is_in, 1);
  }
  std::ostringstream out;
  out << "<?xml version=\"1.0\"?>\n<!-- a bar, 2 > 1 -->\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" "
         "byte_order=\"LittleEndian\" "
      << "header_type=\"UInt64\"" << (form == Xml::compressed ? " compressor=\"vtkZLibDataCompressor\"" : "")
      << ">\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"" << bar.points.size() << "\" NumberOfCells=\"" << ends.size()
      << "\">\n<CellData>\n"
      << data << "</CellData>\n<Points>\n"
      << array("Points", "Float64", points, 3) << "</Points>\n<Cells>\n"
      << array("connectivity", "Int64", nodes, 1) << array("offsets", "Int64", ends, 1) << array("types", "UInt8", types, 1)
      << "</Cells>\n</Piece>\n</UnstructuredGrid>\n";
  if (!appended.empty())
    out << "<AppendedData encoding=\"" << (form == Xml::appended ? "raw" : "base64") << "\">\n_" << appended
        << "\n</AppendedData>\n";
  out << "</VTKFile>\n";
  return out.str();
}

/// A cube's surface of twelve triangles as STL; the last one is left out where it is open.
inline std::string stl(bool is_binary, bool is_open, double noise = 0) {
  constexpr int kFaces[][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  std::vector<std::array<int, 3>> triangles;
  for (const auto& f : kFaces) triangles.insert(triangles.end(), {{f[0], f[1], f[2]}, {f[0], f[2], f[3]}});
  if (is_open) triangles.pop_back();
  std::ostringstream out;
  std::string bytes = std::string(80, 's') + raw(static_cast<std::uint32_t>(triangles.size()));
  out << "solid a cube\n";
  int corner = 0;
  for (const auto& triangle : triangles) {
    out << "facet normal nan nan nan\nouter loop\n";
    bytes += raw(0.f) + raw(0.f) + raw(0.f);
    for (const int v : triangle) {
      out << "vertex";
      for (const int bit : {v >> 2, v >> 1 & 1, v & 1}) {
        const double x = bit + noise * (corner++ % 3 - 1);
        out << ' ' << x;
        bytes += raw(static_cast<float>(x));
      }
      out << "\n";
    }
    out << "endloop\nendfacet\n";
    bytes += raw(std::uint16_t{0});
  }
  out << "endsolid a cube\n";
  return is_binary ? bytes : out.str();
}

}  // namespace itr
