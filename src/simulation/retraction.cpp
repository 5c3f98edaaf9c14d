// SPDX-License-Identifier: MIT
#include "simulation/retraction.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/connected_parts.hpp"
#include "energy/contact/retraction.hpp"
#include "energy/rigid_body.hpp"
#include "mesh/cell_of_facet.hpp"
#include "simulation/step_terms.hpp"
#include "simulation/unsupported.hpp"

namespace itr {

namespace {

constexpr double kSmooth = 35 * std::numbers::pi / 180;  ///< largest turn of a smooth surface at a vertex
constexpr double kDepthBySag = 3;
constexpr double kMostOfCell = 0.125;  ///< of the way through a cell
constexpr double kStiffnessByModulus = 10;

/// A vertex of a polyline with its two edges: at rest.
struct Corner {
  std::array<int, 2> neighbour{kNone, kNone};
  std::array<Vec<2>, 2> normal{Vec<2>::Zero(), Vec<2>::Zero()};  ///< outward, of the edges; of obstacles either side
  double longest = 0;                                            ///< edge [m]
  double curvature = 0;                                          ///< where it is smooth [1/m]
  bool is_smooth = false;

  void add(int other, const Vec<2>& outward, double length) {
    if (neighbour[1] != kNone) return;
    const bool is_second = neighbour[0] != kNone;
    neighbour[is_second] = other;
    normal[is_second] = outward;
    longest = std::max(longest, length);
  }
  void finish(double lengths) {
    if (neighbour[1] == kNone) return;
    const double turn = std::acos(std::clamp(normal[0].dot(normal[1]), -1.0, 1.0));
    is_smooth = turn < kSmooth;
    if (is_smooth) curvature = 2 * turn / lengths;
  }
};

/// The largest value of each of several parts, as others see it.
class LargestByPart {
 public:
  void include(int part, double value) {
    if (part == part_) {
      largest_ = std::max(largest_, value);
    } else if (value > largest_) {
      second_ = std::exchange(largest_, value);
      part_ = part;
    } else {
      second_ = std::max(second_, value);
    }
  }
  double of_others(int part) const { return part == part_ ? second_ : largest_; }

 private:
  double largest_ = 0, second_ = 0;  ///< of one part, and of all others
  int part_ = kNone;
};

/// The polylines of the bodies' boundary and of the obstacles, by vertex: those of the mesh come first.
class Polylines {
 public:
  explicit Polylines(const Setup<2>& setup) : mesh_(setup.mesh), rest_(setup.mesh.rest()) {
    const int vertices = mesh_.num_vertices();
    rest_.insert(rest_.end(), setup.obstacles.rest.begin(), setup.obstacles.rest.end());
    corners_.resize(rest_.size());
    std::vector<double> lengths(rest_.size(), 0);
    const auto add = [&](int a, int b, const Vec<2>& outward) {
      const double length = (rest_[a] - rest_[b]).norm();
      corners_[a].add(b, outward, length);
      corners_[b].add(a, outward, length);
      lengths[a] += length;
      lengths[b] += length;
      edges_.push_back({a, b});
    };
    for (FacetId f = 0; f < mesh_.facet_slots(); ++f) {
      const auto [a, b] = mesh_.facet(f);
      add(a, b, outward_of(f));
    }
    num_facets_ = edges_.size();
    for (const auto& [a, b] : setup.obstacles.edges) {
      const Vec<2> along = (setup.obstacles.rest[b] - setup.obstacles.rest[a]).normalized();
      add(vertices + a, vertices + b, {along[1], -along[0]});
    }
    for (std::size_t v = 0; v < corners_.size(); ++v) corners_[v].finish(lengths[v]);
    part_ = connected_parts<2>(rest_.size(), std::span<const std::array<int, 2>>(edges_));
    curvature_ = largest_by_part([&](int v) { return corners_[v].curvature; });
  }

