// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <numeric>

#include "itr/core.hpp"
#include "mesh/mesh_file.hpp"
#include "mesh/refine.hpp"

namespace itr {
namespace {

namespace fs = std::filesystem;

/// A file that lives as long as the test.
class TemporaryFile {
 public:
  TemporaryFile(const std::string& name, const std::string& bytes)
      : path_(fs::path(::testing::TempDir()) / ("itr_readers_" + std::to_string(::getpid()) + "_" + name)) {
    std::ofstream(path_, std::ios::binary) << bytes;
  }
  ~TemporaryFile() { fs::remove(path_); }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

MeshFile read_bytes(const std::string& name, const std::string& bytes) {
  return read_mesh_file(TemporaryFile(name, bytes).path());
}

InputError::Parts failure(const std::string& name, const std::string& bytes) {
  try {
    read_bytes(name, bytes);
  } catch (const InputError& error) {
    return error.parts();
  }
  ADD_FAILURE() << "read without an error";
  return {};
}

template <typename... Values>
std::string raw(Values... values) {
  std::string bytes;
  (bytes.append(reinterpret_cast<const char*>(&values), sizeof(values)), ...);
  return bytes;
}

using std::int32_t;
using std::uint64_t;

const std::string kText22 =
    "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 7 \"$odd name\"\n$EndPhysicalNames\n"
    "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 1 1 0.5\n$EndNodes\n"
    "$Elements\n4\n1 15 2 0 1 1\n2 1 2 9 1 1 2\n3 2 2 7 1 1 2 3\n4 2 0 2 4 3\n$EndElements\n";

std::string binary22() {
  std::string bytes = "$MeshFormat\n2.2 1 8\n" + raw(int32_t{1}) + "\n$EndMeshFormat\n$Nodes\n4\n";
  const double xyz[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (int32_t i = 0; i < 4; ++i) bytes += raw(i + 1, xyz[i][0], xyz[i][1], xyz[i][2]);
  bytes += "\n$EndNodes\n$Elements\n1\n" + raw(int32_t{4}, int32_t{1}, int32_t{2});
  bytes += raw(int32_t{1}, int32_t{5}, int32_t{1}, int32_t{1}, int32_t{2}, int32_t{3}, int32_t{4});
  return bytes + "\n$EndElements\n";
}

const std::string kText41 =
    "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n"
    "$Entities\n1 0 1 0\n3 0 0 0 0\n1 0 0 0 1 1 0 2 8 9 1 3\n$EndEntities\n"
    "$Nodes\n2 3 10 30\n0 3 0 1\n10\n0 0 0\n2 1 1 2\n20\n30\n1 0 0 0.5 0.5\n0 1 0 0.5 0.5\n$EndNodes\n"
    "$Elements\n1 1 1 1\n2 1 2 1\n1 10 20 30\n$EndElements\n";

std::string binary41() {
  const auto u = [](uint64_t value) { return value; };
  std::string bytes = "$MeshFormat\n4.1 1 8\n" + raw(int32_t{1}) + "\n$EndMeshFormat\n$Entities\n";
  bytes +=
      raw(u(0), u(0), u(1), u(0), int32_t{1}, 0., 0., 0., 1., 1., 0., u(1), int32_t{6}, u(0)) + "\n$EndEntities\n$Nodes\n";
  bytes += raw(u(1), u(3), u(1), u(3), int32_t{2}, int32_t{1}, int32_t{0}, u(3), u(2), u(1), u(3));
  bytes += raw(1., 0., 0., 0., 0., 0., 0., 1., 0.) + "\n$EndNodes\n$Elements\n";
  bytes += raw(u(1), u(1), u(1), u(1), int32_t{2}, int32_t{1}, int32_t{2}, u(1), u(1), u(1), u(2), u(3));
  return bytes + "\n$EndElements\n";
}

TEST(MeshReaders, Msh22Text) {
  const MeshFile mesh = read_bytes("a.msh", kText22);

  EXPECT_EQ(mesh.vertices.size(), 4u);
  EXPECT_EQ(mesh.vertices[3], Vec<3>(1, 1, 0.5));
  EXPECT_EQ(mesh.edges, (std::vector<std::array<int, 2>>{{0, 1}}));
  EXPECT_EQ(mesh.triangles, (std::vector<std::array<int, 3>>{{0, 1, 2}, {1, 3, 2}}));
  EXPECT_EQ(mesh.triangle_body, (std::vector<int>{7, 0}));
}

TEST(MeshReaders, Msh22Binary) {
  const MeshFile mesh = read_bytes("a.msh", binary22());

  EXPECT_EQ(mesh.vertices[3], Vec<3>(0, 0, 1));
  EXPECT_EQ(mesh.tetrahedra, (std::vector<std::array<int, 4>>{{0, 1, 2, 3}}));
  EXPECT_EQ(mesh.tetrahedron_body, std::vector<int>{5});
}

TEST(MeshReaders, Msh41TextRenumbersSparseTagsInFileOrder) {
  const MeshFile mesh = read_bytes("a.msh", kText41);

  EXPECT_EQ(mesh.vertices.size(), 3u);
  EXPECT_EQ(mesh.vertices[1], Vec<3>(1, 0, 0));
  EXPECT_EQ(mesh.triangles, (std::vector<std::array<int, 3>>{{0, 1, 2}}));
  EXPECT_EQ(mesh.triangle_body, std::vector<int>{8});
}

TEST(MeshReaders, Msh41BinaryPlacesDenseTags) {
  const MeshFile mesh = read_bytes("a.MSH", binary41());

  EXPECT_EQ(mesh.vertices[0], Vec<3>(0, 0, 0));  // tag 1, second in the file
  EXPECT_EQ(mesh.vertices[1], Vec<3>(1, 0, 0));
  EXPECT_EQ(mesh.triangle_body, std::vector<int>{6});
}

TEST(MeshReaders, ObjWithRelativeIndicesAndPolylines) {
  const MeshFile mesh =
      read_bytes("a.obj", "# comment\nv 0 0\r\nv 1 0 0\nvt 0 0\nv +1e0 1 2 0.1 0.2 0.3\nf 1/1 2//3 -1\nl 1 2 3\ng x\n");

  EXPECT_EQ(mesh.vertices[2], Vec<3>(1, 1, 2));
  EXPECT_EQ(mesh.triangles, (std::vector<std::array<int, 3>>{{0, 1, 2}}));
  EXPECT_EQ(mesh.edges, (std::vector<std::array<int, 2>>{{0, 1}, {1, 2}}));
}

const std::string kTextPly =
    "ply\nformat ascii 1.0\ncomment property of nobody\nelement vertex 4\nproperty float x\nproperty float y\n"
    "property float z\nproperty uchar red\nelement material 2\nproperty list uchar int parts\nproperty float shine\n"
    "element face 2\nproperty list uchar int vertex_indices\nelement edge 1\nproperty int vertex1\nproperty int vertex2\n"
    "end_header\n0 0 0 255\n1 0 0 0\n0 1 0 0\n0 0 +1.5 7\n3 1 2 3 0.5\n0 1\n3 0 1 2\n3 0 3 1\n2 3\n";

/// Bytes of a PLY with doubles, as tools write it: the header's lines may end in \r\n, and data begin at once after it.
std::string binary_ply(const std::string& end = "\n") {
  std::string bytes;
  for (const char* line :
       {"ply", "format binary_little_endian 1.0", "element vertex 4", "property double x", "property double y",
        "property double z", "property uchar red", "element material 1", "property list ushort short parts",
        "element face 2", "property list uint8 int32 vertex_index", "property float quality", "end_header"})
    bytes += line + end;
  const double xyz[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1.5}};
  for (const auto& v : xyz) bytes += raw(v[0], v[1], v[2], std::uint8_t{10});  // 10 is an end of line, too
  bytes += raw(std::uint16_t{2}, std::int16_t{-1}, std::int16_t{3});
  bytes += raw(std::uint8_t{3}, int32_t{0}, int32_t{1}, int32_t{2}, 0.5f);
  return bytes + raw(std::uint8_t{3}, int32_t{0}, int32_t{3}, int32_t{1}, 0.5f);
}

const std::string kMedit =
    "MeshVersionFormatted 1\n# made by hand\nDimension 3\nVertices\n4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1.5 0\n"
    "Triangles\n2\n1 2 3 7\n1 2 4 0\nCorners\n1\n4\nHexahedra 0\nTetrahedra\n1\n1 2 3 4 5\nEnd\n";

TEST(MeshReaders, MeditHasReferencesAsGroups) {
  const MeshFile mesh = read_bytes("a.mesh", kMedit);
  ASSERT_EQ(mesh.vertices.size(), 4u);
  EXPECT_EQ(mesh.vertices[3], Vec<3>(0, 0, 1.5));
  EXPECT_EQ(mesh.triangles, (std::vector<std::array<int, 3>>{{0, 1, 2}, {0, 1, 3}}));
  EXPECT_EQ(mesh.tetrahedra, (std::vector<std::array<int, 4>>{{0, 1, 2, 3}}));
  EXPECT_EQ(mesh.triangle_body, (std::vector<int>{7, 0}));
  EXPECT_EQ(mesh.tetrahedron_body, (std::vector<int>{5}));
  ASSERT_EQ(mesh.groups.size(), 2u);
  EXPECT_EQ(mesh.groups[0].dim, 2);
  EXPECT_EQ(mesh.groups[0].number, 7);
  EXPECT_EQ(mesh.groups[0].members, std::vector<int>{0});
  EXPECT_EQ(mesh.groups[1].dim, 3);
  const MeshFile flat =
      read_bytes("a.mesh", "MeshVersionFormatted 2 Dimension 2 Vertices 3 0 0 1 1 0 1 0 2 1 Triangles 1 1 2 3 4");
  EXPECT_EQ(flat.vertices[2], Vec<3>(0, 2, 0));
  EXPECT_EQ(flat.triangles.size(), 1u);
}

std::string changed(std::string text, const std::string& from, const std::string& to);

TEST(MeshReaders, SaysWhereAMeditFileIsWrong) {
  const auto found = [](const std::string& from, const std::string& to) {
    const auto parts = failure("a.mesh", changed(kMedit, from, to));
    return parts.place + " " + parts.found;
  };
  EXPECT_EQ(found("MeshVersionFormatted", "solid"), "line 1 another beginning");
  EXPECT_NE(found("Hexahedra 0", "Hexahedra 1").find("'Hexahedra'"), std::string::npos);
  EXPECT_NE(found("Corners", "Colours").find("'Colours'"), std::string::npos);
  EXPECT_EQ(found("1 2 3 4 5", "1 2 3 0 5"), "line 20 vertex 0");
  EXPECT_EQ(found("1 2 3 4 5", "1 2 3 9 5"), "tetrahedron 0 vertex 8 (0-based)");
  EXPECT_NE(found("Vertices\n4", "Vertices\n4000").find("a count of 4000"), std::string::npos);
}

TEST(MeshReaders, PlyTextAndBinary) {
  for (const std::string& bytes : {kTextPly, binary_ply(), binary_ply("\r\n")}) {
    const MeshFile mesh = read_bytes("a.ply", bytes);
    ASSERT_EQ(mesh.vertices.size(), 4u);
    EXPECT_EQ(mesh.vertices[1], Vec<3>(1, 0, 0));
    EXPECT_EQ(mesh.vertices[3], Vec<3>(0, 0, 1.5));
    EXPECT_EQ(mesh.triangles, (std::vector<std::array<int, 3>>{{0, 1, 2}, {0, 3, 1}}));
    EXPECT_EQ(mesh.triangle_body, (std::vector<int>{0, 0}));
  }
  EXPECT_EQ(read_bytes("a.ply", kTextPly).edges, (std::vector<std::array<int, 2>>{{2, 3}}));
}

std::string changed(std::string text, const std::string& from, const std::string& to) {
  return text.replace(text.find(from), from.size(), to);
}

TEST(MeshReaders, SaysWhereAPlyFileIsWrong) {
  const auto refuses = [](const std::string& from, const std::string& to, const std::string& found) {
    const auto parts = failure("a.ply", changed(kTextPly, from, to));
    EXPECT_NE((parts.place + " " + parts.found).find(found), std::string::npos) << parts.place << " " << parts.found;
  };
  refuses("ply\n", "solid\n", "line 1 another beginning");
  refuses("ascii", "binary_big_endian", "the format 'binary_big_endian'");
  refuses("end_header", "end", "the end of the file");
  refuses("float y", "complex y", "line 6 the type 'complex'");
  refuses("float y", "float why", "'vertex' without 'y'");
  refuses("int vertex_indices", "int corners", "'face' without 'vertex_indices'");
  refuses("element vertex 4\n", "", "line 4 a property");
  refuses("element vertex 4", "element vertex many", "'many'");
  refuses("element vertex 4", "element vertex -4", "a count of -4");
  refuses("element vertex 4", "element vertex 4000000000", "a count of 4000000000");
  refuses("element material", "element tristrips", "strips of triangles");
  refuses("\n3 0 1 2\n", "\n4 0 1 2 3\n", "'vertex_indices' with 4 numbers");
  refuses("\n3 0 1 2\n", "\n3 0 1 9\n", "triangle 0 vertex 9");
  refuses("\n3 0 1 2\n", "\n3 0 1 0.5\n", "the number 0.5");
  refuses("\n3 0 1 2\n", "\n3 0 1 1e10\n", "the number 10000000000");
  refuses("+1.5", "inf", "vertex 3 a coordinate that is not finite");
  refuses("+1.5", "up", "line 21 'up'");
  refuses("property float x", "property list uchar float x", "'x' with 0 numbers");
  EXPECT_EQ(failure("a.ply", binary_ply().substr(0, 330)).expected, "more data");
}

TEST(MeshReaders, SaysWhereAFileIsWrong) {
  EXPECT_THROW(read_mesh_file("/no/such/file.msh"), InputError);
  EXPECT_THROW(read_bytes("a.stl", ""), InputError);
  EXPECT_EQ(failure("a.obj", "v 0 0\nv 1 x\n").place, "line 2");
  EXPECT_EQ(failure("a.obj", "v 0 0\nv 1 0\nv 1 1\nv 0 1\nf 1 2 3 4\n").place, "line 5");
  EXPECT_EQ(failure("a.obj", "v 0 0\nv 1 0\nv 1 1\nf 1 2 9\n").place, "triangle 0");
  EXPECT_EQ(failure("a.obj", "v 0 0\nv 1 nan\n").place, "vertex 1");
  EXPECT_EQ(failure("a.obj", "").found, "no vertices");
  EXPECT_EQ(failure("a.msh", "$MeshFormat\n3 0 8\n$EndMeshFormat\n").place, "line 2");
  EXPECT_EQ(failure("a.msh", "nonsense").expected, "$MeshFormat");
}

/// A triangle and a tetrahedron of second order, nodes in Gmsh's order, a middle node before a corner.
const std::string kSecondOrder =
    "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n10\n1 0 0 0\n2 0.5 0 0\n3 1 0 0\n4 0 1 0\n5 0 0 1\n6 0.5 0.5 0\n"
    "7 0 0.5 0\n8 0 0 0.5\n9 0 0.5 0.5\n10 0.5 0 0.5\n$EndNodes\n"
    "$Elements\n3\n1 8 2 4 1 1 3 2\n2 9 2 7 1 1 3 4 2 6 7\n3 11 2 5 1 1 3 4 5 2 6 7 8 9 10\n$EndElements\n";

TEST(MeshReaders, SecondOrderFilesAreTheirCorners) {
  const MeshFile mesh = read_bytes("a.msh", kSecondOrder);

  EXPECT_EQ(mesh.vertices.size(), 4u);
  EXPECT_EQ(mesh.vertices[1], Vec<3>(1, 0, 0));
  EXPECT_EQ(mesh.edges, (std::vector<std::array<int, 2>>{{0, 1}}));
  EXPECT_EQ(mesh.triangles, (std::vector<std::array<int, 3>>{{0, 1, 2}}));
  EXPECT_EQ(mesh.triangle_body, std::vector<int>{7});
  EXPECT_EQ(mesh.tetrahedra, (std::vector<std::array<int, 4>>{{0, 1, 2, 3}}));
  EXPECT_EQ(mesh.tetrahedron_body, std::vector<int>{5});
}

TEST(MeshReaders, TellsHowFarEdgesAreCurvedAtRest) {
  std::string curved = kSecondOrder, both = kSecondOrder;
  curved.replace(curved.find("6 0.5 0.5 0\n"), 12, "6 0.6 0.6 0\n");
  both.replace(both.find("1 8 2 4 1 1 3 2"), 15, "1 1 2 4 1 2 3  ");

  const MeshFile mesh = read_bytes("a.msh", curved);
  EXPECT_EQ(mesh.sag_place, "node 6");
  EXPECT_EQ(mesh.sagging_edges, 1);
  EXPECT_NEAR(mesh.sag, 0.1, 1e-12);
  EXPECT_EQ(read_bytes("a.msh", kSecondOrder).sagging_edges, 0);
  EXPECT_NE(failure("a.msh", both).found.find("in the middle of an edge"), std::string::npos);
}

TEST(MeshReaders, GroupsHaveNumbersAndNames) {
  const MeshFile mesh = read_bytes("a.msh", kText22);

  ASSERT_EQ(mesh.groups.size(), 2u);
  EXPECT_EQ(mesh.groups[0].dim, 1);
  EXPECT_EQ(mesh.groups[0].number, 9);
  EXPECT_EQ(mesh.groups[0].members, std::vector<int>{0});
  EXPECT_EQ(mesh.groups[1].name, "$odd name");
  EXPECT_EQ(mesh.groups[1].members, std::vector<int>{0});
}

TEST(MeshReaders, ParametricNodesAndCellsInTwoGroups) {
  std::string text = kText22;
  text.replace(text.find("$Nodes"), 6, "$ParametricNodes").replace(text.find("$EndNodes"), 9, "$EndParametricNodes");
  text.replace(text.find("1 0 0 0\n2 1 0 0\n3 0 1 0\n"), 24, "1 0 0 0 0 1\n2 1 0 0 1 1 0.5\n3 0 1 0 2 1 0.1 0.2\n");
  text.replace(text.find("4 1 1 0.5\n"), 10, "4 1 1 0.5 3 1\n");
  text.replace(text.find("4 2 0 2 4 3\n"), 12, "4 2 2 8 1 1 2 3\n");

  const MeshFile mesh = read_bytes("a.msh", text);
  EXPECT_EQ(mesh.vertices[3], Vec<3>(1, 1, 0.5));
  EXPECT_EQ(mesh.triangles.size(), 1u);
  EXPECT_EQ(mesh.triangle_body, std::vector<int>{7});
  ASSERT_EQ(mesh.groups.size(), 3u);
  EXPECT_EQ(mesh.groups[2].number, 8);
  EXPECT_EQ(mesh.groups[2].members, std::vector<int>{0});
}

TEST(MeshReaders, RefusesOtherElementTypes) {
  std::string text = kText22;
  text.replace(text.find("3 2 2 7 1 1 2 3"), 15, "3 3 2 7 1 1 2 3");

  EXPECT_NE(failure("a.msh", text).found.find("element 3 of type 3"), std::string::npos);
}

TEST(MeshReaders, RefusesUnknownNodesAndHugeCounts) {
  std::string unknown = kText22;
  unknown.replace(unknown.find("2 4 3\n"), 6, "2 5 3\n");
  std::string huge = kText22;
  huge.replace(huge.find("$Nodes\n4"), 8, "$Nodes\n4000000000");

  EXPECT_EQ(failure("a.msh", unknown).found, "node 5");
  EXPECT_NE(failure("a.msh", huge).found.find("a count of 4000000000"), std::string::npos);
}

// Every beginning of a file is an InputError (or, where only white space is missing, the mesh): never a crash.
TEST(MeshReaders, TruncatedFilesAreErrors) {
  for (const std::string& whole : {kText22, binary22(), kText41, binary41()})
    for (std::size_t size = 0; size + 14 < whole.size(); ++size) {
      try {
        const MeshFile mesh = read_bytes("cut.msh", whole.substr(0, size));
        EXPECT_TRUE(mesh.triangles.empty() && mesh.tetrahedra.empty()) << size;  // cut between two sections
      } catch (const InputError&) {
      }
    }
}

TEST(MeshReaders, TruncatedPlyFilesAreErrors) {  // the header says how much there is
  for (const std::string& whole : {kTextPly, binary_ply()})
    for (std::size_t size = 0; size + 1 < whole.size(); ++size)
      EXPECT_THROW(read_bytes("cut.ply", whole.substr(0, size)), InputError) << size;
}

TEST(Refine, TriangleIntoFourKeepsAreaTagsAndBody) {
  Mesh<2> mesh({{0, 0}, {2, 0}, {0, 2}}, {{0, 1, 2}}, {4});
  mesh.set_facet_tag(mesh.find_facet({0, 1}), 7);

  const Mesh<2> refined = refine_uniformly(mesh);

  EXPECT_EQ(refined.num_cells(), 4);
  EXPECT_EQ(refined.num_vertices(), 6);
  EXPECT_EQ(refined.rest(3), Vec<2>(1, 0));  // the first edge that the cell meets
  EXPECT_DOUBLE_EQ(refined.total_volume(), 2);
  EXPECT_EQ(refined.body(3), 4);
  EXPECT_EQ(refined.facet_tag(refined.find_facet({0, 3})), 7);
  EXPECT_EQ(refined.facet_tag(refined.find_facet({3, 1})), 7);
  EXPECT_EQ(refined.facet_tag(refined.find_facet({0, 4})), kNoTag);
  EXPECT_EQ(refined.find_defect(), "");
}

TEST(Refine, TetrahedronIntoEightOfEqualVolume) {
  Mesh<3> mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2, 3}}, {2});
  mesh.set_facet_tag(mesh.find_facet({0, 1, 2}), 3);

