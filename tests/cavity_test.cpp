// SPDX-License-Identifier: MIT
// Cavities: derivatives, the part of rank one of the Newton system, closed forms, what is refused.
#include "energy/cavity.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <random>

#include "advance.hpp"
#include "block.hpp"
#include "derivatives.hpp"
#include "newton/rank_one_system.hpp"
#include "output/force_file.hpp"
#include "simulation/state.hpp"
#include "square_mesh.hpp"
#include "temporary_path.hpp"

namespace itr {
namespace {

constexpr int kInner = 5, kOuter = 6;  ///< tags

/// A square or a cube of 3^Dim boxes of side 1 without the one in the middle; the hole is tagged kInner.
template <int Dim>
Mesh<Dim> hollow_box();

template <int Dim>
void tag_hole(Mesh<Dim>& mesh, double least, double most) {
  for (const FacetId f : mesh.live_facets()) {
    bool is_inner = true;
    for (const VertexId v : mesh.facet(f))
      is_inner = is_inner && (mesh.rest(v).array() > least).all() && (mesh.rest(v).array() < most).all();
    mesh.set_facet_tag(f, is_inner ? kInner : kOuter);
  }
}

template <>
Mesh<2> hollow_box<2>() {
  const Grid grid = make_regular_grid(3, 3, [](int i, int j) { return (i + j) % 2; });
  std::vector<std::array<int, 3>> cells;
  for (std::size_t c = 0; c < grid.cells.size(); ++c)
    if (c / 2 != 4) cells.push_back(grid.cells[c]);
  Mesh<2> mesh(grid.rest, cells, std::vector<int>(cells.size(), 1));
  tag_hole(mesh, 0.5, 2.5);
  return mesh;
}

template <>
Mesh<3> hollow_box<3>() {
  std::vector<Vec<3>> rest;
  for (int i = 0; i < 64; ++i) rest.emplace_back(i % 4, i / 4 % 4, i / 16);
  std::vector<std::array<int, 4>> cells;
  for (int box = 0; box < 27; ++box) {
    if (box == 13) continue;
    const int first = box % 3 + 4 * (box / 3 % 3) + 16 * (box / 9);
    const auto corner = [&](int i) { return first + (i & 1) + 4 * (i >> 1 & 1) + 16 * (i >> 2 & 1); };
    for (const auto& [a, b] : {std::pair{1, 3}, {3, 2}, {2, 6}, {6, 4}, {4, 5}, {5, 1}})
      cells.push_back({corner(0), corner(a), corner(b), corner(7)});
  }
  Mesh<3> mesh(rest, cells, std::vector<int>(cells.size(), 1));
  tag_hole(mesh, 0.5, 2.5);
  return mesh;
}

const CavityLoad kLoads[] = {{{kInner}, 2, 5, 1.4, 0}, {{kInner}, -1, 4, 1, 0}, {{kInner}, 3, 1, 1.4, 20}};

template <int Dim>
VectorX rest_of(const CellSet<Dim>& cells) {
  VectorX x(Dim * cells.num_vertices);
  for (int v = 0; v < cells.num_vertices; ++v) vertex_of<Dim>(x, v) = cells.rest[v];
  return x;
}

template <int Dim>
VectorX perturbed_rest(const CellSet<Dim>& cells, std::mt19937& random) {
  std::normal_distribution<double> normal(0, 0.08);
  return rest_of(cells) + VectorX::NullaryExpr(Dim * cells.num_vertices, [&] { return normal(random); });
}

/// The whole Hessian, with the part that is not assembled.
MatrixX whole_hessian(const Energy& energy, const VectorX& x) {
  MatrixX hessian = hessian_of(energy, x, PsdProjection::none);
  std::vector<RankOne> parts;
  energy.add_rank_ones(x, parts);
  for (const RankOne& part : parts) hessian += part.factor * part.vector * part.vector.transpose();
  return hessian;
}

template <int Dim>
void expect_cavity_derivatives(const CellSet<Dim>& cells, double rest_volume) {
  std::mt19937 random(3);
  Workspace workspace;
  for (const CavityLoad& load : kLoads) {
    const CavityEnergy<Dim> cavity(cells, load, 0.3);
    const VectorX rest = rest_of(cells);
    EXPECT_NEAR(cavity.volume(rest), rest_volume, 1e-13 * rest_volume);
    EXPECT_NEAR(cavity.value(rest, workspace), 0, 1e-13);
    EXPECT_NEAR(cavity.pressure(rest), load.pressure, 1e-13);
    const VectorX x = perturbed_rest(cells, random), gradient = gradient_of(cavity, x);
    const MatrixX hessian = whole_hessian(cavity, x);
    constexpr double h = 1e-5;
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      VectorX plus = x, minus = x;
      plus[i] += h;
      minus[i] -= h;
      EXPECT_NEAR((cavity.value(plus, workspace) - cavity.value(minus, workspace)) / (2 * h), gradient[i], 1e-8);
      const VectorX column = (gradient_of(cavity, plus) - gradient_of(cavity, minus)) / (2 * h);
      EXPECT_LE((column - hessian.col(i)).norm(), 1e-7);
    }
    expect_psd(cavity, x);
    Vec<Dim> resultant = sum<Dim>(gradient);
    if (cells.axisymmetric) resultant[0] = 0;  // sums around circles, no resultant
    EXPECT_LE(resultant.norm(), 1e-13);
  }
}

TEST(Cavity, DerivativesMatchDifferences) {
  expect_cavity_derivatives<2>(whole_mesh(hollow_box<2>(), {}), 1);
  expect_cavity_derivatives<3>(whole_mesh(hollow_box<3>(), {}), 1);
  Mesh<2> curved = hollow_box<2>();
  curved.set_curved_edges(curved.edges());
  expect_cavity_derivatives<2>(whole_mesh(curved, {}), 1);
  for (Mesh<2> turned : {hollow_box<2>(), curved}) {
    turned.set_axisymmetric(true);
    expect_cavity_derivatives<2>(whole_mesh(turned, {}), 3 * std::numbers::pi);
  }
}

TEST(Cavity, EndsWhereNoVolumeIsLeft) {
  const CellSet<2> cells = whole_mesh(hollow_box<2>(), {});
  Workspace workspace;
  VectorX x = rest_of(cells);
  for (Eigen::Index i = 0; i < x.size(); i += 2) x[i] = -x[i];
  EXPECT_EQ(CavityEnergy<2>(cells, kLoads[0], 1).value(x, workspace), std::numeric_limits<double>::infinity());
}

/// A stiffness for every node beside that of a cavity.
class Springs final : public Energy {
 public:
  std::string_view name() const override { return "springs"; }
  double value(ConstVectorView x, Workspace&) const override { return 5 * x.squaredNorm(); }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override { gradient += 10 * x; }
  void add_hessian(ConstVectorView x, PsdProjection, HessianSink& sink, Workspace&) const override {
    const Mat<2> block = 10 * Mat<2>::Identity();
    for (int v = 0; v < x.size() / 2; ++v) sink.add<2>(std::array{v}, block.data());
  }
};

/// Checks solutions, products and the motion of held dofs against the matrix that has all parts.
TEST(Cavity, NewtonSystemSolvesAsIfItWereAssembled) {
  const CellSet<2> cells = whole_mesh(hollow_box<2>(), {});
  std::mt19937 random(4);
  const VectorX x = perturbed_rest(cells, random);
  EnergySum sum;
  sum.add(std::make_shared<Springs>());
  sum.add(std::make_shared<CavityEnergy<2>>(cells, kLoads[0], 0.3));
  sum.add(std::make_shared<CavityEnergy<2>>(cells, kLoads[2], 0.7));
  std::vector<char> held(x.size(), 0);
  PrescribedMotion motion;
  motion.step = VectorX::Zero(x.size());
  for (const int i : {10, 11, 21}) held[i] = 1, motion.step[i] = 0.1 * i - 1;
  const DofMap dofs = DofMap::from_held(held);
  const MatrixX all = whole_hessian(sum, x);
  MatrixX H(dofs.num_unknowns, dofs.num_unknowns);
  VectorX coupling(dofs.num_unknowns);
  const VectorX of_motion = all * motion.step;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    if (held[i]) continue;
    coupling[dofs.unknown[i]] = of_motion[i];
    for (Eigen::Index j = 0; j < x.size(); ++j)
      if (!held[j]) H(dofs.unknown[i], dofs.unknown[j]) = all(i, j);
  }
  DenseSystem dense;
  RankOneSystem system(dense);
  Workspace workspace;
  system.assemble(sum, x, PsdProjection::none, dofs, motion, workspace);
  EXPECT_LE((motion.coupling - coupling).norm(), 1e-12);
  EXPECT_NEAR(motion.curvature, motion.step.dot(of_motion), 1e-12);
  const VectorX rhs = VectorX::LinSpaced(dofs.num_unknowns, -1, 2);
  for (const double shift : {0.0, 0.5}) {
    const VectorX expected = (H + shift * MatrixX::Identity(H.rows(), H.cols())).ldlt().solve(rhs);
    VectorX solution(rhs.size()), again(rhs.size());
    const auto report = system.solve(shift, rhs, {1e-8}, solution);
    EXPECT_EQ(report.outcome, linear::Outcome::ok);
    EXPECT_EQ(report.definiteness, linear::Definiteness::positive);
    EXPECT_LE((solution - expected).norm(), 1e-12);
    system.factorize(shift);
    system.solve_again(rhs, again);
    EXPECT_LE((again - expected).norm(), 1e-12);
    MatrixX columns;
    ASSERT_TRUE(system.solve_columns(rhs, columns));
    EXPECT_LE((columns.col(0) - expected).norm(), 1e-12);
  }
  VectorX product(rhs.size()), near = x + VectorX::Constant(x.size(), 1e-3);  // moved as a whole: nothing changes
  system.product()(rhs, product);
  EXPECT_LE((product - H * rhs).norm(), 1e-12);
  for (const double change : {0.0, 1e-6, 0.1}) {  // solutions begin with the columns of the last one
    near += change * VectorX::LinSpaced(x.size(), -1, 1);
    PrescribedMotion none;
    system.assemble(sum, near, PsdProjection::none, dofs, none, workspace);
    const MatrixX now = whole_hessian(sum, near);
    VectorX solution(rhs.size()), all_dofs = VectorX::Zero(x.size());
    EXPECT_LE(system.solve(0, rhs, {1e-8}, solution).residual, 1e-7);
    for (Eigen::Index i = 0; i < x.size(); ++i)
      if (!held[i]) all_dofs[i] = solution[dofs.unknown[i]];
    const VectorX back = now * all_dofs;
    for (Eigen::Index i = 0; i < x.size(); ++i) EXPECT_NEAR(held[i] ? 0 : back[i] - rhs[dofs.unknown[i]], 0, 1e-6) << change;
  }
}

