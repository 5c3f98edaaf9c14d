// SPDX-License-Identifier: MIT
// Values of a simulation after a step, for observers (output, a host program).
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "itr/mesh.hpp"
#include "itr/types.hpp"

namespace itr {

/// Why an operation was not done.
enum class Refusal : char {
  none,
  not_asked,  ///< it was left out before anything was computed: it is not counted
  // No trial was worth its time.
  depth,       ///< as many generations of the edge as a step may have are there
  length,      ///< the edge is too short for a split, too long for a collapse, or a move too short
  dhat,        ///< halves of a surface edge would be shorter than dhat
  prediction,  ///< derivatives at the present positions promise too little
  // No edit can be made.
  gone,          ///< no such edge, facet or vertex in the mesh
  non_manifold,  ///< the cells around it are neither a ball nor a half ball
  held,       ///< whatever would have to go or move is on a feature, corner or patch that it may not leave: the shape would
              ///< change
  link,       ///< a collapse that would change the topology of the bodies, their surfaces or features (link condition)
  exists,     ///< the edge that a swap makes is there already
  long_ring,  ///< an edge to be removed has too many cells around it
  shape,      ///< a cell would be inverted, flat, or much worse than the worst that is there now
  overhang,   ///< a surface edge that touches would be farther out than its chords
  outside,    ///< the target of a move lies outside of the cells around
  cost,       ///< infinite cost of each triangulation of the ring
  // A trial refused the edit.
  invalid,     ///< some stored configuration would have inversions or intersections
  bound,       ///< the energy cannot fall by enough: the new vertex alone tells
  energy,      ///< a relaxed patch does not gain enough
  no_unknowns  ///< nothing of the patch is free
};
inline constexpr int kRefusals = static_cast<int>(Refusal::no_unknowns) + 1;
/// As in `steps.jsonl`.
ITR_EXPORT std::string_view name(Refusal refusal);

struct OperationCount {
  int tried = 0, accepted = 0;
  int relaxed = 0;                       ///< tried operations that a relaxed patch decided; bounds decided the others
  std::array<int, kRefusals> refused{};  ///< by Refusal; more than were tried, as most are refused without a trial
  /// Counts a refusal, unless nobody asked or the candidate is gone.
  void note(Refusal reason) {
    if (reason != Refusal::none && reason != Refusal::not_asked && reason != Refusal::gone)
      ++refused[static_cast<int>(reason)];
  }
  int refused_by(Refusal reason) const { return refused[static_cast<int>(reason)]; }
  OperationCount& operator+=(const OperationCount& other) {
    tried += other.tried;
    accepted += other.accepted;
    relaxed += other.relaxed;
    for (int i = 0; i < kRefusals; ++i) refused[i] += other.refused[i];
    return *this;
  }
};

struct SetNames;

/// Terms of the incremental potential divided by alpha h^2 [J], after the last solve of the step.
struct EnergyReport {
  double inertia = 0, elastic = 0, body = 0, contact = 0, friction = 0, damping = 0, total = 0;
  double host = 0;  ///< of what the program adds, Setup::terms and Setup::follower: part of the total
};

/// Wall-clock seconds of one step. The parts are disjoint and sum to the total but for what nobody names.
struct ITR_EXPORT StepSeconds {
  double assembly = 0, linear_solve = 0, line_search = 0, ccd = 0, remesh = 0, projection = 0, output = 0, total = 0;
  StepSeconds& operator+=(const StepSeconds& other);
};

/// Change of a body's momentum, and of its moment about the origin, by edits of the mesh.
struct MomentumChange {
  int body = 0;
  std::vector<double> linear;   ///< Dim numbers [kg m/s]
  std::vector<double> angular;  ///< 1 in 2D, 3 in 3D [kg m^2/s]
};
/// Adds changes by body.
ITR_EXPORT void add_changes(const std::vector<MomentumChange>& changes, double factor, std::vector<MomentumChange>& sum);

/// Trial of an adaptive step that was taken again with a shorter one.
struct RejectedStep {
  double dt = 0;       ///< of the trial [s]
  double error = 0;    ///< its local error, a part of the energy norm; not finite where there is no solution to tell it
  std::string reason;  ///< "error in time", "impact", or why no solution was found
};

/// Sources of errors that a step estimates (docs/theory.md, "Error bars"). In the order of files.
enum class ErrorSource {
  mesh,      ///< cells are too large
  dhat,      ///< contact acts from a distance
  friction,  ///< friction is smoothed below a velocity
  lag,       ///< friction and others are those of an iterate before
  solver,    ///< iterations ended
  time       ///< steps are too long; not a number where that is not known
};
inline constexpr int kErrorSources = 6;
/// As in files.
ITR_EXPORT std::string_view name(ErrorSource source);

/// Estimated errors of the energy: what is to be added to it for a better one.
struct ErrorReport {
  bool is_asked = false;
  std::array<double, kErrorSources> energy{};  ///< of the total, by ErrorSource [J]
  std::string no_bar{};                        ///< why there is no estimate; empty: there is one
  double seconds = 0;                          ///< that the estimate took
};

struct ITR_EXPORT StepReport {
  int step = 0;
  double t = 0;   ///< [s]
  double dt = 0;  ///< length, where steps are adaptive [s]; else 0
  /// Local error of an adaptive step, in the energy norm, by that of the largest energy so far (docs/theory.md, "Adaptive
  /// time"). Its sum over the run estimates the error in time at its end.
  double time_error = 0;
  int rejected_steps = 0;                ///< adaptive: trials that were taken again with a shorter step
  std::vector<RejectedStep> rejections;  ///< these, in their order
  int vertices = 0, elements = 0, unknowns = 0;
  int newton_iterations = 0;
  int linear_solves = 0;      ///< systems of the whole mesh: Newton's, and those of the safe projection
  int factorizations = 0;     ///< for them
  int reused_factors = 0;     ///< systems that a factor of an earlier one solved
  int linear_iterations = 0;  ///< of conjugate gradients over such factors, failed attempts included
  int indefinite = 0;         ///< factorised Hessians with negative eigenvalues, where the solver tells
  EnergyReport energy;
  double energy_before_remesh = 0;  ///< total after the first solve [J]
  /// Jump of the total where surfaces were put onto their shapes: material comes or goes there, which is no gain [J].
  double shape_energy = 0;
  /// Energy that the projection onto the new mesh forgot, 1/2 ||xhat_old - xhat_new||^2 / (alpha h^2) of the predictor [J]:
  /// not gained by remeshing, though the total is lower by it. Of viscoelastic bodies, too, what their state lost where it
  /// was averaged over new cells, and of softening ones the dissipated energy that the cells put elsewhere. Over all parts
  /// of a step that was cut.
  double history_loss = 0;
  double viscous_dissipation = 0;  ///< by viscoelastic bodies [J]
  double softening = 0;            ///< energy that Mullins' softening dissipated [J]
  double wetted = 0;               ///< part of the rest area that fluids may wet where they are
  int leaks = 0;                   ///< fluids that have come to where they should not
  /// By body that edits touched: momentum that they changed, as impulses over the step. The rate of momentum (the
  /// acceleration of the integrator, from the momenta that were reported) times dt is that of the forces plus these. Empty
  /// without inertia.
  std::vector<MomentumChange> remeshing;
  OperationCount splits, curves, straightens, collapses, swaps, smooths;
  int bound_by_dhat = 0;          ///< surface edges that were not split because the halves would be below dhat
  int reverted_remeshes = 0;      ///< all of a step's operations were dropped, as the state on the new mesh failed
  double split_tolerance = 0;     ///< of this step [J]; 0: no remeshing
  double best_refused_split = 0;  ///< largest gain of a refused split, as it was predicted or found [J]
  double residual_worth = 0;      ///< gain of one more Newton iteration at the end, by the quadratic model [J]
  double trial_seconds = 0;       ///< median over the trials of these operations; 0 where there were none
  int refined_quadrature = 0;     ///< cells with curved edges whose elastic energy has a finer quadrature
  int order = 0;                  ///< of accuracy of the integrator that took it, see TimeIntegrator::accuracy
  int cut_steps = 0;              ///< smaller steps that it was cut into, see TimeOptions::step_cuts; 0: it was not
  int damped_steps = 0;           ///< Newmark only: 1 if taken by implicit Euler, to keep energy from growing
  double min_distance = 0;        ///< over contact pairs nearer than dhat; infinity where there are none [m]
  double min_volume_ratio = 1;    ///< smallest J = det F over the cells
  StepSeconds seconds;
  double processor_seconds = 0;  ///< of the whole process, all threads, from begin to end of the step, without output
  double peak_rss_mb = 0;
  ErrorReport errors;  ///< where FieldOptions::error_bars asks for them

