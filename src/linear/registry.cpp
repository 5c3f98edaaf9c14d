// SPDX-License-Identifier: MIT
#include "itr/solver.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <map>
#include <mutex>
#include <set>
#include <utility>

#include "eigen_engines.hpp"
#include "itr/core.hpp"
#include "itr/module.h"
#include "linear/choice.hpp"
#include "modules.hpp"

namespace itr::linear {

namespace {

struct Row {
  BackendInfo info;
  EngineFactory make_engine;            ///< of ours and of modules
  const itr_engine* engine = nullptr;   ///< of a module
  SolverFactory make_solver = nullptr;  ///< of the program
};

Row built_in(const std::string& name, Capabilities capabilities, std::unique_ptr<Engine> (*make)(),
             const std::string& options = "") {
  const std::string version = "Eigen " + std::to_string(EIGEN_WORLD_VERSION) + "." + std::to_string(EIGEN_MAJOR_VERSION) +
                              "." + std::to_string(EIGEN_MINOR_VERSION);
  return {{name, version, "MPL-2.0", options, capabilities, true, ""}, [=](const SolverOptions& asked) {
            auto engine = make();
            apply_options(*engine, name, options, asked);
            return engine;
          }};
}

/// A solver that is not built into every copy, with what brings it.
struct Known {
  const char* name;
  const char* module;
  const char* packages;
};
constexpr Known kKnown[] = {
    {"cholmod", "itr_backend_cholmod", "libsuitesparse-dev libopenblas-dev"},
    {"cholmod:tasks", "itr_backend_cholmod", "libsuitesparse-dev libopenblas-dev"},
    {"cholmod:supernodal", "itr_backend_cholmod", "libsuitesparse-dev libopenblas-dev"},
    {"cholmod:simplicial", "itr_backend_cholmod", "libsuitesparse-dev libopenblas-dev"},
    {"umfpack", "itr_backend_umfpack", "libsuitesparse-dev libopenblas-dev"},
    {"mumps", "itr_backend_mumps", "libmumps-dev libmumps-ptscotch-dev libptscotch-dev libopenmpi-dev"},
    {"mumps:spd", "itr_backend_mumps", "libmumps-dev libmumps-ptscotch-dev libptscotch-dev libopenmpi-dev"},
    {"amesos2:klu2", "itr_backend_trilinos", "trilinos-all-dev"},
    {"amesos2:tacho", "itr_backend_trilinos", "trilinos-all-dev"},
    {"belos:muelu", "itr_backend_trilinos", "trilinos-all-dev"}};

}  // namespace

struct Registry::Impl {
  std::vector<std::filesystem::path> folders;
  std::vector<Row> rows;
  std::set<std::filesystem::path> loaded;
  bool searched = false;
  bool may_start_mpi = false;

  Row* find(const std::string& name) {
    const auto it = std::find_if(rows.begin(), rows.end(), [&](const Row& row) { return row.info.name == name; });
    return it == rows.end() ? nullptr : &*it;
  }

