// SPDX-License-Identifier: MIT
// Operations on meshes with curved edges: splits and curves keep every field as the function that it was, other operations
// interpolate it and are charged for what they forget, projections keep momentum, and cells become straight.
#include <gtest/gtest.h>

#include <map>
#include <numeric>
#include <set>

#include "curved_scene.hpp"
#include "curved_trial.hpp"
#include "geometry/intersection.hpp"
#include "itr/transfer.hpp"
#include "remesh/decide/queries.hpp"
#include "remesh/remesher.hpp"
#include "remesh_options.hpp"

namespace itr {
namespace {

template <typename T>
class Curved : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Curved, Dimensions);

TYPED_TEST(Curved, SplitsAndCurvesKeepEveryFunction) {
  constexpr int Dim = TypeParam::value;
  int curves = 0, splits = 0;
  for (unsigned seed = 0; seed < 30; ++seed) {
    CurvedScene<Dim> scene(seed, 0.1 * (seed % 11));
    for (int i = 0; i < (Dim == 2 ? 40 : 25); ++i) {
      const EdgeKey edge = scene.edge();
      if (scene.random() % 3 == 0 && scene.mesh.node_of(edge[0], edge[1]) == kNone) {
        scene.apply(make_curve(scene.mesh, edge));
        ++curves;
      } else if (const auto proposal = propose_split(scene.mesh, edge)) {
        scene.apply(*proposal.edit);
        ++splits;
      }
      if (this->HasFatalFailure()) return;
    }
    EXPECT_LT(scene.largest_change(), 1e-13) << "seed " << seed;
  }
  EXPECT_GT(curves, 100);
  EXPECT_GT(splits, 300);
}

/// A field of which both spaces hold the function keeps its values: affine ones always, quadratic ones where all edges are
/// curved, which they then stay.
TYPED_TEST(Curved, EveryOperationKeepsTheFunctionsOfBothSpaces) {
  constexpr int Dim = TypeParam::value;
  std::map<typename Edit<Dim>::Kind, int> done;
  for (unsigned seed = 0; seed < 40; ++seed) {
    const bool is_quadratic = seed % 2;
    CurvedScene<Dim> scene(seed, is_quadratic ? 1 : 0.4);
    Mat<Dim> slope = Mat<Dim>::Random(),
             curvature = is_quadratic ? Mat<Dim>(Mat<Dim>::Random()) : Mat<Dim>(Mat<Dim>::Zero());
    scene.fields.for_each([&](VectorX& field) {
      for (int v = 0; v < scene.mesh.node_slots(); ++v) {
        const Vec<Dim>& X = scene.mesh.rest(v);
        field.template segment<Dim>(Dim * v) = slope * X + curvature * (X[0] * X);
      }
    });
    scene.probes.clear();
    for (CellId c = 0; c < scene.mesh.cell_slots(); ++c) scene.add_probe(c);
    for (int i = 0; i < 60; ++i) {
      const auto proposal = propose_any(scene);
      if (!proposal) continue;
      const auto kind = proposal.edit->kind;
      if (is_quadratic && (kind == Edit<Dim>::Kind::straighten || kind == Edit<Dim>::Kind::chords)) continue;
      scene.apply(*proposal.edit);
      if (this->HasFatalFailure()) return;
      ++done[proposal.edit->kind];
    }
    EXPECT_LT(scene.largest_change(), 1e-12) << "seed " << seed;
    if (!is_quadratic) continue;
    for (const EdgeKey& edge : scene.mesh.edges()) EXPECT_NE(scene.mesh.node_of(edge[0], edge[1]), kNone) << "seed " << seed;
  }
  for (const auto kind : {Edit<Dim>::Kind::split, Edit<Dim>::Kind::collapse, Edit<Dim>::Kind::swap, Edit<Dim>::Kind::smooth})
    EXPECT_GT(done[kind], 30) << static_cast<int>(kind);
}

/// Nodes that an edit sets have the values of the old functions there. Edges that stay where they are keep their nodes, and
/// all other fields their bits.
TYPED_TEST(Curved, OperationsInterpolateWhereTheyChangeNodes) {
  constexpr int Dim = TypeParam::value;
  int nodes = 0, kept = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    CurvedScene<Dim> scene(seed, 0.5);
    for (int i = 0; i < 40; ++i) {
      const auto proposal = propose_any(scene);
      if (!proposal) continue;
      const Edit<Dim>& edit = *proposal.edit;
      const Mesh<Dim> old = scene.mesh;
      const VectorX before = scene.fields.x;
      std::vector<EdgeKey> set = edit.removed_nodes;
      for (const auto& node : edit.inserted_nodes) set.push_back(node.edge);
      scene.apply(edit);
      if (this->HasFatalFailure()) return;
      const VectorX& after = scene.fields.x;
      const int first_node = scene.mesh.node_slots() - static_cast<int>(edit.inserted_nodes.size());
      for (int v = first_node; v < scene.mesh.node_slots(); ++v) {
        double deepest = -1;
        Vec<Dim> value = Vec<Dim>::Zero();
        for (const CellId c : edit.removed_cells) {
          const Vec<Dim> w = old.inverse_rest_edges(c) * (scene.mesh.rest(v) - old.rest(old.cell(c)[0]));
          if (std::min(w.minCoeff(), 1 - w.sum()) <= deepest) continue;
          deepest = std::min(w.minCoeff(), 1 - w.sum());
          std::array<double, Dim + 1> l{1 - w.sum()};
          for (int k = 0; k < Dim; ++k) l[k + 1] = w[k];
          value = value_at<Dim>(old, before, c, l);
        }
        EXPECT_GT(deepest, -1e-12);
        EXPECT_LT((after.template segment<Dim>(Dim * v) - value).norm(), 1e-12) << "seed " << seed;
        ++nodes;
      }
      for (const EdgeKey& edge : old.curved_edges()) {
        if (std::find(set.begin(), set.end(), edge) != set.end()) continue;
        const VertexId node = old.node_of(edge);
        ASSERT_EQ(scene.mesh.node_of(edge), node);
        ASSERT_EQ(scene.mesh.rest(node), (scene.mesh.rest(edge[0]) + scene.mesh.rest(edge[1])) / 2);
        ++kept;
      }
      for (VertexId v = 0; v < old.node_slots(); ++v)
        if (!edit.value || v != edit.value->vertex) {
          ASSERT_EQ((after.template segment<Dim>(Dim * v)), (before.template segment<Dim>(Dim * v)));
        }
    }
  }
  EXPECT_GT(nodes, 300);
  EXPECT_GT(kept, 3000);
}

