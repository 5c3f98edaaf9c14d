// SPDX-License-Identifier: MIT
#include "output/distance.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "fem/quadratic.hpp"
#include "fem/quadrature.hpp"
#include "frame_file.hpp"
#include "geometry/bvh.hpp"
#include "geometry/intersection.hpp"
#include "itr/core.hpp"
#include "surface_distance.hpp"

namespace itr::output {

namespace {

constexpr double kSameVolume = 1e-9;

template <int Dim>
Vec<Dim> point(const std::vector<double>& x, std::int64_t v) {
  return Eigen::Map<const Vec<Dim>>(x.data() + Dim * v);
}

/// Displacements of the nodes of a cell with curved edges, a column each.
template <int Dim>
struct CurvedField {
  CurvedEdges curved = 0;  ///< none: the cell's corners say it all
  Eigen::Matrix<double, Dim, kQuadraticNodes<Dim>> u = Eigen::Matrix<double, Dim, kQuadraticNodes<Dim>>::Zero();
};

/// The cells of one body: their simplices at rest and the displacements of their corners, a column each.
template <int Dim>
struct Cells {
  std::vector<Simplex<Dim>> simplices;
  std::vector<Eigen::Matrix<double, Dim, Dim + 1>> u;
  std::vector<CurvedField<Dim>> curved;  ///< by cell; empty where all edges are straight
  std::vector<Box<Dim>> boxes;
  double volume = 0;

  bool is_curved(int c) const { return !curved.empty() && curved[c].curved != 0; }
  /// The field of a cell, whatever it is.
  CurvedField<Dim> field(int c) const {
    if (is_curved(c)) return curved[c];
    CurvedField<Dim> straight;
    straight.u.template leftCols<Dim + 1>() = u[c];
    return straight;
  }
  /// Gradients of the barycentric coordinates of a cell, a column each.
  Eigen::Matrix<double, Dim, Dim + 1> coordinate_gradients(int c) const {
    Eigen::Matrix<double, Dim, Dim + 1> gradients;
    gradients.template rightCols<Dim>() = simplices[c].inverse_edges.transpose();
    gradients.col(0) = -gradients.template rightCols<Dim>().rowwise().sum();
    return gradients;
  }

