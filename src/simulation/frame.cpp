// SPDX-License-Identifier: MIT
#include "itr/frame.hpp"

#include <algorithm>
#include <type_traits>

#include "report_fields.hpp"

namespace itr {

void add_changes(const std::vector<MomentumChange>& changes, double factor, std::vector<MomentumChange>& sum) {
  for (const MomentumChange& change : changes) {
    auto of_body = std::find_if(sum.begin(), sum.end(), [&](const auto& other) { return other.body == change.body; });
    if (of_body == sum.end()) {
      const std::vector<double> linear(change.linear.size()), angular(change.angular.size());
      of_body = sum.insert(sum.end(), {change.body, linear, angular});
    }
    for (std::size_t i = 0; i < change.linear.size(); ++i) of_body->linear[i] += factor * change.linear[i];
    for (std::size_t i = 0; i < change.angular.size(); ++i) of_body->angular[i] += factor * change.angular[i];
  }
}

std::string_view name(ErrorSource source) {
  constexpr std::array<std::string_view, kErrorSources> kNames{"mesh", "dhat", "friction", "lag", "solver", "time"};
  return kNames[static_cast<std::size_t>(source)];
}

StepSeconds& StepSeconds::operator+=(const StepSeconds& other) {
  for_each_field(kSecondsFields, [&](const auto& field) { this->*field.member += other.*field.member; });
  return *this;
}

namespace {

template <typename Value>
void add(const Value& before, Value& sum) {
  sum += before;
}
void add(const std::vector<RejectedStep>& before, std::vector<RejectedStep>& sum) {
  sum.insert(sum.begin(), before.begin(), before.end());
}
/// Leaves what belongs to the end of a step alone.
void add(const EnergyReport&, EnergyReport&) {}
void add(const ErrorReport&, ErrorReport&) {}
void add(const std::vector<MomentumChange>& before, std::vector<MomentumChange>& sum) { add_changes(before, 1, sum); }

}  // namespace

void StepReport::add_effort(const StepReport& before) {
  for_each_field(kStepFields, [&](const auto& field) {
    if (field.add_up == AddUp::sum) add(before.*field.member, this->*field.member);
  });
}

void add_up(StepReport& report, const StepReport& before) {
  report.add_effort(before);
  for_each_field(kStepFields, [&](const auto& field) {
    const auto& old = before.*field.member;
    auto& value = report.*field.member;
    if constexpr (std::is_arithmetic_v<std::remove_cvref_t<decltype(old)>>) {
      if (field.add_up == AddUp::least) value = std::min(old, value);
      if (field.add_up == AddUp::most) value = std::max(old, value);
    }
  });
}

void StepReport::forget_operations() {
  for (auto* operations : {&splits, &curves, &straightens, &collapses, &swaps, &smooths}) operations->accepted = 0;
  history_loss = 0;
  shape_energy = 0;
  remeshing.clear();
}

}  // namespace itr
