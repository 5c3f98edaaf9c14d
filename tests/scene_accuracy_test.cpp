// SPDX-License-Identifier: MIT
// The choices of /accuracy: values go with it, those of the scene stay with a sentence, and what has no error bars is
// refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "scene/accuracy.hpp"
#include "scene_folder.hpp"

namespace itr::scene {
namespace {

/// A square above a line, that leaves open what an accuracy chooses.
json open_scene(const json& changes = json::object()) {
  json scene = {
      {"geometry",
       json::array({{{"mesh", "square.obj"}, {"volume_selection", 1}, {"transformation", {{"translation", {0, 0.5}}}}},
                    {{"mesh", "line.obj"}, {"is_obstacle", true}, {"surface_selection", 7}}})},
      {"materials", json::array({{{"id", 1}, {"type", "NeoHookean"}, {"E", 1e4}, {"nu", 0.3}, {"rho", 1000}}})},
      {"boundary_conditions", {{"obstacle_displacements", json::array({{{"id", 7}, {"value", {0, "t"}}}})}}},
      {"time", {{"tend", 1}}},
      {"contact", {{"enabled", true}, {"friction_coefficient", 0.3}}},
      {"space", {{"remesh", {{"enabled", true}}}}},
      {"output", {{"forces", json::array({{{"name", "block"}, {"bodies", 1}}})}}},
      {"accuracy", 0.01}};
  scene.merge_patch(changes);
  return scene;
}

bool tells(const std::vector<std::string>& lines, const std::string& part) {
  return std::any_of(lines.begin(), lines.end(), [&](const std::string& line) { return line.find(part) != line.npos; });
}

TEST_F(SceneTest, TighterAccuracyTightensAllThatItChooses) {
  for (const json& time :
       {json{{"integrator", "BDF2"}}, json{{"integrator", "ImplicitEuler"}}, json{{"quasistatic", true}}}) {
    double tolerance = std::numeric_limits<double>::infinity(), dhat = tolerance, lag = tolerance, mesh = tolerance;
    for (const double accuracy : {0.05, 0.02, 0.01, 0.001}) {
      const Scene scene = read_scene(open_scene({{"accuracy", accuracy}, {"time", time}}));
      const auto& setup = std::get<itr::Setup<2>>(scene.setup);
      EXPECT_TRUE(setup.time.adaptive.enabled);
      EXPECT_TRUE(setup.fields.error_bars);
      EXPECT_LT(setup.time.adaptive.tolerance, tolerance);
      EXPECT_LT(setup.contact.dhat, dhat);
      EXPECT_LT(setup.lagging_tolerance, lag);
      EXPECT_LT(setup.remesh.relative_tolerance, mesh);
      EXPECT_GT(std::min({setup.time.adaptive.tolerance, setup.contact.dhat, setup.lagging_tolerance,
                          setup.remesh.relative_tolerance}),
                0);
      tolerance = setup.time.adaptive.tolerance;
      dhat = setup.contact.dhat;
      lag = setup.lagging_tolerance;
      mesh = setup.remesh.relative_tolerance;
      EXPECT_TRUE(scene.accuracy.kept.empty());
      EXPECT_EQ(scene.accuracy.derived.size(), 6U) << "dt, its tolerance, lag, bars, d-hat, mesh";
      EXPECT_EQ(scene.accuracy.follows_bars, time.contains("quasistatic"));
    }
  }
}

TEST_F(SceneTest, SharesOfTheAccuracyAreWhole) {
  constexpr AccuracyShares kShares;
  EXPECT_DOUBLE_EQ(kShares.mesh + kShares.time + kShares.dhat + kShares.friction, 1);
}

TEST_F(SceneTest, DhatOfAnAccuracyIsNeverLargerThanThatOfAuto) {
  itr::Setup<2> automatic = read2(open_scene({{"accuracy", nullptr}, {"time", {{"dt", 0.01}}}}));
  automatic.choose_defaults();
  EXPECT_DOUBLE_EQ(read2(open_scene({{"accuracy", 0.5}})).contact.dhat, automatic.contact.dhat);
  EXPECT_DOUBLE_EQ(read2(open_scene({{"accuracy", 0.01}})).contact.dhat, 0.1 * automatic.contact.dhat);
}

TEST_F(SceneTest, ValuesOfTheSceneStayWithASentence) {
  struct Case {
    json changes;
    std::string key;
  };
  for (const auto& [changes, key] :
       {Case{{{"time", {{"dt", 0.1}}}}, "/time/dt"},
        Case{{{"time", {{"tend", nullptr}, {"dt", 0.1}, {"time_steps", 3}}}}, "/time/dt"},
        Case{{{"contact", {{"dhat", 0.02}}}}, "/contact/dhat"}, Case{{{"contact", {{"epsv", 0.02}}}}, "/contact/epsv"},
        Case{{{"solver", {{"lagging_tolerance", 0.3}}}}, "/solver/lagging_tolerance"},
        Case{{{"space", {{"remesh", {{"relative_tolerance", 0.3}}}}}}, "/space/remesh/relative_tolerance"},
        Case{{{"space", {{"remesh", {{"split", {{"acceptance_tolerance", 2}}}}}}}},
             "/space/remesh/split/acceptance_tolerance"},
        Case{{{"output", {{"error_bars", false}}}}, "/output/error_bars"},
        Case{{{"space", {{"remesh", {{"enabled", false}}}}}}, "the mesh is fixed"}}) {
    const Scene scene = read_scene(open_scene(changes));
    EXPECT_TRUE(tells(scene.accuracy.kept, key)) << key;
    EXPECT_EQ(scene.accuracy.kept.size(), 1U) << key;
    EXPECT_TRUE(std::none_of(scene.accuracy.derived.begin(), scene.accuracy.derived.end(),
                             [&](const auto& row) { return row.pointer == key; }));
  }
  EXPECT_EQ(read2(open_scene({{"contact", {{"dhat", 0.02}}}})).contact.dhat, 0.02);
  EXPECT_EQ(read2(open_scene({{"time", {{"dt", 0.1}}}})).time.dt, 0.1);
  EXPECT_FALSE(read2(open_scene({{"time", {{"dt", 0.1}}}})).time.adaptive.enabled);
  EXPECT_EQ(read2(open_scene({{"time", {{"dt", "auto"}, {"tolerance", 0.2}}}})).time.adaptive.tolerance, 0.2);
  EXPECT_EQ(read2(open_scene({{"space", {{"remesh", {{"relative_tolerance", 0.3}}}}}})).remesh.relative_tolerance, 0.3);
  EXPECT_EQ(read2(open_scene({{"solver", {{"lagging_tolerance", 0.3}}}})).lagging_tolerance, 0.3);
}

TEST_F(SceneTest, ScenesWithoutBarsAndWrongAccuraciesAreRefused) {
  const auto place = [&](const json& changes) { return failure(open_scene(changes)).place; };
  EXPECT_EQ(place({{"accuracy", 0}}), "/accuracy");
  EXPECT_EQ(place({{"accuracy", 0.6}}), "/accuracy");
  EXPECT_EQ(place({{"accuracy", "fine"}}), "/accuracy");
  EXPECT_EQ(place({{"accuracy", json::object()}}), "/accuracy/value");
  EXPECT_EQ(place({{"accuracy", {{"value", -1}}}}), "/accuracy/value");
  EXPECT_EQ(place({{"accuracy", {{"value", 0.1}, {"of", "plate"}}}}), "/accuracy/of");
  EXPECT_EQ(read_scene(open_scene({{"accuracy", {{"value", 0.1}, {"of", "block"}}}})).accuracy.of, "block");
  EXPECT_EQ(place({{"time", {{"tend", nullptr}}}}), "/time/tend");
  EXPECT_EQ(place({{"defaults", "polyfem"}}), "/accuracy");

  json rigid = open_scene();
  rigid["geometry"][0]["rigid"] = {{"density", 1}};
  const auto parts = failure(rigid);
  EXPECT_EQ(parts.place, "/accuracy");
  EXPECT_NE(parts.found.find("rigid bodies"), parts.found.npos);
  EXPECT_NE(parts.expected.find("no error bars"), parts.expected.npos);
  EXPECT_EQ(place({{"ties", json::array({{{"a", 1}, {"b", 2}}})}}), "/accuracy");
}

TEST_F(SceneTest, ProgramsChooseForThemselves) {
  Geometry<2> geometry;
  geometry.mesh = read2(square()).mesh;
  std::vector<std::string> warnings;
  try {
    make_setup<2>(std::move(geometry), open_scene({{"geometry", nullptr}, {"output", nullptr}}).dump(), {}, warnings);
    FAIL() << "read";
  } catch (const InputError& error) {
    EXPECT_EQ(error.parts().place, "/accuracy");
  }
}

}  // namespace
}  // namespace itr::scene