  /// Adds the effort of what came before: iterations, operations, forgotten history and momentum, damped and cut steps,
  /// seconds, processor seconds.
  void add_effort(const StepReport& before);
  /// Forgets the operations of a mesh that was dropped: none of them was accepted.
  void forget_operations();
};

/// Forces on the bodies' vertices at the end of a step, interleaved [N]; 2D: by thickness. Of a dynamic step that was cut
/// they are the means over its parts. The sum of all over the bodies, the residual subtracted and the remeshing added, is
/// the rate of momentum. Empty where not asked for.
struct NodalForces {
  VectorX contact, friction;  ///< contact with its damping
  VectorX reaction;  ///< of what holds a vertex in its prescribed directions; 0 elsewhere, and before the first step
  VectorX applied;   ///< of tractions, pressures and what the program adds; not of body forces
  VectorX body;      ///< body forces; asked for with `applied`
  VectorX residual;  ///< sum of all forces and inertia that the solve left where nothing is held; asked for with `reaction`
  VectorX obstacle_contact, obstacle_friction;  ///< on the obstacles' vertices
  std::vector<MomentumChange> remeshing;        ///< StepReport::remeshing by dt: forces [N] and moments [N m]
};

/// Members of NodalForces on the bodies' vertices, in the order of `itr_force`, and on the obstacles'.
inline constexpr std::array kForcesOnBodies{&NodalForces::contact, &NodalForces::friction, &NodalForces::reaction,
                                            &NodalForces::applied, &NodalForces::body,     &NodalForces::residual};
inline constexpr std::array kForcesOnObstacles{&NodalForces::obstacle_contact, &NodalForces::obstacle_friction};

/// Estimated errors by ErrorSource, as ErrorReport; empty: there are none.
struct ErrorFields {
  struct OfSource {
    NodalForces forces;    ///< those that the setup asks for
    VectorX displacement;  ///< of the bodies' nodes, interleaved [m]
  };
  std::vector<OfSource> sources;
};

/// Forces on a ForceTarget: on each line force (Dim numbers) [N] and moment (1 in 2D, 3 in 3D) [N m], of contact, friction,
/// reactions, all (with tractions, pressures and forces of the program), body forces, the residual, and the momentum of its
/// bodies that edits changed.
struct ForceCurvePoint {
  std::string name;
  std::array<std::vector<double>, 7> kinds;  ///< the last three are empty where a stored frame does not have them
  /// Estimated errors of the first four, by ErrorSource; empty: there are none.
  std::vector<std::array<std::vector<double>, 4>> errors{};
  /// Volume [m^Dim] and overpressure [Pa] (2D: [N/m]) of the Cavity of this name; not a number: there is none of it. Empty:
  /// the setup has no cavities.
  std::vector<double> cavity{};
};

/// A PointTarget at the end of a step.
struct PointValue {
  std::string name;
  std::vector<double> x, u;                   ///< position and displacement, Dim numbers each [m]
  std::vector<std::vector<double>> errors{};  ///< estimated, of u, by ErrorSource; empty: there are none
};

/// Fields that a scene may ask for (FieldOptions); empty where it does not.
struct AskedFields {
  NodalForces forces;
  std::vector<double> von_mises;       ///< a cell [Pa]; in 2D of the plane stress, or strain, that the material says
  std::vector<double> stress;          ///< Cauchy stress, Dim x Dim a cell, row-major [Pa]
  std::vector<double> pressure;        ///< a cell: minus the mean normal stress [Pa]
  std::vector<double> stretches;       ///< three a cell: in the plane (3D: all) the largest first, then across it
  VectorX contact_pressure;            ///< a node of the bodies [Pa]
  std::vector<double> kinetic_energy;  ///< of all bodies, one number [J]
  std::vector<double> momentum;        ///< of all bodies, Dim numbers [kg m/s]
  std::vector<ForceCurvePoint> curves;
  std::vector<PointValue> points;
};

/// The surface that touches in place of the bodies' boundary, see CollisionProxy. Null: there is none.
template <int Dim>
struct ProxyView {
  const std::vector<Vec<Dim>>* x = nullptr;  ///< positions now [m]
  const std::vector<std::array<int, 2>>* edges = nullptr;
  const std::vector<std::array<int, 3>>* triangles = nullptr;
};

/// The state after a step on its own mesh. References are valid during the observer's call only.
template <int Dim>
struct FrameView {
  const Mesh<Dim>& mesh;                       ///< compact: no dead slots
  ConstVectorView x;                           ///< positions of the bodies' nodes (vertices first), interleaved [m]
  ConstVectorView v;                           ///< velocities [m/s]
  const std::vector<double>& elastic_density;  ///< elastic energy by rest volume, a cell [J/m^3]
  const std::vector<Vec<Dim>>& obstacle_x;     ///< obstacle positions now [m]
  const std::vector<std::array<int, 2>>& obstacle_edges;
  const std::vector<std::array<int, 3>>& obstacle_triangles;
  const AskedFields* asked = nullptr;  ///< null: nothing was asked for
  ProxyView<Dim> proxy{};
  const SetNames* names = nullptr;  ///< of body ids and tags of the mesh; null: there are none
  double dhat = 0;                  ///< ContactOptions::reach_of_closed [m]
};

}  // namespace itr
