// SPDX-License-Identifier: MIT
#include "energy/contact/averaged_contact.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "core/parallel.hpp"
#include "core/scratch_vector.hpp"
#include "fem/quadrature.hpp"
#include "geometry/bvh.hpp"

namespace itr {

namespace {

constexpr int kDegree = 5;    ///< of quadrature on a piece
constexpr double kReach = 2;  ///< gaps are bounded by 3/4 of this many widths
constexpr double kFar = 4;    ///< pieces of one part see each other where they are so many lengths apart at rest
constexpr std::size_t kBlock = 64;

/// b(s) = -(s - 1)^2 ln s and its derivatives.
struct Barrier {
  double value = 0, first = 0, second = 0;
  explicit Barrier(double s) {
    if (s >= 1) return;
    if (!(s > 0)) {
      value = std::numeric_limits<double>::infinity();
      return;
    }
    const double log = std::log(s), d = s - 1;
    value = -d * d * log;
    first = -2 * d * log - d * d / s;
    second = -2 * log - 4 * d / s + d * d / (s * s);
  }
};

/// A gap bounded from above by 3/4 of `most`: the gap itself below half of it.
struct BoundedGap {
  double value, first = 0, second = 0;
  BoundedGap(double gap, double most) {
    const double half = most / 2, u = (gap - half) / half;
    if (u <= 0) {
      value = gap;
      first = 1;
    } else if (u < 1) {
      value = half + half * (u - u * u * u + u * u * u * u / 2);
      first = 1 - 3 * u * u + 2 * u * u * u;
      second = 6 * (u * u - u) / half;
    } else {
      value = 1.5 * half;
    }
  }
};

/// Coefficients of 1, t, t^2 of the depth along a piece.
Vec<3> depths_along(const CurvePiece& piece, const Retraction& retraction) {
  Vec<3> depths = Vec<3>::Zero();
  for (int k = 0; k < 3; ++k) depths += retraction.depth[piece.owners[k]] * piece.hats.row(k).transpose();
  return depths;
}

/// The t in [0, 1] with the least distance from q less depth, from the nearest one on: there the gap has the derivatives of
/// a fixed t.
double least_less_depth(const PlacedPiece& piece, const Vec<3>& depths, const Vec<2>& q, double nearest) {
  if (depths[1] == 0 && depths[2] == 0) return nearest;
  const auto slope = [&](double s) {
    return (piece.at(s) - q).normalized().dot(piece.tangent(s)) - depths[1] - 2 * s * depths[2];
  };
  const bool is_before = slope(nearest) > 0;
  const double low = is_before ? 0 : nearest, high = is_before ? nearest : 1;
  if (is_before && slope(low) >= 0) return low;
  if (!is_before && slope(high) <= 0) return high;
  return bracketed_root(low, high, nearest, [&](double s) {
    const Vec<2> away = piece.at(s) - q, tangent = piece.tangent(s);
    const double distance = away.norm(), along = away.dot(tangent) / distance;
    return std::pair(slope(s),
                     (tangent.squaredNorm() - along * along + 2 * away.dot(piece.c[2])) / distance - 2 * depths[2]);
  });
}

}  // namespace

/// Gaps and averages at the positions that were asked for last.
struct AveragedContact::Cache {
  const CollisionSurface* surface = nullptr;
  int revision = 0;
  ScratchVector x;
  std::vector<Gap> gaps;
  Averages averages;
};

AveragedContact::AveragedContact(const CollisionSurface& surface, double scale)
    : surface_(&surface),
      retraction_(surface.retraction.get()),
      scale_(scale),
      pieces_(curve_pieces(surface, *surface.retraction)),
      measure_(surface.area.size(), 0) {
  for (int i = 0; i < static_cast<int>(pieces_.size()); ++i) {
    const CurvePiece& piece = pieces_[i];
    if (!surface.counts[piece.vertex]) continue;
    double width = 0;
    for (int k = 0; k < 3; ++k)
      if (!piece.hats.row(k).isZero(0)) width = std::max(width, retraction_->width[piece.owners[k]]);
    if (width == 0) continue;
    for (const auto& node : quadrature<1>(kDegree)) {
      const double t = node.weights[1];
      points_.push_back({i, t, node.fraction * piece.length, piece.hats * CurvePiece::powers(t), width});
      for (int k = 0; k < 3; ++k) measure_[piece.owners[k]] += points_.back().weight * points_.back().hats[k];
    }
  }
}

/// All pieces at some positions, in a tree.
class AveragedContact::GapFinder {
 public:
  GapFinder(const AveragedContact& contact, ConstVectorView x) : contact_(contact) {
    std::vector<Box<2>> boxes;
    for (const CurvePiece& piece : contact.pieces_) {
      PlacedPiece placed;
      for (int k = 0; k < 3; ++k) placed.c[k] = piece.position(piece.coefficients.col(k), x);
      boxes.emplace_back();
      boxes.back().include(placed.c[0]);
      boxes.back().include(placed.c[0] + placed.c[1] / 2);
      boxes.back().include(placed.at(1));
      placed_.push_back(placed);
      depths_.push_back(depths_along(piece, *contact.retraction_));
    }
    tree_.build(boxes);
    for (const double depth : contact.retraction_->depth) deepest_ = std::max(deepest_, depth);
  }