/// An edge at the vertex that stays is curved if one of those that it replaces was.
TYPED_TEST(Curved, CollapsesMergeNodes) {
  constexpr int Dim = TypeParam::value;
  int curved = 0, straight = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    CurvedScene<Dim> scene(seed, 0.3);
    for (int i = 0; i < 12; ++i)
      if (const auto proposal = propose_split(scene.mesh, scene.edge())) scene.apply(*proposal.edit);
    for (int i = 0; i < 20; ++i) {
      const EdgeKey edge = scene.edge();
      if (scene.mesh.is_boundary(edge[0]) || scene.mesh.is_boundary(edge[1])) continue;
      const auto proposal = propose_collapse(scene.mesh, scene.strata, edge);
      if (!proposal || proposal.edit->value->rest == scene.mesh.rest(proposal.edit->value->vertex)) continue;  // onto an end
      const VertexId kept = proposal.edit->value->vertex;
      std::set<VertexId> had;
      for (const EdgeKey& with_node : scene.mesh.curved_edges())
        for (const VertexId end : edge)
          if (with_node[0] == end || with_node[1] == end) had.insert(with_node[0] == end ? with_node[1] : with_node[0]);
      scene.apply(*proposal.edit);
      if (this->HasFatalFailure()) return;
      for (const EdgeKey& near : scene.mesh.edges()) {
        if (near[0] != kept && near[1] != kept) continue;
        const bool is_curved = scene.mesh.node_of(near[0], near[1]) != kNone;
        EXPECT_EQ(is_curved, had.contains(near[0] == kept ? near[1] : near[0])) << "seed " << seed;
        ++(is_curved ? curved : straight);
      }
    }
  }
  EXPECT_GT(curved, 20);
  EXPECT_GT(straight, 20);
}

TYPED_TEST(Curved, NodesOfASplitAreCounted) {
  constexpr int Dim = TypeParam::value;
  for (unsigned seed = 0; seed < 20; ++seed) {
    CurvedScene<Dim> scene(seed, 0.1 * (seed % 11));
    for (const EdgeKey& edge : scene.mesh.edges()) {
      const Edit<Dim> edit = make_split(scene.mesh, edge);
      EXPECT_EQ(nodes_of_split(scene.mesh, edge),
                1 + static_cast<int>(edit.inserted_nodes.size()) - static_cast<int>(edit.removed_nodes.size()));
    }
  }
}

