// SPDX-License-Identifier: MIT
// Input that explains itself: the schema says what the reader accepts, `itr explain` says what is modelled.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "itr/core.hpp"
#include "itr/scene.hpp"
#include "linear/choice.hpp"

namespace itr {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

bool has_type(const Json& value, const std::string& type) {
  if (type == "object") return value.is_object();
  if (type == "array") return value.is_array();
  if (type == "string") return value.is_string();
  if (type == "boolean") return value.is_boolean();
  if (type == "number") return value.is_number();
  return value.is_number() && value.get<double>() == std::floor(value.get<double>());
}

/// The keywords that our schema uses; a null member is an absent one.
bool is_valid(const Json& value, const Json& schema) {
  for (const auto& [keyword, argument] : schema.items()) {
    if (keyword == "type" && argument.is_string() && !has_type(value, argument)) return false;
    if (keyword == "type" && argument.is_array() &&
        std::none_of(argument.begin(), argument.end(), [&](const Json& type) { return has_type(value, type); }))
      return false;
    if (keyword == "enum" && std::find(argument.begin(), argument.end(), value) == argument.end()) return false;
    if (keyword == "maximum" && !(value <= argument)) return false;
    if (keyword == "const" && value != argument) return false;
    if (keyword == "not" && is_valid(value, argument)) return false;
    if (keyword == "minimum" && !(value >= argument)) return false;
    if (keyword == "exclusiveMinimum" && !(value > argument)) return false;
    if (keyword == "items")
      for (const auto& item : value)
        if (!is_valid(item, argument)) return false;
    if (keyword == "anyOf" &&
        std::none_of(argument.begin(), argument.end(), [&](const Json& s) { return is_valid(value, s); }))
      return false;
    if (keyword == "required")
      for (const std::string key : argument)
        if (!value.contains(key)) return false;
    if (keyword != "properties") continue;
    for (const auto& [key, member] : value.items())
      if (!member.is_null() && !(argument.contains(key) ? is_valid(member, argument[key]) : false)) return false;
  }
  return true;
}

Json read_json(const fs::path& file) { return Json::parse(std::ifstream(file), nullptr, true, true); }

std::vector<fs::path> example_scenes() {
  std::vector<fs::path> files;
  for (const char* folder : {"examples", "examples/tasks"})
    for (const auto& entry : fs::directory_iterator(fs::path(ITR_SOURCE_DIR) / folder))
      if (entry.path().extension() == ".json") files.push_back(entry.path());
  return files;
}

TEST(Schema, AcceptsWhatTheReaderAccepts) {
  const Json schema = Json::parse(scene::json_schema());
  ASSERT_GE(example_scenes().size(), 3u);
  for (const auto& file : example_scenes()) EXPECT_TRUE(is_valid(read_json(file), schema)) << file;
}

TEST(Schema, RefusesWhatTheReaderRefuses) {
  const Json schema = Json::parse(scene::json_schema());
  const fs::path file = fs::path(ITR_SOURCE_DIR) / "examples/masticator.json";
  const Json good = read_json(file);
  const std::array<std::pair<const char*, Json>, 11> wrong = {{{"/time/dt", -1},
                                                               {"/time/dtt", 1},
                                                               {"/contact/dhat", 0},
                                                               {"/contact/enabled", 1},
                                                               {"/contact/friction_coefficient", -0.1},
                                                               {"/solver/nonlinear/max_iterations", 0},
                                                               {"/solver/rayleigh_damping", {1}},
                                                               {"/space/remesh/split/max_depth", 0.5},
                                                               {"/time/integrator", "RK4"},
                                                               {"/space/remesh/split/culling_threshold", 2},
                                                               {"/output/paraview/options/contact_force", true}}};
  for (const auto& [pointer, value] : wrong) {
    Json scene = good;
    scene[Json::json_pointer(pointer)] = value;
    EXPECT_FALSE(is_valid(scene, schema)) << pointer;
    EXPECT_THROW(scene::read(file, {{pointer, value.dump()}}), InputError) << pointer;
  }
}

std::string explain(const std::string& arguments) {
  const std::string command = std::string(ITR_BINARY_DIR) + "/bin/itr explain " + ITR_SOURCE_DIR "/examples/" + arguments;
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  std::string text;
  for (std::array<char, 4096> buffer; std::fgets(buffer.data(), buffer.size(), pipe);) text += buffer.data();
  pclose(pipe);
  return text;
}

TEST(Explain, NamesTheSolverThatRunWouldTake) {
  const std::string ball = "ball_wall.json ";
  for (const char* on_mpi : {"mumps", "belos:muelu"}) {
    if (!linear::Registry().find(on_mpi).available) continue;
    EXPECT_NE(explain(ball + "--solver " + on_mpi).find(std::string(on_mpi) + " (asked for"), std::string::npos);
  }
}

// 144 unknowns of the cantilever: its 81 vertices less the 9 of its left side, 2 each.
TEST(Explain, CountsTheEntriesOfTheMatrix) {
  const std::filesystem::path file = ITR_SOURCE_DIR "/examples/cantilever.json";
  const auto setup = std::get<itr::Setup<2>>(scene::read(file).setup);
  std::size_t entries = 0, free_vertices = 0;
  const auto is_free = [&](VertexId v) { return setup.mesh.rest(v).x() > 1e-9; };
  for (VertexId v = 0; v < setup.mesh.node_slots(); ++v) free_vertices += is_free(v);
  for (const auto& [a, b] : setup.mesh.edges()) entries += is_free(a) && is_free(b) ? 4 : 0;
  ASSERT_EQ(free_vertices, 72u);
  entries += 3 * free_vertices;
  const double megabytes = linear::estimate_factor_bytes({144, entries, 2, false, 0}) / 1e6;
  const std::string line = fmt::format("matrix {:.1f} MB, factor of a direct solver up to about {:.1f} MB",
                                       12e-6 * static_cast<double>(entries), megabytes);
  EXPECT_NE(explain("cantilever.json").find(line), std::string::npos) << line;
}

}  // namespace
}  // namespace itr
