// SPDX-License-Identifier: MIT
#include "itr/energy/contact/contact.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "itr/core/parallel.hpp"
#include "itr/geometry/ccd.hpp"
#include "itr/geometry/distance.hpp"

namespace itr {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

template <int Dim>
Vec<Dim> at(ConstVectorView x, int v) {
  return x.segment<Dim>(Dim * v);
}

template <int Size>
void clamp_to_psd(Mat<Size>& block) {
  const Eigen::SelfAdjointEigenSolver<Mat<Size>> eigen(block);
  if (eigen.eigenvalues()[0] >= 0) return;
  block = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).asDiagonal() * eigen.eigenvectors().transpose();
}

bool same_features(const ContactStencil& p, const ContactStencil& q) { return p.a == q.a && p.b1 == q.b1 && p.b2 == q.b2; }

/// Sorts by features and sums the weights of equal ones; drops those that cancel.
void merge(std::vector<ContactStencil>& stencils) {
  std::stable_sort(stencils.begin(), stencils.end(), [](const ContactStencil& p, const ContactStencil& q) {
    return std::tie(p.a, p.b1, p.b2) < std::tie(q.a, q.b1, q.b2);
  });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < stencils.size();) {
    ContactStencil sum = stencils[i];
    double magnitude = std::abs(sum.weight);
    for (++i; i < stencils.size() && same_features(stencils[i], sum); ++i) {
      sum.weight += stencils[i].weight;
      magnitude += std::abs(stencils[i].weight);
    }
    if (std::abs(sum.weight) > 1e-14 * magnitude) stencils[kept++] = sum;
  }
  stencils.resize(kept);
}

}  // namespace

template <int Dim>
ContactEnergy<Dim>::ContactEnergy(const CollisionSurface& surface, const ContactOptions& options, double stiffness,
                                  double scale)
    : surface_(surface),
      dhat_(options.activation_distance),
      convergent_(options.convergent),
      stiffness_(stiffness),
      scale_(scale),
      weight_scale_(options.convergent ? 1 / (dhat_ * dhat_ * dhat_) : 1) {}

template <int Dim>
double ContactEnergy<Dim>::barrier(double D) const {
  const double Dhat = dhat_ * dhat_;
  if (D >= Dhat) return 0;
  if (!(D > 0)) return kInfinity;
  return -(D - Dhat) * (D - Dhat) * std::log(D / Dhat);
}

template <int Dim>
double ContactEnergy<Dim>::barrier_first(double D) const {
  const double Dhat = dhat_ * dhat_;
  return D >= Dhat ? 0 : (Dhat - D) * (2 * std::log(D / Dhat) - Dhat / D + 1);
}

template <int Dim>
double ContactEnergy<Dim>::barrier_second(double D) const {
  const double Dhat = dhat_ * dhat_, r = Dhat / D;
  return D >= Dhat ? 0 : (r + 2) * r - 2 * std::log(D / Dhat) - 3;
}

