// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "itr/frame.hpp"
#include "itr/options.hpp"
#include "itr/scene.hpp"

namespace itr::cli {

/// Compares the error bars of a run with the accuracy that its scene asks for (docs/theory.md, "Accuracy"): chooses the
/// tolerance of remeshing from step to step, and says at the end what was reached.
class AccuracyWatch {
 public:
  /// `depends_on_path`: whether solutions without inertia depend on the steps before.
  AccuracyWatch(const scene::Accuracy& asked, const TimeOptions& time, const RemeshOptions& remesh, bool depends_on_path);

  bool is_asked() const { return asked_.value > 0; }
  /// Goes on after the steps of this text of steps.jsonl. With inertia it knows nothing of them.
  void go_on(const std::string& steps, const Units& units);
  /// The relative_tolerance with which a step is to be taken again, or none: it stands. `energy` [J]: the largest so far.
  /// Where that grows fast, errors of the early steps would rule, and only the `last` step is looked at.
  std::optional<double> finer(const StepReport& report, double energy, bool is_last);
  /// Adds a step that stands.
  void add(const StepReport& report, double energy);
  /// The tolerance of the next step.
  double relative_tolerance() const;
  /// Says what was asked and what is estimated, of a result whose texts are those of forces.csv and points.csv.
  std::string describe(const std::string& forces, const std::string& points) const;

 private:
  static constexpr int kTime = static_cast<int>(ErrorSource::time);  ///< the last source
  using Parts = std::array<double, kErrorSources>;

  bool is_steered(double energy, bool is_last) const;
  double mesh_error(const StepReport& report, double energy) const;
  double time_error() const;
  std::string advice(int source) const;

  scene::Accuracy asked_;
  TimeOptions time_;
  bool is_remeshed_, depends_on_path_;
  double first_tolerance_;
  int halvings_ = 0;                    ///< of it
  int trials_ = 0, last_halvings_ = 0;  ///< of this step
  double error_before_ = 0;
  Parts worst_{};  ///< of the step that is wrong by most [J]
  double energy_ = 0, time_sum_ = 0, worst_chord_ = 0;
  bool has_contact_ = false;
  int steps_ = 0, coarse_steps_ = 0, steps_without_bar_ = 0;
  std::string no_bar_;
  bool is_resumed_ = false;
};

/// Tells what a scene's accuracy chooses, and which values of the scene stay: a sentence each.
std::vector<std::string> describe_accuracy(const scene::Accuracy& accuracy);

}  // namespace itr::cli
