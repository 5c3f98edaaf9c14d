// SPDX-License-Identifier: MIT
// Contact by averaged gaps: derivatives, what its forces add up to, and that coarse surfaces slide without teeth.
#include "energy/contact/averaged_contact.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include "core/noise.hpp"
#include "derivatives.hpp"
#include "energy/contact/contact.hpp"
#include "energy/support.hpp"
#include "geometry/distance.hpp"
#include "rings.hpp"
#include "simulation/contact_pressure.hpp"

namespace itr {
namespace {

/// Polylines, each closed or open, whose surface has a retraction.
struct Lines {
  std::vector<Vec<2>> rest;
  std::vector<std::array<int, 2>> edges;
  std::vector<char> is_corner;
  std::vector<Vec<2>> outward;

  /// `inside`: a point of the body, or far away on its side.
  void add(const std::vector<Vec<2>>& points, bool is_closed, const Vec<2>& inside, double sign = 1) {
    const int first = static_cast<int>(rest.size()), count = static_cast<int>(points.size());
    for (int i = 0; i < count; ++i) {
      rest.push_back(points[i]);
      outward.emplace_back(sign * (points[i] - inside));
      is_corner.push_back(!is_closed && (i == 0 || i + 1 == count));
      if (i + 1 < count || is_closed) edges.push_back({first + i, first + (i + 1) % count});
    }
  }
  /// `uneven`: by which part of `depth` depths differ.
  CollisionSurface surface(double depth, double width, double uneven = 0) const {
    CollisionSurface result = make_collision_surface<2>(edges, {}, {}, rest, std::vector<char>(rest.size(), 1));
    Retraction retraction;
    for (std::size_t i = 0; i < rest.size(); ++i)
      retraction.depth.push_back(depth * (1 + uneven * std::sin(3.0 * static_cast<double>(i))));
    retraction.width.assign(rest.size(), width);
    retraction.is_corner = is_corner;
    retraction.rest = rest;
    retraction.outward = outward;
    retraction.stiffness.assign(rest.size(), 3);
    result.retraction = std::make_shared<Retraction>(retraction);
    return result;
  }
  VectorX positions() const {
    VectorX x(2 * std::ssize(rest));
    for (std::size_t i = 0; i < rest.size(); ++i) x.segment<2>(2 * static_cast<Eigen::Index>(i)) = rest[i];
    return x;
  }
};

std::vector<Vec<2>> circle(const Vec<2>& center, double radius, int count, double turn = 0) {
  std::vector<Vec<2>> points;
  for (int i = 0; i < count; ++i) {
    const double angle = turn + 2 * std::numbers::pi * i / count;
    points.emplace_back(center[0] + radius * std::cos(angle), center[1] + radius * std::sin(angle));
  }
  return points;
}
std::vector<Vec<2>> line(double from, double to, double y, int count) {
  std::vector<Vec<2>> points;
  for (int i = 0; i < count; ++i) points.emplace_back(from + (to - from) * i / (count - 1), y);
  return points;
}

Lines disc_on_line(double height = 1.02) {
  Lines lines;
  lines.add(circle({0.1, height}, 1, 16), true, {0.1, height});
  lines.add(line(-1.5, 1.5, 0, 12), false, {0, -10});
  return lines;
}

TEST(AveragedContact, HasTheDerivativesOfItsEnergy) {
  const Lines lines = disc_on_line();
  for (const double uneven : {0.0, 0.3}) {
    const CollisionSurface surface = lines.surface(0.02 * (1 + uneven), 0.06, uneven);
    for (std::uint64_t seed = 1; seed < 6; ++seed) {
      VectorX x = lines.positions();
      for (Eigen::Index i = 0; i < x.size(); ++i) x[i] += 0.004 * noise(1000 * seed + static_cast<std::uint64_t>(i));
      const AveragedContact contact(surface, 0.7);
      Workspace workspace;
      ASSERT_GT(contact.value(x, workspace), 0);
      expect_derivatives(contact, x, 1e-7, 2e-5);
      expect_psd(contact, x);
    }
  }
}

/// Splines may cross a little where polygons do not: distances are negative there, and contact still pushes apart.
TEST(AveragedContact, PushesApartWhereCurvesCross) {
  for (const double height : {0.997, 0.99, 0.98}) {
    const Lines lines = disc_on_line(height);
    const CollisionSurface surface = lines.surface(0.02, 0.2, 0.3);
    const AveragedContact contact(surface, 1);
    const VectorX x = lines.positions();
    expect_derivatives(contact, x, 1e-7, 2e-5);
    const VectorX gradient = gradient_of(contact, x);
    double upward = 0;
    for (Eigen::Index i = 0; i < 16; ++i) upward -= gradient[2 * i + 1];
    EXPECT_GT(upward, 0);
  }
}

TEST(AveragedContact, FindsGapsAnewWherePositionsChange) {
  const Lines lines = disc_on_line();
  const CollisionSurface surface = lines.surface(0.02, 0.06);
  const AveragedContact contact(surface, 1);
  const VectorX x = lines.positions(), moved = 1.001 * x;
  Workspace used, fresh;
  const double at_x = contact.value(x, used);
  EXPECT_EQ(contact.value(moved, used), contact.value(moved, fresh));
  EXPECT_EQ(contact.value(x, used), at_x);
  EXPECT_NE(contact.value(moved, used), at_x);
}

TEST(AveragedContact, ForcesAndMomentsAddUpToNothing) {
  const Lines lines = disc_on_line();
  const CollisionSurface surface = lines.surface(0.02, 0.06);
  const VectorX x = lines.positions();
  const VectorX gradient = gradient_of(AveragedContact(surface, 1), x);
  Vec<2> force = Vec<2>::Zero();
  double moment = 0;
  for (Eigen::Index i = 0; i < std::ssize(lines.rest); ++i) {
    force += gradient.segment<2>(2 * i);
    moment += x[2 * i] * gradient[2 * i + 1] - x[2 * i + 1] * gradient[2 * i];
  }
  ASSERT_GT(gradient.norm(), 1e-3);
  EXPECT_LE(force.norm(), 1e-14 * gradient.lpNorm<1>());
  EXPECT_LE(std::abs(moment), 1e-13 * gradient.lpNorm<1>());
}

/// The energy of a ring in a bore that is too narrow for it hardly depends on how the ring is turned: it has no teeth. With
/// pairs of vertices and edges it changes many times over.
TEST(AveragedContact, OfARingInABoreDoesNotDependOnItsTurn) {
  const auto energies = [](bool is_averaged) {
    double least = std::numeric_limits<double>::infinity(), largest = 0;
    for (int step = 0; step < 10; ++step) {
      Lines lines;
      const double depth = 0.02, overlap = is_averaged ? 0.01 : 0.02;
      lines.add(circle({0, 0}, 1 - depth + overlap, 24, 0.026 * step), true, {0, 0});
      lines.add(circle({0, 0}, 1 + depth, 24), true, {0, 0}, -1);
      const CollisionSurface surface = lines.surface(depth, 2 * depth);
      const ContactOptions options{.enabled = true, .dhat = 0.03, .convergent = true};
      Workspace workspace;
      const double energy = is_averaged ? AveragedContact(surface, 1).value(lines.positions(), workspace)
                                        : ContactEnergy<2>(surface, options, 1, 1).value(lines.positions(), workspace);
      least = std::min(least, energy);
      largest = std::max(largest, energy);
    }
    return largest / least - 1;
  };
  EXPECT_LE(energies(true), 2e-3);
  EXPECT_GE(energies(false), 0.05);
}

/// Quarters of two rings with a gap between them, of which friction is asked.
Setup<2> two_rings() {
  Setup<2> setup = quarter_rings({{0.4, 0.6, 6, 2}, {0.64, 0.8, 7, 2}});
  for (const int body : {1, 2}) setup.materials[body] = {.youngs_modulus = 1e6 * body, .poisson_ratio = 0.3, .density = 1};
  setup.time = {.dt = 1, .steps = 1};
  setup.time.quasistatic = true;
  setup.contact = {.enabled = true, .dhat = 1e-4, .may_average_gaps = true, .convergent = true, .friction_coefficient = 0.2};
  return setup;
}

TEST(AveragedContact, IsChosenWhereBodiesSlideThatConditionsHold) {
  const auto is_chosen = [](itr::Setup<2> setup) {
    setup.choose_defaults();
    EXPECT_EQ(setup.contact.average_gaps, setup.proxy.has_value());
    return setup.contact.average_gaps;
  };
  EXPECT_TRUE(is_chosen(two_rings()));
  itr::Setup<2> other = two_rings();
  other.fields.error_bars = true;
  EXPECT_TRUE(is_chosen(other)) << "who asks for bars asks for no other result";
  other = two_rings();
  other.dirichlet.clear();
  EXPECT_FALSE(is_chosen(other));
  for (const int tag : {1, 2})  // all facets of a body, or of the other
    other.nodal_loads.push_back(CouplingEntry<2>{std::make_shared<Coupling>(
        Coupling{.surfaces = {tag}, .held_position = {true, true, false}, .held_rotation = {false, false, true}})});
  for (const FacetId f : other.mesh.live_facets())
    other.mesh.set_facet_tag(f, other.mesh.part_of_vertex(other.mesh.facet(f)[0]) == other.mesh.part_of_vertex(0) ? 1 : 2);
  EXPECT_TRUE(is_chosen(other));
  other = two_rings();
  other.contact.friction_coefficient = 0;
  EXPECT_FALSE(is_chosen(other));
  other = two_rings();
  other.time.quasistatic = false;
  EXPECT_FALSE(is_chosen(other));
  other = two_rings();
  other.remesh.enabled = true;
  EXPECT_FALSE(is_chosen(other));
  other = two_rings();
  other.fluids = {{.place = "the fluid", .wet = {{1, 7}}}};
  EXPECT_FALSE(is_chosen(other)) << "part of the forces is inside of bodies, where no facet has a pressure of it";
}

TEST(AveragedContact, ActsOfASurfaceInsideOfTheBodies) {
  itr::Setup<2> setup = two_rings();
  setup.choose_defaults();
  ASSERT_TRUE(setup.proxy);
  const CollisionProxy<2>& proxy = *setup.proxy;
  const auto& depth = proxy.retraction->depth;
  for (int row = 0; row < proxy.weights.rows(); ++row) {
    double sum = 0;
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(proxy.weights, row); it; ++it) {
      EXPECT_GT(it.value(), -1e-15);  // inside of a cell
      sum += it.value();
    }
    EXPECT_NEAR(sum, 1, 1e-14);
    double nearest = std::numeric_limits<double>::infinity();
    for (const FacetId f : setup.mesh.live_facets()) {
      const auto& [a, b] = setup.mesh.facet(f);
      nearest = std::min(nearest, point_edge_distance_squared<2>(proxy.rest[row], setup.mesh.rest(a), setup.mesh.rest(b)));
    }
    EXPECT_GE(std::sqrt(nearest), depth[row] - 1e-14);
    EXPECT_LE(std::sqrt(nearest), 1.05 * depth[row]);  // farther from a corner that is concave
  }
  EXPECT_GT(*std::max_element(depth.begin(), depth.end()), 0.002);
}

/// Forces of the surface, brought back from the nodes that carry them: the even part of them exactly.
TEST(AveragedContact, GivesItsForcesToTheBoundary) {
  itr::Setup<2> setup = two_rings();
  setup.choose_defaults();
  ASSERT_TRUE(setup.proxy);
  const CollisionProxy<2>& proxy = *setup.proxy;
  VectorX force = VectorX::Zero(2 * setup.mesh.num_nodes());
  const Vec<2> of_each(3, -2);
  for (int row = 0; row < proxy.weights.rows(); ++row)
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(proxy.weights, row); it; ++it)
      vertex_of<2>(force, static_cast<int>(it.col())) += it.value() * of_each;
  const VectorX found = force_on_boundary(proxy, setup.mesh, force);
  Vec<2> sum = Vec<2>::Zero();
  double inside = 0;
  for (VertexId v = 0; v < setup.mesh.num_vertices(); ++v) {
    const Vec<2> at = vertex_of<2>(found, v);
    sum += at;
    if (!setup.mesh.is_boundary(v)) {
      EXPECT_EQ(at.norm(), 0);
      inside += vertex_of<2>(force, v).norm();
    }
  }
  EXPECT_GT(inside, 1);
  EXPECT_LE((sum - static_cast<double>(proxy.weights.rows()) * of_each).norm(), 1e-12 * sum.norm());
}

}  // namespace
}  // namespace itr
