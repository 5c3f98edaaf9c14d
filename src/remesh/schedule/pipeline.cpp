// SPDX-License-Identifier: MIT
#include "pipeline.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace itr {

namespace {

/// A batch has twice the candidates of the one before if no evaluation of that was wasted, and half of them if more than
/// this fraction was (verification/paper/NOTEBOOK.md, "Waves").
constexpr int kSmallestBatch = 8, kLargestBatch = 256;
constexpr double kTolerableWaste = 0.1;

template <int Dim>
class Pipeline {
 public:
  Pipeline(RemeshSession<Dim>& session, std::initializer_list<Operation<Dim>*> operations)
      : session_(session), queries_(session.queries()), is_alone_(session.num_lanes() == 1) {
    for (Operation<Dim>* operation : operations) {
      if (!operation) continue;
      operations_[static_cast<int>(operation->kind)] = operation;
      const auto listed = operation->list();
      fresh_.insert(fresh_.end(), listed.begin(), listed.end());
    }
  }

  void run() {
    int size = kSmallestBatch;
    while (!queries_.is_cancelled()) {
      const auto batch = take_batch(size);
      if (batch.empty() && fresh_.empty()) return;
      auto entries = evaluate_and_rank(batch);
      if (batch.empty() && std::ranges::all_of(entries, &Entry::is_hopeless)) return pass_over(entries);
      queue_.push(std::move(entries));
      const int wasted = apply(batch);
      std::sort(fresh_.begin(), fresh_.end());
      fresh_.erase(std::unique(fresh_.begin(), fresh_.end()), fresh_.end());
      if (wasted == 0)
        size = std::min(2 * size, kLargestBatch);
      else if (wasted > kTolerableWaste * static_cast<double>(batch.size()))
        size = std::max(size / 2, kSmallestBatch);
    }
  }

 private:
  using Entry = CandidateQueue::Entry;
  /// An entry of the queue, or why there is none.
  struct Rank {
    std::optional<Entry> entry{};
    Refusal refusal = Refusal::not_asked;
  };

  Operation<Dim>& operation_of(const Candidate& candidate) const { return *operations_[static_cast<int>(candidate.kind())]; }
  OperationCount& count_of(const Candidate& candidate) { return session_.report().*operation_of(candidate).count; }

  std::span<Trial<Dim>> take_batch(int size) {
    int count = 0;
    for (; count < size; ++count) {
      const auto entry = queue_.pop();
      if (!entry) break;
      trials_[count].entry = *entry;
    }
    return std::span(trials_).first(count);
  }

  /// Evaluates a batch and ranks the fresh candidates, which are then none.
  std::vector<Entry> evaluate_and_rank(std::span<Trial<Dim>> batch) {
    constexpr std::size_t kChunk = 16;
    const std::size_t evaluations = is_alone_ ? 0 : batch.size(), chunks = (fresh_.size() + kChunk - 1) / kChunk;
    ranks_.assign(fresh_.size(), {});
    session_.for_each(evaluations + chunks, [&](std::size_t task, LocalScratch<Dim>& scratch) {
      if (task < evaluations) return evaluate(batch[task], scratch);
      const std::size_t first = kChunk * (task - evaluations);
      for (std::size_t i = first; i < std::min(fresh_.size(), first + kChunk); ++i) ranks_[i] = rank(fresh_[i], scratch);
    });
    std::vector<Entry> entries;
    for (std::size_t i = 0; i < fresh_.size(); ++i)
      if (ranks_[i].entry)
        entries.push_back(*ranks_[i].entry);
      else
        count_of(fresh_[i]).note(ranks_[i].refusal);
    fresh_.clear();
    return entries;
  }

  Rank rank(const Candidate& candidate, LocalScratch<Dim>& scratch) const {
    const Operation<Dim>& operation = operation_of(candidate);
    if (!queries_.exists(candidate)) return {};
    if (const Refusal refusal = operation.refuse(candidate); refusal != Refusal::none) return {.refusal = refusal};
    if (operation.priority) {
      const auto priority = operation.priority(candidate);
      return priority ? Rank{Entry{.candidate = candidate, .priority = *priority}} : Rank{};
    }
    Trial<Dim> trial{.entry = {.candidate = candidate, .priority = 0}};
    trial.in_contact = queries_.is_in_contact(candidate, scratch);
    if (!predict(operation, trial, scratch)) return {.refusal = trial.verdict.refusal};
    return {Entry{.candidate = candidate,
                  .priority = trial.gain / operation.num_nodes(candidate),
                  .since = session_.log().now(),
                  .gain = trial.gain,
                  .key = trial.key,
                  .is_hopeless = is_hopeless(operation, trial)}};
  }