  /// `near` is scratch.
  Gap find(const Point& point, std::vector<int>& near) const {
    const CurvePiece& own = contact_.pieces_[point.piece];
    const Vec<2> q = placed_[point.piece].at(point.t);
    const double most = kReach * point.width;
    near.clear();
    tree_.query(Box<2>{q, q}.inflated(most + 2 * deepest_), near);
    std::sort(near.begin(), near.end());
    Gap gap;
    double least = std::numeric_limits<double>::infinity();
    for (const int i : near) {
      if (!sees(own, contact_.pieces_[i])) continue;
      const PlacedPiece& piece = placed_[i];
      const double nearest = piece.nearest(q);
      const Vec<2> tangent = piece.tangent(nearest);
      const Vec<2> outward = contact_.pieces_[i].side * Vec<2>(tangent[1], -tangent[0]);
      // Behind the other curve distances are negative, so that contact never holds an overlap.
      const double sign = outward.dot(q - piece.at(nearest)) < 0 ? -1 : 1;
      if (sign < 0 && (q - piece.at(nearest)).norm() > point.width) continue;  // the far side of a thin body
      const double t = least_less_depth(piece, sign * depths_[i], q, nearest);
      const Vec<2> separation = q - piece.at(t);
      const double distance = separation.norm();
      if (const double left = distance - depth_at(i, t); left < least) {
        least = left;
        gap.distance = sign * distance;
        gap.foot = i;
        gap.t = t;
        gap.normal = sign * separation / distance;
      }
    }
    double value = most;
    if (gap.foot != kNone) value = gap.distance - depth_at(point.piece, point.t) - depth_at(gap.foot, gap.t);
    const BoundedGap bounded(value, most);
    gap.value = bounded.value;
    gap.first = bounded.first;
    gap.second = bounded.second;
    return gap;
  }

 private:
  double depth_at(int piece, double t) const { return depths_[piece].dot(CurvePiece::powers(t)); }
  bool sees(const CurvePiece& own, const CurvePiece& other) const {
    if (own.part != other.part) return true;
    const auto& rest = contact_.retraction_->rest;
    return (rest[own.vertex] - rest[other.vertex]).norm() > kFar * (own.length + other.length);
  }

  const AveragedContact& contact_;
  std::vector<PlacedPiece> placed_;
  std::vector<Vec<3>> depths_;  ///< as depths_along() has them
  Bvh<2> tree_;
  double deepest_ = 0;
};

auto AveragedContact::at(ConstVectorView x, Workspace& workspace) const -> const Cache& {
  auto& cache = workspace.get<Cache>();
  if (cache.surface == surface_ && cache.revision == surface_->revision && cache.x.size() == x.size() &&
      std::memcmp(cache.x.view().data(), x.data(), sizeof(double) * x.size()) == 0)
    return cache;
  const GapFinder finder(*this, x);
  cache.gaps.resize(points_.size());
  parallel_blocks(points_.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    std::vector<int> near;
    for (std::size_t i = begin; i < end; ++i) cache.gaps[i] = finder.find(points_[i], near);
  });
  average(cache.gaps, cache.averages);
  cache.surface = surface_;
  cache.revision = surface_->revision;
  cache.x = x;
  return cache;
}