template <int Dim>
const std::vector<std::array<int, 3>>& ContactEnergy<Dim>::candidates(ConstVectorView x, const VectorX* dx,
                                                                      Workspace& workspace) const {
  auto& cache = workspace.get<ContactCandidates<Dim>>();
  const std::size_t n = surface_.vertices.size();
  bool valid = cache.surface == &surface_ && cache.boxes.size() == n;
  for (std::size_t i = 0; valid && i < n; ++i) {
    const Vec<Dim> p = at<Dim>(x, surface_.vertices[i]);
    valid = cache.boxes[i].contains(p) && (!dx || cache.boxes[i].contains(p + at<Dim>(*dx, surface_.vertices[i])));
  }
  if (valid) return cache.pairs;

  // Boxes hold the motion and some room around it, so that the list serves a whole line search and often the next one.
  double motion = 0;
  if (dx)
    for (const int v : surface_.vertices) motion = std::max(motion, at<Dim>(*dx, v).norm());
  const double room = 0.5 * dhat_ + 0.25 * motion;
  cache.surface = &surface_;
  cache.boxes.assign(n, {});
  std::vector<Box<Dim>> reach(surface_.area.size());
  for (std::size_t i = 0; i < n; ++i) {
    const int v = surface_.vertices[i];
    cache.boxes[i].include(at<Dim>(x, v));
    if (dx) cache.boxes[i].include(at<Dim>(x, v) + at<Dim>(*dx, v));
    cache.boxes[i] = cache.boxes[i].inflated(room);
    reach[v] = cache.boxes[i].inflated(dhat_ / 2);
  }
  std::vector<Box<Dim>> edge_boxes(surface_.edges.size());
  for (std::size_t e = 0; e < edge_boxes.size(); ++e)
    for (const int v : surface_.edges[e]) edge_boxes[e].include(reach[v]);
  cache.pairs.clear();
  const auto consider = [&](int v, int e) {
    const auto [e0, e1] = surface_.edges[e];
    if (v != e0 && v != e1 && counts(v, e0, e1)) cache.pairs.push_back({v, e0, e1});
  };
  if (n * edge_boxes.size() < 4096) {
    for (const int v : surface_.vertices)
      for (std::size_t e = 0; e < edge_boxes.size(); ++e)
        if (reach[v].overlaps(edge_boxes[e])) consider(v, static_cast<int>(e));
  } else {
    const Bvh<Dim> tree(edge_boxes);
    std::vector<int> hits;
    for (const int v : surface_.vertices) {
      hits.clear();
      tree.query(reach[v], hits);
      for (const int e : hits) consider(v, e);
    }
  }
  return cache.pairs;
}

template <int Dim>
double ContactEnergy<Dim>::squared_distance(const ContactStencil& s, ConstVectorView x) const {
  if (s.b2 == kNone) return point_point_distance_squared<Dim>(at<Dim>(x, s.a), at<Dim>(x, s.b1));
  return point_line_distance_squared<Dim>(at<Dim>(x, s.a), at<Dim>(x, s.b1), at<Dim>(x, s.b2));
}

template <int Dim>
std::vector<ContactStencil> ContactEnergy<Dim>::active(ConstVectorView x, Workspace& workspace) const {
  const double Dhat = dhat_ * dhat_;
  std::vector<ContactStencil> stencils;
  std::vector<std::array<int, 2>> corners;  // vertex pairs within reach, each once: where edges' regions overlap
  for (const auto& [v, e0, e1] : candidates(x, nullptr, workspace)) {
    const Vec<Dim> p = at<Dim>(x, v), a = at<Dim>(x, e0), b = at<Dim>(x, e1);
    if (point_edge_distance_squared<Dim>(p, a, b) >= Dhat) continue;
    const double weight = convergent_ ? surface_.area[v] / 2 * weight_scale_ : 1;
    switch (closest_feature_on_edge<Dim>(p, a, b)) {
      case EdgeFeature::vertex0:
        stencils.push_back({std::min(v, e0), std::max(v, e0), kNone, weight});
        break;
      case EdgeFeature::vertex1:
        stencils.push_back({std::min(v, e1), std::max(v, e1), kNone, weight});
        break;
      case EdgeFeature::interior:
        stencils.push_back({v, std::min(e0, e1), std::max(e0, e1), weight});
        break;
    }
    if (!convergent_) continue;
    for (const int q : {e0, e1})
      if ((surface_.counts[v] || surface_.counts[q]) && point_point_distance_squared<Dim>(p, at<Dim>(x, q)) < Dhat)
        corners.push_back({std::min(v, q), std::max(v, q)});
  }
  std::sort(corners.begin(), corners.end());
  corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
  for (const auto& [i, j] : corners) {
    const bool adjacent = std::binary_search(surface_.edges.begin(), surface_.edges.end(), std::array{i, j});
    const auto correct = [&](int vertex, int corner) {  // the corner's edges count the vertex n times
      const int n = surface_.degree[corner] - (adjacent ? 1 : 0);
      if (n > 1) stencils.push_back({i, j, kNone, (1 - n) * surface_.area[vertex] / 2 * weight_scale_});
    };
    correct(i, j);
    correct(j, i);
  }
  merge(stencils);
  return stencils;
}

