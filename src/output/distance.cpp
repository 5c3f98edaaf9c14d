// SPDX-License-Identifier: MIT
#include "itr/output/distance.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "frame_file.hpp"
#include "itr/core/error.hpp"
#include "itr/geometry/bvh.hpp"
#include "itr/geometry/intersection.hpp"
#include "surface_distance.hpp"

namespace itr::output {

namespace {

constexpr double kSameVolume = 1e-9;

template <int Dim>
Vec<Dim> point(const std::vector<double>& x, std::int64_t v) {
  return Eigen::Map<const Vec<Dim>>(x.data() + Dim * v);
}

/// The cells of one body: their simplices at rest and the displacements of their corners, a column each.
template <int Dim>
struct Cells {
  std::vector<Simplex<Dim>> simplices;
  std::vector<Eigen::Matrix<double, Dim, Dim + 1>> u;
  std::vector<Box<Dim>> boxes;
  double volume = 0;

  /// du/dX, constant in a cell.
  Mat<Dim> gradient(int c) const {
    Mat<Dim> edges;
    for (int k = 0; k < Dim; ++k) edges.col(k) = u[c].col(k + 1) - u[c].col(0);
    return edges * simplices[c].inverse_edges;
  }
};

template <int Dim>
using Bodies = std::map<std::int64_t, Cells<Dim>>;

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

template <int Dim>
Integrals integrate_difference(const Cells<Dim>& a, const Cells<Dim>& b) {
  Integrals sum;
  const Bvh<Dim> tree(b.boxes);
  std::vector<int> hits;
  OverlapIntegrals<Dim> overlap;
  for (int i = 0; i < static_cast<int>(a.simplices.size()); ++i) {
    const Mat<Dim> gradient = a.gradient(i);
    hits.clear();
    tree.query(a.boxes[i], hits);
    std::sort(hits.begin(), hits.end());
    for (const int j : hits) {
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
    const auto& u = cells.u[c];
    sum.square += volume / ((Dim + 1) * (Dim + 2)) * (u.squaredNorm() + u.rowwise().sum().squaredNorm());
    sum.gradient_square += volume * cells.gradient(c).squaredNorm();
    sum.volume += volume;
  }
  return sum;
}

template <int Dim>
std::vector<std::array<Vec<Dim>, Dim>> boundary_now(const StoredFrame& frame) {
  std::vector<std::array<Vec<Dim>, Dim>> facets(frame.surface.size() / Dim);
  for (std::size_t f = 0; f < facets.size(); ++f)
    for (int k = 0; k < Dim; ++k) facets[f][k] = point<Dim>(frame.x, frame.surface[Dim * f + k]);
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

}  // namespace

FrameDistance frame_distance(const std::filesystem::path& frame, const std::filesystem::path& reference) {
  const StoredFrame a = read_frame(frame), b = read_frame(reference);
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
