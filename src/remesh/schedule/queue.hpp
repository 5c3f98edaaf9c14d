// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <unordered_map>
#include <vector>

#include "remesh/candidate.hpp"

namespace itr {

/// Candidates in order of descending priority, ties by their own. One that is pushed again moves. Priorities
/// count to four digits: those of mirror images differ by the round-off of a solve, which is not to decide what is done
/// first.
class CandidateQueue {
 public:
  struct Entry {
    Candidate candidate;
    double priority;
    unsigned since = 0;            ///< commit after which it was ranked
    std::optional<double> gain{};  ///< predicted for the rank [J, times the scaling]; none: not asked for
    double key = 0;                ///< of a refusal, then
    bool is_hopeless = false;      ///< too little to gain, then
  };

  /// Several at once, each candidate once.
  void push(std::vector<Entry> entries) {
    if (!heap_.empty() || !last_.empty()) {
      for (const Entry& entry : entries) push(entry);
      return;
    }
    heap_ = std::move(entries);
    for (Entry& entry : heap_) entry.priority = rounded(entry.priority);
    std::make_heap(heap_.begin(), heap_.end(), is_after);
  }
  void push(Entry entry) {
    entry.priority = rounded(entry.priority);
    last_[entry.candidate] = entry.priority;
    heap_.push_back(entry);
    std::push_heap(heap_.begin(), heap_.end(), is_after);
  }

  std::optional<Entry> pop() {
    while (!heap_.empty()) {
      std::pop_heap(heap_.begin(), heap_.end(), is_after);
      const Entry entry = heap_.back();
      heap_.pop_back();
      if (last_.empty()) return entry;
      const auto it = last_.find(entry.candidate);
      if (it == last_.end()) return entry;
      if (it->second != entry.priority) continue;  // moved, or popped since
      it->second.reset();
      return entry;
    }
    return std::nullopt;
  }

 private:
  static double rounded(double priority) {
    int exponent = 0;
    const double fraction = std::frexp(priority, &exponent);
    return std::isfinite(priority) ? std::ldexp(std::round(fraction * 16384), exponent - 14) : priority;
  }
  static bool is_after(const Entry& a, const Entry& b) {
    return a.priority != b.priority ? a.priority < b.priority : a.candidate > b.candidate;
  }
  std::vector<Entry> heap_;
  /// Priorities of those that did not come first; none: popped.
  std::unordered_map<Candidate, std::optional<double>, Candidate::Hash> last_;
};

}  // namespace itr
