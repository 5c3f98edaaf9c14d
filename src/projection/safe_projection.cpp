// SPDX-License-Identifier: MIT
#include "projection/safe_projection.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "energy/contact/contact.hpp"
#include "energy/elastic/elastic.hpp"
#include "energy/inertia.hpp"
#include "geometry/quadratic_validity.hpp"
#include "newton/newton.hpp"
#include "projection/volume_barrier.hpp"

namespace itr {

namespace {

constexpr double kVolumeActivation = 1e-2;   ///< most volume ratio below which the barrier acts
constexpr double kRelativeTolerance = 1e-9;  ///< of the way from the interpolant to the unconstrained minimiser
constexpr double kNearEnd = 1e-2;            ///< of the same way
constexpr double kHardlyNearer = 1e-3;       ///< of the same way: what is left of it, by the model, where a solve ends
constexpr double kPenalty = 1e8;             ///< of an integral's change by that of the inertia

/// An integral sum_i m_i (x_i - goal_i) over the free dofs of one part and one axis, which is to vanish.
struct Integral {
  std::vector<int> dofs;
  std::vector<double> masses;
  double total_mass = 0;

  double defect(ConstVectorView x, const VectorX& goal) const {
    double sum = 0;
    for (std::size_t i = 0; i < dofs.size(); ++i) sum += masses[i] * (x[dofs[i]] - goal[dofs[i]]);
    return sum;
  }
  double weight() const { return kPenalty / total_mass; }
};

/// 1/2 weight * defect^2 for each integral. Its Hessian, of low rank and dense, is PenalisedSystem's to add.
class IntegralPenalty final : public Energy {
 public:
  IntegralPenalty(const std::vector<Integral>& integrals, const VectorX& goal) : integrals_(integrals), goal_(goal) {}
  std::string_view name() const override { return "integrals"; }
  double value(ConstVectorView x, Workspace&) const override {
    double sum = 0;
    for (const Integral& integral : integrals_) sum += 0.5 * integral.weight() * std::pow(integral.defect(x, goal_), 2);
    return sum;
  }
  void add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const override {
    for (const Integral& integral : integrals_) {
      const double force = integral.weight() * integral.defect(x, goal_);
      for (std::size_t i = 0; i < integral.dofs.size(); ++i) gradient[integral.dofs[i]] += force * integral.masses[i];
    }
  }
  void add_hessian(ConstVectorView, PsdProjection, HessianSink&, Workspace&) const override {}

 private:
  const std::vector<Integral>& integrals_;
  const VectorX& goal_;
};

/// (H + C W C^T)^-1 by the formula of Sherman, Morrison and Woodbury, columns of C the masses of the integrals.
class PenalisedSystem final : public NewtonSystem {
 public:
  PenalisedSystem(SparseSystem& system, const std::vector<Integral>& integrals, const DofMap& dofs) : system_(system) {
    columns_ = MatrixX::Zero(dofs.num_unknowns, static_cast<Eigen::Index>(integrals.size()));
    inverse_weights_.resize(columns_.cols());
    for (std::size_t q = 0; q < integrals.size(); ++q) {
      const auto column = static_cast<Eigen::Index>(q);
      inverse_weights_[column] = 1 / integrals[q].weight();
      for (std::size_t i = 0; i < integrals[q].dofs.size(); ++i)
        columns_(dofs.unknown[integrals[q].dofs[i]], column) = integrals[q].masses[i];
    }
  }
  void assemble(const Energy& energy, ConstVectorView x, PsdProjection psd, const DofMap& dofs, PrescribedMotion& motion,
                Workspace& workspace) override {
    system_.assemble(energy, x, psd, dofs, motion, workspace);
  }
  linear::SystemReport factorize(const Shift& shift) override {
    linear::SystemReport report = system_.factorize(shift);
    if (report.outcome != linear::Outcome::ok) return report;
    solved_.resize(columns_.rows(), columns_.cols());
    VectorX solution(columns_.rows());
    for (Eigen::Index q = 0; q < columns_.cols(); ++q) {
      report.outcome = system_.solve_again(columns_.col(q), solution).outcome;
      if (report.outcome != linear::Outcome::ok) return report;
      solved_.col(q) = solution;
    }
    MatrixX small = columns_.transpose() * solved_;
    small.diagonal() += inverse_weights_;
    small_.compute(small);
    return report;
  }
  linear::SolveReport solve_again(ConstVectorView rhs, VectorView solution) override {
    const linear::SolveReport report = system_.solve_again(rhs, solution);
    solution -= solved_ * small_.solve(columns_.transpose() * solution);
    return report;
  }
  std::string message() const override { return system_.message(); }
  bool tells_definiteness() const override { return system_.tells_definiteness(); }
  double diagonal_scale() const override { return system_.diagonal_scale(); }
  double curvature_of(const Shift& shift, ConstVectorView step) const override { return system_.curvature_of(shift, step); }

