// SPDX-License-Identifier: MIT
// Obstacles are prescribed, so two of them may cross each other; anything else that shares a point without sharing a vertex
// is a violation, and so are neighbours that lie on each other. What is wholly inside is found by winding numbers.
#include "output/certify.hpp"

#include <cmath>
#include <map>
#include <optional>

#include "curve_checks.hpp"
#include "fem/quadratic.hpp"
#include "frame_surface.hpp"
#include "geometry/closed_surface.hpp"
#include "geometry/predicates.hpp"
#include "geometry/quadratic_validity.hpp"
#include "itr/core.hpp"

namespace itr::output {

namespace {

namespace fs = std::filesystem;
using Of = Violation::Of;

int orientation_of(const std::array<Vec<2>, 3>& p) { return orientation(p[0], p[1], p[2]); }
int orientation_of(const std::array<Vec<3>, 4>& p) { return orientation(p[0], p[1], p[2], p[3]); }

/// Positions of all nodes of a cell with a curved edge; nothing where all of its edges are straight.
template <int Dim>
std::optional<QuadraticCell<Dim>> curved_cell(const StoredFrame& frame, std::size_t c, const std::vector<Vec<Dim>>& x,
                                              const CurvedNodes& node_of) {
  const std::int64_t* cell = &frame.simplices[(Dim + 1) * c];
  QuadraticCell<Dim> nodes;
  bool is_curved = false;
  for (int k = 0; k <= Dim; ++k) nodes.col(k) = x[cell[k]];
  for_each_edge<Dim>([&](int edge, int i, int j) {
    const int node = node_of(cell[i], cell[j]);
    is_curved = is_curved || node != kNone;
    nodes.col(Dim + 1 + edge) = node != kNone ? x[node] : Vec<Dim>((x[cell[i]] + x[cell[j]]) / 2);
  });
  return is_curved ? std::optional(nodes) : std::nullopt;
}

/// `what`: of the cells, where `coordinates` say that their vertices are.
template <int Dim>
void check_cells(const StoredFrame& frame, const std::vector<double>& coordinates, const char* what, const std::string& name,
                 std::vector<Violation>& violations) {
  const std::vector<Vec<Dim>> x = points<Dim>(coordinates);
  const CurvedNodes node_of(frame);
  for (std::size_t c = 0; c < frame.simplices.size() / (Dim + 1); ++c) {
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = x[frame.simplices[(Dim + 1) * c + k]];
    if (const auto nodes = curved_cell<Dim>(frame, c, x, node_of)) {
      if (!is_positive_everywhere_exact<Dim>(*nodes))
        violations.push_back({Of::cells, fmt::format("{}: {}cell {} is not positive everywhere", name, what, c)});
      continue;
    }
    const int sign = orientation_of(p);
    if (sign <= 0)
      violations.push_back(
          {Of::cells, fmt::format("{}: {}cell {} is {}", name, what, c, sign < 0 ? "inverted" : "degenerate")});
  }
}

/// Sign of a + b + c, exact.
int sign_of_sum(double a, double b, double c) {
  const double sum = a + b, rest = sum - a, error = (a - (sum - rest)) + (b - rest);  // Knuth: sum + error = a + b
  const double total = sum + c;                                                       // c cancels only what is near it
  if (total == 0 || std::abs(total) < std::abs(sum) / 2) return (total > -error) - (total < -error);
  return (total > 0) - (total < 0);
}

/// Bodies of revolution: nodes on the axis at rest stay there, the radius is positive everywhere else.
void check_axis(const StoredFrame& frame, const std::string& name, std::vector<Violation>& violations) {
  const auto rest = points<2>(frame.rest), x = points<2>(frame.x);
  const std::size_t vertices = x.size() - frame.curved_edges.size() / 2;
  for (std::size_t v = 0; v < vertices; ++v)
    if (!(rest[v][0] > 0 ? x[v][0] > 0 : rest[v][0] == 0 && x[v][0] == 0))
      violations.push_back(
          {Of::cells, fmt::format("{}: vertex {} of R = {:g} is at r = {:g}", name, v, rest[v][0], x[v][0])});
  for (std::size_t e = 0; e < frame.curved_edges.size() / 2; ++e) {
    const auto a = static_cast<std::size_t>(frame.curved_edges[2 * e]),
               b = static_cast<std::size_t>(frame.curved_edges[2 * e + 1]);
    const bool is_on_axis = rest[a][0] == 0 && rest[b][0] == 0;
    const int sign = sign_of_sum(4 * x[vertices + e][0], -x[a][0], -x[b][0]);  // of the edge's middle Bernstein coefficient
    if (is_on_axis ? x[vertices + e][0] != 0 : sign <= 0)
      violations.push_back({Of::cells, fmt::format("{}: the edge of vertices {} and {} reaches the axis", name, a, b)});
  }
}

/// Whether an edge and a triangle with one common vertex lie on each other: in one plane, and the edge within the triangle's
/// angle at that vertex. Exact.
bool is_folded(const FrameSurface<3>& surface, const std::array<int, 2>& edge, const std::array<int, 3>& triangle) {
  const int corner =
      static_cast<int>(std::find_first_of(triangle.begin(), triangle.end(), edge.begin(), edge.end()) - triangle.begin());
  const Vec<3>&o = surface.x[triangle[corner]], &a = surface.x[triangle[(corner + 1) % 3]],
        &b = surface.x[triangle[(corner + 2) % 3]], &end = surface.x[edge[edge[0] == triangle[corner] ? 1 : 0]];
  if (orientation(o, a, b, end) != 0) return false;
  for (int axis = 0; axis < 3; ++axis) {  // a plane of two axes on which the triangle's shadow has an area
    const auto shadow = [axis](const Vec<3>& p) { return Vec<2>(p[(axis + 1) % 3], p[(axis + 2) % 3]); };
    const int turn = orientation(shadow(o), shadow(a), shadow(b));
    if (turn == 0) continue;
    return turn * orientation(shadow(o), shadow(a), shadow(end)) >= 0 &&
           turn * orientation(shadow(o), shadow(end), shadow(b)) >= 0;
  }
  return false;
}

/// Whether two edges with one common vertex lie on each other: in one line, and to the same side of that vertex. Exact.
bool is_folded(const FrameSurface<2>& surface, const std::array<int, 2>& a, const std::array<int, 2>& b) {
  const int common = a[0] == b[0] || a[0] == b[1] ? a[0] : a[1];
  const Vec<2>& origin = surface.x[common];
  const Vec<2>& p = surface.x[a[0] == common ? a[1] : a[0]];
  const Vec<2>& q = surface.x[b[0] == common ? b[1] : b[0]];
  if (orientation(origin, p, q) != 0) return false;
  const int axis = p[0] != origin[0] ? 0 : 1;
  return (p[axis] < origin[axis]) == (q[axis] < origin[axis]);
}

void check_surface(const FrameSurface<2>& surface, const std::string& name, std::vector<Violation>& violations) {
  const auto& edges = surface.edges;
  const std::vector<Box<2>> boxes = boxes_of<2>(surface.x, edges);
  const Bvh<2> tree(boxes);
  std::vector<int> hits;
  for (int i = 0; i < static_cast<int>(edges.size()); ++i) {
    if (surface.is_obstacle(edges[i])) continue;  // met from the side of the body
    hits.clear();
    tree.query(boxes[i], hits);
    for (const int j : hits) {
      if (!surface.is_obstacle(edges[j]) && j <= i) continue;
      const auto &a = edges[i], &b = edges[j];
      if (surface.are_seen_as_curves(a, b)) continue;
      const bool meet = num_shared(a, b) > 0
                            ? is_folded(surface, a, b)
                            : segments_intersect(surface.x[a[0]], surface.x[a[1]], surface.x[b[0]], surface.x[b[1]]);
      if (meet && !surface.excuses(a, b))
        violations.push_back(
            {Of::surfaces, fmt::format("{}: edges {} and {} intersect", name, surface.name(a), surface.name(b))});
    }
  }
}

void check_surface(const FrameSurface<3>& surface, const std::string& name, std::vector<Violation>& violations) {
  const Bvh<3> tree(boxes_of<3>(surface.x, surface.triangles));
  const std::vector<Box<3>> boxes = boxes_of<3>(surface.x, surface.edges);
  std::vector<int> hits;
  for (std::size_t i = 0; i < surface.edges.size(); ++i) {
    const auto& e = surface.edges[i];
    hits.clear();
    tree.query(boxes[i], hits);
    for (const int j : hits) {
      const auto& t = surface.triangles[j];
      const int shared = num_shared(e, t);
      if ((surface.is_obstacle(e) && surface.is_obstacle(t)) || shared > 1) continue;
      if (surface.are_seen_as_curves(e, t)) continue;
      const auto& x = surface.x;
      const bool meet =
          shared == 1 ? is_folded(surface, e, t) : segment_intersects_triangle(x[e[0]], x[e[1]], x[t[0]], x[t[1]], x[t[2]]);
      if (!meet || surface.excuses(e, t)) continue;
      violations.push_back(
          {Of::surfaces, fmt::format("{}: edge {} and triangle {} intersect", name, surface.name(e), surface.name(t))});
    }
  }
}

/// Finds vertices inside of bodies, where no surfaces cross. A surface of obstacles may hold bodies: it is a container.
/// Chords through nodes may have a vertex near a curve on the wrong side.
template <int Dim>
void check_insides(const FrameSurface<Dim>& surface, const Patches<Dim>& curves, const std::string& name,
                   std::vector<Violation>& violations) {
  const ClosedSurface<Dim> closed(surface.x, surface.own_facets);
  const std::set<int> beyond_chords = find_beyond_chords(surface, curves);
  const std::string what = surface.has_proxy ? "the proxy" : "a body";
  const int first = surface.has_proxy ? 0 : surface.num_body_vertices;
  for (int v = first; v < static_cast<int>(surface.x.size()); ++v) {
    if (closed.is_vertex(v)) continue;
    const bool touches = closed.touches(surface.x[v]);
    if (touches || (closed.winding(surface.x[v]) + static_cast<int>(beyond_chords.count(v))) % 2 != 0)
      violations.push_back({Of::surfaces, fmt::format("{}: vertex ({}) is {} {}", name, surface.name(v),
                                                      touches ? "on" : "inside of", what)});
  }
  if (surface.has_proxy) return;  // need not have an orientation that tells a solid from a cavity
  if (!surface.closed.empty()) return;
  for (const int v : closed.nested(find_doubtful(surface, curves, closed)))
    violations.push_back(
        {Of::surfaces, fmt::format("{}: the part of the boundary at vertex {} is inside of a body", name, surface.name(v))});
}

/// Finds bodies in bodies, and how far closed faces overlap, where there are any.
template <int Dim>
void check_overlap(const StoredFrame& frame, const FrameSurface<Dim>& surface, const std::string& name,
                   Certificate& certificate) {
  if (surface.closed.empty()) return;
  const auto overlap = ClosedSurface<Dim>(surface.x, surface.own_facets).find_overlap(surface.closed);
  certificate.overlap = std::max(certificate.overlap, overlap.depth);
  if (overlap.depth <= frame.dhat) return;
  std::string place;
  for (int c = 0; c < Dim; ++c) place += fmt::format("{}{:.6g}", c ? ", " : "", overlap.place[c]);
  certificate.violations.push_back({Of::surfaces, fmt::format("{}: bodies overlap at ({})", name, place)});
}

template <int Dim>
double flight(const StoredFrame& frame) {
  struct Sum {
    Vec<Dim> u = Vec<Dim>::Zero();
    int corners = 0;
  };
  const auto rest = points<Dim>(frame.rest), x = points<Dim>(frame.x);
  std::map<std::int64_t, Sum> bodies;
  Box<Dim> box;
  for (std::size_t c = 0; c < frame.body.size(); ++c) {
    Sum& sum = bodies[frame.body[c]];
    for (int k = 0; k <= Dim; ++k) {
      const std::int64_t v = frame.simplices[(Dim + 1) * c + k];
      sum.u += x[v] - rest[v];
      box.include(rest[v]);
      ++sum.corners;
    }
  }
  for (const Vec<Dim>& p : points<Dim>(frame.obstacles.x)) box.include(p);
  double longest = 0;
  for (const auto& [id, sum] : bodies) longest = std::max(longest, sum.u.norm() / sum.corners);
  return bodies.empty() ? 0 : longest / (box.max - box.min).norm();
}

template <int Dim>
void check_frame(const StoredFrame& frame, const std::string& name, Certificate& certificate) {
  std::vector<Violation>& violations = certificate.violations;
  // NaN compares false with everything, and every predicate after it would pass.
  const auto is_finite = [](double value) { return std::isfinite(value); };
  for (const auto* x : {&frame.rest, &frame.x, &frame.obstacles.x, &frame.proxy.x}) {
    if (std::all_of(x->begin(), x->end(), is_finite)) continue;
    violations.push_back({Of::file, name + ": a position is not finite"});
    return;
  }
  const std::size_t before = violations.size();
  check_cells<Dim>(frame, frame.rest, "at rest ", name, violations);
  check_cells<Dim>(frame, frame.x, "", name, violations);
  if (frame.axisymmetric) check_axis(frame, name, violations);
  const FrameSurface<Dim> surface = make_surface<Dim>(frame);
  check_surface(surface, name, violations);
  Patches<Dim> curves;
  if (!surface.curved.empty()) curves = true_surface(surface);
  if (violations.size() == before) check_insides(surface, curves, name, violations);
  check_overlap(frame, surface, name, certificate);
  check_curves(surface, curves, name, violations);
  measure_overhangs(surface, certificate);
  certificate.flight = std::max(certificate.flight, flight<Dim>(frame));
}

std::vector<fs::path> frame_files(const fs::path& directory) {
  std::vector<fs::path> files = stored_frames(directory);
  if (files.empty()) throw InputError({directory.string(), "frames", "no *.h5 there", "a folder that `itr run` wrote"});
  return files;
}

}  // namespace

Certificate certify(const fs::path& directory) {
  Certificate certificate;
  for (const fs::path& file : frame_files(directory)) {
    const std::string name = "frames/" + file.filename().string();
    ++certificate.frames;
    if (const auto damaged = find_damage(file); !damaged.empty()) {
      for (const std::string& what : damaged)
        certificate.violations.push_back({Of::file, fmt::format("{}: {} is damaged: not what was written", name, what)});
      continue;
    }
    const StoredFrame frame = read_frame(file);
    certificate.units = frame.units;
    if (frame.dim == 2) {
      check_frame<2>(frame, name, certificate);
    } else {
      check_frame<3>(frame, name, certificate);
    }
  }
  return certificate;
}

}  // namespace itr::output