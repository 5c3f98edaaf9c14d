// SPDX-License-Identifier: MIT
// A host program that owns MPI: it splits its ranks into two groups of their own, and each group solves another system over
// its own communicator. Started by mpi_test.py on 4 ranks.
#include <mpi.h>

#include <cmath>
#include <cstdio>
#include <string_view>
#include <vector>

#include "itr/core.hpp"
#include "itr/solver.hpp"

namespace {

using namespace itr::linear;

struct Chain {
  SparsityPattern pattern;
  std::vector<double> values;
};

/// n springs between nodes that have `diagonal` each, the first and the last held: positive definite from 2 on.
Chain make_chain(int n, double diagonal) {
  Chain chain;
  chain.pattern.order = n;
  for (int j = 0; j < n; ++j) {
    chain.pattern.column_starts.push_back(static_cast<int>(chain.values.size()));
    chain.pattern.row_indices.push_back(j);
    chain.values.push_back(diagonal);
    if (j + 1 == n) continue;
    chain.pattern.row_indices.push_back(j + 1);
    chain.values.push_back(-1);
  }
  chain.pattern.column_starts.push_back(static_cast<int>(chain.values.size()));
  return chain;
}

/// Whether it finds a matrix indefinite whose diagonal is positive. On no rank this may be an exception that others wait
/// for.
bool tells_indefinite(Solver& solver) {
  const auto [pattern, values] = make_chain(400, 1);
  const std::vector<double> b(400, 1.0);
  std::vector<double> x(400);
  if (solver.analyze(pattern, {}) != Outcome::ok) return false;
  const Outcome outcome = solver.factorize(values);
  return (outcome == Outcome::ok ? solver.solve(b, x, 1, 1e-10).outcome : outcome) == Outcome::not_positive_definite;
}

/// Largest error of the solution of a chain against the exact parabola; negative: it failed.
double chain_error(Solver& solver, int n) {
  const auto [pattern, values] = make_chain(n, 2);
  const std::vector<double> b(n, 1.0);
  std::vector<double> x(n);
  if (solver.analyze(pattern, {}) != Outcome::ok || solver.factorize(values) != Outcome::ok) return -1;
  if (solver.solve(b, x, 1, 1e-10).outcome != Outcome::ok) return -1;
  double error = 0;
  for (int i = 0; i < n; ++i) error = std::max(error, std::abs(x[i] / (0.5 * (i + 1) * (n - i)) - 1));
  return error;
}

/// Iterations end at a residual of 1e-10, of a matrix whose condition is up to a million.
double most_error(const Solver& solver) { return solver.capabilities().iterative ? 1e-4 : 1e-9; }

/// Twice in a row: a session can follow another.
bool solve_in_group(int group, MPI_Comm communicator) {
  int rank = 0;
  MPI_Comm_rank(communicator, &rank);
  bool good = true;
  for (const char* name : {"mumps", "mumps:spd", "belos:muelu"}) {
    Registry registry;
    if (!registry.find(name).available) continue;
    if (rank > 0) {
      registry.serve(name, &communicator);
      continue;
    }
    registry.connect(name, &communicator);
    {
      const auto first = registry.create(name), second = registry.create(name);
      if (name == std::string_view("belos:muelu")) good = good && tells_indefinite(*first);
      for (Solver* solver : {first.get(), second.get(), first.get()}) {
        const double error = chain_error(*solver, 1000 + 500 * group);
        good = good && error >= 0 && error < most_error(*solver);
      }
    }
    registry.disconnect(name);
    const auto alone = registry.create(name);  // on this rank alone again
    const double error = chain_error(*alone, 100);
    good = good && error >= 0 && error < most_error(*alone);
  }
  return good;
}

}  // namespace

int main(int argc, char** argv) {
  {
    Registry registry;
    try {
      registry.create("mumps");
      std::printf("mumps was created before MPI_Init\n");
      return 1;
    } catch (const itr::InputError&) {
    }
    int initialized = 0;
    MPI_Initialized(&initialized);
    if (initialized) {
      std::printf("the library initialised MPI behind its host's back\n");
      return 1;
    }
  }
  int provided = 0;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_MULTIPLE, &provided);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm communicator = MPI_COMM_NULL;
  MPI_Comm_split(MPI_COMM_WORLD, rank % 2, rank, &communicator);
  int good = solve_in_group(rank % 2, communicator) ? 1 : 0;
  MPI_Allreduce(MPI_IN_PLACE, &good, 1, MPI_INT, MPI_MIN, MPI_COMM_WORLD);
  MPI_Comm_free(&communicator);
  MPI_Finalize();  // a module that had finalised it would make this an error
  if (rank == 0) std::printf("%s\n", good ? "ok" : "wrong or failed");
  return good ? 0 : 1;
}
