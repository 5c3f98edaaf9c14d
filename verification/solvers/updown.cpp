// SPDX-License-Identifier: MIT
// Worth of CHOLMOD's low-rank updates of a factor between two systems of a run (itr_dump_systems):
//   OPENBLAS_CORETYPE=... itr_updown_bench FIRST SECOND
// Prints one line of JSON: the unknowns in which the matrices differ, the rank of the difference, and seconds to solve the
// second system by a factor of its own, by conjugate gradients over the factor of the first (as Newton does), and by that
// factor updated. The time to find the low-rank form of the difference is not counted.
#include <cholmod.h>
#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "core/timer.hpp"
#include "dump.hpp"
#include "itr/core.hpp"
#include "itr/solver.hpp"
#include "itr/types.hpp"
#include "linear/reuse.hpp"

namespace {

using namespace itr;
using namespace itr::linear;

constexpr double kAskedResidual = 1e-8;  // Newton's (newton/systems.cpp)
constexpr double kRoundOff = 1e-10;      // of the largest entry of the difference
constexpr int kLargest = 4000;           // unknowns whose difference is decomposed

template <typename F>
double seconds(F&& f) {
  const double start = seconds_now();
  f();
  return seconds_now() - start;
}

/// The second matrix less the first one: where it is not zero, and there.
struct Difference {
  std::vector<int> unknowns;
  MatrixX values;
  Difference(const DumpedSystem& first, const DumpedSystem& second) {
    std::map<std::pair<int, int>, double> entries;
    double largest = 0;
    const auto add = [&](const DumpedSystem& system, double sign) {
      for (int j = 0; j < system.pattern.order; ++j)
        for (int p = system.pattern.column_starts[j]; p < system.pattern.column_starts[j + 1]; ++p)
          entries[{system.pattern.row_indices[p], j}] += sign * system.values[p];
    };
    add(second, 1);
    add(first, -1);
    for (const auto& [place, value] : entries) largest = std::max(largest, std::abs(value));
    std::map<int, int> number;
    for (const auto& [place, value] : entries)
      if (std::abs(value) > kRoundOff * largest) number[place.first] = number[place.second] = 0;
    for (auto& [unknown, index] : number) {
      index = static_cast<int>(unknowns.size());
      unknowns.push_back(unknown);
    }
    if (unknowns.size() > kLargest) return;
    values = MatrixX::Zero(index(), index());
    for (const auto& [place, value] : entries) {
      if (std::abs(value) <= kRoundOff * largest) continue;
      const int i = number[place.first], j = number[place.second];
      values(i, j) = values(j, i) = value;
    }
  }
  Eigen::Index index() const { return static_cast<Eigen::Index>(unknowns.size()); }
};

/// A factor L D L^T that CHOLMOD can update.
class UpdatedFactor {
 public:
  explicit UpdatedFactor(const DumpedSystem& system) {
    cholmod_start(&common_);
    common_.supernodal = CHOLMOD_SIMPLICIAL;
    common_.nmethods = 1;
    common_.method[0].ordering = CHOLMOD_AMD;
    const SparsityPattern& pattern = system.pattern;
    cholmod_sparse* matrix =
        cholmod_allocate_sparse(pattern.order, pattern.order, pattern.nonzeros(), 1, 1, -1, CHOLMOD_REAL, &common_);
    std::ranges::copy(pattern.column_starts, static_cast<int*>(matrix->p));
    std::ranges::copy(pattern.row_indices, static_cast<int*>(matrix->i));
    std::ranges::copy(system.values, static_cast<double*>(matrix->x));
    factor_ = cholmod_analyze(matrix, &common_);
    cholmod_factorize(matrix, factor_, &common_);
    cholmod_free_sparse(&matrix, &common_);
  }
  ~UpdatedFactor() {
    cholmod_free_factor(&factor_, &common_);
    cholmod_finish(&common_);
  }
  UpdatedFactor(const UpdatedFactor&) = delete;
  UpdatedFactor& operator=(const UpdatedFactor&) = delete;

  /// Adds (or subtracts) the sum of v v^T of the columns of V, rows of which belong to `unknowns`.
  void add(bool is_update, const std::vector<int>& unknowns, const MatrixX& V) {
    if (V.cols() == 0) return;
    cholmod_sparse* columns = cholmod_allocate_sparse(factor_->n, V.cols(), V.size(), 1, 1, 0, CHOLMOD_REAL, &common_);
    for (Eigen::Index j = 0; j <= V.cols(); ++j) static_cast<int*>(columns->p)[j] = static_cast<int>(j * V.rows());
    for (Eigen::Index k = 0; k < V.size(); ++k) {
      static_cast<int*>(columns->i)[k] = unknowns[k % V.rows()];
      static_cast<double*>(columns->x)[k] = V.data()[k];
    }
    cholmod_sparse* permuted = cholmod_submatrix(columns, static_cast<int*>(factor_->Perm),
                                                 static_cast<SuiteSparse_long>(factor_->n), nullptr, -1, 1, 1, &common_);
    cholmod_updown(is_update ? 1 : 0, permuted, factor_, &common_);
    cholmod_free_sparse(&permuted, &common_);
    cholmod_free_sparse(&columns, &common_);
  }

