// SPDX-License-Identifier: MIT
// Every mistake that the command refuses before it computes anything: exit status 2, and a message with the file, the place
// in it, what was found and what was expected.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

namespace itr {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr const char* kMsh = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
constexpr const char* kTetNodes = "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n";

const std::vector<std::pair<const char*, std::string>> kFiles = {
    {"square.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n"},
    {"line.obj", "v -1 -0.5 0\nv 2 -0.5 0\nl 1 2\n"},
    {"flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nf 1 2 4\nf 1 2 3\n"},
    {"surface.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n"},
    {"word.obj", "v 0 0 0\nv 1 zero 0\n"},
    {"range.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 9\n"},
    {"inverted.msh", std::string(kMsh) + kTetNodes + "$Elements\n1\n1 4 2 3 1 2 1 3 4\n$EndElements\n"},
    {"cut.msh", std::string(kMsh) + "$Nodes\n4\n1 0 0 0\n2 1 0"},
    {"cut_elements.msh", std::string(kMsh) + kTetNodes + "$Elements\n1\n1 4 2 3 1 1 2"},
    {"quad.msh", std::string(kMsh) + kTetNodes + "$Elements\n1\n1 3 2 3 1 1 2 3 4\n$EndElements\n"},
    {"node.msh", std::string(kMsh) + kTetNodes + "$Elements\n1\n1 4 2 3 1 1 2 3 7\n$EndElements\n"},
    {"text.msh", "this is no mesh\n"},
    {"mesh.stl", "solid\n"},
    {"folder/empty.obj", ""},
    {"twice.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\nf 3 4 1\n"},
    {"loose.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 4 5 6\n"},
    {"tilted.msh", std::string(kMsh) + "$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 1\n$EndNodes\n"
                                       "$Elements\n1\n1 2 2 3 1 1 2 3\n$EndElements\n"},
    {"wall.obj", "v -1 -1 -1\nv 2 -1 -1\nv -1 -1 2\nf 1 2 3\n"},
};

struct Refusal {
  const char* name;
  Json changes;       ///< merged into the scene
  std::string file;   ///< that the message names
  std::string place;  ///< in that file
  std::string found, expected;
};

Json geometry(const char* mesh) { return {{"geometry", {{{"mesh", mesh}, {"volume_selection", 1}}}}}; }
Json material(const char* key, const Json& value) {
  Json one = {{"id", 1}, {"type", "NeoHookean"}, {"E", 1e4}, {"nu", 0.4}, {"rho", 1000}};
  one[key] = value;
  return {{"materials", {one}}};
}
Json velocity(const Json& value) { return {{"initial_conditions", {{"velocity", {{{"id", 1}, {"value", value}}}}}}}; }
Json output(const char* key, const Json& value) { return {{"output", {{key, value}}}}; }
Json option(const char* key) { return output("paraview", {{"options", {{key, true}}}}); }
Json rhs(const Json& value) { return {{"boundary_conditions", {{"rhs", value}}}}; }
Json contact(const char* key, const Json& value) { return {{"contact", {{"enabled", true}, {key, value}}}}; }
Json overlapping() {
  return {{"geometry",
           {{{"mesh", "square.obj"}, {"volume_selection", 1}},
            {{"mesh", "line.obj"}, {"is_obstacle", true}, {"transformation", {{"translation", {0, 1}}}}}}},
          {"contact", {{"enabled", true}, {"dhat", 1e-3}}},
          {"solver", {{"contact", {{"barrier_stiffness", 1e5}}}}}};
}

const std::vector<Refusal> kRefusals = {
    {"selection of nothing",
     {{"geometry",
       {{{"mesh", "square.obj"}, {"volume_selection", 1}, {"surface_selection", {{{"id", 3}, {"box", {{5, 5}, {6, 6}}}}}}}}},
      {"boundary_conditions", {{"dirichlet_boundary", {{{"id", 3}, {"value", {0, 0}}}}}}}},
     "scene.json",
     "/boundary_conditions/dirichlet_boundary/0/id",
     "3, which nothing has (/geometry/0/surface_selection/0: selects nothing: no barycentre of a boundary facet is in it, "
     "or rules before it took them; the mesh spans (0, 0) to (1, 1) m)",
     "there is none"},
    {"units of other systems",
     {{"units", {{"length", "furlong"}}}},
     "scene.json",
     "/units/length",
     "\"furlong\"",
     "one of \"nm\", \"um\", \"mm\", \"cm\", \"dm\", \"m\", \"km\", \"in\", \"ft\""},
    {"units of mass as a number",
     {{"units", {{"mass", 1000}}}},
     "scene.json",
     "/units/mass",
     "1000",
     "one of \"ug\", \"mg\""},
    {"units in a word", {{"units", "mm"}}, "scene.json", "/units", "\"mm\"", "an object"},
    {"part of a name",
     {{"time", {{"dt", 0.1}, {"tend", nullptr}, {"steps", 10}}}},
     "scene.json",
     "/time/steps",
     "an unknown key",
     "\"time_steps\" perhaps"},
    {"name of other programs", material("density", 1000), "scene.json", "/materials/0/density", "an unknown key",
     "\"rho\" perhaps"},
    {"missing mesh", geometry("none.obj"), "scene.json", "/geometry/0/mesh", "none.obj", "the path of a mesh file"},
    {"a folder for a mesh", geometry("folder"), "scene.json", "/geometry/0/mesh", "folder", "the path of a mesh file"},
    {"truncated nodes", geometry("cut.msh"), "cut.msh", "line 7", "the end", "a number"},
    {"truncated elements", geometry("cut_elements.msh"), "cut_elements.msh", "line 13", "the end", "a number"},
    {"not a mesh", geometry("text.msh"), "text.msh", "line 1", "another beginning", "$MeshFormat"},
    {"unknown format", geometry("mesh.stl"), "mesh.stl", "", ".stl", ".msh, .obj or .ply"},
    {"empty file", geometry("folder/empty.obj"), "empty.obj", "", "no vertices", "a mesh"},
    {"word for a number", geometry("word.obj"), "word.obj", "line 2", "zero", "a coordinate"},
    {"vertex out of range", geometry("range.obj"), "range.obj", "triangle 0", "vertex 8", "0 to 3 - 1"},
    {"node out of range", geometry("node.msh"), "node.msh", "$Elements", "node 7", "a node of the $Nodes section"},
    {"unknown element type", geometry("quad.msh"), "quad.msh", "line 13", "element 1 of type 3 (quadrilateral)",
     "4 (tetrahedron)"},
    {"inverted element", geometry("inverted.msh"), "scene.json", "/geometry/0/mesh", "inverted elements 0",
     "positive volume"},
    {"degenerate element", geometry("flat.obj"), "scene.json", "/geometry/0/mesh", "degenerate elements 1",
     "positive volume"},
    {"a line for a body", geometry("line.obj"), "scene.json", "/geometry/0/mesh", "without cells", "triangles"},
    {"a surface for a body", geometry("surface.obj"), "scene.json", "/geometry/0/mesh", "surface", "tetrahedra"},
    {"element without material", material("id", 2), "scene.json", "/materials", "which elements 0, 1 have", "every body"},
    {"intersecting surfaces", overlapping(), "scene.json", "initial state", "(in m): edge (0, 0)-(0, 1)", "do not touch"},
    {"no time step", {{"time", {{"dt", nullptr}}}}, "scene.json", "/time", "tend", "two of tend, dt and time_steps"},
    {"contradicting times", {{"time", {{"time_steps", 3}}}}, "scene.json", "/time", "3", "tend = t0 + dt * time_steps"},
    {"wrong time key", {{"time", {{"step", 0.1}}}}, "scene.json", "/time/step", "unknown key", "time_steps"},
    {"negative time step", {{"time", {{"dt", -0.1}}}}, "scene.json", "/time/dt", "-0.1", "> 0"},
    {"end before start", {{"time", {{"t0", 3}}}}, "scene.json", "/time/tend", "1", "after t0"},
    {"unknown integrator", {{"time", {{"integrator", "RK4"}}}}, "scene.json", "/time/integrator", "RK4", "ImplicitEuler"},
    {"unknown name", rhs({0, "9.81 * tt"}), "scene.json", "/boundary_conditions/rhs/1", "'tt'", "expression"},
    {"unfinished expression", rhs({"1 +", 0}), "scene.json", "/boundary_conditions/rhs/0", "1 +", "expression"},
    {"not a number", velocity({"sqrt(-1 - x)", 0}), "scene.json", "/velocity/0/value", "no finite value at X", "a value"},
    {"infinite", velocity({"1 / x", 0}), "scene.json", "/velocity/0/value", "no finite value at X = (0", "a value"},
    {"infinite constant", velocity({"1 / 0", 0}), "scene.json", "/velocity/0/value/0", "1 / 0", "a value"},
    {"not a number later", rhs({"sqrt(0.9 - t)", 0}), "scene.json", "/boundary_conditions/rhs", "t = 1", "a value"},
    {"E = 0", material("E", 0), "scene.json", "/materials/0/E", "0", "> 0"},
    {"nu = 0.5", material("nu", 0.5), "scene.json", "/materials/0/nu", "0.5", "(-1, 0.5)"},
    {"nu = -1", material("nu", -1), "scene.json", "/materials/0/nu", "-1", "(-1, 0.5)"},
    {"rho = 0", material("rho", 0), "scene.json", "/materials/0/rho", "0", "> 0"},
    {"unknown law", material("type", "Ogden"), "scene.json", "/materials/0/type", "Ogden", "NeoHookean"},
    {"no d-hat", contact("dhat", 0), "scene.json", "/contact/dhat", "0", "> 0"},
    {"negative d-hat", contact("dhat", -1e-3), "scene.json", "/contact/dhat", "-0.001", "> 0"},
    {"negative friction", contact("friction_coefficient", -1), "scene.json", "/contact/friction_coefficient", "-1", ">= 0"},
    {"unknown solver",
     {{"solver", {{"linear", {{"solver", "Cholmodd"}}}}}},
     "scene.json",
     "/solver/linear/solver",
     "Cholmodd",
     "eigen:ldlt"},
    {"unknown solver of Eigen",
     {{"solver", {{"linear", {{"solver", "Eigen::LDLLT"}}}}}},
     "scene.json",
     "/solver/linear/solver",
     "Eigen::LDLLT",
     "eigen:ldlt"},
    {"unknown Newton",
     {{"solver", {{"nonlinear", {{"solver", "newtonn"}}}}}},
     "scene.json",
     "/solver/nonlinear/solver",
     "newtonn",
     "Newton"},
    {"misspelt key",
     {{"contact", {{"friction_coeficient", 1}}}},
     "scene.json",
     "/contact/friction_coeficient",
     "unknown key",
     "\"friction_coefficient\" perhaps"},
    {"key in a wrong place", {{"dhat", 1}}, "scene.json", "/dhat", "unknown key", "/contact/dhat"},
    {"wrong type", {{"contact", {{"enabled", "yes"}}}}, "scene.json", "/contact/enabled", "yes", "true or false"},
    {"unknown output", output("foo", 1), "scene.json", "/output/foo", "unknown key", "known here: advanced"},
    {"singular force", option("contact_force"), "scene.json", "/options/contact_force", "unknown key", "\"contact_forces\""},
    {"von Mises", option("von_mises"), "scene.json", "/options/von_mises", "unknown key", "scalar_values"},
    {"wrong option", output("paraview", {{"options", {{"momentum", 1}}}}), "scene.json", "/momentum", "1", "true or false"},
    {"no frames", output("paraview", {{"skip_frame", 0}}), "scene.json", "/output/paraview/skip_frame", "0", ">= 1"},
    {"wrong period", output("checkpoint_period", "often"), "scene.json", "/checkpoint_period", "often", "number"},
    {"element that is there twice", geometry("twice.obj"), "scene.json", "/geometry/0/mesh", "cell 2", "do not overlap"},
    {"elements without common vertices", geometry("loose.obj"), "scene.json", "/geometry/0/mesh",
     "share no vertices: 6 of them at 4 places", "merge those that coincide"},
    {"tilted plane", geometry("tilted.msh"), "scene.json", "/geometry/0/mesh", "surface mesh", "all vertices at one z"},
    {"surface in space for a plane scene",
     {{"geometry", {{{"mesh", "square.obj"}, {"volume_selection", 1}}, {{"mesh", "wall.obj"}, {"is_obstacle", true}}}}},
     "scene.json",
     "/geometry/1/mesh",
     "a surface in space",
     "a line or a flat mesh"},
    {"negative split tolerance",
     {{"space", {{"remesh", {{"enabled", true}, {"split", {{"acceptance_tolerance", -1}}}}}}}},
     "scene.json",
     "/space/remesh/split/acceptance_tolerance",
     "-1",
     "> 0"},
    {"solver that is meant",
     {{"solver", {{"linear", {{"solver", "choldmod"}}}}}},
     "scene.json",
     "/solver/linear/solver",
     "choldmod",
     "\"cholmod\" perhaps"},
    {"no geometry", {{"geometry", nullptr}}, "scene.json", "/geometry", "nothing", "geometries"},
    {"no materials", {{"materials", nullptr}}, "scene.json", "/materials", "nothing", "materials"},
};

std::ostream& operator<<(std::ostream& out, const Refusal& refusal) { return out << refusal.name; }

std::string name_of(std::string name) {
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return name;
}

class RefusalFolder : public ::testing::Test {
 protected:
  RefusalFolder() : folder_(fs::path(::testing::TempDir()) / ("itr_refusal_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_ / "folder");
    for (const auto& [name, text] : kFiles) std::ofstream(folder_ / name) << text;
  }
  ~RefusalFolder() override { fs::remove_all(folder_); }

  /// Exit status and message.
  std::pair<int, std::string> run(const std::string& scene, const std::string& what = "run") const {
    std::ofstream(folder_ / "scene.json") << scene;
    return command(what + " " + (folder_ / "scene.json").string() + " -o " + (folder_ / "results").string());
  }
  static std::pair<int, std::string> command(const std::string& arguments) {
    const std::string command = std::string(ITR_BINARY_DIR) + "/bin/itr " + arguments + " 2>&1";
    FILE* pipe = popen(command.c_str(), "r");
    std::string text;
    for (std::array<char, 4096> buffer; std::fgets(buffer.data(), buffer.size(), pipe);) text += buffer.data();
    return {WEXITSTATUS(pclose(pipe)), text};
  }

  static Json good_scene() {
    return {{"geometry", {{{"mesh", "square.obj"}, {"volume_selection", 1}}}},
            {"materials", {{{"id", 1}, {"type", "NeoHookean"}, {"E", 1e4}, {"nu", 0.4}, {"rho", 1000}}}},
            {"time", {{"dt", 0.1}, {"tend", 1}}}};
  }

  fs::path folder_;
};

class Refusals : public RefusalFolder, public ::testing::WithParamInterface<Refusal> {};

TEST_P(Refusals, SayFilePlaceFoundAndExpected) {
  const Refusal& refusal = GetParam();
  Json scene = good_scene();
  scene.merge_patch(refusal.changes);
  const auto [status, message] = run(scene.dump());
  ASSERT_FALSE(refusal.found.empty() || refusal.expected.empty()) << "this row could not fail";
  EXPECT_EQ(status, 2) << message;
  EXPECT_FALSE(fs::exists(folder_ / "results")) << "something was computed";
  const auto found_at = message.find("found "), expected_at = message.find("; expected ");
  ASSERT_NE(found_at, std::string::npos) << message;
  ASSERT_NE(expected_at, std::string::npos) << message;
  const std::string head = message.substr(0, found_at), found = message.substr(found_at, expected_at - found_at);
  EXPECT_NE(head.find((folder_ / "").string()), std::string::npos) << message;
  EXPECT_NE(head.find(refusal.file + ":"), std::string::npos) << message;
  EXPECT_NE(head.find(refusal.place), std::string::npos) << message;
  EXPECT_NE(found.find(refusal.found), std::string::npos) << message;
  EXPECT_NE(message.substr(expected_at).find(refusal.expected), std::string::npos) << message;
}

INSTANTIATE_TEST_SUITE_P(All, Refusals, ::testing::ValuesIn(kRefusals),
                         [](const auto& info) { return name_of(info.param.name); });

TEST_F(Refusals, GoodSceneRunsWithoutAWarning) {
  const auto [status, message] = run(good_scene().dump());
  EXPECT_EQ(status, 0) << message;
  EXPECT_EQ(message.find("step 1/10"), 0u) << message;
}

TEST_F(Refusals, SummaryNamesTheSolverThatAutoTook) {
  std::ofstream(folder_ / "scene.json") << good_scene().dump();
  const fs::path results = folder_ / "results";
  const auto [status, message] =
      command("run " + (folder_ / "scene.json").string() + " --solver auto -o " + results.string());
  ASSERT_EQ(status, 0) << message;
  const Json summary = Json::parse(std::ifstream(results / "summary.json"));
  EXPECT_EQ(summary["backend"], "auto");
  EXPECT_EQ(summary["solver"], "dense");  // of 8 unknowns
}

/// Scene that runs, but is perhaps not meant: `run` says so as `explain` does.
struct Suspicion {
  const char* name;
  Json changes;
  std::string warning;
};

const std::vector<Suspicion> kSuspicions = {
    {"contact that is off", {{"contact", {{"dhat", 0.01}}}}, "/contact: without \"enabled\": true nothing collides"},
    {"no density", material("rho", nullptr), "/materials/0/rho: not given, so it is 1"},
    {"odd density", material("rho", 1.1), "are densities in kg/m^3?"},
    {"odd modulus", material("E", 500), "are moduli in Pa?"},
    {"end between steps", {{"time", {{"tend", 1.03}}}}, "the run ends at 1.1 s"},
    {"third component", rhs({0, 0, 9.81}), "has more components than a 2D scene"},
    {"one component", velocity({1}), "has too few components for a 2D scene"},
    {"gravity upwards", rhs({0, -9.81}), "gravity down y is [0, 9.81]"},
    {"nothing held", {{"time", {{"quasistatic", true}}}}, "nothing keeps them in place"},
    {"solver of others", {{"solver", {{"linear", {{"solver", "Hypre"}}}}}}, "no \"Hypre\" here, eigen:ldlt takes its place"},
    {"options of another solver",
     {{"solver", {{"linear", {{"solver", "eigen:llt"}, {"options", {{"eigen:cg", {{"tolerance", 1e-9}}}}}}}}}},
     "/solver/linear/options/eigen:cg: that solver is not used, eigen:llt is"},
    {"output that is not written", option("acceleration"), "/output/paraview/options/acceleration: is not written"},
};

std::ostream& operator<<(std::ostream& out, const Suspicion& suspicion) { return out << suspicion.name; }

class Suspicions : public RefusalFolder, public ::testing::WithParamInterface<Suspicion> {};

TEST_P(Suspicions, AreSaidByRunAndExplain) {
  Json scene = good_scene();
  scene["time"]["tend"] = 0.2;
  scene.merge_patch(GetParam().changes);
  const auto [status, message] = run(scene.dump());
  EXPECT_EQ(status, 0) << message;
  EXPECT_NE(message.find(GetParam().warning), std::string::npos) << message;
  const auto [explained, text] = run(scene.dump(), "explain");
  EXPECT_EQ(explained, 0) << text;
  EXPECT_NE(text.find(GetParam().warning), std::string::npos) << text;
}

INSTANTIATE_TEST_SUITE_P(All, Suspicions, ::testing::ValuesIn(kSuspicions),
                         [](const auto& info) { return name_of(info.param.name); });

TEST_F(Refusals, CommandThatIsMeant) {
  const auto [status, message] = command("rum scene.json");
  EXPECT_EQ(status, 2);
  EXPECT_NE(message.find("no such command: rum; expected run perhaps; one of run, explain"), std::string::npos) << message;
}

TEST_F(Refusals, NumbersThatNoDoubleHolds) {  // found by fuzz_input
  const auto [status, message] = run("{\"time\": {\"dt\": 1e999}}");
  EXPECT_EQ(status, 2) << message;
  EXPECT_NE(message.find("/time/dt: found 1e999"), std::string::npos) << message;
}

TEST_F(Refusals, WrongJsonNamesTheLine) {
  const auto [status, message] = run("{\n  \"geometry\": [\n");
  EXPECT_EQ(status, 2) << message;
  EXPECT_NE(message.find("line 3"), std::string::npos) << message;
}

}  // namespace
}  // namespace itr
