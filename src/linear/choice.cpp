// SPDX-License-Identifier: MIT
#include "linear/choice.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "forwarding.hpp"
#include "itr/core.hpp"

namespace itr::linear {

namespace {

// Where one solver overtakes another, from verification/solvers/results.csv.
constexpr int kDenseBelow = 60;
constexpr const char* kTasks = "cholmod:tasks";
constexpr double kContributions = 0.7;       ///< memory beside the factor that cholmod:tasks takes, over the factor
constexpr std::size_t kTasksAbove = 10'000;  // nonzeros of the lower triangle, from which solves are as fast as eigen:ldlt's
constexpr std::size_t kSupernodalAbove2d = 60'000, kSupernodalAbove3d = 20'000;  // nonzeros of the lower triangle

double half_of_memory() {
  return 0.5 * static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE));
}

/// Whether factors and what is needed beside them, over the factors, do not fit.
bool outgrows_memory(const MatrixTraits& traits, double beside = 0) {
  const double memory = traits.memory_bytes > 0 ? traits.memory_bytes : half_of_memory();
  return !traits.may_be_indefinite &&
         (1 + beside) * (traits.factor_bytes > 0 ? traits.factor_bytes : estimate_factor_bytes(traits)) > memory;
}

/// Stands for a solver that could not be created in the middle of a run.
class Absent final : public Solver {
 public:
  Absent(std::string name, std::string why) : name_(std::move(name)), why_(std::move(why)) {}
  std::string_view name() const override { return name_; }
  Capabilities capabilities() const override { return {}; }
  Outcome analyze(const SparsityPattern&, const AnalyzeHints&) override { return Outcome::failed; }
  Outcome factorize(std::span<const double>) override { return Outcome::failed; }
  SolveReport solve(std::span<const double>, std::span<double>, int, double) override {
    return {Outcome::failed, std::numeric_limits<double>::infinity()};
  }
  Statistics statistics() const override { return {}; }
  std::string message() const override { return why_; }

 private:
  std::string name_, why_;
};

template <typename Make>
std::unique_ptr<Solver> created_or_absent(const std::string& name, Make&& make) {
  try {
    return make(name);
  } catch (const InputError& error) {
    return std::make_unique<Absent>(name, error.what());
  }
}

class AutoSolver final : public Forwarding {
 public:
  AutoSolver(Registry& registry, bool may_be_indefinite, Logger logger, std::map<std::string, SolverOptions> options)
      : registry_(registry),
        may_be_indefinite_(may_be_indefinite),
        logger_(std::move(logger)),
        options_(std::move(options)) {
    pick({});
  }
  std::string_view name() const override { return "auto"; }

  Outcome analyze(const SparsityPattern& pattern, const AnalyzeHints& hints) override {
    MatrixTraits traits{pattern.order, pattern.nonzeros(), hints.block_size, may_be_indefinite_};
    if (!hints.may_keep_order) factor_bytes_ = 0;
    if (factor_bytes_ == 0 && outgrows_memory(traits, kContributions) && registry_.is_ready(kTasks)) {
      solver_ = create(kTasks);  // where it is picked, the next analysis is for nothing
      const bool is_possible = solver_->analyze(pattern, hints) == Outcome::ok;
      factor_bytes_ =
          is_possible ? sizeof(double) * solver_->statistics().factor_nonzeros : std::numeric_limits<double>::infinity();
    }
    traits.factor_bytes = factor_bytes_;
    pick(traits);
    return solver_->analyze(pattern, hints);
  }
  Outcome factorize(std::span<const double> values) override { return solver_->factorize(values); }
  SolveReport solve(std::span<const double> B, std::span<double> X, int columns, double asked) override {
    return solver_->solve(B, X, columns, asked);
  }

 private:
  const Solver& current() const override { return *solver_; }

  /// With its options; cholmod:tasks has those of cholmod where it has none of its own.
  std::unique_ptr<Solver> create(const std::string& name) {
    return registry_.create(name, options_[name == kTasks && !options_.contains(kTasks) ? "cholmod" : name]);
  }
  void pick(const MatrixTraits& traits) {
    Pick picked = pick_solver(traits, registry_);
    if (!solver_ || picked.name != solver_->name())
      solver_ = created_or_absent(picked.name, [&](const std::string& name) { return create(name); });
    if (traits.order > 0 && std::exchange(told_, picked.name) != picked.name)
      logger_.info("linear solver: auto takes " + picked.name + " for " + std::to_string(traits.order) +
                   " unknowns: " + picked.reason);
  }

