// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "assets.hpp"
#include "deflate.hpp"
#include "frames.hpp"
#include "itr/core/error.hpp"
#include "output/certify.hpp"
#include "output/file_list.hpp"
#include "output/files.hpp"
#include "output/force_file.hpp"
#include "picture.hpp"
#include "report.hpp"

namespace itr::output {

namespace {

namespace fs = std::filesystem;

std::string read_text(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// Text of JSON as a script element may hold it.
std::string in_script(std::string json) {
  for (std::size_t i = 0; (i = json.find('<', i)) != std::string::npos; i += 6) json.replace(i, 1, "\\u003c");
  return json;
}

std::string json_string(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    if (static_cast<unsigned char>(c) < 0x20)
      out += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    else
      out += c;
  }
  return out + '"';
}

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text)
    out += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : c == '"' ? "&quot;" : std::string(1, c);
  return out;
}

std::string json_list(const std::array<double, 3>& values, int n) {
  return fmt::format("[{}]", fmt::join(values.begin(), values.begin() + n, ","));
}

std::string json_range(const std::array<double, 2>& range) {
  return range[0] <= range[1] ? fmt::format("[{},{}]", range[0], range[1]) : "[0,0]";
}

std::string json_fields(const std::vector<FieldName>& fields) {
  std::vector<std::string> items;
  for (const FieldName& field : fields)
    items.push_back(fmt::format(R"({{"name":{},"unit":{}}})", json_string(field.name), json_string(field.unit)));
  return fmt::format("[{}]", fmt::join(items, ","));
}

/// The scene's names of units by those of SI.
std::string json_units(const Units& units) {
  std::vector<std::string> items;
  for (const char* unit : {"m", "s", "J", "N", "N m"})
    items.push_back(json_string(unit) + ":" + json_string(units.name(unit)));
  return fmt::format("{{{}}}", fmt::join(items, ","));
}

std::string json_forces(const EncodedFrame& frame, int dim) {
  std::vector<std::string> items;
  for (const auto& [name, sum] : frame.forces) items.push_back(json_string(name) + ":" + json_list(sum, dim));
  return fmt::format("{{{}}}", fmt::join(items, ","));
}

std::string block(const std::string& id, const std::string& text, bool is_json = false) {
  return fmt::format("<script type=\"{}\" id=\"{}\">{}</script>\n", is_json ? "application/json" : "text/plain", id, text);
}

/// Every so many-th, and the last.
std::vector<fs::path> thinned(const std::vector<fs::path>& all, int every) {
  std::vector<fs::path> chosen;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (i % every == 0 || i + 1 == all.size()) chosen.push_back(all[i]);
  return chosen;
}

/// Whole lines only: a run that goes on may be writing the next.
std::string step_lines(const fs::path& directory) {
  const std::string text = read_text(directory / "steps.jsonl");
  return text.substr(0, text.rfind('\n') + 1);
}

/// Where the colours of a field of cells end.
double shown(const FrameEncoder& encoder, std::string_view name) {
  for (std::size_t i = 0; i < encoder.cell_fields().size(); ++i)
    if (encoder.cell_fields()[i].name == name) return encoder.shown()[encoder.vertex_fields().size() + i];
  return 0;
}

std::string pictures(const std::vector<fs::path>& files, const FrameEncoder& encoder) {
  std::vector<fs::path> chosen = {files.front(), files[files.size() / 2], files.back()};
  chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  std::vector<StoredFrame> frames;
  std::vector<std::vector<double>> densities;
  const double largest = shown(encoder, "elastic_density");
  for (const fs::path& path : chosen) {
    frames.push_back(read_frame(path));
    densities.emplace_back();
    for (StoredField& field : read_frame_fields(path))
      if (field.name == "elastic_density") densities.back() = std::move(field.values);
  }
  std::string html;
  const Units& units = frames.front().units;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const std::string png =
        draw_frame(frames[i], densities[i], largest, cells_of_facets(frames[i]), encoder.low(), encoder.high(), 640, 420);
    html += fmt::format(
        "<figure><img alt=\"step {0}\" src=\"data:image/png;base64,{1}\"><figcaption>step {0}, t = {2:.6g} {3}</figcaption>"
        "</figure>\n",
        step_of_frame(chosen[i]), base64(png), read_frame_sizes(chosen[i]).t, units.name("s"));
  }
  return html + fmt::format("<p>Colour: elastic energy density, 0 to {:.4g} {}/{}{} and more.</p>\n", largest,
                            units.name("J"), units.name("m"), encoder.dim() == 2 ? "²" : "³");
}