  /// du/dX, constant in a cell.
  Mat<Dim> gradient(int c) const {
    Mat<Dim> edges;
    for (int k = 0; k < Dim; ++k) edges.col(k) = u[c].col(k + 1) - u[c].col(0);
    return edges * simplices[c].inverse_edges;
  }
};

template <int Dim>
using Bodies = std::map<std::int64_t, Cells<Dim>>;

/// The node of an edge of a stored frame, or none where it is straight.
std::optional<std::int64_t> curved_node(const StoredFrame& frame, std::int64_t a, std::int64_t b) {
  using Edge = std::array<std::int64_t, 2>;
  const Edge edge = {std::min(a, b), std::max(a, b)};
  const auto at = [&](std::int64_t e) { return Edge{frame.curved_edges[2 * e], frame.curved_edges[2 * e + 1]}; };
  const std::int64_t edges = static_cast<std::int64_t>(frame.curved_edges.size()) / 2;
  std::int64_t low = 0;
  for (std::int64_t high = edges; low < high;) {  // the first edge that is not before this one
    const std::int64_t middle = (low + high) / 2;
    if (at(middle) < edge)
      low = middle + 1;
    else
      high = middle;
  }
  if (low == edges || at(low) != edge) return std::nullopt;
  return static_cast<std::int64_t>(frame.x.size()) / frame.dim - edges + low;
}

/// By body, or all under one id.
template <int Dim>
Bodies<Dim> cells_of(const StoredFrame& frame, bool by_body) {
  Bodies<Dim> bodies;
  for (std::size_t c = 0; c < frame.body.size(); ++c) {
    std::array<Vec<Dim>, Dim + 1> corners;
    Eigen::Matrix<double, Dim, Dim + 1> u;
    Box<Dim> box;
    for (int k = 0; k <= Dim; ++k) {
      const std::int64_t v = frame.simplices[(Dim + 1) * c + k];
      corners[k] = point<Dim>(frame.rest, v);
      u.col(k) = point<Dim>(frame.x, v) - corners[k];
      box.include(corners[k]);
    }
    Cells<Dim>& cells = bodies[by_body ? frame.body[c] : 0];
    cells.simplices.emplace_back(corners);
    cells.u.push_back(u);
    cells.boxes.push_back(box);
    if (!frame.curved_edges.empty()) {
      CurvedField<Dim>& field = cells.curved.emplace_back();
      field.u.template leftCols<Dim + 1>() = u;
      for_each_edge<Dim>([&](int edge, int i, int j) {
        const std::int64_t* v = &frame.simplices[(Dim + 1) * c];
        if (const auto node = curved_node(frame, v[i], v[j])) {
          field.curved |= static_cast<CurvedEdges>(1 << edge);
          field.u.col(Dim + 1 + edge) = point<Dim>(frame.x, *node) - point<Dim>(frame.rest, *node);
        }
      });
    }
    cells.volume += cells.simplices.back().volume;
  }
  return bodies;
}

/// Whether two meshes have the same bodies together, but not each: a selection by place takes cells by their barycentres,
/// and finer ones go elsewhere.
template <int Dim>
bool are_divided_otherwise(const Bodies<Dim>& a, const Bodies<Dim>& b) {
  const auto has_same_id = [](const auto& x, const auto& y) { return x.first == y.first; };
  if (!std::equal(a.begin(), a.end(), b.begin(), b.end(), has_same_id)) return false;
  double all_a = 0, all_b = 0, moved = 0;
  for (const auto& [id, cells] : a) {
    all_a += cells.volume;
    all_b += b.at(id).volume;
    moved = std::max(moved, std::abs(cells.volume - b.at(id).volume));
  }
  return std::abs(all_a - all_b) < kSameVolume * all_a && moved > kSameVolume * all_a;
}

struct Integrals {
  double square = 0, gradient_square = 0, volume = 0;
};

constexpr int kSquareDegree = 4, kGradientDegree = 2;  ///< of squares of quadratic fields

/// A place in a piece of a cell, by barycentric coordinates in the cell.
template <int Dim>
std::array<double, Dim + 1> place(const std::array<Vec<Dim + 1>, Dim + 1>& corners,
                                  const std::array<double, Dim + 1>& weights) {
  Vec<Dim + 1> sum = Vec<Dim + 1>::Zero();
  for (int k = 0; k <= Dim; ++k) sum += weights[k] * corners[k];
  std::array<double, Dim + 1> l;
  for (int k = 0; k <= Dim; ++k) l[k] = sum[k];
  return l;
}

/// Integrates the difference of two fields over the intersection of their cells, exactly, where one of them has curved
/// edges.
template <int Dim>
class CurvedDifference {
 public:
  void add(const Cells<Dim>& a, int i, const Cells<Dim>& b, int j, Integrals& sum) {
    list_overlap(a.simplices[i], b.simplices[j], pieces_);
    if (pieces_.empty()) return;
    CurvedField<Dim> u = a.field(i), w = b.field(j);
    const Vec<Dim> shift = w.u.col(0);  // a constant is in both fields; without it the squares lose no digits
    u.u.colwise() -= shift;
    w.u.colwise() -= shift;
    const auto of_a = a.coordinate_gradients(i), of_b = b.coordinate_gradients(j);
    for (const auto& piece : pieces_) {
      sum.volume += piece.volume;
      for (const auto& at : quadrature<Dim>(kSquareDegree)) {
        const Vec<Dim> off = u.u * quadratic_shapes<Dim>(u.curved, place<Dim>(piece.in_a, at.weights)) -
                             w.u * quadratic_shapes<Dim>(w.curved, place<Dim>(piece.in_b, at.weights));
        sum.square += at.fraction * piece.volume * off.squaredNorm();
      }
      for (const auto& at : quadrature<Dim>(kGradientDegree)) {
        const Mat<Dim> off =
            u.u * quadratic_gradients<Dim, Dim>(u.curved, place<Dim>(piece.in_a, at.weights), of_a).transpose() -
            w.u * quadratic_gradients<Dim, Dim>(w.curved, place<Dim>(piece.in_b, at.weights), of_b).transpose();
        sum.gradient_square += at.fraction * piece.volume * off.squaredNorm();
      }
    }
  }

