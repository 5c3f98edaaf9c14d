// SPDX-License-Identifier: MIT
// A wave takes several candidates from the head of the queue. All threads preview them on the mesh as it is; then they are
// settled one after another in the queue's order. A candidate goes back to the queue if an earlier one of its wave has
// changed something that its preview read. The size of a wave depends on the results of the one before and never on threads,
// so neither do results.
#pragma once

#include <algorithm>
#include <concepts>
#include <optional>
#include <span>
#include <vector>

#include "session.hpp"

namespace itr {

/// A wave has twice the candidates of the one before if no preview of that was wasted, and half of them if more than this
/// share was (verification/paper/NOTEBOOK.md, "Waves").
inline constexpr int kSmallestWave = 8, kLargestWave = 256;
inline constexpr double kTolerableWaste = 0.1;

/// Operation that waves are made for: `rank` gives a candidate its place in the queue, or leaves it out; `look` examines one
/// and may preview an edit. `settle` may commit it, and adds places to `fresh` that are to be ranked (again).
template <typename T, int Dim>
concept Operation = requires(const T& asked, T& settled, const Place& place, Trial<Dim>& trial, LocalScratch<Dim>& scratch,
                             std::vector<Place>& fresh) {
  { asked.rank(place, scratch) } -> std::same_as<std::optional<PlaceQueue::Entry>>;
  { asked.look(trial, scratch) } -> std::same_as<void>;
  { settled.settle(trial, fresh) } -> std::same_as<void>;
};
/// One that calls candidates hopeless also counts them where there are no others.
template <typename T, int Dim>
concept PassingOperation = Operation<T, Dim> && requires(T& operation, std::span<const PlaceQueue::Entry> hopeless) {
  { operation.pass_over(hopeless) } -> std::same_as<void>;
};

/// Edges as places.
inline std::vector<Place> places(const std::vector<EdgeKey>& edges) { return {edges.begin(), edges.end()}; }

/// Settles candidates of an operation until there are none. `fresh` are to be ranked: at first these, each once.
template <int Dim, Operation<Dim> T>
void run_waves(RemeshSession<Dim>& session, T& operation, std::vector<Place> fresh) {
  PlaceQueue queue;
  std::vector<std::optional<PlaceQueue::Entry>> ranked;
  std::vector<Trial<Dim>> wave(kLargestWave);
  int size = kSmallestWave;
  // A single thread previews each candidate at its turn, and leaves out those that are lost by then. This finds the same.
  const bool is_alone = session.num_lanes() == 1;
  const auto look = [&](Trial<Dim>& trial, LocalScratch<Dim>& scratch) {
    trial.clear();
    operation.look(trial, scratch);
  };
  while (!session.ask().is_cancelled()) {
    int count = 0;
    for (; count < size; ++count) {
      const auto entry = queue.pop();
      if (!entry) break;
      wave[count].candidate = *entry;
    }
    if (count == 0 && fresh.empty()) return;

    constexpr std::size_t kChunk = 16;
    const std::size_t looks = is_alone ? 0 : count, chunks = (fresh.size() + kChunk - 1) / kChunk;
    ranked.assign(fresh.size(), std::nullopt);
    session.for_each(looks + chunks, [&](std::size_t task, LocalScratch<Dim>& scratch) {
      if (task < looks) return look(wave[task], scratch);
      const std::size_t first = kChunk * (task - looks);
      for (std::size_t i = first; i < std::min(fresh.size(), first + kChunk); ++i)
        if (session.ask().exists(fresh[i])) ranked[i] = operation.rank(fresh[i], scratch);
    });
    std::vector<PlaceQueue::Entry> entries;
    for (const auto& entry : ranked)
      if (entry) entries.push_back(session.stamped(*entry));
    if constexpr (PassingOperation<T, Dim>) {
      const auto is_hopeless = [](const PlaceQueue::Entry& entry) { return entry.is_hopeless; };
      if (count == 0 && std::all_of(entries.begin(), entries.end(), is_hopeless)) return operation.pass_over(entries);
    }
    queue.push(std::move(entries));
    fresh.clear();

    session.commits().begin_wave();
    int wasted = 0;
    for (Trial<Dim>& trial : std::span(wave).first(count)) {
      bool is_lost = session.commits().has_changed_around(trial.candidate.place);
      if (is_alone && !is_lost) look(trial, session.scratch());
      is_lost = is_lost || session.commits().was_overtaken(trial);
      if (is_lost)
        queue.push(trial.candidate);
      else
        operation.settle(trial, fresh);
      wasted += is_lost;
    }
    std::sort(fresh.begin(), fresh.end());
    fresh.erase(std::unique(fresh.begin(), fresh.end()), fresh.end());
    if (wasted == 0)
      size = std::min(2 * size, kLargestWave);
    else if (wasted > kTolerableWaste * count)
      size = std::max(size / 2, kSmallestWave);
  }
}

}  // namespace itr
