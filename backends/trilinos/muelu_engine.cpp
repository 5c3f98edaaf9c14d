// SPDX-License-Identifier: MIT
// Belos' conjugate gradients preconditioned by MueLu's smoothed aggregation, for systems too large to factorise. The
// near-null space is that of the rigid body modes at the positions that the analysis is given (Vanek, Mandel & Brezina
// 1996); nodes with held components are filled up with unit rows, so that every node has the same number of unknowns.
// Rank 0 owns the system; matrix, hierarchy and vectors are spread over it and those who serve.
#include <array>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "../common/full_matrix.hpp"
#include "../common/rank_session.hpp"
#include "muelu_part.hpp"
#include "trilinos.hpp"

namespace itr::backends {

namespace {

constexpr int kBegin = 1, kAnalyze = 2, kFactorize = 3, kSolve = 4, kEnd = 5;

RankSession session;  // under Trilinos' lock

/// Ends all ranks: one that fails leaves the others waiting for it.
[[noreturn]] void give_up(const std::exception& error) {
  std::fprintf(stderr, "belos:muelu over %d ranks: %s\n", session.ranks(), error.what());
  MPI_Abort(session.communicator(), 1);
  std::abort();
}

/// Rank 0's side of an instance, or of one that works on its own rank alone.
class SharedPart {
 public:
  SharedPart()
      : number_(session.number()),
        is_shared_(session.is_shared()),
        instance_(session.new_instance()),
        communicator_(session.communicator()) {
    call(kBegin, [&] { part_ = std::make_unique<MueluPart>(communicator_); });
  }
  ~SharedPart() {
    if (is_alive()) call(kEnd, [&] { part_.reset(); });
  }
  SharedPart(const SharedPart&) = delete;
  SharedPart& operator=(const SharedPart&) = delete;

  void analyze(const MueluSystem& system) {
    call(kAnalyze, [&] { part_->analyze(system); });
  }
  void factorize(const std::vector<double>& values) {
    call(kFactorize, [&] { part_->factorize(values); });
  }
  int solve(const std::vector<double>& b, std::vector<double>& x, const linear::IterationOptions& options) {
    int outcome = ITR_FAILED;
    call(kSolve, [&] { outcome = part_->solve(b, x, options); });
    return outcome;
  }
  int iterations() const { return part_->iterations(); }
  const std::string& message() const { return part_->message(); }

 private:
  /// One on its own rank does not care who connects or leaves.
  bool is_alive() const { return !is_shared_ || number_ == session.number(); }

  template <typename F>
  void call(int job, F&& f) {
    if (!is_alive()) throw std::runtime_error("the MPI ranks of this solver are gone");
    if (!is_shared_) return f();
    session.send({job, instance_, 0});
    try {
      f();
    } catch (const std::exception& error) {
      give_up(error);
    }
  }

  int number_;
  bool is_shared_;
  int instance_;
  MPI_Comm communicator_;
  std::unique_ptr<MueluPart> part_;
};

class Muelu {
 public:
  int set_option(std::string_view key, std::string_view value) { return options_.set(key, value) ? ITR_OK : ITR_FAILED; }

  int analyze(const itr_pattern& pattern, const itr_hints& hints) {
    part_.reset();
    fill_up(pattern, hints);
    const itr_pattern padded{static_cast<int32_t>(starts_.size() - 1), starts_.data(), rows_.data()};
    full_.set_pattern(padded);
    MueluSystem system{block_, full_.starts, full_.indices, {}, {}};
    set_near_null_space(hints, system);
    part_ = std::make_unique<SharedPart>();
    part_->analyze(system);
    return ITR_OK;
  }

  int factorize(const double* values, size_t count) {
    message_.clear();
    double diagonal = 0;
    for (const int p : diagonals_) {
      if (!(values[p] > 0)) {
        message_ = "a diagonal entry is not positive";
        return ITR_NOT_POSITIVE_DEFINITE;
      }
      diagonal += values[p] / diagonals_.size();
    }
    lower_.assign(rows_.size(), diagonal);  // also of the unknowns that fill up nodes
    for (size_t k = 0; k < count; ++k) lower_[place_[k]] = values[k];
    full_.set_values(lower_.data(), lower_.size());
    part_->factorize(full_.values);
    return ITR_OK;
  }

  int solve(const double* rhs, double* solution, int columns) {
    iterations_ = 0;
    int outcome = ITR_OK;
    for (int c = 0; c < columns; ++c) {
      const auto offset = static_cast<size_t>(c) * dofs_.size();
      b_.assign(full_.order, 0.0);
      for (size_t i = 0; i < dofs_.size(); ++i) b_[dofs_[i]] = rhs[offset + i];
      const int of_column = part_->solve(b_, x_, options_);
      iterations_ += part_->iterations();
      for (size_t i = 0; i < dofs_.size(); ++i) solution[offset + i] = x_[dofs_[i]];
      if (of_column == ITR_OK || outcome == ITR_NOT_POSITIVE_DEFINITE) continue;
      outcome = of_column;
      message_ = part_->message();
    }
    return outcome;
  }

  itr_statistics statistics() const {
    itr_statistics result{};
    result.iterations = iterations_;
    return result;
  }
  const char* message() const { return message_.c_str(); }