 private:
  std::vector<OverlapPiece<Dim>> pieces_;
};

template <int Dim>
Integrals integrate_difference(const Cells<Dim>& a, const Cells<Dim>& b) {
  Integrals sum;
  const Bvh<Dim> tree(b.boxes);
  std::vector<int> hits;
  OverlapIntegrals<Dim> overlap;
  CurvedDifference<Dim> curved;
  for (int i = 0; i < static_cast<int>(a.simplices.size()); ++i) {
    const Mat<Dim> gradient = a.gradient(i);
    hits.clear();
    tree.query(a.boxes[i], hits);
    std::sort(hits.begin(), hits.end());
    for (const int j : hits) {
      if (a.is_curved(i) || b.is_curved(j)) {
        curved.add(a, i, b, j, sum);
        continue;
      }
      if (!integrate_overlap(a.simplices[i], b.simplices[j], overlap)) continue;
      const double volume = overlap.volume();
      // A constant is in both fields; without it the squares lose no digits.
      const Vec<Dim> shift = b.u[j].col(0);
      const Eigen::Matrix<double, Dim, Dim + 1> u = a.u[i].colwise() - shift, w = b.u[j].colwise() - shift;
      sum.square +=
          (u * overlap.aa * u.transpose() - 2 * u * overlap.ab * w.transpose() + w * overlap.bb * w.transpose()).trace();
      sum.gradient_square += volume * (gradient - b.gradient(j)).squaredNorm();
      sum.volume += volume;
    }
  }
  return sum;
}

template <int Dim>
Integrals integrate_field(const Cells<Dim>& cells) {
  Integrals sum;
  for (int c = 0; c < static_cast<int>(cells.simplices.size()); ++c) {
    const double volume = cells.simplices[c].volume;
    if (cells.is_curved(c)) {
      const CurvedField<Dim>& field = cells.curved[c];
      for (const auto& at : quadrature<Dim>(kSquareDegree))
        sum.square += at.fraction * volume * (field.u * quadratic_shapes<Dim>(field.curved, at.weights)).squaredNorm();
      const auto gradients = cells.coordinate_gradients(c);
      for (const auto& at : quadrature<Dim>(kGradientDegree)) {
        const Mat<Dim> F = field.u * quadratic_gradients<Dim, Dim>(field.curved, at.weights, gradients).transpose();
        sum.gradient_square += at.fraction * volume * F.squaredNorm();
      }
      sum.volume += volume;
      continue;
    }
    const auto& u = cells.u[c];
    sum.square += volume / ((Dim + 1) * (Dim + 2)) * (u.squaredNorm() + u.rowwise().sum().squaredNorm());
    sum.gradient_square += volume * cells.gradient(c).squaredNorm();
    sum.volume += volume;
  }
  return sum;
}

template <int Dim>
using Facets = std::vector<std::array<Vec<Dim>, Dim>>;

// Chords may leave curved edges by this fraction of the surface's extent (a distance is told to no better), and are at most
// so many.
template <int Dim>
constexpr double kChordError = Dim == 2 ? 1e-7 : 1e-4;
template <int Dim>
constexpr int kMostChords = Dim == 2 ? 256 : 16;

/// Positions on a boundary facet with curved edges.
template <int Dim>
class CurvedFacet {
 public:
  CurvedFacet(const StoredFrame& frame, const std::int64_t* vertices) {
    for (int k = 0; k < Dim; ++k) x_.col(k) = point<Dim>(frame.x, vertices[k]);
    for_each_edge<Dim - 1>([&](int edge, int i, int j) {
      const auto node = curved_node(frame, vertices[i], vertices[j]);
      if (!node) return;
      curved_ |= static_cast<CurvedEdges>(1 << edge);
      x_.col(Dim + edge) = point<Dim>(frame.x, *node);
      bulge_ += (x_.col(Dim + edge) - 0.5 * (x_.col(i) + x_.col(j))).norm();
    });
  }
  /// Adds chords that stay as near to it as asked.
  void add_chords(double error, Facets<Dim>& facets) const {
    const int n = std::clamp(static_cast<int>(std::ceil(std::sqrt(bulge_ / error))), 1, kMostChords<Dim>);
    if constexpr (Dim == 2) {
      for (int i = 0; i < n; ++i) facets.push_back({at(i, n), at(i + 1, n)});
    } else {
      for (int i = 0; i < n; ++i)
        for (int j = 0; i + j < n; ++j) {
          facets.push_back({at(i, n, j), at(i + 1, n, j), at(i, n, j + 1)});
          if (i + j + 1 < n) facets.push_back({at(i + 1, n, j), at(i + 1, n, j + 1), at(i, n, j + 1)});
        }
    }
  }