 private:
  SparseSystem& system_;
  MatrixX columns_, solved_;
  VectorX inverse_weights_;
  Eigen::LLT<MatrixX> small_;
};

template <int Dim>
std::vector<Integral> integrals_of(const SafeProjectionProblem<Dim>& problem, const std::vector<char>& held_dofs) {
  const int patch = static_cast<int>(problem.part.size());
  const int parts = patch == 0 ? 0 : *std::max_element(problem.part.begin(), problem.part.end()) + 1;
  VectorX masses = VectorX::Zero(patch);
  for (const auto& element : problem.cells.straight())
    for (const int v : element.vertices)
      masses[v] += problem.materials.at(element.body).density * element.volume / (Dim + 1);
  for (const auto& element : problem.cells.curved()) {
    Mat<kQuadraticNodes<Dim>> unit = constant_quadratic_mass<Dim>(MassKind::consistent, element.curved);
    if (problem.cells.axisymmetric) {
      std::array<Vec<Dim>, Dim + 1> corners;
      for (int k = 0; k <= Dim; ++k) corners[k] = problem.cells.rest[element.vertices[k]];
      unit = turned_mass<Dim>(MassKind::consistent, element.curved, corners);
    }
    const auto fractions = unit.rowwise().sum().eval();
    const auto nodes = element.nodes();
    for (int k = 0; k < kQuadraticNodes<Dim>; ++k)  // 0 at straight edges
      masses[nodes[k]] += problem.materials.at(element.body).density * element.volume * fractions[k];
  }
  std::vector<Integral> integrals(parts * Dim);
  for (int v = 0; v < patch; ++v)
    for (int c = 0; c < Dim; ++c) {
      if (held_dofs[Dim * v + c]) continue;
      Integral& integral = integrals[Dim * problem.part[v] + c];
      integral.dofs.push_back(Dim * v + c);
      integral.masses.push_back(masses[v]);
      integral.total_mass += masses[v];
    }
  std::erase_if(integrals, [](const Integral& integral) { return integral.dofs.empty(); });
  return integrals;
}

/// Ends steps before a cell with curved edges is inverted; without a barrier, so that a solve may end there.
template <int Dim>
class InversionGuard final : public Energy {
 public:
  explicit InversionGuard(std::shared_ptr<const ElasticEnergy<Dim>> elastic) : elastic_(std::move(elastic)) {}
  std::string_view name() const override { return "inversion guard"; }
  double value(ConstVectorView, Workspace&) const override { return 0; }
  void add_gradient(ConstVectorView, VectorView, Workspace&) const override {}
  void add_hessian(ConstVectorView, PsdProjection, HessianSink&, Workspace&) const override {}
  double max_step(ConstVectorView x, ConstVectorView dx, Workspace& workspace) const override {
    return elastic_->max_step(x, dx, workspace);
  }

 private:
  std::shared_ptr<const ElasticEnergy<Dim>> elastic_;
};

/// Barriers that must not become worse on the way from the interpolant.
template <int Dim>
struct Barriers {
  std::shared_ptr<ElasticEnergy<Dim>> inversion;  ///< asked for steps alone
  std::shared_ptr<VolumeBarrier<Dim>> volume;
  std::shared_ptr<ContactEnergy<Dim>> distance;  ///< null: nothing to touch
  double least_ratio;                            ///< of volumes, below which theirs acts

