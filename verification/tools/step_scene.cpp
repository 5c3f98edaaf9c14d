// SPDX-License-Identifier: MIT
// Steps a scene to its end through the C++ or the C interface, writes nothing, and prints a hash of the final positions.
//   step_scene cpp|c SCENE [POINTER=VALUE]...
#include <itr/itr.h>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <itr/itr.hpp>
#include <string>

namespace {

/// FNV-1a of the bytes.
std::uint64_t hash(const double* values, std::size_t count) {
  std::uint64_t h = 14695981039346656037ull;
  unsigned char bytes[sizeof(double)];
  for (std::size_t i = 0; i < count; ++i) {
    std::memcpy(bytes, &values[i], sizeof bytes);
    for (const unsigned char b : bytes) h = (h ^ b) * 1099511628211ull;
  }
  return h;
}

int fail(const char* message) { return std::fprintf(stderr, "step_scene: %s\n", message), 1; }

int step_cpp(const std::string& scene, const std::vector<itr::scene::Override>& overrides) try {
  itr::AnySimulation simulation(itr::Model::from_scene(scene, overrides));
  while (!simulation.finished())
    if (const auto result = simulation.step(); !result.ok) return fail(result.reason.c_str());
  const auto x = simulation.positions();
  return std::printf("%016llx\n", static_cast<unsigned long long>(hash(x.data(), x.size()))), 0;
} catch (const itr::InputError& error) {
  return fail(error.what());
}

int step_c(const std::string& scene, const std::vector<itr::scene::Override>& overrides) {
  itr_model* model = itr_model_create(2);
  itr_simulation* simulation = nullptr;
  bool ok = itr_model_read_scene(model, scene.c_str()) == ITR_SUCCESS;
  for (const auto& [pointer, value] : overrides)
    ok = ok && itr_model_set_option(model, pointer.c_str(), value.c_str()) == ITR_SUCCESS;
  if (!ok || itr_simulation_create(model, nullptr, nullptr, &simulation) != ITR_SUCCESS)
    return fail(itr_model_message(model));
  while (!itr_finished(simulation))
    if (itr_step(simulation, 0) != ITR_SUCCESS) return fail(itr_simulation_message(simulation));
  const std::size_t count = itr_num_vertices(simulation) * static_cast<std::size_t>(itr_dimension(simulation));
  std::printf("%016llx\n", static_cast<unsigned long long>(hash(itr_positions(simulation), count)));
  itr_simulation_destroy(simulation);
  itr_model_destroy(model);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return fail("usage: step_scene cpp|c SCENE [POINTER=VALUE]...");
  std::vector<itr::scene::Override> overrides;
  for (int i = 3; i < argc; ++i) {
    const std::string argument = argv[i];
    const auto equals = argument.find('=');
    if (equals == std::string::npos) return fail("an override is POINTER=VALUE");
    overrides.push_back({argument.substr(0, equals), argument.substr(equals + 1)});
  }
  return std::strcmp(argv[1], "c") == 0 ? step_c(argv[2], overrides) : step_cpp(argv[2], overrides);
}