  void evaluate(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    trial.clear();
    const Operation<Dim>& operation = operation_of(trial.candidate());
    if (!queries_.exists(trial.candidate())) return trial.refuse(Refusal::gone);
    if (const Refusal refusal = operation.refuse(trial.candidate()); refusal != Refusal::none) return trial.refuse(refusal);
    queries_.find_contact(trial, scratch);
    if (trial.entry.gain && !session_.log().has_changed_around(trial.candidate(), trial.entry.since)) {
      trial.gain = *trial.entry.gain;
      trial.key = trial.entry.key;
    } else if (!predict(operation, trial, scratch)) {
      return;
    }
    if (is_hopeless(operation, trial)) return trial.refuse(Refusal::prediction);
    if (!trial.edit && !trial.take(operation.propose(trial.candidate(), scratch))) return;
    queries_.judge(trial, operation.local, scratch);
  }

  /// Finds the refusal key and the prediction. Returns whether the candidate may be tried as far as these tell.
  bool predict(const Operation<Dim>& operation, Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    trial.key = operation.key(trial, scratch);
    if (session_.memory().was_refused(trial.candidate(), trial.key, trial.in_contact)) return false;
    const auto gain = operation.predict(trial, scratch);
    trial.gain = gain.value_or(0);
    return gain.has_value();
  }

  bool is_hopeless(const Operation<Dim>& operation, Trial<Dim>& trial) const {
    trial.tolerance = operation.tolerance(trial);
    const auto factor = operation.patch_over_prediction(trial);
    return factor && queries_.is_hopeless(trial.gain, *factor, trial.tolerance);
  }

  /// Applies the results of a batch in its order. Returns how many evaluations were wasted.
  int apply(std::span<Trial<Dim>> batch) {
    batch_began_ = session_.log().now();
    int wasted = 0;
    for (Trial<Dim>& trial : batch) {
      bool is_lost = session_.log().has_changed_around(trial.candidate(), batch_began_);
      // A single thread evaluates each candidate at its turn, and leaves out those that are lost by then.
      if (is_alone_ && !is_lost) evaluate(trial, session_.scratch());
      is_lost = is_lost || was_overtaken(trial);
      if (is_lost)
        queue_.push(trial.entry);
      else
        apply(trial);
      wasted += is_lost;
    }
    return wasted;
  }

  /// Whether a commit of this batch has changed something that a trial read beside the cells at its candidate.
  bool was_overtaken(const Trial<Dim>& trial) const {
    const ChangeLog<Dim>& log = session_.log();
    if (log.now() == batch_began_) return false;
    const bool reads_past_surface = trial.edit && session_.gate().moves_surface(*trial.edit);
    if (std::ranges::any_of(log.surfaces(batch_began_), [&](const Box<Dim>& box) {
          return box.min[0] <= box.max[0] && (reads_past_surface || box.overlaps(trial.surface_read));
        }))
      return true;
    const Mesh<Dim>& mesh = queries_.mesh();
    if (queries_.patches() && has_other_volume(trial)) return true;
    return std::ranges::any_of(trial.verdict.patch, [&](CellId c) {
      return !mesh.is_cell_alive(c) ||
             std::ranges::any_of(mesh.cell(c), [&](VertexId v) { return log.was_written(v, batch_began_); });
    });
  }

  /// Whether a commit of this batch has changed the mean volume of a patch that a trial has read.
  bool has_other_volume(const Trial<Dim>& trial) const {
    const Mesh<Dim>& mesh = queries_.mesh();
    const auto is_other = [&](CellId c) { return queries_.patches()->was_written(c, batch_began_); };
    return std::ranges::any_of(trial.candidate().vertices(),
                               [&](VertexId v) { return std::ranges::any_of(mesh.cells_of(v), is_other); }) ||
           std::ranges::any_of(trial.verdict.patch, is_other);
  }

  /// Counts a trial, and commits it where it was accepted; the verdict's patch then has the new cells too.
  bool commit(Trial<Dim>& trial, OperationCount& count) {
    Verdict<Dim>& verdict = trial.verdict;
    session_.trial_seconds().push_back(trial.seconds);
    ++count.tried;
    count.relaxed += verdict.was_relaxed;
    count.accepted += verdict.accepted();
    if (!verdict.accepted()) return false;
    const Change<Dim> change = session_.log().commit(*trial.edit, verdict.positions);
    verdict.patch.insert(verdict.patch.end(), change.cells.begin(), change.cells.end());
    return true;
  }

