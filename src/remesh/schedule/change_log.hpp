// SPDX-License-Identifier: MIT
// One record of what commits have changed, and the one place where an edit is applied: what follows the mesh registers here.
#pragma once

#include <algorithm>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "remesh/candidate.hpp"
#include "remesh/decide/local_problem.hpp"

namespace itr {

/// Changes of one commit. Followers see them when the mesh has the edit already.
template <int Dim>
struct Change {
  const Edit<Dim>& edit;
  VertexId created;                                               ///< or kNone
  std::vector<CellId> cells{};                                    ///< new ones
  FacetId first_facet;                                            ///< facets from here on are new
  VertexId first_node;                                            ///< of the nodes that the edit creates
  std::vector<typename LocalProblem<Dim>::Position> positions{};  ///< where vertices of the mesh are now [m]
};

/// Counts commits, and tells by this count what has changed after one of them.
template <int Dim>
class ChangeLog {
 public:
  using Position = typename LocalProblem<Dim>::Position;
  /// `x`: positions [m]. The surface is logged where something can touch it.
  ChangeLog(Mesh<Dim>& mesh, const VectorX& x, bool logs_surface)
      : mesh_(mesh), x_(x), logs_surface_(logs_surface), touched_(mesh.node_slots()) {}
  /// Followers are called in the order in which they were added.
  void add_follower(std::function<void(const Change<Dim>&)> follower) { followers_.push_back(std::move(follower)); }
  /// Called before the mesh has the edit, in their order.
  void add_forerunner(std::function<void(const Edit<Dim>&)> forerunner) { forerunners_.push_back(std::move(forerunner)); }
  /// Applies an edit with the positions to which it relaxed.
  Change<Dim> commit(const Edit<Dim>& edit, std::span<const Position> positions);

  /// Number of the last commit.
  unsigned now() const { return static_cast<unsigned>(surfaces_.size()); }
  /// Whether a commit after `since` replaced cells at a vertex of a candidate, or moved a vertex of these.
  bool has_changed_around(const Candidate& candidate, unsigned since) const {
    return std::ranges::any_of(candidate.vertices(), [&](VertexId v) { return touched_[v].last_around > since; });
  }
  /// Whether the first commit that did so was one up to `until`.
  bool had_changed_around(const Candidate& candidate, unsigned until) const {
    const auto had = [&](VertexId v) { return touched_[v].first_around > 0 && touched_[v].first_around <= until; };
    return std::ranges::any_of(candidate.vertices(), had);
  }
  /// Whether one moved a vertex or gave it other cells.
  bool was_written(VertexId v, unsigned since) const { return touched_[v].written > since; }
  /// Boxes of the surface that commits changed, before and after, in the present configuration; some are empty.
  std::span<const Box<Dim>> surfaces(unsigned since) const { return std::span(surfaces_).subspan(since); }

 private:
  struct Touched {
    unsigned written = 0, first_around = 0, last_around = 0;  ///< numbers of commits; 0: none
  };
  void write(VertexId v);
  void write_surface(VertexId v);

  Mesh<Dim>& mesh_;
  const VectorX& x_;
  bool logs_surface_;
  std::vector<std::function<void(const Edit<Dim>&)>> forerunners_;
  std::vector<std::function<void(const Change<Dim>&)>> followers_;
  std::vector<Touched> touched_;    ///< by vertex
  std::vector<Box<Dim>> surfaces_;  ///< by commit
};

}  // namespace itr
