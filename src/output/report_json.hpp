// SPDX-License-Identifier: MIT
// Reports as JSON with the names that docs/theory.md, "Output" promises.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "itr/output.hpp"

namespace itr::output {

using Json = nlohmann::ordered_json;
/// The text of `json` in one line, without the line end. Bytes that are no UTF-8 become U+FFFD.
std::string text_of(const Json& json);
/// One line of steps.jsonl. Numbers read back with the same value; infinity and NaN, which JSON lacks, are null.
Json step_json(const StepReport& report);

/// Values over a run, by the rules of kStepFields.
class Totals {
 public:
  void add(const StepReport& report);
  /// Sets the seconds of the whole run.
  void set_seconds(double total) { total_.seconds.total = total; }
  void add_output(double seconds) { total_.seconds.output += seconds; }
  /// Returns all of it by name as JSON text, for a checkpoint.
  std::string save() const;
  /// Takes back such a text. Throws InputError where it is not one.
  void restore(const std::string& saved);
  const StepReport& report() const { return total_; }
  /// Returns the text of summary.json, in `units`; `members` come before the norms.
  std::string summary_json(const RunInfo& info, const Units& units, const std::string& outcome, const std::string& solver,
                           const DisplacementNorms& norms, const Json& members) const;

 private:
  StepReport total_;
  double gain_ = 0;  ///< by remeshing: sum of energy_before_remesh + shape_energy - total - history_loss [J]
};

/// Returns what Totals::save gives from the list of numbers of checkpoints of formats 7 and 8. Throws InputError for a
/// length that no version wrote.
std::string totals_of_list(std::span<const double> numbers);

}  // namespace itr::output
