// SPDX-License-Identifier: MIT
// A program that embeds the library: reads a scene, registers a linear solver of its own in code, and steps the simulation.
//   own_solver SCENE.json [STEPS]
#include <Eigen/IterativeLinearSolvers>
#include <cstdio>
#include <cstdlib>
#include <itr/core.hpp>
#include <itr/scene.hpp>
#include <itr/simulation.hpp>
#include <itr/solver.hpp>

namespace {

using itr::linear::Outcome;

/// Conjugate gradients preconditioned by Eigen's incomplete Cholesky factor.
class IncompleteCholesky final : public itr::linear::Engine {
 public:
  bool set_option(const std::string&, const std::string&) override { return false; }
  Outcome analyze(const itr::linear::SparsityPattern& pattern, const itr::linear::AnalyzeHints&) override {
    pattern_ = pattern;
    return Outcome::ok;
  }
  Outcome factorize(std::span<const double> values) override {
    matrix_ = Eigen::Map<const Matrix>(pattern_.order, pattern_.order, static_cast<int>(values.size()),
                                       pattern_.column_starts.data(), pattern_.row_indices.data(), values.data());
    solver_.setTolerance(1e-10);
    solver_.compute(matrix_);
    return solver_.info() == Eigen::Success ? Outcome::ok : Outcome::not_positive_definite;
  }
  Outcome solve(std::span<const double> B, std::span<double> X, int columns) override {
    Eigen::Map<Eigen::MatrixXd>(X.data(), pattern_.order, columns) =
        solver_.solve(Eigen::Map<const Eigen::MatrixXd>(B.data(), pattern_.order, columns));
    return solver_.info() == Eigen::Success ? Outcome::ok : Outcome::not_converged;
  }
  itr::linear::Statistics statistics() const override {
    itr::linear::Statistics result;
    if (matrix_.rows() > 0) result.iterations = static_cast<int>(solver_.iterations());
    return result;
  }
  std::string message() const override { return {}; }

 private:
  using Matrix = Eigen::SparseMatrix<double>;
  itr::linear::SparsityPattern pattern_;
  Matrix matrix_;
  Eigen::ConjugateGradient<Matrix, Eigen::Lower, Eigen::IncompleteCholesky<double>> solver_;
};

void add_own_solver(itr::linear::Registry& registry) {
  itr::linear::BackendInfo info;
  info.name = "mine:iccg";
  info.license = "MIT";
  info.capabilities.iterative = true;
  info.available = true;
  registry.add(info, [info](const itr::linear::SolverOptions& options) {
    auto engine = std::make_unique<IncompleteCholesky>();
    itr::linear::apply_options(*engine, info.name, info.options, options);
    return itr::linear::make_checked_solver(info.name, info.capabilities, std::move(engine));
  });
}

template <int Dim>
int run(itr::Setup<Dim> setup, int steps) {
  itr::linear::Registry registry;
  add_own_solver(registry);
  setup.linear.solvers = {"mine:iccg"};
  setup.linear.fallback = {"eigen:ldlt"};
  itr::Simulation<Dim> simulation(std::move(setup), registry, itr::Logger([](itr::LogLevel, std::string_view message) {
                                    std::printf("%.*s\n", static_cast<int>(message.size()), message.data());
                                  }));
  for (int i = 0; i < steps && !simulation.finished(); ++i) {
    const itr::StepResult result = simulation.advance();
    if (!result.ok) {
      std::printf("step %d: %s\n", result.report.step, result.reason.c_str());
      return 1;
    }
    std::printf("t = %g s: %d vertices, %g J\n", result.report.t, result.report.vertices, result.report.energy.total);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: own_solver SCENE.json [STEPS]\n");
    return 2;
  }
  try {
    itr::scene::Scene scene = itr::scene::read(argv[1]);
    const int steps = argc > 2 ? std::atoi(argv[2]) : 1'000'000;
    return std::visit([&](auto& setup) { return run(std::move(setup), steps); }, scene.setup);
  } catch (const itr::InputError& error) {
    std::fprintf(stderr, "own_solver: %s\n", error.what());
    return 2;
  }
}
