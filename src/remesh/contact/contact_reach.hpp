// SPDX-License-Identifier: MIT
// Finds the parts of the surface that can touch where an edit and the relaxation after it change the surface. Most patches
// of a mesh touch nothing and need no contact.
#pragma once

#include <vector>

#include "remesh/marks.hpp"
#include "surface_index.hpp"

namespace itr {

/// Largest clearance worth knowing on this surface [m]: the `span` of its index.
template <int Dim>
double span_of_clearances(const Mesh<Dim>& mesh, const VectorX& x, double dhat);

/// Neighbours of each facet and their distances. Found on demand, and kept as long as nothing changes there.
template <int Dim>
class Neighbourhoods {
 public:
  using Hits = typename SurfaceIndex<Dim>::Hits;
  struct Near {
    SurfaceId piece;
    double distance;  ///< see distance_below [m]
  };

  /// All that the facet could touch nearer than `radius` [m], at most the surface's span, and perhaps more.
  std::span<const Near> near(const SurfaceIndex<Dim>& surface, FacetId f, double radius, Hits& hits);
  /// Whether something is nearer than dhat [m].
  bool is_in_contact(const SurfaceIndex<Dim>& surface, FacetId f, double dhat, Hits& hits);

 private:
  struct Entry {
    std::vector<Near> near;
    double radius = 0;
    unsigned stamp = 0;
  };
  std::vector<Entry> entries_;  ///< by facet
};

/// Primitives that the facets of one patch could touch.
template <int Dim>
class ContactReach {
 public:
  using Hits = typename SurfaceIndex<Dim>::Hits;

  /// Forgets the last patch. `facet_slots`: facets of the mesh, gone ones included.
  void clear(int facet_slots);
  /// Adds a facet of the patch, by its pieces one after the other. It `moves` if it is replaced or one of its vertices or
  /// nodes is free. `facet` is its id, or kNone if the edit inserts it.
  void add(const SurfacePiece<Dim>& piece, FacetId facet, bool moves);
  /// Finds everything that the added facets could touch, also each other, as long as no vertex moves further than room().
  /// Leaves out facets that are gone (`is_gone(facet)`). `may_give_way`: where there is less room, but not much less, in
  /// which nothing can touch, that is the room. `dhat` [m].
  template <typename IsGone>
  void find(const SurfaceIndex<Dim>& surface, Neighbourhoods<Dim>& neighbourhoods, double dhat, Hits& hits,
            bool may_give_way, const IsGone& is_gone) {
    choose_room(dhat, surface.span());
    free_room_ = may_give_way ? room_ : 0;
    for (const Own& own : own_) read_.include(own.piece.box.inflated(dhat_ + 2 * room_));
    for (std::size_t i = 0; i < own_.size(); ++i) {
      if (own_[i].facet == kNone) {
        look_around(surface, static_cast<int>(i), hits, is_gone);
        continue;
      }
      if (own_of_[own_[i].facet] != static_cast<int>(i)) continue;  // another piece of a facet
      for (const auto& [other, distance] : neighbourhoods.near(surface, own_[i].facet, dhat + 2 * room_, hits)) {
        const bool is_facet = !other.is_of_obstacle();
        const int number = other.number();
        const bool other_moves = is_facet && moves(number);
        if ((is_facet && is_gone(number)) || distance >= reach(own_[i].moves, other_moves)) continue;
        note(distance, own_[i].moves, other_moves);
        mark_facet(surface, own_[i].facet);
        if (is_facet)
          mark_facet(surface, number);
        else
          mark(surface.obstacle_piece(number));
      }
    }
    if (gives_way())
      touching_.clear();
    else
      sort();
  }
  /// How far vertices may move [m].
  double room() const { return room_; }
  /// Holds all of the surface that could have made a difference.
  const Box<Dim>& read() const { return read_; }
  /// Vertices of what can touch, ascending by their ids in pieces.
  const std::vector<SurfaceId>& touching() const { return touching_; }
  bool touches(SurfaceId id) const { return std::binary_search(touching_.begin(), touching_.end(), id); }

 private:
  struct Own {
    SurfacePiece<Dim> piece;
    FacetId facet;
    bool moves;
  };
  void choose_room(double dhat, double span);
  /// Takes in how far apart two pieces are that could touch.
  void note(double distance, bool first_moves, bool second_moves) {
    const int movers = first_moves + second_moves;
    free_room_ = movers == 0 ? 0 : std::min(free_room_, (distance - dhat_) / movers);
  }
  bool gives_way();
  bool moves(FacetId f) const { return known_[f] && own_[own_of_[f]].moves; }
  double reach(bool first_moves, bool second_moves) const { return dhat_ + (first_moves + second_moves) * room_; }
  void compare(int own, const SurfacePiece<Dim>& other, bool other_moves) {
    const double least = reach(own_[own].moves, other_moves);
    if (free_room_ > 0) {
      const double distance = distance_below(own_[own].piece, other, least);
      if (distance >= least) return;
      note(distance, own_[own].moves, other_moves);
    } else if (!come_near(own_[own].piece, other, least)) {
      return;
    }
    mark(own_[own].piece);
    mark(other);
  }
  /// Compares a facet that the edit inserts with all others.
  template <typename IsGone>
  void look_around(const SurfaceIndex<Dim>& surface, int inserted, Hits& hits, const IsGone& is_gone) {
    surface.query(own_[inserted].piece.box.inflated(reach(own_[inserted].moves, true)), hits);
    for (const FacetId f : hits.facets)
      if (!is_gone(f))
        for (const auto& piece : surface.pieces(f)) compare(inserted, piece, moves(f));
    for (const int i : hits.obstacles) compare(inserted, surface.obstacle_piece(i), false);
    for (int i = 0; i < inserted; ++i)
      if (own_[i].facet == kNone) compare(inserted, own_[i].piece, own_[i].moves);
  }
  void mark_facet(const SurfaceIndex<Dim>& surface, FacetId f) {
    if (!marked_.mark(f)) return;
    for (const auto& piece : surface.pieces(f)) mark(piece);
  }
  void mark(const SurfacePiece<Dim>& piece) {
    touching_.insert(touching_.end(), piece.id.begin(), piece.id.begin() + piece.size);
  }
  void sort();

  std::vector<Own> own_;
  Marks known_;
  Marks marked_;             ///< facets of which all pieces are in `touching_`
  std::vector<int> own_of_;  ///< by facet, where it is known
  std::vector<SurfaceId> touching_;
  double dhat_ = 0, room_ = 0;
  double free_room_ = 0;  ///< in which nothing can touch, of what is known so far
  Box<Dim> read_;
};

extern template class Neighbourhoods<2>;
extern template class Neighbourhoods<3>;
extern template class ContactReach<2>;
extern template class ContactReach<3>;

}  // namespace itr
