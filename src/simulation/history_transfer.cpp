// SPDX-License-Identifier: MIT
#include "simulation/history_transfer.hpp"

#include "projection/safe_projection.hpp"
#include "projection/transfer_patch.hpp"
#include "simulation/patch_surface.hpp"
#include "simulation/step_terms.hpp"

namespace itr {

namespace {

/// Rings of vertices around the touched cells that the projection may change. What it would change further away is less by
/// a factor of about four a ring: 4e-6 of it in the plane, where rings cost little, 2e-2 in space.
template <int Dim>
constexpr int kRings = Dim == 2 ? 9 : 3;

template <int Dim>
VectorX interleaved(const MatrixX& rows) {
  VectorX field(rows.size());
  for (Eigen::Index v = 0; v < rows.rows(); ++v) field.segment<Dim>(Dim * v) = rows.row(v).transpose();
  return field;
}

template <int Dim>
class HistoryTransfer {
 public:
  HistoryTransfer(const StepSetup<Dim>& setup, const Mesh<Dim>& old_mesh, const Mesh<Dim>& mesh, const TouchedCells& touched)
      : setup_(setup), mesh_(mesh), patch_(make_transfer_patch(old_mesh, mesh, touched, setup.materials, kRings<Dim>)) {
    const auto n = patch_.new_cells.vertices.size();
    prescribed_.assign(Dim * n, 0);
    const auto components = held_components(setup);
    const HeldRule<Dim> rule(components);
    for (std::size_t i = 0; i < n; ++i) {
      const auto tags = rule.tags_of_node(mesh, patch_.new_cells.vertices[i]);
      for (int c = 0; c < Dim; ++c) prescribed_[Dim * i + c] = tags[c] != kNoTag;
      on_axis_.push_back(mesh.is_on_axis(patch_.new_cells.vertices[i]));
      if (on_axis_.back()) prescribed_[Dim * i] = 1;
    }
  }

  void add(const VectorX& old_field, const VectorX& interpolant) {
    old_values_.push_back(patch_.old_cells.gather(old_field));
    new_values_.push_back(patch_.new_cells.gather(interpolant));
  }

  /// Projects the first fields that were added into `fields`, of which the first `num_positions` are positions.
  HistoryTransferReport run(const std::vector<VectorX*>& fields, std::size_t num_positions, linear::Solver& solver) {
    HistoryTransferReport report;
    difference_ = touched_difference(patch_.old_cells.view(), patch_.new_cells.view(), patch_.touched, joined(old_values_),
                                     joined(new_values_));
    const auto columns = static_cast<Eigen::Index>(Dim * fields.size());
    std::vector<char> fixed(patch_.new_cells.vertices.size() * columns, 0);
    for (std::size_t v = 0; v < patch_.new_cells.vertices.size(); ++v)
      for (Eigen::Index k = 0; k < columns; ++k)
        fixed[v * columns + k] = patch_.at_rim[v] || (on_axis_[v] && k % Dim == 0) ||
                                 (k < static_cast<Eigen::Index>(Dim * num_positions) && prescribed_[Dim * v + k % Dim]);
    TransferReport transfer;
    const MatrixX correction =
        solve_projection(patch_.new_cells.view(), difference_.residual.leftCols(columns), fixed, transfer);
    for (std::size_t i = 0; i < fields.size(); ++i) {
      const MatrixX projected = new_values_[i] + correction.middleCols<Dim>(static_cast<Eigen::Index>(Dim * i));
      VectorX goal = interleaved<Dim>(projected);
      if (i < num_positions) {
        Vec<Dim> lost = transfer.lost.segment<Dim>(static_cast<Eigen::Index>(Dim * i));
        goal = positions(*fields[i], interleaved<Dim>(new_values_[i]), std::move(goal), static_cast<int>(i), solver, lost,
                         report);
        report.lost_positions = std::max(report.lost_positions, lost.cwiseAbs().maxCoeff());
      }
      for (std::size_t v = 0; v < patch_.new_cells.vertices.size(); ++v)
        if (!patch_.at_rim[v])
          fields[i]->template segment<Dim>(Dim * patch_.new_cells.vertices[v]) = goal.segment<Dim>(Dim * v);
    }
    return report;
  }

  /// 1/2 ||old - new||^2 of the last field that was added, which is now `field`.
  double loss(const VectorX& field) const {
    const auto first = Dim * static_cast<Eigen::Index>(new_values_.size() - 1);
    const MatrixX change = patch_.new_cells.gather(field) - new_values_.back();
    return 0.5 * (difference_.squares.segment<Dim>(first).sum() -
                  2 * change.cwiseProduct(difference_.residual.middleCols<Dim>(first)).sum() +
                  mass_squares(patch_.new_cells.view(), change).sum());
  }

