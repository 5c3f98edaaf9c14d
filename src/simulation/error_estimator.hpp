// SPDX-License-Identifier: MIT
// Estimates of what the results of a step are wrong by (docs/theory.md, "Error bars").
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fem/vertex_map.hpp"
#include "itr/frame.hpp"
#include "itr/setup.hpp"
#include "linear/reuse.hpp"
#include "simulation/carried_errors.hpp"
#include "simulation/error_change.hpp"
#include "simulation/state.hpp"
#include "simulation/step_problem.hpp"
#include "simulation/time_bars.hpp"

namespace itr {

/// A space that contains that of a mesh: edges that are straight become curved, or, where some are curved, all cells are
/// split and their edges curved.
template <int Dim>
struct FinerSpace {
  /// The mesh must be compact and outlive this no more than the call.
  FinerSpace(const Mesh<Dim>& mesh, int obstacle_vertices);

  /// Functions, or motions, in this space that are those of the mesh; fields are interleaved over nodes and obstacles.
  VectorX prolong(const VectorX& coarse) const { return map.motion(coarse); }
  History prolong(History history) const;
  /// The transposed of it.
  VectorX restrict(const VectorX& functional) const;
  /// Zero but at nodes that both spaces have.
  VectorX inject(const VectorX& coarse) const;
  /// The values at nodes of the coarse space.
  VectorX at_coarse_nodes(const VectorX& fine) const;

  std::uint64_t revision;  ///< of the coarse mesh
  int obstacle_vertices;
  Mesh<Dim> mesh;
  std::vector<int> fine_of_coarse;             ///< node that is the same one
  VertexMap<Dim> map;                          ///< of coarse nodes to those here
  std::vector<char> is_new;                    ///< by node: no coarse one is there
  std::optional<CollisionProxy<Dim>> proxy{};  ///< what touches in place of the boundary, where gaps are averaged

 private:
  typename VertexMap<Dim>::Weights find_weights(const Mesh<Dim>& coarse);
};

/// Estimates errors of energy, forces and displacements at the end of steps. Keeps what depends on the mesh alone, and
/// errors that the last step has left to the next.
template <int Dim>
class ErrorEstimator {
 public:
  /// `solver`, that of the steps, must outlive this.
  explicit ErrorEstimator(linear::ReusingSolver& solver) : solver_(solver), cache_(solver) {}

  /// Estimates those of the solution x of `problem` on the mesh of `state`, of which the history is that before the step.
  /// `problem` is lagged at x then.
  ErrorFields estimate(const StepSetup<Dim>& setup, const State<Dim>& state, StepProblem<Dim>& problem, const VectorX& x,
                       ErrorReport& report);

 private:
  using Gradients = typename StepProblem<Dim>::Gradients;
  bool provide_factor(StepProblem<Dim>& problem, const VectorX& x, bool anew);
  VectorX precondition(const VectorX& residual);
  template <typename Minimise>
  bool try_factors(StepProblem<Dim>& problem, const VectorX& x, std::string& no_bar, const Minimise& minimise);
  History finer_history(const State<Dim>& state) const;
  void carry(const StepSetup<Dim>& setup, const State<Dim>& state, History history, const VectorX& x, const VectorX& motion);
  bool estimate_mesh(const StepSetup<Dim>& setup, const State<Dim>& state, StepProblem<Dim>& problem, const VectorX& x,
                     const Gradients& at_x, ErrorReport& report, ErrorFields::OfSource& fields);
  bool estimate_other(const StepSetup<Dim>& setup, const State<Dim>& state, StepProblem<Dim>& problem, const VectorX& x,
                      const SourceChange& change, const NewtonSystem::Product& hessian, std::string& no_bar, double& energy,
                      ErrorFields::OfSource& fields);
  void estimate_time(const StepSetup<Dim>& setup, const State<Dim>& state, StepProblem<Dim>& problem, const VectorX& x,
                     SourceChange& change, const NewtonSystem::Product& hessian, double& energy,
                     ErrorFields::OfSource& fields);

  linear::ReusingSolver& solver_;
  std::unique_ptr<FinerSpace<Dim>> space_;
  ProblemCache<Dim> cache_;  ///< of the finer space; nothing is solved by it
  CarriedErrors carried_;    ///< of the finer space
  TimeBars<Dim> time_bars_;
};

extern template class ErrorEstimator<2>;
extern template class ErrorEstimator<3>;

}  // namespace itr
