// SPDX-License-Identifier: MIT
// Materials, and the options of a simulation: plain values.
#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "itr/core.hpp"
#include "itr/types.hpp"

namespace itr {

// Materials.

/// Stored-energy densities; their formulas are in energy/elastic/laws.hpp.
enum class MaterialLaw { neo_hookean, linear, saint_venant_kirchhoff, fixed_corotated, mooney_rivlin, own };

/// Where the volumetric part U(det F) of a law is taken: at each point, or of the mean det F over patches of cells, which
/// keeps nearly incompressible bodies from locking.
enum class VolumeForm { pointwise, patches };

/// A scalar function of rest position X [m]; in 2D X_3 = 0. Empty: none.
using SpaceFunction = std::function<double(const Vec<3>& X)>;

/// Coefficients of the Mooney-Rivlin laws. Two- and three-term forms leave the others 0.
struct MooneyRivlinModuli {
  double c1 = 0;        ///< of the first isochoric invariant [Pa]
  double c2 = 0;        ///< of the second [Pa]
  double c3 = 0;        ///< of their product [Pa]
  double log_k = 0;     ///< k of k/2 (ln J)^2 [Pa]
  double volume_d = 0;  ///< d of d (J - 1)^2 [Pa]
};

/// An energy density W(F) of a program, for F with positive determinant; other F count as infinite. W must be
/// frame-indifferent: W(R F) = W(F). Several threads call it at a time.
class ITR_EXPORT OwnLaw {
 public:
  virtual ~OwnLaw() = default;
  virtual double density(const Eigen::Ref<const MatrixX>& F) const = 0;  ///< [J/m^Dim]
  /// First Piola-Kirchhoff stress dW/dF, Dim x Dim [Pa].
  virtual void stress(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> P) const = 0;
  /// d2W/dF2, Dim^2 x Dim^2, symmetric: F by columns [Pa].
  virtual void hessian(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> H) const = 0;
  /// Whether W is a quadratic form of (F + F^T)/2 - I. An eigenstrain is subtracted from that then.
  virtual bool has_small_strain() const { return false; }
};

/// Strain of a stress-free body at rest position X [m] and time t [s], symmetric; in 2D its third row is that across the
/// plane. Empty: none.
using Eigenstrain = std::function<Mat<3>(const Vec<3>& X, double t)>;
/// Whether such a strain is symmetric and I + strain positive definite.
inline bool is_eigenstrain(const Mat<3>& strain) {
  const Mat<3> F = Mat<3>::Identity() + strain;
  return F.allFinite() && F == F.transpose() && F(0, 0) > 0 && F(0, 0) * F(1, 1) > F(0, 1) * F(0, 1) && F.determinant() > 0;
}

/// A term of the relaxation function of shear moduli, 1 - sum g (1 - exp(-t / tau)).
struct PronyTerm {
  double g;    ///< share of the instantaneous moduli
  double tau;  ///< [s]
};

/// Mullins' softening (docs/theory.md, "Softening"): below the largest density W_max of the past the energy density W of
/// changes of shape counts 1 - erf((W_max - W) / (m + beta W_max)) / r times.
struct MullinsSoftening {
  double r;     ///< > 1
  double m;     ///< [Pa]
  double beta;  ///< not both of these 0
};

/// The material of a body. In 2D all values are per unit thickness.
struct Material {
  MaterialLaw law = MaterialLaw::neo_hookean;
  double youngs_modulus = 1e5;  ///< E [Pa]; of small strains where the law has other moduli; the largest where it varies
  double poisson_ratio = 0.3;   ///< as for E
  double density = 1;           ///< rho [kg/m^3], in 2D too
  bool plane_strain = false;    ///< 2D: lambda = E nu / ((1 + nu)(1 - 2 nu)) instead of nu E / (1 - nu^2)
  MooneyRivlinModuli mooney_rivlin{};
  std::shared_ptr<const OwnLaw> own{};  ///< of MaterialLaw::own; E and nu then are those of small strains, a scale
  std::function<std::shared_ptr<const OwnLaw>(double t)> own_at{};  ///< that at time t [s] instead; empty: `own` always
  VolumeForm volume = VolumeForm::pointwise;
  std::vector<PronyTerm> prony{};  ///< viscoelasticity of the deviator (docs/theory.md, "Viscoelasticity"); empty: elastic
  std::optional<MullinsSoftening> mullins{};  ///< empty: none
  /// Factor of the law's resistance to changes of shape, which leaves its bulk modulus at rest as it is; with terms of
  /// `prony` the instantaneous law has it.
  double deviator = 1;

