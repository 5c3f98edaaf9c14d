// SPDX-License-Identifier: MIT
// Surfaces with a shape: vertices on it, momenta, orientation and mass, on random meshes.
#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "fem/inverted.hpp"
#include "remesh/edits.hpp"
#include "remesh/shapes.hpp"
#include "remesh_options.hpp"
#include "simulation/shape_step.hpp"

namespace itr {
namespace {

constexpr double kRoundOff = 1e-12;
constexpr int kTag = 7;

TEST(Shape, DistancesHaveTheirGradients) {
  using enum Shape::Kind;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> number(-1, 1);
  for (const Shape::Kind kind : {plane, sphere, cylinder, cone, torus}) {
    Shape shape{.kind = kind, .center = {0.1, -0.2, 0.3}, .radius = 0.6, .tube_radius = 0.2, .angle = 0.5};
    shape.axis = Vec<3>(1, 2, -1).normalized();
    for (int i = 0; i < 20; ++i) {
      const Vec<3> point = shape.center + shape.axis + 0.5 * Vec<3>(number(random), number(random), number(random));
      const ShapeOffset offset = offset_from(shape, point);
      EXPECT_NEAR(offset_from(shape, point - offset.distance * offset.normal).distance, 0, kRoundOff);
      for (int c = 0; c < 3; ++c) {
        constexpr double kStep = 1e-6;
        const Vec<3> step = kStep * Vec<3>::Unit(c);
        const double slope =
            (offset_from(shape, point + step).distance - offset_from(shape, point - step).distance) / (2 * kStep);
        EXPECT_NEAR(slope, offset.normal[c], 1e-8);
      }
    }
  }
}

TEST(Shape, FittedCurvesAreArcsAndKeepCorners) {
  constexpr int kCorners = 12;
  std::vector<std::array<Vec<3>, 2>> circle, square;
  const auto on_circle = [](double k) {
    const double angle = 2 * std::numbers::pi * k / kCorners;
    return Vec<3>(std::cos(angle), std::sin(angle), 0);
  };
  for (int k = 0; k < kCorners; ++k) circle.push_back({on_circle(k), on_circle((k + 1) % kCorners)});
  const Vec<3> corners[] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  for (int k = 0; k < 4; ++k) square.push_back({corners[k], corners[(k + 1) % 4]});
  Shape shape{.kind = Shape::Kind::fitted, .fitted = fit_curves(circle, 0.7)};
  for (double k = 0; k < kCorners; k += 0.3) EXPECT_NEAR(offset_from(shape, on_circle(k)).distance, 0, 1e-6);
  shape.fitted = fit_curves(circle, 0.1);
  EXPECT_NEAR(std::abs(offset_from(shape, on_circle(0.5)).distance), 1 - std::cos(std::numbers::pi / kCorners), 1e-12);
  shape.fitted = fit_curves(square, 0.7);
  EXPECT_NEAR(offset_from(shape, {0.3, -0.1, 0}).distance, 0.1, 1e-12);
}

/// A polygon in a circle, or an octahedron in a sphere, about a point that is not its middle, in random motion.
template <int Dim>
struct Ball {
  Setup<Dim> setup;
  State<Dim> state;
  Shapes shapes{std::make_shared<Shape>(Shape{.surfaces = {kTag}, .kind = Shape::Kind::sphere, .radius = 1})};

  Ball(unsigned seed, bool lumped) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> number(-1, 1);
    const auto small = [&](double size) {
      Vec<Dim> v;
      for (int c = 0; c < Dim; ++c) v[c] = size * number(random);
      return v;
    };
    std::vector<Vec<Dim>> rest{small(0.2)};
    std::vector<typename Mesh<Dim>::Cell> cells;
    if constexpr (Dim == 2) {
      constexpr int kCorners = 12;
      for (int k = 0; k < kCorners; ++k) {
        const double angle = 2 * std::numbers::pi * (k + 0.2 * number(random)) / kCorners;
        rest.emplace_back(std::cos(angle), std::sin(angle));
        cells.push_back({0, 1 + k, 1 + (k + 1) % kCorners});
      }
    } else {
      for (int axis = 0; axis < 3; ++axis)
        for (const double sign : {1.0, -1.0}) rest.push_back((sign * Vec<3>::Unit(axis) + small(0.1)).normalized());
      for (const int x : {1, 2})
        for (const int y : {3, 4})
          for (const int z : {5, 6}) {
            const bool is_even = (x + y + z) % 2 == 1;
            cells.push_back(is_even ? std::array{0, x, y, z} : std::array{0, y, x, z});
          }
    }
    setup.mesh = Mesh<Dim>(rest, cells, std::vector<int>(cells.size(), 1));
    for (const FacetId f : setup.mesh.live_facets()) setup.mesh.set_facet_tag(f, kTag);
    setup.materials[1] = {.youngs_modulus = 1e5, .density = 3};
    setup.lump_mass = lumped;
    state.mesh = setup.mesh;
    const auto n = Dim * Eigen::Index{state.mesh.num_vertices()};
    VectorX x(n), v(n);
    for (VertexId i = 0; i < state.mesh.num_vertices(); ++i) {
      x.segment<Dim>(Dim * i) = state.mesh.rest(i) + small(0.05);
      v.segment<Dim>(Dim * i) = small(1);
    }
    state.history = {.x = {x}, .v = {v}, .a = {}};
  }

