// SPDX-License-Identifier: MIT
#include "contact_reach.hpp"

#include <algorithm>
#include <cmath>

namespace itr {

namespace {

/// How far vertices may move, at least: in longest edges of what moves, and in activation distances.
constexpr double kRoomInEdges = 0.1, kRoomInDistances = 2;
/// Fraction of the room that is enough where contact can be left out.
constexpr double kLeastRoom = 0.25;

template <int Dim>
double longest_edge(const SurfacePiece<Dim>& piece) {
  double squared = 0;
  for (int k = 0; k < Dim; ++k) squared = std::max(squared, (piece.p[k] - piece.p[(k + 1) % Dim]).squaredNorm());
  return std::sqrt(squared);
}

double room_for(double longest, double dhat) { return std::max(kRoomInDistances * dhat, kRoomInEdges * longest); }

}  // namespace

template <int Dim>
double span_of_clearances(const Mesh<Dim>& mesh, const VectorX& x, double dhat) {
  double squared = 0;
  for (const FacetId f : mesh.live_facets()) {
    const auto& facet = mesh.facet(f);
    for (int k = 0; k < Dim; ++k)
      squared =
          std::max(squared, (x.segment<Dim>(Dim * facet[k]) - x.segment<Dim>(Dim * facet[(k + 1) % Dim])).squaredNorm());
  }
  return dhat + 2 * room_for(std::sqrt(squared), dhat);
}

template <int Dim>
std::span<const typename Neighbourhoods<Dim>::Near> Neighbourhoods<Dim>::near(const SurfaceIndex<Dim>& surface, FacetId f,
                                                                              double radius, Hits& hits) {
  if (static_cast<int>(entries_.size()) <= f) entries_.resize(2 * f + 16);
  Entry& entry = entries_[f];
  const bool is_wide = entry.radius >= radius;
  if (is_wide && entry.stamp == surface.stamp(f)) return entry.near;
  // Where the facet is where it was, only what has changed around it is looked at.
  const bool is_there = is_wide && surface.changed(f) <= entry.stamp;
  const auto has_changed = [&](SurfaceId other) {
    return !other.is_of_obstacle() && surface.changed(other.number()) > entry.stamp;
  };
  if (is_there)
    std::erase_if(entry.near, [&](const Near& known) { return has_changed(known.piece); });
  else
    entry.near.clear();
  entry.radius = std::max(entry.radius, radius);
  const SurfacePieces<Dim> pieces = surface.pieces(f);
  surface.query(surface.box_of(f).inflated(entry.radius), hits);
  const auto add = [&](SurfaceId other, double distance) {
    if (distance < entry.radius) entry.near.push_back({other, distance});
  };
  for (const FacetId other : hits.facets) {
    if (is_there && !has_changed(other)) continue;
    const SurfacePieces<Dim> there = surface.pieces(other);
    double distance = entry.radius;
    for (std::size_t i = 0; i < pieces.size(); ++i)
      for (std::size_t j = other == f ? i + 1 : 0; j < there.size(); ++j)
        distance = distance_below(pieces[i], there[j], distance);
    add(other, distance);
  }
  if (!is_there)
    for (const int i : hits.obstacles) {
      const SurfacePiece<Dim> there = surface.obstacle_piece(i);
      double distance = entry.radius;
      for (const auto& piece : pieces) distance = distance_below(piece, there, distance);
      add(SurfaceId::of_obstacle(i), distance);
    }
  std::sort(entry.near.begin(), entry.near.end(), [](const Near& a, const Near& b) { return a.piece < b.piece; });
  entry.stamp = surface.stamp(f);
  return entry.near;
}

template <int Dim>
bool Neighbourhoods<Dim>::is_in_contact(const SurfaceIndex<Dim>& surface, FacetId f, double dhat, Hits& hits) {
  const auto around = near(surface, f, dhat, hits);
  return std::any_of(around.begin(), around.end(), [&](const Near& other) { return other.distance < dhat; });
}

template <int Dim>
void ContactReach<Dim>::clear(int facet_slots) {
  own_.clear();
  touching_.clear();
  read_ = {};
  known_.clear(facet_slots);
  marked_.clear(facet_slots);
  own_of_.resize(facet_slots);
}

template <int Dim>
void ContactReach<Dim>::add(const SurfacePiece<Dim>& piece, FacetId facet, bool moves) {
  if (facet != kNone) {
    known_.mark(facet);
    own_of_[facet] = static_cast<int>(own_.size());
  }
  own_.push_back({piece, facet, moves});
}

template <int Dim>
void ContactReach<Dim>::choose_room(double dhat, double span) {
  double longest = 0;
  for (const Own& own : own_)
    if (own.moves) longest = std::max(longest, longest_edge(own.piece));
  dhat_ = dhat;
  room_ = std::min(room_for(longest, dhat), (span - dhat) / 2);  // no more is known
}

template <int Dim>
bool ContactReach<Dim>::gives_way() {
  if (touching_.empty() || !(free_room_ >= kLeastRoom * room_)) return false;
  room_ = free_room_;
  return true;
}

template <int Dim>
void ContactReach<Dim>::sort() {
  std::sort(touching_.begin(), touching_.end());
  touching_.erase(std::unique(touching_.begin(), touching_.end()), touching_.end());
}

#define ITR_INSTANTIATE(Dim)                                                    \
  template double span_of_clearances(const Mesh<Dim>&, const VectorX&, double); \
  template class Neighbourhoods<Dim>;                                           \
  template class ContactReach<Dim>;
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