constexpr double kA = 1, kB = 2, kE = 1e6, kNu = 0.3;  ///< radii of a ring, its moduli

/// Two thirds of the nodes of a ring between two radii are on curved edges.
Setup<2> ring(double pressure, double external, double exponent) {
  constexpr int kAround = 32, kThrough = 4;
  std::vector<Vec<2>> rest;
  for (int i = 0; i <= kThrough; ++i)
    for (int j = 0; j < kAround; ++j) {
      const double r = kA + (kB - kA) * i / kThrough, angle = 2 * std::numbers::pi * j / kAround;
      rest.emplace_back(r * std::cos(angle), r * std::sin(angle));
    }
  std::vector<std::array<int, 3>> cells;
  for (int i = 0; i < kThrough; ++i)
    for (int j = 0; j < kAround; ++j) {
      const int a = i * kAround + j, b = i * kAround + (j + 1) % kAround, c = a + kAround, d = b + kAround;
      cells.push_back({a, c, d});
      cells.push_back({a, d, b});
    }
  Setup<2> setup;
  setup.mesh = Mesh<2>(rest, cells, std::vector<int>(cells.size(), 1));
  for (const FacetId f : setup.mesh.live_facets())
    setup.mesh.set_facet_tag(f, setup.mesh.rest(setup.mesh.facet(f)[0]).norm() < kA + 0.1 ? kInner : kOuter);
  for (VertexId v = 0; v < setup.mesh.num_vertices(); ++v) {  // rollers on the axes
    const Vec<2>& X = setup.mesh.rest(v);
    if (X.norm() > kB - 1e-9 && X.cwiseAbs().minCoeff() < 1e-9)
      setup.mesh.set_vertex_tag(v, std::abs(X[1]) < 1e-9 ? 11 : 12);
  }
  const auto stay = [](const Vec<2>&, double) { return Vec<2>(0, 0); };
  setup.dirichlet = {{11, {false, true}, stay}, {12, {true, false}, stay}};
  setup.order[1] = 2;
  setup.materials[1] = {
      .law = MaterialLaw::linear, .youngs_modulus = kE, .poisson_ratio = kNu, .density = 1000, .plane_strain = true};
  setup.cavities = {{.name = "hole",
                     .surfaces = {kInner},
                     .pressure = [pressure](double) { return pressure; },
                     .external_pressure = external,
                     .exponent = exponent}};
  setup.fields.curves = {{.name = "hole", .surfaces = {kInner}}, {.name = "all", .bodies = {1}}};
  setup.time = {.is_static = true, .dt = 1, .steps = 1};
  return setup;
}

