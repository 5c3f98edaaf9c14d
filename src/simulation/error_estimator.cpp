// SPDX-License-Identifier: MIT
#include "simulation/error_estimator.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <map>
#include <optional>
#include <string>

#include "fem/unknowns.hpp"
#include "mesh/refine.hpp"
#include "simulation/closed_faces.hpp"

namespace itr {

namespace {

constexpr int kMostIterations = 60;
/// Gains by the gain so far, for an iteration to be the last: of what the mesh leaves, and of other sources. Those act on
/// contact, beside whose stiffness all else gains little.
constexpr double kEnough = 1e-3, kEnoughInContact = 1e-10;
/// Relative, for derivatives by d-hat: what it changes and what the response changes of a force nearly cancel.
constexpr double kDhatChange = 1e-7;
constexpr double kLeastMotion = 1e-7;   ///< of the bodies' diagonal, for derivatives along a motion
constexpr double kPartOfGap = 1e-4;     ///< of the smallest, at most
constexpr double kTried = 0.25;         ///< of the estimated error, where the energy must be what it is expected to be
constexpr double kOffByMost = 2;        ///< times
constexpr double kResolvedFall = 1e-9;  ///< of the energy: a fall that round-off leaves some digits of
constexpr double kUnresolved = 0.5;     ///< of the stored energy
constexpr double kNothing = 1e-16;      ///< gain by the energy: forces change by its root at most

/// Barycentric weights over vertices of a mesh; points of one cell have few.
using Weights = std::map<VertexId, double>;

Weights mean(const Weights& a, const Weights& b) {
  Weights sum;
  for (const Weights& of : {a, b})
    for (const auto& [v, weight] : of) sum[v] += weight / 2;
  return sum;
}

/// Adds the row of weights of the nodes of a mesh at a point of a cell.
template <int Dim>
void add_row(const Mesh<Dim>& mesh, int row, const Weights& point, std::vector<Eigen::Triplet<double>>& entries) {
  for (auto i = point.begin(); i != point.end(); ++i) {
    entries.emplace_back(row, i->first, i->second * (2 * i->second - 1));
    for (auto j = std::next(i); j != point.end(); ++j) {
      const double weight = 4 * i->second * j->second;
      if (const VertexId node = mesh.node_of(i->first, j->first); node != kNone) {
        entries.emplace_back(row, node, weight);
      } else {
        entries.emplace_back(row, i->first, weight / 2);
        entries.emplace_back(row, j->first, weight / 2);
      }
    }
  }
}

template <int Dim>
Mesh<Dim> finer_mesh(const Mesh<Dim>& mesh) {
  Mesh<Dim> finer = mesh;
  if (mesh.has_nodes()) {
    finer.set_curved_edges({});
    finer = refine_uniformly(finer);
  }
  finer.set_curved_edges(finer.edges());
  return finer;
}

}  // namespace

template <int Dim>
FinerSpace<Dim>::FinerSpace(const Mesh<Dim>& coarse, int num_obstacle_vertices)
    : revision(coarse.revision()),
      obstacle_vertices(num_obstacle_vertices),
      mesh(finer_mesh(coarse)),
      map(find_weights(coarse), VectorX::Zero(Dim * (mesh.num_nodes() + obstacle_vertices))),
      is_new(mesh.num_nodes() + obstacle_vertices, 1) {
  for (const int fine : fine_of_coarse) is_new[fine] = 0;
}

/// Sets `fine_of_coarse`, too.
template <int Dim>
typename VertexMap<Dim>::Weights FinerSpace<Dim>::find_weights(const Mesh<Dim>& coarse) {
  const int rows = mesh.num_nodes() + obstacle_vertices, columns = coarse.num_nodes() + obstacle_vertices;
  std::vector<Weights> point(mesh.num_nodes());
  fine_of_coarse.assign(columns, kNone);
  for (VertexId v = 0; v < coarse.num_vertices(); ++v) {
    point[v] = {{v, 1.0}};
    fine_of_coarse[v] = v;
  }
  if (coarse.has_nodes())
    for (VertexId middle = coarse.num_vertices(); const EdgeKey& edge : coarse.edges()) {
      if (const VertexId node = coarse.node_of(edge); node != kNone) fine_of_coarse[node] = middle;
      point[middle++] = {{edge[0], 0.5}, {edge[1], 0.5}};
    }
  for (VertexId node = mesh.num_vertices(); node < mesh.num_nodes(); ++node) {
    const EdgeKey edge = mesh.edge_of_node(node);
    point[node] = mean(point[edge[0]], point[edge[1]]);
  }
  std::vector<Eigen::Triplet<double>> entries;
  for (int row = 0; row < mesh.num_nodes(); ++row) add_row(coarse, row, point[row], entries);
  for (int o = 0; o < obstacle_vertices; ++o) {
    fine_of_coarse[coarse.num_nodes() + o] = mesh.num_nodes() + o;
    entries.emplace_back(mesh.num_nodes() + o, coarse.num_nodes() + o, 1.0);
  }
  typename VertexMap<Dim>::Weights weights(rows, columns);
  weights.setFromTriplets(entries.begin(), entries.end());
  return weights;
}

template <int Dim>
VectorX FinerSpace<Dim>::restrict(const VectorX& functional) const {
  VectorX coarse = VectorX::Zero(Dim * static_cast<Eigen::Index>(fine_of_coarse.size()));
  map.add_gradient(functional, coarse);
  return coarse;
}
template <int Dim>
VectorX FinerSpace<Dim>::inject(const VectorX& coarse) const {
  VectorX fine = VectorX::Zero(Dim * static_cast<Eigen::Index>(is_new.size()));
  for (std::size_t node = 0; node < fine_of_coarse.size(); ++node)
    fine.template segment<Dim>(Dim * fine_of_coarse[node]) = coarse.template segment<Dim>(Dim * node);
  return fine;
}
template <int Dim>
VectorX FinerSpace<Dim>::at_coarse_nodes(const VectorX& fine) const {
  VectorX coarse(Dim * static_cast<Eigen::Index>(fine_of_coarse.size()));
  for (std::size_t node = 0; node < fine_of_coarse.size(); ++node)
    coarse.template segment<Dim>(Dim * node) = fine.template segment<Dim>(Dim * fine_of_coarse[node]);
  return coarse;
}

namespace {

using Change = SourceChange;
enum class End { converged, slow, indefinite };

std::span<double> span_of(VectorX& v) { return {v.data(), static_cast<std::size_t>(v.size())}; }
std::span<const double> span_of(const VectorX& v) { return {v.data(), static_cast<std::size_t>(v.size())}; }

/// A motion, of all dofs, that lowers a quadratic model of the energy, and by how much.
struct Response {
  VectorX motion;
  double gain = 0;
};
/// Minimises the model of this gradient and Hessian by conjugate gradients. Gains up to `nothing` are left, and it ends
/// where one is less than `enough` of those so far, of which the first `jump` count for nothing: it is what the model's
/// energy rose by before.
template <typename Precondition>
End minimise(const DofMap& dofs, const NewtonSystem::Product& hessian, const Precondition& precondition,
             const VectorX& gradient, double nothing, double enough, double jump, Response& response) {
  VectorX residual = -at_unknowns(dofs, gradient), motion = VectorX::Zero(residual.size());
  response = {at_dofs(dofs, motion)};
  VectorX z = precondition(residual), p = z, product(residual.size());
  double rz = residual.dot(z);
  for (int i = 0; rz > nothing; ++i) {
    if (i == kMostIterations) return End::slow;
    hessian(p, product);
    const double curvature = p.dot(product);
    if (!(curvature > 0)) return End::indefinite;
    const double step = rz / curvature, gain = 0.5 * step * rz;
    motion += step * p;
    residual -= step * product;
    response.gain += gain;
    if (gain < enough * std::abs(response.gain - jump)) break;
    z = precondition(residual);
    const double next = residual.dot(z);
    p = z + next / rz * p;
    rz = next;
  }
  response.motion = at_dofs(dofs, motion);
  return std::isfinite(response.gain) ? End::converged : End::slow;
}

/// Inverses of the diagonal blocks of nodes that are new in the finer space.
template <int Dim>
std::vector<Mat<Dim>> inverse_blocks(const FinerSpace<Dim>& space, const DofMap& dofs, const SparseAssembler& assembler) {
  std::vector<int> dof_of(dofs.num_unknowns);
  for (std::size_t i = 0; i < dofs.unknown.size(); ++i)
    if (dofs.unknown[i] != kNone) dof_of[dofs.unknown[i]] = static_cast<int>(i);
  std::vector<Mat<Dim>> blocks(space.is_new.size(), Mat<Dim>::Zero());
  const linear::SparsityPattern& pattern = assembler.pattern();
  for (int j = 0; j < pattern.order; ++j) {
    const int node = dof_of[j] / Dim;
    if (!space.is_new[node]) continue;
    for (int k = pattern.column_starts[j]; k < pattern.column_starts[j + 1]; ++k) {
      const int row = dof_of[pattern.row_indices[k]];
      if (row / Dim == node) blocks[node](row % Dim, dof_of[j] % Dim) = assembler.values()[k];
    }
  }
  for (std::size_t node = 0; node < blocks.size(); ++node) {
    if (!space.is_new[node]) continue;
    Mat<Dim>& block = blocks[node];
    for (int c = 0; c < Dim; ++c)
      if (dofs.unknown[Dim * node + c] == kNone) block(c, c) = 1;
    const Eigen::LLT<Mat<Dim>> llt(block);  // which reads the lower triangle
    if (llt.info() == Eigen::Success)
      block = llt.solve(Mat<Dim>::Identity());
    else
      block = block.diagonal().cwiseAbs().cwiseInverse().asDiagonal();
  }
  return blocks;
}

void make_unknown(std::initializer_list<VectorX*> fields) {
  for (VectorX* field : fields) field->setConstant(std::numeric_limits<double>::quiet_NaN());
}

/// Why errors of such a step cannot be estimated; empty: they can.
template <int Dim>
std::string why_unknown(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh) {
  if (setup.proxy && !setup.proxy->retraction) return "contact acts on another surface than the mesh's";
  if (setup.follower.forces) return "forces of the program follow its own nodes";
  if (setup.lump_mass) return "the mass is lumped";
  if (setup.contact.enabled && has_closed_faces(mesh)) return "faces that coincide at rest are closed";
  return {};
}

/// Barycentric coordinates at rest of a point in the best of these cells, with its vertices.
struct PointOfCell {
  std::array<VertexId, 3> vertices;
  Vec<3> weights;
};
PointOfCell locate(const Mesh<2>& mesh, std::span<const CellId> cells, const Vec<2>& X) {
  PointOfCell best{{}, Vec<3>::Constant(-std::numeric_limits<double>::infinity())};
  for (const CellId c : cells) {
    const auto& [i, j, k] = mesh.cell(c);
    Mat<2> edges;
    edges << mesh.rest(j) - mesh.rest(i), mesh.rest(k) - mesh.rest(i);
    const Vec<2> at = edges.inverse() * (X - mesh.rest(i));
    const Vec<3> weights(1 - at.sum(), at[0], at[1]);
    if (weights.minCoeff() > best.weights.minCoeff()) best = {{i, j, k}, weights};
  }
  return best;
}

/// The weights of a retracted surface over the nodes of a finer space with curved edges: to positions on the mesh come those
/// that the curves add along the surface, as means over the hats of its vertices.
Eigen::SparseMatrix<double, Eigen::RowMajor> finer_weights(const CollisionProxy<2>& proxy, const Mesh<2>& mesh) {
  constexpr double kGauss = 0.28867513459481287;  // half of 1 / sqrt(3)
  std::vector<Eigen::Triplet<double>> entries;
  std::vector<std::vector<CellId>> cells(proxy.rest.size());
  for (int i = 0; i < proxy.weights.rows(); ++i)
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(proxy.weights, i); it; ++it) {
      entries.emplace_back(i, static_cast<int>(it.col()), it.value());
      const auto around = mesh.cells_of(static_cast<VertexId>(it.col()));
      cells[i].insert(cells[i].end(), around.begin(), around.end());
    }
  std::vector<double> measure(proxy.rest.size(), 0);
  const auto length = [&](const auto& edge) { return (proxy.rest[edge[0]] - proxy.rest[edge[1]]).norm(); };
  for (const auto& edge : proxy.edges)
    for (const int end : edge) measure[end] += length(edge) / 2;
  for (const auto& edge : proxy.edges) {
    std::vector<CellId> near = cells[edge[0]];
    near.insert(near.end(), cells[edge[1]].begin(), cells[edge[1]].end());
    for (const double t : {0.5 - kGauss, 0.5 + kGauss}) {
      const PointOfCell at = locate(mesh, near, (1 - t) * proxy.rest[edge[0]] + t * proxy.rest[edge[1]]);
      for (const int end : {0, 1}) {
        const double share = (end == 0 ? 1 - t : t) * length(edge) / 2 / measure[edge[end]];
        for (int k = 0; k < 3; ++k) {
          const VertexId a = at.vertices[k], b = at.vertices[(k + 1) % 3];
          const double curve = 4 * share * at.weights[k] * at.weights[(k + 1) % 3];
          entries.emplace_back(edge[end], mesh.node_of(a, b), curve);
          for (const VertexId v : {a, b}) entries.emplace_back(edge[end], v, -curve / 2);
        }
      }
    }
  }
  Eigen::SparseMatrix<double, Eigen::RowMajor> weights(proxy.weights.rows(), mesh.num_nodes());
  weights.setFromTriplets(entries.begin(), entries.end());
  return weights;
}

/// Changes by d-hat, friction's velocity, lagging and the solver on the mesh itself, by ErrorSource. Gradients at x are
/// those as the solve lagged (`before`), and as lagged at x (`now`).
template <int Dim>
std::array<Change, kErrorSources> find_changes(const StepSetup<Dim>& setup, StepProblem<Dim>& problem, const VectorX& x,
                                               const typename StepProblem<Dim>::Gradients& before,
                                               const typename StepProblem<Dim>::Gradients& now) {
  std::array<Change, kErrorSources> changes;
  const auto of = [&](ErrorSource source) -> Change& { return changes[static_cast<std::size_t>(source)]; };
  for (Change& change : changes) change.all = change.contact = change.friction = VectorX::Zero(x.size());
  of(ErrorSource::solver).all = at_dofs(problem.dofs(), at_unknowns(problem.dofs(), before.all));
  of(ErrorSource::lag).all = now.all - before.all;
  of(ErrorSource::lag).friction = now.friction - before.friction;
  if (!setup.contact.enabled || now.contact.isZero(0)) return changes;
  const auto contact = problem.contact_at(x, 1), nearer = problem.contact_at(x, 1 - kDhatChange);
  Change& dhat = of(ErrorSource::dhat);
  dhat.all = dhat.contact = (nearer.gradient - contact.gradient) / kDhatChange;
  dhat.energy = (nearer.value - contact.value) / kDhatChange;
  if (now.friction.isZero(0)) return changes;
  const auto friction = problem.friction_at(x, 1), sharper = problem.friction_at(x, 0.5);
  Change& smoothing = of(ErrorSource::friction);
  smoothing.all = smoothing.friction = sharper.gradient - friction.gradient;
  smoothing.energy = sharper.value - friction.value;
  return changes;
}

/// Adds to `change` what a motion from x changes, to first order. Differences are central: forces of contact are small
/// beside what they lose and gain along the motion.
template <int Dim>
typename StepProblem<Dim>::Gradients with_motion(const Change& change, StepProblem<Dim>& problem, const VectorX& x,
                                                 const VectorX& motion) {
  typename StepProblem<Dim>::Gradients sum{change.all, change.contact, change.friction, VectorX::Zero(x.size())};
  const double largest = motion.template lpNorm<Eigen::Infinity>();
  if (largest == 0) return sum;
  const auto places = x.reshaped(Dim, x.size() / Dim);
  const double diagonal = (places.rowwise().maxCoeff() - places.rowwise().minCoeff()).norm();
  const double part = std::min(kLeastMotion * diagonal, kPartOfGap * problem.min_distance(x)) / largest;
  for (const double side : {part, -part}) {
    const VectorX there = x + side * motion;
    problem.lag_as(problem, there);
    const auto at = problem.gradients(there);
    sum.all += at.all / (2 * side);
    sum.contact += at.contact / (2 * side);
    sum.friction += at.friction / (2 * side);
    sum.applied += at.applied / (2 * side);
  }
  problem.lag_as(problem, x);
  return sum;
}

/// Changes of gradients on the mesh, scaled, as those of the forces of which they are.
template <int Dim>
NodalForces forces_of(const typename StepProblem<Dim>::Gradients& change, const StepProblem<Dim>& problem,
                      Eigen::Index bodies) {
  const double unit = -1 / problem.scaling();
  const Eigen::Index obstacles = change.all.size() - bodies;
  NodalForces forces;
  forces.contact = unit * change.contact.head(bodies);
  forces.friction = unit * change.friction.head(bodies);
  forces.applied = unit * change.applied.head(bodies);
  forces.obstacle_contact = unit * change.contact.tail(obstacles);
  forces.obstacle_friction = unit * change.friction.tail(obstacles);
  forces.body = forces.residual = forces.reaction = VectorX::Zero(bodies);
  for (Eigen::Index i = 0; i < bodies; ++i)
    if (problem.dofs().unknown[i] == kNone) forces.reaction[i] = -unit * change.all[i];
  return forces;
}

}  // namespace

