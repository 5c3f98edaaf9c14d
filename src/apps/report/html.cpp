// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>

#include "assets.hpp"
#include "core/read_file.hpp"
#include "deflate.hpp"
#include "frames.hpp"
#include "itr/core.hpp"
#include "output/certify.hpp"
#include "output/file_list.hpp"
#include "output/files.hpp"
#include "output/force_file.hpp"
#include "report.hpp"

namespace itr::report {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text)
    out += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : c == '"' ? "&quot;" : std::string(1, c);
  return out;
}

std::string block(const std::string& id, std::string_view compressed) {
  return fmt::format("<script type=\"text/plain\" id=\"{}\">{}</script>\n", id, base64(compressed));
}

/// An element of JSON; bytes that are not UTF-8 are replaced.
std::string json_block(const std::string& id, const Json& json) {
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  for (std::size_t i = 0; (i = text.find('<', i)) != std::string::npos; i += 6) text.replace(i, 1, "\\u003c");
  return fmt::format("<script type=\"application/json\" id=\"{}\">{}</script>\n", id, text);
}

Json first(const std::array<double, 3>& values, int n) { return std::vector<double>(values.begin(), values.begin() + n); }

Json range(const std::array<double, 2>& values) { return values[0] <= values[1] ? Json(values) : Json{0, 0}; }

Json describe(const std::vector<FieldName>& fields) {
  Json list = Json::array();
  for (const FieldName& field : fields) list.push_back({{"name", field.name}, {"unit", field.unit}});
  return list;
}

/// The scene's names of units by those of SI.
Json describe(const Units& units) {
  Json names;
  for (const char* unit : {"m", "s", "J", "N", "N m"}) names[unit] = units.name(unit);
  return names;
}

Json describe(const EncodedFrame& frame, int dim) {
  Json forces = Json::object();
  for (const auto& [name, sum] : frame.forces) forces[name] = first(sum, dim);
  return {{"step", frame.step},   {"t", frame.t},     {"mesh", frame.mesh},           {"vertices", frame.vertices},
          {"cells", frame.cells}, {"forces", forces}, {"low", first(frame.low, dim)}, {"high", first(frame.high, dim)}};
}

/// The numbers 0 to n - 1, every so many-th, and the last.
std::vector<int> thinned(int n, int every) {
  std::vector<int> chosen;
  for (int i = 0; i < n; ++i)
    if (i % every == 0 || i + 1 == n) chosen.push_back(i);
  return chosen;
}

/// Whole lines only: a run that goes on may be writing the next.
std::string step_lines(const fs::path& directory) {
  const std::string text = read_file(directory / "steps.jsonl").value_or("");
  return text.substr(0, text.rfind('\n') + 1);
}

std::string fill(std::string_view page, const std::vector<std::pair<std::string, std::string_view>>& parts) {
  std::string out;
  std::size_t at = 0;
  for (std::size_t open; (open = page.find("{{", at)) != std::string::npos;) {
    const std::size_t close = page.find("}}", open);
    out += page.substr(at, open - at);
    const std::string_view name = page.substr(open + 2, close - open - 2);
    for (const auto& [key, value] : parts)
      if (key == name) out += value;
    at = close + 2;
  }
  return out += page.substr(at);
}

Json describe(const output::Certificate& certificate) {
  constexpr std::size_t kShown = 20;  // a run that went wrong may have as many as it has cells
  const auto& all = certificate.violations;
  Json shown = Json::array();
  for (std::size_t i = 0; i < std::min(all.size(), kShown); ++i) shown.push_back(all[i].text);
  return {{"frames", certificate.frames}, {"count", all.size()}, {"violations", shown}};
}

/// Data of a run that a page holds.
struct RunData {
  std::string name;
  fs::path directory;
  const FrameEncoder& encoder;
  Json certificate{};  ///< null: not asked for
};

/// Elements of a run with the frames `chosen` of those that are encoded; their ids begin with `prefix`.
std::string run_blocks(const std::string& prefix, const RunData& run, const std::vector<int>& chosen,
                       const std::vector<std::string>& notes = {}) {
  const FrameEncoder& encoder = run.encoder;
  const FrameEncoder::Topology topology = encoder.topology(chosen);
  const int dim = encoder.dim();
  Json frames = Json::array();
  std::string data;
  for (const int i : chosen) {
    data += block(fmt::format("{}frame{}", prefix, frames.size()), encoder.frames()[i].bytes);
    frames.push_back(describe(encoder.frames()[i], dim));
  }
  const Json summary = Json::parse(read_file(run.directory / "summary.json").value_or(""), nullptr, false);
  const Json meta = {{"title", run.name},
                     {"version", ITR_VERSION},
                     {"dim", dim},
                     {"origin", first(encoder.origin(), dim)},
                     {"low", first(encoder.low(), dim)},
                     {"high", first(encoder.high(), dim)},
                     {"counts", topology.counts},
                     {"vertex_fields", describe(encoder.vertex_fields())},
                     {"cell_fields", describe(encoder.cell_fields())},
                     {"largest", encoder.largest()},
                     {"shown", encoder.shown()},
                     {"largest_u", encoder.largest_u()},
                     {"ranges", {{"J", range(encoder.volume_ratios())}, {"size", range(encoder.longest_edges())}}},
                     {"notes", notes},
                     {"summary", summary.is_discarded() ? Json() : summary},
                     {"certificate", run.certificate},
                     {"units", describe(encoder.units())},
                     {"frames", frames}};
  return json_block(prefix + "meta", meta) + block(prefix + "steps", deflate(step_lines(run.directory))) +
         block(prefix + "topology", topology.bytes) +
         block(prefix + "forces", deflate(output::stored_forces(run.directory))) + data;
}