 private:
  static MatrixX joined(const std::vector<MatrixX>& fields) {
    MatrixX all(fields[0].rows(), static_cast<Eigen::Index>(Dim * fields.size()));
    for (std::size_t i = 0; i < fields.size(); ++i) all.middleCols<Dim>(static_cast<Eigen::Index>(Dim * i)) = fields[i];
    return all;
  }

  /// The safe way from the interpolant to `goal`, of positions of `age` steps ago; `field` has what is around the patch.
  VectorX positions(const VectorX& field, VectorX interpolant, VectorX goal, int age, linear::Solver& solver, Vec<Dim>& lost,
                    HistoryTransferReport& report) const {
    const auto n = static_cast<Eigen::Index>(patch_.new_cells.vertices.size());
    std::vector<char> moving(n), held(prescribed_);
    for (Eigen::Index v = 0; v < n; ++v) {
      moving[v] = !patch_.at_rim[v];
      for (int c = 0; c < Dim; ++c) held[Dim * v + c] |= patch_.at_rim[v];
    }
    PatchSurface<Dim> surface;
    CellSet<Dim> cells = patch_.cells;
    if (setup_.contact.enabled) {
      surface = patch_surface(mesh_, setup_.obstacles, patch_, moving, field, goal, setup_.contact.reach_of_closed(), age);
      cells.num_vertices += static_cast<int>(surface.others.size());
      interpolant.conservativeResize(Dim * cells.num_vertices);
      for (std::size_t i = 0; i < surface.others.size(); ++i)
        interpolant.segment<Dim>(Dim * (n + i)) = field.segment<Dim>(Dim * surface.others[i]);
      goal.conservativeResize(interpolant.size());
      goal.tail(interpolant.size() - Dim * n) = interpolant.tail(interpolant.size() - Dim * n);
      held.resize(interpolant.size(), 1);
    }
    SafeProjectionReport<Dim> safe;
    const auto& patch = patch_.new_cells;
    VectorX x = project_safely<Dim>({cells, surface.empty() ? nullptr : &surface.surface, setup_.materials,
                                     setup_.contact.dhat, std::move(held), parts_of(patch.view()), kRings<Dim>},
                                    interpolant, goal, solver, safe);
    report.with_barriers += safe.used_barriers;
    report.not_converged += !safe.converged;
    lost += safe.lost;
    return x;
  }

  const StepSetup<Dim>& setup_;
  const Mesh<Dim>& mesh_;
  TransferPatch<Dim> patch_;
  std::vector<char> prescribed_;  ///< by dof of the patch
  std::vector<char> on_axis_;     ///< by its vertex: it has no radial displacement and velocity
  std::vector<MatrixX> old_values_, new_values_;
  TouchedDifference difference_;
};

}  // namespace

template <int Dim>
bool depends_on_past(const StepSetup<Dim>& setup) {
  const bool has_friction = setup.contact.enabled && setup.contact.largest_friction() > 0;
  return setup.time.has_inertia() || has_friction || !setup.damping.empty() || !setup.terms.empty();
}

template <int Dim>
HistoryTransferReport transfer_history(const StepSetup<Dim>& setup, const Mesh<Dim>& old_mesh, const History& old_history,
                                       const Mesh<Dim>& mesh, const TouchedCells& touched, linear::Solver& solver,
                                       History& history) {
  if (!depends_on_past(setup)) return {};
  HistoryTransfer<Dim> transfer(setup, old_mesh, mesh, touched);
  std::vector<VectorX*> fields;
  const auto add = [&](const std::vector<VectorX>& old_fields, std::vector<VectorX>& new_fields) {
    for (std::size_t i = 0; i < new_fields.size(); ++i) {
      transfer.add(old_fields[i], new_fields[i]);
      fields.push_back(&new_fields[i]);
    }
  };
  add(old_history.x, history.x);
  add(old_history.v, history.v);
  add(old_history.a, history.a);
  const TimeIntegrator integrator(setup.time);
  const bool has_inertia = setup.time.has_inertia();
  if (has_inertia) transfer.add(integrator.predictor(old_history), integrator.predictor(history));
  HistoryTransferReport report = transfer.run(fields, history.x.size(), solver);
  if (has_inertia) report.loss = std::max(0.0, transfer.loss(integrator.predictor(history)));
  return report;
}

#define ITR_INSTANTIATE(Dim)                                                                                    \
  template bool depends_on_past<Dim>(const StepSetup<Dim>&);                                                    \
  template HistoryTransferReport transfer_history<Dim>(const StepSetup<Dim>&, const Mesh<Dim>&, const History&, \
                                                       const Mesh<Dim>&, const TouchedCells&, linear::Solver&, History&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
