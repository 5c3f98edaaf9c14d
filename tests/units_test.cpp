// SPDX-License-Identifier: MIT
// Scenes in units of their own: the same numbers as of their twins in SI units, in and out.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>

#include "core/hdf5.hpp"
#include "itr/core.hpp"

namespace itr {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// A system of units by what is one of its own in SI units.
struct System {
  std::string length, mass, time;
  double m, kg, s;
  int dim = 3;

  /// 2D: for a thickness of one unit of length.
  double thickness() const { return dim == 2 ? m : 1; }
  double newton() const { return kg * m / (s * s) / thickness(); }
  double joule() const { return newton() * m; }
  double pascal() const { return kg / (m * s * s); }
  double density() const { return kg / (m * m * m); }
  double speed() const { return m / s; }
  std::string name() const { return length + "-" + mass + "-" + time; }
  double acceleration() const { return m / (s * s); }
};

const System kMetres{"m", "kg", "s", 1, 1, 1};
const System kTonnes{"mm", "t", "s", 1e-3, 1e3, 1};
const System kGrams{"mm", "g", "ms", 1e-3, 1e-3, 1e-3};
const System kCentimetres{"cm", "g", "s", 1e-2, 1e-3, 1};

template <int Dim>
System in(System system) {
  system.dim = Dim;
  return system;
}

constexpr double kSide = 0.2;  // of the block [m]

/// A block of squares, or of six tetrahedra around a diagonal.
template <int Dim>
void write_block(const fs::path& path, const System& by) {
  std::ofstream file(path);
  file.precision(17);
  const int n = Dim == 2 ? 3 : 1;
  const int nodes = Dim == 2 ? (n + 1) * (n + 1) : 8;
  // Irregular: no two edges gain the same.
  const auto odd = [&](int place, int i) { return place + (place > 0 && place < n ? 0.2 * std::sin(7.0 * i) : 0); };
  file << "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n" << nodes << '\n';
  for (int i = 0; i < nodes; ++i) {
    const double h = kSide / by.m / n;
    if (Dim == 2)
      file << i + 1 << ' ' << h * odd(i % (n + 1), i) << ' ' << h * odd(i / (n + 1), i + 7) << " 0\n";
    else
      file << i + 1 << ' ' << h * (i & 1) * (1 + 0.005 * i) << ' ' << h * (i >> 1 & 1) << ' '
           << h * ((i >> 2 & 1) + 0.04 * std::sin(i)) << '\n';
  }
  file << "$EndNodes\n$Elements\n";
  if (Dim == 2) {
    file << 2 * n * n << '\n';
    for (int j = 0, e = 1; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const int a = j * (n + 1) + i + 1;
        file << e++ << " 2 2 1 1 " << a << ' ' << a + 1 << ' ' << a + n + 2 << '\n';
        file << e++ << " 2 2 1 1 " << a << ' ' << a + n + 2 << ' ' << a + n + 1 << '\n';
      }
  } else {
    constexpr int kCells[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
    file << "6\n";
    for (int c = 0; c < 6; ++c) {
      file << c + 1 << " 4 2 1 1";
      for (const int v : kCells[c]) file << ' ' << v + 1;
      file << '\n';
    }
  }
  file << "$EndElements\n";
}

template <int Dim>
Json vector(double x, double y, double z = 0) {
  return Dim == 2 ? Json{x, y} : Json{x, y, z};
}

/// A block that slides over the ground while a plane comes down on it, and is pushed and pressed.
template <int Dim>
Json scene(const System& by, const Json& changes = Json::object()) {
  const double m = by.m, s = by.s, Pa = by.pascal();
  const std::string x = fmt::format("(x/{})", kSide / m), t = fmt::format("(t/{})", 0.02 / s);
  Json json = {{"geometry",
                {{{"mesh", "block.msh"},
                  {"n_refs", 1},
                  {"volume_selection", 1},
                  {"surface_selection",
                   {{{"id", 1}, {"box", {vector<Dim>(-0.01 / m, -0.01 / m), vector<Dim>(0.001 / m, 0.3 / m, 0.3 / m)}}},
                    {{"id", 2}, {"axis", "x"}, {"position", 0.19 / m}},
                    {{"id", 3}, {"axis", "y"}, {"position", 0.95}, {"relative", true}}}}},
                 {{"type", "ground"}, {"height", -0.0005 / m}, {"surface_selection", 7}},
                 {{"type", "plane"},
                  {"point", vector<Dim>(0, 0.201 / m)},
                  {"normal", vector<Dim>(0, -1)},
                  {"name", "press"},
                  {"surface_selection", 8}}}},
               {"materials",
                {{{"id", 1},
                  {"type", "NeoHookean"},
                  {"E", fmt::format("{} * (1 + 0.2 * {})", 1e5 / Pa, x)},
                  {"nu", 0.3},
                  {"rho", 1000 / by.density()}}}},
               {"time", {{"dt", 0.005 / s}, {"tend", 0.02 / s}, {"integrator", "BDF2"}}},
               {"initial_conditions", {{"velocity", {{{"id", 1}, {"value", vector<Dim>(0.5 / by.speed(), 0)}}}}}},
               {"boundary_conditions",
                {{"rhs", vector<Dim>(0, 9.81 / by.acceleration())},
                 {"neumann_boundary", {{{"id", 2}, {"value", vector<Dim>(0, 0)}}}},
                 {"pressure_boundary",
                  {{{"id", 1},
                    {"value", 500 / Pa},
                    {"interpolation", {{"type", "piecewise_linear"}, {"points", {0, 0.02 / s}}, {"values", {0, 1}}}}}}},
                 {"obstacle_displacements",
                  {{{"id", 8},
                    {"value", vector<Dim>(0, -0.4 / by.speed())},
                    {"interpolation", {{"type", "linear_ramp"}, {"from", 0}, {"to", 1 / s}}}}}}}},
               {"contact",
                {{"enabled", true},
                 {"dhat", 0.002 / m},
                 {"epsv", 0.01 / by.speed()},
                 {"friction_coefficient", 0.2},
                 {"use_convergent_formulation", true}}},
               {"solver",
                {{"contact", {{"barrier_stiffness", 1e5 / Pa}, {"friction_iterations", 1}}},
                 {"nonlinear", {{"x_delta", 1e-12 / by.speed()}, {"grad_norm", 1e-16 / (by.newton() * s)}}}}},
               {"output",
                {{"checkpoint_period", 0},
                 {"forces",
                  {{{"name", "press"}, {"obstacles", "press"}, {"about", vector<Dim>(0.1 / m, 0)}},
                   {{"name", "block"}, {"bodies", 1}}}},
                 {"paraview",
                  {{"vtu", true},
                   {"options",
                    {{"contact_forces", true},
                     {"friction_forces", true},
                     {"reaction_forces", true},
                     {"scalar_values", true},
                     {"tensor_values", true},
                     {"kinetic_energy", true},
                     {"momentum", true}}}}}}}};
  Json& traction = json["boundary_conditions"]["neumann_boundary"][0]["value"];
  traction[0] = fmt::format("{} * (y/{}) * {}", 800 / Pa, kSide / m, t);
  if (by.length != "m" || by.mass != "kg" || by.time != "s")
    json["units"] = {{"length", by.length}, {"mass", by.mass}, {"time", by.time}};
  json.merge_patch(changes);
  return json;
}

class UnitsTest : public ::testing::Test {
 protected:
  UnitsTest() : folder_(fs::path(::testing::TempDir()) / ("itr_units_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~UnitsTest() override { fs::remove_all(folder_); }

  int itr(const std::string& arguments) {
    FILE* pipe = popen((std::string(ITR_BINARY_DIR) + "/bin/itr " + arguments + " 2>&1").c_str(), "r");
    said_.clear();
    for (std::array<char, 4096> buffer; std::fgets(buffer.data(), buffer.size(), pipe);) said_ += buffer.data();
    return WEXITSTATUS(pclose(pipe));
  }

  template <int Dim>
  fs::path write(const System& by, const Json& json) {
    const fs::path folder = folder_ / by.name();
    fs::create_directories(folder);
    write_block<Dim>(folder / "block.msh", by);
    std::ofstream(folder / "scene.json") << json.dump(1);
    return folder;
  }
  void run(const fs::path& folder, const std::string& more = "--overwrite") {
    ASSERT_EQ(itr(fmt::format("run {0}/scene.json --threads 1 -o {0}/run {1}", folder.string(), more)), 0) << said_;
  }

  fs::path folder_;
  std::string said_;
};

std::string text(const fs::path& path) {
  std::ostringstream all;
  all << std::ifstream(path).rdbuf();
  return all.str();
}

/// `values` times `unit` against `expected`, by the largest of these.
void expect_same(const std::vector<double>& values, double unit, const std::vector<double>& expected,
                 const std::string& what) {
  constexpr double kRounding = 1e-10;
  ASSERT_EQ(values.size(), expected.size()) << what;
  double largest = 0, error = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    largest = std::max(largest, std::abs(expected[i]));
    error = std::max(error, std::abs(unit * values[i] - expected[i]));
  }
  EXPECT_LE(error, kRounding * largest) << what << ", of " << largest;
}

/// All that two runs have written.
void expect_twins(const fs::path& run, const System& by, const fs::path& metres) {
  const std::vector<std::pair<const char*, double>> sets = {{"/mesh/rest", by.m},
                                                            {"/fields/x", by.m},
                                                            {"/fields/u", by.m},
                                                            {"/fields/v", by.speed()},
                                                            {"/fields/elastic_density", by.pascal()},
                                                            {"/fields/contact_force", by.newton()},
                                                            {"/fields/friction_force", by.newton()},
                                                            {"/fields/von_mises", by.pascal()},
                                                            {"/fields/stress", by.pascal()},
                                                            {"/obstacles/x", by.m},
                                                            {"/totals/kinetic_energy", by.joule()},
                                                            {"/totals/momentum", by.newton() * by.s},
                                                            {"/checkpoint/history/x/0", 1},
                                                            {"/checkpoint/history/v/0", 1}};
  int frames = 0;
  for (const auto& entry : fs::directory_iterator(metres / "frames")) {
    const hdf5::Session session;
    const std::string name = entry.path().filename().string();
    const hdf5::File a = hdf5::File::open(run / "frames" / name), b = hdf5::File::open(entry.path());
    EXPECT_NEAR(a.read_double_attribute("t") * by.s, b.read_double_attribute("t"), 1e-14);
    ++frames;
    for (const auto& [set, unit] : sets)  // at the start stresses are round-off
      if (name != "000000.h5" || std::string(set).starts_with("/mesh"))
        expect_same(a.read_doubles(set).values, unit, b.read_doubles(set).values, name + set);
  }
  EXPECT_EQ(frames, 5);

  const Json summary = Json::parse(text(run / "summary.json")), reference = Json::parse(text(metres / "summary.json"));
  EXPECT_EQ(summary["units"], (Json{{"length", by.length}, {"mass", by.mass}, {"time", by.time}}));
  EXPECT_EQ(summary["vertices"], reference["vertices"]);
  EXPECT_EQ(summary["splits"], reference["splits"]);
  if (reference["splits"]["tried"] > 0) {
    EXPECT_GT(reference["splits"]["accepted"], 3);
  }
  const auto number = [](const Json& json) { return std::vector<double>{json.is_null() ? 0 : json.get<double>()}; };
  for (const char* name : {"elastic", "inertia", "contact", "total"})
    expect_same(number(summary["energy"][name]), by.joule(), number(reference["energy"][name]), name);
  expect_same(number(summary["min_distance"]), by.m, number(reference["min_distance"]), "min_distance");
  expect_same(number(summary["t"]), by.s, number(reference["t"]), "t");
  const double root_of_volume = std::pow(by.m, 0.5 * by.dim);
  expect_same(number(summary["norms"]["l2"]), by.m * root_of_volume, number(reference["norms"]["l2"]), "l2");
  expect_same(number(summary["norms"]["h1_semi"]), root_of_volume, number(reference["norms"]["h1_semi"]), "h1_semi");

  std::istringstream lines(text(run / "forces.csv")), others(text(metres / "forces.csv"));
  std::vector<double> values, expected;
  std::string line, other;
  std::getline(lines, line);
  std::getline(others, other);
  EXPECT_EQ(line, other);
  const int columns = by.dim == 2 ? 3 : 6;
  while (std::getline(lines, line) && std::getline(others, other)) {
    std::istringstream cells(line), of_other(other);
    std::string cell, there;
    for (int i = 0; std::getline(cells, cell, ',') && std::getline(of_other, there, ','); ++i) {
      if (i == 2) {
        EXPECT_EQ(cell, there);
      }
      if (i < 3) continue;
      values.push_back(std::stod(cell) * ((i - 3) % columns < by.dim ? by.newton() : by.joule()));
      expected.push_back(std::stod(there));
    }
  }
  EXPECT_GT(values.size(), 50u);
  expect_same(values, 1, expected, "forces.csv");
}

template <int Dim>
Json remeshed(const System& by, bool with_tolerance) {
  Json json = {{"space", {{"remesh", {{"enabled", true}}}}}};
  json["space"]["remesh"]["relative_tolerance"] = Dim == 2 ? 1e-3 : 1e-2;
  if (with_tolerance) json["space"]["remesh"]["split"]["acceptance_tolerance"] = 1e-3 / by.joule();
  return json;
}

template <int Dim>
void change_plan(Json& json, const System& by, int plan) {
  if (plan == 1) json.merge_patch(remeshed<Dim>(by, true));
  if (plan == 2) json.merge_patch(remeshed<Dim>(by, false));
  if (plan == 3) json.merge_patch(Json{{"space", {{"discr_order", 2}}}});
}

const char* const kPlans[] = {"fixed", "remeshed", "remeshed by default", "quadratic"};

class Twins : public UnitsTest {
 protected:
  template <int Dim>
  void compare(int plan) {
    SCOPED_TRACE(fmt::format("{}D {}", Dim, kPlans[plan]));
    const auto make = [&](const System& system) {
      const System by = in<Dim>(system);
      Json json = scene<Dim>(by);
      change_plan<Dim>(json, by, plan);
      const fs::path folder = write<Dim>(by, json);
      run(folder);
      return folder / "run";
    };
    const fs::path metres = make(kMetres);
    for (const System& system : {kTonnes, kGrams, kCentimetres}) {
      SCOPED_TRACE(system.name());
      expect_twins(make(system), in<Dim>(system), metres);
    }
  }
};

TEST_F(Twins, FixedMesh2d) { compare<2>(0); }
TEST_F(Twins, FixedMesh3d) { compare<3>(0); }
TEST_F(Twins, RemeshedByTolerance2d) { compare<2>(1); }
TEST_F(Twins, RemeshedByTolerance3d) { compare<3>(1); }
TEST_F(Twins, RemeshedByDefault2d) { compare<2>(2); }
TEST_F(Twins, RemeshedByDefault3d) { compare<3>(2); }
TEST_F(Twins, QuadraticElements2d) { compare<2>(3); }

TEST_F(UnitsTest, StaticSceneHasNoTime) {
  const auto make = [&](const System& system) {
    const System by = in<2>(system);
    Json json =
        scene<2>(by, {{"time", nullptr}, {"initial_conditions", nullptr}, {"contact", nullptr}, {"output", nullptr}});
    json["geometry"].erase(2);
    json["geometry"].erase(1);
    Json& conditions = json["boundary_conditions"];
    conditions.erase("obstacle_displacements");
    conditions.erase("pressure_boundary");
    conditions["dirichlet_boundary"] = {{{"id", 1}, {"value", {fmt::format("{}*t", 0.001 / by.m), 0}}}};
    conditions["neumann_boundary"][0]["value"] = {fmt::format("{}*t", 800 / by.pascal()), 0};
    json["solver"] = {{"nonlinear", {{"grad_norm", 1e-10 / by.newton()}}}};
    const fs::path folder = write<2>(by, json);
    run(folder);
    const hdf5::Session session;
    const hdf5::File file = hdf5::File::open(folder / "run/frames/000001.h5");
    EXPECT_EQ(file.read_double_attribute("t"), 1);
    return file.read_doubles("/fields/u").values;
  };
  const std::vector<double> metres = make(kMetres);
  for (const System& by : {kTonnes, kGrams}) expect_same(make(by), by.m, metres, by.name());
}

TEST_F(UnitsTest, PlainContactsStiffnessIsAnEnergy) {
  const auto make = [&](const System& system) {
    const System by = in<2>(system);
    const fs::path folder = write<2>(
        by, scene<2>(by, {{"contact", {{"use_convergent_formulation", false}}},
                          {"solver", {{"contact", {{"barrier_stiffness", 1e9 / by.joule() * std::pow(by.m, 4)}}}}}}));
    run(folder);
    return folder / "run";
  };
  const fs::path metres = make(kMetres);
  expect_twins(make(kTonnes), in<2>(kTonnes), metres);
}

TEST_F(UnitsTest, RunGoesOnWithTheSameBits) {
  const System by = in<2>(kGrams);
  Json json = scene<2>(by);
  change_plan<2>(json, by, 1);
  const fs::path folder = write<2>(by, json);
  run(folder);
  const auto frame = [&](const char* name) { return text(folder / "run/frames" / name); };
  const std::string last = frame("000004.h5"), forces = text(folder / "run/forces.csv");
  run(folder, "--overwrite --set /time/tend=10");
  run(folder, "--resume");
  EXPECT_EQ(text(folder / "run/forces.csv"), forces);
  const auto array = [&] {
    const hdf5::Session session;
    return hdf5::File::open(folder / "run/frames/000004.h5").read_doubles("/fields/x").values;
  };
  const auto resumed = array();
  run(folder);
  EXPECT_EQ(array(), resumed);
  ASSERT_EQ(itr("certify " + (folder / "run").string()), 0) << said_;
}

TEST_F(UnitsTest, ExplainAndRunSpeakInThem) {
  const fs::path folder = write<2>(kTonnes, scene<2>(in<2>(kTonnes)));
  ASSERT_EQ(itr("explain " + (folder / "scene.json").string()), 0) << said_;
  for (const char* words :
       {"units\n  mm, t, s: forces in N, stresses in MPa, energies in mJ, by mm of thickness", "area 4e+04 mm^2",
        "E 0.1191 MPa", "rho 1e-09 t/mm^3", "4 steps of 0.005 s", "bodies accelerate by (0, -9810) mm/s^2", "d-hat 2 mm"})
    EXPECT_NE(said_.find(words), std::string::npos) << words << said_;
  run(folder);
  EXPECT_NE(said_.find(" mJ "), std::string::npos) << said_;
  const hdf5::Session session;
  const hdf5::File file = hdf5::File::open(folder / "run/frames/000004.h5");
  EXPECT_EQ(file.read_text("/units"), "mm t s");
  EXPECT_EQ(file.read_text_attribute("/fields/x", "unit"), "mm");
  EXPECT_EQ(file.read_text_attribute("/fields/stress", "unit"), "MPa");
  EXPECT_EQ(file.read_text_attribute("/fields/elastic_density", "unit"), "mJ/mm^2");
}

TEST_F(UnitsTest, CertificatesAndFailedSolvesSpeakInThem) {
  const System by = in<2>(kCentimetres);
  const Json curved = {{"space", {{"discr_order", 2}}}};
  const fs::path folder = write<2>(by, scene<2>(by, curved));
  const std::regex in_metres("[0-9] m\\b");
  run(folder);
  EXPECT_EQ(itr(fmt::format("certify {}/run", folder.string())), 0) << said_;
  EXPECT_TRUE(std::regex_search(said_, std::regex("by at most [0-9.e-]+ cm, and by [0-9.e-]+ cm"))) << said_;
  EXPECT_FALSE(std::regex_search(said_, in_metres)) << said_;

  const std::string hurried = "--overwrite --set /solver/nonlinear/max_iterations=1";
  EXPECT_EQ(itr(fmt::format("run {0}/scene.json -o {0}/run {1}", folder.string(), hurried)), 3) << said_;
  EXPECT_NE(said_.find("the largest residual"), std::string::npos) << said_;
  EXPECT_FALSE(std::regex_search(said_, in_metres)) << said_;
  EXPECT_FALSE(std::regex_search(said_, std::regex("[0-9] N\\b"))) << said_;
}

TEST_F(UnitsTest, PlacesAndStiffnessesAreInThem) {
  const System by = in<2>(kTonnes);
  const fs::path folder = write<2>(by, scene<2>(by));
  const std::string explain = fmt::format("run {0}/scene.json -o {0}/run --overwrite --set ", folder.string());
  EXPECT_EQ(itr(explain + "/geometry/1/height=50"), 2) << said_;
  EXPECT_TRUE(std::regex_search(said_, std::regex("intersect \\(in mm\\): edge \\([^)]*\\b[1-9][0-9]+[.,)]"))) << said_;
  EXPECT_EQ(itr(explain + "/solver/contact/barrier_stiffness=100 --set /time/tend=0.005"), 0) << said_;
  EXPECT_NE(said_.find("barrier stiffness 100 is "), std::string::npos) << said_;
}

TEST_F(UnitsTest, SecondsAddUpToTheTimeOfTheRun) {
  const System by = in<2>(kMetres);
  const fs::path folder = write<2>(by, scene<2>(by));
  const auto start = std::chrono::steady_clock::now();
  run(folder);
  const double wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const auto check = [&](const char* line, const Json& seconds) {
    double sum = 0;
    for (const auto& [name, part] : seconds.items()) {
      EXPECT_GE(part.get<double>(), -1e-6) << name << " in " << line;
      if (name != "total") sum += part.get<double>();
    }
    EXPECT_NEAR(sum, seconds["total"].get<double>(), 1e-9) << line;
  };
  const Json summary = Json::parse(text(folder / "run/summary.json"))["seconds"];
  check("summary", summary);
  std::istringstream lines(text(folder / "run/steps.jsonl"));
  double steps = 0;
  for (std::string line; std::getline(lines, line);) {
    const Json seconds = Json::parse(line)["seconds"];
    check(line.c_str(), seconds);
    steps += seconds["total"].get<double>();
  }
  const double total = summary["total"];
  EXPECT_GT(total, steps);
  EXPECT_LT(total, wall);
  EXPECT_GT(total, 0.3 * wall);  // starting the process is outside

  run(folder, fmt::format("--resume --set /time/tend={}", 0.03 / by.s));
  const Json resumed = Json::parse(text(folder / "run/summary.json"))["seconds"];
  check("resumed", resumed);
  EXPECT_GT(resumed["total"].get<double>(), total);
}

TEST_F(UnitsTest, MeshInUnitsOfItsOwn) {
  const fs::path folder = write<3>(kGrams, scene<3>(kMetres));
  Json json = scene<3>(kMetres);
  json["geometry"][0]["unit"] = "mm";
  std::ofstream(folder / "scene.json") << json.dump();
  ASSERT_EQ(itr("explain " + (folder / "scene.json").string()), 0) << said_;
  EXPECT_NE(said_.find("volume 0.007969 m^3"), std::string::npos) << said_;
  json = scene<3>(kGrams);
  json["geometry"][0]["unit"] = "";  // PolyFEM's default: the scene's
  std::ofstream(folder / "scene.json") << json.dump();
  ASSERT_EQ(itr("explain " + (folder / "scene.json").string()), 0) << said_;
  EXPECT_NE(said_.find("volume 7.969e+06 mm^3"), std::string::npos) << said_;
}

TEST_F(UnitsTest, ResultsInSiUnitsAreSaidToBe) {
  const fs::path folder = write<2>(kTonnes, scene<2>(in<2>(kTonnes)));
  const std::string explain = "explain " + (folder / "scene.json").string();
  ASSERT_EQ(itr(explain), 0) << said_;
  EXPECT_NE(said_.find("by mm of thickness; results too\n"), std::string::npos) << said_;
  ASSERT_EQ(itr(explain + " --set '/output/units=\"SI\"'"), 0) << said_;
  EXPECT_NE(said_.find("by mm of thickness; results in SI units\n"), std::string::npos) << said_;
}

/// The t of a static solve is 1 in any unit of time.
TEST_F(UnitsTest, StaticsHaveNoTime) {
  const fs::path folder = write<2>(kGrams, scene<2>(in<2>(kGrams), {{"time", nullptr}, {"initial_conditions", nullptr}}));
  run(folder);
  EXPECT_NE(said_.find("step 1/1  t = 1  "), std::string::npos) << said_;
}

TEST(UnitsOf, HaveNamesAndFactors) {
  const Units si;
  EXPECT_EQ(si.text(0.25, "Pa"), "0.25 Pa");
  const Units tonnes("mm", "t", "s"), grams("cm", "g", "ms");
  EXPECT_EQ(tonnes.name("Pa"), "MPa");
  EXPECT_EQ(tonnes.name("J"), "mJ");
  EXPECT_EQ(tonnes.name("N m"), "N mm");
  EXPECT_EQ(tonnes.name("kg/m^3"), "t/mm^3");
  EXPECT_EQ(tonnes.name("m/s^2"), "mm/s^2");
  EXPECT_EQ(grams.name("N"), "(g cm/ms^2)");
  EXPECT_DOUBLE_EQ(grams.factor("N"), 10);
  EXPECT_DOUBLE_EQ(tonnes.factor("J s^2"), 1e-3);
  EXPECT_DOUBLE_EQ(tonnes.factor("kg/m^3"), 1e12);
  EXPECT_DOUBLE_EQ(grams.factor("1/s^2"), 1e6);
  EXPECT_DOUBLE_EQ(tonnes.factor("deg"), 1);
  EXPECT_DOUBLE_EQ(tonnes.factor(""), 1);
}

}  // namespace
}  // namespace itr
