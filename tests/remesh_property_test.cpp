// SPDX-License-Identifier: MIT
// Properties of edits, trials and transfers on meshes and edits that RapidCheck draws, and shrinks where one fails.
// RC_PARAMS="seed=.. max_success=.." in the environment chooses the cases.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cstring>

#include "core/parallel.hpp"
#include "fem/inverted.hpp"
#include "geometry/measures.hpp"
#include "itr/transfer.hpp"
#include "random_mesh.hpp"
#include "random_terms.hpp"
#include "remesh/decide/patch.hpp"
#include "remesh/remesher.hpp"
#include "remesh_options.hpp"

namespace itr {
namespace {

using Kind = Edit<2>::Kind;

struct EditChoice {
  unsigned kind, which;
};
[[maybe_unused]] std::ostream& operator<<(std::ostream& out, const EditChoice& choice) {
  return out << "{kind " << choice.kind << ", edge " << choice.which << "}";
}

/// Random edits of kinds [first, last).
std::vector<EditChoice> draw_edits(unsigned first, unsigned last) {
  return *rc::gen::container<std::vector<EditChoice>>(
      rc::gen::construct<EditChoice>(rc::gen::inRange(first, last), rc::gen::noShrink(rc::gen::inRange(0u, 1000000u))));
}

Mesh<2> draw_mesh() {
  std::mt19937 random(*rc::gen::noShrink(rc::gen::inRange(0u, 1000000u)));
  return random_mesh(2 * *rc::gen::inRange(1, 5), random);  // even: the interface is a straight line of vertices
}

bool same_bits(const VectorX& a, const VectorX& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), sizeof(double) * a.size()) == 0;
}

bool same_fields(RemeshFields<2> a, RemeshFields<2> b) {
  std::vector<VectorX> values;
  a.for_each([&](const VectorX& field) { values.push_back(field); });
  std::size_t i = 0;
  bool same = true;
  b.for_each([&](const VectorX& field) { same = i < values.size() && same_bits(values[i++], field) && same; });
  return same && i == values.size();
}

/// Slot by slot, dead ones and adjacency included.
bool same_mesh(const Mesh<2>& a, const Mesh<2>& b) {
  if (a.node_slots() != b.node_slots() || a.cell_slots() != b.cell_slots() || a.facet_slots() != b.facet_slots())
    return false;
  for (int v = 0; v < a.node_slots(); ++v)
    if (a.is_vertex_alive(v) != b.is_vertex_alive(v) || a.rest(v) != b.rest(v) ||
        !std::ranges::equal(a.cells_of(v), b.cells_of(v)) || !std::ranges::equal(a.facets_of(v), b.facets_of(v)))
      return false;
  for (int c = 0; c < a.cell_slots(); ++c)
    if (a.cell(c) != b.cell(c) || (a.is_cell_alive(c) && (a.body(c) != b.body(c) || a.volume(c) != b.volume(c) ||
                                                          a.inverse_rest_edges(c) != b.inverse_rest_edges(c))))
      return false;
  for (int f = 0; f < a.facet_slots(); ++f)
    if (a.facet(f) != b.facet(f) || (a.is_facet_alive(f) && a.facet_tag(f) != b.facet_tag(f))) return false;
  return true;
}

/// Nothing where the domain is the unit square of random_mesh(): bodies on their sides of the middle, tags on their sides.
std::string find_wrong_place(const Mesh<2>& mesh) {
  const double eps = 1e-12;
  for (int c = 0; c < mesh.cell_slots(); ++c) {
    if (!mesh.is_cell_alive(c)) continue;
    if (mesh.volume(c) <= 0) return "cell " + std::to_string(c) + " is not positively oriented";
    for (const int v : mesh.cell(c))
      if (mesh.body(c) == 1 ? mesh.rest(v)[0] > 0.5 + eps : mesh.rest(v)[0] < 0.5 - eps)
        return "cell " + std::to_string(c) + " reaches over the interface";
  }
  for (int f = 0; f < mesh.facet_slots(); ++f) {
    if (!mesh.is_facet_alive(f)) continue;
    for (const int v : mesh.facet(f)) {
      const Vec<2>& X = mesh.rest(v);
      const double off[] = {X[0], X[1], X[0] - 1, X[1] - 1};
      if (std::abs(off[mesh.facet_tag(f) - 1]) > eps) return "facet " + std::to_string(f) + " has another side's tag";
    }
  }
  return mesh.find_defect();
}

