// SPDX-License-Identifier: MIT
#include "geometric_contact.hpp"

#include <algorithm>
#include <cmath>

#include "energy/contact/candidates.hpp"
#include "energy/project_block.hpp"
#include "taylor.hpp"

namespace itr {

namespace {

constexpr int kVariables = 12;
using Series = Taylor<kVariables>;

template <typename T>
using Point = std::array<T, 2>;
template <typename T>
Point<T> operator-(const Point<T>& a, const Point<T>& b) {
  return {a[0] - b[0], a[1] - b[1]};
}
template <typename T>
T dot(const Point<T>& a, const Point<T>& b) {
  return a[0] * b[0] + a[1] * b[1];
}
template <typename T>
T cross(const Point<T>& a, const Point<T>& b) {
  return a[0] * b[1] - a[1] * b[0];
}
template <typename T>
T length(const Point<T>& a) {
  return root(dot(a, a));
}

/// 0 below -width, 1 from 0 on, by cubic polynomials.
template <typename T>
T smooth_step(const T& x, double width) {
  const double s = 3 / width, y = s * value_of(x);
  std::array<double, 3> f = {1, 0, 0};
  if (y <= -3)
    f = {0, 0, 0};
  else if (y <= -2)
    f = {(3 + y) * (3 + y) * (3 + y) / 6, (3 + y) * (3 + y) / 2, 3 + y};
  else if (y <= -1)
    f = {(((-2 * y - 9) * y - 9) * y + 3) / 6, -(y * y + 3 * y + 1.5), -3 - 2 * y};
  else if (y < 0)
    f = {y * y * y / 6 + 1, y * y / 2, y};
  return chain(x, {f[0], s * f[1], s * s * f[2]});
}

/// s(x) / x of a cubic spline s that ends at x = 1.
template <typename T>
T barrier(const T& at) {
  const double x = value_of(at), r = 1 - x;
  std::array<double, 3> s = {0, 0, 0};
  if (x < 0.5)
    s = {2.0 / 3 - 4 * x * x * r, 4 * x * (3 * x - 2), 8 * (3 * x - 1)};
  else if (x < 1)
    s = {4.0 / 3 * r * r * r, -4 * r * r, 8 * r};
  const double f = s[0] / x, first = (s[1] - f) / x;
  return chain(at, {f, first, (s[2] - 2 * first) / x});
}

/// 0 below 0, 1 from 1 on.
template <typename T>
T fade(const T& at) {
  const double x = value_of(at);
  if (x <= 0) return chain(at, {0, 0, 0});
  if (x >= 1) return chain(at, {1, 0, 0});
  return chain(at, {x * (2 - x), 2 * (1 - x), -2});
}

/// The factor of a vertex, seen from a point outside, `inward` from there: half the length of its edges where it is nearer
/// than the points beside it on both, and where `inward` goes into the body.
template <typename T>
T vertex_factor(const Point<T>& v, const Point<T>& next, const Point<T>& last, const Point<T>& inward,
                const GeometricContactOptions& options) {
  const Point<T> on = next - v, back = last - v;
  const T l_on = length(on), l_back = length(back);
  const T nearest =
      smooth_step<T>(dot(inward, on) / l_on, options.tangent) * smooth_step<T>(dot(inward, back) / l_back, options.tangent);
  const T faces = smooth_step<T>(cross(inward, on) / l_on * -1.0, options.normal) +
                  smooth_step<T>(cross(inward, back) / l_back, options.normal);
  return nearest * smooth_step<T>(faces - T(1.0), options.normal) * (l_on + l_back) * 0.5;
}

template <typename T>
Point<T> reversed(const Point<T>& a) {
  return {a[0] * -1.0, a[1] * -1.0};
}

}  // namespace

GeometricContact::GeometricContact(const CellSet<2>& cells, const GeometricContactOptions& options, double scale)
    : options_(options), factor_(options.stiffness * scale), adjacent_(cells.rest.size(), {kNone, kNone}) {
  std::vector<std::array<int, 2>> sides, boundary;
  for (const auto& element : cells.elements)
    for (int k = 0; k < 3; ++k) sides.push_back({element.vertices[k], element.vertices[(k + 1) % 3]});
  std::sort(sides.begin(), sides.end());
  for (const auto& [a, b] : sides) {
    if (std::binary_search(sides.begin(), sides.end(), std::array{b, a})) continue;
    boundary.push_back({a, b});
    adjacent_[a][0] = b;
    adjacent_[b][1] = a;
  }
  surface_ = make_collision_surface<2>(std::move(boundary), {}, {}, cells.rest, std::vector<char>(cells.rest.size(), 1));
}

std::vector<GeometricContact::Pair> GeometricContact::pairs(ConstVectorView x, Workspace& workspace) const {
  // Its own, since contact has another surface in the workspace.
  struct Own {
    ContactCandidates<2> candidates;
  };
  auto& candidates = workspace.get<Own>().candidates;
  candidates.update(surface_, x, options_.dhat);
  std::vector<Pair> pairs;
  const auto place = [&](int v) { return Vec<2>(x.segment<2>(2 * v)); };
  const auto has_sides = [&](int v) { return adjacent_[v][0] != kNone && adjacent_[v][1] != kNone; };
  for (const auto& [v, e] : candidates.vertex_edges()) {
    if (!has_sides(v)) continue;
    const auto [a, b] = surface_.edges[e];
    const Vec<2> edge = place(b) - place(a), d = place(v) - place(a);
    const double t = d.dot(edge) / edge.squaredNorm();
    if (t > 0 && t < 1 && (d - t * edge).norm() < options_.dhat)
      pairs.push_back({5, {a, b, v, adjacent_[v][0], adjacent_[v][1], kNone}});
    for (const int end : {a, b}) {
      if (!has_sides(end) || !((place(end) - place(v)).norm() < options_.dhat)) continue;
      const int first = std::min(v, end), second = std::max(v, end);
      pairs.push_back(
          {6, {first, adjacent_[first][0], adjacent_[first][1], second, adjacent_[second][0], adjacent_[second][1]}});
    }
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

template <typename T>
T GeometricContact::energy(const Pair& pair, const std::array<std::array<T, 2>, Pair::kMost>& at) const {
  constexpr double kFading = 1e-2;  // of the squared distance
  if (pair.size == 6) {
    const Point<T> d = at[3] - at[0];
    const T distance = length(d);
    const Point<T> inward = {d[0] / distance, d[1] / distance};
    return vertex_factor<T>(at[0], at[1], at[2], reversed(inward), options_) *
           vertex_factor<T>(at[3], at[4], at[5], inward, options_) * barrier<T>(distance * (1 / options_.dhat));
  }
  const Point<T> edge = at[1] - at[0], from = at[2] - at[0];
  const T along = dot(from, edge) / dot(edge, edge);
  const Point<T> d = {from[0] - along * edge[0], from[1] - along * edge[1]};
  const T squared = dot(d, d), distance = root(squared);
  const auto fades_at = [&](const Point<T>& end) {
    const Point<T> away = at[2] - end;
    return fade<T>((dot(away, away) - squared) / (squared * kFading));
  };
  return length(edge) * vertex_factor<T>(at[2], at[3], at[4], {d[0] / distance, d[1] / distance}, options_) *
         barrier<T>(distance * (1 / options_.dhat)) * fades_at(at[0]) * fades_at(at[1]);
}

double GeometricContact::value(ConstVectorView x, Workspace& workspace) const {
  double sum = 0;
  for (const Pair& pair : pairs(x, workspace)) {
    std::array<std::array<double, 2>, Pair::kMost> at{};
    for (int k = 0; k < pair.size; ++k) at[k] = {x[2 * pair.vertices[k]], x[2 * pair.vertices[k] + 1]};
    sum += energy<double>(pair, at);
  }
  return factor_ * sum;
}

namespace {

/// Positions as variables.
template <std::size_t N>
std::array<Point<Series>, N> as_variables(const std::array<int, N>& vertices, int size, ConstVectorView x) {
  std::array<Point<Series>, N> at;
  for (int k = 0; k < size; ++k)
    for (int c = 0; c < 2; ++c) at[k][c] = Series::variable(x[2 * vertices[k] + c], 2 * k + c);
  return at;
}

}  // namespace

void GeometricContact::add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const {
  for (const Pair& pair : pairs(x, workspace)) {
    const Series E = energy<Series>(pair, as_variables(pair.vertices, pair.size, x));
    for (int k = 0; k < pair.size; ++k) gradient.segment<2>(2 * pair.vertices[k]) += factor_ * E.first.segment<2>(2 * k);
  }
}

void GeometricContact::add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const {
  for (const Pair& pair : pairs(x, workspace)) {
    const Series E = energy<Series>(pair, as_variables(pair.vertices, pair.size, x));
    if (E.value == 0) continue;
    // Neighbours of both may be the same.
    std::vector<int> vertices(pair.vertices.begin(), pair.vertices.begin() + pair.size);
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    const auto place = [&](int k) {
      return 2 * (std::lower_bound(vertices.begin(), vertices.end(), pair.vertices[k]) - vertices.begin());
    };
    MatrixX block = MatrixX::Zero(2 * std::ssize(vertices), 2 * std::ssize(vertices));
    for (int j = 0; j < pair.size; ++j)
      for (int i = 0; i < pair.size; ++i)
        block.block<2, 2>(place(i), place(j)) += factor_ * E.second.block<2, 2>(2 * i, 2 * j);
    project_block(block, psd);
    sink.add<2>(vertices, block.data());
  }
}

}  // namespace itr
