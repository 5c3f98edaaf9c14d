// SPDX-License-Identifier: MIT
#include "itr/linear/registry.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "engine.hpp"
#include "itr/core/error.hpp"
#include "modules.hpp"

namespace itr::linear {

namespace {

struct Row {
  BackendInfo info;
  SolverFactory factory;
};

Row built_in(std::string name, Capabilities capabilities, std::unique_ptr<Engine> (*make)()) {
  const std::string version = "Eigen " + std::to_string(EIGEN_WORLD_VERSION) + "." + std::to_string(EIGEN_MAJOR_VERSION) +
                              "." + std::to_string(EIGEN_MINOR_VERSION);
  return {{name, version, "MPL-2.0", capabilities, true, ""},
          [name, capabilities, make] { return make_checked_solver(name, capabilities, make()); }};
}

/// Solvers that we know of and that are not built into every copy, with what brings them.
const std::map<std::string, std::string>& known_absent() {
  static const std::map<std::string, std::string> kReasons = {
      {"cholmod:supernodal", "module itr_backend_cholmod not found: install libsuitesparse-dev and rebuild"},
      {"cholmod:simplicial", "module itr_backend_cholmod not found: install libsuitesparse-dev and rebuild"},
      {"umfpack", "this version has no module for it yet"},
      {"mumps", "this version has no module for it yet"},
      {"amesos2:klu2", "this version has no module for it yet"},
      {"amesos2:tacho", "this version has no module for it yet"},
      {"belos:muelu", "this version has no module for it yet"}};
  return kReasons;
}

}  // namespace

struct Registry::Impl {
  std::vector<Row> rows;
  bool searched = false;

  Row* find(const std::string& name) {
    const auto it = std::find_if(rows.begin(), rows.end(), [&](const Row& row) { return row.info.name == name; });
    return it == rows.end() ? nullptr : &*it;
  }

  /// Looks for modules, once. The first folder that has an engine wins.
  void search() {
    if (std::exchange(searched, true)) return;
    for (const auto& folder : module_folders()) {
      std::error_code error;
      std::set<std::filesystem::path> files;
      for (const auto& entry : std::filesystem::directory_iterator(folder, error))
        if (entry.path().extension() == ".so") files.insert(entry.path());
      for (const auto& file : files)
        for (auto& row : load_module(file))
          if (const Row* present = find(row.info.name); !present)
            rows.push_back({std::move(row.info), std::move(row.factory)});
    }
    for (const auto& [name, usual_reason] : known_absent()) {
      if (find(name)) continue;
      const std::string module = "itr_backend_" + name.substr(0, name.find(':'));
      const Row* found = find(module);  // a row of that name is a file that is there and does not load
      rows.push_back(
          {{name, "", "", {}, false, found ? "module " + module + " " + found->info.reason : usual_reason}, nullptr});
    }
  }
};

Registry::Registry() : impl_(std::make_unique<Impl>()) {
  impl_->rows.push_back(built_in("eigen:ldlt", {.indefinite = true}, make_eigen_ldlt));
  impl_->rows.push_back(built_in("eigen:llt", {}, make_eigen_llt));
  impl_->rows.push_back(built_in("eigen:lu", {.indefinite = true}, make_eigen_lu));
  impl_->rows.push_back(built_in("eigen:cg", {.iterative = true}, make_eigen_cg));
  impl_->rows.push_back(built_in("dense", {}, make_dense));
}
Registry::~Registry() = default;
Registry::Registry(Registry&&) noexcept = default;
Registry& Registry::operator=(Registry&&) noexcept = default;

void Registry::add(BackendInfo info, SolverFactory factory) {
  if (Row* row = impl_->find(info.name))
    *row = {std::move(info), std::move(factory)};
  else
    impl_->rows.push_back({std::move(info), std::move(factory)});
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
                                                              {"cholmod", "cholmod:supernodal"},
                                                              {"amesos2", "amesos2:klu2"},
                                                              {"belos", "belos:muelu"},
                                                              {"Eigen::SimplicialLDLT", "eigen:ldlt"},
                                                              {"Eigen::SimplicialLLT", "eigen:llt"},
                                                              {"Eigen::SparseLU", "eigen:lu"},
                                                              {"Eigen::ConjugateGradient", "eigen:cg"},
                                                              {"Eigen::CholmodSupernodalLLT", "cholmod:supernodal"},
                                                              {"Eigen::CholmodSimplicialLLT", "cholmod:simplicial"},
                                                              {"Eigen::CholmodDecomposition", "cholmod:supernodal"},
                                                              {"Eigen::UmfPackLU", "umfpack"}};
  const auto it = kAliases.find(name);
  if (it != kAliases.end()) return it->second;
  // Other programs' solvers that we have no equal of.
  if (name.rfind("Eigen::", 0) == 0 || name == "Pardiso" || name == "Hypre" || name == "AMGCL" || name == "MAS" ||
      name == "Trilinos" || name == "cuSolverDN")
    return {};
  return name;
}

std::unique_ptr<Solver> Registry::create(const std::string& asked) {
  const std::string name = canonical_name(asked);
  if (!impl_->find(name)) impl_->search();
  const Row* row = impl_->find(name);
  if (row && row->info.available) return row->factory();
  std::string present, absent;
  for (const auto& info : list()) {
    std::string& names = info.available ? present : absent;
    names += (names.empty() ? "" : ", ") + info.name;
  }
  throw InputError({"", "linear solver", "\"" + asked + "\"" + (row ? ", which is absent: " + row->info.reason : ""),
                    "one of " + present + " (absent: " + absent + ")"});
}

}  // namespace itr::linear