std::string colours() {
  std::vector<std::string> items;
  for (const auto& c : kColourMap) items.push_back(fmt::format("[{},{},{}]", c[0], c[1], c[2]));
  return fmt::format("{}", fmt::join(items, ","));
}

std::string meta(const FrameEncoder& encoder, const std::string& title, const std::string& counts, bool has_inside,
                 const std::string& summary, const std::vector<std::string>& notes, const std::string& certificate) {
  const int dim = encoder.dim();
  std::vector<std::string> frames, chunks, said;
  for (const EncodedFrame& f : encoder.frames())
    frames.push_back(fmt::format(R"({{"step":{},"t":{},"mesh":{},"vertices":{},"cells":{},"forces":{}}})", f.step, f.t,
                                 f.mesh, f.vertices, f.cells, json_forces(f, dim)));
  for (const EncodedChunk& c : encoder.chunks())
    chunks.push_back(fmt::format(R"({{"first":{},"count":{},"low":{},"high":{}}})", c.first, c.count, json_list(c.low, dim),
                                 json_list(c.high, dim)));
  for (const std::string& note : notes) said.push_back(json_string(note));
  return fmt::format(
      R"({{"title":{},"version":{},"dim":{},"origin":{},"low":{},"high":{},"counts":{},"inside":{},"azimuth":{},)"
      R"("elevation":{},"vertex_fields":{},"cell_fields":{},"largest":[{}],"shown":[{}],"largest_u":{},)"
      R"("ranges":{{"J":{},"size":{}}},"notes":[{}],"summary":{},"certificate":{},)"
      R"("units":{},"colours":[{}],"chunks":[{}],"frames":[{}]}})",
      json_string(title), json_string(ITR_VERSION), dim, json_list(encoder.origin(), dim), json_list(encoder.low(), dim),
      json_list(encoder.high(), dim), counts, has_inside, kAzimuth, kElevation, json_fields(encoder.vertex_fields()),
      json_fields(encoder.cell_fields()), fmt::join(encoder.largest(), ","), fmt::join(encoder.shown(), ","),
      encoder.largest_u(), json_range(encoder.volume_ratios()), json_range(encoder.longest_edges()), fmt::join(said, ","),
      summary.empty() ? "null" : summary, certificate.empty() ? "null" : certificate, json_units(encoder.units()), colours(),
      fmt::join(chunks, ","), fmt::join(frames, ","));
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

std::string certificate_json(const Certificate& certificate) {
  constexpr std::size_t kShown = 20;  // a run that went wrong may have as many as it has cells
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < std::min(certificate.violations.size(), kShown); ++i)
    lines.push_back(json_string(certificate.violations[i]));
  return fmt::format(R"({{"frames":{},"count":{},"violations":[{}]}})", certificate.frames, certificate.violations.size(),
                     fmt::join(lines, ","));
}

/// All that a page holds of a run; ids of its elements begin with `prefix`.
std::string run_blocks(const std::string& prefix, const std::string& name, const fs::path& directory,
                       const FrameEncoder& encoder, bool has_inside, const std::vector<std::string>& notes,
                       const std::string& certificate = {}) {
  std::string counts;
  const std::string topology = encoder.topology(counts), summary = read_text(directory / "summary.json");
  std::string data =
      block(prefix + "meta", in_script(meta(encoder, name, counts, has_inside, summary, notes, certificate)), true);
  data += block(prefix + "steps", base64(deflate(step_lines(directory)))) + block(prefix + "topology", base64(topology));
  data += block(prefix + "forces", base64(deflate(stored_forces(directory))));
  for (std::size_t i = 0; i < encoder.chunks().size(); ++i)
    data += block(fmt::format("{}chunk{}", prefix, i), base64(encoder.chunks()[i].bytes));
  return data;
}

class Page {
 public:
  Page(const fs::path& directory, const ReportOptions& options) : directory_(directory), options_(options) {
    all_ = stored_frames(directory);
    if (all_.empty())
      throw InputError({directory.string(), "frames", "no stored frame", "the folder of a run, with frames/NNNNNN.h5"});
    if (options.certify) certificate_ = certificate_json(certify(directory));
  }

  /// Leaves out what makes it too large: cells inside first, then frames.
  std::string text() {
    for (int every = std::max(options_.every, 1), inside = 1;;) {
      const std::string html = encode(every, inside);
      const double mb = html.empty() ? 2 * options_.max_mb : static_cast<double>(html.size()) / 1e6;
      if (!html.empty() && (mb <= options_.max_mb || chosen_.size() <= 2)) return html;
      if (inside && dim_ == 3)
        inside = 0;
      else
        every *= 2;
    }
  }