 private:
  /// Numbers the unknowns so that each node has block_ of them, one after another.
  void fill_up(const itr_pattern& pattern, const itr_hints& hints) {
    block_ = hints.dofs ? hints.block_size : 1;
    dofs_.resize(pattern.order);
    int nodes = 0;
    for (int i = 0, last = -1; i < pattern.order; ++i) {
      const int dof = hints.dofs ? hints.dofs[i] : i, node = dof / block_;
      nodes += node != last;
      last = node;
      dofs_[i] = (nodes - 1) * block_ + dof % block_;
    }
    std::vector<int> unknown(static_cast<size_t>(nodes) * block_, -1);
    for (int i = 0; i < pattern.order; ++i) unknown[dofs_[i]] = i;
    starts_.assign(1, 0);
    rows_.clear();
    place_.resize(pattern.column_starts[pattern.order]);
    diagonals_.clear();
    for (size_t j = 0; j < unknown.size(); ++j) {
      const int column = unknown[j];
      if (column < 0) {
        rows_.push_back(static_cast<int>(j));
      } else {
        diagonals_.push_back(pattern.column_starts[column]);
        for (int p = pattern.column_starts[column]; p < pattern.column_starts[column + 1]; ++p) {
          place_[p] = static_cast<int>(rows_.size());
          rows_.push_back(dofs_[pattern.row_indices[p]]);
        }
      }
      starts_.push_back(static_cast<int>(rows_.size()));
    }
  }

  /// Translations, and rotations about the mean position where positions are known.
  void set_near_null_space(const itr_hints& hints, MueluSystem& system) const {
    const bool has_positions = hints.coordinates && (block_ == 2 || block_ == 3);
    const int modes = !has_positions ? block_ : block_ == 2 ? 3 : 6;
    system.modes.assign(modes, std::vector<double>(full_.order));
    const auto order = static_cast<int>(dofs_.size());
    std::array<double, 3> center{};
    if (has_positions)
      for (int i = 0; i < order; ++i)
        for (int c = 0; c < block_; ++c) center[c] += hints.coordinates[static_cast<size_t>(i) * block_ + c] / order;
    for (int i = 0; i < order; ++i) {
      const int row = dofs_[i], component = row % block_;
      system.modes[component][row] = 1;
      if (!has_positions) continue;
      std::array<double, 3> r{};
      for (int c = 0; c < block_; ++c) r[c] = hints.coordinates[static_cast<size_t>(i) * block_ + c] - center[c];
      if (block_ == 2) {
        system.modes[2][row] = component == 0 ? -r[1] : r[0];
      } else {  // e_k x r
        for (int k = 0; k < 3; ++k) {
          const std::array<double, 3> axis{double(k == 0), double(k == 1), double(k == 2)};
          const int a = (component + 1) % 3, b = (component + 2) % 3;
          system.modes[3 + k][row] = axis[a] * r[b] - axis[b] * r[a];
        }
      }
    }
    if (!has_positions) return;
    system.coordinates.assign(block_, std::vector<double>(full_.order / block_));
    for (int c = 0; c < block_; ++c)
      for (int i = 0; i < order; ++i)
        system.coordinates[c][dofs_[i] / block_] = hints.coordinates[static_cast<size_t>(i) * block_ + c];
  }

  linear::IterationOptions options_{1e-10, 1000};
  FullMatrix full_;
  std::unique_ptr<SharedPart> part_;
  int block_ = 1;
  int iterations_ = 0;
  std::vector<int> dofs_;           ///< row of each unknown in the filled-up system
  std::vector<int> starts_, rows_;  ///< lower triangle of the filled-up system
  std::vector<int> place_;          ///< where each entry of the given triangle goes in it
  std::vector<int> diagonals_;      ///< of the given triangle
  std::vector<double> lower_, b_, x_;
  std::string message_;
};

void disconnect() {
  const std::scoped_lock guard(trilinos_lock());
  session.end();
}

int connect(const void* communicator) {
  const std::scoped_lock guard(trilinos_lock());
  if (!session.join(communicator)) return ITR_FAILED;
  // A program that ends without a word must not leave the others waiting.
  static const int registered = std::atexit(disconnect);
  return registered == 0 ? ITR_OK : ITR_FAILED;
}

void run(const RankCommand& command, std::map<int, std::unique_ptr<MueluPart>>& parts) {
  if (command.job == kBegin) {
    parts[command.instance] = std::make_unique<MueluPart>(session.communicator());
    return;
  }
  MueluPart& part = *parts.at(command.instance);
  std::vector<double> nothing;
  if (command.job == kAnalyze) part.analyze({});
  if (command.job == kFactorize) part.factorize(nothing);
  if (command.job == kSolve) part.solve(nothing, nothing, {});
  if (command.job == kEnd) parts.erase(command.instance);
}

int serve(const void* communicator) {
  const std::scoped_lock guard(trilinos_lock());
  if (!session.join(communicator) || !start_kokkos()) return ITR_FAILED;
  std::map<int, std::unique_ptr<MueluPart>> parts;
  for (RankCommand command = session.next_command(); command.job != 0; command = session.next_command()) {
    try {
      run(command, parts);
    } catch (const std::exception& error) {
      give_up(error);
    }
  }
  parts.clear();
  session.leave();
  return ITR_OK;
}

}  // namespace

itr_engine muelu_row(const char* version) {
  itr_engine engine = kokkos_row<Muelu>("belos:muelu", version, "BSD-3-Clause",
                                        ITR_ITERATIVE | ITR_TELLS_DEFINITENESS | ITR_MPI, linear::IterationOptions::kNames);
  engine.connect = connect;
  engine.disconnect = disconnect;
  engine.serve = serve;
  return engine;
}

}  // namespace itr::backends
