// SPDX-License-Identifier: MIT
// The fields of a step's report: one row for each, which sums, units, JSON, saved totals and Python walk.
#pragma once

#include <tuple>

#include "itr/frame.hpp"

namespace itr {

/// How the values of two steps make one.
enum class AddUp { last, sum, least, most };

/// Where a field is shown; these add.
enum Shown : unsigned {
  in_step = 1,     ///< a line of steps.jsonl
  in_summary = 2,  ///< summary.json
  in_program = 4,  ///< the dictionary of Python
  if_any = 8,      ///< not in files where it is 0
  in_files = in_step | in_summary,
  everywhere = in_files | in_program
};

template <typename Whole, typename Value>
struct ReportField {
  const char* name;  ///< in files and programs
  Value Whole::*member;
  AddUp add_up;
  const char* unit;  ///< as Units names it; "" for counts, ratios and for seconds of a clock
  unsigned shown;
};
template <typename Whole, typename Value>
ReportField(const char*, Value Whole::*, AddUp, const char*, unsigned) -> ReportField<Whole, Value>;

/// Energies of the last solve. The members of EnergyReport, in the order of files.
inline constexpr std::tuple kEnergyFields{
    ReportField{"inertia", &EnergyReport::inertia, AddUp::last, "J", everywhere},
    ReportField{"elastic", &EnergyReport::elastic, AddUp::last, "J", everywhere},
    ReportField{"body", &EnergyReport::body, AddUp::last, "J", everywhere},
    ReportField{"contact", &EnergyReport::contact, AddUp::last, "J", everywhere},
    ReportField{"friction", &EnergyReport::friction, AddUp::last, "J", everywhere},
    ReportField{"damping", &EnergyReport::damping, AddUp::last, "J", everywhere},
    ReportField{"host", &EnergyReport::host, AddUp::last, "J", everywhere},
    ReportField{"total", &EnergyReport::total, AddUp::last, "J", everywhere},
};

/// Seconds of a clock. The members of StepSeconds, the total last.
inline constexpr std::tuple kSecondsFields{
    ReportField{"assembly", &StepSeconds::assembly, AddUp::sum, "", in_files},
    ReportField{"linear_solve", &StepSeconds::linear_solve, AddUp::sum, "", in_files},
    ReportField{"line_search", &StepSeconds::line_search, AddUp::sum, "", in_files},
    ReportField{"ccd", &StepSeconds::ccd, AddUp::sum, "", in_files},
    ReportField{"remesh", &StepSeconds::remesh, AddUp::sum, "", in_files},
    ReportField{"projection", &StepSeconds::projection, AddUp::sum, "", in_files},
    ReportField{"output", &StepSeconds::output, AddUp::sum, "", in_files},
    ReportField{"total", &StepSeconds::total, AddUp::sum, "", everywhere},
};

/// The members of StepReport, in the order of files.
inline constexpr std::tuple kStepFields{
    ReportField{"step", &StepReport::step, AddUp::last, "", in_step | in_program},
    ReportField{"t", &StepReport::t, AddUp::last, "s", in_step | in_program},
    ReportField{"dt", &StepReport::dt, AddUp::last, "s", in_step | in_program | if_any},
    ReportField{"time_error", &StepReport::time_error, AddUp::sum, "", everywhere | if_any},
    ReportField{"rejected_steps", &StepReport::rejected_steps, AddUp::sum, "", everywhere | if_any},
    ReportField{"rejections", &StepReport::rejections, AddUp::sum, "", in_step},
    ReportField{"order", &StepReport::order, AddUp::last, "", in_step | in_program},
    ReportField{"cut_steps", &StepReport::cut_steps, AddUp::sum, "", in_step | in_program},
    ReportField{"vertices", &StepReport::vertices, AddUp::last, "", everywhere},
    ReportField{"elements", &StepReport::elements, AddUp::last, "", everywhere},
    ReportField{"unknowns", &StepReport::unknowns, AddUp::last, "", everywhere},
    ReportField{"newton_iterations", &StepReport::newton_iterations, AddUp::sum, "", everywhere},
    ReportField{"factorizations", &StepReport::factorizations, AddUp::sum, "", everywhere},
    ReportField{"linear_solves", &StepReport::linear_solves, AddUp::sum, "", everywhere},
    ReportField{"reused_factors", &StepReport::reused_factors, AddUp::sum, "", in_files},
    ReportField{"linear_iterations", &StepReport::linear_iterations, AddUp::sum, "", in_files},
    ReportField{"energy", &StepReport::energy, AddUp::last, "J", everywhere},
    ReportField{"energy_before_remesh", &StepReport::energy_before_remesh, AddUp::last, "J", in_files},
    ReportField{"shape_energy", &StepReport::shape_energy, AddUp::sum, "J", in_files | if_any},
    ReportField{"splits", &StepReport::splits, AddUp::sum, "", everywhere},
    ReportField{"curves", &StepReport::curves, AddUp::sum, "", everywhere},
    ReportField{"straightens", &StepReport::straightens, AddUp::sum, "", everywhere},
    ReportField{"collapses", &StepReport::collapses, AddUp::sum, "", everywhere},
    ReportField{"swaps", &StepReport::swaps, AddUp::sum, "", everywhere},
    ReportField{"smooths", &StepReport::smooths, AddUp::sum, "", everywhere},
    ReportField{"bound_by_dhat", &StepReport::bound_by_dhat, AddUp::sum, "", in_files},
    ReportField{"reverted_remeshes", &StepReport::reverted_remeshes, AddUp::sum, "", in_files},
    ReportField{"min_distance", &StepReport::min_distance, AddUp::least, "m", everywhere},
    ReportField{"min_volume_ratio", &StepReport::min_volume_ratio, AddUp::least, "", everywhere},
    ReportField{"history_loss", &StepReport::history_loss, AddUp::sum, "J", everywhere},
    ReportField{"viscous_dissipation", &StepReport::viscous_dissipation, AddUp::sum, "J", everywhere | if_any},
    ReportField{"softening", &StepReport::softening, AddUp::sum, "J", everywhere | if_any},
    ReportField{"wetted", &StepReport::wetted, AddUp::last, "", everywhere | if_any},
    ReportField{"leaks", &StepReport::leaks, AddUp::last, "", everywhere | if_any},
    ReportField{"indefinite", &StepReport::indefinite, AddUp::sum, "", in_files},
    ReportField{"damped_steps", &StepReport::damped_steps, AddUp::sum, "", in_files},
    ReportField{"refined_quadrature", &StepReport::refined_quadrature, AddUp::last, "", in_files},
    ReportField{"seconds", &StepReport::seconds, AddUp::sum, "", everywhere},
    ReportField{"processor_seconds", &StepReport::processor_seconds, AddUp::sum, "", in_files},
    ReportField{"peak_rss_mb", &StepReport::peak_rss_mb, AddUp::most, "", in_files},
    ReportField{"remeshing_momentum", &StepReport::remeshing, AddUp::sum, "kg m/s", in_step},
    ReportField{"residual_worth", &StepReport::residual_worth, AddUp::last, "J", in_step},
    ReportField{"split_tolerance", &StepReport::split_tolerance, AddUp::last, "J", in_step},
    ReportField{"best_refused_split", &StepReport::best_refused_split, AddUp::most, "J", in_step},
    ReportField{"bars", &StepReport::errors, AddUp::last, "J", in_files},
    ReportField{"trial_seconds", &StepReport::trial_seconds, AddUp::last, "", in_step},
};

/// Calls `visit` with each row of a table.
template <typename Fields, typename Visit>
void for_each_field(const Fields& fields, Visit&& visit) {
  std::apply([&](const auto&... field) { (visit(field), ...); }, fields);
}

/// Adds up `report`, of a step, and those `before` it by all rules of the table.
void add_up(StepReport& report, const StepReport& before);

}  // namespace itr
