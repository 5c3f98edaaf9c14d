// SPDX-License-Identifier: MIT
// The step's energy on a patch of cells: the same terms as on the whole mesh, with all vertices outside held. It is built
// for the mesh as it is, or as an edit would make it. A patch is a few rings, or only the cells of the edit, where hardly
// more than the vertex that the edit sets is free.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "energy/incremental_potential.hpp"
#include "newton/newton.hpp"
#include "remesh/carried_patches.hpp"
#include "remesh/contact/contact_reach.hpp"
#include "remesh/contact/gate.hpp"
#include "remesh/fields.hpp"
#include "remesh/marks.hpp"

namespace itr {

/// How x-hat is taken on the mesh after an edit.
enum class HistoryRule {
  function,     ///< as a function on the mesh before; the new mesh pays for motion that it cannot represent
  interpolated  ///< interpolated onto the new mesh, which costs less time and no energy
};

/// Inputs of local problems. None of them changes while a local problem lives, so several may be evaluated at once.
template <int Dim>
struct RemeshState {
  const Mesh<Dim>& mesh;
  const RemeshFields<Dim>& fields;
  const StepContext<Dim>& context;
  const SurfaceIndex<Dim>& surface;  ///< at fields.x
  HistoryRule history;
  const CarriedPatches<Dim>* patches = nullptr;  ///< null: no body averages its volume
  bool cuts_star = false;                        ///< the cells of the edit are patches of their own
};

/// A vertex of a local problem, or the node of a curved edge.
struct LocalVertex {
  enum class Kind : char { of_mesh, created, of_obstacle };
  Kind kind = Kind::of_mesh;
  int id = kNone;  ///< in the mesh or among the obstacles' vertices; kNewVertex or new_node(i) where the edit creates it
  bool operator==(const LocalVertex&) const = default;
};

template <int Dim>
class MotionBound;

/// Memory of one local problem. The next one finds the room that this one took, so that after a few nothing is allocated but
/// for damping, pressure and terms of the program, and where an edit forgets history.
template <int Dim>
struct LocalStorage {
  CellSet<Dim> cells;
  std::vector<LocalVertex> vertices;
  std::vector<char> changes;  ///< by local vertex: whether its contacts can change
  std::vector<char> held;     ///< by dof
  CollisionSurface surface;   ///< where it touches contact
  DofMap dofs;
  ScratchVector x, predictor, velocity_reference, norm_weights;
  std::optional<IncrementalPotential<Dim>> potential;  ///< of `cells`
  std::shared_ptr<MotionBound<Dim>> motion_bound;
  EnergySum energy;
  Workspace workspace;
};

/// Buffers of local problems that are worth keeping between them: one for each thread.
template <int Dim>
struct LocalScratch {
  std::vector<int> local_of;           ///< by vertex slot: local id, valid where `known` is marked
  std::vector<int> local_of_obstacle;  ///< the same of the obstacles' vertices
  Marks known, known_obstacles, cells, patch, facets, primitives;
  std::vector<CellId> star;
  std::vector<typename CellSet<Dim>::Element> curved;  ///< to be added behind the others
  std::vector<FacetId> near_facets;
  std::vector<int> near_primitives, points;
  typename SurfaceIndex<Dim>::Hits hits;
  GateScratch<Dim> gate;
  Neighbourhoods<Dim> neighbourhoods;
  ContactReach<Dim> reach;
  DenseSystem system;
  std::vector<std::unique_ptr<LocalStorage<Dim>>> spare;
  std::unique_ptr<LocalStorage<Dim>> take_storage();
};

template <int Dim>
class LocalProblem {
 public:
  /// `patch` has alive cells, ascending, all removed cells of the edit among them. A vertex is free if the patch has all of
  /// its cells, the node of an edge if it has all of the edge's. `is_after` chooses the problem after the edit instead of
  /// the one before. The arguments must outlive this.
  LocalProblem(const RemeshState<Dim>& state, std::span<const CellId> patch, const Edit<Dim>& edit, bool is_after,
               LocalScratch<Dim>& scratch);
  ~LocalProblem();
  LocalProblem(const LocalProblem&) = delete;
  LocalProblem& operator=(const LocalProblem&) = delete;

