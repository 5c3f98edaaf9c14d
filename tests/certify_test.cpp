// SPDX-License-Identifier: MIT
// Certificates find what is wrong in stored frames.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "itr/core.hpp"
#include "output/certify.hpp"
#include "output/frame_file.hpp"
#include "temporary_path.hpp"
#include "written_scenes.hpp"

namespace itr::output {
namespace {

namespace fs = std::filesystem;

class CertifyTest : public testing::Test {
 protected:
  void SetUp() override {
    folder = temporary_path();
    fs::remove_all(folder);
  }
  void TearDown() override { fs::remove_all(folder); }

  template <typename Scene>
  std::vector<std::string> violations_of(const Scene& scene) {
    fs::remove_all(folder);
    Writer writer(folder, {1}, {"scene.json", "eigen:ldlt", 1});
    writer.write(scene.view(), StepReport());
    writer.finish("finished");
    certificate = certify(folder);
    return texts_of(certificate);
  }
  static std::vector<std::string> texts_of(const Certificate& certificate) {
    std::vector<std::string> texts;
    for (const Violation& violation : certificate.violations) texts.push_back(violation.text);
    return texts;
  }

  fs::path folder;
  Certificate certificate;  ///< of the last one
};

TEST_F(CertifyTest, CertifiesAValidPlaneFrame) { EXPECT_TRUE(violations_of(Plane()).empty()); }

TEST_F(CertifyTest, CertifiesAValidSolidFrame) { EXPECT_TRUE(violations_of(Solid()).empty()); }

TEST_F(CertifyTest, FindsInvertedAndDegenerateCells) {
  Plane plane;
  plane.x[2 * 3] = 1.5;  // vertex 3 moves across the diagonal 0-2 of its cell
  const auto inverted = violations_of(plane);
  ASSERT_FALSE(inverted.empty());
  EXPECT_EQ(inverted[0], "frames/000000.h5: cell 1 is inverted");

  plane.x[2 * 3] = plane.x[2 * 3 + 1] = 0.25;  // onto it
  const auto degenerate = violations_of(plane);
  ASSERT_FALSE(degenerate.empty());
  EXPECT_EQ(degenerate[0], "frames/000000.h5: cell 1 is degenerate");
}

TEST_F(CertifyTest, FindsWhatLeavesTheAxisAndWhatReachesIt) {
  Plane plane;
  plane.mesh.set_axisymmetric(true);
  EXPECT_TRUE(violations_of(plane).empty());
  EXPECT_TRUE(read_frame(folder / "frames" / "000000.h5").axisymmetric);
  plane.x[0] = 0.01;
  EXPECT_EQ(violations_of(plane), std::vector<std::string>{"frames/000000.h5: vertex 0 of R = 0 is at r = 0.01"});
  for (int i = 0; i < plane.x.size(); i += 2) plane.x[i] = plane.mesh.rest(i / 2)[0] - 1;
  const auto violations = violations_of(plane);
  for (const char* text : {"vertex 0 of R = 0 is at r = -1", "vertex 1 of R = 1 is at r = 0"})
    EXPECT_TRUE(std::ranges::count(violations, "frames/000000.h5: " + std::string(text))) << text;
}

TEST_F(CertifyTest, FindsBodiesThatTouch) {
  Plane plane;
  for (int i = 4; i < 8; ++i) plane.x[2 * i + 1] = plane.mesh.rest(i)[1] - 1;
  for (int i = 4; i < 6; ++i) plane.x[2 * i + 1] = std::nextafter(1.0, 2.0);
  EXPECT_TRUE(violations_of(plane).empty()) << "a gap of one unit in the last place";
  for (int i = 4; i < 6; ++i) plane.x[2 * i + 1] = 1;
  EXPECT_FALSE(violations_of(plane).empty());
}

TEST_F(CertifyTest, FindsABodyInAnObstacleButLetsObstaclesCross) {
  Plane plane;
  plane.obstacle_x.insert(plane.obstacle_x.end(), {{0, -1}, {0, -0.25}});
  plane.obstacle_edges.push_back({2, 3});
  EXPECT_TRUE(violations_of(plane).empty());
  plane.obstacle_x[3] = {0.5, 0.25};
  const auto violations = violations_of(plane);
  ASSERT_EQ(violations.size(), 1u);
  EXPECT_EQ(violations[0], "frames/000000.h5: edges (0, 1) and (obstacle 2, obstacle 3) intersect");
  EXPECT_EQ(certify(folder).violations[0].of, Violation::Of::surfaces);
}

struct PlaneWithProxy : Plane {
  std::vector<Vec<2>> proxy_x = {{-1, 0.2}, {0.5, 0.1}, {2, 0.2}};
  std::vector<std::array<int, 2>> proxy_edges = {{0, 1}, {1, 2}};
  FrameView<2> view() const {
    FrameView<2> frame = Plane::view();
    frame.proxy = {&proxy_x, &proxy_edges, &obstacle_triangles};
    return frame;
  }
};

TEST_F(CertifyTest, AProxyTouchesInPlaceOfTheBoundary) {
  PlaneWithProxy plane;
  plane.obstacle_x = {{0.5, -0.25}, {0.5, 0.05}};  // through the lower square's bottom
  EXPECT_FALSE(violations_of<Plane>(plane).empty());
  EXPECT_TRUE(violations_of(plane).empty());
  plane.proxy_x[1][1] = 0;
  const auto violations = violations_of(plane);
  ASSERT_EQ(violations.size(), 2u);
  EXPECT_EQ(violations[0], "frames/000000.h5: edges (proxy 0, proxy 1) and (obstacle 0, obstacle 1) intersect");
  plane.proxy_x[1][0] = std::nan("");
  EXPECT_EQ(violations_of(plane).size(), 1u);
}

/// Two squares with faces that coincide at rest.
struct TouchingPlane : Plane {
  TouchingPlane() {
    mesh = Mesh<2>({{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 1}, {1, 1}, {1, 2}, {0, 2}},
                   {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}}, {1, 1, 2, 2});
    for (int i = 0; i < 8; ++i) vertex_of<2>(x, i) = mesh.rest(i);
  }
  FrameView<2> view() const {
    FrameView<2> frame = Plane::view();
    frame.dhat = 0.01;
    return frame;
  }
};

TEST_F(CertifyTest, LetsClosedFacesOverlapByDhat) {
  TouchingPlane plane;
  EXPECT_FALSE(violations_of(plane).empty());
  for (int v = 0; v < 8; ++v) plane.mesh.set_steps_apart(v, 0);
  EXPECT_TRUE(violations_of(plane).empty());
  for (int v = 4; v < 8; ++v) plane.x[2 * v + 1] -= 0.008;
  for (const double shift : {0.0, 0.003, -0.3}) {
    for (int v = 4; v < 8; ++v) plane.x[2 * v] = plane.mesh.rest(v)[0] + shift;
    EXPECT_TRUE(violations_of(plane).empty()) << shift;
    EXPECT_NEAR(certificate.overlap, 0.008, 1e-5);
  }
  for (int v = 4; v < 8; ++v) plane.x[2 * v + 1] -= 0.003;
  ASSERT_EQ(violations_of(plane).size(), 3u);  // two are of edges that cross by more than d-hat
  EXPECT_NE(certificate.violations.back().text.find("bodies overlap at"), std::string::npos);
  for (int v = 4; v < 8; ++v) plane.x[2 * v + 1] += 0.003;
  plane.mesh.set_steps_apart(4, 1);
  plane.mesh.set_steps_apart(5, 1);
  EXPECT_FALSE(violations_of(plane).empty());
}

TEST_F(CertifyTest, FindsAnEdgeFoldedOntoItsNeighbour) {
  Plane plane;  // two triangles with one common vertex, an edge of one on an edge of the other
  plane.mesh = Mesh<2>({{0, 0}, {2, 0}, {1, 1}, {0.5, -1}, {1, 0}}, {{0, 1, 2}, {0, 3, 4}}, {1, 1});
  plane.x.resize(10);
  plane.v = VectorX::Zero(10);
  plane.density = {0, 0};
  for (int i = 0; i < 5; ++i) vertex_of<2>(plane.x, i) = plane.mesh.rest(i);
  plane.obstacle_x = {};
  plane.obstacle_edges = {};
  const auto violations = violations_of(plane);
  EXPECT_NE(std::find(violations.begin(), violations.end(), "frames/000000.h5: edges (0, 1) and (0, 4) intersect"),
            violations.end());
  plane.x[9] = -0.1;
  EXPECT_TRUE(violations_of(plane).empty());
}

TEST_F(CertifyTest, FindsASolidThatPiercesAnObstacle) {
  Solid solid;
  for (int i = 0; i < 4; ++i) solid.x[3 * i + 2] -= 1.5;
  EXPECT_EQ(violations_of(solid).size(), 3u);  // the three edges at the apex
}

TEST_F(CertifyTest, FindsObstaclePointsInABody) {
  Plane plane;
  const auto violations_at = [&](double x, double y) {
    plane.obstacle_x[2] = {x, y};
    return violations_of(plane);
  };
  plane.obstacle_x.emplace_back(0, 0);
  for (const double x : {0.25, 0.5, 0.75}) {  // also where the ray upward meets vertices
    EXPECT_TRUE(violations_at(x, -0.25).empty());
    EXPECT_TRUE(violations_at(x, 1.5).empty());
    EXPECT_EQ(violations_at(x, 0.5), std::vector<std::string>{"frames/000000.h5: vertex (obstacle 2) is inside of a body"});
    EXPECT_EQ(violations_at(x, 3), std::vector<std::string>{"frames/000000.h5: vertex (obstacle 2) is on a body"});
  }
  for (const double x : {0.0, 1.0}) {
    EXPECT_EQ(violations_at(x, 0.5).size(), 1u) << "on the side";
    EXPECT_TRUE(violations_at(x, -0.25).empty());
  }
}

TEST_F(CertifyTest, FindsObstaclePointsAndEdgesInASolid) {
  Solid solid;
  solid.obstacle_x.insert(solid.obstacle_x.end(), {{0.1, 0.1, -0.5}, {0.2, 0.1, -0.5}});
  for (const bool joined : {false, true}) {
    if (joined) solid.obstacle_edges.push_back({3, 4});
    const auto violations_at = [&](double z) {
      solid.obstacle_x[3][2] = solid.obstacle_x[4][2] = z;
      return violations_of(solid).size();
    };
    EXPECT_EQ(violations_at(-0.5), 0u);
    EXPECT_EQ(violations_at(0.9), 0u);
    EXPECT_EQ(violations_at(0.1), 2u);
    EXPECT_GE(violations_at(0), 1u) << "on it";
  }
  solid.obstacle_edges.pop_back();
  solid.obstacle_x[3] = {0.125, 0.125, -0.5};  // the ray meets an edge, a vertex, and a plane of facets
  solid.obstacle_x[4] = {0, 0, -0.5};
  EXPECT_EQ(violations_of(solid).size(), 0u);
  solid.obstacle_x[3][2] = 0.125;
  EXPECT_EQ(violations_of(solid).size(), 1u);
}

TEST_F(CertifyTest, FindsABodyInABody) {
  Plane plane;
  const auto shrink_into = [&](double y) {  // the upper square
    for (int i = 4; i < 8; ++i) vertex_of<2>(plane.x, i) = Vec<2>(0.5, y) + 0.1 * (plane.mesh.rest(i) - Vec<2>(0.5, 2.5));
  };
  shrink_into(1.5);
  EXPECT_TRUE(violations_of(plane).empty());
  shrink_into(0.75);
  EXPECT_EQ(violations_of(plane),
            std::vector<std::string>{"frames/000000.h5: the part of the boundary at vertex 4 is inside of a body"});

  Solid solid;
  const std::vector<Vec<3>> corners = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  std::vector<Vec<3>> rest = corners;
  for (const Vec<3>& p : corners) rest.push_back(p + Vec<3>(2, 0, 0));
  solid.mesh = Mesh<3>(rest, {{0, 1, 2, 3}, {4, 5, 6, 7}}, {1, 2});
  solid.v = VectorX::Zero(24);
  solid.density = {0, 0};
  solid.x.resize(24);
  for (int i = 0; i < 8; ++i) vertex_of<3>(solid.x, i) = rest[i];
  EXPECT_TRUE(violations_of(solid).empty());
  for (int i = 0; i < 4; ++i) vertex_of<3>(solid.x, 4 + i) = 0.1 * corners[i] + Vec<3>::Constant(0.2);
  EXPECT_EQ(violations_of(solid).size(), 1u);
}

/// A sheet of two triangles as a proxy, folded shut along their common edge.
TEST_F(CertifyTest, FindsTrianglesFoldedOntoTheirNeighbours) {
  struct Sheet : Solid {
    std::vector<Vec<3>> proxy_x = {{0, 0, 5}, {1, 0, 5}, {0.25, 1, 5}, {0.75, -1, 5}};
    std::vector<std::array<int, 2>> proxy_edges = {{0, 1}, {0, 2}, {1, 2}, {0, 3}, {1, 3}};
    std::vector<std::array<int, 3>> proxy_triangles = {{0, 1, 2}, {1, 0, 3}};
    FrameView<3> view() const {
      FrameView<3> frame = Solid::view();
      frame.proxy = {&proxy_x, &proxy_edges, &proxy_triangles};
      return frame;
    }
  } sheet;
  EXPECT_TRUE(violations_of(sheet).empty());
  sheet.proxy_x[3] = {0.75, 1, std::nextafter(5.0, 6.0)};
  EXPECT_TRUE(violations_of(sheet).empty()) << "open by one unit in the last place";
  sheet.proxy_x[3][2] = 5;
  EXPECT_FALSE(violations_of(sheet).empty());
}

TEST_F(CertifyTest, FindsCellsOfNoVolumeAtRest) {
  Plane plane;
  for (double& value : plane.x) value += 10;
  EXPECT_TRUE(violations_of(plane).empty());
  std::vector<double> rest;
  for (int i = 0; i < 8; ++i) rest.insert(rest.end(), {plane.mesh.rest(i)[0], plane.mesh.rest(i)[1]});
  const fs::path frame = folder / "frames/000000.h5";
  std::string bytes = text_of(frame);
  const std::size_t at = bytes.find(std::string(reinterpret_cast<const char*>(rest.data()), 8 * rest.size()));
  ASSERT_NE(at, std::string::npos);
  rest[6] = 1.5;  // vertex 3 across the diagonal
  std::memcpy(bytes.data() + at, rest.data(), 8 * rest.size());
  std::ofstream(frame, std::ios::binary) << bytes;
  Certificate certificate = certify(folder);
  EXPECT_EQ(texts_of(certificate),
            std::vector<std::string>{"frames/000000.h5: /mesh/rest is damaged: not what was written"});
  EXPECT_EQ(certificate.violations[0].of, Violation::Of::file);
  for (std::size_t name; (name = bytes.find("digests")) != std::string::npos;) bytes[name] = 'D';  // as of before these
  std::ofstream(frame, std::ios::binary) << bytes;
  certificate = certify(folder);
  EXPECT_EQ(texts_of(certificate), std::vector<std::string>{"frames/000000.h5: at rest cell 1 is inverted"});
  EXPECT_EQ(certificate.violations[0].of, Violation::Of::cells);
}

TEST_F(CertifyTest, MeasuresFlightByTheSizeOfTheScene) {
  Plane plane;
  EXPECT_TRUE(violations_of(plane).empty());
  EXPECT_EQ(certify(folder).flight, 0);
  // Body 2 is 7 m up; bodies and obstacle fill 3 m x 3.5 m.
  for (int i = 4; i < 8; ++i) vertex_of<2>(plane.x, i)[1] += 7;
  EXPECT_TRUE(violations_of(plane).empty());
  EXPECT_NEAR(certify(folder).flight, 7 / std::hypot(3, 3.5), 1e-14);
}

TEST_F(CertifyTest, FindsCurvesInObstaclesThatTheirChordsDoNotReach) {
  Plane plane;
  plane.mesh.set_curved_edges({{0, 1}});
  VectorX x(18);  // and the node of the lowest edge
  x << plane.x, 0.5, -0.4;
  plane.x = x;
  plane.v = VectorX::Zero(18);
  plane.density.assign(4, 0);
  const auto violations = [&](double a, double b, double height) {
    plane.obstacle_x = {{a, height}, {b, height}};
    return violations_of(plane).size();
  };
  // At x = 1/4 the parabola is at -0.3, its chord at -0.2.
  EXPECT_EQ(violations(-1, 0.25, -0.300001), 0u);
  EXPECT_EQ(violations(-1, 0.25, -0.299), 1u + 1u) << "the edge crosses, and its end is beyond";
  EXPECT_EQ(violations(0.25, 0.26, -0.25), 2u) << "wholly between curve and chord";
}

/// Chords through the nodes of a dent cut off the tip of what is in there; its other vertices tell that it is outside.
TEST_F(CertifyTest, LetsTipsReachIntoDentsOfCurves) {
  Plane plane;
  plane.mesh.set_curved_edges({{2, 3}});
  VectorX x(18);
  x << plane.x, 0.5, 0.8;
  plane.x = x;
  plane.v = VectorX::Zero(18);
  plane.density.assign(4, 0);
  const auto put_tip = [&](double y) {  // at x = 1/4 the parabola is at 0.85, its chord at 0.9
    const std::vector<Vec<2>> corners = {{0.25, y}, {0.3, 1.75}, {0.3, 2.75}, {0.25, 2.75}};
    for (int i = 0; i < 4; ++i) vertex_of<2>(plane.x, 4 + i) = corners[i];
  };
  put_tip(0.875);
  EXPECT_TRUE(violations_of(plane).empty()) << ::testing::PrintToString(texts_of(certificate));
  put_tip(0.82);
  EXPECT_FALSE(violations_of(plane).empty());

  Solid solid;
  solid.mesh.set_curved_edges({{1, 2}, {1, 3}, {2, 3}});
  x.resize(21);
  const Vec<3> dent = Vec<3>::Constant(-0.06);  // 4/3 of it in the middle of the face
  x << solid.x, Vec<3>(0.5, 0.5, 0) + dent, Vec<3>(0.5, 0, 0.5) + dent, Vec<3>(0, 0.5, 0.5) + dent;
  solid.x = x;
  solid.v = VectorX::Zero(21);
  for (const double depth : {1.15, 1.4}) {
    solid.obstacle_x = {Vec<3>::Constant(1.0 / 3) + depth * dent, {5, 5, 4.5}, {5, 4.5, 5}};
    EXPECT_EQ(violations_of(solid).empty(), depth < 4.0 / 3) << ::testing::PrintToString(texts_of(certificate));
  }
}

/// Points between a curved face and its chords, in a hollow and in a bulge.
TEST_F(CertifyTest, TellsOnWhichSideOfACurvedFacePointsAre) {
  Solid solid;
  solid.mesh = Mesh<3>({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2, 3}}, {1});
  solid.mesh.set_curved_edges({{0, 1}, {0, 2}, {1, 2}});
  solid.obstacle_edges.clear();
  solid.obstacle_triangles.clear();
  solid.density = {0};
  solid.v = VectorX::Zero(21);
  const auto is_certified = [&](double middle, double height) {
    solid.x.resize(21);
    for (int i = 0; i < 4; ++i) vertex_of<3>(solid.x, i) = solid.mesh.rest(i);
    vertex_of<3>(solid.x, solid.mesh.node_of(0, 1)) = Vec<3>(0.5, 0, middle);
    vertex_of<3>(solid.x, solid.mesh.node_of(0, 2)) = Vec<3>(0, 0.5, middle);
    vertex_of<3>(solid.x, solid.mesh.node_of(1, 2)) = Vec<3>(0.5, 0.5, middle);
    solid.obstacle_x = {{1. / 3, 1. / 3, height}};
    return violations_of(solid).empty();
  };
  // In the middle the face is at 4/3 of its nodes' height, its chords at that height.
  for (const double beside : {1e-6, 0.03}) {
    EXPECT_TRUE(is_certified(0.1, 0.4 / 3 - beside)) << "hollow";
    EXPECT_FALSE(is_certified(0.1, 0.4 / 3 + beside)) << "hollow";
    EXPECT_TRUE(is_certified(-0.1, -0.4 / 3 - beside)) << "bulge";
    EXPECT_FALSE(is_certified(-0.1, -0.4 / 3 + beside)) << "bulge";
  }
  EXPECT_FALSE(is_certified(0.1, 0.4 / 3)) << "on the face";

