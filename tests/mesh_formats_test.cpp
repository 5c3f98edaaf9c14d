// SPDX-License-Identifier: MIT
// One body in all formats of mesh files: the same mesh, the same names, the same run.
#include <gtest/gtest.h>

#include <functional>

#include "mesh/mesh_file.hpp"
#include "mesh_formats.hpp"
#include "scene_folder.hpp"
#include "simulation/state.hpp"

namespace itr::scene {
namespace {

/// The foot held, the head pulled and let down, under gravity.
json scene_of(const std::string& mesh) {
  return {{"geometry", json::array({{{"mesh", mesh}}})},
          {"materials", json::array({{{"id", "left"}, {"type", "NeoHookean"}, {"E", 1e4}, {"nu", 0.4}, {"rho", 1000}},
                                     {{"id", "right"}, {"type", "NeoHookean"}, {"E", 3e4}, {"nu", 0.3}, {"rho", 500}}})},
          {"boundary_conditions",
           {{"rhs", {0, 9.81, 0}},
            {"dirichlet_boundary", json::array({{{"id", "foot"}, {"value", {0, 0, 0}}}})},
            {"neumann_boundary", json::array({{{"id", "head"}, {"value", {"100 * t", 0, 50}}}})}}},
          {"output", {{"forces", json::array({{{"name", "foot"}, {"surfaces", "foot"}, {"bodies", json::array()}}})}}},
          {"solver", {{"linear", {{"solver", "eigen"}}}}},
          {"time", {{"dt", 0.01}, {"time_steps", 3}}}};
}

class MeshFormats : public SceneTest {
 protected:
  VectorX run(const json& scene) {
    Scene read = read_scene(scene);
    linear::Registry registry;
    Simulation<3> simulation(std::get<itr::Setup<3>>(read.setup), registry);
    while (!simulation.finished())
      if (!simulation.advance().ok) ADD_FAILURE() << "a step failed";
    return simulation.state().history.x[0];
  }
};

TEST_F(MeshFormats, SameBodyInEachIsTheSameRun) {
  const Bar bar;
  write("text41.msh", msh41(bar, false));
  const VectorX expected = run(scene_of("text41.msh"));
  ASSERT_GT((expected.tail(12) - Eigen::Map<const VectorX>(bar.points[8].data(), 12)).norm(), 1e-4);
  const std::vector<std::pair<std::string, std::string>> files = {{"binary41.msh", msh41(bar, true)},
                                                                  {"partitioned.msh", msh41(bar, false, true)},
                                                                  {"partitioned_binary.msh", msh41(bar, true, true)},
                                                                  {"text22.msh", msh22(bar, false)},
                                                                  {"binary22.msh", msh22(bar, true)},
                                                                  {"linear.inp", inp(bar, false, inp_sets(bar))},
                                                                  {"quadratic.inp", inp(bar, true, inp_sets(bar))},
                                                                  {"text3.vtk", vtk(bar, false, false)},
                                                                  {"binary3.vtk", vtk(bar, true, false)},
                                                                  {"text5.vtk", vtk(bar, false, true)},
                                                                  {"binary5.vtk", vtk(bar, true, true)},
                                                                  {"text.vtu", vtu(bar, Xml::text)},
                                                                  {"base64.vtu", vtu(bar, Xml::base64)},
                                                                  {"compressed.vtu", vtu(bar, Xml::compressed)},
                                                                  {"appended.vtu", vtu(bar, Xml::appended)},
                                                                  {"appended64.vtu", vtu(bar, Xml::appended_base64)}};
  for (const auto& [name, bytes] : files) {
    write(name, bytes);
    const VectorX x = run(scene_of(name));
    ASSERT_EQ(x.size(), expected.size()) << name;
    EXPECT_TRUE(x == expected) << name << ": off by " << (x - expected).norm();
  }
}

TEST_F(MeshFormats, NumbersAndNamesAreTheSameGroup) {
  write("bar.msh", msh41(Bar(), false));
  json by_number = scene_of("bar.msh");
  by_number["materials"][0]["id"] = 1;
  by_number["materials"][1]["id"] = 2;
  by_number["boundary_conditions"]["dirichlet_boundary"][0]["id"] = 11;
  by_number["boundary_conditions"]["neumann_boundary"][0]["id"] = 12;
  by_number["output"]["forces"][0]["surfaces"] = 11;

  EXPECT_TRUE(run(by_number) == run(scene_of("bar.msh")));
}

TEST_F(MeshFormats, GroupsPassOnToRefinedMeshesAndCopies) {
  write("bar.msh", msh41(Bar(), false));
  json scene = scene_of("bar.msh");
  scene["geometry"][0]["n_refs"] = 1;
  scene["geometry"][0]["type"] = "mesh_array";
  scene["geometry"][0]["array"] = {{"offset", 5}, {"size", {1, 2, 1}}};

  const Scene read = read_scene(scene);
  const auto& setup = std::get<itr::Setup<3>>(read.setup);
  const auto count = [&](const std::string& name) {
    const std::vector<int>& tags = setup.names.surfaces.at(name);
    int facets = 0;
    for (FacetId f = 0; f < setup.mesh.num_facets(); ++f)
      facets += std::count(tags.begin(), tags.end(), setup.mesh.facet_tag(f)) > 0;
    return facets;
  };
  EXPECT_EQ(count("foot"), 16);
  EXPECT_EQ(count("head"), 16);
}

/// A square of two triangles with all that is at x = 0 in "left", at y = 0 in "bottom".
const std::string kSquare =
    "*NODE\n1, 0, 0\n2, 1, 0\n3, 1, 1\n4, 0, 1\n*ELEMENT, TYPE=CPS3, ELSET=all\n1, 1, 2, 3\n2, 1, 3, 4\n"
    "*NSET, NSET=LEFT\n1, 4\n*NSET, NSET=bottom\n1, 2\n*NSET, NSET=around\nLeft, bottom\n*NSET, NSET=corner\n3,\n"
    "*SURFACE, NAME=Skin\nall,\n*SURFACE, NAME=Low\n1, S1\n*ELSET, ELSET=first\n1\n";

json square_with(const json& conditions) {
  return {{"geometry", json::array({{{"mesh", "square.inp"}}})},
          {"materials", {{"type", "NeoHookean"}, {"E", 1e4}, {"nu", 0.4}, {"rho", 1000}}},
          {"boundary_conditions", conditions},
          {"time", {{"dt", 0.1}, {"tend", 1}}}};
}

TEST_F(MeshFormats, OverlappingSetsKeepTheirConditions) {
  write("square.inp", kSquare);
  const json scene = square_with(
      {{"dirichlet_boundary", json::array({{{"id", "LEFT"}, {"value", {1, 0}}, {"dimension", {true, false}}},
                                           {{"id", "around"}, {"value", {5, 2}}, {"dimension", {false, true}}}})},
       {"neumann_boundary", json::array({{{"id", "Skin"}, {"value", {1, 0}}}, {{"id", "Low"}, {"value", {2, 0}}}})},
       {"pressure_boundary", json::array({{{"id", "Skin"}, {"value", 3}}})}});

  const itr::Setup<2> setup = read2(scene);
  const auto tag_of = [&](int a, int b) { return setup.mesh.facet_tag(setup.mesh.find_facet({a, b})); };
  const auto held = [&](int a, int b) {
    for (const auto& condition : setup.dirichlet)
      if (condition.tag == tag_of(a, b)) return std::pair{condition.components, condition.displacement(Vec<2>(0, 0), 0)};
    return std::pair{std::array{false, false}, Vec<2>(0, 0)};
  };
  EXPECT_EQ(held(3, 0).first, (std::array{true, true}));
  EXPECT_EQ(held(3, 0).second, Vec<2>(1, 2));
  EXPECT_EQ(held(0, 1).first, (std::array{false, true}));
  EXPECT_EQ(held(0, 1).second[1], 2);
  EXPECT_EQ(held(1, 2).first, (std::array{false, false}));
  const auto traction = [&](int a, int b) {
    double sum = 0;
    for (const auto& load : setup.neumann)
      if (load.tag == tag_of(a, b)) sum += load.traction(Vec<2>(0, 0), 0)[0];
    return sum;
  };
  EXPECT_EQ(traction(0, 1), 3);
  EXPECT_EQ(traction(1, 2), 1);
  for (const auto& [a, b] : {std::array{0, 1}, {1, 2}, {2, 3}, {3, 0}})
    EXPECT_EQ(
        std::count_if(setup.pressure.begin(), setup.pressure.end(), [&](const auto& p) { return p.tag == tag_of(a, b); }),
        1);
  EXPECT_EQ(setup.dirichlet.size(), 2u);
}

TEST_F(MeshFormats, SetsOfSinglePointsHoldPoints) {
  write("square.inp", kSquare);
  const itr::Setup<2> setup =
      read2(square_with({{"dirichlet_boundary", json::array({{{"id", "corner"}, {"value", {0, 0}}}})}}));

  ASSERT_EQ(setup.dirichlet.size(), 1u);
  EXPECT_EQ(setup.mesh.vertex_tag(2), setup.dirichlet[0].tag);
  for (FacetId f = 0; f < setup.mesh.num_facets(); ++f) EXPECT_EQ(setup.mesh.facet_tag(f), kNoTag);
}

TEST_F(MeshFormats, SelectionsGiveNamesAndWin) {
  write("bar.msh", msh41(Bar(), false));
  json scene = scene_of("bar.msh");
  scene["geometry"][0]["surface_selection"] = {{{"id", "front"}, {"axis", "-z"}, {"position", 0}},
                                               {{"id", 11}, {"axis", "z"}, {"position", 1}}};
  scene["boundary_conditions"]["dirichlet_boundary"] = {{{"id", "front"}, {"value", {0, 0, 0}}},
                                                        {{"id", 11}, {"value", {0, 0, 0}}}};

  const Scene read = read_scene(scene);
  const auto& setup = std::get<itr::Setup<3>>(read.setup);
  for (FacetId f = 0; f < setup.mesh.num_facets(); ++f) {
    double z = 0;
    for (const int v : setup.mesh.facet(f)) z += setup.mesh.rest(v)[2] / 3;
    EXPECT_EQ(setup.mesh.facet_tag(f) == 11, z == 1);
  }
  EXPECT_TRUE(std::any_of(read.warnings.begin(), read.warnings.end(), [](const std::string& warning) {
    return warning.find("gives the id 11, which a group of the mesh file has too") != std::string::npos;
  }));
}

TEST_F(MeshFormats, NamesThatNothingHasAreToldWithThoseThatThereAre) {
  write("bar.msh", msh41(Bar(), false));
  const auto wrong = [&](const std::function<void(json&)>& change) {
    json scene = scene_of("bar.msh");
    change(scene);
    const auto parts = failure(scene);
    return parts.place + ": " + parts.found + "; " + parts.expected;
  };
  EXPECT_EQ(wrong([](json& s) { s["boundary_conditions"]["dirichlet_boundary"][0]["id"] = "foto"; }),
            "/boundary_conditions/dirichlet_boundary/0/id: \"foto\", which nothing has; the id of a surface or an obstacle, "
            "above 0: \"foot\", \"head\"");
  EXPECT_EQ(
      wrong([](json& s) { s["boundary_conditions"]["dirichlet_boundary"][0]["id"] = "left"; }),
      "/boundary_conditions/dirichlet_boundary/0/id: \"left\", which nothing has (a group of cells of the mesh file); the "
      "id of a surface or an obstacle, above 0: \"foot\", \"head\"");
  EXPECT_EQ(wrong([](json& s) { s["materials"][1]["id"] = "rigth"; }),
            "/materials/1/id: \"rigth\", which nothing has; the id of a body: 1, 2, \"left\", \"right\"");
  EXPECT_EQ(
      wrong([](json& s) { s["output"]["forces"][0]["bodies"] = "head"; }),
      "/output/forces/0/bodies: \"head\", which nothing has (a group of the mesh file that holds no cells); the id of a "
      "body: 1, 2, \"left\", \"right\"");
}

TEST_F(MeshFormats, SecondMaterialOfACellIsRefused) {
  write("square.inp", kSquare);
  json scene = square_with(json::object());
  const json material = scene["materials"];
  scene["materials"] = {material, material};
  scene["materials"][0]["id"] = "all";
  scene["materials"][1]["id"] = "first";

  EXPECT_EQ(failure(scene).found, "a second material, of \"first\", for elements 0, which are in \"all\" too");
}

TEST_F(MeshFormats, TetrahedraAreTurnedWithAWord) {
  Bar bar;
  for (auto& cell : bar.cells) std::swap(cell[1], cell[2]);
  write("bar.msh", msh41(bar, false));

  const Scene read = read_scene(scene_of("bar.msh"));
  EXPECT_NE(read.warnings.end(),
            std::find(read.warnings.begin(), read.warnings.end(),
                      "/geometry/0/mesh: 12 of 12 elements list their corners the other way round: turned"));
}

TEST_F(MeshFormats, CurvedEdgesAreStraightenedWhereTheyAreAlmost) {
  const auto curved = [&](const char* middle, const json& advanced) {
    write("square.inp", std::string("*NODE\n1, 0, 0\n2, 1, 0\n3, 0, 1\n4, ") + middle +
                            "\n5, 0.5, 0.5\n6, 0, 0.5\n*ELEMENT, TYPE=CPS6\n1, 1, 2, 3, 4, 5, 6\n");
    json scene = square_with(json::object());
    scene["geometry"][0]["advanced"] = advanced;
    return scene;
  };
  const std::vector<std::string> warnings = read_scene(curved("0.5, -0.009", json::object())).warnings;
  EXPECT_TRUE(std::ranges::count(
      warnings,
      "/geometry/0/mesh: 1 edges that are curved at rest, by up to 0.9 % of their length (node 4): taken as straight"));
  const auto parts = failure(curved("0.5, -0.02", json::object()));
  EXPECT_EQ(parts.found, "\"square.inp\" with 1 edges that are curved at rest, by up to 2 % of their length (node 4)");
  EXPECT_NE(parts.expected.find("force_linear_geometry"), std::string::npos);
  EXPECT_EQ(read2(curved("0.5, -0.02", {{"force_linear_geometry", true}})).mesh.num_vertices(), 3);
}

TEST_F(MeshFormats, StlIsWeldedAndOpenShellsAreTold) {
  for (const bool is_binary : {false, true}) {
    write("closed.stl", stl(is_binary, false));
    write("open.stl", stl(is_binary, true));
    write("noisy.stl", stl(is_binary, false, 2e-7));
    const MeshFile closed = read_mesh_file(folder_ / "closed.stl"), open = read_mesh_file(folder_ / "open.stl");
    EXPECT_EQ(closed.vertices.size(), 8u);
    EXPECT_EQ(closed.triangles.size(), 12u);
    EXPECT_TRUE(closed.notes.empty());
    EXPECT_EQ(read_mesh_file(folder_ / "noisy.stl").vertices.size(), 8u);
    ASSERT_EQ(open.notes.size(), 1u);
    EXPECT_EQ(open.notes[0].substr(0, 58), "is an open shell: 3 edges belong to one triangle only, the");
  }
}

TEST_F(MeshFormats, ObstaclesOfAllFormatsMoveByTheirName) {
  write("bar.msh", msh41(Bar(), false));
  write("cube.stl", stl(true, false));
  write("cube.vtp",
        "<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfPoints=\"3\" NumberOfPolys=\"1\"><Points><DataArray "
        "type=\"Float32\" "
        "Name=\"Points\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0 0 1 0</DataArray></Points><Polys><DataArray "
        "type=\"Int32\" Name=\"connectivity\" format=\"ascii\">0 1 2</DataArray><DataArray type=\"Int32\" Name=\"offsets\" "
        "format=\"ascii\">3</DataArray></Polys></Piece></PolyData></VTKFile>\n");
  json scene = scene_of("bar.msh");
  scene["boundary_conditions"]["obstacle_displacements"] = {{{"id", "punch"}, {"value", {"t", 0, 0}}}};
  scene["output"]["forces"][0]["obstacles"] = {"punch", "plate"};
  for (const auto& [file, vertices] : {std::pair{"cube.stl", 8}, {"cube.vtp", 3}}) {
    scene["geometry"][1] = {{"mesh", file},
                            {"is_obstacle", true},
                            {"surface_selection", "punch"},
                            {"transformation", {{"translation", {9, 0, 0}}}}};
    scene["geometry"][2] = {{"type", "ground"}, {"height", -5}, {"name", "plate"}};
    const Scene read = read_scene(scene);
    const auto& obstacles = std::get<itr::Setup<3>>(read.setup).obstacles;
    ASSERT_EQ(obstacles.rest.size(), static_cast<std::size_t>(vertices) + 3);
    EXPECT_EQ(obstacles.motion.front(), 0);
    EXPECT_EQ(obstacles.motion.back(), kNone);
    EXPECT_EQ(std::get<itr::Setup<3>>(read.setup).fields.curves[0].obstacle_vertices.size(), obstacles.rest.size());
  }
}

TEST_F(MeshFormats, SaysWhereAFileIsWrong) {
  const auto wrong = [&](const std::string& name, const std::string& bytes) {
    write(name, bytes);
    try {
      read_mesh_file(folder_ / name);
    } catch (const InputError& error) {
      return error.parts().place + ": " + error.parts().found + "; " + error.parts().expected;
    }
    return std::string("no error");
  };
  const std::string deck = "*NODE\n1, 0, 0\n2, 1, 0\n3, 0, 1\n*ELEMENT, TYPE=CPS3, ELSET=all\n1, 1, 2, 3\n";
  EXPECT_EQ(wrong("a.inp", "1, 2, 3\n"), "line 1: no keyword; a deck that begins with one, such as *NODE");
  EXPECT_EQ(wrong("a.inp", "*NODE\n1, 0, zero\n"), "line 2: 'zero'; a number");
  EXPECT_EQ(wrong("a.inp", deck + "2, 1, 2\n"), "line 7: an element of 2 nodes; 3 of CPS3");
  EXPECT_EQ(wrong("a.inp", deck + "2, 1, 2, 9\n"), "triangle 2: node 9; a node of the file");
  EXPECT_EQ(wrong("a.inp", deck + "*ELSET, ELSET=b\n1, 7\n"), "line 8: element 7; one of the file");
  EXPECT_EQ(wrong("a.inp", deck + "*ELSET, ELSET=b\nalll\n"), "line 8: 'alll'; the name of an ELSET");
  EXPECT_EQ(wrong("a.inp", deck + "*SURFACE, NAME=b\nall, S4\n"), "line 8: the face 'S4'; S1 to S3");
  EXPECT_EQ(wrong("a.inp", deck + "*NSET\n1\n"), "line 8: *NSET without NSET; NSET=...");
  EXPECT_EQ(
      wrong("a.inp", deck + "*ELEMENT, TYPE=C3D8R\n"),
      "line 7: elements of type C3D8R; C3D4, C3D10, CPS3, CPS6, CPE3 or CPE6, and triangles or lines on their surface; "
      "`python3 -m itr.simplices a.inp new.msh` splits other cells into these");
  EXPECT_NE(wrong("a.inp", deck + "*ELEMENT, TYPE=CAX3\n").find("axisymmetric"), std::string::npos);
  EXPECT_NE(wrong("a.inp", deck + "*INCLUDE, INPUT=b.inp\n").find("the file that it names"), std::string::npos);
  EXPECT_NE(wrong("a.inp", "*PART, NAME=a\n*END PART\n*PART, NAME=b\n").find("noPartsInputFile=ON"), std::string::npos);
  EXPECT_EQ(wrong("a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0\nvertex"), "line 5: 'vertex'; a number");
  EXPECT_NE(wrong("a.stl", "cube").find("line 1: another beginning"), std::string::npos);
  EXPECT_EQ(wrong("a.vtk", "# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\n"),
            "line 4: a dataset of type 'STRUCTURED_POINTS'; UNSTRUCTURED_GRID or POLYDATA");
  EXPECT_EQ(wrong("a.vtk",
                  "# vtk DataFile Version 5.1\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 double\n0 0 0 1 0 0 0 1 0\n"
                  "LINES 2 3\nOFFSETS vtktypeint64\n1 3\nCONNECTIVITY vtktypeint64\n0 1 2\n"),
            "line 9: OFFSETS that begin with 1.000000; 0");
  EXPECT_NE(wrong("a.vtu", "<VTKFile type=\"ImageData\">").find("line 1: a file of type 'ImageData'"), std::string::npos);
  std::string cut = vtu(Bar(), Xml::base64);
  cut.erase(cut.find("Name=\"Points\"") + 100, 40);
  EXPECT_NE(wrong("a.vtu", cut).find("an array that ends too early"), std::string::npos);
  EXPECT_NE(wrong("a.step", "").find("docs/user-guide.md"), std::string::npos);
}

// Every beginning of a file is an InputError, or the part that is there: never a crash.
TEST_F(MeshFormats, TruncatedFilesAreErrors) {
  const Bar bar;
  const std::vector<std::pair<std::string, std::string>> files = {
      {"a.inp", inp(bar, true, inp_sets(bar))}, {"a.stl", stl(false, false)},     {"b.stl", stl(true, false)},
      {"a.vtk", vtk(bar, false, true)},         {"b.vtk", vtk(bar, true, false)}, {"a.vtu", vtu(bar, Xml::compressed)},
      {"b.vtu", vtu(bar, Xml::appended)}};
  for (const auto& [name, whole] : files)
    for (std::size_t size = 0; size < whole.size(); size += 1 + whole.size() / 500) {
      write(name, whole.substr(0, size));
      try {
        read_mesh_file(folder_ / name);
      } catch (const InputError&) {
      }
    }
}

}  // namespace
}  // namespace itr::scene
