// SPDX-License-Identifier: MIT
#include "plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace itr::cli::study {

namespace {

constexpr int kWidth = 340, kHeight = 250, kLeft = 62, kRight = 12, kTop = 12, kBottom = 44, kLegendLine = 18;
constexpr const char* kColours[] = {"#000000", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00",
                                    "#56b4e9", "#8c510a", "#6a3d9a", "#999999", "#b15928"};

struct Point {
  double x, y;
};

struct Line {
  const char* name;
  const char* colour;
  std::vector<Point> points;
};

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '<' ? "&lt;" : c == '&' ? "&amp;" : std::string(1, c);
  return out;
}

/// A logarithmic axis over whole steps of 1, 2, 5.
class Axis {
 public:
  void include(double value) { low_ = std::min(low_, value), high_ = std::max(high_, value); }
  bool is_empty() const { return !(high_ > 0); }
  void finish() {
    low_ = step_below(low_);
    high_ = -step_below(-high_, true);
    if (high_ <= low_) high_ = 10 * low_;
  }
  double share(double value) const { return std::log(value / low_) / std::log(high_ / low_); }
  /// Powers of ten, with 2 and 5 between where there are few.
  std::vector<double> ticks() const {
    std::vector<double> found;
    const bool is_short = high_ / low_ < 150;
    for (int e = static_cast<int>(std::floor(std::log10(low_))); e <= std::ceil(std::log10(high_)); ++e)
      for (const double m : {1.0, 2.0, 5.0}) {
        const double tick = m * std::pow(10, e);
        if ((m == 1 || is_short) && tick > 0.999 * low_ && tick < 1.001 * high_) found.push_back(tick);
      }
    return found;
  }

 private:
  /// The next of 1, 2, 5 times a power of ten at or below; `negated`: above, for a negated value.
  static double step_below(double value, bool negated = false) {
    const double v = std::abs(value), power = std::pow(10, std::floor(std::log10(v)));
    const double all[] = {1, 2, 5, 10};
    if (negated) return -power * *std::find_if(all, all + 3, [&](double m) { return m * power >= 0.9999 * v; });
    double best = 1;
    for (const double m : all)
      if (m * power <= 1.0001 * v) best = m;
    return best * power;
  }

  double low_ = std::numeric_limits<double>::infinity(), high_ = 0;
};

/// Series with what they have of a measure, by cost.
std::vector<Line> lines_of(const Results& results, const Measure& measure, const Cost& cost) {
  std::vector<Line> lines;
  for (const auto& series : all_series()) {
    if (series.kind == Series::Kind::solvers || series.kind == Series::Kind::time_steps) continue;
    const std::size_t colour = static_cast<std::size_t>(&series - all_series().data()) % std::size(kColours);
    Line line{series.name, kColours[colour], {}};
    for (const auto& row : results.rows) {
      if (row.run.series->name != std::string(series.name)) continue;
      const auto error = told_error(results, row, measure);
      if (!error) continue;
      const Point point{row.*cost.value, *error};
      if (point.x > 0 && point.y > 0) line.points.push_back(point);
    }
    std::stable_sort(line.points.begin(), line.points.end(), [](const Point& a, const Point& b) { return a.y > b.y; });
    if (!line.points.empty()) lines.push_back(std::move(line));
  }
  return lines;
}

std::string draw_text(double x, double y, const char* anchor, const std::string& text, const char* more = "") {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"{}>{}</text>\n", x, y, anchor, more, escaped(text));
}

std::string draw_line(double x0, double y0, double x1, double y1, const char* colour) {
  return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\"/>\n", x0, y0, x1, y1,
                     colour);
}

std::string draw_panel(double left, double top, const std::vector<Line>& lines, const std::string& x_label,
                       const std::string& y_label) {
  Axis x, y;
  for (const auto& line : lines)
    for (const auto& point : line.points) x.include(point.x), y.include(point.y);
  if (x.is_empty()) return "";
  x.finish();
  y.finish();
  const double x0 = left + kLeft, x1 = left + kWidth - kRight, y0 = top + kHeight - kBottom, y1 = top + kTop;
  const auto at_x = [&](double value) { return x0 + x.share(value) * (x1 - x0); };
  const auto at_y = [&](double value) { return y0 + y.share(value) * (y1 - y0); };
  std::string svg;
  for (const double tick : x.ticks()) {
    svg += draw_line(at_x(tick), y0, at_x(tick), y1, "#ddd");
    svg += draw_text(at_x(tick), y0 + 14, "middle", fmt::format("{:.3g}", tick));
  }
  for (const double tick : y.ticks()) {
    svg += draw_line(x0, at_y(tick), x1, at_y(tick), "#ddd");
    svg += draw_text(x0 - 5, at_y(tick) + 4, "end", fmt::format("{:.3g}", tick));
  }
  svg += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" stroke=\"#888\"/>\n",
                     x0, y1, x1 - x0, y0 - y1);
  svg += draw_text((x0 + x1) / 2, y0 + 32, "middle", x_label);
  const double middle = (y0 + y1) / 2;
  svg += draw_text(left + 11, middle, "middle", y_label,
                   fmt::format(" transform=\"rotate(-90 {:.1f} {:.1f})\"", left + 11, middle).c_str());
  for (const auto& line : lines) {
    std::string path;
    for (const auto& point : line.points) path += fmt::format("{:.1f},{:.1f} ", at_x(point.x), at_y(point.y));
    svg += fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\"/>\n", path, line.colour);
    for (const auto& point : line.points)
      svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\" fill=\"{}\"/>\n", at_x(point.x), at_y(point.y),
                         line.colour);
  }
  return svg;
}

}  // namespace

std::string work_precision_svg(const Results& results) {
  std::vector<Line> legend;
  std::string panels;
  int rows = 0;
  for (const auto& measure : measures()) {
    if (lines_of(results, measure, costs()[0]).empty()) continue;
    for (std::size_t k = 0; k < costs().size(); ++k) {
      const auto lines = lines_of(results, measure, costs()[k]);
      if (lines.size() > legend.size()) legend = lines;
      panels += draw_panel(static_cast<double>(k) * kWidth, rows * kHeight, lines, costs()[k].label,
                           fmt::format("{}{}{}", measure.name, *measure.unit ? " error, " : " error", measure.unit));
    }
    ++rows;
  }
  const int top = rows * kHeight, width = static_cast<int>(costs().size()) * kWidth;
  std::string keys;
  int at = top;
  for (const auto& line : legend) {
    const auto series = std::find_if(all_series().begin(), all_series().end(),
                                     [&](const Series& s) { return std::string(s.name) == line.name; });
    keys += draw_line(kLeft, at + 8, kLeft + 30, at + 8, line.colour);
    keys += draw_text(kLeft + 38, at + 12, "start", fmt::format("{}: {}", line.name, series->what));
    at += kLegendLine;
  }
  return fmt::format(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
             "font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>\n",
             width, at + 8) +
         panels + keys + "</svg>\n";
}

}  // namespace itr::cli::study