template <int Dim>
History FinerSpace<Dim>::prolong(History history) const {
  for (auto* fields : {&history.x, &history.v, &history.a})
    for (VectorX& field : *fields) field = prolong(field);
  return history;
}

/// The factor of the last solve preconditions; where there is none, or `anew`, one of the Hessian at x.
template <int Dim>
bool ErrorEstimator<Dim>::provide_factor(StepProblem<Dim>& problem, const VectorX& x, bool anew) {
  const VectorX zero = VectorX::Zero(problem.dofs().num_unknowns);
  if (!anew && precondition(zero).size() == zero.size()) return true;
  return problem.assemble(x, PsdProjection::clamp).factorize(0).outcome == linear::Outcome::ok &&
         precondition(zero).size() == zero.size();
}

/// By the factor that is there; empty without one.
template <int Dim>
VectorX ErrorEstimator<Dim>::precondition(const VectorX& residual) {
  VectorX z = VectorX::Zero(residual.size());
  if (z.size() > 0 && !solver_.precondition(span_of(residual), span_of(z))) z.resize(0);
  return z;
}

/// Minimises, if need be with a new factor. Says in `no_bar` where that fails.
template <int Dim>
template <typename Minimise>
bool ErrorEstimator<Dim>::try_factors(StepProblem<Dim>& problem, const VectorX& x, std::string& no_bar,
                                      const Minimise& minimise) {
  for (const bool anew : {false, true}) {
    if (!provide_factor(problem, x, anew)) {
      no_bar = "the linear solver keeps no factor";
      return false;
    }
    const End end = minimise();
    if (end == End::converged) return true;
    no_bar = end == End::indefinite ? "the solution is not stable" : "the linear estimate does not converge";
    if (end == End::indefinite) return false;
    if (!anew) no_bar.clear();
  }
  return false;
}

