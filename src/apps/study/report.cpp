// SPDX-License-Identifier: MIT
#include "report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "answers.hpp"

namespace itr::cli::study {

namespace {

using Json = nlohmann::ordered_json;

// Sizes of the scene that count as flight. A body in motion may well leave the place; one in equilibrium that does is held
// by nothing.
constexpr double kFlight = 1, kFlightWithInertia = 100;

const char* status(const Row& row) {
  if (!row.finished) return "failed";
  return row.certified ? "finished" : "not certified";
}

/// As a cell of CSV.
std::string cell(std::string text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  for (std::size_t i = 0; (i = text.find('"', i)) != std::string::npos; i += 2) text.insert(i, 1, '"');
  return '"' + text + '"';
}

std::string table_cell(std::string text) {
  for (std::size_t i = 0; (i = text.find('|', i)) != std::string::npos; i += 2) text.insert(i, 1, '\\');
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

Json warnings_json(const Row& row) {
  Json list = Json::array();
  for (const auto& warning : row.warnings) list.push_back({{"text", warning.text}, {"times", warning.times}});
  return list;
}

Json to_json(const Results& results, const Row& row) {
  Json sets = Json::array();
  for (const auto& set : row.run.overrides) sets.push_back(set.pointer + "=" + set.value);
  Json object = {{"run", row.run.name}, {"series", row.run.series->name}, {"label", row.run.label},
                 {"set", sets},         {"solver", row.run.solver},       {"status", status(row)}};
  if (!row.reason.empty()) object["reason"] = row.reason;
  if (!row.finished) return object;
  object.update({{"steps", row.steps},
                 {"vertices", row.vertices},
                 {"unknowns", row.unknowns},
                 {"seconds", row.seconds},
                 {"processor_seconds", row.processor_seconds},
                 {"memory_mb", row.memory_mb},
                 {"newton_iterations", row.newton_iterations},
                 {"potential", row.potential},
                 {"flight", row.flight},
                 {"warnings", warnings_json(row)}});
  if (!row.errors) return object;
  object["against"] = row.run.reference;
  for (const auto& measure : measures()) {
    const auto error = told_error(results, row, measure);
    object["errors"][measure.name] = error ? Json(*error) : Json();
  }
  return object;
}

Json to_json(const Verdict& verdict) {
  const auto number = [](double value) { return std::isnan(value) ? Json() : Json(value); };
  Json object = {{"series", verdict.series->name}, {"measure", verdict.measure->name}, {"points", Json::array()}};
  object["is_recommended"] = verdict.is_recommended;
  object["pays_from"] = verdict.pays_from ? Json(*verdict.pays_from) : Json();
  object["untold_from"] = verdict.untold_from ? Json(*verdict.untold_from) : Json();
  for (const auto& point : verdict.points)
    object["points"].push_back({{"run", point.run},
                                {"error", point.error},
                                {"seconds", point.seconds},
                                {"time_ratio", number(point.time_ratio)},
                                {"quadratic_ratio", number(point.quadratic_ratio)},
                                {"unknowns_ratio", number(point.unknowns_ratio)},
                                {"beaten_by", point.beaten_by.empty() ? Json() : Json(point.beaten_by)},
                                {"is_large", point.is_large}});
  object["finest_uniform"] = {{"error", verdict.finest_uniform.error}, {"seconds", verdict.finest_uniform.seconds}};
  return object;
}

/// Errors below what the reference is worth are bounds.
std::string error_cell(const Results& results, const Row& row, const Measure& measure) {
  if (!row.errors || std::isnan((*row.errors).*measure.value)) return "";
  if (const auto error = told_error(results, row, measure)) return fmt::format("{:.3g}", *error);
  return fmt::format("below {:.2g}", (*results.worth).*measure.value);
}

std::string runs_table(const Results& results) {
  std::string text = "| run | | vertices | unknowns, mean | processor s | s | MB |";
  for (const auto& measure : measures())
    text += fmt::format(" {}{}{} |", measure.name, *measure.unit ? " " : "", measure.unit);
  text += " last potential J |\n|---|---|";
  for (std::size_t i = 0; i < measures().size() + 6; ++i) text += "---|";
  for (const auto& row : results.rows) {
    text += fmt::format("\n| {} | {} |", row.run.name, table_cell(row.run.label));
    if (!row.finished) {
      text += fmt::format(" failed: {} |", table_cell(row.reason));
      continue;
    }
    text += fmt::format(" {} | {:.0f} | {:.3g} | {:.3g} | {:.0f} |", row.vertices, row.unknowns, row.processor_seconds,
                        row.seconds, row.memory_mb);
    for (const auto& measure : measures()) text += fmt::format(" {} |", error_cell(results, row, measure));
    text += fmt::format(" {:.8g} |", row.potential);
  }
  return text + "\n";
}

/// Each warning once, with the runs that gave it.
std::string warnings_list(const Results& results) {
  std::vector<std::pair<std::string, std::string>> texts;  // and the runs
  for (const auto& row : results.rows) {
    for (const auto& warning : row.warnings) {
      auto found = std::find_if(texts.begin(), texts.end(), [&](const auto& t) { return t.first == warning.text; });
      if (found == texts.end()) found = texts.insert(texts.end(), {warning.text, ""});
      found->second += fmt::format("{}`{}`", found->second.empty() ? "" : ", ", row.run.name);
      if (warning.times > 1) found->second += fmt::format(" ({} times)", warning.times);
    }
  }
  std::string text;
  for (const auto& [warning, runs] : texts) text += fmt::format("- {}: {}\n", warning, runs);
  return text;
}

}  // namespace

bool is_against_reference(const Row& row) { return row.run.reference == kReference; }

std::optional<double> told_error(const Results& results, const Row& row, const Measure& measure) {
  if (!row.errors) return std::nullopt;
  const double error = (*row.errors).*measure.value;
  if (std::isnan(error)) return std::nullopt;
  const bool is_judged_by_worth = results.worth && is_against_reference(row) && row.run.name != kSecondReference;
  if (is_judged_by_worth && error < (*results.worth).*measure.value) return std::nullopt;
  return error;
}

std::optional<double> relative_error(const Results& results, const Row& row, const Measure& measure) {
  const auto error = told_error(results, row, measure);
  if (!error) return std::nullopt;
  if (measure.value == &Errors::l2 || measure.value == &Errors::h1) return error;
  if (measure.value != &Errors::energy || !(row.errors->reference_energy > 0)) return std::nullopt;
  return *error / row.errors->reference_energy;
}

bool flies(const Results& results, const Row& row) {
  return row.flight > (results.is_dynamic ? kFlightWithInertia : kFlight);
}

const std::vector<Measure>& measures() {
  static const std::vector<Measure> table = {
      {"l2", "L2 error of the displacement, relative", "", &Errors::l2},
      {"h1", "H1 error of the displacement, relative", "", &Errors::h1},
      {"surface", "distance of the surfaces [m]", "m", &Errors::surface},
      {"energy", "error of the energy [J]", "J", &Errors::energy},
      {"momentum", "error of the momentum [kg m/s]", "kg m/s", &Errors::momentum},
  };
  return table;
}

const std::vector<Cost>& costs() {
  static const std::vector<Cost> table = {{"processor_seconds", "processor seconds", &Row::processor_seconds},
                                          {"unknowns", "unknowns, mean over the steps", &Row::unknowns},
                                          {"memory_mb", "memory [MB]", &Row::memory_mb}};
  return table;
}

std::string csv(const Results& results) {
  std::string text =
      "run,series,label,status,reason,steps,vertices,unknowns,seconds,processor_seconds,memory_mb,newton_iterations,"
      "potential";
  for (const auto& measure : measures()) text += fmt::format(",{}", measure.name);
  text += '\n';
  for (const auto& row : results.rows) {
    text += fmt::format("{},{},{},{},{}", cell(row.run.name), row.run.series->name, cell(row.run.label), status(row),
                        cell(row.reason));
    if (row.finished)
      text += fmt::format(",{},{},{:.7g},{:.4g},{:.4g},{:.4g},{},{:.12g}", row.steps, row.vertices, row.unknowns,
                          row.seconds, row.processor_seconds, row.memory_mb, row.newton_iterations, row.potential);
    else
      text += ",,,,,,,,";
    for (const auto& measure : measures()) {
      text += ',';
      if (const auto error = told_error(results, row, measure)) text += fmt::format("{:.6g}", *error);
    }
    text += '\n';
  }
  return text;
}

std::string json(const Results& results) {
  Json object = {{"scene", results.scene},
                 {"settings", results.settings},
                 {"notes", results.notes},
                 {"version", ITR_VERSION},
                 {"reference", results.reference},
                 {"refused", results.refused.empty() ? Json() : Json(results.refused)},
                 {"second_reference", results.second_reference},
                 {"worth", Json()},
                 {"times", results.frames},
                 {"doubts", doubts(results)},
                 {"answers", Json::array()},
                 {"verdicts", Json::array()},
                 {"orders", Json::array()},
                 {"runs", Json::array()}};
  if (results.worth)
    for (const auto& measure : measures()) object["worth"][measure.name] = (*results.worth).*measure.value;
  for (const auto& sentence : answers(results)) object["answers"].push_back(sentence);
  for (const auto& verdict : verdicts(results)) object["verdicts"].push_back(to_json(verdict));
  for (const auto& order : orders(results))
    object["orders"].push_back({{"series", order.series},
                                {"measure", order.measure},
                                {"in_size", order.in_size},
                                {"in_seconds", order.in_seconds},
                                {"runs", order.runs}});
  for (const auto& row : results.rows) object["runs"].push_back(to_json(results, row));
  return object.dump(1) + "\n";
}

std::string page(const Results& results) {
  std::string text = fmt::format("# Speed against error: {}\n\n", results.scene);
  if (!results.settings.empty()) text += fmt::format("With {}. ", results.settings);
  if (!results.notes.empty()) text += fmt::format("In all runs {}. ", results.notes);
  text += fmt::format("Errors against {}, over at most {} times.\n\n", results.reference, results.frames);
  for (const auto& sentence : doubts(results)) text += "- " + sentence + "\n";
  for (const auto& sentence : answers(results)) text += "- " + sentence + "\n";
  if (const std::string table = choices_table(results); !table.empty()) text += "\n## For this error, run this\n\n" + table;
  text += "\n## Orders\n\nError by element size (unknowns to the power of -1/Dim) and by processor seconds, fitted.\n\n";
  text += "| series | error | by size | by seconds | runs |\n|---|---|---|---|---|\n";
  for (const auto& order : orders(results))
    text += fmt::format("| {} | {} | {:.2f} | {:.2f} | {} |\n", order.series, order.measure, order.in_size, order.in_seconds,
                        order.runs);
  text += "\n## Runs\n\n" + runs_table(results);
  if (const std::string warnings = warnings_list(results); !warnings.empty())
    text += "\n## Warnings of the runs\n\n" + warnings;
  text += "\n![work and precision](study.svg)\n";
  return text;
}

}  // namespace itr::cli::study