ForceCurvePoint curve_of(const Simulation<2>& simulation, std::size_t i = 0) {
  ForceCurvePoint curve;
  simulation.observe([&](const FrameView<2>& frame) { curve = frame.asked->curves.at(i); });
  return curve;
}

/// The gas expands adiabatically as Lamé's ring widens by (1 + nu) p a / E (a^2 (1 - 2 nu) + b^2) / (b^2 - a^2).
TEST(Cavity, GasInARingExpandsAsLameSays) {
  for (const auto& [pressure, external, exponent] : {std::tuple{5e3, 0.0, 1.4}, {2e3, 1e5, 1.4}, {5e3, 2e3, 1.0}}) {
    linear::Registry registry;
    Simulation<2> simulation(ring(pressure, external, exponent), registry);
    const double V0 = curve_of(simulation).cavity[0];
    EXPECT_NEAR(curve_of(simulation).cavity[1], pressure, 1e-9 * pressure);
    const StepResult result = advance(simulation);
    const double compliance = (1 + kNu) / kE * (kA * kA * (1 - 2 * kNu) + kB * kB) / (kB * kB - kA * kA);
    double p = pressure, ratio = 1;
    for (int i = 0; i < 50; ++i) {  // p by the volume, the volume by p
      ratio = std::pow(1 + compliance * p, 2);
      p = 0.5 * p + 0.5 * ((pressure + external) * std::pow(ratio, -exponent) - external);
    }
    const ForceCurvePoint curve = curve_of(simulation);
    EXPECT_NEAR(curve.cavity[0] / V0 - 1, ratio - 1, 0.02 * (ratio - 1));
    EXPECT_NEAR(pressure - curve.cavity[1], pressure - p, 0.02 * (pressure - p));
    EXPECT_NEAR((curve.cavity[1] + external) * std::pow(curve.cavity[0], exponent),
                (pressure + external) * std::pow(V0, exponent), 1e-9 * (pressure + external) * std::pow(V0, exponent));
    EXPECT_LE(std::hypot(curve.kinds[3][0], curve.kinds[3][1]), 1e-6 * pressure);  // a closed surface pushes nowhere
    EXPECT_TRUE(std::isnan(curve_of(simulation, 1).cavity[0]));
  }
}