  /// Functions that replace the constants above, sampled at the rest barycentre of each element. Empty: the constant.
  SpaceFunction youngs_modulus_at{}, poisson_ratio_at{}, density_at{};

  Eigenstrain eigenstrain{};        ///< of heat or swelling (docs/theory.md, "Eigenstrain")
  bool eigenstrain_varies = false;  ///< in space
  double eigenstrain_time = 0;      ///< t of `eigenstrain` [s]: a step sets it

  double lame_mu() const { return lame_mu(youngs_modulus, poisson_ratio); }
  double lame_lambda(int dim) const { return lame_lambda(youngs_modulus, poisson_ratio, dim); }
  /// Whether the law depends on the place.
  bool has_varying_moduli() const { return youngs_modulus_at || poisson_ratio_at || (eigenstrain && eigenstrain_varies); }

  static double lame_mu(double E, double nu) { return E / (2 * (1 + nu)); }
  double lame_lambda(double E, double nu, int dim) const {
    return dim == 2 && !plane_strain ? nu * E / (1 - nu * nu) : E * nu / ((1 + nu) * (1 - 2 * nu));
  }
};

/// Whether stresses depend on where the body has been.
inline bool has_memory(const Material& material) { return !material.prony.empty() || material.mullins; }

// Contact.

/// Surfaces whose friction a FrictionPair is about: of bodies, boundary facets with tags, and of obstacles.
struct FrictionSide {
  std::vector<int> bodies{};             ///< ids
  std::vector<int> surfaces{};           ///< tags of boundary facets
  std::vector<int> obstacle_vertices{};  ///< indices into Obstacles::rest
  bool operator==(const FrictionSide&) const = default;
};

/// Coefficients of a FrictionPair across a direction in 3D; its own are those along it (docs/theory.md, "Friction").
struct FrictionAcross {
  enum class Frame { space, a, b };  ///< b: it turns with the surface of side b
  double statics = 0, kinetic = 0;   ///< by the same ratio as those along it
  Vec<3> direction =
      Vec<3>::Zero();  ///< projected into the plane of contact; where that is normal to it, all slip is across
  Frame frame = Frame::space;
};

/// Coefficients of friction between two surfaces, in either order; both may be the same.
struct FrictionPair {
  FrictionSide a, b;
  double statics = 0;  ///< mu_s: the most that friction resists before it slides, by the normal force
  double kinetic = 0;  ///< mu_k of what slides, at most mu_s
  std::optional<FrictionAcross> across{};

  bool has_two() const { return across && across->statics != statics; }
  double largest() const { return across ? std::max(statics, across->statics) : statics; }
  bool falls() const { return kinetic < statics || (across && across->kinetic < across->statics); }
  /// Whether it has to know how a surface turns.
  bool turns() const { return has_two() && across->frame != FrictionAcross::Frame::space; }
};
inline constexpr int kMostFrictionPairs = 32;

/// Adhesion in the form of Fang et al. 2023 (docs/theory.md, "Adhesion").
struct AdhesionOptions {
  double strength = 0;                ///< Y, of the largest pull; 0: none
  double peak = 1e-3;                 ///< distance of the largest pull [m]
  double reach = 1e-2;                ///< distance from which on nothing pulls [m]
  double tangential_coefficient = 0;  ///< of the largest pull: what holds against sliding
  double velocity = 1e-3;             ///< eps_a [m/s]: sliding twice as fast is not held
  int iterations = 1;                 ///< as ContactOptions::friction_iterations
  /// PolyFEM's way: alpha h^2, which multiplies all other energies of a step, is left out, so that strengths act divided by
  /// it.
  bool is_by_step = false;