template <int Dim>
double ContactEnergy<Dim>::min_distance(ConstVectorView x, Workspace& workspace) const {
  double smallest = kInfinity;
  for (const auto& [v, e0, e1] : candidates(x, nullptr, workspace))
    smallest = std::min(smallest, point_edge_distance_squared<Dim>(at<Dim>(x, v), at<Dim>(x, e0), at<Dim>(x, e1)));
  return std::sqrt(smallest);
}

template <int Dim>
double ContactEnergy<Dim>::value(ConstVectorView x, Workspace& workspace) const {
  double sum = 0;
  for (const auto& s : active(x, workspace)) {
    const double b = barrier(squared_distance(s, x));
    if (!std::isfinite(b)) return kInfinity;  // whatever the sign of its weight
    sum += s.weight * b;
  }
  return scale_ * stiffness_ * sum;
}

template <int Dim>
void ContactEnergy<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const {
  for (const auto& s : active(x, workspace)) {
    const double factor = scale_ * stiffness_ * s.weight * barrier_first(squared_distance(s, x));
    const auto scatter = [&](const auto& local) {
      for (int k = 0; k < s.size(); ++k)
        gradient.segment<Dim>(Dim * s.vertices()[k]) += factor * local.template segment<Dim>(Dim * k);
    };
    if (s.b2 == kNone)
      scatter(point_point_distance_squared_gradient<Dim>(at<Dim>(x, s.a), at<Dim>(x, s.b1)));
    else
      scatter(point_line_distance_squared_gradient<Dim>(at<Dim>(x, s.a), at<Dim>(x, s.b1), at<Dim>(x, s.b2)));
  }
}

template <int Dim>
void ContactEnergy<Dim>::add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const {
  for (const auto& s : active(x, workspace)) {
    const double D = squared_distance(s, x), factor = scale_ * stiffness_ * s.weight;
    const auto add = [&](const auto& gradient, const auto& hessian) {
      constexpr int kSize = std::decay_t<decltype(gradient)>::RowsAtCompileTime;
      Mat<kSize> block = factor * (barrier_second(D) * gradient * gradient.transpose() + barrier_first(D) * hessian);
      if (psd == PsdProjection::clamp) clamp_to_psd<kSize>(block);
      const auto vertices = s.vertices();
      sink.add<Dim>(std::span(vertices.data(), s.size()), block.data());
    };
    if (s.b2 == kNone)
      add(point_point_distance_squared_gradient<Dim>(at<Dim>(x, s.a), at<Dim>(x, s.b1)),
          point_point_distance_squared_hessian<Dim>());
    else
      add(point_line_distance_squared_gradient<Dim>(at<Dim>(x, s.a), at<Dim>(x, s.b1), at<Dim>(x, s.b2)),
          point_line_distance_squared_hessian<Dim>(at<Dim>(x, s.a), at<Dim>(x, s.b1), at<Dim>(x, s.b2)));
  }
}

template <int Dim>
double ContactEnergy<Dim>::max_step(ConstVectorView x, ConstVectorView dx, Workspace& workspace) const {
  const VectorX motion = dx;
  double step = 1;
  for (const auto& [v, e0, e1] : candidates(x, &motion, workspace)) {
    const Vec<Dim> p = at<Dim>(x, v), a = at<Dim>(x, e0), b = at<Dim>(x, e1);
    // Later pairs are only asked about the part of the way that earlier ones left over.
    step *= point_edge_ccd<Dim>(p, a, b, p + step * at<Dim>(dx, v), a + step * at<Dim>(dx, e0), b + step * at<Dim>(dx, e1));
  }
  return step;
}

template class ContactEnergy<2>;
template class ContactEnergy<3>;

}  // namespace itr