  double largest_of_others(int v, const LargestByPart& by_part) const { return by_part.of_others(part_[v]); }
  /// The largest value f(v) >= 0 of each part's vertices.
  template <typename F>
  LargestByPart largest_by_part(const F& f) const {
    LargestByPart largest;
    for (std::size_t v = 0; v < part_.size(); ++v) largest.include(part_[v], f(static_cast<int>(v)));
    return largest;
  }
  /// How far the edges at v may be from the smooth surfaces that they and others stand for [m].
  double sag(int v) const {
    const Corner& corner = corners_[v];
    if (corner.neighbour[0] == kNone) return 0;
    double curvature = std::max(corner.curvature, is_of_body(v) ? largest_of_others(v, curvature_) : 0);
    for (const int u : corner.neighbour)
      if (u != kNone) curvature = std::max(curvature, corners_[u].curvature);
    return std::min(curvature * corner.longest, kSmooth) * corner.longest / 8;
  }
  bool is_of_body(int v) const { return v < mesh_.num_vertices(); }
  const std::vector<Corner>& corners() const { return corners_; }
  const std::vector<Vec<2>>& rest() const { return rest_; }
  /// The boundary facets, and not the obstacles' edges.
  std::span<const std::array<int, 2>> facets() const { return std::span(edges_).first(num_facets_); }

 private:
  Vec<2> outward_of(FacetId f) const {
    const auto [a, b] = mesh_.facet(f);
    const Vec<2> along = (rest_[b] - rest_[a]).normalized(), normal(along[1], -along[0]);
    return normal.dot(mesh_.barycenter(cell_of_facet(mesh_, f)) - rest_[a]) < 0 ? normal : Vec<2>(-normal);
  }