/// A fluid that hardly compresses keeps its volume where the ring is squeezed.
TEST(Cavity, FluidKeepsItsVolume) {
  itr::Setup<2> setup = ring(0, 0, 1.4);
  setup.cavities[0].bulk_modulus = 1e9;
  setup.materials[1].law = MaterialLaw::neo_hookean;
  for (const FacetId f : setup.mesh.live_facets()) {
    if (setup.mesh.facet_tag(f) == kInner) continue;
    const Vec<2> X = setup.mesh.rest(setup.mesh.facet(f)[0]);
    if (std::abs(X[1]) > 1.8) setup.mesh.set_facet_tag(f, X[1] > 0 ? 7 : 8);
  }
  setup.dirichlet = {{7, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, -0.2); }},
                     {8, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0.2); }}};
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  Simulation<2> open(
      [&] {
        itr::Setup<2> empty = setup;
        empty.cavities[0].bulk_modulus = 0;
        return empty;
      }(),
      registry);
  const double V0 = curve_of(simulation).cavity[0];
  for (auto* each : {&simulation, &open}) {
    const StepResult result = each->advance();
    ASSERT_TRUE(result.ok) << result.reason;
  }
  const auto squeezed = curve_of(simulation).cavity;
  EXPECT_GT(squeezed[1], 1e4);
  EXPECT_NEAR(squeezed[0] / V0, std::exp(-squeezed[1] / 1e9), 1e-9);
  EXPECT_LT(curve_of(open).cavity[0] / V0, 0.97);  // without fluid it does not
}

