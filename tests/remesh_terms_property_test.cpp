// SPDX-License-Identifier: MIT
// Properties of remeshing in scenes with all terms that a step can have. What a trial is said to gain is recomputed on the
// whole mesh, from the definitions and without any patch.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <memory>

#include "fem/inverted.hpp"
#include "random_terms.hpp"
#include "remesh/remesher.hpp"
#include "remesh_options.hpp"
#include "whole_mesh_energy.hpp"

namespace itr {
namespace {

using Kind = Edit<2>::Kind;

/// A term of a program that is 0. No prediction knows it, so that patches alone decide.
class UnknownTerm final : public Energy {
 public:
  std::string_view name() const override { return "unknown"; }
  double value(ConstVectorView, Workspace&) const override { return 0; }
  void add_gradient(ConstVectorView, VectorView, Workspace&) const override {}
  void add_hessian(ConstVectorView, PsdProjection, HessianSink&, Workspace&) const override {}
};

/// Operations of one kind, with patches relaxed to convergence before the decision.
RemeshOptions only(Kind kind, Screening screening) {
  RemeshOptions options = remesh_options();
  options.screening = screening;
  options.split.culling_threshold = kind == Kind::split ? 0 : 1;
  options.collapse.culling_threshold = 1;
  options.split.enabled = kind == Kind::split;
  options.collapse.enabled = kind == Kind::collapse;
  options.swap.enabled = kind == Kind::swap;
  options.smooth.enabled = kind == Kind::smooth;
  options.split.max_depth = 1;
  options.split.acceptance_tolerance = 0;  // of swaps and moves that only stir the mesh
  options.collapse.rel_max_edge_length = 100;
  options.local.max_iterations = options.local.max_contact_iterations = 100;
  return options;
}

int accepted(const RemeshReport& report) {
  return report.splits.accepted + report.collapses.accepted + report.swaps.accepted + report.smooths.accepted;
}

/// A remeshed state, and between which tolerances [J] lies the largest that leads to it.
struct Remeshed {
  Mesh<2> mesh;
  RemeshFields<2> fields;
  int accepted = 0;
  double low = 0, high = 0;
};

/// Remeshes at the largest tolerance at which anything is accepted, searched below `most` [J].
Remeshed remesh_sharply(const TrialScene& scene, RemeshOptions options, double most) {
  Remeshed result;
  result.low = -most;
  result.high = most;
  for (int i = 0; i < 36; ++i) {
    const double middle = 0.5 * (result.low + result.high);
    if (options.split.enabled) options.split.acceptance_tolerance = middle;
    options.collapse.acceptance_tolerance = middle;
    options.swap.acceptance_tolerance = options.smooth.acceptance_tolerance = middle;
    Mesh<2> mesh = scene.mesh;
    RemeshFields<2> fields = scene.fields;
    RemeshMemory memory;
    Strata<2> strata;
    const int count = accepted(remesh(mesh, fields, scene.context, options, memory, strata));
    (count > 0 ? result.low : result.high) = middle;
    if (count > 0) result.mesh = mesh, result.fields = fields, result.accepted = count;
  }
  return result;
}

/// A field of a mesh at the vertices of another one of the same body, as the function that it is.
VectorX evaluate(const Mesh<2>& mesh, const VectorX& field, const Mesh<2>& other) {
  VectorX values = VectorX::Zero(2 * other.node_slots());
  for (int v = 0; v < other.node_slots(); ++v) {
    if (!other.is_vertex_alive(v)) continue;
    const int body = other.body(other.cells_of(v)[0]);
    vertex_of<2>(values, v) = value_in(mesh, field, cell_at(mesh, body, other.rest(v)), other.rest(v));
  }
  return values;
}

VectorX lumped_masses(const Mesh<2>& mesh, const std::map<int, Material>& materials) {
  VectorX masses = VectorX::Zero(mesh.node_slots());
  for (int c = 0; c < mesh.cell_slots(); ++c)
    if (mesh.is_cell_alive(c))
      for (const int v : mesh.cell(c)) masses[v] += materials.at(mesh.body(c)).density * mesh.volume(c) / 3;
  return masses;
}

double weighted(const VectorX& masses, const VectorX& a, const VectorX& b) {
  double sum = 0;
  for (int v = 0; v < masses.size(); ++v) sum += masses[v] * vertex_of<2>(a, v).dot(vertex_of<2>(b, v));
  return sum;
}

/// The inertia of x on the new mesh with the history as a function and lumped mass: sums over the vertices of the old mesh,
/// but for the square of the way to x, which the new mesh sums from what the old one makes of it at `start` on.
double lumped_inertia(const Mesh<2>& old_mesh, const VectorX& old_predictor, const Mesh<2>& mesh, const VectorX& predictor,
                      const VectorX& start, const VectorX& x, const std::map<int, Material>& materials) {
  const VectorX old_masses = lumped_masses(old_mesh, materials), masses = lumped_masses(mesh, materials);
  const VectorX gap = evaluate(mesh, predictor, old_mesh) - old_predictor, step = x - predictor, first = start - predictor;
  const VectorX step_there = evaluate(mesh, step, old_mesh), first_there = evaluate(mesh, first, old_mesh);
  return 0.5 * (weighted(masses, step, step) - weighted(masses, first, first) +
                weighted(old_masses, first_there, first_there) + weighted(old_masses, gap, gap + 2 * step_there));
}

bool is_near(const Mesh<2>& mesh, const VectorX& a, const VectorX& b) {
  for (int v = 0; v < mesh.node_slots(); ++v)
    if (mesh.is_vertex_alive(v) && (vertex_of<2>(a, v) - vertex_of<2>(b, v)).norm() > 1e-12) return false;
  return true;
}

RC_GTEST_PROP(WholeMesh, LosesTheEnergyThatAnAcceptedOperationIsSaidToGain, ()) {
  const Terms terms = draw_terms();
  const Kind kind = *rc::gen::element(Kind::split, Kind::collapse, Kind::swap, Kind::smooth);
  const auto by_patches = Screening::energy_percentile;
  const auto screening = *rc::gen::element(by_patches, by_patches, Screening::bounds);
  TrialScene scene(*rc::gen::noShrink(rc::gen::inRange(0u, 1000000u)), 4, terms);
  // From rest, with what is lagged at rest too: whatever is left over is not the operation's.
  RC_PRE(find_inverted<2>(scene.mesh, scene.fields.x) == kNone);
  for (int round = 0; round < 4; ++round)
    RC_PRE(WholeMeshEnergy(scene.mesh, scene.fields, scene.context, VectorX(scene.fields.x)).minimize(scene.fields.x));
  WholeMeshEnergy before(scene.mesh, scene.fields, scene.context, scene.fields.x);
  const double energy = before.value(scene.fields.x);
  VectorX relaxed = scene.fields.x;
  RC_PRE(before.minimize(relaxed));
  const double slack = energy - before.value(relaxed);

  if (screening == by_patches)
    scene.context.host.push_back([](const CellSet<2>&, double, double) { return std::make_shared<UnknownTerm>(); });
  const double scale = scene.context.scaling;
  const Remeshed after = remesh_sharply(scene, only(kind, screening), std::abs(energy) / scale);
  RC_PRE(after.accepted == 1);
  RC_ASSERT(find_inverted<2>(after.mesh, after.fields.x) == kNone);
  const auto start = evaluate(scene.mesh, scene.fields.x, after.mesh);
  WholeMeshEnergy changed(after.mesh, after.fields, scene.context, start);
  const auto inertia_of = [&] {
    const auto& predictor = scene.fields.predictor;
    const auto& materials = scene.context.materials;
    return terms.lumped
               ? lumped_inertia(scene.mesh, predictor, after.mesh, after.fields.predictor, start, after.fields.x, materials)
               : squared_distance(scene.mesh, predictor, after.mesh, after.fields.x, materials);
  };
  const double inertia = inertia_of();
  const double gain = energy - changed.without_inertia(after.fields.x) - inertia;
  const double round_off = 1e-10 * std::abs(energy);
  RC_LOG() << kind << ", " << terms << ", gain " << gain << " J s^2, asked " << scale * after.low << " to "
           << scale * after.high << ", left over before " << slack << "\n";
  RC_CLASSIFY(gain > 1e3 * (slack + round_off), "gain well above what was left over");
  RC_ASSERT(gain >= scale * after.low - round_off);
  // The force that a move follows promises it too little in some scenes, as it leaves out inertia and pressure.
  if (screening == by_patches && kind != Kind::smooth) RC_ASSERT(gain <= scale * after.high + slack + round_off);

  RC_ASSERT(is_near(after.mesh, after.fields.predictor, evaluate(scene.mesh, scene.fields.predictor, after.mesh)));
  RC_ASSERT(is_near(after.mesh, after.fields.velocity_reference,
                    evaluate(scene.mesh, scene.fields.velocity_reference, after.mesh)));
  for (int v = 0; v < after.mesh.node_slots(); ++v)
    for (int c = 0; c < 2; ++c)
      if (after.mesh.is_vertex_alive(v) && !changed.is_free(v, c))
        RC_ASSERT(std::abs(after.fields.x[2 * v + c] - start[2 * v + c]) < 1e-13);
}

}  // namespace
}  // namespace itr