  Registry& registry_;
  bool may_be_indefinite_;
  Logger logger_;
  std::map<std::string, SolverOptions> options_;
  std::unique_ptr<Solver> solver_;
  std::string told_;         ///< the last pick that the logger knows
  double factor_bytes_ = 0;  ///< of this step's first pattern, where it was analysed for them
};

/// Does the failure say something about the solver, so that another one may succeed?
bool is_solvers_fault(Outcome outcome) {
  return outcome == Outcome::out_of_memory || outcome == Outcome::not_converged || outcome == Outcome::failed ||
         outcome == Outcome::singular;
}

/// One solver with others behind it. A matrix goes down the list until one copes; the next analysis starts at the top.
class FallbackSolver final : public Forwarding {
 public:
  using Make = std::function<std::unique_ptr<Solver>(const std::string& name)>;
  FallbackSolver(std::unique_ptr<Solver> first, std::vector<std::string> others, Make make, Logger logger)
      : others_(std::move(others)), make_(std::move(make)), logger_(std::move(logger)) {
    solvers_.push_back(std::move(first));
  }
  std::string_view name() const override { return solvers_[0]->name(); }

  Outcome analyze(const SparsityPattern& pattern, const AnalyzeHints& hints) override {
    pattern_ = pattern;
    block_size_ = hints.block_size;
    dofs_.assign(hints.dofs.begin(), hints.dofs.end());
    coordinates_.assign(hints.coordinates.begin(), hints.coordinates.end());
    values_.clear();
    active_ = 0;
    const Outcome first = solvers_[0]->analyze(pattern_, hints);
    return take_over(first, [&] { return analyze_active(); });
  }

  Outcome factorize(std::span<const double> values) override {
    values_.assign(values.begin(), values.end());
    const Outcome first = solvers_[active_]->factorize(values_);
    return take_over(first, [&] { return prepare_active(); });
  }

  /// If all answers are poor, the best one counts, and its solver stays in use.
  SolveReport solve(std::span<const double> B, std::span<double> X, int columns, double asked) override {
    SolveReport best = solvers_[active_]->solve(B, X, columns, asked);
    std::size_t kept = active_;
    Outcome last = best.outcome;
    std::vector<double> other;
    while (is_solvers_fault(last) && advance(last)) {
      last = prepare_active();
      if (last != Outcome::ok) continue;
      other.resize(X.size());
      const SolveReport next = solvers_[active_]->solve(B, other, columns, asked);
      last = next.outcome;
      if (last != Outcome::ok && !(next.relative_residual < best.relative_residual)) continue;
      std::ranges::copy(other, X.begin());
      best = next;
      kept = active_;
    }
    // If no solver has a solution, the outcome is what a factorisation found out about the matrix.
    if (std::isinf(best.relative_residual) && !is_solvers_fault(last)) {
      best.outcome = last;
      kept = active_;
    }
    active_ = kept;
    return best;
  }

 private:
  const Solver& current() const override { return *solvers_[active_]; }

  /// To the next solver, if there is one.
  bool advance(Outcome outcome) {
    if (active_ == others_.size()) return false;
    const Solver& failed = *solvers_[active_];
    if (++active_ == solvers_.size()) solvers_.push_back(created_or_absent(others_[active_ - 1], make_));
    logger_.warning("linear solver " + std::string(failed.name()) + ": " + to_string(outcome) + " (" + failed.message() +
                    "); falling back to " + std::string(solvers_[active_]->name()));
    return true;
  }
  /// The next solvers try until one succeeds or finds out something about the matrix. Otherwise the first failure stays.
  template <typename F>
  Outcome take_over(Outcome first, F&& attempt) {
    const std::size_t start = active_;
    Outcome last = first;
    while (is_solvers_fault(last) && advance(last)) last = attempt();
    if (!is_solvers_fault(last)) return last;
    active_ = start;
    return first;
  }
  Outcome analyze_active() {
    return solvers_[active_]->analyze(pattern_, {.block_size = block_size_, .dofs = dofs_, .coordinates = coordinates_});
  }
  Outcome prepare_active() {
    const Outcome outcome = analyze_active();
    return outcome == Outcome::ok ? solvers_[active_]->factorize(values_) : outcome;
  }

  std::vector<std::string> others_;
  Make make_;
  Logger logger_;
  std::vector<std::unique_ptr<Solver>> solvers_;  ///< those that were needed so far
  std::size_t active_ = 0;
  SparsityPattern pattern_;
  int block_size_ = 1;
  std::vector<int> dofs_;
  std::vector<double> coordinates_, values_;
};

}  // namespace