  solid.mesh = Mesh<3>({{0, 0, 0}, {1, 1, 0}, {0, 1, 0}, {1, 0, 0}, {0.5, 0.5, 1}}, {{0, 1, 2, 4}, {1, 0, 3, 4}}, {1, 1});
  solid.mesh.set_curved_edges({{0, 1}});
  solid.density = {0, 0};
  solid.v = VectorX::Zero(18);
  const auto is_certified_at_edge = [&](double middle, double height) {
    solid.x.resize(18);
    for (int i = 0; i < 5; ++i) vertex_of<3>(solid.x, i) = solid.mesh.rest(i);
    vertex_of<3>(solid.x, 5) = Vec<3>(0.5, 0.5, middle);
    solid.obstacle_x = {{0.25, 0.25, height}};
    return violations_of(solid).empty();
  };
  // The edge is at 3/4 of its node's height there, its chord at half.
  EXPECT_TRUE(is_certified_at_edge(0.1, 0.07)) << "in the plane between a curved edge and its chord";
  EXPECT_FALSE(is_certified_at_edge(0.1, 0.08));
  EXPECT_TRUE(is_certified_at_edge(-0.1, -0.08));
  EXPECT_FALSE(is_certified_at_edge(-0.1, -0.07));
}

/// The curved edge 0 1 pierces the facet 2 3 4, which shares a vertex with each of the two facets beside that edge.
TEST_F(CertifyTest, FindsACurvedEdgeInAFacetThatNeighboursBothOfItsOwn) {
  Solid solid;
  solid.mesh =
      Mesh<3>({{-1, 0, 1}, {1, 0, 1}, {0, 1, 0}, {0, -1, 0}, {-1, 0, -1}, {1, 0, -1}}, {{1, 0, 2, 3}, {4, 5, 2, 3}}, {1, 1});
  solid.mesh.set_curved_edges({{0, 1}});
  solid.obstacle_x.clear();
  solid.obstacle_edges.clear();
  solid.obstacle_triangles.clear();
  solid.density = {0, 0};
  solid.x.resize(21);
  for (int i = 0; i < 6; ++i) vertex_of<3>(solid.x, i) = solid.mesh.rest(i);
  solid.v = VectorX::Zero(21);
  vertex_of<3>(solid.x, 6) = Vec<3>(0, 0, 1);
  EXPECT_TRUE(violations_of(solid).empty());
  vertex_of<3>(solid.x, 6) = Vec<3>(-0.5, 0, -0.7);
  const std::vector<std::string> found = violations_of(solid);
  EXPECT_TRUE(std::any_of(found.begin(), found.end(), [](const std::string& text) {
    return text.find("edge (0, 6) and triangle (2, 3, 4) intersect") != std::string::npos;
  })) << ::testing::PrintToString(found);
}

TEST_F(CertifyTest, FindsPositionsThatAreNotNumbers) {
  Plane plane;
  plane.x[5] = std::nan("");
  EXPECT_EQ(violations_of(plane).size(), 1u);
}

TEST_F(CertifyTest, CertifyRefusesWhatItCannotRead) {
  EXPECT_THROW(certify(folder), InputError);
  EXPECT_TRUE(violations_of(Plane()).empty());
  fs::resize_file(folder / "frames/000000.h5", 1000);
  EXPECT_THROW(certify(folder), InputError);
}

}  // namespace
}  // namespace itr::output
