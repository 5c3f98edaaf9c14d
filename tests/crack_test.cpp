// SPDX-License-Identifier: MIT
// Vertices and facets that coincide at rest are told apart by the body that they belong to: random cracks in 2D and 3D.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>

#include "cracked_mesh.hpp"
#include "energy/load.hpp"
#include "energy/load_points.hpp"
#include "energy/pressure.hpp"
#include "fem/locator.hpp"
#include "geometry/intersection.hpp"
#include "itr/core.hpp"
#include "itr/energy.hpp"
#include "itr/itr.hpp"
#include "itr/solver.hpp"
#include "itr/transfer.hpp"
#include "output/checkpoint.hpp"
#include "output/frame_file.hpp"
#include "random_mesh.hpp"
#include "random_tets.hpp"
#include "simulation/invariants.hpp"
#include "simulation/state.hpp"
#include "simulation/step_problem.hpp"
#include "temporary_path.hpp"

namespace itr {
namespace {

constexpr int kMeshes = 12;  ///< a dimension

template <int Dim>
Mesh<Dim> whole(std::mt19937& random) {
  if constexpr (Dim == 2)
    return random_mesh(6, random);
  else
    return random_tets(3, random, false);
}
template <int Dim>
Mesh<Dim> cracked(std::mt19937& random) {
  return cracked_at_random(whole<Dim>(random), 3, Dim == 2 ? 5 : 12, random);
}
template <int Dim>
class Cracks : public testing::Test {};

template <int Dim>
std::array<Vec<Dim>, Dim + 1> corners_of(const Mesh<Dim>& mesh, CellId c) {
  std::array<Vec<Dim>, Dim + 1> p;
  for (int k = 0; k <= Dim; ++k) p[k] = mesh.rest(mesh.cell(c)[k]);
  return p;
}

/// Values that have nothing to do with each other from one vertex to the next.
VectorX scattered(Eigen::Index size, std::mt19937& random) {
  std::uniform_real_distribution<double> value(-1, 1);
  VectorX values(size);
  for (double& v : values) v = value(random);
  return values;
}

template <int Dim>
SpaceTimeFunction<Dim> as_function(const Mesh<Dim>& mesh, const VectorX& values) {
  return [f = nodal_function<Dim>(std::make_shared<Locator<Dim>>(mesh), values, Dim)](const RestPoint<Dim>& X, double) {
    return Vec<Dim>(f(X));
  };
}

template <int Dim>
void check_values_at_vertices() {
  int doubled = 0;
  for (unsigned seed = 0; seed < kMeshes; ++seed) {
    std::mt19937 random(seed);
    Mesh<Dim> mesh = cracked<Dim>(random);
    doubled += num_doubled(mesh);
    if (seed % 2) mesh.set_curved_edges(mesh.edges());
    const VectorX values = scattered(Dim * mesh.num_nodes(), random);
    StepSetup<Dim> setup;
    Mesh<Dim> held = mesh;
    for (FacetId f = 0; f < held.facet_slots(); ++f) held.set_facet_tag(f, 1);
    std::array<bool, Dim> all;
    all.fill(true);
    setup.dirichlet = {{1, all, as_function<Dim>(mesh, values)}};
    const HeldDofs<Dim> result = held_dofs(setup, held, 0);
    const std::vector<Vec<Dim>>& rest = mesh.rest();
    for (int n = 0; n < mesh.num_nodes(); ++n) {
      if (!result.held[Dim * n]) continue;
      const Vec<Dim> asked = values.segment<Dim>(Dim * n), got = result.target.template segment<Dim>(Dim * n) - rest[n];
      ASSERT_LT((got - asked).norm(), 1e-12) << "seed " << seed << ", node " << n;
    }
  }
  EXPECT_GT(doubled, 10 * kMeshes);
}
TEST(Cracks, VerticesAndNodesAreHeldWhereTheyAreAsked2D) { check_values_at_vertices<2>(); }
TEST(Cracks, VerticesAndNodesAreHeldWhereTheyAreAsked3D) { check_values_at_vertices<3>(); }

/// Tractions, pressures and accelerations by vertex against those of functions that know their facet or cell.
template <int Dim>
void check_loads() {
  for (unsigned seed = 0; seed < kMeshes; ++seed) {
    std::mt19937 random(seed);
    Mesh<Dim> mesh = cracked<Dim>(random);
    for (FacetId f = 0; f < mesh.facet_slots(); ++f) mesh.set_facet_tag(f, 1);
    const VectorX values = scattered(Dim * mesh.node_slots(), random);
    StepSetup<Dim> setup;
    setup.neumann = {{1, as_function<Dim>(mesh, values)}};
    setup.body_acceleration = as_function<Dim>(mesh, values);
    const Loads<Dim> loads = loads_at<Dim>(setup, 0);
    const CellSet<Dim> cells = whole_mesh<Dim>(mesh, {});
    std::map<int, Material> materials;
    for (CellId c = 0; c < mesh.cell_slots(); ++c) materials[mesh.body(c)].density = 1;
    const VectorX forces = LoadEnergy<Dim>(cells, materials, loads, 1).forces();
    // Consistent forces of linear loads: measure / (n (n + 1)) (sum of all + own).
    VectorX expected = VectorX::Zero(forces.size());
    const auto add = [&](const auto& ids, double measure) {
      const auto n = static_cast<double>(ids.size());
      Vec<Dim> sum = Vec<Dim>::Zero();
      for (const int v : ids) sum += values.segment<Dim>(Dim * v);
      for (const int v : ids)
        expected.segment<Dim>(Dim * v) += measure / (n * (n + 1)) * (sum + values.segment<Dim>(Dim * v));
    };
    for (CellId c = 0; c < mesh.cell_slots(); ++c) add(mesh.cell(c), mesh.volume(c));
    for (FacetId f = 0; f < mesh.facet_slots(); ++f) {
      std::array<Vec<Dim>, Dim> p;
      for (int k = 0; k < Dim; ++k) p[k] = mesh.rest(mesh.facet(f)[k]);
      add(mesh.facet(f), facet_area(p));
    }
    ASSERT_LT((forces - expected).norm(), 1e-11 * expected.norm()) << "seed " << seed;
  }
}
TEST(Cracks, LoadsActOnTheirFaces2D) { check_loads<2>(); }
TEST(Cracks, LoadsActOnTheirFaces3D) { check_loads<3>(); }

template <int Dim>
std::optional<Edit<Dim>> any_edit(const Mesh<Dim>& mesh, std::mt19937& random) {
  if constexpr (Dim == 2)
    return random_edit(mesh, random);
  else
    return propose_at_random(mesh, Strata<3>(mesh), static_cast<Operation>(random() % 5), random).edit;
}

template <int Dim>
MeshRenumbering changed_at_random(Mesh<Dim>& mesh, int edits, std::mt19937& random) {
  for (int i = 0; i < edits;)
    if (const auto edit = any_edit(mesh, random)) mesh.apply(*edit), ++i;
  return mesh.compact();
}

/// Whether cell c of `a` overlaps a cell at v of `b`.
template <int Dim>
bool fraction_volume(const Mesh<Dim>& a, CellId c, const Mesh<Dim>& b, VertexId v) {
  OverlapIntegrals<Dim> integrals;
  return std::ranges::any_of(b.cells_of(v), [&](CellId d) {
    return integrate_overlap<Dim>(Simplex<Dim>(corners_of(a, c)), Simplex<Dim>(corners_of(b, d)), integrals) &&
           integrals.volume() > 1e-9 * std::min(a.volume(c), b.volume(d));
  });
}

template <int Dim>
void check_interpolation() {
  int new_ones = 0;
  for (unsigned seed = 0; seed < kMeshes; ++seed) {
    std::mt19937 random(seed);
    const Mesh<Dim> before = cracked<Dim>(random);
    Mesh<Dim> mesh = before;
    const MeshRenumbering renumbering = changed_at_random(mesh, 60, random);
    const MeshChange<Dim> change = describe_change(before, mesh, renumbering);
    for (VertexId v = 0; v < mesh.node_slots(); ++v) {
      if (!mesh.is_boundary(v)) continue;
      std::vector<int> parents;
      for (typename Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(change.interpolation, v); it; ++it)
        parents.push_back(static_cast<int>(it.col()));
      if (parents.size() > 1) ++new_ones;
      const auto around = before.cells_of(parents[0]);
      const bool is_of_body = std::ranges::any_of(around, [&](CellId c) {
        const auto& cell = before.cell(c);
        return std::ranges::all_of(parents, [&](int p) { return std::ranges::count(cell, p); }) &&
               fraction_volume(before, c, mesh, v);
      });
      ASSERT_TRUE(is_of_body) << "seed " << seed << ", vertex " << v << " at " << mesh.rest(v).transpose();
    }
    for (FacetId f = 0; f < mesh.facet_slots(); ++f) {
      const FacetId parent = change.facet_parent[f];
      ASSERT_NE(parent, kNone);
      const auto normal = [](const Mesh<Dim>& of, FacetId g) {
        std::array<Vec<Dim>, Dim> p;
        for (int k = 0; k < Dim; ++k) p[k] = of.rest(of.facet(g)[k]);
        return inward_normal(p).normalized();
      };
      ASSERT_GT(normal(mesh, f).dot(normal(before, parent)), 0.9) << "seed " << seed << ", facet " << f;
    }
  }
  EXPECT_GT(new_ones, 5 * kMeshes);
}
TEST(Cracks, NewVerticesAndFacetsComeFromTheirBody2D) { check_interpolation<2>(); }
TEST(Cracks, NewVerticesAndFacetsComeFromTheirBody3D) { check_interpolation<3>(); }

/// Forces stay where they are when the mesh changes: on vertices that stay, they are what was asked.
template <int Dim>
void check_forces() {
  for (unsigned seed = 0; seed < kMeshes; ++seed) {
    std::mt19937 random(seed);
    const Mesh<Dim> before = cracked<Dim>(random);
    Mesh<Dim> mesh = before;
    const MeshRenumbering renumbering = changed_at_random(mesh, 60, random);
    for (VertexId v = 0; v < before.node_slots(); ++v) {
      if (!before.is_boundary(v)) continue;
      VectorX asked = VectorX::Zero(Dim * before.node_slots());
      asked.segment<Dim>(Dim * v) = Vec<Dim>::Ones();
      const CellSet<Dim> cells = whole_mesh<Dim>(mesh, {});
      const auto term = point_forces<Dim>(before, asked)(cells, 0, 1);
      ASSERT_TRUE(term) << "seed " << seed << ", vertex " << v;
      VectorX gradient = VectorX::Zero(Dim * mesh.node_slots());
      Workspace workspace;
      term->add_gradient(gradient, gradient, workspace);
      double sum = 0;
      Vec<Dim> moment = Vec<Dim>::Zero();
      bool has_any = false;
      for (VertexId w = 0; w < mesh.node_slots(); ++w) {
        const double fraction = -gradient[Dim * w];
        if (fraction == 0) continue;
        sum += fraction;
        moment += fraction * mesh.rest(w);
        has_any = has_any ||
                  std::ranges::any_of(before.cells_of(v), [&](CellId c) { return fraction_volume(before, c, mesh, w); });
      }
      ASSERT_NEAR(sum, 1, 1e-12);
      ASSERT_LT((moment - before.rest(v)).norm(), 1e-9);
      ASSERT_TRUE(has_any) << "seed " << seed << ", vertex " << v;
      if (const VertexId now = renumbering.vertex[v]; now != kNone && mesh.rest(now) == before.rest(v)) {
        ASSERT_NEAR(-gradient[Dim * now], 1, 1e-12) << "seed " << seed << ", vertex " << v;
      }
    }
  }
}
TEST(Cracks, ForcesStayOnTheirBody2D) { check_forces<2>(); }
TEST(Cracks, ForcesStayOnTheirBody3D) { check_forces<3>(); }

/// The facets of cracks: those whose place another one has, too.
template <int Dim>
std::vector<FacetId> crack_facets(const Mesh<Dim>& mesh) {
  const auto place = [&](FacetId f) {
    std::array<std::array<double, Dim>, Dim> corners;
    for (int k = 0; k < Dim; ++k)
      for (int c = 0; c < Dim; ++c) corners[k][c] = mesh.rest(mesh.facet(f)[k])[c];
    std::ranges::sort(corners);
    return corners;
  };
  std::map<std::array<std::array<double, Dim>, Dim>, std::vector<FacetId>> at;
  for (FacetId f = 0; f < mesh.facet_slots(); ++f) at[place(f)].push_back(f);
  std::vector<FacetId> found;
  for (const auto& [corners, facets] : at)
    if (facets.size() > 1) found.insert(found.end(), facets.begin(), facets.end());
  return found;
}

/// A unit square or cube with a plane crack of random depth from one side.
template <int Dim>
Mesh<Dim> with_plane_crack(std::mt19937& random) {
  const auto whole = [&] {
    if constexpr (Dim == 2)
      return random_mesh(6, random);
    else
      return make_cubes(4, unit_grid(4), [](int, int, int) { return 1; });
  }();
  const double depth = std::uniform_real_distribution<double>(0.4, 0.8)(random);
  std::set<typename MeshTypes<Dim>::Facet> crack;
  for (const auto& facet : inner_facets(whole))
    if (std::ranges::all_of(facet, [&](int v) { return whole.rest(v)[0] == 0.5 && whole.rest(v)[1] <= depth; }))
      crack.insert(facet);
  return cut(whole, crack);
}

/// Tractions that press the faces of cracks into their own bodies, and so the cracks open, by `factor(t)`.
template <int Dim>
itr::Setup<Dim> opened_cracks(Mesh<Dim> mesh, const std::function<double(double)>& factor) {
  itr::Setup<Dim> setup;
  setup.mesh = std::move(mesh);
  for (FacetId f = 0; f < setup.mesh.facet_slots(); ++f) setup.mesh.set_facet_tag(f, kNoTag);
  VectorX inward = VectorX::Zero(Dim * setup.mesh.num_vertices());
  for (const FacetId f : crack_facets(setup.mesh)) {
    setup.mesh.set_facet_tag(f, 1);
    std::array<Vec<Dim>, Dim> p;
    for (int k = 0; k < Dim; ++k) p[k] = setup.mesh.rest(setup.mesh.facet(f)[k]);
    for (const int v : setup.mesh.facet(f)) inward.segment<Dim>(Dim * v) += inward_normal(p).normalized();
  }
  for (const int body : {1, 2, 3}) setup.materials[body] = {.youngs_modulus = 1e5, .poisson_ratio = 0.3, .density = 1000};
  setup.neumann = {{1, [f = as_function<Dim>(setup.mesh, inward), factor](const RestPoint<Dim>& X, double t) {
                      return Vec<Dim>(factor(t) * f(X, t));
                    }}};
  setup.time.dt = 0.02;
  setup.time.steps = 6;
  setup.time.integrator = Integrator::implicit_euler;
  setup.newton.step_tolerance = 1e-9;
  setup.contact.enabled = true;
  return setup;
}

/// Whether anything is violated now or in the history.
template <int Dim>
std::string violation_of(const Simulation<Dim>& simulation) {
  const State<Dim>& state = simulation.state();
  std::string found;
  for (int age = 0; age < static_cast<int>(state.history.x.size()) && found.empty(); ++age)
    found = find_violation<Dim>(simulation.setup(), state.mesh, state.history.x[age], state.chords, age);
  return found;
}

/// Cracks that open by less than d-hat are no contact: all is as without it.
template <int Dim>
void check_small_openings() {
  linear::Registry registry;
  for (unsigned seed = 0; seed < kMeshes; ++seed) {
    std::mt19937 random(seed);
    itr::Setup<Dim> setup = opened_cracks<Dim>(cracked<Dim>(random), [](double) { return 1.0; });
    for (const int body : {1, 2, 3}) setup.order[body] = seed % 3 == 0 ? 2 : 1;
    Simulation<Dim> with(setup, registry);
    setup.contact.enabled = false;
    Simulation<Dim> without(setup, registry);
    ASSERT_TRUE(with.state().mesh.steps_apart(with.state().mesh.facet(crack_facets(with.state().mesh)[0])[0]) == 0);
    const VectorX rest = without.state().history.x[0];
    for (int step = 0; step < 3; ++step) {
      const StepResult result = with.advance();
      ASSERT_TRUE(result.ok) << "seed " << seed << ": " << result.reason;
      ASSERT_TRUE(without.advance().ok);
      ASSERT_EQ(violation_of(with), "") << "seed " << seed;
      ASSERT_EQ(result.report.energy.contact, 0);
    }
    const VectorX &x = with.state().history.x[0], &y = without.state().history.x[0];
    EXPECT_LT((x - y).norm(), 1e-6 * (y - rest).norm()) << "seed " << seed;
    EXPECT_GT((y - rest).norm(), 0);
  }
}
TEST(Cracks, AreNoContactWhereTheyOpenALittle2D) { check_small_openings<2>(); }
TEST(Cracks, AreNoContactWhereTheyOpenALittle3D) { check_small_openings<3>(); }

template <int Dim>
State<Dim> written_and_read(const Simulation<Dim>& simulation) {
  const std::filesystem::path path = temporary_path(".h5");
  simulation.observe([&](const FrameView<Dim>& frame) {
    output::write_frame(path, frame, simulation.state().step, simulation.state().t, {}, [&](hdf5::File& file) {
      output::write_checkpoint(file, simulation.state(), {"{}", "eigen", "{}", 0});
    });
  });
  const auto read = output::read_checkpoint<Dim>({path, "{}", "eigen", Dim});
  std::filesystem::remove(path);
  return *read.state;
}

/// Cracks open far, and are pressed together then. Parts of cracks that are not plane close at once.
/// Whatever happens, no step leaves a violation, steps that fail say why, and steps from a saved state have the same bits.
template <int Dim>
void check_far_openings(bool remeshed) {
  linear::Registry registry;
  const unsigned meshes = remeshed ? 3 : kMeshes;
  int opened = 0, changed = 0;
  for (unsigned seed = 0; seed < meshes; ++seed) {
    std::mt19937 random(seed + 100);
    const bool is_plane = seed % 3 != 0;
    itr::Setup<Dim> setup = opened_cracks<Dim>(is_plane ? with_plane_crack<Dim>(random) : cracked<Dim>(random),
                                               [](double t) { return t < 0.07 ? 3e3 : -8e2; });
    setup.remesh.enabled = remeshed;
    setup.time.integrator = seed % 2 ? Integrator::bdf : Integrator::implicit_euler;
    setup.time.bdf_order = seed % 2 ? 2 : 1;
    setup.time.steps = 10;
    Simulation<Dim> simulation(setup, registry);
    std::optional<State<Dim>> saved;
    std::vector<VectorX> after;
    for (int step = 0; step < setup.time.steps; ++step) {
      if (step == 3) saved = written_and_read(simulation);
      const StepResult result = simulation.advance();
      ASSERT_EQ(violation_of(simulation), "") << "seed " << seed << ", step " << step;
      if (!result.ok) {
        EXPECT_NE(result.reason.find("faces that coincide at rest are pressed into each other"), std::string::npos)
            << "seed " << seed << ": " << result.reason;
        EXPECT_TRUE(!is_plane || step > 2) << "seed " << seed << ", step " << step;
        break;
      }
      changed += !result.renumbering.empty();
      if (saved) after.push_back(simulation.state().history.x[0]);
    }
    const Mesh<Dim>& mesh = simulation.state().mesh;
    for (VertexId v = 0; v < mesh.num_vertices(); ++v) opened += mesh.steps_apart(v) > 0 && mesh.steps_apart(v) != kApart;
    if (!saved) continue;
    Simulation<Dim> resumed(setup, registry);
    resumed.restore(*saved);
    for (const VectorX& x : after) {
      ASSERT_TRUE(resumed.advance().ok);
      ASSERT_EQ(resumed.state().history.x[0], x) << "seed " << seed;
    }
  }
  EXPECT_GT(opened, 0);
  if (remeshed) {
    EXPECT_GT(changed, 0);
  }
}
TEST(Cracks, StayValidWhereTheyOpenFar2D) { check_far_openings<2>(false); }
TEST(Cracks, StayValidWhereTheyOpenFar3D) { check_far_openings<3>(false); }
TEST(Cracks, StayValidWhereTheyOpenFarRemeshed2D) { check_far_openings<2>(true); }

/// The least distance along x of vertices of a plane crack that coincide at rest [m]; negative: its faces overlap.
template <int Dim>
double least_opening(const State<Dim>& state) {
  const Mesh<Dim>& mesh = state.mesh;
  const auto is_left = [&](VertexId v) {
    return std::ranges::any_of(mesh.cell(mesh.cells_of(v)[0]),
                               [&](VertexId w) { return mesh.rest(w)[0] < mesh.rest(v)[0]; });
  };
  double least = std::numeric_limits<double>::infinity();
  for (VertexId v = 0; v < mesh.num_vertices(); ++v)
    for (VertexId w = 0; w < mesh.num_vertices(); ++w)
      if (v != w && mesh.rest(v) == mesh.rest(w) && is_left(v) && !is_left(w))
        least = std::min(least, state.history.x[0][Dim * w] - state.history.x[0][Dim * v]);
  return least;
}

/// A body with a plane crack, whose sides are pulled apart and pressed together then, farther than the crack is open.
template <int Dim>
void check_closing(bool remeshed) {
  linear::Registry registry;
  for (unsigned seed = 0; seed < (remeshed || Dim == 3 ? 3 : 6); ++seed) {
    std::mt19937 random(seed);
    itr::Setup<Dim> setup = opened_cracks<Dim>(with_plane_crack<Dim>(random), {});
    setup.neumann.clear();
    std::array<bool, Dim> all;
    all.fill(true);
    for (const int side : {0, 1}) {
      for (FacetId f = 0; f < setup.mesh.facet_slots(); ++f)
        if (std::ranges::all_of(setup.mesh.facet(f), [&](VertexId v) { return setup.mesh.rest(v)[0] == side; }))
          setup.mesh.set_facet_tag(f, 2 + side);
      setup.dirichlet.push_back({2 + side, all, [side](const RestPoint<Dim>&, double t) {
                                   return Vec<Dim>((2 * side - 1) * (t < 4.5 ? 0.01 * t : 0.01 * (8 - t)) *
                                                   Vec<Dim>::UnitX());
                                 }});
    }
    setup.time = {.quasistatic = true, .dt = 1, .steps = 12};
    setup.contact.dhat = 1e-3;
    setup.remesh.enabled = remeshed;
    Simulation<Dim> with(setup, registry);
    setup.contact.enabled = false;
    Simulation<Dim> without(setup, registry);
    StepResult result;
    double widest = 0;
    for (int step = 0; step < setup.time.steps; ++step) {
      result = with.advance();
      ASSERT_TRUE(result.ok) << "seed " << seed << ", step " << step << ": " << result.reason;
      ASSERT_TRUE(without.advance().ok);
      ASSERT_EQ(violation_of(with), "") << "seed " << seed << ", step " << step;
      ASSERT_GT(least_opening(with.state()), 0) << "seed " << seed << ", step " << step;
      widest = std::max(widest, least_opening(with.state()));
    }
    EXPECT_GT(widest, 3 * setup.contact.dhat);
    EXPECT_LT(least_opening(without.state()), -3 * setup.contact.dhat);
    EXPECT_LT(least_opening(with.state()), setup.contact.dhat);
    EXPECT_GT(result.report.energy.contact, 0);
  }
}
TEST(Cracks, AreInContactWhereTheyCloseAgain2D) { check_closing<2>(false); }
TEST(Cracks, AreInContactWhereTheyCloseAgain3D) { check_closing<3>(false); }
TEST(Cracks, AreInContactWhereTheyCloseAgainRemeshed2D) { check_closing<2>(true); }

/// A square over a wider body, which is held below; `gap`: between them [m].
itr::Setup<2> two_squares(double gap, double acceleration) {
  itr::Setup<2> setup;
  setup.mesh = Mesh<2>({{0, 0}, {3, 0}, {3, 1}, {0, 1}, {1, 1 + gap}, {2, 1 + gap}, {2, 2}, {1, 2}},
                       {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}}, {1, 1, 2, 2});
  setup.mesh.set_facet_tag(setup.mesh.find_facet({0, 1}), 1);
  setup.dirichlet = {{1, {true, true}, [](const RestPoint<2>&, double) { return Vec<2>(Vec<2>::Zero()); }}};
  for (const int body : {1, 2}) setup.materials[body] = {.youngs_modulus = 1e5, .poisson_ratio = 0.3, .density = 1000};
  setup.body_acceleration = [acceleration](const RestPoint<2>&, double) { return Vec<2>(0, acceleration); };
  setup.time.dt = 0.02;
  setup.time.steps = 20;
  setup.time.integrator = Integrator::implicit_euler;
  setup.contact.enabled = true;
  setup.contact.dhat = 1e-3;
  return setup;
}

TEST(BodiesThatTouch, PartWhereTheyArePulledApart) {
  linear::Registry registry;
  Simulation<2> simulation(two_squares(0, 1), registry);
  for (int step = 0; step < 20; ++step) ASSERT_TRUE(simulation.advance().ok);
  EXPECT_GT(simulation.state().history.x[0][2 * 4 + 1], 1.05);
  EXPECT_GT(simulation.state().mesh.steps_apart(4), 0);
  EXPECT_EQ(violation_of(simulation), "");
}

TEST(BodiesThatTouch, AreInContactOnceTheyHaveParted) {
  linear::Registry registry;
  itr::Setup<2> setup = two_squares(0, 0);
  setup.body_acceleration = [](const RestPoint<2>&, double t) { return Vec<2>(0, t < 0.2 ? 2 : -4); };
  setup.time.steps = 40;
  Simulation<2> simulation(setup, registry);
  double most = 0, lowest = 1;
  for (int step = 0; step < 40; ++step) {
    const StepResult result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    ASSERT_EQ(violation_of(simulation), "");
    most = std::max(most, result.report.energy.contact);
    lowest = std::min(lowest, simulation.state().history.x[0][2 * 4 + 1]);
  }
  EXPECT_GT(most, 0);
  EXPECT_GT(lowest, 0.9);  // the square comes down on the body, and stays on it
  EXPECT_LT(simulation.state().history.x[0][2 * 4 + 1], 1.01);
}

TEST(BodiesThatTouch, NeedAGapWhereTheyArePressedTogether) {
  linear::Registry registry;
  std::vector<std::string> warnings;
  const Logger logger([&](LogLevel level, std::string_view text) {
    if (level == LogLevel::warning) warnings.emplace_back(text);
  });
  Simulation<2> simulation(two_squares(0, -1), registry, logger);
  StepResult result;
  for (int step = 0; step < 20 && result.ok; ++step) {
    result = simulation.advance();
    ASSERT_EQ(violation_of(simulation), "");
  }
  EXPECT_FALSE(result.ok);
  EXPECT_NE(result.reason.find("leave a gap between them"), std::string::npos) << result.reason;
  EXPECT_EQ(std::ranges::count_if(warnings,
                                  [](const std::string& text) {
                                    return text.find("begin to be pressed into each other") != std::string::npos;
                                  }),
            1);
  Simulation<2> apart(two_squares(1e-3, -1), registry);
  for (int step = 0; step < 20; ++step) ASSERT_TRUE(apart.advance().ok);
}

/// Two squares of one body id that lie on each other: parts that share no vertex.
TEST(Cracks, PartsThatOverlapAreToldApart) {
  std::mt19937 random(1);
  const Mesh<2> one = random_mesh(3, random);
  std::vector<Vec<2>> rest;
  std::vector<Mesh<2>::Cell> cells;
  for (int copy = 0; copy < 2; ++copy) {
    const int first = static_cast<int>(rest.size());
    for (VertexId v = 0; v < one.node_slots(); ++v) rest.push_back(one.rest(v));
    for (CellId c = 0; c < one.cell_slots(); ++c) {
      cells.push_back(one.cell(c));
      for (int& v : cells.back()) v += first;
    }
  }
  const std::vector<int> bodies(cells.size(), 1);
  const Mesh<2> before(rest, cells, bodies);
  const VectorX values = scattered(2 * before.node_slots(), random);
  const auto f = as_function<2>(before, values);
  for (VertexId v = 0; v < before.node_slots(); ++v) EXPECT_EQ(f(before.point(v), 0), values.segment<2>(2 * v));
  Mesh<2> mesh = before;
  const MeshRenumbering renumbering = changed_at_random(mesh, 40, random);
  const MeshChange<2> change = describe_change(before, mesh, renumbering);
  for (VertexId v = 0; v < mesh.node_slots(); ++v)
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(change.interpolation, v); it; ++it)
      EXPECT_EQ(before.part_of_vertex(static_cast<int>(it.col())), mesh.part_of_vertex(v));
  for (FacetId g = 0; g < mesh.facet_slots(); ++g)
    EXPECT_EQ(before.part_of_vertex(before.facet(change.facet_parent[g])[0]), mesh.part_of_vertex(mesh.facet(g)[0]));
}

}  // namespace
}  // namespace itr