void AveragedContact::average(const std::vector<Gap>& gaps, Averages& averages) const {
  const std::size_t n = measure_.size();
  std::vector<double> sum(n, 0);
  for (std::size_t i = 0; i < points_.size(); ++i)
    for (int k = 0; k < 3; ++k)
      sum[pieces_[points_[i].piece].owners[k]] += points_[i].weight * points_[i].hats[k] * gaps[i].value;
  for (auto* values : {&averages.value, &averages.first, &averages.second}) values->assign(n, 0);
  for (std::size_t v = 0; v < n; ++v) {
    const double width = retraction_->width[v];
    if (!(measure_[v] > 0) || width == 0 || sum[v] >= 0) continue;
    const Barrier barrier(1 + sum[v] / measure_[v] / width);
    const double half = retraction_->stiffness[v] / 2;
    averages.value[v] = half * width * barrier.value;
    averages.first[v] = half * barrier.first;
    averages.second[v] = half / width * barrier.second;
  }
}

/// Derivative of the energy over the scale by a point's gap.
double AveragedContact::slope(const Point& point, const Gap& gap, const Averages& averages) const {
  double sum = 0;
  for (int k = 0; k < 3; ++k) sum += point.hats[k] * averages.first[pieces_[point.piece].owners[k]];
  return gap.acts() ? point.weight * sum : 0;
}

double AveragedContact::value(ConstVectorView x, Workspace& workspace) const {
  const Averages& averages = at(x, workspace).averages;
  double sum = 0;
  for (std::size_t v = 0; v < measure_.size(); ++v)
    if (averages.value[v] > 0) sum += measure_[v] * averages.value[v];
  return scale_ * sum;
}

auto AveragedContact::pressed(const Point& point, const Gap& gap) const -> PressedPoint {
  const CurvePiece &own = pieces_[point.piece], &foot = pieces_[gap.foot];
  PressedPoint result{.normal = gap.normal};
  const auto add = [&](const CurvePiece& piece, const CurvePiece::Weights& weights, double sign) {
    for (int k = 0; k < piece.size; ++k) {
      result.vertices[result.size] = piece.vertices[k];
      result.coefficients[result.size++] = sign * weights[k];
    }
  };
  add(own, own.at(point.t), 1);
  add(foot, foot.at(gap.t), -1);
  return result;
}

auto AveragedContact::pressed_points(ConstVectorView x, Workspace& workspace) const -> std::vector<PressedPoint> {
  const Cache& now = at(x, workspace);
  std::vector<PressedPoint> result;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const double by_gap = slope(points_[i], now.gaps[i], now.averages);
    if (by_gap == 0) continue;
    result.push_back(pressed(points_[i], now.gaps[i]));
    result.back().force = -by_gap * now.gaps[i].first;
  }
  return result;
}

void AveragedContact::add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const {
  for (const PressedPoint& p : pressed_points(x, workspace))
    for (int k = 0; k < p.size; ++k)
      gradient.segment<2>(2 * p.vertices[k]) -= scale_ * p.force * p.coefficients[k] * p.normal;
}