RC_GTEST_PROP(EditProperties, KeepAreaTagsInterfaceAndOrientation, ()) {
  Mesh<2> mesh = draw_mesh();
  const Totals before(mesh);
  for (const EditChoice& choice : draw_edits(0, 4)) {
    const auto edit = edit_at(mesh, choice.kind, choice.which);
    if (!edit) continue;
    mesh.apply(*edit);
    RC_ASSERT(find_wrong_place(mesh) == "");
  }
  const auto expect_kept = [&] {
    const Totals after(mesh);
    RC_ASSERT(after.area.size() == before.area.size());
    RC_ASSERT(after.length.size() == before.length.size());
    for (const auto& [body, area] : before.area) RC_ASSERT(std::abs(after.area.at(body) - area) < 1e-13);
    for (const auto& [tag, length] : before.length) RC_ASSERT(std::abs(after.length.at(tag) - length) < 1e-13);
  };
  expect_kept();
  mesh.compact();
  RC_ASSERT(find_wrong_place(mesh) == "");
  expect_kept();
}

/// A mesh before and after edits, as the transfer sees it. Fields at slots of the edited mesh follow the edits.
struct Transfer {
  std::vector<Vec<2>> old_rest, rest;
  std::vector<std::array<int, 3>> old_cells, cells;
  std::vector<double> old_density, density;
  TouchedCells touched;
  MatrixX old_values, interpolant;  ///< two columns a field: u, v

  TransferMesh<2> old_view() const { return {old_rest, old_cells, old_density}; }
  TransferMesh<2> view() const { return {rest, cells, density}; }

  Transfer(const Mesh<2>& before, const std::vector<EditChoice>& edits, const std::map<int, double>& density_of) {
    RemeshFields<2> fields;
    fields.x = VectorX::Random(2 * before.node_slots());
    fields.past_rates = {VectorX::Random(2 * before.node_slots())};
    Mesh<2> mesh = before;
    old_values = columns(fields);
    fill(before, density_of, old_rest, old_cells, old_density);
    for (const EditChoice& choice : edits)
      if (const auto edit = edit_at(mesh, choice.kind, choice.which)) fields.follow(*edit, mesh.apply(*edit));
    for (int c = 0; c < before.cell_slots(); ++c)
      if (!mesh.is_cell_alive(c)) touched.old_cells.push_back(c);
    const MatrixX slots = columns(fields);
    const auto map = mesh.compact();
    for (int c = before.cell_slots(); c < static_cast<int>(map.cell.size()); ++c)
      if (map.cell[c] != kNone) touched.new_cells.push_back(map.cell[c]);
    interpolant.resize(mesh.node_slots(), 4);
    for (std::size_t v = 0; v < map.vertex.size(); ++v)
      if (map.vertex[v] != kNone) interpolant.row(map.vertex[v]) = slots.row(static_cast<int>(v));
    fill(mesh, density_of, rest, cells, density);
  }

  MatrixX project() const {
    TransferReport report;
    return project_l2<2>(old_view(), view(), touched, old_values, interpolant, {}, report);
  }

