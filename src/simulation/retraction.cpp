// SPDX-License-Identifier: MIT
#include "simulation/retraction.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "energy/contact/averaged_contact.hpp"
#include "energy/contact/retraction.hpp"
#include "energy/support.hpp"
#include "mesh/cell_of_facet.hpp"
#include "simulation/closed_faces.hpp"
#include "simulation/contact_surface.hpp"
#include "simulation/step_terms.hpp"
#include "simulation/unsupported.hpp"

namespace itr {

namespace {

constexpr double kSmooth = 35 * std::numbers::pi / 180;  ///< largest turn of a smooth surface at a vertex
constexpr double kDepthBySag = 3, kLeastDepthBySag = 1.5;
constexpr double kMostOfCell = 0.125;  ///< of the way through a cell
constexpr double kStiffnessByModulus = 10;

/// A vertex of a polyline with its two edges: at rest.
struct Corner {
  std::array<int, 2> neighbour{kNone, kNone};
  std::array<Vec<2>, 2> normal{Vec<2>::Zero(), Vec<2>::Zero()};  ///< outward, of the edges
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

/// The polylines of the bodies' boundary, by vertex of the mesh. Parts are those of the mesh.
class Polylines {
 public:
  explicit Polylines(const Mesh<2>& mesh) : mesh_(mesh), corners_(mesh.num_vertices()) {
    std::vector<double> lengths(corners_.size(), 0);
    for (const FacetId f : mesh.live_facets()) {
      const auto& [a, b] = mesh.facet(f);
      const Vec<2> outward = outward_of(f);
      const double length = (mesh.rest(a) - mesh.rest(b)).norm();
      corners_[a].add(b, outward, length);
      corners_[b].add(a, outward, length);
      lengths[a] += length;
      lengths[b] += length;
      facets_.push_back({a, b});
    }
    for (std::size_t v = 0; v < corners_.size(); ++v) corners_[v].finish(lengths[v]);
    for (int v = 0; v < mesh.num_vertices(); ++v) curvature_.include(mesh.part_of_vertex(v), corners_[v].curvature);
  }

  /// How far the edges at v may be from the smooth surfaces that they and others stand for [m]. Surfaces that bend by more
  /// over one of these edges touch less than an edge: they do not count.
  double sag(int v) const { return sag(v, curvature_.of_others(mesh_.part_of_vertex(v))); }
  /// The part of it that is by the curvature at v itself [m].
  double own_sag(int v) const { return sag(v, 0); }
  const std::vector<Corner>& corners() const { return corners_; }
  const std::vector<std::array<int, 2>>& facets() const { return facets_; }
  bool is_on(int v) const { return corners_[v].neighbour[0] != kNone; }

 private:
  double sag(int v, double curvature_of_others) const {
    const Corner& corner = corners_[v];
    double curvature = 0;
    const auto include = [&](double other) {
      if (other * corner.longest < kSmooth) curvature = std::max(curvature, other);
    };
    include(corner.curvature);
    include(curvature_of_others);
    for (const int u : corner.neighbour)
      if (u != kNone) include(corners_[u].curvature);
    return curvature * corner.longest * corner.longest / 8;
  }
  Vec<2> outward_of(FacetId f) const {
    const auto& [a, b] = mesh_.facet(f);
    const Vec<2> along = (mesh_.rest(b) - mesh_.rest(a)).normalized(), normal(along[1], -along[0]);
    return normal.dot(mesh_.barycenter(cell_of_facet(mesh_, f)) - mesh_.rest(a)) < 0 ? normal : Vec<2>(-normal);
  }