/// Inflated in time, with inertia and remeshing: the law holds at the end of every step, and nothing moves the ring as a
/// whole.
TEST(Cavity, IsPartOfDynamicsWithRemeshing) {
  itr::Setup<2> setup = ring(0, 1e5, 1.4);
  setup.order.clear();
  setup.materials[1].law = MaterialLaw::neo_hookean;
  setup.cavities[0].pressure = [](double t) { return 2e6 * t; };
  setup.time = {.dt = 0.01, .steps = 8};
  setup.remesh.enabled = true;
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const double V0 = curve_of(simulation).cavity[0];
  int edits = 0;
  for (int step = 0; step < setup.time.steps; ++step) {
    const StepResult result = advance(simulation);
    edits += result.report.splits.accepted;
    const auto [V, p] = std::pair(curve_of(simulation).cavity[0], curve_of(simulation).cavity[1]);
    const double p0 = 2e6 * simulation.state().t;
    EXPECT_NEAR((p + 1e5) * std::pow(V / V0, 1.4), p0 + 1e5, 1e-9 * (p0 + 1e5));
    EXPECT_LE(std::hypot(curve_of(simulation).kinds[3][0], curve_of(simulation).kinds[3][1]), 1e-6 * p0);
  }
  EXPECT_GT(edits, 0);
  EXPECT_GT(curve_of(simulation).cavity[0], 1.05 * V0);
}

/// The place and the reason that a setup is refused for.
std::string refusal(const Setup<2>& setup) {
  try {
    setup.validate();
  } catch (const InputError& error) {
    return error.parts().place + ": " + error.parts().found;
  }
  return "";
}

