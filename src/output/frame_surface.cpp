// SPDX-License-Identifier: MIT
#include "frame_surface.hpp"

#include <Eigen/Geometry>

#include "fem/chords.hpp"

namespace itr::output {

namespace {

/// Facets with one incident cell, oriented outward.
template <int Dim>
std::vector<std::array<int, Dim>> boundary_facets(const std::vector<std::int64_t>& simplices) {
  using Facet = std::array<int, Dim>;
  std::vector<std::pair<Facet, Facet>> facets;  // sorted, oriented
  facets.reserve(simplices.size());
  for (std::size_t c = 0; c < simplices.size(); c += Dim + 1) {
    for (int skipped = 0; skipped <= Dim; ++skipped) {
      Facet facet;
      for (int k = 0, i = 0; k <= Dim; ++k) {
        if (k != skipped) facet[i++] = static_cast<int>(simplices[c + k]);
      }
      Facet oriented = facet;
      if (skipped % 2 == 1) std::swap(oriented[0], oriented[1]);
      std::sort(facet.begin(), facet.end());
      facets.emplace_back(facet, oriented);
    }
  }
  std::sort(facets.begin(), facets.end());
  std::vector<Facet> once;
  for (std::size_t i = 0, j = 0; i < facets.size(); i = j) {
    while (j < facets.size() && facets[j].first == facets[i].first) ++j;
    if (j == i + 1) once.push_back(facets[i].second);
  }
  return once;
}

/// The surface through all nodes.
template <int Dim>
std::vector<std::array<int, Dim>> chords(const std::vector<std::array<int, Dim>>& facets, const CurvedNodes& node_of) {
  std::vector<std::array<int, Dim>> result;
  for (const auto& facet : facets) for_each_chord<Dim>(facet, node_of, [&](const auto& ids) { result.push_back(ids); });
  return result;
}

/// Facets as what can intersect, where orientation does not matter.
void add_facets(const std::vector<std::array<int, 2>>& facets, FrameSurface<2>& surface) { surface.edges = facets; }

void add_facets(const std::vector<std::array<int, 3>>& facets, FrameSurface<3>& surface) {
  surface.triangles = facets;
  for (const auto& f : facets) surface.edges.insert(surface.edges.end(), {{f[0], f[1]}, {f[0], f[2]}, {f[1], f[2]}});
  std::sort(surface.edges.begin(), surface.edges.end());
  surface.edges.erase(std::unique(surface.edges.begin(), surface.edges.end()), surface.edges.end());
}

template <int Dim>
void add_surface(const StoredSurface& stored, FrameSurface<Dim>& surface) {
  const int offset = static_cast<int>(surface.x.size());
  const std::vector<Vec<Dim>> x = points<Dim>(stored.x);
  surface.x.insert(surface.x.end(), x.begin(), x.end());
  const auto& edges = stored.edges;
  for (std::size_t i = 0; i < edges.size(); i += 2) {
    surface.edges.push_back({offset + static_cast<int>(edges[i]), offset + static_cast<int>(edges[i + 1])});
  }
  const auto& faces = stored.faces;
  for (std::size_t i = 0; i < faces.size(); i += 3) {
    surface.triangles.push_back({offset + static_cast<int>(faces[i]), offset + static_cast<int>(faces[i + 1]),
                                 offset + static_cast<int>(faces[i + 2])});
  }
}

}  // namespace

template <int Dim>
FrameSurface<Dim> make_surface(const StoredFrame& frame) {
  FrameSurface<Dim> surface;
  surface.has_proxy = frame.has_proxy;
  if (frame.has_proxy) {
    surface.own = "proxy ";
    add_surface(frame.proxy, surface);
    surface.own_facets = facets_of(surface);
  } else {
    surface.x = points<Dim>(frame.x);
    surface.boundary = boundary_facets<Dim>(frame.simplices);
    const CurvedNodes node_of(frame);
    surface.curved = node_of.edges;
    surface.own_facets = chords<Dim>(surface.boundary, node_of);
    if (Dim == 3 && !surface.curved.empty())
      for (const auto& f : surface.boundary)
        for (int k = 0; k < 3; ++k) {
          const auto [first, last] = std::minmax(f[k], f[(k + 1) % 3]);
          surface.third_corners[{first, last}].push_back(f[(k + 2) % 3]);
        }
    auto facets = surface.own_facets;
    for (auto& facet : facets) std::sort(facet.begin(), facet.end());
    add_facets(facets, surface);
  }
  surface.num_body_vertices = static_cast<int>(surface.x.size());
  add_surface(frame.obstacles, surface);
  if (frame.steps_apart.empty()) return surface;
  std::vector<Vec<Dim>> rest = points<Dim>(frame.rest);
  Eigen::AlignedBox<double, Dim> box;
  for (const Vec<Dim>& X : rest) box.extend(X);
  rest.insert(rest.end(), surface.x.begin() + surface.num_body_vertices, surface.x.end());
  const int vertices = static_cast<int>(frame.steps_apart.size());
  const auto is_closed = [&](int v) { return v < vertices && frame.steps_apart[v] == 0; };
  surface.closed = closed_faces<Dim>(rest, frame.dhat, coincidence<Dim>(box.min(), box.max()), [&](int v) {
    return surface.is_node(v) ? is_closed(surface.curved[v - vertices][0]) || is_closed(surface.curved[v - vertices][1])
                              : is_closed(v);
  });
  return surface;
}

template FrameSurface<2> make_surface(const StoredFrame&);
template FrameSurface<3> make_surface(const StoredFrame&);

}  // namespace itr::output