/// Adds W b'' grad y grad y^T of each vertex.
void AveragedContact::add_hessian_of_averages(const Cache& now, HessianSink& sink) const {
  struct Part {
    int vertex;
    double weight;
    PressedPoint point;
  };
  std::vector<Part> parts;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (!now.gaps[i].acts()) continue;
    const PressedPoint point = pressed(points_[i], now.gaps[i]);
    for (int k = 0; k < 3; ++k) {
      const int v = pieces_[points_[i].piece].owners[k];
      const double weight = points_[i].weight * points_[i].hats[k] * now.gaps[i].first;
      if (weight != 0 && now.averages.second[v] > 0) parts.push_back({v, weight, point});
    }
  }
  std::stable_sort(parts.begin(), parts.end(), [](const Part& a, const Part& b) { return a.vertex < b.vertex; });
  std::vector<int> vertices;
  VectorX slope;  // W grad y
  for (auto begin = parts.begin(); begin != parts.end();) {
    const int v = begin->vertex;
    const auto end = std::find_if(begin, parts.end(), [v](const Part& part) { return part.vertex != v; });
    vertices.clear();
    for (auto it = begin; it != end; ++it)
      vertices.insert(vertices.end(), it->point.vertices.begin(), it->point.vertices.begin() + it->point.size);
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    slope.setZero(2 * std::ssize(vertices));
    for (auto it = begin; it != end; ++it)
      for (int k = 0; k < it->point.size; ++k) {
        const auto at = std::lower_bound(vertices.begin(), vertices.end(), it->point.vertices[k]) - vertices.begin();
        slope.segment<2>(2 * at) += it->weight * it->point.coefficients[k] * it->point.normal;
      }
    const MatrixX block = scale_ * now.averages.second[v] / measure_[v] * slope * slope.transpose();
    sink.add<2>(vertices, block.data());
    begin = end;
  }
}

/// Second derivatives of the bounded gap of a point; the foot follows the place on the piece with the least gap.
auto AveragedContact::curvature(const Point& point, const Gap& gap, const PressedPoint& pressed, ConstVectorView x) const
    -> Curvature {
  const CurvePiece &own = pieces_[point.piece], &foot = pieces_[gap.foot];
  const CurvePiece::Weights slope = foot.slope(gap.t);
  const Vec<2> along = foot.position(slope, x), bend = foot.position(foot.bend(), x);
  const Vec<2> across = along - gap.normal.dot(along) * gap.normal;
  // Derivatives of the distance; of t and the positions.
  Vec<kMostDofs> first = Vec<kMostDofs>::Zero(), mixed = Vec<kMostDofs>::Zero();
  Curvature hessian = Curvature::Zero();
  for (int k = 0; k < pressed.size; ++k) {
    first.segment<2>(2 * k) = pressed.coefficients[k] * gap.normal;
    mixed.segment<2>(2 * k) = -pressed.coefficients[k] * across;
    if (k >= own.size) mixed.segment<2>(2 * k) -= slope[k - own.size] * gap.distance * gap.normal;
    for (int l = 0; l < pressed.size; ++l)
      hessian.block<2, 2>(2 * k, 2 * l).diagonal().setConstant(pressed.coefficients[k] * pressed.coefficients[l]);
  }
  hessian -= first * first.transpose();
  const double stiffness =
      across.squaredNorm() - gap.distance * (gap.normal.dot(bend) + 2 * depths_along(foot, *retraction_)[2]);
  if (gap.t > 0 && gap.t < 1 && stiffness > 0) hessian -= mixed * mixed.transpose() / stiffness;
  return gap.first / gap.distance * hessian + gap.second * first * first.transpose();
}

void AveragedContact::add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const {
  const Cache& now = at(x, workspace);
  add_hessian_of_averages(now, sink);
  using Block = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMostDofs, kMostDofs>;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const double by_gap = slope(points_[i], now.gaps[i], now.averages);
    if (by_gap == 0) continue;
    const PressedPoint p = pressed(points_[i], now.gaps[i]);
    const int n = 2 * p.size;
    Block block = scale_ * by_gap * curvature(points_[i], now.gaps[i], p, x).topLeftCorner(n, n);
    if (psd != PsdProjection::none) {
      const Eigen::SelfAdjointEigenSolver<Block> eigen(block);
      block = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() * eigen.eigenvectors().transpose();
    }
    sink.add<2>(std::span(p.vertices.data(), p.size), block.data());
  }
}

}  // namespace itr
