// SPDX-License-Identifier: MIT
// MUMPS as a loadable module: multifrontal L D L^T (or L L^T) over the ranks of an MPI communicator. Rank 0 owns the matrix;
// the others wait for commands and take part. Without connect() an instance works on its own rank alone.
#include <dmumps_c.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <mutex>
#include <string_view>
#include <utility>
#include <vector>

#include "../common/blas.hpp"
#include "../common/ordering.hpp"
#include "../common/rank_session.hpp"
#include "itr/module.h"

#ifdef ITR_MUMPS_HAS_SCOTCH
extern "C" void SCOTCH_randomReset(void);  // NOLINT(readability-identifier-naming)
#endif

namespace {

// MUMPS numbers its parameters from one, as its manual does.
template <typename Struct>
auto& icntl(Struct& mumps, int i) {
  return mumps.icntl[i - 1];
}
template <typename Struct>
auto infog(const Struct& mumps, int i) {
  return mumps.infog[i - 1];
}
/// Large counts are stored as negative millions.
double count(MUMPS_INT n) { return n >= 0 ? n : -1e6 * n; }

constexpr int kInit = -1, kEnd = -2, kAnalyze = 1, kFactorize = 2, kSolve = 3;

using itr::backends::RankCommand;

/// MUMPS is not re-entrant; everything below and every call of it happens under this lock.
std::mutex lock;

itr::backends::RankSession session;

void run(DMUMPS_STRUC_C& mumps, int job) {
  mumps.job = job;
  dmumps_c(&mumps);
}

void init(DMUMPS_STRUC_C& mumps, int symmetry, MPI_Comm communicator) {
  mumps = {};
  mumps.par = 1;  // rank 0 factorises too
  mumps.sym = symmetry;
  mumps.comm_fortran = static_cast<MUMPS_INT>(MPI_Comm_c2f(communicator));
  run(mumps, kInit);
  for (const int stream : {1, 2, 3}) icntl(mumps, stream) = -1;  // says nothing, on any rank
  icntl(mumps, 4) = 0;
}

template <int Symmetry>  // 1: positive definite, 2: general
class Mumps {
 public:
  Mumps() = default;
  ~Mumps() {
    const std::scoped_lock guard(lock);
    end();
  }
  Mumps(const Mumps&) = delete;
  Mumps& operator=(const Mumps&) = delete;

  int set_option(std::string_view key, std::string_view value) {
    static constexpr itr::backends::Ordering kOrderings[] = {{"auto", kAuto},
#ifdef ITR_MUMPS_HAS_SCOTCH
                                                             {"scotch", kScotch},
#endif
                                                             {"amd", 0},
                                                             {"amf", kAmf},
                                                             {"qamd", 6}};
    const auto ordering = itr::backends::find_ordering(kOrderings, key, value);
    if (!ordering) return ITR_FAILED;
    ordering_ = *ordering;
    return ITR_OK;
  }

  int analyze(const itr_pattern& pattern, const itr_hints& hints) {
    const std::scoped_lock guard(lock);
    if (!start()) return ITR_FAILED;
    rows_.clear();
    columns_.clear();
    for (int j = 0; j < pattern.order; ++j)
      for (int p = pattern.column_starts[j]; p < pattern.column_starts[j + 1]; ++p) {
        rows_.push_back(pattern.row_indices[p] + 1);
        columns_.push_back(j + 1);
      }
    mumps_.n = pattern.order;
    mumps_.nnz = static_cast<MUMPS_INT8>(rows_.size());
    mumps_.irn = rows_.data();
    mumps_.jcn = columns_.data();
    icntl(mumps_, 14) = kMemoryMargin;
    if (order_.recall(pattern, hints)) {
      mumps_.perm_in = order_.permutation();
      const int outcome = analyze_by(kGiven);
      if (outcome != ITR_OK || order_.is_good(foreseen_flops())) return outcome;
    }
    int outcome = analyze_by(ordering_ == kAuto ? kAmf : ordering_);
    if (outcome == ITR_OK && ordering_ == kAuto && kScotch != kAmf && foreseen_flops() >= kScotchFromFlops * pattern.order)
      outcome = analyze_by(kScotch);
    if (outcome == ITR_OK) order_.keep(mumps_.sym_perm, pattern.order, foreseen_flops());
    return outcome;
  }