/// The history before the step in the finer space, with the errors that earlier steps have left in it.
template <int Dim>
History ErrorEstimator<Dim>::finer_history(const State<Dim>& state) const {
  return carried_.added_to(space_->prolong(state.history), state.history, space_->revision);
}

/// Keeps the errors that the step leaves to the next: `motion` those of its positions.
template <int Dim>
void ErrorEstimator<Dim>::carry(const StepSetup<Dim>& setup, const State<Dim>& state, History history, const VectorX& x,
                                const VectorX& motion) {
  const TimeIntegrator integrator(setup.time);
  History coarse = state.history;
  integrator.push(x, coarse);
  integrator.push(space_->prolong(x) + motion, history);
  carried_ = {space_->revision, x, difference(history, space_->prolong(coarse))};
}

/// Estimates the errors by the mesh: what a finer space gains, with forces on the nodes of the mesh.
template <int Dim>
bool ErrorEstimator<Dim>::estimate_mesh(const StepSetup<Dim>& setup, const State<Dim>& state, StepProblem<Dim>& problem,
                                        const VectorX& x, const typename StepProblem<Dim>::Gradients& at_x,
                                        ErrorReport& report, ErrorFields::OfSource& fields) {
  const FinerSpace<Dim>& space = *space_;
  const History history = finer_history(state);
  const VectorX fine_x = space.prolong(x);
  std::optional<StepSetup<Dim>> finer;
  if (space.proxy) (finer = setup)->proxy = space.proxy;
  StepProblem<Dim> fine(finer ? *finer : setup, space.mesh, history, state.t, cache_, problem.stiffness());
  fine.lag_as(problem, fine_x);
  const auto at_fine_x = fine.gradients(fine_x);
  const Change change{at_fine_x.all - space.inject(at_x.all), at_fine_x.contact - space.inject(at_x.contact),
                      at_fine_x.friction - space.inject(at_x.friction)};
  const double start = fine.sum().value(fine_x, fine.workspace());
  if (!change.all.allFinite() || !std::isfinite(start)) {
    report.no_bar = "the solution is not possible in a finer space";
    return false;
  }
  // Finer patches raise the energy of the same positions.
  const double jump = fine.cells().patches ? start - problem.sum().value(x, problem.workspace()) : 0;
  Response response;
  const auto solve = [&] {
    End end = End::indefinite;
    for (const PsdProjection psd : {PsdProjection::none, PsdProjection::clamp}) {  // contact may be indefinite
      const SparseSystem& system = fine.assemble(fine_x, psd);
      const auto blocks = inverse_blocks(space, fine.dofs(), system.assembler());
      const auto by_levels = [&](const VectorX& residual) {
        const VectorX all = at_dofs(fine.dofs(), residual);
        VectorX motion =
            space.prolong(at_dofs(problem.dofs(), precondition(at_unknowns(problem.dofs(), space.restrict(all)))));
        for (std::size_t node = 0; node < blocks.size(); ++node)
          if (space.is_new[node])
            motion.template segment<Dim>(Dim * node) += blocks[node] * all.template segment<Dim>(Dim * node);
        return at_unknowns(fine.dofs(), motion);
      };
      end = minimise(fine.dofs(), system.product(), by_levels, change.all, kNothing * std::abs(start), kEnough, jump,
                     response);
      if (end != End::indefinite) break;
    }
    return end;
  };
  if (!try_factors(problem, x, report.no_bar, solve)) return false;
  const double fall = start - fine.sum().value(fine_x + kTried * response.motion, fine.workspace());
  const double expected = kTried * (2 - kTried) * response.gain;
  if (expected > kResolvedFall * std::abs(start) && !(fall > expected / kOffByMost && fall < expected * kOffByMost)) {
    report.no_bar = "errors are too large for a linear estimate: the mesh does not resolve the solution";
    return false;
  }
  report.energy[0] = (start - problem.sum().value(x, problem.workspace()) - response.gain) / problem.scaling();
  fields.displacement = space.at_coarse_nodes(response.motion);
  if (setup.fields.any_forces()) {
    const auto moved = with_motion<Dim>(change, fine, fine_x, response.motion);
    fields.forces = forces_of<Dim>({space.restrict(moved.all), space.restrict(moved.contact), space.restrict(moved.friction),
                                    space.restrict(moved.applied)},
                                   problem, Eigen::Index{Dim} * state.mesh.num_nodes());
  }
  carry(setup, state, history, x, response.motion);
  return true;
}