double estimate_factor_bytes(const MatrixTraits& traits) {
  const double n = traits.order, entries = 8;
  // The entries of a cube, which has the most for its unknowns. Slender bodies have half of them, many small bodies fewer.
  if (traits.block_size == 3) return entries * std::max(double(traits.nonzeros), 20.0 * std::pow(n, 4.0 / 3));
  return entries * std::max(double(traits.nonzeros), 6.0 * n * std::log2(std::max(2.0, n)));
}

Pick pick_solver(const MatrixTraits& traits, const std::function<bool(const char* name)>& is_there) {
  const bool is_3d = traits.block_size == 3;
  if (outgrows_memory(traits)) {
    const char* why = "its factors would not fit into the memory";
    if (is_there("belos:muelu")) return {"belos:muelu", why};
    return {"eigen:cg", why + std::string(", and belos:muelu is not there")};
  }
  if (traits.order <= kDenseBelow && !traits.may_be_indefinite) return {"dense", "tiny"};
  if (!traits.may_be_indefinite && traits.nonzeros > kTasksAbove && !outgrows_memory(traits, kContributions) &&
      is_there(kTasks))
    return {kTasks, "dense blocks of the factor pay, on all threads"};
  const bool is_large = traits.nonzeros > (is_3d ? kSupernodalAbove3d : kSupernodalAbove2d);
  if (!is_large) return {"eigen:ldlt", "small, so nothing is gained by dense blocks"};
  if (traits.may_be_indefinite) {
    for (const char* name : {"mumps", "umfpack"})
      if (is_there(name)) return {name, "large, and it may be indefinite"};
    return {"eigen:ldlt", "it may be indefinite, and neither mumps nor umfpack is there"};
  }
  for (const char* name : {"cholmod", "mumps:spd"})
    if (is_there(name)) return {name, "large: dense blocks of the factor pay"};
  return {"eigen:ldlt", "neither cholmod nor mumps is there"};
}

Pick pick_solver(const MatrixTraits& traits, Registry& registry) {
  return pick_solver(traits, [&](const char* name) { return registry.is_ready(name); });
}

std::unique_ptr<Solver> make_auto_solver(Registry& registry, bool may_be_indefinite, Logger logger,
                                         std::map<std::string, SolverOptions> options) {
  return std::make_unique<AutoSolver>(registry, may_be_indefinite, std::move(logger), std::move(options));
}

std::string choose_name(const LinearOptions& options, Registry& registry) {
  for (const auto& asked : options.solvers) {
    if (asked == "auto") return asked;
    std::string name = Registry::canonical_name(asked);
    if (!name.empty() && registry.find(name).available) return name;
  }
  // An absent solver under one of ITR's own names is an error. A name that ITR does not know only means the default.
  for (const auto& asked : options.solvers)
    if (!Registry::canonical_name(asked).empty()) registry.create(asked);
  return Registry::canonical_name("eigen");
}

std::unique_ptr<Solver> choose_solver(const LinearOptions& options, bool may_be_indefinite, Registry& registry,
                                      const Logger& logger) {
  std::map<std::string, SolverOptions> options_of;
  for (const auto& [name, values] : options.options) options_of[registry.find(name).name] = values;
  const auto make = [&registry, options_of, may_be_indefinite, logger](const std::string& name) {
    if (name == "auto") return make_auto_solver(registry, may_be_indefinite, logger, options_of);
    const auto found = options_of.find(Registry::canonical_name(name));
    return registry.create(name, found == options_of.end() ? SolverOptions() : found->second);
  };

  const std::string first = choose_name(options, registry);
  std::vector<std::string> others;
  for (const auto& asked : options.fallback) {
    if (asked == "auto") {
      others.push_back(asked);
      continue;
    }
    const BackendInfo info = registry.find(asked);
    if (!info.available) {
      logger.warning("linear solver: the fallback " + asked + " is absent: " + info.reason);
      continue;
    }
    if (!registry.is_ready(info.name)) registry.create(info.name);  // says why: now, not in the middle of a step
    others.push_back(info.name);
  }
  // Options are checked now, also those of solvers that run only later; but none is created, or MPI started, in vain.
  const auto may_run = [&](const std::string& name) {
    return first == name || first == "auto" || std::ranges::find(others, name) != others.end() ||
           std::ranges::find(others, "auto") != others.end();
  };
  for (const auto& [name, values] : options_of)
    if (may_run(name) && registry.is_ready(name)) registry.create(name, values);

  auto solver = may_be_indefinite ? with_indefinite(make(first), registry) : make(first);
  if (!others.empty()) solver = std::make_unique<FallbackSolver>(std::move(solver), std::move(others), make, logger);
  return solver;
}

}  // namespace itr::linear
