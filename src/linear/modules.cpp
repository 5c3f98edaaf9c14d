// SPDX-License-Identifier: MIT
#include "modules.hpp"

#include <dlfcn.h>
#include <link.h>

#include <cstdlib>
#include <sstream>

#include "blas_kernels.hpp"
#include "core/profile.hpp"
#include "itr/solver.hpp"

/// The folder of the prefix that a program was linked against: the installed package compiles it into the program.
extern "C" __attribute__((weak)) const char* itr_installed_backends();

namespace itr::linear {

namespace {

/// An engine on the other side of the C boundary.
class ModuleEngine final : public Engine {
 public:
  explicit ModuleEngine(const itr_engine& table) : table_(table), self_(table.create()) {}
  ~ModuleEngine() override {
    if (self_) table_.destroy(self_);
  }
  ModuleEngine(const ModuleEngine&) = delete;
  ModuleEngine& operator=(const ModuleEngine&) = delete;
  bool set_option(const std::string& key, const std::string& value) override {
    return self_ && table_.set_option(self_, key.c_str(), value.c_str()) == ITR_OK;
  }
  Outcome analyze(const SparsityPattern& pattern, const AnalyzeHints& hints) override {
    if (!self_) return Outcome::out_of_memory;
    const itr_pattern view{pattern.order, pattern.column_starts.data(), pattern.row_indices.data()};
    const itr_hints help{hints.block_size, hints.dofs.empty() ? nullptr : hints.dofs.data(),
                         hints.coordinates.empty() ? nullptr : hints.coordinates.data(), hints.may_keep_order};
    return outcome(table_.analyze(self_, &view, &help));
  }
  Outcome factorize(std::span<const double> values) override {
    if (!self_) return Outcome::out_of_memory;
    const Outcome result = outcome(table_.factorize(self_, values.data(), values.size()));
    tell_profile();
    return result;
  }
  Outcome solve(std::span<const double> B, std::span<double> X, int columns) override {
    if (!self_) return Outcome::out_of_memory;
    const Outcome result = outcome(table_.solve(self_, B.data(), X.data(), columns));
    tell_profile();
    return result;
  }
  Statistics statistics() const override {
    itr_statistics s{};
    if (self_) table_.statistics(self_, &s);
    return {s.factor_nonzeros,
            s.factor_bytes,
            s.largest_bytes,
            s.flops,
            static_cast<int>(s.iterations),
            static_cast<int>(s.negative_pivots)};
  }
  std::string message() const override { return self_ ? table_.message(self_) : "no memory for the solver"; }

 private:
  /// Seconds of the tasks of the last call: what more cores would take of it.
  void tell_profile() const {
    if (!Profile::active()) return;
    itr_statistics s{};
    table_.statistics(self_, &s);
    add_loop(s.tasks_wall, s.tasks_work, s.tasks_span);
  }
  static Outcome outcome(int32_t code) {
    return code >= ITR_OK && code <= ITR_FAILED ? static_cast<Outcome>(code) : Outcome::failed;
  }
  const itr_engine& table_;
  void* self_;
};

static_assert(static_cast<int>(Outcome::failed) == ITR_FAILED && static_cast<int>(Outcome::singular) == ITR_SINGULAR);

std::vector<ModuleRow> broken(const std::filesystem::path& file, std::string reason) {
  ModuleRow row;
  row.info.name = file.stem().string();
  row.info.reason = std::move(reason);
  return {row};
}

/// The file that this code was loaded from: the shared library, or the program that it is linked into.
std::filesystem::path own_file() {
  Dl_info info{};
  link_map* map = nullptr;
  if (!dladdr1(reinterpret_cast<void*>(&own_file), &info, reinterpret_cast<void**>(&map), RTLD_DL_LINKMAP) || !map)
    return {};
  std::error_code error;
  // A program's own entry has no name, and info.dli_fname is only what its caller typed.
  return std::filesystem::canonical(map->l_name[0] ? map->l_name : "/proc/self/exe", error);
}

}  // namespace

std::vector<std::filesystem::path> module_folders() {
  std::vector<std::filesystem::path> folders;
  if (const char* path = std::getenv("ITR_BACKEND_PATH")) {
    std::istringstream list(path);
    for (std::string folder; std::getline(list, folder, ':');)
      if (!folder.empty()) folders.emplace_back(folder);
  }
  // Beside the library, or in the lib folder of the program's prefix: an install tree may have been moved.
  if (const auto file = own_file(); !file.empty()) {
    folders.push_back(file.parent_path() / "itr" / "backends");
    folders.push_back(file.parent_path().parent_path() / "lib" / "itr" / "backends");
  }
  if (itr_installed_backends) folders.emplace_back(itr_installed_backends());
  return folders;
}

std::vector<ModuleRow> load_module(const std::filesystem::path& file) {
  void* handle = [&] {
    const BlasEnvironment environment;
    return dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  }();
  if (!handle) {
    const char* why = dlerror();
    return broken(file, std::string("does not load: ") + (why ? why : "unknown reason"));
  }
  const auto entry = reinterpret_cast<itr_backend_entry>(dlsym(handle, ITR_BACKEND_ENTRY));
  if (!entry) return broken(file, "is no solver module: it has no " ITR_BACKEND_ENTRY);
  const itr_module* module = entry();
  if (!module || module->abi_version != ITR_BACKEND_ABI_VERSION)
    return broken(file, "has ABI version " + std::to_string(module ? module->abi_version : 0) + ", this library " +
                            std::to_string(ITR_BACKEND_ABI_VERSION) + ": rebuild it");
  const std::string kernels = blas_kernels(handle);
  std::vector<ModuleRow> rows;
  for (int i = 0; i < module->num_engines; ++i) {
    const itr_engine& engine = module->engines[i];
    const Capabilities capabilities{
        (engine.capabilities & ITR_INDEFINITE) != 0,  (engine.capabilities & ITR_ITERATIVE) != 0,
        (engine.capabilities & ITR_THREADS) != 0,     (engine.capabilities & ITR_MPI) != 0,
        (engine.capabilities & ITR_KEEPS_ORDER) != 0, (engine.capabilities & ITR_TELLS_DEFINITENESS) != 0};
    const std::string version = engine.library_version + (kernels.empty() ? "" : " for " + kernels);
    rows.push_back(
        {{engine.name, version, engine.license, engine.options, capabilities, true, "", advice_on_blas_kernels(kernels)},
         [&engine](const SolverOptions& options) -> std::unique_ptr<Engine> {
           auto instance = std::make_unique<ModuleEngine>(engine);
           apply_options(*instance, engine.name, engine.options, options);
           return instance;
         },
         &engine});
  }
  return rows;
}

}  // namespace itr::linear