/// The least det F that a field has in a cell, and the least of its means over cells.
template <int Dim>
std::pair<double, double> least_jacobians(const CurvedScene<Dim>& scene, const VectorX& field) {
  double least = 1e9, least_mean = 1e9;
  for (CellId c = 0; c < scene.mesh.cell_slots(); ++c) {
    if (!scene.mesh.is_cell_alive(c)) continue;
    const auto nodes =
        curved_cell<Dim>(scene.mesh.cell(c), [&](VertexId a, VertexId b) { return scene.mesh.node_of(a, b); });
    const QuadraticCell<Dim> values = nodes.values(field, kNoEdit<Dim>);
    const double rest = scene.mesh.inverse_rest_edges(c).determinant();
    least = std::min(least, min_jacobian_bound<Dim>(values, 0.01) * rest);
    least_mean = std::min(least_mean, mean_jacobian<Dim>(values) * rest);
  }
  return {least, least_mean};
}

/// A step is taken again from what that leaves, so no cell may come near to inversion.
TYPED_TEST(Curved, CellsAreStraightenedWithoutCompressingThem) {
  constexpr int Dim = TypeParam::value;
  int compared = 0, nodes_before = 0, nodes_after = 0;
  for (unsigned seed = 0; seed < 300; ++seed) {
    CurvedScene<Dim> scene(seed, 0.6, Dim == 2 ? 0.08 : 0.03);
    scene.fields.past_positions[0] = scene.fields.x;
    const auto [least, least_mean] = least_jacobians<Dim>(scene, scene.fields.x);
    if (least <= 0) continue;
    RemeshOptions options;
    options.split.min_edge_length = 0;
    RemeshMemory memory;
    std::vector<CellId> all(scene.mesh.cell_slots());
    std::iota(all.begin(), all.end(), 0);
    nodes_before += scene.mesh.num_curved();
    const RemeshReport report =
        straighten_cells<Dim>(all, 0.2, scene.mesh, scene.fields, context_of<Dim>(seed), options, memory, scene.strata);
    nodes_after += scene.mesh.num_curved();
    EXPECT_GT(least_jacobians<Dim>(scene, scene.fields.x).first, 0.05 * least_mean) << "seed " << seed;
    EXPECT_TRUE(report.coarsened());
    ++compared;
  }
  EXPECT_GT(compared, 20);
  EXPECT_LT(nodes_after, nodes_before / 10) << nodes_before;
}

/// A refusal of long ago, when the edge's cells were as they should be, does not keep them distorted.
TYPED_TEST(Curved, RefusalsDoNotKeepCellsDistorted) {
  constexpr int Dim = TypeParam::value;
  int distorted = 0, straightened = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    CurvedScene<Dim> scene(seed, 0, 0);
    EdgeKey edge = scene.edge();
    while (!scene.mesh.facets_of_edge(edge).empty()) edge = scene.edge();
    scene.apply(make_curve(scene.mesh, edge));
    const VertexId node = scene.mesh.node_of(edge[0], edge[1]);
    const double length = (scene.mesh.rest(edge[0]) - scene.mesh.rest(edge[1])).norm();
    scene.fields.x.template segment<Dim>(Dim * node) +=
        0.22 * length * (scene.mesh.rest(edge[1]) - scene.mesh.rest(edge[0])).normalized();
    StepContext<Dim> context = context_of<Dim>(0);
    context.has_inertia = false;
    context.loads = {};
    context.shortest_edge = 1e-9;
    RemeshOptions options;
    options.split.enabled = options.collapse.enabled = false;
    options.straighten.enabled = true;
    options.split.acceptance_tolerance = 1;  // also what distorted cells may cost
    options.split.min_edge_length = 0;
    options.collapse.acceptance_tolerance = options.straighten.acceptance_tolerance = -1e-12;
    const Gate<Dim> gate(scene.mesh, scene.fields, context);
    const RemeshQueries<Dim> queries(scene.mesh, scene.fields, context, options, scene.strata, gate, nullptr, nullptr);
    if (!queries.is_distorted(scene.mesh.cells_of_edge(edge))) continue;
    ++distorted;
    RemeshMemory memory;
    memory.refusals = {{Candidate(OperationKind::straighten, edge), {0, 1e9, false}}};
    straightened += remesh<Dim>(scene.mesh, scene.fields, context, options, memory, scene.strata).straightens.accepted;
  }
  EXPECT_GT(distorted, 5);
  EXPECT_EQ(straightened, distorted);
}