/// Estimates the errors by a source on the mesh itself.
template <int Dim>
bool ErrorEstimator<Dim>::estimate_other(const StepSetup<Dim>& setup, const State<Dim>& state, StepProblem<Dim>& problem,
                                         const VectorX& x, const Change& change, const NewtonSystem::Product& hessian,
                                         std::string& no_bar, double& energy, ErrorFields::OfSource& fields) {
  const double nothing = kNothing * std::abs(problem.sum().value(x, problem.workspace()));
  Response response{VectorX::Zero(x.size())};
  const auto solve = [&] {
    const auto by_factor = [&](const VectorX& residual) { return precondition(residual); };
    return minimise(problem.dofs(), hessian, by_factor, change.all, nothing, kEnoughInContact, 0, response);
  };
  if (!change.all.isZero(0) && !try_factors(problem, x, no_bar, solve)) return false;
  // Where a source changes the energy itself, that is of first order, and the gain of second.
  energy = (change.energy != 0 ? change.energy : -response.gain) / problem.scaling();
  fields.displacement = response.motion;
  if (setup.fields.any_forces())
    fields.forces = forces_of<Dim>(with_motion<Dim>(change, problem, x, response.motion), problem,
                                   Eigen::Index{Dim} * state.mesh.num_nodes());
  return true;
}