  /// Holds against sliding, times the coefficient: the largest pull of a pair, or PolyFEM's Y / (2 peak).
  double lagged_pull() const { return is_by_step ? strength / (2 * peak) : strength; }
};

/// Contact and friction (IPC). docs/theory.md, "Contact", has the exact sums.
struct ContactOptions {
  bool enabled = false;
  /// Surfaces that touch or overlap at the start are pushed apart: a run begins at the equilibrium of the interference, at
  /// rest and without loads (docs/theory.md, "Press fits").
  bool resolve_overlap = false;
  double dhat = 1e-3;  ///< [m]: the barrier acts below it; 0: as Setup::choose_defaults says
  /// Gaps are averaged over coarse smooth surfaces in 2D, which slide then (docs/theory.md, "Averaged gaps").
  bool average_gaps = false;
  bool may_average_gaps = false;     ///< Setup::choose_defaults sets average_gaps where bodies slide that conditions hold
  bool convergent = false;           ///< area weights, duplicate-region correction, 1/dhat^3: kappa is a pressure [Pa]
  double barrier_stiffness = 0;      ///< kappa; 0: as Setup::choose_defaults says
  bool adaptive_stiffness = false;   ///< from barrier_stiffness on as docs/theory.md, "Barrier stiffness", says
  double friction_coefficient = 0;   ///< mu of what is in no pair
  double friction_velocity = 1e-3;   ///< eps_v [m/s]: below it friction is smoothed; 0: chosen (Setup)
  int friction_iterations = 1;       ///< most lagging rounds a step; negative: no limit; 0: no friction
  double friction_tolerance = 1e-2;  ///< rounds end when the re-lagged gradient norm is below this * h
  std::vector<FrictionPair> friction_pairs{};  ///< of several that a contact is in, the first counts

  double largest_friction() const {
    double largest = friction_coefficient;
    for (const FrictionPair& pair : friction_pairs) largest = std::max(largest, pair.largest());
    return largest;
  }
  bool has_friction() const { return enabled && friction_iterations != 0 && largest_friction() > 0; }
  bool has_turning_friction() const {
    return std::any_of(friction_pairs.begin(), friction_pairs.end(), [](const auto& p) { return p.turns(); });
  }
  /// Whether friction falls where something begins to slide.
  bool has_static_friction() const {
    return std::any_of(friction_pairs.begin(), friction_pairs.end(), [](const auto& p) { return p.falls(); });
  }
  AdhesionOptions adhesion{};
  double tie_reach = 0;  ///< how far surfaces that are tied may overlap, for their meshes do not match [m]; 0: no ties

  /// How far faces that are no contact yet may overlap [m].
  double reach_of_closed() const { return std::max(dhat, tie_reach); }
  bool has_adhesion() const { return enabled && adhesion.strength > 0; }
};

// Ties.

/// Surfaces of bodies that are bonded, with any two meshes: boundary facets with these tags. One of them has to cover the
/// other; small gaps between them at rest stay (docs/theory.md, "Ties").
struct Tie {
  std::vector<int> a{}, b{};
  /// Displacement of b less that of a by time, where they are opposite sides of a periodic cell [m].
  std::function<Vec<3>(double)> jump{};
};

// Damping.

/// Stiffness-proportional Rayleigh damping: forces -coefficient * K v, with K the stiffness of one term.
struct DampingOptions {
  enum class Term { elastic, contact };
  Term term = Term::elastic;
  double coefficient = 0;  ///< [s]
  int lagging_rounds = 1;  ///< most solves of a step, each with K of the solution before it
};

// Quadrature.

inline constexpr int kMostQuadratureDegree = 5;
inline constexpr int kElasticDegree = 2;  ///< exact for products of two gradients of quadratic functions

// Time.

enum class Integrator { implicit_euler, newmark, bdf };

/// Steps whose lengths follow from their errors (docs/theory.md, "Adaptive time").
struct AdaptiveTimeOptions {
  bool enabled = false;
  double tolerance = 0.03;    ///< of the energy norm: what a period of a free oscillation may add, about
  double dt_min = 0;          ///< errors shorten no step below it [s]
  double dt_max = 0;          ///< [s]
  double begin = 0, end = 1;  ///< of the run [s]
  double output_dt = 0;  ///< frames and forces are asked for at its multiples after `begin`, and at `end` [s]; 0: always
  std::vector<double> kinks{};  ///< where functions of time are not smooth [s], ascending: steps end there
  double step_end = 0;          ///< of the step that is being taken [s]