  const Mesh<2>& mesh_;
  std::vector<Vec<2>> rest_;
  std::vector<Corner> corners_;
  std::vector<std::array<int, 2>> edges_;
  std::size_t num_facets_ = 0;
  std::vector<int> part_;
  LargestByPart curvature_;
};

/// The point `depth` behind a vertex of the boundary, or as far as kMostOfCell allows: weights of the vertices of its cell.
struct Behind {
  double depth = 0;
  std::array<int, 3> vertices{kNone, kNone, kNone};
  Vec<3> weights = Vec<3>::Zero();
};
Behind find_behind(const Mesh<2>& mesh, int v, const Corner& corner, double depth) {
  constexpr double kRounding = 1e-9;
  const Vec<2> sum = corner.normal[0] + corner.normal[1];
  // So that both edges lie at this depth; at most twice as far.
  const Vec<2> inward = -sum / std::max(1 + corner.normal[0].dot(corner.normal[1]), 0.5 * sum.norm());
  Behind behind{.vertices = {v, kNone, kNone}, .weights = {1, 0, 0}};
  for (const CellId c : mesh.cells_of(v)) {
    Mat<3> positions;
    for (int k = 0; k < 3; ++k) positions.col(k) << mesh.rest(mesh.cell(c)[k]), 1;
    Vec<3> along;  // rate of the barycentric coordinates
    along << inward, 0;
    along = positions.inverse() * along;
    bool is_inside = true;
    double rate = 0;  // at which it leaves the vertex
    for (int k = 0; k < 3; ++k) {
      if (mesh.cell(c)[k] == v)
        rate = -along[k];
      else
        is_inside = is_inside && along[k] >= -kRounding * along.norm();
    }
    if (!is_inside || !(rate > 0)) continue;
    behind.depth = std::min(depth, kMostOfCell / rate);
    for (int k = 0; k < 3; ++k) {
      behind.vertices[k] = mesh.cell(c)[k];
      behind.weights[k] = (mesh.cell(c)[k] == v ? 1 : 0) + behind.depth * along[k];
    }
    return behind;
  }
  return behind;  // as where cells of several bodies meet
}

double least_modulus(const Setup<2>& setup) {
  double least = std::numeric_limits<double>::infinity();
  for (const auto& [body, material] : setup.materials)
    if (!rigid_body_of(material)) least = std::min(least, material.youngs_modulus);
  return least;
}

/// The proxy and its retraction; its vertices are those of the boundary, in their order.
void add_proxy(Setup<2>& setup, const Polylines& lines, const std::vector<double>& sag) {
  const Mesh<2>& mesh = setup.mesh;
  const int vertices = mesh.num_vertices();
  std::vector<int> own(vertices, kNone);
  CollisionProxy<2> proxy;
  Retraction retraction;
  std::vector<Eigen::Triplet<double>> entries;
  for (int v = 0; v < vertices; ++v) {
    if (lines.corners()[v].neighbour[0] == kNone) continue;
    own[v] = static_cast<int>(proxy.rest.size());
    const Behind behind = find_behind(mesh, v, lines.corners()[v], kDepthBySag * sag[v]);
    Vec<2> at = Vec<2>::Zero();
    for (int k = 0; k < 3; ++k) {
      if (behind.weights[k] == 0) continue;
      entries.emplace_back(own[v], behind.vertices[k], behind.weights[k]);
      at += behind.weights[k] * mesh.rest(behind.vertices[k]);
    }
    proxy.rest.push_back(at);
    retraction.depth.push_back(behind.depth);
    retraction.is_corner.push_back(!lines.corners()[v].is_smooth);
  }
  const int size = static_cast<int>(proxy.rest.size());
  retraction.rest = proxy.rest;
  for (const auto& [a, b] : lines.facets()) proxy.edges.push_back({own[a], own[b]});
  proxy.weights.resize(size, vertices);
  proxy.weights.setFromTriplets(entries.begin(), entries.end());
  for (std::size_t o = 0; o < setup.obstacles.rest.size(); ++o) {
    retraction.depth.push_back(0);
    retraction.is_corner.push_back(!lines.corners()[vertices + o].is_smooth);
    retraction.rest.push_back(setup.obstacles.rest[o]);
  }
  retraction.width.assign(retraction.depth.size(), 0);
  const LargestByPart deepest =
      lines.largest_by_part([&](int v) { return v < vertices && own[v] != kNone ? retraction.depth[own[v]] : 0.0; });
  for (int v = 0; v < vertices; ++v)
    if (own[v] != kNone && retraction.depth[own[v]] > 0)
      retraction.width[own[v]] = retraction.depth[own[v]] + lines.largest_of_others(v, deepest);
  retraction.stiffness = kStiffnessByModulus * least_modulus(setup);
  proxy.retraction = std::make_shared<const Retraction>(std::move(retraction));
  setup.proxy = std::move(proxy);
}

std::string retract(Setup<2>& setup) {
  if (setup.proxy) return {};
  const Polylines lines(setup);
  std::vector<double> sag(lines.rest().size());
  double largest = 0, of_others = 0;  // of two parts
  for (int v = 0; v < static_cast<int>(sag.size()); ++v) {
    sag[v] = lines.sag(v);
    largest = std::max(largest, sag[v]);
  }
  const LargestByPart by_part = lines.largest_by_part([&](int v) { return sag[v]; });
  for (int v = 0; v < static_cast<int>(sag.size()); ++v)
    of_others = std::max(of_others, sag[v] + lines.largest_of_others(v, by_part));
  const Units& units = setup.units;
  if (!(of_others > setup.contact.dhat))
    return fmt::format("gaps are not averaged: edges are nearer to smooth surfaces, by {}, than d-hat",
                       units.text(of_others, "m", 3));
  add_proxy(setup, lines, sag);
  const auto& depth = setup.proxy->retraction->depth;
  const double deepest = depth.empty() ? 0 : *std::max_element(depth.begin(), depth.end());
  return fmt::format(
      "gaps are averaged where edges are up to {} from smooth surfaces: what is certified lies up to {} behind the boundary",
      units.text(largest, "m", 3), units.text(deepest, "m", 3));
}

}  // namespace

template <int Dim>
bool averaging_helps(const Setup<Dim>& setup) {
  if (!can_average_gaps(setup) || !setup.contact.has_friction() || setup.time.has_inertia() || setup.fields.error_bars)
    return false;
  const std::vector<char> held = held_dofs(setup, setup.mesh, setup.time.t0).held;
  std::vector<std::array<int, Dim + 1>> cells;
  for (const CellId c : setup.mesh.live_cells()) cells.push_back(setup.mesh.cell(c));
  const std::vector<int> part =
      connected_parts<Dim + 1>(setup.mesh.node_slots(), std::span<const std::array<int, Dim + 1>>(cells));
  std::set<int> parts, held_parts;
  for (const auto& cell : cells)
    for (const VertexId v : cell) {
      parts.insert(part[v]);
      if (std::any_of(&held[Dim * v], &held[Dim * v] + Dim, [](char is_held) { return is_held != 0; }))
        held_parts.insert(part[v]);
    }
  return parts == held_parts;
}

template <int Dim>
std::string retract_surfaces(Setup<Dim>& setup) {
  if constexpr (Dim == 2) return retract(setup);
  return {};
}

#define ITR_INSTANTIATE(Dim)                        \
  template bool averaging_helps(const Setup<Dim>&); \
  template std::string retract_surfaces(Setup<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
