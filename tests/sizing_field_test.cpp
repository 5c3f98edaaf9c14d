// SPDX-License-Identifier: MIT
// The sizing-field baseline: sizes of edges are where they shall be, and the state stays valid.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

#include "fem/inverted.hpp"
#include "random_cube.hpp"
#include "remesh/remesher.hpp"
#include "remesh_options.hpp"
#include "square_mesh.hpp"

namespace itr {
namespace {

template <int Dim>
Mesh<Dim> make_mesh();
template <>
Mesh<2> make_mesh<2>() {
  const Grid grid = make_regular_grid(4, 1, [](int i, int j) { return (i + j) % 2 == 0; });
  return Mesh<2>(grid.rest, grid.cells, std::vector<int>(grid.cells.size(), 1));
}
template <>
Mesh<3> make_mesh<3>() {
  std::mt19937 random(3);
  return make_cube(3, random, 0.1);
}

/// A body that was moved by a linear map, remeshed by the sizing field.
template <int Dim>
struct SizedBody {
  Mesh<Dim> mesh = make_mesh<Dim>();
  RemeshFields<Dim> fields;
  StepContext<Dim> context;
  RemeshOptions options = remesh_options();
  RemeshReport report;

  explicit SizedBody(const Mat<Dim>& motion) {
    context.materials[1] = {.youngs_modulus = 1000, .poisson_ratio = 0.3, .density = 2};
    context.shortest_edge = std::numeric_limits<double>::infinity();
    for (const auto& [a, b] : mesh.edges()) {
      const double length = (mesh.rest(a) - mesh.rest(b)).norm();
      context.shortest_edge = std::min(context.shortest_edge, length);
      context.longest_edge = std::max(context.longest_edge, length);
    }
    fields.x.resize(Dim * mesh.node_slots());
    for (int v = 0; v < mesh.node_slots(); ++v) fields.x.template segment<Dim>(Dim * v) = motion * mesh.rest(v);
    fields.past_positions = {fields.x};
    fields.predictor = fields.velocity_reference = fields.x;
    options.enabled = options.sizing_field.enabled = true;
    options.collapse.rel_max_edge_length = 100;
  }

  void remesh_it() {
    RemeshMemory memory;
    Strata<Dim> strata;
    const double volume = mesh.total_volume();
    report = remesh(mesh, fields, context, options, memory, strata);
    EXPECT_EQ(mesh.find_defect(), "");
    EXPECT_EQ(find_inverted<Dim>(mesh, fields.x), kNone);
    EXPECT_NEAR(mesh.total_volume(), volume, 1e-12);
  }

  double length(const EdgeKey& e) const {
    return (fields.x.template segment<Dim>(Dim * e[0]) - fields.x.template segment<Dim>(Dim * e[1])).norm();
  }
  double longest() const {
    double longest = 0;
    for (const EdgeKey& e : mesh.edges()) longest = std::max(longest, length(e));
    return longest;
  }
};

template <int Dim>
void turn_and_stretch() {
  Mat<Dim> turn = Mat<Dim>::Identity();
  turn.template topLeftCorner<2, 2>() = Eigen::Rotation2Dd(0.7).toRotationMatrix();
  SizedBody<Dim> turned(turn);
  turned.options.collapse.enabled = false;
  turned.remesh_it();
  EXPECT_EQ(turned.report.splits.tried, 0);

  Mat<Dim> stretch = turn;
  stretch.col(0) *= 3;
  SizedBody<Dim> stretched(stretch);
  const double before = stretched.longest();
  stretched.remesh_it();
  EXPECT_GT(before, 1.5 * stretched.context.longest_edge);
  EXPECT_GT(stretched.report.splits.accepted, 10);
  EXPECT_LE(stretched.longest(), (1 + 1e-6) * stretched.context.longest_edge);
}

TEST(SizingField, SplitsWhatIsStretchedAndNothingThatIsOnlyTurned) {
  turn_and_stretch<2>();
  turn_and_stretch<3>();
}

template <int Dim>
void squeeze() {
  SizedBody<Dim> body(0.3 * Mat<Dim>::Identity());
  body.remesh_it();
  EXPECT_GT(body.report.collapses.accepted, 3);
  EXPECT_EQ(body.report.splits.accepted, 0);
  EXPECT_LE(body.longest(), 0.8 * body.context.longest_edge);
}

TEST(SizingField, CollapsesWhatIsSmallAndNeverAboveTheLimit) {
  squeeze<2>();
  squeeze<3>();
}

/// A point of an obstacle at 0.02 below the bottom, in the middle of an edge of it (2D) or of the lower side (3D).
void put_spike_below(SizedBody<2>& body) {
  auto& obstacles = body.context.obstacles;
  obstacles.x = obstacles.velocity_reference = {{0.4, -0.02}, {0.4, -1}};
  obstacles.rest = {{0.4, -2}, {0.4, -3}};
  obstacles.edges = {{0, 1}};
  obstacles.past_x = {obstacles.x};
}
void put_spike_below(SizedBody<3>& body) {
  auto& obstacles = body.context.obstacles;
  obstacles.x = obstacles.velocity_reference = {{0.4, 0.4, -0.02}, {0.4, 0.4, -1}, {0.5, 0.4, -1}};
  obstacles.rest = {{0.4, 0.4, -2}, {0.4, 0.4, -3}, {0.5, 0.4, -3}};
  obstacles.triangles = {{0, 1, 2}};
  obstacles.edges = {{0, 1}, {1, 2}, {0, 2}};
  obstacles.past_x = {obstacles.x};
}

template <int Dim>
void refine_at_contact() {
  Mat<Dim> tilt = Mat<Dim>::Identity();
  SizedBody<Dim> body(tilt);
  put_spike_below(body);
  body.context.contact.enabled = true;
  body.context.contact.dhat = 0.03;
  // The inner vertices' lengths alone ask for nothing; what is in contact spans some of the way to the spike.
  for (int v = 0; v < body.mesh.node_slots(); ++v) {
    auto x = body.fields.x.template segment<Dim>(Dim * v);
    x[Dim - 1] += 0.3 * (x[0] - 0.4) * (x[0] - 0.4);
  }
  body.fields.past_positions = {body.fields.x};
  body.fields.predictor = body.fields.velocity_reference = body.fields.x;
  body.options.collapse.enabled = false;
  body.options.sizing_field.rel_min_edge_length = 0.15;
  body.remesh_it();
  EXPECT_GT(body.report.splits.accepted, 0);
  for (const EdgeKey& e : body.mesh.edges()) EXPECT_GE((body.mesh.rest(e[0]) - body.mesh.rest(e[1])).norm(), 0.15 / 4);
}

TEST(SizingField, RefinesWhereSurfacesAreInContactDownToTheLimit) {
  refine_at_contact<2>();
  refine_at_contact<3>();
}

}  // namespace
}  // namespace itr
