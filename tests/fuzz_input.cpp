// SPDX-License-Identifier: MIT
// Reads mutated scenes and meshes: whatever is in a file, reading it ends, in an InputError or a setup. Meant to run under
// the sanitizers, which turn what is wrong into a crash.
// usage: fuzz_input [SECONDS [SEED]]
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "core/process.hpp"
#include "core/timer.hpp"
#include "itr/core.hpp"
#include "itr/scene.hpp"
#include "mesh/mesh_file.hpp"
#include "simulation/state.hpp"

namespace itr {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Random = std::mt19937;

constexpr unsigned kLongestCase = 20;     ///< [s]
constexpr double kMostMemoryGrowth = 10;  ///< by what the unmutated scenes need

int below(Random& random, std::size_t n) { return static_cast<int>(random() % std::max<std::size_t>(n, 1)); }

std::string text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// Changes some bytes, cuts, repeats or takes out a part.
std::string mutate_bytes(std::string text, Random& random) {
  static const char* const kParts[] = {"-1",
                                       "1e308",
                                       "nan",
                                       "99999999999",
                                       "0",
                                       "\n",
                                       "{",
                                       "]",
                                       "\"",
                                       "$Elements\n",
                                       "f 1 1 1\n",
                                       "\xff",
                                       "element face 9\n",
                                       "property list char int vertex_index\n",
                                       "end_header\n"};
  for (int n = 1 + below(random, 4); n > 0 && !text.empty(); --n) {
    const std::size_t at = below(random, text.size()), length = below(random, std::min<std::size_t>(text.size() - at, 40));
    switch (random() % 6) {
      case 0:
        text[at] = static_cast<char>(random());
        break;
      case 1:
        text.resize(at);
        break;
      case 2:
        text.erase(at, length);
        break;
      case 3:
        text.insert(at, text.substr(at, length));
        break;
      case 4:
        text.insert(at, kParts[below(random, std::size(kParts))]);
        break;
      default:
        text.replace(at, length, kParts[below(random, std::size(kParts))]);
    }
  }
  return text;
}

void collect(Json& value, std::vector<Json*>& all) {
  all.push_back(&value);
  if (value.is_structured())
    for (auto& child : value) collect(child, all);
}

/// Puts values of other kinds and sizes, or copies from elsewhere, in place of some values; drops and renames keys.
Json mutate_values(Json scene, Random& random) {
  static const Json kValues[] = {nullptr,
                                 true,
                                 0,
                                 -1,
                                 1,
                                 2,
                                 1e-300,
                                 1e308,
                                 -0.0,
                                 0.5,
                                 4294967296,
                                 "",
                                 "x",
                                 "1/0",
                                 "sqrt(-1)",
                                 "t^t^t",
                                 "all",
                                 "((((((",
                                 Json::array(),
                                 Json::object(),
                                 {1, 2},
                                 {1, "y"},
                                 {1, 2, 3, 4},
                                 {{"a", 1}},
                                 "NeoHookean",
                                 "meshes/line.obj",
                                 "meshes",
                                 "BDF6"};
  for (int n = 1 + below(random, 3); n > 0; --n) {
    std::vector<Json*> all;
    collect(scene, all);
    Json& target = *all[below(random, all.size())];
    switch (random() % 5) {
      case 0:
      case 1:
        target = kValues[below(random, std::size(kValues))];
        break;
      case 2:
        target = Json(*all[below(random, all.size())]);
        break;
      case 3:
        if (target.is_object() && !target.empty()) target.erase(std::next(target.begin(), below(random, target.size())));
        break;
      default:
        if (target.is_structured() && target.is_array())
          target.push_back(kValues[below(random, std::size(kValues))]);
        else if (target.is_number())
          target = target.get<double>() * (random() % 2 ? -1 : 1e9);
    }
  }
  return scene;
}

/// Refinement and copies may ask for as much memory as they like.
void limit_size(Json& scene) {
  if (!scene.is_object() || !scene.contains("geometry") || !scene["geometry"].is_structured()) return;
  const auto limit = [](Json& geometry) {
    if (!geometry.is_object()) return;
    geometry.erase("array");
    if (geometry.contains("n_refs") && geometry["n_refs"].is_number() && geometry["n_refs"] > 2) geometry["n_refs"] = 2;
  };
  limit(scene["geometry"]);
  for (auto& geometry : scene["geometry"]) limit(geometry);
}

/// The vertices, edges and triangles of a mesh in the .ply format.
std::string as_ply(const MeshFile& mesh, bool binary) {
  std::ostringstream out;
  const auto put = [&](auto value) {
    if (binary)
      out.write(reinterpret_cast<const char*>(&value), sizeof(value));
    else
      out << +value << ' ';
  };
  out << "ply\nformat " << (binary ? "binary_little_endian" : "ascii") << " 1.0\nelement vertex " << mesh.vertices.size()
      << "\nproperty double x\nproperty double y\nproperty double z\nelement face " << mesh.triangles.size()
      << "\nproperty list uchar int vertex_indices\nelement edge " << mesh.edges.size()
      << "\nproperty int vertex1\nproperty int vertex2\nend_header\n";
  for (const Vec<3>& vertex : mesh.vertices)
    for (const double x : vertex) put(x);
  for (const auto& triangle : mesh.triangles) {
    put(std::uint8_t{3});
    for (const int v : triangle) put(v);
  }
  for (const auto& edge : mesh.edges)
    for (const int v : edge) put(v);
  return out.str();
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (auto at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
  return text;
}

class Fuzzer {
 public:
  Fuzzer(const fs::path& examples, unsigned seed)
      : random_(seed), folder_(fs::temp_directory_path() / ("itr_fuzz_" + std::to_string(getpid()))) {
    fs::create_directories(folder_ / "meshes");
    for (const auto& entry : fs::directory_iterator(examples))
      if (entry.path().extension() == ".json") scenes_.push_back(Json::parse(text_of(entry.path())));
    for (const auto& entry : fs::directory_iterator(examples / "meshes"))
      meshes_.emplace_back(entry.path().filename().string(), text_of(entry.path()));
    std::sort(meshes_.begin(), meshes_.end());
    for (const auto& [name, text] : meshes_) write("meshes/" + name, text);
    add_ply();
    for (const Json& scene : scenes_) {
      write("scene.json", scene.dump());
      read();
    }
    least_memory_ = peak_rss_mb();
  }
  ~Fuzzer() { fs::remove_all(folder_); }

  /// Returns whether memory stayed within bounds.
  bool run_case() {
    Json scene = scenes_[below(random_, scenes_.size())];
    const int kind = below(random_, 3);
    if (kind == 0) scene = mutate_values(scene, random_);
    limit_size(scene);
    const std::string text = scene.dump(1);
    write("scene.json", kind == 1 ? without_growth(mutate_bytes(text, random_)) : text);
    const auto& [name, mesh] = meshes_[below(random_, meshes_.size())];
    if (kind == 2) write("meshes/" + name, mutate_bytes(mesh, random_));
    alarm(kLongestCase);
    read();
    alarm(0);
    if (kind == 2) write("meshes/" + name, mesh);
    return peak_rss_mb() < kMostMemoryGrowth * least_memory_;
  }

  int accepted() const { return accepted_; }
  const fs::path& folder() const { return folder_; }

 private:
  /// Every .obj as a text and as a binary .ply, and the scenes with these.
  void add_ply() {
    for (const bool binary : {false, true}) {
      const std::string ending = binary ? ".b.ply" : ".ply";
      for (std::size_t i = 0, n = meshes_.size(); i < n; ++i) {
        const std::string name = meshes_[i].first;
        if (!name.ends_with(".obj")) continue;
        meshes_.emplace_back(replaced(name, ".obj", ending), as_ply(read_mesh_file(folder_ / "meshes" / name), binary));
        write("meshes/" + meshes_.back().first, meshes_.back().second);
      }
      for (std::size_t i = 0, n = scenes_.size(); i < n; ++i)
        if (const std::string text = scenes_[i].dump(); text.find(".obj") != std::string::npos)
          scenes_.push_back(Json::parse(replaced(text, ".obj", ending)));
    }
  }

  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }

  static std::string without_growth(const std::string& text) {
    try {
      Json scene = Json::parse(text);
      limit_size(scene);
      return scene.dump(-1, ' ', false, Json::error_handler_t::replace);
    } catch (const Json::exception&) {
      return text;
    }
  }

  void read() {
    try {
      const scene::Scene scene = scene::read(folder_ / "scene.json");
      std::visit([&](const auto& setup) { start(setup); }, scene.setup);
      ++accepted_;
    } catch (const InputError&) {
    }
  }

  template <int Dim>
  void start(const Setup<Dim>& setup) {
    linear::Registry registry;
    Simulation<Dim>(setup, registry).report();
  }

  Random random_;
  fs::path folder_;
  std::vector<Json> scenes_;
  std::vector<std::pair<std::string, std::string>> meshes_;
  double least_memory_ = 0;
  int accepted_ = 0;
};

}  // namespace
}  // namespace itr

int main(int argc, char** argv) {
  const double seconds = argc > 1 ? std::atof(argv[1]) : 10;
  const unsigned seed = argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 1;
  itr::Fuzzer fuzzer(std::filesystem::path(ITR_SOURCE_DIR) / "examples", seed);
  const double start = itr::seconds_now();
  int cases = 0;
  try {
    for (; itr::seconds_now() - start < seconds; ++cases)
      if (!fuzzer.run_case()) throw std::runtime_error("more than ten times the memory");
  } catch (const std::exception& error) {
    std::printf("case %d of seed %u: %s\n", cases, seed, error.what());
    return 1;
  }
  std::printf("%d cases, %d of them accepted, no crash\n", cases, fuzzer.accepted());
}