  /// The next time after t at which a step has to end [s]; infinity after the end.
  double next_stop(double t) const;
  bool is_asked(double t) const;  ///< whether frames and forces are asked for at the time t of a step's end
};

struct TimeOptions {
  Integrator integrator = Integrator::implicit_euler;
  int bdf_order = 2;           ///< 1..6, for Integrator::bdf
  double newmark_beta = 0.25;  ///< for Integrator::newmark
  double newmark_gamma = 0.5;
  /// Newmark with beta 1/4 and gamma 1/2 keeps energy only to the order of the step: where contact or near-inversion is
  /// much faster than a step, it can create energy without bound. A step that creates some, after which the energy created
  /// so far would exceed this part of the mechanical energy (kinetic, elastic and contact; the larger of those before and
  /// after the step), is taken by implicit Euler instead. Work of loads, held vertices and obstacles is not created.
  /// Infinity: never.
  double energy_growth_limit = 0.05;
  bool quasistatic = false;  ///< no inertia
  bool is_static = false;    ///< one equilibrium at t0 + dt, 1 by default; alpha = 1
  /// A step whose solve fails is cut into two of half its length, and these again, so many times; 0: the simulation stops.
  /// In BDF and Newmark the smaller steps are of implicit Euler, and BDF's order grows again from 1 after them.
  int step_cuts = 0;
  double t0 = 0;                   ///< [s]
  double dt = 1;                   ///< h [s]
  int steps = 1;                   ///< number of steps
  int first_step = 0;              ///< after which it is t0: steps after it have the length dt, those before it had others
  AdaptiveTimeOptions adaptive{};  ///< where it is enabled dt and steps say nothing about steps to come

  bool has_inertia() const { return !quasistatic && !is_static; }
  double time_after(int step) const {  ///< [s]
    return adaptive.enabled && step == first_step + 1 ? adaptive.step_end : t0 + (step - first_step) * dt;
  }
  /// Whether a run that has taken so many steps, to the time t, is at its end.
  bool is_over(int step, double t) const { return adaptive.enabled ? t >= adaptive.end : step >= steps; }
};

// Newton.

/// How gradients g and steps p are measured, with D the diagonal of the mass matrix of unit density: the last two do not
/// depend on the mesh.
enum class NewtonNorm {
  euclidean,  ///< sqrt(g.g), sqrt(p.p)
  l2,         ///< sqrt(g.g/D), sqrt(p.Dp)
  linf        ///< max |g/D|, max |p|
};

/// Treatment of Hessians with negative eigenvalues. It does not depend on the linear solver.
enum class IndefiniteHessian {
  /// Looks for a minimum: projects the Hessian, and does not converge while a factorisation finds the Hessian indefinite.
  /// Solvers that cannot find that get projected Hessians always.
  project,
  /// Takes the direction of the true Hessian if it descends, as PolyFEM does with an L D L^T. May end at a saddle.
  accept
};

/// Progress of a solve after an iteration.
struct NewtonProgress {
  int iteration = 0;         ///< 1 after the first
  double energy = 0;         ///< [J s^2]
  double gradient_norm = 0;  ///< before the iteration, and that of its full step: in the options' norm
  double step_norm = 0;
};

/// Convergence tests and search of a solve. Absolute tolerances are those of the scene, already multiplied by the factors of
/// docs/theory.md, "Tolerances". 0 turns a test off. Where none is given, forces are compared with the forces that act.
struct NewtonOptions {
  int max_iterations = 3000;
  NewtonNorm norm = NewtonNorm::euclidean;
  double step_tolerance = 0;               ///< stop when the full step has a norm below it
  double force_tolerance = 1e-9;           ///< stop when the gradient is below this part of the forces that act; not
                                           ///< where a gradient tolerance is given
  double gradient_tolerance = 0;           ///< stop when the gradient has a norm below it
  double first_gradient_tolerance = 0;     ///< the same before the first iteration
  double relative_step_tolerance = 0;      ///< of the norm of the solve's first full step
  double relative_gradient_tolerance = 0;  ///< of the norm of the solve's first gradient
  double decrement_tolerance = 0;          ///< stop when the Newton decrement -p.g / 2 is below it [J s^2]
  double energy_tolerance = 0;             ///< stop after `energy_steps` steps in a row that change less [J s^2]
  int energy_steps = 100;
  IndefiniteHessian indefinite = IndefiniteHessian::project;
  bool project_to_psd = true;    ///< project stencils' Hessians to semi-definite ones where the sum is not definite
  int projected_iterations = 5;  ///< iterations with it before the true Hessian is tried again; 0: it never is
  /// If it becomes true, the solve ends before its next iteration without convergence and the step is dropped. Another
  /// thread or a signal handler may set it. It must outlive the solves. Null: solves cannot be cancelled.
  const std::atomic<bool>* cancel = nullptr;