  int factorize(const double* values, size_t length) {
    const std::scoped_lock guard(lock);
    if (!is_alive()) return gone();
    values_.assign(values, values + length);
    mumps_.a = values_.data();
    int outcome = job(kFactorize);
    // Delayed pivots may need more room than the analysis foresaw.
    while (is_short_of_workspace() && icntl(mumps_, 14) < kMostMemoryMargin) {
      icntl(mumps_, 14) *= 3;
      outcome = job(kFactorize);
    }
    is_factorized_ = outcome == ITR_OK;
    if (outcome == ITR_OK && Symmetry == 1 && infog(mumps_, 12) > 0) {
      std::snprintf(text_.data(), text_.size(), "%d pivots are not positive", infog(mumps_, 12));
      return ITR_NOT_POSITIVE_DEFINITE;
    }
    return outcome;
  }

  int solve(const double* rhs, double* solution, int columns) {
    const std::scoped_lock guard(lock);
    if (!is_alive()) return gone();
    std::copy(rhs, rhs + static_cast<size_t>(columns) * mumps_.n, solution);
    mumps_.rhs = solution;
    mumps_.nrhs = columns;
    mumps_.lrhs = mumps_.n;
    return job(kSolve);
  }

  itr_statistics statistics() const {
    itr_statistics result{};
    if (session_ < 0) return result;
    // Before the first factorisation what the analysis predicts.
    result.factor_nonzeros = count(infog(mumps_, is_factorized_ ? 29 : 20));
    result.largest_bytes = 1e6 * infog(mumps_, is_factorized_ ? 21 : 16);
    result.factor_bytes = 1e6 * infog(mumps_, is_factorized_ ? 22 : 17);
    result.flops = is_factorized_ ? mumps_.rinfog[2] : foreseen_flops();
    result.negative_pivots = is_factorized_ ? infog(mumps_, 12) : 0;
    return result;
  }
  const char* message() const { return text_.data(); }

 private:
  // MUMPS's own choice may be PORD, which ends the process on some graphs.
  static constexpr int kAuto = -1, kGiven = 1, kAmf = 2;
#ifdef ITR_MUMPS_HAS_SCOTCH
  static constexpr int kScotch = 3;
#else
  static constexpr int kScotch = kAmf;
#endif
  /// Flops of AMF's factorisation an unknown, from which the sixth to third of them that Scotch saves pays for its 5
  /// microseconds an unknown in the few factorisations that its order lasts (verification/solvers).
  static constexpr double kScotchFromFlops = 1.5e5;
  static constexpr int kMemoryMargin = 30, kMostMemoryMargin = 1000;  ///< of the estimate [%]

  /// An instance on its own rank does not care who connects or leaves.
  bool is_alive() const {
    return session_ >= 0 && (!is_shared_ || session_ == session.number()) && itr::backends::mpi_is_running();
  }
  int gone() {
    std::snprintf(text_.data(), text_.size(), "the MPI ranks of this solver are gone");
    return ITR_FAILED;
  }
  bool is_short_of_workspace() const { return infog(mumps_, 1) == -9 || infog(mumps_, 1) == -8; }

  /// A fresh instance on all ranks: MUMPS keeps something of the last matrix otherwise.
  bool start() {
    end();
    if (!itr::backends::mpi_is_running()) {
      std::snprintf(text_.data(), text_.size(), "MPI does not run");
      return false;
    }
    session_ = session.number();
    is_shared_ = session.is_shared();
    instance_ = session.new_instance();
    is_factorized_ = false;
    if (is_shared_) session.send({kInit, instance_, Symmetry});
    init(mumps_, Symmetry, session.communicator());
    return infog(mumps_, 1) >= 0;
  }
  void end() {
    if (is_alive()) {
      if (is_shared_) session.send({kEnd, instance_, 0});
      run(mumps_, kEnd);
    }
    session_ = -1;
  }

  int analyze_by(int ordering) {
#ifdef ITR_MUMPS_HAS_SCOTCH
    SCOTCH_randomReset();  // else its next order would depend on those before
#endif
    icntl(mumps_, 7) = ordering;
    return job(kAnalyze);
  }
  double foreseen_flops() const { return mumps_.rinfog[0]; }