 private:
  Vec<Dim> at(int i, int n, int j = 0) const {
    const double a = static_cast<double>(i) / n, b = static_cast<double>(j) / n;
    if constexpr (Dim == 2)
      return x_ * quadratic_shapes<1>(curved_, {1 - a, a});
    else
      return x_ * quadratic_shapes<2>(curved_, {1 - a - b, a, b});
  }

  Eigen::Matrix<double, Dim, kQuadraticNodes<Dim - 1>> x_ = Eigen::Matrix<double, Dim, kQuadraticNodes<Dim - 1>>::Zero();
  CurvedEdges curved_ = 0;
  double bulge_ = 0;  ///< no point is farther from the facet of the corners
};

template <int Dim>
Facets<Dim> boundary_now(const StoredFrame& frame) {
  Facets<Dim> facets;
  Box<Dim> box;
  for (std::size_t v = 0; Dim * v < frame.x.size(); ++v) box.include(point<Dim>(frame.x, static_cast<std::int64_t>(v)));
  const double error = kChordError<Dim> * (box.max - box.min).norm();
  for (std::size_t f = 0; Dim * f < frame.surface.size(); ++f) {
    const std::int64_t* vertices = &frame.surface[Dim * f];
    if (!frame.curved_edges.empty()) {
      CurvedFacet<Dim>(frame, vertices).add_chords(error, facets);
      continue;
    }
    auto& facet = facets.emplace_back();
    for (int k = 0; k < Dim; ++k) facet[k] = point<Dim>(frame.x, vertices[k]);
  }
  return facets;
}

template <int Dim>
FrameDistance distance_of(const StoredFrame& frame, const StoredFrame& reference) {
  Bodies<Dim> bodies = cells_of<Dim>(frame, true), reference_bodies = cells_of<Dim>(reference, true);
  if (are_divided_otherwise(bodies, reference_bodies)) {
    bodies = cells_of<Dim>(frame, false);
    reference_bodies = cells_of<Dim>(reference, false);
  }
  Integrals difference, of_reference;
  double volume = 0, reference_volume = 0;
  for (const auto& [id, cells] : bodies) {
    volume += cells.volume;
    const auto found = reference_bodies.find(id);
    if (found == reference_bodies.end()) continue;
    const Integrals part = integrate_difference(cells, found->second);
    difference.square += part.square;
    difference.gradient_square += part.gradient_square;
    difference.volume += part.volume;
  }
  for (const auto& [id, cells] : reference_bodies) {
    const Integrals part = integrate_field(cells);
    reference_volume += part.volume;
    of_reference.square += part.square;
    of_reference.gradient_square += part.gradient_square;
  }
  FrameDistance distance;
  distance.l2 = std::sqrt(std::max(0.0, difference.square));
  distance.h1_semi = std::sqrt(difference.gradient_square);
  distance.reference_l2 = std::sqrt(of_reference.square);
  distance.reference_h1_semi = std::sqrt(of_reference.gradient_square);
  distance.uncovered = std::max(0.0, 1 - difference.volume / std::max(volume, reference_volume));
  distance.surface = surface_distance<Dim>(boundary_now<Dim>(frame), boundary_now<Dim>(reference));
  return distance;
}

StoredFrame in_metres(StoredFrame frame) {
  if (frame.units.is_si()) return frame;
  const double metre = frame.units.factor("m");
  for (auto* places : {&frame.rest, &frame.x, &frame.obstacles.x, &frame.proxy.x})
    for (double& place : *places) place *= metre;
  frame.units = {};
  return frame;
}

}  // namespace

FrameDistance frame_distance(const std::filesystem::path& frame, const std::filesystem::path& reference) {
  const StoredFrame a = in_metres(read_frame(frame)), b = in_metres(read_frame(reference));
  if (a.dim != b.dim)
    throw InputError({frame.string(), "/fields/x", std::to_string(a.dim) + " columns",
                      std::to_string(b.dim) + ", as in " + reference.string()});
  return a.dim == 2 ? distance_of<2>(a, b) : distance_of<3>(a, b);
}

std::vector<ListedFrame> list_frames(const std::filesystem::path& directory) {
  std::vector<ListedFrame> entries;
  for (const auto& file : stored_frames(directory)) entries.push_back({file, read_frame_totals(file)});
  return entries;
}

}  // namespace itr::output