  /// Integrals of density * values.
  static Eigen::RowVectorXd integral(const TransferMesh<2>& mesh, const MatrixX& values) {
    Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(values.cols());
    for (std::size_t c = 0; c < mesh.cells.size(); ++c) {
      const auto& [i, j, k] = mesh.cells[c];
      const double area = simplex_volume<2>({mesh.rest[i], mesh.rest[j], mesh.rest[k]});
      sum += mesh.density[c] * area / 3 * (values.row(i) + values.row(j) + values.row(k));
    }
    return sum;
  }

 private:
  static MatrixX columns(const RemeshFields<2>& fields) {
    MatrixX values(fields.x.size() / 2, 4);
    for (Eigen::Index v = 0; v < values.rows(); ++v)
      values.row(v) << fields.x.segment<2>(2 * v).transpose(), fields.past_rates[0].segment<2>(2 * v).transpose();
    return values;
  }
  static void fill(const Mesh<2>& mesh, const std::map<int, double>& density_of, std::vector<Vec<2>>& rest,
                   std::vector<std::array<int, 3>>& cells, std::vector<double>& density) {
    for (int v = 0; v < mesh.node_slots(); ++v) rest.push_back(mesh.rest(v));
    for (int c = 0; c < mesh.cell_slots(); ++c) {
      cells.push_back(mesh.cell(c));
      density.push_back(density_of.at(mesh.body(c)));
    }
  }
};

RC_GTEST_PROP(TransferProperties, RefinementTransfersFieldsExactly, ()) {
  const Mesh<2> before = draw_mesh();
  const Transfer transfer(before, draw_edits(0, 1), {{1, 1}, {2, 7}});
  // The functions before and after agree at every vertex after, wherever the cell around it was split.
  for (std::size_t v = 0; v < transfer.rest.size(); ++v) {
    if (static_cast<int>(v) < before.node_slots()) {
      RC_ASSERT(transfer.interpolant.row(v) == transfer.old_values.row(v));
      continue;
    }
    bool found = false;
    for (int c = 0; c < before.cell_slots() && !found; ++c) {
      const auto& cell = before.cell(c);
      const Vec<2> w = before.inverse_rest_edges(c) * (transfer.rest[v] - before.rest(cell[0]));
      found = w.minCoeff() > -1e-12 && w.sum() < 1 + 1e-12;
      if (!found) continue;
      const Eigen::RowVectorXd value = (1 - w.sum()) * transfer.old_values.row(cell[0]) +
                                       w[0] * transfer.old_values.row(cell[1]) + w[1] * transfer.old_values.row(cell[2]);
      RC_ASSERT((value - transfer.interpolant.row(v)).cwiseAbs().maxCoeff() < 1e-13);
    }
    RC_ASSERT(found);
  }
  RC_ASSERT((transfer.project() - transfer.interpolant).cwiseAbs().maxCoeff() < 1e-12);
}

RC_GTEST_PROP(TransferProperties, EveryEditKeepsTheIntegralsOfPositionAndVelocity, ()) {
  const double jump = *rc::gen::element(1.0, 3.0, 1e3);  // of density at the interface; 1: plain integrals
  const Transfer transfer(draw_mesh(), draw_edits(0, 4), {{1, 1}, {2, jump}});
  const MatrixX projected = transfer.project();
  const Eigen::RowVectorXd before = Transfer::integral(transfer.old_view(), transfer.old_values);
  const Eigen::RowVectorXd after = Transfer::integral(transfer.view(), projected);
  const Eigen::RowVectorXd size = Transfer::integral(transfer.old_view(), transfer.old_values.cwiseAbs());
  RC_ASSERT(((after - before).cwiseAbs().array() <= 1e-13 * size.array()).all());
}