  int job(int number) {
    if (is_shared_) session.send({number, instance_, 0});
    run(mumps_, number);
    const int status = infog(mumps_, 1);
    std::snprintf(text_.data(), text_.size(), "MUMPS status %d (%d)", status, infog(mumps_, 2));
    if (status >= 0) return ITR_OK;
    switch (status) {
      case -6:  // structurally
      case -10:
        return ITR_SINGULAR;
      case -40:
        return ITR_NOT_POSITIVE_DEFINITE;
      case -5:
      case -7:
      case -8:
      case -9:
      case -13:
      case -19:
        return ITR_OUT_OF_MEMORY;
      default:
        return ITR_FAILED;
    }
  }

  DMUMPS_STRUC_C mumps_{};
  int session_ = -1;  ///< -1: not started
  int instance_ = 0;
  bool is_shared_ = false, is_factorized_ = false;
  int ordering_ = kAuto;
  itr::backends::KeptOrder order_;
  std::vector<MUMPS_INT> rows_, columns_;
  std::vector<double> values_;
  std::array<char, 96> text_{};
};

void disconnect() {
  const std::scoped_lock guard(lock);
  session.end();
}

int connect(const void* communicator) {
  const std::scoped_lock guard(lock);
  if (!session.join(communicator)) return ITR_FAILED;
  // A program that ends without a word must not leave the others waiting.
  static const int registered = std::atexit(disconnect);
  return registered == 0 ? ITR_OK : ITR_FAILED;
}

int serve(const void* communicator) {
  const std::scoped_lock guard(lock);
  if (!session.join(communicator)) return ITR_FAILED;
  std::map<int, DMUMPS_STRUC_C> instances;
  for (RankCommand command = session.next_command(); command.job != 0; command = session.next_command()) {
    DMUMPS_STRUC_C& mumps = instances[command.instance];
    if (command.job == kInit)
      init(mumps, command.argument, session.communicator());
    else
      run(mumps, command.job);
    if (command.job == kEnd) instances.erase(command.instance);
  }
  session.leave();
  return ITR_OK;
}

#ifdef ITR_MUMPS_HAS_SCOTCH
constexpr const char* kOptions = "ordering=auto|amd|amf|qamd|scotch";
#else
constexpr const char* kOptions = "ordering=auto|amd|amf|qamd";
#endif

template <int Symmetry>
itr_engine row(const char* name, const char* version, uint32_t capabilities) {
  itr_engine engine = itr::linear::ModuleAdapter<Mumps<Symmetry>>::row(name, version, "CeCILL-C", capabilities, kOptions);
  engine.prepare_mpi = itr::backends::prepare_mpi;
  engine.connect = connect;
  engine.disconnect = disconnect;
  engine.serve = serve;
  return engine;
}

const char* version() {
  static char text[256], mpi[MPI_MAX_LIBRARY_VERSION_STRING];
  int length = 0;
  MPI_Get_library_version(mpi, &length);
#ifdef ITR_MUMPS_HAS_SCOTCH
  setenv("SCOTCH_PTHREAD_NUMBER", "1", 1);  // on several threads Scotch orders otherwise each time; it has no other switch
#endif
  const std::string_view words = mpi;  // "Open MPI v4.1.4, package: ..."
  const auto end = static_cast<int>(std::min(words.find_first_of(",\n"), words.size()));
  std::snprintf(text, sizeof text, "MUMPS %s, %.*s, %s", MUMPS_VERSION, std::min(end, 40), mpi, itr::backends::pin_blas());
  return text;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const itr_module* itr_backend_module(void) {
  static const char* const text = version();
  static const itr_engine engines[] = {
      row<2>("mumps", text, ITR_INDEFINITE | ITR_MPI | ITR_KEEPS_ORDER | ITR_TELLS_DEFINITENESS),
      row<1>("mumps:spd", text, ITR_MPI | ITR_KEEPS_ORDER | ITR_TELLS_DEFINITENESS)};
  static const itr_module module{ITR_BACKEND_ABI_VERSION, 2, engines};
  return &module;
}
