// SPDX-License-Identifier: MIT
#include "itr/linear/registry.hpp"

#include <Eigen/SparseCholesky>

#include "itr/core/error.hpp"

namespace itr::linear {

const char* to_string(Outcome) { return ""; }

namespace {
class Ldlt final : public Solver {
 public:
  std::string_view name() const override { return "eigen:ldlt"; }
  Capabilities capabilities() const override { return {.indefinite = true}; }
  Outcome analyze(const SparsityPattern& p, const AnalyzeHints&) override {
    n_ = p.order;
    std::vector<double> zero(p.nonzeros(), 0);
    A_ = Eigen::Map<const Eigen::SparseMatrix<double>>(n_, n_, p.nonzeros(), p.column_starts.data(), p.row_indices.data(), zero.data());
    solver_.analyzePattern(A_);
    return Outcome::ok;
  }
  Outcome factorize(std::span<const double> v) override {
    std::copy(v.begin(), v.end(), A_.valuePtr());
    solver_.factorize(A_);
    return solver_.info() == Eigen::Success ? Outcome::ok : Outcome::singular;
  }
  SolveReport solve(std::span<const double> B, std::span<double> X, int, double) override {
    Eigen::Map<const Eigen::VectorXd> b(B.data(), n_);
    Eigen::Map<Eigen::VectorXd> x(X.data(), n_);
    x = solver_.solve(b);
    return {};
  }
  std::string message() const override { return {}; }

 private:
  int n_ = 0;
  Eigen::SparseMatrix<double> A_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver_;
};
}  // namespace

struct Registry::Impl {};
Registry::Registry() : impl_(new Impl) {}
Registry::~Registry() = default;
Registry::Registry(Registry&&) noexcept = default;
Registry& Registry::operator=(Registry&&) noexcept = default;
void Registry::add(BackendInfo, SolverFactory) {}
std::vector<BackendInfo> Registry::list() { return {{"eigen:ldlt", "", "", {}, true, ""}}; }
std::string Registry::canonical_name(const std::string& n) { return n == "eigen" ? "eigen:ldlt" : ""; }
std::unique_ptr<Solver> Registry::create(const std::string&) { return std::make_unique<Ldlt>(); }
double self_test_residual(Solver&) { return 0; }
}  // namespace itr::linear