/// Operations of one kind, which patches decide.
RemeshOptions only(Kind kind, double tolerance) {
  RemeshOptions options = remesh_options();
  options.screening = Screening::energy_percentile;
  options.split.culling_threshold = kind == Kind::split ? 0 : 1;
  options.collapse.culling_threshold = 1;
  options.split.enabled = kind == Kind::split;
  options.collapse.enabled = kind == Kind::collapse;
  options.swap.enabled = kind == Kind::swap;
  options.smooth.enabled = kind == Kind::smooth;
  options.split.acceptance_tolerance = options.collapse.acceptance_tolerance = tolerance;
  options.swap.acceptance_tolerance = options.smooth.acceptance_tolerance = tolerance;
  options.split.max_depth = 1;
  options.collapse.rel_max_edge_length = 100;
  return options;
}

OperationCount total(const RemeshReport& report) {
  OperationCount sum;
  for (const OperationCount& count : {report.splits, report.collapses, report.swaps, report.smooths}) {
    sum.tried += count.tried;
    sum.accepted += count.accepted;
  }
  return sum;
}

Kind draw_kind() { return *rc::gen::element(Kind::split, Kind::collapse, Kind::swap, Kind::smooth); }

TrialScene draw_scene(const Terms& terms = {}) {
  TrialScene scene(*rc::gen::noShrink(rc::gen::inRange(0u, 1000000u)), *rc::gen::element(4, 6), terms);
  RC_PRE(find_inverted<2>(scene.mesh, scene.fields.x) == kNone);
  return scene;
}

/// At the least tolerance, nearly, that no trial reaches.
RC_GTEST_PROP(TrialProperties, RejectedTrialsLeaveNoTrace, ()) {
  const TrialScene scene = draw_scene(draw_terms());
  const Kind kind = draw_kind();
  Mesh<2> mesh;
  RemeshFields<2> fields;
  const auto run = [&](double tolerance) {
    mesh = scene.mesh;
    fields = scene.fields;
    RemeshMemory memory;
    Strata<2> strata;
    return total(remesh(mesh, fields, scene.context, only(kind, tolerance), memory, strata));
  };
  double low = 1e-12, high = 1e12;
  for (int i = 0; i < 12; ++i) {
    const double middle = std::sqrt(low * high);
    (run(middle).accepted > 0 ? low : high) = middle;
  }
  const OperationCount count = run(high);
  RC_PRE(count.tried > 0);
  RC_ASSERT(count.accepted == 0);
  RC_ASSERT(same_mesh(mesh, scene.mesh));
  RC_ASSERT(same_fields(fields, scene.fields));
}

/// The edit of a kind that makes `after` of `before`.
std::optional<Edit<2>> find_edit(const Mesh<2>& before, const Mesh<2>& after, Kind kind) {
  const auto leads_there = [&](const std::optional<Edit<2>>& edit) {
    if (!edit) return false;
    Mesh<2> changed = before;
    changed.apply(*edit);
    return same_mesh(changed, after);
  };
  const Strata<2> strata(before);
  if (kind == Kind::smooth) {
    for (int v = 0; v < before.node_slots(); ++v)
      if (const auto edit = propose_move(before, strata, v, after.rest(v)).edit;
          after.rest(v) != before.rest(v) && leads_there(edit))
        return edit;
    return std::nullopt;
  }
  for (const EdgeKey& edge : before.edges()) {
    const std::optional<Edit<2>> edit = kind == Kind::split      ? make_split(before, edge)
                                        : kind == Kind::collapse ? propose_collapse(before, strata, edge).edit
                                                                 : propose_diagonal_swap(before, strata, edge).edit;
    if (leads_there(edit)) return edit;
  }
  return std::nullopt;
}