  const Mesh<3> once = refine_uniformly(mesh);
  const Mesh<3> twice = refine_uniformly(once);

  EXPECT_EQ(once.num_cells(), 8);
  EXPECT_EQ(once.num_vertices(), 10);
  for (CellId c = 0; c < 8; ++c) EXPECT_NEAR(once.volume(c), mesh.volume(0) / 8, 1e-15);
  EXPECT_EQ(twice.num_cells(), 64);
  EXPECT_EQ(twice.num_vertices(), 35);
  EXPECT_EQ(twice.find_defect(), "");
  int tagged = 0;
  for (FacetId f = 0; f < twice.num_facets(); ++f) tagged += twice.facet_tag(f) == 3;
  EXPECT_EQ(tagged, 16);
}

TEST(MeshReaders, EveryMeshOfThePaper) {
  const fs::path folder = fs::path(ITR_SHARED_DIR) / "paper-scenes" / "meshes";
  if (!fs::exists(folder)) GTEST_SKIP() << "a machine without the data of the paper does without: no " << folder;
  int read = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const fs::path& file = entry.path();
    if ((file.extension() != ".msh" && file.extension() != ".obj") || file.filename() == "cantilever-quad.obj") continue;
    const MeshFile mesh = read_mesh_file(file);
    EXPECT_GT(mesh.triangles.size() + mesh.tetrahedra.size() + mesh.edges.size(), 0u) << file;
    ++read;
  }
  EXPECT_GT(read, 20);
}

}  // namespace
}  // namespace itr