  /// Loads the modules of a folder whose names `wanted` says true to.
  template <typename Wanted>
  void load(const std::filesystem::path& folder, const Wanted& wanted) {
    std::error_code error;
    std::set<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder, error))
      if (entry.path().extension() == ".so" && wanted(entry.path().stem().string())) files.insert(entry.path());
    for (const auto& file : files) {
      if (!loaded.insert(file).second) continue;
      for (auto& row : load_module(file))
        if (const Row* present = find(row.info.name); !present)
          rows.push_back({std::move(row.info), std::move(row.factory), row.engine});
    }
  }

  /// Looks for modules, once. The first folder that has an engine wins.
  void search() {
    if (std::exchange(searched, true)) return;
    for (const auto& folder : folders) load(folder, [](const std::string&) { return true; });
    for (const Known& known : kKnown) {
      if (find(known.name)) continue;
      const Row* broken = find(known.module);  // a row of that name is a file that is there and does not load
      rows.push_back({{known.name,
                       "",
                       "",
                       "",
                       {},
                       false,
                       std::string("module ") + known.module +
                           (broken ? " " + broken->info.reason
                                   : " not found: install " + std::string(known.packages) + " and rebuild")},
                      nullptr});
    }
  }

  /// Returns the row of one of ITR's own names, and searches for modules if it is not built in. A module that is known to
  /// bring only other solvers stays unloaded as long as possible: Trilinos and MUMPS take 40 MB.
  Row* find_anywhere(const std::string& name) {
    if (Row* row = find(name)) return row;
    if (!searched)
      for (const auto& folder : folders) {
        load(folder, [&](const std::string& module) {
          bool brings_others = false;
          for (const Known& known : kKnown) {
            if (module != known.module) continue;
            if (name == known.name) return true;
            brings_others = true;
          }
          return !brings_others;
        });
        if (Row* row = find(name)) return row;
      }
    search();
    return find(name);
  }

  /// Throws InputError where it cannot be created.
  const Row& usable(const std::string& asked);

  static std::string reason(const Row* row) { return row ? row->info.reason : ""; }

  /// By value, as the search may move the rows: NOLINTNEXTLINE(performance-unnecessary-value-param)
  [[noreturn]] void refuse(const std::string& asked, std::string reason_of_absence) {
    search();
    std::string present, absent;
    for (const Row& other : rows) {
      std::string& names = other.info.available ? present : absent;
      names += (names.empty() ? "" : ", ") + other.info.name;
    }
    throw InputError({"", "linear solver",
                      "\"" + asked + "\"" + (reason_of_absence.empty() ? "" : ", which is absent: " + reason_of_absence),
                      "auto or one of " + present + " (absent: " + (absent.empty() ? "none" : absent) + ")"});
  }

  /// Starts MPI where that is allowed and needed.
  bool has_its_mpi(const Row& row) const {
    static std::mutex start;  // one for all modules of the process
    const std::scoped_lock guard(start);
    return !row.engine || !row.engine->prepare_mpi || row.engine->prepare_mpi(may_start_mpi) == ITR_OK;
  }

  const itr_engine& mpi_engine(const std::string& asked) {
    search();
    const Row* row = find(canonical_name(asked));
    if (asked != "auto" && (!row || !row->info.available)) refuse(asked, reason(row));
    if (row && row->engine && row->engine->connect) return *row->engine;
    std::string able;
    for (const Row& other : rows)
      if (other.engine && other.engine->connect) able += (able.empty() ? "" : ", ") + other.info.name;
    throw InputError({"", "linear solver", "\"" + asked + "\", which does not use MPI, on several MPI ranks",
                      able.empty() ? "one rank: no solver that is there uses MPI" : "one rank, or one of " + able});
  }
};

Registry::Registry() : Registry(module_folders()) {}

Registry::Registry(std::vector<std::filesystem::path> folders) : impl_(std::make_unique<Impl>()) {
  impl_->folders = std::move(folders);
  impl_->rows.push_back(built_in("eigen:ldlt", {.indefinite = true, .tells_definiteness = true}, make_eigen_ldlt));
  impl_->rows.push_back(built_in("eigen:llt", {.tells_definiteness = true}, make_eigen_llt));
  impl_->rows.push_back(built_in("eigen:lu", {.indefinite = true}, make_eigen_lu));
  impl_->rows.push_back(built_in("eigen:cg", {.iterative = true}, make_eigen_cg, IterationOptions::kNames));
  impl_->rows.push_back(built_in("dense", {.tells_definiteness = true}, make_dense));
}
Registry::~Registry() = default;
Registry::Registry(Registry&&) noexcept = default;
Registry& Registry::operator=(Registry&&) noexcept = default;

void Registry::add(BackendInfo info, SolverFactory factory) {
  info.available = true;
  if (Row* row = impl_->find(info.name))
    *row = {std::move(info), nullptr, nullptr, std::move(factory)};
  else
    impl_->rows.push_back({std::move(info), nullptr, nullptr, std::move(factory)});
}

std::vector<BackendInfo> Registry::list() {
  impl_->search();
  std::vector<BackendInfo> infos;
  for (const Row& row : impl_->rows) infos.push_back(row.info);
  const auto group = [](const BackendInfo& info) {
    return info.name.rfind("eigen", 0) == 0 ? 0 : info.name == "dense" ? 1 : 2;
  };
  std::stable_sort(infos.begin(), infos.end(), [&](const BackendInfo& a, const BackendInfo& b) {
    return std::pair(group(a), a.name) < std::pair(group(b), b.name);
  });
  return infos;
}