/// Between tolerances that accept all and none there is one, nearly always, that accepts exactly one edit. What is accepted
/// then must keep the rule of acceptance when it is evaluated anew, and the run must have the bits of that edit alone: the
/// trials rejected before and after it left no trace.
RC_GTEST_PROP(TrialProperties, AcceptedEditKeepsTheRuleAndIsAllThatChanged, ()) {
  const TrialScene scene = draw_scene();
  const Kind kind = draw_kind();
  Mesh<2> mesh;
  RemeshFields<2> fields;
  OperationCount count;
  RemeshOptions options = remesh_options();
  const double energy = global_energy(scene.mesh, scene.fields, scene.context);
  RC_PRE(std::isfinite(energy));
  double low = -energy / scene.context.scaling, high = -low;
  for (int i = 0; i < 30 && count.accepted != 1; ++i) {
    const double middle = 0.5 * (low + high);
    options = only(kind, middle);
    mesh = scene.mesh;
    fields = scene.fields;
    RemeshMemory memory;
    Strata<2> strata;
    count = total(remesh(mesh, fields, scene.context, options, memory, strata));
    (count.accepted > 1 ? low : high) = middle;
  }
  RC_PRE(count.accepted == 1);
  RC_ASSERT(count.tried > 1);
  const auto edit = find_edit(scene.mesh, mesh, kind);
  RC_ASSERT(edit.has_value());

  const bool moves = kind == Kind::smooth;
  LocalRelaxationOptions local = options.local;
  if (moves) local.rings = 1;
  Marks marks;
  const auto patch = select_patch<2>(scene.mesh, *edit, local, marks);
  LocalView view(scene);
  const auto before = view.problem(patch, *edit, false), after = view.problem(patch, *edit, true);
  const double energy_before = before->value();
  const bool contact = before->touches_contact() || after->touches_contact();
  const int iterations = contact ? local.max_contact_iterations : local.max_iterations;
  const double energy_after = after->relax(iterations).energy;
  const double relaxed_before = before->has_unknowns() ? before->relax(iterations).energy : energy_before;
  const double tolerance = kind == Kind::split      ? *options.split.acceptance_tolerance
                           : kind == Kind::collapse ? *options.collapse.acceptance_tolerance
                                                    : *options.swap.acceptance_tolerance;
  const double required = scene.context.scaling * tolerance;
  RC_ASSERT(energy_before - energy_after >= required);
  RC_ASSERT(relaxed_before - energy_after >= required);

  const double energy_end = after->relax(1000).energy;
  RC_ASSERT(energy_end <= energy_after + 1e-13 * energy);
  if (kind == Kind::split) {  // the rule on the whole mesh, without any patch
    const double energy_changed = global_energy(mesh, fields, scene.context);
    RC_ASSERT(energy - energy_changed >= required - 1e-12 * energy);
  }

  Mesh<2> replayed_mesh = scene.mesh;
  RemeshFields<2> replayed = scene.fields;
  const VertexId created = replayed_mesh.apply(*edit);
  replayed.follow(*edit, created);
  write_back(*after, created, replayed.x);
  RC_ASSERT(same_mesh(replayed_mesh, mesh));
  RC_ASSERT(same_fields(replayed, fields));
}

RC_GTEST_PROP(TrialProperties, RemeshingHasTheSameBitsForAnyNumberOfThreads, ()) {
  const unsigned seed = *rc::gen::noShrink(rc::gen::inRange(0u, 1000000u));
  const Terms terms = draw_terms();
  const auto run = [&](int threads) {
    const ThreadLimit limit(threads);
    TrialScene scene(seed, 12, terms);  // 288 cells: more than one block of a parallel loop
    RemeshOptions options = remesh_options();
    options.split.culling_threshold = 0.9;
    options.split.acceptance_tolerance = 1e-3;
    options.collapse.rel_max_edge_length = 100;
    options.collapse.culling_threshold = 0.1;
    options.swap.enabled = options.smooth.enabled = true;
    RemeshMemory memory;
    Strata<2> strata;
    remesh(scene.mesh, scene.fields, scene.context, options, memory, strata);
    return std::pair(scene.mesh, scene.fields);
  };
  const auto one = run(1);
  for (const int threads : {2, 3}) {
    const auto several = run(threads);
    RC_ASSERT(same_mesh(one.first, several.first));
    RC_ASSERT(same_fields(one.second, several.second));
  }
}

}  // namespace
}  // namespace itr