  /// Splits all edges of the surface, puts it onto the sphere and keeps momenta. Returns the material that came.
  AddedMaterial<Dim> refine() {
    RemeshFields<Dim> fields;
    fields.x = state.history.x[0];
    fields.past_positions = state.history.x;
    fields.past_rates = state.history.v;
    Mesh<Dim>& mesh = state.mesh;
    std::vector<EdgeKey> edges;
    for (const EdgeKey& edge : mesh.edges())
      if (!mesh.facets_of_edge(edge).empty()) edges.push_back(edge);
    for (const EdgeKey& edge : edges) {
      const Edit<Dim> edit = make_split(mesh, edge);
      fields.follow(edit, mesh.apply(edit));
    }
    settle(fields, mesh.compact());
    const State<Dim> before = state;
    StepContext<Dim> context;
    context.materials = setup.materials;
    context.has_inertia = true;
    context.obstacles.past_x.resize(1);
    RemeshMemory memory;
    AddedMaterial<Dim> added;
    state.strata = {};
    const auto report = put_on_shapes<Dim>(shapes, mesh, fields, context, remesh_options(), memory, state.strata, added);
    EXPECT_GE(report.smooths.accepted, static_cast<int>(edges.size()));
    const auto renumbering = mesh.compact();
    settle(fields, renumbering);
    state.strata.compact(renumbering);
    EXPECT_EQ(state.strata.find_defect(mesh), "");
    keep_momenta<Dim>(setup, before, added, state);
    check_momenta(before, added);
    return added;
  }

  void settle(RemeshFields<Dim>& fields, const MeshRenumbering& renumbering) {
    for (VectorX* field : {&fields.x, &fields.past_positions[0], &fields.past_rates[0]}) {
      VectorX kept(Dim * Eigen::Index{state.mesh.num_nodes()});
      for (std::size_t v = 0; v < renumbering.vertex.size(); ++v)
        if (renumbering.vertex[v] != kNone)
          kept.segment<Dim>(Dim * renumbering.vertex[v]) = field->segment<Dim>(Dim * static_cast<int>(v));
      *field = kept;
    }
    state.history = {.x = fields.past_positions, .v = fields.past_rates, .a = {}};
  }

  Vec<Dim> momentum(const State<Dim>& of) const {
    Vec<Dim> sum = Vec<Dim>::Zero();
    for (const CellId c : of.mesh.live_cells())
      for (const VertexId v : of.mesh.cell(c))
        sum += 3 * of.mesh.volume(c) / (Dim + 1) * of.history.v[0].template segment<Dim>(Dim * v);
    return sum;
  }
  void check_momenta(const State<Dim>& before, const AddedMaterial<Dim>& added) const {
    Vec<Dim> came = Vec<Dim>::Zero();
    double volume = 0;
    for (const auto& piece : added.pieces) {
      Mat<Dim> edges;
      for (int k = 0; k < Dim; ++k) edges.col(k) = piece.rest[k + 1] - piece.rest[0];
      const double of_piece = std::abs(edges.determinant()) / (Dim == 2 ? 2 : 6);  // a ball is convex
      volume += of_piece;
      for (const auto& v : piece.rates[0]) came += 3 * of_piece / (Dim + 1) * v;
    }
    EXPECT_NEAR(volume, state.mesh.total_volume() - before.mesh.total_volume(), kRoundOff);
    EXPECT_LE((momentum(state) - momentum(before) - came).norm(), kRoundOff);
  }
};

template <typename T>
struct Shapes_ : ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Shapes_, Dimensions);

TYPED_TEST(Shapes_, VerticesGetOntoThemAndMomentaAndOrientationStay) {
  constexpr int Dim = TypeParam::value;
  for (unsigned seed = 0; seed < (Dim == 2 ? 10 : 3); ++seed) {
    Ball<Dim> ball(seed, seed % 2 == 1);
    double missing = 1;
    for (int round = 0; round < (Dim == 2 ? 3 : 2); ++round) {
      const auto added = ball.refine();
      for (const VertexId v : ball.state.mesh.live_vertices())
        EXPECT_NEAR(ball.state.mesh.is_boundary(v) ? ball.state.mesh.rest(v).norm() : 1, 1, kRoundOff);
      EXPECT_EQ(ball.state.mesh.find_defect(), "");
      EXPECT_EQ(find_inverted(ball.state.mesh, ball.state.history.x[0]), kNone);
      EXPECT_FALSE(added.moved.empty());
      const double now = 1 - ball.state.mesh.total_volume() / (Dim == 2 ? std::numbers::pi : 4 * std::numbers::pi / 3);
      EXPECT_LT(now, 0.5 * missing);
      missing = now;
    }
    EXPECT_LT(missing, Dim == 2 ? 1e-4 : 0.01);
  }
}

TYPED_TEST(Shapes_, RigidMotionGoesOn) {
  constexpr int Dim = TypeParam::value;
  Ball<Dim> ball(3, false);
  const auto velocity = [](const Vec<Dim>& x) {
    Vec<Dim> v = Vec<Dim>::Constant(0.3);
    v[0] -= 2 * x[1];
    v[1] += 2 * x[0];
    return v;
  };
  for (const VertexId v : ball.state.mesh.live_vertices()) {
    ball.state.history.x[0].template segment<Dim>(Dim * v) = ball.state.mesh.rest(v);
    ball.state.history.v[0].template segment<Dim>(Dim * v) = velocity(ball.state.mesh.rest(v));
  }
  ball.refine();
  for (const VertexId v : ball.state.mesh.live_vertices()) {
    const Vec<Dim>& rest = ball.state.mesh.rest(v);
    EXPECT_LE((ball.state.history.x[0].template segment<Dim>(Dim * v) - rest).norm(), kRoundOff);
    EXPECT_LE((ball.state.history.v[0].template segment<Dim>(Dim * v) - velocity(rest)).norm(), kRoundOff);
  }
}

}  // namespace
}  // namespace itr
