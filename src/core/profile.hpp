// SPDX-License-Identifier: MIT
// Where the time of a thread goes, by phase, while a profile is active in it; and what loops would take with more cores.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/process.hpp"
#include "core/timer.hpp"

namespace itr {

/// Numbers of cores for which times are predicted.
inline constexpr std::array<int, 4> kPredictedCores = {2, 4, 16, 64};

/// Times of one phase, without those of phases inside it [s].
struct PhaseTimes {
  std::string name;  ///< "assembly", or "assembly of contact" for that of a term
  double wall = 0;
  double processor = 0;  ///< of all threads
  double work = 0;       ///< on one core: serial parts, and all blocks of loops
  double span = 0;       ///< on as many cores as may be: serial parts, and the longest block of each loop
  std::array<double, kPredictedCores.size()> predicted{};  ///< wall times, by kPredictedCores
  double bytes = 0;                                        ///< that the largest arrays are read and written with
};

class Profile {
 public:
  /// Makes a profile the active one of this thread while it lives; null: none.
  class Active {
   public:
    explicit Active(Profile* profile);
    ~Active();
    Active(const Active&) = delete;
    Active& operator=(const Active&) = delete;

   private:
    Profile* before_;
  };
  static Profile* active();

  /// Times since the last call by phase, in the order in which phases began; what no phase took is "rest".
  std::vector<PhaseTimes> take();

 private:
  friend class ScopedPhase;
  friend class LoopTimer;
  friend void add_loop(double wall, double work, double span);
  friend void add_bytes(double bytes);
  struct Entry {
    std::string_view kind, term;
    double wall = 0, processor = 0, in_loops = 0, work = 0, span = 0, bytes = 0;
    std::array<double, kPredictedCores.size()> predicted{};
    bool is_beside = false;
  };
  struct Level {
    std::size_t entry;
    bool is_coarse;
    int fine_inside;  ///< phases that a coarse one takes in
  };
  Entry& present() { return entries_[levels_.back().entry]; }
  void enter(std::string_view kind, std::string_view term, bool is_coarse);
  void leave();
  void charge();
  std::size_t find(std::string_view kind, std::string_view term);

  std::vector<Entry> entries_ = {{"rest", {}}};
  std::vector<Level> levels_ = {{0, false, 0}};
  double wall_ = seconds_now(), processor_ = processor_seconds_now();
};

/// Charges the time of its scope to a phase of the active profile, if there is one. `kind` and `term` outlive the profile.
class ScopedPhase {
 public:
  explicit ScopedPhase(std::string_view kind, std::string_view term = {}) : ScopedPhase(kind, term, false) {}
  /// A phase that takes in those inside it, but for other coarse ones.
  static ScopedPhase coarse(std::string_view kind) { return ScopedPhase(kind, {}, true); }
  /// A coarse phase that with several cores runs beside the others, and takes only what it is longer than they are.
  static ScopedPhase beside(std::string_view kind) { return ScopedPhase(kind, {}, true, true); }
  ~ScopedPhase() {
    if (profile_) profile_->leave();
  }
  ScopedPhase(const ScopedPhase&) = delete;
  ScopedPhase& operator=(const ScopedPhase&) = delete;

 private:
  ScopedPhase(std::string_view kind, std::string_view term, bool is_coarse, bool is_beside = false)
      : profile_(Profile::active()) {
    if (!profile_) return;
    profile_->enter(kind, term, is_coarse);
    if (is_beside) profile_->present().is_beside = true;
  }

  Profile* profile_;
};

/// Times the blocks of a parallel loop, which any thread may run. Loops inside a block are part of it.
class LoopTimer {
 public:
  LoopTimer();
  ~LoopTimer();
  LoopTimer(const LoopTimer&) = delete;
  LoopTimer& operator=(const LoopTimer&) = delete;

  template <typename F>
  void run(const F& block) {
    if (!profile_) return block();
    const double begin = seconds_now();
    block();
    add(seconds_now() - begin);
  }

 private:
  void add(double seconds);

  Profile* profile_;
  Profile::Active none_{nullptr};
  double begin_ = 0;
  std::atomic<std::int64_t> work_ = 0, longest_ = 0;  ///< [ns]
};

/// Counts a part of the present phase that several threads share: its seconds by the clock, of all its pieces, and of the
/// longest chain of pieces.
void add_loop(double wall, double work, double span);

/// Counts bytes that the present phase reads or writes.
void add_bytes(double bytes);

}  // namespace itr