/// 1/2 the integral of rho |a - b|^2, cells of both meshes cut by each other.
template <int Dim>
double squared_distance(const Mesh<Dim>& mesh_a, const VectorX& a, const Mesh<Dim>& mesh_b, const VectorX& b,
                        const std::map<int, Material>& materials) {
  const auto simplex = [](const Mesh<Dim>& mesh, CellId c) {
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = mesh.rest(mesh.cell(c)[k]);
    return Simplex<Dim>(p);
  };
  double sum = 0;
  std::vector<OverlapPiece<Dim>> pieces;
  for (CellId i = 0; i < mesh_a.cell_slots(); ++i)
    for (CellId j = 0; j < mesh_b.cell_slots(); ++j) {
      if (!mesh_a.is_cell_alive(i) || !mesh_b.is_cell_alive(j) || mesh_a.body(i) != mesh_b.body(j)) continue;
      list_overlap(simplex(mesh_a, i), simplex(mesh_b, j), pieces);
      for (const auto& piece : pieces)
        for (const auto& point : quadrature<Dim>(kMassDegree)) {
          std::array<double, Dim + 1> in_a{}, in_b{};
          for (int k = 0; k <= Dim; ++k)
            for (int m = 0; m <= Dim; ++m) {
              in_a[m] += point.weights[k] * piece.in_a[k][m];
              in_b[m] += point.weights[k] * piece.in_b[k][m];
            }
          sum += 0.5 * materials.at(mesh_a.body(i)).density * point.fraction * piece.volume *
                 (value_at<Dim>(mesh_a, a, i, in_a) - value_at<Dim>(mesh_b, b, j, in_b)).squaredNorm();
        }
    }
  return sum;
}

/// With the function as history, inertia after an edit is the distance of the new positions from the predictor as the
/// function that it was.
TYPED_TEST(Curved, EveryOperationIsChargedForWhatItForgets) {
  constexpr int Dim = TypeParam::value;
  std::map<typename Edit<Dim>::Kind, int> compared;
  for (unsigned seed = 0; seed < 300; ++seed) {
    CurvedScene<Dim> scene(seed, 0.4, 0.001);
    StepContext<Dim> context;
    context.materials = context_of<Dim>(seed).materials;
    context.scaling = 0;
    context.has_inertia = true;
    context.obstacles.past_x.resize(1);
    const VectorX old_predictor = scene.fields.predictor, old_x = scene.fields.x;
    auto proposal = propose_any(scene);
    while (!proposal) proposal = propose_any(scene);
    const View<Dim> view(scene, context);
    LocalScratch<Dim> scratch;
    std::vector<CellId> all(scene.mesh.cell_slots());
    std::iota(all.begin(), all.end(), 0);
    const double value = LocalProblem<Dim>(view.state, all, *proposal.edit, true, scratch).value();
    const Mesh<Dim> old = scene.mesh;
    scene.apply(*proposal.edit);
    const double distance = squared_distance<Dim>(old, old_predictor, scene.mesh, scene.fields.x, context.materials);
    EXPECT_NEAR(value, distance, 1e-10 * distance) << "seed " << seed << ", kind " << static_cast<int>(proposal.edit->kind);
    ++compared[proposal.edit->kind];
  }
  for (const auto kind :
       {Edit<Dim>::Kind::collapse, Edit<Dim>::Kind::straighten, Edit<Dim>::Kind::swap, Edit<Dim>::Kind::smooth})
    EXPECT_GT(compared[kind], 15) << static_cast<int>(kind);
}

/// The alive part of a mesh with nodes as arrays.
template <int Dim>
struct Arrays {
  std::vector<Vec<Dim>> rest;
  std::vector<std::array<int, Dim + 1>> vertices;
  std::vector<double> density;
  std::vector<std::array<int, kQuadraticNodes<Dim>>> nodes;
  std::vector<CurvedEdges> curved;
  std::vector<VertexId> slots;  ///< by row
  std::vector<int> place;       ///< by cell slot

