// SPDX-License-Identifier: MIT
// Reports as JSON text with the names that docs/theory.md, "Output" promises.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "itr/output/writer.hpp"

namespace itr::output {

std::string json_string(std::string_view text);
/// One line of steps.jsonl, without the line end. Numbers read back with the same bits; what JSON cannot say is null.
std::string step_json(const StepReport& report);

/// Sums over a run; where a sum says nothing (energy, sizes), the last value; of minima, the least.
class Totals {
 public:
  void add(const StepReport& report);
  /// Sets the seconds of the whole run.
  void set_seconds(double total) { total_.seconds.total = total; }
  void add_output(double seconds) { total_.seconds.output += seconds; }
  /// All of it as numbers, for a checkpoint, and back. Throws InputError for a wrong length.
  std::vector<double> save() const;
  void restore(const std::vector<double>& values);
  const StepReport& report() const { return total_; }
  /// The text of summary.json, in `units`; `members` are more of them.
  std::string summary_json(const RunInfo& info, const Units& units, const std::string& outcome, const std::string& solver,
                           const DisplacementNorms& norms, const std::string& members) const;

 private:
  StepReport total_;
  double gain_ = 0;  ///< by remeshing: sum of energy_before_remesh - total - history_loss [J]
};

}  // namespace itr::output
