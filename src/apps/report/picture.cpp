// SPDX-License-Identifier: MIT
#include "picture.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "deflate.hpp"

namespace itr::output {

namespace {

using Point = std::array<double, 3>;
using Colour = std::array<double, 3>;

Colour colour_of(double share) {
  const double at = std::clamp(share, 0.0, 1.0) * (kColourMap.size() - 1);
  const std::size_t k = std::min<std::size_t>(static_cast<std::size_t>(at), kColourMap.size() - 2);
  Colour colour;
  for (int i = 0; i < 3; ++i) colour[i] = kColourMap[k][i] + (at - k) * (kColourMap[k + 1][i] - kColourMap[k][i]);
  return colour;
}

std::string big_endian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 255);
  return bytes;
}

std::string png_chunk(const std::string& name, const std::string& data) {
  const std::string body = name + data;
  return big_endian(static_cast<std::uint32_t>(data.size())) + body + big_endian(crc32_of(body));
}

/// Pixels with depths; x to the right, y up, z towards the eye, in units of the scene.
class Canvas {
 public:
  Canvas(int width, int height, const Point& low, const Point& high)
      : width_(width), height_(height), pixels_(3 * width * height, 255), depth_(width * height, -INFINITY) {
    scale_ = 0.92 * std::min(width / std::max(high[0] - low[0], 1e-300), height / std::max(high[1] - low[1], 1e-300));
    for (int k = 0; k < 2; ++k) centre_[k] = (low[k] + high[k]) / 2;
  }

  void triangle(const std::array<Point, 3>& corners, const Colour& colour) {
    std::array<Point, 3> p;
    for (int i = 0; i < 3; ++i) p[i] = on_screen(corners[i]);
    const double area = cross(p[0], p[1], p[2]);
    if (area == 0 || !std::isfinite(area)) return;
    const auto [x0, x1] = std::minmax({p[0][0], p[1][0], p[2][0]});
    const auto [y0, y1] = std::minmax({p[0][1], p[1][1], p[2][1]});
    const int last_x = std::min(width_ - 1.0, std::ceil(x1)), last_y = std::min(height_ - 1.0, std::ceil(y1));
    for (int y = std::max(0.0, std::floor(y0)); y <= last_y; ++y)
      for (int x = std::max(0.0, std::floor(x0)); x <= last_x; ++x) {
        const Point here = {x + 0.5, y + 0.5, 0};
        const double a = cross(here, p[1], p[2]) / area, b = cross(p[0], here, p[2]) / area, c = 1 - a - b;
        if (a >= 0 && b >= 0 && c >= 0) put(x, y, a * p[0][2] + b * p[1][2] + c * p[2][2], colour);
      }
  }

  void line(const Point& from, const Point& to, const Colour& colour) {
    const Point a = on_screen(from), b = on_screen(to);
    const double length = std::hypot(b[0] - a[0], b[1] - a[1]);
    if (!(length < 1e5)) return;
    for (int i = 0, n = static_cast<int>(2 * length) + 1; i <= n; ++i) {
      const double s = static_cast<double>(i) / n, x = a[0] + s * (b[0] - a[0]), y = a[1] + s * (b[1] - a[1]);
      if (x < 0 || y < 0 || x >= width_ || y >= height_) continue;
      put(static_cast<int>(x), static_cast<int>(y), a[2] + s * (b[2] - a[2]), colour);
    }
  }

  std::string png() const {
    std::string rows;
    for (int y = 0; y < height_; ++y) {
      rows += '\0';  // of the filter: none
      rows.append(reinterpret_cast<const char*>(&pixels_[3 * static_cast<std::size_t>(y) * width_]), 3 * width_);
    }
    const std::string head = big_endian(width_) + big_endian(height_) + std::string("\x08\x02\x00\x00\x00", 5);
    return "\x89PNG\r\n\x1a\n" + png_chunk("IHDR", head) + png_chunk("IDAT", deflate(rows)) + png_chunk("IEND", "");
  }

 private:
  Point on_screen(const Point& p) const {
    return {width_ / 2.0 + scale_ * (p[0] - centre_[0]), height_ / 2.0 - scale_ * (p[1] - centre_[1]), scale_ * p[2]};
  }
  static double cross(const Point& a, const Point& b, const Point& c) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  }
  void put(int x, int y, double z, const Colour& colour) {
    const std::size_t at = static_cast<std::size_t>(y) * width_ + x;
    if (z < depth_[at]) return;
    depth_[at] = z;
    for (int i = 0; i < 3; ++i) pixels_[3 * at + i] = static_cast<unsigned char>(std::clamp(colour[i], 0.0, 255.0));
  }

  int width_, height_;
  std::vector<unsigned char> pixels_;
  std::vector<double> depth_;
  double scale_ = 1;
  std::array<double, 2> centre_{};
};