  bool let_pass(const VectorX& x, const VectorX& direction, Workspace& workspace) const {
    const VectorX end = x + direction;
    return inversion->max_step(x, direction, workspace) == 1 && volume->value(end, workspace) == 0 &&
           (!distance || (distance->max_step(x, direction, workspace) == 1 && distance->active(end, workspace).empty()));
  }
};

/// They act below half of what the interpolant has.
template <int Dim>
Barriers<Dim> barriers_for(const SafeProjectionProblem<Dim>& problem, const VectorX& interpolant, Workspace& workspace) {
  double least_ratio = kVolumeActivation * 2, mass = 0, volume = 0;
  for (const auto& element : problem.cells.elements) {
    if (!element.curved) least_ratio = std::min(least_ratio, deformation_gradient<Dim>(element, interpolant).determinant());
    mass += problem.materials.at(element.body).density * element.volume;
    volume += element.volume;
  }
  const double size = std::pow(volume / problem.cells.elements.size(), 1.0 / Dim);
  Barriers<Dim> barriers{std::make_shared<ElasticEnergy<Dim>>(problem.cells, problem.materials, 1), nullptr, nullptr,
                         least_ratio / 2};
  barriers.volume = std::make_shared<VolumeBarrier<Dim>>(problem.cells, barriers.least_ratio, mass / volume * size * size);
  if (problem.surface) {
    ContactOptions contact{.enabled = true, .dhat = problem.dhat};
    const double nearest = ContactEnergy<Dim>(*problem.surface, contact, 1, 1).min_distance(interpolant, workspace);
    contact.dhat = std::min(nearest, problem.dhat) / 2;
    // At half of that distance the barrier is as stiff as the mass of a vertex.
    const double stiffness = mass / problem.part.size() / std::pow(contact.dhat, 2);
    barriers.distance = std::make_shared<ContactEnergy<Dim>>(*problem.surface, contact, stiffness, 1);
  }
  return barriers;
}

/// By vertex, whether it is in a cell or a pair that the straight way squeezes or stops, or at most `problem.rings` edges
/// away.
template <int Dim>
std::vector<char> near_barriers(const SafeProjectionProblem<Dim>& problem, const Barriers<Dim>& barriers, const VectorX& x,
                                const VectorX& direction, Workspace& workspace) {
  std::vector<char> is_near(problem.cells.num_vertices, 0);
  const VectorX end = x + direction;
  for (const auto& element : problem.cells.elements)
    if (element.curved ? max_positive_step<Dim>(at_all_nodes<Dim>(element, x), at_all_nodes<Dim>(element, direction)) < 1
                       : deformation_gradient<Dim>(element, end).determinant() < barriers.least_ratio)
      for_each_node(element, [&](int v) { is_near[v] = 1; });
  if (barriers.distance) {
    VectorX single(direction.size());
    barriers.distance->get_vertex_steps(x, direction, single, workspace);
    for (int v = 0; v < problem.cells.num_vertices; ++v)
      is_near[v] |= single.segment<Dim>(Dim * v) != direction.segment<Dim>(Dim * v);
    for (const ContactStencil& pair : barriers.distance->active(end, workspace))
      for (int k = 0; k < pair.size(); ++k) is_near[pair.vertices[k]] = 1;
  }
  for (int ring = 0; ring < problem.rings; ++ring) {
    const std::vector<char> before = is_near;
    for (const auto& element : problem.cells.elements) {
      bool is_beside = false;
      for_each_node(element, [&](int v) { is_beside = is_beside || before[v]; });
      if (is_beside) for_each_node(element, [&](int v) { is_near[v] = 1; });
    }
  }
  return is_near;
}

/// Moves free dofs, all by the same, to where the integrals are; returns whether that is free of contact and inversion.
bool close_integrals(const std::vector<Integral>& integrals, const VectorX& goal, const Energy& energy, VectorX& x,
                     Workspace& workspace) {
  VectorX direction = VectorX::Zero(x.size());
  for (const Integral& integral : integrals) {
    const double shift = -integral.defect(x, goal) / integral.total_mass;
    for (const int dof : integral.dofs) direction[dof] = shift;
  }
  if (energy.max_step(x, direction, workspace) < 1 || !std::isfinite(energy.value(x + direction, workspace))) return false;
  x += direction;
  return true;
}

}  // namespace

template <int Dim>
VectorX project_safely(const SafeProjectionProblem<Dim>& problem, const VectorX& interpolant, const VectorX& projected,
                       linear::Solver& solver, SafeProjectionReport<Dim>& report) {
  Workspace workspace;
  const VectorX direction = projected - interpolant;
  const Barriers<Dim> barriers = barriers_for(problem, interpolant, workspace);
  if (barriers.let_pass(interpolant, direction, workspace)) return projected;

  // Far from what stands in the way all goes straight, if that is free with the rest left behind.
  VectorX x = interpolant;
  std::vector<char> held = problem.held_dofs;
  const std::vector<char> is_near = near_barriers(problem, barriers, interpolant, direction, workspace);
  VectorX straight = direction;
  for (int v = 0; v < problem.cells.num_vertices; ++v)
    if (is_near[v]) straight.segment<Dim>(Dim * v).setZero();
  if (barriers.let_pass(interpolant, straight, workspace))
    for (int v = 0; v < problem.cells.num_vertices; ++v) {
      if (is_near[v]) continue;
      x.segment<Dim>(Dim * v) = projected.segment<Dim>(Dim * v);
      std::fill_n(held.begin() + static_cast<std::ptrdiff_t>(Dim * v), Dim, 1);
    }

  report.used_barriers = true;
  const std::vector<Integral> integrals = integrals_of(problem, held);
  const DofMap dofs = DofMap::from_held(held);
  EnergySum energy;
  const auto distance =
      std::make_shared<InertiaEnergy<Dim>>(problem.cells, problem.materials, MassKind::consistent, projected);
  const double whole = distance->value(interpolant, workspace);
  energy.add(distance);
  energy.add(barriers.volume);
  if (!problem.cells.curved().empty()) energy.add(std::make_shared<InversionGuard<Dim>>(barriers.inversion));
  if (barriers.distance) energy.add(barriers.distance);
  SparseSystem sparse(solver);
  sparse.reset(dofs, Dim, element_stencils(problem.cells));
  NewtonOptions options;
  options.max_iterations = 100;
  options.gradient_tolerance = options.first_gradient_tolerance = 0;
  // Integrals bind all vertices together, so that what stops one stops all: first without, near to the end.
  options.step_tolerance = kNearEnd * direction.norm();
  options.decrement_tolerance = std::pow(kNearEnd, 2) * whole;
  report.iterations = minimize(energy, x, dofs, VectorX(), sparse, options, workspace).iterations;
  energy.add(std::make_shared<IntegralPenalty>(integrals, projected));
  PenalisedSystem system(sparse, integrals, dofs);
  options.step_tolerance = kRelativeTolerance * direction.norm();
  options.decrement_tolerance = std::pow(kHardlyNearer, 2) * whole;
  const NewtonSummary summary = minimize(energy, x, dofs, VectorX(), system, options, workspace);
  report.converged = summary.converged();
  report.iterations += summary.iterations;
  close_integrals(integrals, projected, energy, x, workspace);
  for (const Integral& integral : integrals) report.lost[integral.dofs[0] % Dim] -= integral.defect(x, projected);
  return x;
}

template VectorX project_safely<2>(const SafeProjectionProblem<2>&, const VectorX&, const VectorX&, linear::Solver&,
                                   SafeProjectionReport<2>&);
template VectorX project_safely<3>(const SafeProjectionProblem<3>&, const VectorX&, const VectorX&, linear::Solver&,
                                   SafeProjectionReport<3>&);

}  // namespace itr
