// SPDX-License-Identifier: MIT
// The table of keys is true: pages are current, every key has a type, defaults are those of the reader.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "itr/core.hpp"
#include "itr/scene.hpp"
#include "scene/defaults.hpp"
#include "scene/key_table.hpp"

namespace itr::scene {
namespace {

namespace fs = std::filesystem;

std::string text_of(const fs::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

TEST(Reference, CommittedPageIsTheCurrentOne) {
  EXPECT_EQ(text_of(fs::path(ITR_SOURCE_DIR) / "docs/scenes.md"), reference_page())
      << "build/release/bin/itr schema --markdown > docs/scenes.md";
}

/// Calls `visit` with every schema of a value that is read.
template <typename Visit>
void for_each_value(const Json& schema, const std::string& pointer, const Visit& visit) {
  const bool is_inner = schema.contains("properties");
  if (is_inner)
    for (const auto& [key, member] : schema["properties"].items()) for_each_value(member, pointer + "/" + key, visit);
  if (schema.contains("anyOf"))
    for (const Json& one : schema["anyOf"]) for_each_value(one, pointer, visit);
  if (schema.contains("items")) for_each_value(schema["items"], pointer + "/*", visit);
  if (!is_inner) visit(pointer, schema);
}

TEST(Reference, EveryPropertyOfTheSchemaSaysWhatItMayBe) {
  int count = 0;
  for_each_value(Json::parse(json_schema()), "", [&](const std::string& pointer, const Json& schema) {
    ++count;
    EXPECT_FALSE(schema.empty()) << pointer;
    const Entry* entry = key_table().find(pointer);
    if (!entry || entry->key->role != Role::read || !schema.contains("description")) return;
    EXPECT_TRUE(schema.contains("type") || schema.contains("enum") || schema.contains("anyOf") || schema.contains("const"))
        << pointer;
  });
  EXPECT_GT(count, 300);
}

TEST(Reference, EveryKeyHasAMeaning) {
  for (const Key& key : keys()) {
    if (key.pointer.ends_with("/enabled")) continue;  // says it itself
    EXPECT_GT(key.meaning.size(), 0u) << key.pointer;
  }
}

/// All options of a setup in one text.
std::string options_of(const Scene& scene) {
  const auto& s = std::get<Setup<2>>(scene.setup);
  const auto& [t, c, n, r] = std::tie(s.time, s.contact, s.newton, s.remesh);
  std::string text =
      fmt::format("{} {} {} {} {} {} {} {} {} {} {}|", static_cast<int>(t.integrator), t.bdf_order, t.newmark_beta,
                  t.newmark_gamma, t.energy_growth_limit, t.quasistatic, t.is_static, t.step_cuts, t.t0, t.dt, t.steps);
  text +=
      fmt::format("{} {} {} {} {} {} {} {} {}|", c.enabled, c.dhat, c.convergent, c.barrier_stiffness, c.adaptive_stiffness,
                  c.friction_coefficient, c.friction_velocity, c.friction_iterations, c.friction_tolerance);
  text += fmt::format("{} {} {} {} {} {} {} {} {} {} {} {} {}|", n.max_iterations, static_cast<int>(n.norm),
                      n.step_tolerance, n.gradient_tolerance, n.first_gradient_tolerance, n.relative_step_tolerance,
                      n.relative_gradient_tolerance, n.decrement_tolerance, n.energy_tolerance, n.energy_steps,
                      n.project_to_psd, n.projected_iterations, static_cast<int>(n.indefinite));
  text += fmt::format(
      "{} {} {} {}|{} {} {} {} {}|{} {} {} {}|{} {}|{} {}|{} {} {}|", r.enabled, r.sizing_field.enabled,
      static_cast<int>(r.screening), r.relative_tolerance, r.split.enabled, r.split.acceptance_tolerance.value_or(1e99),
      r.split.culling_threshold, r.split.max_depth, r.split.min_edge_length.value_or(1e99), r.collapse.enabled,
      r.collapse.acceptance_tolerance.value_or(1e99), r.collapse.culling_threshold, r.collapse.rel_max_edge_length,
      r.swap.enabled, r.swap.acceptance_tolerance.value_or(1e99), r.smooth.enabled,
      r.smooth.acceptance_tolerance.value_or(1e99), r.local.rings, r.local.max_cells, r.local.max_iterations);
  text += fmt::format("{} {} {} {} {} {} {}|", s.lagging_tolerance, s.lump_mass, s.mesh.num_vertices(),
                      fmt::join(s.linear.solvers, ","), s.linear.fallback.size(), s.linear.options.size(), s.damping.size());
  text += fmt::format(
      "{} {} {} {} {}|", scene.output.skip_frames, scene.output.checkpoint_period, scene.max_threads, scene.directory,
      s.fields.any_forces() || s.fields.von_mises || s.fields.stress || s.fields.kinetic_energy || s.fields.momentum);
  for (VertexId v = 0; v < s.mesh.num_vertices(); ++v) text += fmt::format("{} {} ", s.mesh.rest(v)[0], s.mesh.rest(v)[1]);
  return text;
}

class Defaults : public ::testing::Test {
 protected:
  Defaults() : folder_(fs::path(::testing::TempDir()) / ("itr_defaults_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
    std::ofstream(folder_ / "square.obj") << "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";
  }
  ~Defaults() override { fs::remove_all(folder_); }

  std::string options(const Json& scene) const {
    std::ofstream(folder_ / "scene.json") << scene.dump();
    return options_of(read(folder_ / "scene.json"));
  }

  fs::path folder_;
};

TEST_F(Defaults, OfTheTableAreThoseOfTheReader) {
  const Json base = Json::parse(R"({
    "defaults": "polyfem", "geometry": [{"mesh": "square.obj"}], "materials": {"type": "NeoHookean", "E": 1e4, "nu": 0.4, "rho": 1000},
    "time": {"dt": 0.1, "tend": 1}})");
  int checked = 0;
  for (const Key& key : keys())
    for (const std::string& pattern : expand(key.pointer)) {
      const Entry& entry = *key_table().find(pattern);
      const bool is_option = pattern.starts_with("/time/") || pattern.starts_with("/contact/") ||
                             pattern.starts_with("/solver/") || pattern.starts_with("/space/") ||
                             pattern.starts_with("/output/") || pattern.starts_with("/geometry/*/transformation") ||
                             pattern.starts_with("/geometry/*/advanced") || pattern == "/geometry/*/n_refs";
      const bool is_of_list = pattern.find("/*", 12) != std::string::npos;
      if (key.role != Role::read || entry.fallback.is_discarded() || !is_option || is_of_list) continue;
      if (pattern.starts_with("/contact/collision_mesh")) continue;  // there is none
      Json scene = base;
      if (pattern.ends_with("/beta") || pattern.ends_with("/gamma") || pattern.ends_with("_growth_limit"))
        scene["time"]["integrator"]["type"] = "ImplicitNewmark";
      if (pattern.ends_with("/steps")) scene["time"]["integrator"]["type"] = "BDF";
      if (pattern == "/time/tolerance") scene["time"]["dt"] = "auto";
      Json& nonlinear = scene["solver"]["nonlinear"];  // with the vocabulary of tolerances that the key is of
      if (pattern.ends_with("/x_delta") || pattern.ends_with("/f_delta"))
        nonlinear["grad_norm"] = 1e-8;
      else if (pattern.ends_with("/grad_norm"))
        nonlinear["x_delta"] = 0;
      if (pattern.ends_with("/initial_barrier_stiffness")) scene["solver"]["contact"]["barrier_stiffness"] = "adaptive";
      std::string pointer = pattern;
      if (const auto star = pointer.find('*'); star != std::string::npos) pointer[star] = '0';
      const std::string absent = options(scene);
      scene[Json::json_pointer(pointer)] = entry.fallback;
      EXPECT_EQ(options(scene), absent) << pattern << " = " << entry.fallback;
      ++checked;
    }
  EXPECT_GT(checked, 70);
}

/// A scene that leaves out a key of ITR's table has the value there.
TEST_F(Defaults, OfItrAreThoseOfTheirTable) {
  const Json base = Json::parse(R"({
    "geometry": [{"mesh": "square.obj"}], "materials": {"type": "NeoHookean", "E": 1e4, "nu": 0.4, "rho": 1000},
    "time": {"dt": 0.1, "tend": 1}, "contact": {"enabled": true, "friction_coefficient": 0.2}})");
  const std::string absent = options(base);
  Json peers = base;
  peers["defaults"] = "polyfem";
  EXPECT_NE(options(peers), absent);
  for (const Default& row : itr_defaults()) {
    Json scene = base;
    scene[Json::json_pointer(row.pointer)] = Json::parse(row.value);
    EXPECT_EQ(options(scene), absent) << row.pointer;
    peers[Json::json_pointer(row.pointer)] = Json::parse(row.value);
  }
  EXPECT_EQ(options(peers), absent);
}

/// Each pointer, and each value, that the page says is refused.
TEST_F(Defaults, WhatIsRefusedOrRemovedIsRefusedThere) {
  const auto place_of_refusal = [&](const std::string& pattern, const Json& value) {
    Json scene = Json::parse(R"({"geometry": [{"mesh": "square.obj"}],
                                 "materials": [{"type": "NeoHookean", "E": 1e4, "nu": 0.4, "rho": 1000}]})");
    std::string pointer = pattern;
    for (std::size_t star; (star = pointer.find('*')) != std::string::npos;) pointer[star] = '0';
    scene[Json::json_pointer(pointer)] = value;
    try {
      options(scene);
    } catch (const InputError& error) {
      return error.parts().place == pointer ? pattern : error.parts().place;
    }
    return "nothing is refused of " + pattern + " = " + value.dump();
  };
  int keys_tried = 0;
  for (const Key& key : keys())
    for (const std::string& pattern : expand(key.pointer))
      if (key.role == Role::refused || key.role == Role::only || key.role == Role::removed) {
        EXPECT_EQ(place_of_refusal(pattern, "another"), pattern);
        ++keys_tried;
      }
  EXPECT_GT(keys_tried, 30);
  int values_tried = 0;
  for (const Key& key : keys()) {
    if (key.refused.empty()) continue;
    ++values_tried;
    if (key.refused == "3 and above")
      for (const int value : {3, 4}) EXPECT_EQ(place_of_refusal(key.pointer, value), key.pointer);
    else
      EXPECT_EQ(place_of_refusal(key.pointer, key.refused), key.pointer);
  }
  EXPECT_EQ(values_tried, 2);
}

/// A setup that a program fills in by hand means what a scene with as little in it means (but for Newton's tolerances).
TEST_F(Defaults, OfSetupsAreThoseOfScenes) {
  for (const bool remeshes : {false, true}) {
    std::ofstream(folder_ / "scene.json") << fmt::format(
        R"({{"geometry": [{{"mesh": "square.obj"}}], "time": {{"dt": 0.1, "tend": 1}}, "contact": {{"enabled": true}},
        "defaults": "polyfem", "solver": {{"contact": {{"barrier_stiffness": "auto"}}}}, "space": {{"remesh": {{"enabled": {}}}}},
        "materials": {{"type": "NeoHookean", "E": 1e4, "nu": 0.4, "rho": 1000}}}})",
        remeshes);
    Scene scene = read(folder_ / "scene.json");
    auto& read = std::get<itr::Setup<2>>(scene.setup);
    itr::Setup<2> setup;
    setup.mesh = read.mesh;
    setup.materials = read.materials;
    setup.newton = read.newton;
    setup.time.dt = 0.1;
    setup.time.steps = 10;
    setup.contact.enabled = true;
    setup.remesh.enabled = remeshes;
    EXPECT_EQ(setup.choose_defaults(), read.choose_defaults());
    const std::string of_scene = options_of(scene);
    read = setup;
    EXPECT_EQ(options_of(scene), of_scene);
  }
}

/// Sources that a reader of the repository cannot open are not cited in it.
TEST(Reference, NoCitationsOfWhatIsNotHere) {
  const fs::path root = ITR_SOURCE_DIR;
  const std::string absent[] = {std::string("scene-") + "format", std::string("design ") + "\u00a7",
                                std::string("design") + ".md"};
  for (const char* folder : {"include", "src", "tests", "examples", "backends", "verification/harness"})
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      const auto extension = entry.path().extension();
      if (extension != ".hpp" && extension != ".cpp" && extension != ".py" && extension != ".h") continue;
      const std::string text = text_of(entry.path());
      for (const std::string& citation : absent)
        EXPECT_EQ(text.find(citation), text.npos) << entry.path() << ": " << citation;
    }
}

}  // namespace
}  // namespace itr::scene