  ReportSummary summary() const { return {static_cast<int>(chosen_.size()), static_cast<int>(all_.size()), 0, notes_}; }

 private:
  /// Empty: too large.
  std::string encode(int every, bool inside) {
    chosen_ = thinned(all_, every);
    FrameEncoder encoder(inside);
    for (const fs::path& path : chosen_) {
      encoder.add(path);
      dim_ = encoder.dim();
      if (chosen_.size() > 2 && 4e-6 / 3 * static_cast<double>(encoder.bytes()) > options_.max_mb) return "";
    }
    encoder.finish();
    notes_.clear();
    if (chosen_.size() < all_.size())
      notes_.push_back(
          fmt::format("{} of {} stored frames: every {}{}", chosen_.size(), all_.size(), ordinal(every),
                      every > std::max(options_.every, 1) ? fmt::format(", for at most {:g} MB", options_.max_mb) : ""));
    if (!inside) notes_.push_back(fmt::format("cells inside of solids are left out, for at most {:g} MB", options_.max_mb));

    const std::string pngs = pictures(chosen_, encoder), name = fs::canonical(directory_).filename().string();
    const std::string data = run_blocks("", name, directory_, encoder, inside, notes_, certificate_);
    return fill(assets::page, {{"TITLE", escaped(name)},
                               {"STYLE", assets::style},
                               {"PICTURES", pngs},
                               {"DATA", data},
                               {"SCRIPT", assets::script}});
  }

  static std::string ordinal(int n) { return fmt::format("{}{}", n, n == 2 ? "nd" : n == 3 ? "rd" : "th"); }

  fs::path directory_;
  ReportOptions options_;
  std::string certificate_;  ///< JSON; empty: not asked for
  std::vector<fs::path> all_, chosen_;
  std::vector<std::string> notes_;
  int dim_ = 0;
};

}  // namespace

ReportSummary write_report(const fs::path& directory, const fs::path& file, const ReportOptions& options) {
  Page page(directory, options);
  const std::string html = page.text();
  if (std::error_code none; fs::equivalent(fs::absolute(file).parent_path(), directory, none))
    add_to_file_list(directory, file.filename().string());
  write_file(file, html);
  ReportSummary summary = page.summary();
  summary.mb = static_cast<double>(html.size()) / 1e6;
  return summary;
}

ReportSummary write_study_report(const std::string& title, const std::string& results, const std::string& diagram,
                                 const std::vector<StudyRun>& runs, const fs::path& file, const ReportOptions& options) {
  struct Shown {
    std::string name, blocks;
  };
  ReportSummary summary;
  std::vector<Shown> shown;
  std::size_t size = assets::script.size() + results.size() + diagram.size();
  for (const StudyRun& run : runs) {
    const std::vector<fs::path> frames = stored_frames(run.directory);
    if (frames.empty()) continue;
    ++summary.stored;
    FrameEncoder encoder(true);
    encoder.add(frames.back());
    encoder.finish();
    shown.push_back({run.name, run_blocks("run-" + run.name + "-", run.name, run.directory, encoder, true, {})});
    size += shown.back().blocks.size();
  }
  while (static_cast<double>(size) > 1e6 * options.max_mb && !shown.empty()) {
    const auto largest = std::max_element(shown.begin(), shown.end(),
                                          [](const Shown& a, const Shown& b) { return a.blocks.size() < b.blocks.size(); });
    summary.notes.push_back(fmt::format("the mesh of {} is left out, for at most {:g} MB", largest->name, options.max_mb));
    size -= largest->blocks.size();
    shown.erase(largest);
  }
  std::vector<std::string> names, notes;
  std::string data = block("study", in_script(results), true);
  for (const Shown& run : shown) {
    names.push_back(json_string(run.name));
    data += run.blocks;
  }
  for (const std::string& note : summary.notes) notes.push_back(json_string(note));
  data += block("study-runs",
                in_script(fmt::format(R"({{"runs":[{}],"notes":[{}],"colours":[{}]}})", fmt::join(names, ","),
                                      fmt::join(notes, ","), colours())),
                true);
  const std::string html = fill(assets::page, {{"TITLE", escaped(title)},
                                               {"STYLE", assets::style},
                                               {"PICTURES", diagram},
                                               {"DATA", data},
                                               {"SCRIPT", assets::script}});
  write_file(file, html);
  summary.frames = static_cast<int>(shown.size());
  summary.mb = static_cast<double>(html.size()) / 1e6;
  return summary;
}

}  // namespace itr::output