/// Turns points of the scene so that the eye looks along -z.
class Eye {
 public:
  explicit Eye(int dim) : is_plane_(dim == 2) {
    const double a = kAzimuth * std::numbers::pi / 180, e = kElevation * std::numbers::pi / 180;
    forward_ = {std::sin(a) * std::cos(e), std::sin(e), std::cos(a) * std::cos(e)};
    right_ = {std::cos(a), 0, -std::sin(a)};
    for (int k = 0; k < 3; ++k)
      up_[k] = forward_[(k + 1) % 3] * right_[(k + 2) % 3] - forward_[(k + 2) % 3] * right_[(k + 1) % 3];
  }
  Point turn(const Point& p) const {
    if (is_plane_) return {p[0], p[1], 0};
    return {dot(right_, p), dot(up_, p), dot(forward_, p)};
  }

 private:
  static double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
  bool is_plane_;
  Point forward_, right_, up_;
};

/// Dims a colour where light falls from beside the eye.
Colour lit(const Colour& colour, const std::array<Point, 3>& p) {
  Point a, b, n;
  for (int k = 0; k < 3; ++k) a[k] = p[1][k] - p[0][k], b[k] = p[2][k] - p[0][k];
  for (int k = 0; k < 3; ++k) n[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
  const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  const double share = length > 0 ? 0.55 + 0.45 * std::abs(0.25 * n[0] + 0.45 * n[1] + 0.86 * n[2]) / length : 1;
  return {share * colour[0], share * colour[1], share * colour[2]};
}

}  // namespace

std::string draw_frame(const StoredFrame& frame, const std::vector<double>& cell_values, double largest,
                       const std::vector<int>& cells_of_facets, const std::array<double, 3>& low,
                       const std::array<double, 3>& high, int width, int height) {
  const int dim = frame.dim;
  const Eye eye(dim);
  Point least = {INFINITY, INFINITY, 0}, most = {-INFINITY, -INFINITY, 0};
  for (int corner = 0; corner < 8; ++corner) {
    const Point p = eye.turn({corner & 1 ? high[0] : low[0], corner & 2 ? high[1] : low[1], corner & 4 ? high[2] : low[2]});
    for (int k = 0; k < 2; ++k) least[k] = std::min(least[k], p[k]), most[k] = std::max(most[k], p[k]);
  }
  Canvas canvas(width, height, least, most);
  const auto point = [&](const std::vector<double>& x, std::int64_t i) {
    Point p{};
    for (int k = 0; k < dim; ++k) p[k] = x[i * dim + k];
    return eye.turn(p);
  };
  const Colour grey = {225, 226, 230}, dark = {60, 60, 70};
  const auto& obstacles = frame.obstacles;
  for (std::size_t f = 0; f + 2 < obstacles.faces.size(); f += 3) {
    std::array<Point, 3> p;
    for (int k = 0; k < 3; ++k) p[k] = point(obstacles.x, obstacles.faces[f + k]);
    canvas.triangle(p, lit(grey, p));
  }
  const auto draw = [&](const std::int64_t* ids, int cell) {
    const double value = cell >= 0 && static_cast<std::size_t>(cell) < cell_values.size() ? cell_values[cell] : 0;
    const Colour colour = colour_of(largest > 0 ? value / largest : 0);
    std::array<Point, 3> p;
    for (int k = 0; k < 3; ++k) p[k] = point(frame.x, ids[k]);
    canvas.triangle(p, dim == 3 ? lit(colour, p) : colour);
  };
  if (dim == 2)
    for (std::size_t c = 0; c < frame.body.size(); ++c) draw(&frame.simplices[3 * c], static_cast<int>(c));
  else
    for (std::size_t f = 0; f < cells_of_facets.size(); ++f) draw(&frame.surface[3 * f], cells_of_facets[f]);
  if (dim == 2 || obstacles.faces.empty())
    for (std::size_t e = 0; e + 1 < obstacles.edges.size(); e += 2)
      canvas.line(point(obstacles.x, obstacles.edges[e]), point(obstacles.x, obstacles.edges[e + 1]), dark);
  return canvas.png();
}

}  // namespace itr::output
