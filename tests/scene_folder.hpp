// SPDX-License-Identifier: MIT
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <variant>
#include <vector>

#include "itr/core.hpp"
#include "itr/scene.hpp"

namespace itr::scene {

namespace fs = std::filesystem;
using nlohmann::json;

/// A folder with a unit square of two triangles, a line and a tetrahedron, and scenes written into it.
class SceneTest : public ::testing::Test {
 protected:
  SceneTest();
  ~SceneTest() override;

  void write(const std::string& name, const std::string& text);

  /// The least scene with the readers' own defaults, PolyFEM's, and `changes` merged into it.
  static json square(const json& changes = json::object());

  Scene read_scene(const json& scene, const std::vector<Override>& overrides = {});
  itr::Setup<2> read2(const json& scene, const std::vector<Override>& overrides = {});
  InputError::Parts failure(const json& scene, const std::vector<Override>& overrides = {});
  /// Where a scene with these changes is wrong.
  std::string wrong_place(const json& changes);

  fs::path folder_;
};

}  // namespace itr::scene