  const Mesh<2>& mesh_;
  std::vector<Corner> corners_;
  std::vector<std::array<int, 2>> facets_;
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

/// The proxy and its retraction; its vertices are those of the boundary, in their order.
CollisionProxy<2> retracted(const Setup<2>& setup, const Polylines& lines, const std::vector<double>& sag) {
  const Mesh<2>& mesh = setup.mesh;
  std::vector<int> own(mesh.num_vertices(), kNone);
  CollisionProxy<2> proxy;
  Retraction retraction;
  std::vector<Eigen::Triplet<double>> entries;
  for (int v = 0; v < mesh.num_vertices(); ++v) {
    if (!lines.is_on(v)) continue;
    const Corner& corner = lines.corners()[v];
    own[v] = static_cast<int>(proxy.rest.size());
    const Behind behind = find_behind(mesh, v, corner, kDepthBySag * sag[v]);
    Vec<2> at = Vec<2>::Zero();
    for (int k = 0; k < 3; ++k) {
      if (behind.weights[k] == 0) continue;
      entries.emplace_back(own[v], behind.vertices[k], behind.weights[k]);
      at += behind.weights[k] * mesh.rest(behind.vertices[k]);
    }
    proxy.rest.push_back(at);
    retraction.depth.push_back(behind.depth);
    retraction.is_corner.push_back(!corner.is_smooth);
    retraction.outward.push_back(corner.normal[0] + corner.normal[1]);
    const int body = mesh.body(mesh.cells_of(v).front());
    retraction.stiffness.push_back(kStiffnessByModulus * setup.materials.at(body).youngs_modulus);
  }
  const double deepest = *std::max_element(retraction.depth.begin(), retraction.depth.end());
  for (const double depth : retraction.depth) retraction.width.push_back(depth > 0 ? depth + deepest : 0);
  retraction.rest = proxy.rest;
  for (const auto& [a, b] : lines.facets()) proxy.edges.push_back({own[a], own[b]});
  proxy.weights.resize(std::ssize(proxy.rest), mesh.num_vertices());
  proxy.weights.setFromTriplets(entries.begin(), entries.end());
  proxy.retraction = std::make_shared<const Retraction>(std::move(retraction));
  return proxy;
}

bool has_faces_that_coincide(const Setup<2>& setup) {
  Mesh<2> mesh = setup.mesh;
  close_coincident_faces(setup, mesh);
  return has_closed_faces(mesh);
}

/// Whether averaged gaps of bodies at rest push.
bool overlaps_at_rest(const Setup<2>& setup) {
  const CollisionSurface surface = contact_surface(setup, setup.mesh).surface;
  VectorX x(2 * std::ssize(setup.proxy->rest));
  for (int v = 0; v < std::ssize(setup.proxy->rest); ++v) vertex_of<2>(x, v) = setup.proxy->rest[v];
  Workspace workspace;
  return AveragedContact(surface, 1).value(x, workspace) > 0;
}

/// Why gaps cannot be averaged, or nothing.
std::string retract(Setup<2>& setup) {
  if (has_faces_that_coincide(setup)) return "faces coincide at rest";
  const Polylines lines(setup.mesh);
  std::vector<double> sag;
  for (int v = 0; v < setup.mesh.num_vertices(); ++v) sag.push_back(lines.is_on(v) ? lines.sag(v) : 0);
  const double largest = *std::max_element(sag.begin(), sag.end());
  const Units& units = setup.units;
  if (!(2 * largest > setup.contact.dhat))
    return fmt::format("edges are nearer to smooth surfaces, by {}, than d-hat", units.text(largest, "m", 3));
  setup.proxy = retracted(setup, lines, sag);
  const auto& depth = setup.proxy->retraction->depth;
  const std::vector<char> held = held_dofs(setup, setup.mesh, setup.time.t0).held;
  bool is_cut = false;  // where surfaces slide
  for (int v = 0, own = 0; v < setup.mesh.num_vertices(); ++v)
    if (lines.is_on(v) && depth[own++] < kLeastDepthBySag * lines.own_sag(v))
      is_cut = is_cut || (lines.corners()[v].is_smooth && !(held[2 * v] && held[2 * v + 1]));
  if (!is_cut && !overlaps_at_rest(setup)) return {};
  setup.proxy.reset();
  return is_cut ? "cells at the surface are too flat for edges that stand for so much curvature" : "bodies overlap at rest";
}

}  // namespace

template <int Dim>
bool averaging_helps(const Setup<Dim>& setup) {
  if (!can_average_gaps(setup) || !setup.contact.has_friction() || setup.time.has_inertia()) return false;
  const std::vector<char> held = held_dofs(setup, setup.mesh, setup.time.t0).held;
  std::set<int> parts, held_parts;
  for (const VertexId v : setup.mesh.live_vertices()) {
    const int part = setup.mesh.part_of_vertex(v);
    parts.insert(part);
    if (std::any_of(&held[Dim * v], &held[Dim * v] + Dim, [](char is_held) { return is_held != 0; }))
      held_parts.insert(part);
  }
  for (const auto& coupling : couplings_of<Dim>(setup.nodal_loads)) {
    if (!coupling->is_held()) continue;
    for (const FacetId f : setup.mesh.live_facets())
      if (std::ranges::find(coupling->surfaces, setup.mesh.facet_tag(f)) != coupling->surfaces.end())
        held_parts.insert(setup.mesh.part_of_vertex(setup.mesh.facet(f)[0]));
  }
  return parts == held_parts;
}

template <int Dim>
std::string retract_surfaces(Setup<Dim>& setup) {
  if (setup.proxy) return {};
  if constexpr (Dim == 2) {
    if (const std::string reason = retract(setup); !reason.empty()) {
      setup.contact.average_gaps = false;
      return "gaps are not averaged: " + reason;
    }
    const auto& depth = setup.proxy->retraction->depth;
    return fmt::format("gaps are averaged: what is certified lies up to {} behind the boundary",
                       setup.units.text(*std::max_element(depth.begin(), depth.end()), "m", 3));
  }
  return {};
}

#define ITR_INSTANTIATE(Dim)                        \
  template bool averaging_helps(const Setup<Dim>&); \
  template std::string retract_surfaces(Setup<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