  /// Whether a cell with curved edges that the edit makes is distorted.
  bool distorts() const;
  double value() { return energy_.value(x_.view(), workspace_); }
  /// Energy of the barrier where the patch can change it; not below 0.
  double contact_energy();
  /// Relaxes from the present positions by at most so many Newton iterations.
  NewtonSummary relax(int max_iterations);
  bool has_unknowns() const { return dofs_.num_unknowns > 0; }
  int num_unknowns() const { return dofs_.num_unknowns; }
  /// Whether anything that the patch changes could touch something.
  bool touches_contact() const { return touches_contact_; }
  /// A box with all surface vertices outside of the patch that could have changed the result; empty without contact.
  const Box<Dim>& surface_read() const { return surface_read_; }

  struct Position {
    VertexId vertex;  ///< kNewVertex for the one that the edit creates, new_node(i) for its nodes
    Vec<Dim> x;
  };
  /// Where vertices are that have a free component.
  void get_positions(std::vector<Position>& positions) const;

 private:
  using Kind = LocalVertex::Kind;
  int local(LocalVertex v);
  int local(VertexId v) { return local({is_created(v) ? Kind::created : Kind::of_mesh, v}); }
  bool is_created(VertexId v) const { return v > kNewVertex - 1 - static_cast<int>(edit_.inserted_nodes.size()); }
  template <typename Simplex>
  void localize(Simplex& simplex);
  void add_cell(typename CellSet<Dim>::Element cell);
  void add_loaded_facet(typename CellSet<Dim>::BoundaryFacet facet);
  EdgeKey edge_of(const LocalVertex& node) const;
  /// The node of an edge on the side of the comparison that this is, or kNone.
  VertexId node_of(VertexId a, VertexId b) const;
  bool is_on_surface(const LocalVertex& v) const;
  bool is_closed(const LocalVertex& v) const;
  std::uint64_t friction_sides_of(const LocalVertex& v) const;
  void add_cells(std::span<const CellId> patch);
  void add_patches(std::span<const CellId> patch);
  void add_loaded_facets();
  void hold_vertices();
  void find_contacts();
  void find_stars_of_touching();
  void add_surface();
  void find_what_changes();
  ConstVectorView gather(const VectorX& field, const std::vector<Vec<Dim>>& obstacle_values, ScratchVector& values) const;
  void add_terms();
  void set_quadrature(ConstVectorView x);
  void add_unrepresented_history(InertiaEnergy<Dim>& inertia) const;
  void add_history_of_node(InertiaEnergy<Dim>& inertia) const;
  Vec<Dim> rest_position(const LocalVertex& v) const;
  Vec<Dim> field_value(const VectorX& field, const std::vector<Vec<Dim>>& obstacle_values, const LocalVertex& v) const;
  bool is_free(int i) const;
  bool is_removed(FacetId f) const;

  const RemeshState<Dim>& state_;
  const Mesh<Dim>& mesh_;
  const Edit<Dim>& edit_;
  bool is_after_;
  LocalScratch<Dim>& scratch_;

  std::unique_ptr<LocalStorage<Dim>> storage_;
  CellSet<Dim>& cells_ = storage_->cells;
  std::vector<LocalVertex>& vertices_ = storage_->vertices;
  std::vector<char>& changes_ = storage_->changes;
  DofMap& dofs_ = storage_->dofs;
  ScratchVector& x_ = storage_->x;
  EnergySum& energy_ = storage_->energy;
  Workspace& workspace_ = storage_->workspace;
  bool has_surface_ = false, touches_contact_ = false;
  Box<Dim> surface_read_;
};

extern template class LocalProblem<2>;
extern template class LocalProblem<3>;

}  // namespace itr