std::string Registry::canonical_name(const std::string& name) {
  static const std::map<std::string, std::string> kAliases = {{"", "eigen:ldlt"},
                                                              {"eigen", "eigen:ldlt"},
                                                              {"amesos2", "amesos2:klu2"},
                                                              {"belos", "belos:muelu"},
                                                              {"Eigen::SimplicialLDLT", "eigen:ldlt"},
                                                              {"Eigen::SimplicialLLT", "eigen:llt"},
                                                              {"Eigen::SparseLU", "eigen:lu"},
                                                              {"Eigen::ConjugateGradient", "eigen:cg"},
                                                              {"Eigen::CholmodSupernodalLLT", "cholmod:tasks"},
                                                              {"Eigen::CholmodSimplicialLLT", "cholmod:simplicial"},
                                                              {"Eigen::CholmodDecomposition", "cholmod"},
                                                              {"Eigen::UmfPackLU", "umfpack"}};
  const auto it = kAliases.find(name);
  if (it != kAliases.end()) return it->second;
  // PolyFEM's solvers that we have no equal of: they change no result, so the default takes their place.
  static const std::set<std::string> kOthers = {"Eigen::SparseQR",
                                                "Eigen::CholmodSimplicialLDLT",
                                                "Eigen::SuperLU",
                                                "Eigen::PardisoLDLT",
                                                "Eigen::PardisoLLT",
                                                "Eigen::PardisoLU",
                                                "Eigen::AccelerateLLT",
                                                "Eigen::AccelerateLDLT",
                                                "Eigen::LeastSquaresConjugateGradient",
                                                "Eigen::DGMRES",
                                                "Eigen::BiCGSTAB",
                                                "Eigen::GMRES",
                                                "Eigen::MINRES",
                                                "Eigen::LDLT",
                                                "Eigen::LLT",
                                                "Eigen::PartialPivLU",
                                                "Eigen::FullPivLU",
                                                "Pardiso",
                                                "Hypre",
                                                "AMGCL",
                                                "AMGCL_cuda",
                                                "MAS",
                                                "Trilinos",
                                                "cuSolverDN"};
  if (kOthers.contains(name)) return {};
  return name;
}

BackendInfo Registry::find(const std::string& asked) {
  const Row* row = impl_->find_anywhere(canonical_name(asked));
  if (!row) impl_->refuse(asked, "");
  return row->info;
}

const Row& Registry::Impl::usable(const std::string& asked) {
  const Row* row = find_anywhere(canonical_name(asked));
  if (!row || !row->info.available) refuse(asked, reason(row));
  if (!has_its_mpi(*row))
    throw InputError({"", "linear solver", "\"" + asked + "\", which runs on MPI, and MPI is not initialised",
                      "MPI_Init before it, or Registry::allow_mpi_start()"});
  return *row;
}

std::unique_ptr<Engine> Registry::create_engine(const std::string& name, const SolverOptions& options) {
  const Row& row = impl_->usable(name);
  return row.make_engine ? row.make_engine(options) : nullptr;
}

std::unique_ptr<Solver> Registry::create(const std::string& asked, const SolverOptions& options) {
  if (asked == "auto" && options.empty()) return make_auto_solver(*this, false, {});
  const Row& row = impl_->usable(asked);
  if (row.make_solver) return row.make_solver(options);
  return make_checked_solver(row.info.name, row.info.capabilities, row.make_engine(options));
}

void Registry::allow_mpi_start() { impl_->may_start_mpi = true; }

bool Registry::is_ready(const std::string& name) {
  const Row* row = impl_->find_anywhere(canonical_name(name));
  if (!row || !row->info.available) return false;
  return impl_->may_start_mpi || impl_->has_its_mpi(*row);
}

void Registry::connect(const std::string& name, const void* communicator) {
  const itr_engine& engine = impl_->mpi_engine(name);
  if (engine.connect(communicator) != ITR_OK)
    throw InputError({"", "linear solver", "\"" + name + "\": MPI cannot be used", "an MPI that the module can initialise"});
}

void Registry::disconnect(const std::string& name) { impl_->mpi_engine(name).disconnect(); }

void Registry::serve(const std::string& name, const void* communicator) {
  if (impl_->mpi_engine(name).serve(communicator) != ITR_OK)
    throw InputError({"", "linear solver", "\"" + name + "\": rank 0 is gone", "ranks that end together"});
}

void apply_options(Engine& engine, const std::string& name, const std::string& known, const SolverOptions& options) {
  for (const auto& [key, value] : options)
    if (!engine.set_option(key, value))
      throw InputError({"", std::string("linear solver ").append(name),
                        std::string("the option ").append(key).append("=").append(value),
                        known.empty() ? "no option: it has none" : std::string("one of ").append(known)});
}

}  // namespace itr::linear