TEST(Cavity, RefusesSurfacesThatDoNotCloseAroundOne) {
  itr::Setup<2> setup = ring(1, 0, 1.4);
  EXPECT_EQ(refusal(setup), "");
  itr::Setup<2> outer = setup;
  outer.cavities[0].surfaces = {kOuter};
  EXPECT_EQ(refusal(outer), "/boundary_conditions/pressure_cavity/0/id: a surface around the body");
  itr::Setup<2> none = setup;
  none.cavities[0].surfaces = {};
  EXPECT_EQ(refusal(none), "/boundary_conditions/pressure_cavity/0/id: no surface");
  itr::Setup<2> open = setup;
  for (const FacetId f : open.mesh.live_facets())
    if (open.mesh.facet_tag(f) == kInner) {
      open.mesh.set_facet_tag(f, 9);
      break;
    }
  EXPECT_NE(refusal(open).find("does not close: it ends at ("), std::string::npos) << refusal(open);
  EXPECT_TRUE(refusal(open).ends_with(") m")) << refusal(open);
  const std::string in_m = refusal(open);
  open.units = Units("mm", "g", "s");
  EXPECT_TRUE(refusal(open).ends_with(") mm")) << refusal(open);
  const auto number_of = [](const std::string& text) { return std::stod(text.substr(text.find('(') + 1)); };
  EXPECT_NEAR(number_of(refusal(open)), 1e3 * number_of(in_m), 1e-2 * number_of(in_m));
  itr::Setup<2> vacuum = setup;
  vacuum.cavities[0].pressure = [](double) { return -2.0; };
  linear::Registry registry;
  try {
    Simulation<2>(vacuum, registry).advance();
    FAIL() << "below a vacuum";
  } catch (const InputError& error) {
    EXPECT_EQ(error.parts().place, "/boundary_conditions/pressure_cavity/0/value");
  }
}

/// A cylinder with a hole of radius and height 1 around the axis, where its section ends.
TEST(Cavity, ClosesOnTheAxis) {
  const Grid grid = make_regular_grid(3, 3, [](int i, int j) { return (i + j) % 2; });
  std::vector<std::array<int, 3>> cells;
  for (std::size_t c = 0; c < grid.cells.size(); ++c)
    if (c / 2 != 3) cells.push_back(grid.cells[c]);
  itr::Setup<2> setup = ring(1, 0, 1.4);
  setup.mesh = Mesh<2>(grid.rest, cells, std::vector<int>(cells.size(), 1));
  for (const FacetId f : setup.mesh.live_facets()) {
    const auto is_inner = [&](VertexId v) {
      const Vec<2>& X = setup.mesh.rest(v);
      return X[0] < 1.5 && X[1] > 0.5 && X[1] < 2.5;
    };
    setup.mesh.set_facet_tag(f, std::ranges::all_of(setup.mesh.facet(f), is_inner) ? kInner : kOuter);
  }
  setup.dirichlet.clear();
  setup.materials[1].plane_strain = false;
  EXPECT_NE(refusal(setup).find("does not close: it ends at ("), std::string::npos) << refusal(setup);
  setup.mesh.set_axisymmetric(true);
  EXPECT_EQ(refusal(setup), "");
  const CellSet<2> whole = whole_mesh(setup.mesh, {});
  EXPECT_NEAR(CavityEnergy<2>(whole, CavityLoad{{kInner}}, 1).volume(rest_of(whole)), std::numbers::pi, 1e-13);
}

TEST(Cavity, IsInForceFiles) {
  const std::filesystem::path folder = temporary_path();
  std::filesystem::create_directories(folder);
  ForceCurvePoint hole{"hole", {}};
  for (auto& kind : hole.kinds) kind = {1, 2, 3};
  ForceCurvePoint all = hole;
  all.name = "all";
  hole.cavity = {0.5, 4};
  all.cavity.assign(2, std::numeric_limits<double>::quiet_NaN());
  {
    output::CurveFile file(folder / "forces.csv", -1);
    file.add(1, 0.1, {hole, all});
  }
  std::ifstream text(folder / "forces.csv");
  std::string head, first, second;
  std::getline(text, head);
  std::getline(text, first);
  std::getline(text, second);
  EXPECT_TRUE(head.ends_with(",remeshing_moment,volume,pressure")) << head;
  EXPECT_TRUE(first.ends_with(",1,2,3,0.5,4")) << first;
  EXPECT_TRUE(second.ends_with(",1,2,3,,")) << second;
}

}  // namespace
}  // namespace itr
