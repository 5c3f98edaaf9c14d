// SPDX-License-Identifier: MIT
// The step's energy on a patch of cells: the same terms as the whole mesh, all vertices outside held. Built for the mesh as
// it is, or as an edit would make it.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "itr/energy/elastic/elastic.hpp"
#include "itr/geometry/bvh.hpp"
#include "itr/newton/newton.hpp"
#include "itr/remesh/fields.hpp"

namespace itr {

/// The deformed surface, bodies' and obstacles' edges, as a tree that is rebuilt after changes when it is next asked.
class SurfaceTree {
 public:
  SurfaceTree(const Mesh<2>& mesh, const RemeshFields<2>& fields, const StepContext<2>& context)
      : mesh_(mesh), fields_(fields), context_(context) {}
  void invalidate() { valid_ = false; }
  /// Facets of bodies (>= 0) and edges of obstacles (-1 - index) whose boxes overlap `box`.
  void query(const Box<2>& box, std::vector<int>& hits);

 private:
  const Mesh<2>& mesh_;
  const RemeshFields<2>& fields_;
  const StepContext<2>& context_;
  Bvh<2> tree_;
  std::vector<int> ids_;
  std::vector<int> scratch_;
  bool valid_ = false;
};

/// Marks of vertices and cells that are cleared in O(1).
class Marks {
 public:
  void clear(int size) {
    if (static_cast<int>(stamp_.size()) < size) stamp_.resize(size, 0);
    ++now_;
  }
  bool operator[](int i) const { return i < static_cast<int>(stamp_.size()) && stamp_[i] == now_; }
  /// True the first time.
  bool mark(int i) {
    if (i >= static_cast<int>(stamp_.size())) stamp_.resize(2 * i + 16, 0);
    return std::exchange(stamp_[i], now_) != now_;
  }

 private:
  std::vector<unsigned> stamp_;
  unsigned now_ = 0;
};

/// Buffers of local problems that are worth keeping between trials.
struct LocalScratch {
  std::vector<int> local_of;  ///< by vertex slot: local id, valid where `known` is marked
  Marks known, cells;
  std::vector<int> hits;
};

class LocalProblem {
 public:
  /// `patch` are alive cells that hold all of the edit's removed cells. `edit` null: the mesh as it is. Everything handed in
  /// must outlive this.
  LocalProblem(const Mesh<2>& mesh, const RemeshFields<2>& fields, const StepContext<2>& context,
               const std::vector<CellId>& patch, const Edit<2>* edit, bool apply_edit, HistoryRule history,
               SurfaceTree& surface_tree, LocalScratch& scratch);
  LocalProblem(const LocalProblem&) = delete;
  LocalProblem& operator=(const LocalProblem&) = delete;

  double value() { return energy_.value(x_, workspace_); }
  /// At most so many Newton iterations from where it stands.
  NewtonSummary relax(int max_iterations);
  bool has_unknowns() const { return dofs_.num_unknowns > 0; }
  int num_unknowns() const { return dofs_.num_unknowns; }
  /// Whether any contact pair can come within reach.
  bool touches_contact() const { return touches_contact_; }
  /// Whether no surface edge that the edit changed touches another one now.
  bool is_free_of_intersections() const;
  /// Positions of free vertices, into a field of the mesh; `created` stands for kNewVertex.
  void write_back(VectorX& x, VertexId created) const;

 private:
  int local(VertexId v);
  void add_cells(const std::vector<CellId>& patch);
  void add_loaded_facets();
  void hold_vertices();
  void add_surface(SurfaceTree& tree);
  void weigh_surface();
  VectorX gather(const VectorX& field, const std::vector<Vec<2>>& obstacle_values) const;
  void add_terms(HistoryRule history);
  VelocityRule velocity_rule() const;
  void add_damping(DampingOptions::Term term, const Energy& damped);
  void add_unrepresented_history(InertiaEnergy<2>& inertia);
  Vec<2> rest_position(VertexId v) const;
  Vec<2> field_value(const VectorX& field, const std::vector<Vec<2>>& obstacle_values, VertexId v) const;
  bool is_removed_facet(FacetId f) const;

  const Mesh<2>& mesh_;
  const RemeshFields<2>& fields_;
  const StepContext<2>& context_;
  const Edit<2>* edit_;
  bool apply_edit_;
  LocalScratch& scratch_;

  CellSet<2> cells_;
  std::vector<VertexId> global_;  ///< per local vertex: id in the mesh, kNewVertex, or -2 - index of an obstacle vertex
  VectorX x_;
  DofMap dofs_;
  CollisionSurface surface_;
  bool has_surface_ = false, touches_contact_ = false;
  std::vector<int> changed_edges_;  ///< indices of surface edges that the edit inserts
  EnergySum energy_;
  std::shared_ptr<ContactEnergy<2>> contact_;
  std::vector<Box<2>> bounds_;  ///< where surface vertices may move; index by local vertex
  DenseSystem system_;
  Workspace workspace_;
};

}  // namespace itr