  VectorX solve(const std::vector<double>& rhs) {
    cholmod_dense* b = cholmod_zeros(rhs.size(), 1, CHOLMOD_REAL, &common_);
    std::ranges::copy(rhs, static_cast<double*>(b->x));
    cholmod_dense* x = cholmod_solve(CHOLMOD_A, factor_, b, &common_);
    VectorX result = Eigen::Map<VectorX>(static_cast<double*>(x->x), static_cast<Eigen::Index>(rhs.size()));
    cholmod_free_dense(&x, &common_);
    cholmod_free_dense(&b, &common_);
    return result;
  }

 private:
  cholmod_common common_{};
  cholmod_factor* factor_ = nullptr;
};

double residual(const DumpedSystem& system, const VectorX& x) {
  VectorX r = Eigen::Map<const VectorX>(system.rhs.data(), x.size());
  const double scale = r.norm();
  for (int j = 0; j < system.pattern.order; ++j)
    for (int p = system.pattern.column_starts[j]; p < system.pattern.column_starts[j + 1]; ++p) {
      const int i = system.pattern.row_indices[p];
      r[i] -= system.values[p] * x[j];
      if (i != j) r[j] -= system.values[p] * x[i];
    }
  return r.norm() / scale;
}

void bench(const DumpedSystem& first, const DumpedSystem& second) {
  Registry registry;
  const auto make = [&] { return registry.create("cholmod"); };
  std::vector<double> x(second.rhs.size());

  const auto own = make();
  own->analyze(second.pattern, second.hints());
  own->factorize(second.values);
  const double refactor = seconds([&] {
    own->factorize(second.values);
    own->solve(second.rhs, x, 1, kAskedResidual);
  });

  const auto old = make();
  ReusingSolver reusing(*old);
  reusing.analyze(first.pattern, first.hints());
  reusing.factorize(first.values);
  reusing.solve(first.rhs, x, 1, kAskedResidual);
  reusing.analyze(second.pattern, second.hints());
  const int before = reusing.counts().factorizations;
  const double iterate = seconds([&] { reusing.solve_system(second.values, second.rhs, {kAskedResidual}, x); });
  const bool has_refactored = reusing.counts().factorizations > before;

  const Difference difference(first, second);
  std::string updated = "null";
  if (difference.unknowns.size() <= kLargest) {
    const Eigen::SelfAdjointEigenSolver<MatrixX> eigen(difference.values);
    const VectorX& w = eigen.eigenvalues();
    const double least = kRoundOff * w.lpNorm<Eigen::Infinity>();
    const Eigen::Index negative = (w.array() < -least).count(), positive = (w.array() > least).count();
    const MatrixX scaled = eigen.eigenvectors() * w.cwiseAbs().cwiseSqrt().asDiagonal();
    UpdatedFactor factor(first);
    const double update = seconds([&] {
      factor.add(true, difference.unknowns, scaled.rightCols(positive));
      factor.add(false, difference.unknowns, scaled.leftCols(negative));
    });
    VectorX solution;
    const double solve = seconds([&] { solution = factor.solve(second.rhs); });
    updated = fmt::format(R"({{"rank":{},"update_s":{:.3g},"solve_s":{:.3g},"residual":{:.1g}}})", positive + negative,
                          update, solve, residual(second, solution));
  }
  fmt::print(
      R"({{"unknowns":{},"changed_unknowns":{},"refactor_s":{:.3g},"iterate_s":{:.3g},"iterations":{},"refactored":{},"updown":{}}})"
      "\n",
      second.pattern.order, difference.unknowns.size(), refactor, iterate, reusing.counts().iterations, has_refactored,
      updated);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("usage: itr_updown_bench FIRST SECOND\n", stderr);
    return 2;
  }
  try {
    const DumpedSystem first = read_system(argv[1]), second = read_system(argv[2]);
    if (first.pattern.order != second.pattern.order)
      throw InputError(
          {argv[2], "", std::to_string(second.pattern.order) + " unknowns", std::to_string(first.pattern.order)});
    bench(first, second);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
  return 0;
}
