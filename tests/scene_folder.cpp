// SPDX-License-Identifier: MIT
#include "scene_folder.hpp"

#include <unistd.h>

#include <fstream>

namespace itr::scene {

SceneTest::SceneTest() : folder_(fs::path(::testing::TempDir()) / ("itr_scene_" + std::to_string(::getpid()))) {
  fs::create_directories(folder_ / "sub");
  write("square.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 4 3\n");
  write("line.obj", "v -1 0 0\nv 1 0 0\nl 1 2\n");
  write("tet.msh",
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n"
        "$Elements\n1\n1 4 2 3 1 1 2 3 4\n$EndElements\n");
  write("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
}

SceneTest::~SceneTest() { fs::remove_all(folder_); }

void SceneTest::write(const std::string& name, const std::string& text) {
  std::ofstream(folder_ / name, std::ios::binary) << text;
}

json SceneTest::square(const json& changes) {
  json scene = {{"defaults", "polyfem"},
                {"geometry", json::array({{{"mesh", "square.obj"}, {"volume_selection", 1}}})},
                {"materials", json::array({{{"id", 1}, {"type", "NeoHookean"}, {"E", 1e4}, {"nu", 0.4}, {"rho", 1000}}})},
                {"time", {{"dt", 0.1}, {"tend", 1}}}};
  scene.merge_patch(changes);
  return scene;
}

Scene SceneTest::read_scene(const json& scene, const std::vector<Override>& overrides) {
  write("scene.json", scene.dump());
  return read(folder_ / "scene.json", overrides);
}
itr::Setup<2> SceneTest::read2(const json& scene, const std::vector<Override>& overrides) {
  return std::get<itr::Setup<2>>(read_scene(scene, overrides).setup);
}

InputError::Parts SceneTest::failure(const json& scene, const std::vector<Override>& overrides) {
  try {
    read_scene(scene, overrides);
  } catch (const InputError& error) {
    return error.parts();
  }
  ADD_FAILURE() << "read without an error: " << scene;
  return {};
}
std::string SceneTest::wrong_place(const json& changes) { return failure(square(changes)).place; }

}  // namespace itr::scene