  void apply(Trial<Dim>& trial) {
    Operation<Dim>& operation = operation_of(trial.candidate());
    OperationCount& count = count_of(trial.candidate());
    const Refusal refusal = trial.verdict.refusal;
    count.note(refusal);
    const bool is_applied = trial.was_previewed && commit(trial, count);
    operation.after(trial, is_applied);
    if (is_applied) {
      const auto edges = operation.edges_to_ask(trial);
      for (const Operation<Dim>* each : operations_)
        for (const EdgeKey& edge : edges)
          if (each && each->is_candidate(edge)) fresh_.emplace_back(each->kind, edge);
    } else if (is_lasting(operation, trial) && std::isfinite(trial.key)) {
      session_.memory().remember(trial.candidate(), operation.remember(trial));
    }
  }

  /// Whether the refusal key tells how long a refusal holds: not where the history decided, nor where the key refuses again.
  static bool is_lasting(const Operation<Dim>& operation, const Trial<Dim>& trial) {
    if (trial.verdict.refusal == Refusal::prediction) return static_cast<bool>(operation.priority);
    return trial.was_previewed && trial.verdict.refusal != Refusal::invalid;
  }

  /// Refuses entries that have nothing to gain, where nothing else is left that could change that.
  void pass_over(std::span<const Entry> entries) {
    for (const Entry& entry : entries) {
      Trial<Dim> trial{.entry = entry, .key = entry.key, .gain = *entry.gain};
      trial.refuse(Refusal::prediction);
      apply(trial);
    }
  }

  RemeshSession<Dim>& session_;
  const RemeshQueries<Dim>& queries_;
  const bool is_alone_;
  std::array<Operation<Dim>*, kOperationKinds> operations_{};
  std::vector<Candidate> fresh_;  ///< to be ranked
  CandidateQueue queue_;
  unsigned batch_began_ = 0;
  std::vector<Rank> ranks_;
  std::vector<Trial<Dim>> trials_ = std::vector<Trial<Dim>>(kLargestBatch);
};

}  // namespace

template <int Dim>
Operation<Dim>::Operation(RemeshSession<Dim>& session, OperationKind kind, OperationCount RemeshReport::*count,
                          double least_gain)
    : kind(kind), count(count), local(session.queries().options().local) {
  const RemeshQueries<Dim>& queries = session.queries();
  const Mesh<Dim>& mesh = queries.mesh();
  list = [&] {
    std::vector<Candidate> found;
    for (const EdgeKey& edge : mesh.edges())
      if (is_candidate(edge)) found.emplace_back(this->kind, edge);
    return found;
  };
  is_candidate = [](const EdgeKey&) { return true; };
  refuse = [](const Candidate&) { return Refusal::none; };
  num_nodes = [](const Candidate&) { return 1; };
  key = [&](const Trial<Dim>& trial, Scratch&) { return queries.roughness(trial.candidate()); };
  predict = [&](Trial<Dim>& trial, Scratch& scratch) {
    return trial.take(propose(trial.candidate(), scratch)) ? std::optional(queries.predict(*trial.edit)) : std::nullopt;
  };
  tolerance = [least_gain](const Trial<Dim>&) { return least_gain; };
  patch_over_prediction = [&](const Trial<Dim>& trial) {
    return trial.in_contact ? std::nullopt : std::optional(queries.patch_over_vertex(trial));
  };
  remember = [](const Trial<Dim>& trial) {
    return RemeshMemory::KeyRange{trial.key / kSameKey, trial.key * kSameKey, trial.in_contact};
  };
  after = [](const Trial<Dim>&, bool) {};
  edges_to_ask = [&](const Trial<Dim>& trial) {
    const std::span<const CellId> patch(trial.verdict.patch);
    return edges_of<Dim>(mesh, patch.last(trial.edit->inserted_cells.size()));
  };
}

template <int Dim>
void Operation<Dim>::rank_by(std::function<double(Trial<Dim>&, Scratch&)> gain) {
  key = [gain = std::move(gain)](Trial<Dim>& trial, Scratch& scratch) { return trial.gain = gain(trial, scratch); };
  predict = [](const Trial<Dim>& trial, Scratch&) { return std::optional(trial.gain); };
}

template struct Operation<2>;
template struct Operation<3>;

template <int Dim>
void run_operations(RemeshSession<Dim>& session, std::initializer_list<Operation<Dim>*> operations) {
  Pipeline<Dim>(session, operations).run();
}

template void run_operations(RemeshSession<2>&, std::initializer_list<Operation<2>*>);
template void run_operations(RemeshSession<3>&, std::initializer_list<Operation<3>*>);

}  // namespace itr