  bool is_cancelled() const { return cancel && cancel->load(std::memory_order_relaxed); }
};

// Linear solvers.

/// Which linear solver a simulation uses. Names as `itr solvers` lists them, their aliases, or "auto".
struct LinearOptions {
  std::vector<std::string> solvers = {"eigen"};  ///< the first one that there is
  /// Tried in this order on a matrix that the solver cannot factorise or solve to the asked residual. A matrix that is not
  /// positive definite is an answer, not a failure: Newton projects it.
  std::vector<std::string> fallback = {};
  std::map<std::string, std::map<std::string, std::string>> options = {};  ///< by solver name: {"ordering", "metis"}
};

// Remeshing.

/// Which edges are tried, and how an operation is decided.
enum class Screening {
  energy_percentile,  ///< the paper's culling: splits at the top by energy, collapses at the bottom; patches decide
  bounds              ///< asks every edge; the gain of the new vertex alone decides, or else a patch
};

// Whatever is left open (std::nullopt) Setup::choose_defaults fills in, and nothing else does: `remesh` needs it filled in.

struct SplitOptions {
  bool enabled = true;
  std::optional<double> acceptance_tolerance;  ///< least energy decrease [J]
  double culling_threshold = 0.95;
  int max_depth = 3;                      ///< generations of one edge a step
  std::optional<double> min_edge_length;  ///< shorter rest edges are not split [m]
};

struct CurveOptions {
  bool enabled = false;
  std::optional<double> acceptance_tolerance;  ///< least energy decrease [J]; none: that of splits
  /// Curves edges in statics where straight ones keep up what would buckle, whether or not `enabled`.
  bool for_stability = true;
};

struct StraightenOptions {
  bool enabled = false;
  std::optional<double> acceptance_tolerance;  ///< [J]; negative: allowed increase; none: that of collapses
};

struct CollapseOptions {
  bool enabled = true;
  std::optional<double> acceptance_tolerance;  ///< least energy decrease [J]; negative: allowed increase
  double culling_threshold = 0.01;
  double rel_max_edge_length = 1;  ///< longest edge collapsed, in shortest edges of the initial mesh
};

struct SwapOptions {
  bool enabled = false;
  std::optional<double> acceptance_tolerance;  ///< [J], of swaps that better the shape
};

struct SmoothOptions {
  bool enabled = false;
  std::optional<double> acceptance_tolerance;  ///< [J], of moves that better the shape
};

struct LocalRelaxationOptions {
  int rings = 2;                   ///< rings of cells around the operation
  int max_cells = 100;             ///< no further ring where there are so many
  int max_iterations = 1;          ///< Newton iterations before the decision
  int max_contact_iterations = 4;  ///< the same where the patch touches contact
};

/// The baseline of docs/theory.md, "The sizing field": lengths of edges decide instead of energies.
struct SizingFieldOptions {
  bool enabled = false;
  /// Shorter rest edges are not split, in longest sides of the bodies' box. In contact nothing else ends the splitting.
  double rel_min_edge_length = 0.01;
};

struct RemeshOptions {
  bool enabled = false;
  SizingFieldOptions sizing_field;
  SplitOptions split;
  CurveOptions curve;
  StraightenOptions straighten;
  CollapseOptions collapse;
  SwapOptions swap;
  SmoothOptions smooth;
  LocalRelaxationOptions local;
  double relative_tolerance = 1e-4;  ///< fraction of the scene's energy that choose_defaults takes as tolerance of splits
  Screening screening = Screening::bounds;

  /// Tolerances of curves and of straightenings [J], filled in.
  double curve_tolerance() const { return curve.acceptance_tolerance.value_or(split.acceptance_tolerance.value()); }
  double straighten_tolerance() const {
    return straighten.acceptance_tolerance.value_or(collapse.acceptance_tolerance.value());
  }
};

// Output.

struct OutputOptions {
  int skip_frames = 1;  ///< store every n-th step
  double checkpoint_period =
      30;            ///< least time between checkpoints, from which a run can be resumed [s]; 0: every stored step
  bool vtu = false;  ///< stored frames as VTU files too
  /// Adaptive steps: with output_dt, frames and rows of forces are stored at these times, whatever skip_frames.
  AdaptiveTimeOptions times{};
  Units units{};  ///< of all that is written but checkpoints
};

}  // namespace itr