  Arrays(const Mesh<Dim>& mesh, const std::map<int, Material>& materials) : place(mesh.cell_slots(), kNone) {
    std::map<VertexId, int> rows;
    for (CellId c = 0; c < mesh.cell_slots(); ++c) {
      if (!mesh.is_cell_alive(c)) continue;
      place[c] = static_cast<int>(vertices.size());
      auto cell = curved_cell<Dim>(mesh.cell(c), [&](VertexId a, VertexId b) { return mesh.node_of(a, b); });
      for (VertexId& v : cell.nodes) {
        const auto [row, is_new] = rows.emplace(v, static_cast<int>(rows.size()));
        if (is_new) slots.push_back(v);
        v = row->second;
      }
      std::copy_n(cell.nodes.begin(), Dim + 1, vertices.emplace_back().begin());
      density.push_back(materials.at(mesh.body(c)).density);
      nodes.push_back(cell.nodes);
      curved.push_back(cell.edges);
    }
    for (const VertexId v : slots) {
      const EdgeKey edge = mesh.edge_of_node(v);
      rest.push_back(edge[0] == kNone ? mesh.rest(v) : Vec<Dim>((mesh.rest(edge[0]) + mesh.rest(edge[1])) / 2));
    }
  }
  TransferMesh<Dim> view() const { return {rest, vertices, density, nodes, curved}; }
  MatrixX rows(const VectorX& field) const {
    MatrixX all(slots.size(), Dim);
    for (std::size_t i = 0; i < slots.size(); ++i) all.row(i) = field.segment<Dim>(Dim * slots[i]).transpose();
    return all;
  }
};

/// The integrals of rho u and rho X u.
template <int Dim>
Eigen::Matrix<double, Dim + 1, Dim> moments(const Mesh<Dim>& mesh, const VectorX& field,
                                            const std::map<int, Material>& materials) {
  Eigen::Matrix<double, Dim + 1, Dim> sum = Eigen::Matrix<double, Dim + 1, Dim>::Zero();
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    if (!mesh.is_cell_alive(c)) continue;
    for (const auto& point : quadrature<Dim>(kMassDegree)) {
      Vec<Dim + 1> one_and_place = Vec<Dim + 1>::Unit(0);
      for (int k = 0; k <= Dim; ++k) one_and_place.template tail<Dim>() += point.weights[k] * mesh.rest(mesh.cell(c)[k]);
      sum += materials.at(mesh.body(c)).density * mesh.volume(c) * point.fraction * one_and_place *
             value_at<Dim>(mesh, field, c, point.weights).transpose();
    }
  }
  return sum;
}

/// Projected after an edit, velocities keep linear and angular momentum, chords' too.
TYPED_TEST(Curved, EveryOperationKeepsMomentum) {
  constexpr int Dim = TypeParam::value;
  using Kind = typename Edit<Dim>::Kind;
  std::map<Kind, int> done;
  double lost_by_interpolation = 0;
  for (unsigned seed = 0; seed < 300; ++seed) {
    CurvedScene<Dim> scene(seed, 0.5, 0.001);
    const auto materials = context_of<Dim>(seed).materials;
    auto proposal = propose_any(scene);
    while (!proposal) proposal = propose_any(scene);
    const Mesh<Dim> old = scene.mesh;
    const VectorX old_rates = scene.fields.past_rates[0];
    scene.apply(*proposal.edit);
    const Arrays<Dim> before(old, materials), after(scene.mesh, materials);
    TouchedCells touched;
    for (const CellId c : proposal.edit->removed_cells) touched.old_cells.push_back(before.place[c]);
    for (CellId c = old.cell_slots(); c < scene.mesh.cell_slots(); ++c) touched.new_cells.push_back(after.place[c]);
    VectorX& rates = scene.fields.past_rates[0];
    const auto expected = moments<Dim>(old, old_rates, materials);
    lost_by_interpolation = std::max(lost_by_interpolation, (moments<Dim>(scene.mesh, rates, materials) - expected).norm());
    TransferReport report;
    const MatrixX projected =
        project_l2<Dim>(before.view(), after.view(), touched, before.rows(old_rates), after.rows(rates), {}, report);
    for (std::size_t i = 0; i < after.slots.size(); ++i)
      rates.template segment<Dim>(Dim * after.slots[i]) = projected.row(static_cast<Eigen::Index>(i)).transpose();
    EXPECT_LE((moments<Dim>(scene.mesh, rates, materials) - expected).norm(), 1e-12 * expected.norm()) << "seed " << seed;
    ++done[proposal.edit->kind];
  }
  EXPECT_GT(lost_by_interpolation, 1e-3);
  for (const Kind kind :
       {Kind::split, Kind::curve, Kind::collapse, Kind::straighten, Kind::chords, Kind::swap, Kind::smooth})
    EXPECT_GT(done[kind], 5) << static_cast<int>(kind);
}

}  // namespace
}  // namespace itr
