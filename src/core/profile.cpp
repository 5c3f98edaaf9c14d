// SPDX-License-Identifier: MIT
#include "core/profile.hpp"

#include <algorithm>
#include <utility>

namespace itr {

namespace {
thread_local Profile* active_profile = nullptr;
}

Profile::Active::Active(Profile* profile) : before_(std::exchange(active_profile, profile)) {}
Profile::Active::~Active() { active_profile = before_; }

Profile* Profile::active() { return active_profile; }

std::size_t Profile::find(std::string_view kind, std::string_view term) {
  const auto known = std::find_if(entries_.begin(), entries_.end(),
                                  [&](const Entry& entry) { return entry.kind == kind && entry.term == term; });
  if (known != entries_.end()) return static_cast<std::size_t>(known - entries_.begin());
  entries_.push_back({kind, term});
  return entries_.size() - 1;
}

/// Gives the time since the last change to the phase that it was of.
void Profile::charge() {
  const double wall = seconds_now(), processor = processor_seconds_now();
  Entry& entry = present();
  entry.wall += wall - std::exchange(wall_, wall);
  entry.processor += processor - std::exchange(processor_, processor);
}

void Profile::enter(std::string_view kind, std::string_view term, bool is_coarse) {
  if (levels_.back().is_coarse && !is_coarse) {
    ++levels_.back().fine_inside;
    return;
  }
  charge();
  levels_.push_back({find(kind, term), is_coarse, 0});
}

void Profile::leave() {
  if (levels_.back().fine_inside > 0) {
    --levels_.back().fine_inside;
    return;
  }
  charge();
  levels_.pop_back();
}

std::vector<PhaseTimes> Profile::take() {
  charge();
  std::vector<PhaseTimes> result;
  PhaseTimes others;
  std::vector<std::size_t> beside;
  for (Entry& of_phase : entries_) {
    const Entry entry = std::exchange(of_phase, {of_phase.kind, of_phase.term});
    if (!(entry.wall > 0)) continue;
    const double serial = std::max(0.0, entry.wall - entry.in_loops);
    PhaseTimes times{std::string(entry.kind), entry.wall, entry.processor, serial + entry.work, serial + entry.span};
    if (!entry.term.empty()) times.name += " of " + std::string(entry.term);
    for (std::size_t i = 0; i < kPredictedCores.size(); ++i) times.predicted[i] = serial + entry.predicted[i];
    times.bytes = entry.bytes;
    if (entry.is_beside) {
      beside.push_back(result.size());
    } else {
      others.span += times.span;
      for (std::size_t i = 0; i < kPredictedCores.size(); ++i) others.predicted[i] += times.predicted[i];
    }
    result.push_back(std::move(times));
  }
  for (const std::size_t k : beside) {
    result[k].span = std::max(0.0, result[k].span - others.span);
    for (std::size_t i = 0; i < kPredictedCores.size(); ++i)
      result[k].predicted[i] = std::max(0.0, result[k].predicted[i] - others.predicted[i]);
  }
  return result;
}

LoopTimer::LoopTimer() : profile_(active_profile) {
  if (profile_) begin_ = seconds_now();
}

LoopTimer::~LoopTimer() {
  if (!profile_) return;
  const Profile::Active again(profile_);
  add_loop(seconds_now() - begin_, 1e-9 * static_cast<double>(work_), 1e-9 * static_cast<double>(longest_));
}

void LoopTimer::add(double seconds) {
  const auto nanoseconds = static_cast<std::int64_t>(1e9 * seconds);
  work_ += nanoseconds;
  std::int64_t longest = longest_;
  while (longest < nanoseconds && !longest_.compare_exchange_weak(longest, nanoseconds)) {
  }
}

void add_loop(double wall, double work, double span) {
  if (!active_profile) return;
  Profile::Entry& entry = active_profile->present();
  entry.in_loops += wall;
  entry.work += work;
  entry.span += span;
  for (std::size_t i = 0; i < kPredictedCores.size(); ++i) entry.predicted[i] += std::max(span, work / kPredictedCores[i]);
}

void add_bytes(double bytes) {
  if (active_profile) active_profile->present().bytes += bytes;
}

}  // namespace itr