/// Estimates what steps have put the solution off by; NaN where that is not known.
template <int Dim>
void ErrorEstimator<Dim>::estimate_time(const StepSetup<Dim>& setup, const State<Dim>& state, StepProblem<Dim>& problem,
                                        const VectorX& x, Change& change, const NewtonSystem::Product& hessian,
                                        double& energy, ErrorFields::OfSource& fields) {
  std::string no_bar;
  const auto filter = [&](const VectorX& momentum) -> VectorX {
    Response response;
    const auto solve = [&] {
      const auto by_factor = [&](const VectorX& residual) { return precondition(residual); };
      return minimise(problem.dofs(), hessian, by_factor, -momentum, 0, kEnough, 0, response);
    };
    return try_factors(problem, x, no_bar, solve) ? response.motion : VectorX();
  };
  time_bars_.find(setup, state, problem, x, filter, change);
  if (!estimate_other(setup, state, problem, x, change, hessian, no_bar, energy, fields)) time_bars_.lose();
  time_bars_.keep(setup, state, problem, x, fields.displacement);
  if (!time_bars_.knows_displacements()) make_unknown({&fields.displacement});
  if (time_bars_.knows_forces()) return;
  NodalForces& forces = fields.forces;
  make_unknown({&forces.contact, &forces.friction, &forces.applied, &forces.obstacle_contact, &forces.obstacle_friction,
                &forces.body, &forces.residual, &forces.reaction});
  energy = std::numeric_limits<double>::quiet_NaN();
}