std::string page(const std::string& title, const std::string& diagram, const std::string& data) {
  return fill(assets::page, {{"TITLE", escaped(title)},
                             {"STYLE", assets::style},
                             {"DIAGRAM", diagram},
                             {"DATA", data},
                             {"SCRIPT", assets::script}});
}

double megabytes(const std::string& text) { return static_cast<double>(text.size()) / 1e6; }

/// Size of displacements and fields on the page.
double megabytes_of_frames(const FrameEncoder& encoder, const std::vector<int>& chosen) {
  std::size_t bytes = 0;
  for (const int i : chosen) bytes += encoder.frames()[i].bytes.size();
  return 4e-6 / 3 * static_cast<double>(bytes);
}

std::string ordinal(int n) { return fmt::format("{}{}", n, n == 2 ? "nd" : n == 3 ? "rd" : "th"); }

/// Says which frames the page has; empty: all.
std::vector<std::string> note_frames(std::size_t chosen, std::size_t stored, int every, const ReportOptions& options) {
  if (chosen == stored) return {};
  return {fmt::format("{} of {} stored frames: every {}{}", chosen, stored, ordinal(every),
                      every > std::max(options.every, 1) ? fmt::format(", for at most {:g} MB", options.max_mb) : "")};
}

}  // namespace

ReportSummary write_report(const fs::path& directory, const fs::path& file, const ReportOptions& options) {
  const std::vector<fs::path> stored = output::stored_frames(directory);
  if (stored.empty())
    throw InputError({directory.string(), "frames", "no stored frame", "the folder of a run, with frames/NNNNNN.h5"});
  FrameEncoder encoder;
  RunData run{fs::canonical(directory).filename().string(), directory, encoder};
  if (options.certify) run.certificate = describe(output::certify(directory));
  const int every = std::max(options.every, 1);
  for (const int i : thinned(static_cast<int>(stored.size()), every)) encoder.add(stored[i]);
  ReportSummary summary;
  std::string html;
  for (int factor = 1;; factor *= 2) {
    const std::vector<int> chosen = thinned(static_cast<int>(encoder.frames().size()), factor);
    if (chosen.size() > 2 && megabytes_of_frames(encoder, chosen) > options.max_mb) continue;
    summary.frames = static_cast<int>(chosen.size());
    summary.notes = note_frames(chosen.size(), stored.size(), factor * every, options);
    html = page(run.name, "", run_blocks("", run, chosen, summary.notes));
    if (megabytes(html) <= options.max_mb || chosen.size() <= 2) break;
  }
  if (std::error_code none; fs::equivalent(fs::absolute(file).parent_path(), directory, none))
    output::add_to_file_list(directory, file.filename().string());
  output::write_file(file, html);
  summary.mb = megabytes(html);
  return summary;
}

ReportSummary write_study_report(const fs::path& directory, const fs::path& file, const ReportOptions& options) {
  const fs::path source = directory / "study.json";
  const Json results = Json::parse(read_file(source).value_or(""), nullptr, false);
  if (!results.is_object() || !results.contains("runs") || !results["runs"].is_array())
    throw InputError({source.string(), "", "no results of a study", "what `itr study` writes"});
  const std::string diagram = read_file(directory / "study.svg").value_or("");
  ReportSummary summary;
  std::vector<std::pair<std::string, std::string>> shown;  // run, its blocks
  std::string data = json_block("study", results);
  std::size_t size = assets::script.size() + data.size() + diagram.size();
  for (const Json& run : results["runs"]) {
    const std::string name = run.value("run", "");
    const fs::path folder = directory / "runs" / name;
    const auto frames = run.value("status", "") == "failed" ? std::vector<fs::path>() : output::stored_frames(folder);
    if (frames.empty()) continue;
    FrameEncoder encoder;
    encoder.add(frames.back());
    shown.push_back({name, run_blocks("run-" + name + "-", {name, folder, encoder}, {0})});
    size += shown.back().second.size();
  }
  while (static_cast<double>(size) > 1e6 * options.max_mb && !shown.empty()) {
    const auto largest = std::ranges::max_element(shown, {}, [](const auto& one) { return one.second.size(); });
    summary.notes.push_back(fmt::format("the mesh of {} is left out, for at most {:g} MB", largest->first, options.max_mb));
    size -= largest->second.size();
    shown.erase(largest);
  }
  Json names = Json::array();
  for (const auto& [name, blocks] : shown) {
    names.push_back(name);
    data += blocks;
  }
  data += json_block("study-runs", {{"runs", names}, {"notes", summary.notes}});
  const std::string html = page(fs::canonical(directory).filename().string(), diagram, data);
  output::write_file(file, html);
  summary.frames = static_cast<int>(shown.size());
  summary.mb = megabytes(html);
  return summary;
}

}  // namespace itr::report