template <int Dim>
ErrorFields ErrorEstimator<Dim>::estimate(const StepSetup<Dim>& setup, const State<Dim>& state, StepProblem<Dim>& problem,
                                          const VectorX& x, ErrorReport& report) {
  report.is_asked = true;
  report.no_bar = why_unknown(setup, state.mesh);
  if (!report.no_bar.empty()) return {};
  const int obstacles = static_cast<int>(setup.obstacles.rest.size());
  if (!space_ || space_->revision != state.mesh.revision() || space_->obstacle_vertices != obstacles) {
    space_ = std::make_unique<FinerSpace<Dim>>(state.mesh, obstacles);
    if constexpr (Dim == 2)
      if (setup.proxy) (space_->proxy = setup.proxy)->weights = finer_weights(*setup.proxy, space_->mesh);
  }
  ErrorFields errors;
  errors.sources.resize(kErrorSources);
  const auto as_solved = problem.gradients(x);
  problem.lag_as(problem, x);
  const auto at_x = problem.gradients(x);
  auto changes = find_changes(setup, problem, x, as_solved, at_x);
  NewtonSystem::Product product;
  const auto hessian = [&](ConstVectorView v, VectorView Hv) {
    if (!product) product = problem.assemble(x, PsdProjection::none).product();
    product(v, Hv);
  };
  constexpr auto kTime = static_cast<std::size_t>(ErrorSource::time);
  estimate_time(setup, state, problem, x, changes[kTime], hessian, report.energy[kTime], errors.sources[kTime]);
  bool are_known = estimate_mesh(setup, state, problem, x, at_x, report, errors.sources[0]);
  for (std::size_t s = 1; s < kTime && are_known; ++s)
    are_known =
        estimate_other(setup, state, problem, x, changes[s], hessian, report.no_bar, report.energy[s], errors.sources[s]);
  if (!are_known) {
    report.energy = {};
    return {};
  }
  if (-report.energy[0] > kUnresolved * state.stored_energy) {
    report.no_bar = "the mesh does not resolve the solution";
    return {};
  }
  for (auto& source : errors.sources) source.displacement.conservativeResize(Eigen::Index{Dim} * state.mesh.num_nodes());
  return errors;
}

#define ITR_INSTANTIATE(Dim)       \
  template struct FinerSpace<Dim>; \
  template class ErrorEstimator<Dim>;
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
