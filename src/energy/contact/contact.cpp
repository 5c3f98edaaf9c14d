// SPDX-License-Identifier: MIT
#include "energy/contact/contact.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "blocking_pairs.hpp"
#include "candidates.hpp"
#include "core/parallel_reduce.hpp"
#include "core/scratch_vector.hpp"
#include "geometry/ccd.hpp"
#include "pairs.hpp"

namespace itr {

namespace {

constexpr double kKeptGap = 0.5;  ///< of the gap, or of the activation distance where the gap is wider

/// Which fractions of their steps the vertices of a pair may go, from 0 to 1, for a plane to stay between its primitives all
/// the way. `dhat`: they may come as near as half of it, or of their distance.
template <int Dim>
std::array<double, 4> planar_fractions(PairKind kind, const Positions<Dim>& p, const Positions<Dim>& motion, double dhat) {
  std::array<double, 4> fractions{1, 1, 1, 1};
  const int size = pair_size(kind), first = size_of_first(kind);
  Positions<Dim> q;
  for (int k = 0; k < size; ++k) q[k] = p[k] + motion[k];
  if (!motions_overlap<Dim>(kind, p, q)) return fractions;
  const ClosestFeatures closest = closest_features<Dim>(kind, p.data());
  Positions<Dim> features;
  for (int k = 0; k < pair_size(closest.kind); ++k) features[k] = p[closest.local[k]];
  Vec<Dim> normal = pair_distance<Dim>(closest.kind, features.data()).separation;
  const double distance = normal.norm();
  if (!(distance > 0)) return {0, 0, 0, 0};
  normal /= distance;
  // Heights over the second primitive, of the first one; the vertices' ways towards the other.
  if (normal.dot(p[0] - p[first]) < 0) normal = -normal;
  std::array<double, 4> height, approach;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  double first_approach = 0, second_approach = 0;
  for (int k = 0; k < size; ++k) {
    height[k] = normal.dot(p[k] - p[0]);
    approach[k] = (k < first ? -1 : 1) * normal.dot(motion[k]);
    if (k < first) {
      low = std::min(low, height[k]);
      first_approach = std::max(first_approach, approach[k]);
    } else {
      high = std::max(high, height[k]);
      second_approach = std::max(second_approach, approach[k]);
    }
  }
  const double gap = low - high;
  const double room = gap - kKeptGap * std::min(gap, dhat);
  const double total = first_approach + second_approach;
  if (total <= room) return fractions;
  for (int k = 0; k < size; ++k) {
    if (approach[k] <= 0) continue;
    const double own =
        k < first ? height[k] - low + room * first_approach / total : high - height[k] + room * second_approach / total;
    fractions[k] = std::clamp(own / approach[k], 0.0, 1.0);
  }
  return fractions;
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kBlock = 64;
constexpr std::size_t kBatch = 1024;  ///< local Hessians that are held at a time

const char* name_of(PairKind kind) {
  return kind == PairKind::edge_vertex   ? "vertex-edge pair"
         : kind == PairKind::face_vertex ? "vertex-triangle pair"
                                         : "edge-edge pair";
}

/// The features of a mollified pair whose distance counts.
template <int Dim>
Positions<Dim> closest_of(const ContactStencil& s, const Positions<Dim>& p) {
  Positions<Dim> closest;
  for (int k = 0; k < pair_size(s.closest.kind); ++k) closest[k] = p[s.closest.local[k]];
  return closest;
}

/// m(s) = (2 - s / eps) s / eps below eps, and its derivatives.
struct Mollifier {
  double value = 1, first = 0, second = 0;
  Mollifier(double s, double eps) {
    if (s >= eps) return;
    value = (2 - s / eps) * (s / eps);
    first = 2 / eps * (1 - s / eps);
    second = -2 / (eps * eps);
  }
};

/// Projects the negative eigenvalues of a block whose range the orthonormal (or zero) columns of `basis` span: the
/// eigenproblem is as small as that range.
template <int Size, int Rank>
void project_to_psd(const Eigen::Matrix<double, Size, Rank>& basis, PsdProjection psd, Mat<Size>& block) {
  const Mat<Rank> reduced = basis.transpose() * block * basis;
  const Eigen::SelfAdjointEigenSolver<Mat<Rank>> eigen(reduced);
  if (eigen.eigenvalues()[0] >= 0) return;
  const Eigen::Matrix<double, Size, Rank> modes = basis * eigen.eigenvectors();
  const Vec<Rank> values = eigen.eigenvalues().unaryExpr([psd](double value) { return projected(value, psd); });
  block.noalias() = modes * values.asDiagonal() * modes.transpose();
}

/// Basis orthogonal to translations of four vertices: columns of Helmert's matrix (x) I.
const Eigen::Matrix<double, 12, 9>& relative_motions() {
  static const Eigen::Matrix<double, 12, 9> basis = [] {
    Eigen::Matrix<double, 12, 9> b = Eigen::Matrix<double, 12, 9>::Zero();
    for (int k = 1; k < 4; ++k)
      for (int i = 0; i <= k; ++i)
        b.block<3, 3>(3 * i, 3 * (k - 1)) = (i < k ? 1 : -k) / std::sqrt(k * (k + 1.0)) * Mat<3>::Identity();
    return b;
  }();
  return basis;
}

/// Gradient of the squared distance of a pair's own features.
template <int Dim>
Vec<4 * Dim> squared_distance_gradient(const PairDistance<Dim>& pair) {
  Vec<4 * Dim> gradient;
  for (int k = 0; k < 4; ++k) gradient.template segment<Dim>(Dim * k) = 2 * pair.coefficients[k] * pair.separation;
  return gradient;
}

/// b(D) of the features that count, its gradient and Hessian, spread to the vertices of the mollified pair.
struct SpreadDistance {
  double D;
  Vec<12> gradient = Vec<12>::Zero();
  Mat<12> hessian = Mat<12>::Zero();
  SpreadDistance(const ContactStencil& s, const Positions<3>& p, bool with_hessian) {
    const Positions<3> closest = closest_of<3>(s, p);
    const int size = pair_size(s.closest.kind);
    const auto pair = pair_distance<3>(s.closest.kind, closest.data());
    D = pair.squared;
    for (int i = 0; i < size; ++i) gradient.segment<3>(3 * s.closest.local[i]) = 2 * pair.coefficients[i] * pair.separation;
    if (!with_hessian) return;
    const Mat<12> H = pair_distance_hessian<3>(s.closest.kind, closest.data());
    for (int i = 0; i < size; ++i)
      for (int j = 0; j < size; ++j)
        hessian.block<3, 3>(3 * s.closest.local[i], 3 * s.closest.local[j]) = H.block<3, 3>(3 * i, 3 * j);
  }
};

/// By vertex, the fraction of its way that is free.
struct Fractions {
  std::vector<double> of_vertex;
};

/// Memory of a way whose pairs are too many at a time.
struct PartOfStep {
  ScratchVector motion, from;
};

constexpr int kMostParts = 16;

/// Walks from x along dx, part by part where its pairs are too many at a time, up to the first part that is not free.
/// `free_share_of(x, way)` says how much of a part is. Returns the fraction of dx that is free, at most that of kMostParts
/// parts.
template <int Dim, typename FreeFraction>
double walk(const CollisionSurface& surface, ConstVectorView x, ConstVectorView dx, double reach, Workspace& workspace,
            const FreeFraction& free_fraction_of) {
  auto& candidates = workspace.get<ContactCandidates<Dim>>();
  auto& [part, from] = workspace.get<PartOfStep>();
  double length = candidates.update(surface, x, dx, reach, part);
  if (length == 1) return free_fraction_of(x, dx);
  double done = 0;
  from = x;
  for (int k = 0; k < kMostParts; ++k) {
    const double fraction = free_fraction_of(from.view(), part.view());
    if (fraction < 1) return done + fraction * length;
    done += length;
    if (done >= 1) break;
    from = x + done * dx;
    length = candidates.update(surface, from.view(), dx, reach, part, std::min(length, 1 - done));
  }
  return done;
}

}  // namespace

template <int Dim>
ContactEnergy<Dim>::ContactEnergy(const CollisionSurface& surface, const ContactOptions& options, double stiffness,
                                  double scale, ContactLaw law) {
  renew(surface, options, stiffness, scale, law);
}

template <int Dim>
void ContactEnergy<Dim>::renew(const CollisionSurface& surface, const ContactOptions& options, double stiffness,
                               double scale, ContactLaw law) {
  surface_ = &surface;
  law_ = law;
  dhat_ = law == ContactLaw::barrier ? options.dhat : options.adhesion.reach;
  passing_ratio_ = options.adaptive_stiffness ? 1 : CcdOptions{}.passing_ratio;
  convergent_ = options.convergent && law == ContactLaw::barrier;
  stiffness_ = stiffness;
  scale_ = scale;
  const AdhesionOptions& adhesion = options.adhesion;
  peak_ = adhesion.peak * adhesion.peak;
  slope_ = adhesion.strength / (4 * adhesion.peak * (peak_ - adhesion.reach * adhesion.reach));
}

template <int Dim>
double ContactEnergy<Dim>::barrier(double D) const {
  const double Dhat = dhat_ * dhat_;
  if (D >= Dhat) return 0;
  if (law_ == ContactLaw::adhesion)
    return D < peak_ ? slope_ * ((Dhat - peak_) * Dhat - (Dhat / peak_ - 1) * D * D) : slope_ * (D - Dhat) * (D - Dhat);
  if (!(D > 0)) return kInfinity;
  return -(D - Dhat) * (D - Dhat) * std::log(D / Dhat);
}

template <int Dim>
double ContactEnergy<Dim>::barrier_first(double D) const {
  const double Dhat = dhat_ * dhat_;
  if (law_ == ContactLaw::adhesion) return D >= Dhat ? 0 : 2 * slope_ * (D < peak_ ? (1 - Dhat / peak_) * D : D - Dhat);
  return D >= Dhat ? 0 : (Dhat - D) * (2 * std::log(D / Dhat) - Dhat / D + 1);
}

template <int Dim>
double ContactEnergy<Dim>::barrier_second(double D) const {
  const double Dhat = dhat_ * dhat_, r = Dhat / D;
  if (law_ == ContactLaw::adhesion) return D >= Dhat ? 0 : 2 * slope_ * (D < peak_ ? 1 - Dhat / peak_ : 1);
  return D >= Dhat ? 0 : (r + 2) * r - 2 * std::log(D / Dhat) - 3;
}

/// Local Hessians, before they are added.
template <int Dim>
struct ContactEnergy<Dim>::HessianBlocks {
  std::vector<Mat<4 * Dim>> blocks;
};

/// The active pairs of the positions that were asked for last, with what else they depend on.
template <int Dim>
struct ContactEnergy<Dim>::ActiveCache {
  const CollisionSurface* surface = nullptr;
  int revision = 0;
  double dhat = 0;
  bool convergent = false;
  ScratchVector x;
  Active active;
};

template <int Dim>
const typename ContactEnergy<Dim>::Active& ContactEnergy<Dim>::active_set(ConstVectorView x, Workspace& workspace) const {
  auto& cache = workspace.get<ActiveCache>();
  if (cache.surface == surface_ && cache.revision == surface_->revision && cache.dhat == dhat_ &&
      cache.convergent == convergent_ && cache.x.size() == x.size() &&
      std::memcmp(cache.x.view().data(), x.data(), sizeof(double) * x.size()) == 0)
    return cache.active;
  find_active(x, workspace, cache.active);
  cache.x = x;
  cache.surface = surface_;
  cache.revision = surface_->revision;
  cache.dhat = dhat_;
  cache.convergent = convergent_;
  return cache.active;
}

template <int Dim>
const std::vector<ContactStencil>& ContactEnergy<Dim>::active(ConstVectorView x, Workspace& workspace) const {
  return active_set(x, workspace).stencils;
}

template <int Dim>
double ContactEnergy<Dim>::min_distance(ConstVectorView x, Workspace& workspace) const {
  return std::sqrt(active_set(x, workspace).least_squared);
}

template <int Dim>
PairDistance<Dim> ContactEnergy<Dim>::distance(const ContactStencil& s, ConstVectorView x) const {
  const auto p = gather<Dim>(s.vertices, s.size(), x);
  return s.is_mollified() ? pair_distance<Dim>(s.closest.kind, closest_of<Dim>(s, p).data())
                          : pair_distance<Dim>(s.kind, p.data());
}

template <int Dim>
double ContactEnergy<Dim>::pair_energy(const ContactStencil& s, ConstVectorView x) const {
  double b = barrier(distance(s, x).squared);
  if constexpr (Dim == 3) {
    if (s.is_mollified() && b != 0 && std::isfinite(b))
      b *= Mollifier(edge_cross_squared(gather<3>(s.vertices, 4, x).data()), s.mollifier_threshold).value;
  }
  return stiffness_ * s.weight * b;
}

template <int Dim>
double ContactEnergy<Dim>::value(ConstVectorView x, Workspace& workspace) const {
  const auto& stencils = active(x, workspace);
  return scale_ * parallel_sum(stencils.size(), kBlock, [&](std::size_t begin, std::size_t end) {
           double sum = 0;
           for (std::size_t i = begin; i < end; ++i) {
             const double energy = pair_energy(stencils[i], x);
             if (!std::isfinite(energy)) return kInfinity;  // whatever the sign of its weight
             sum += energy;
           }
           return sum;
         });
}

template <int Dim>
void ContactEnergy<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const {
  const auto& stencils = active(x, workspace);
  const auto gradient_of = [&](std::size_t i) -> Vec<4 * Dim> {
    const ContactStencil& s = stencils[i];
    const auto p = gather<Dim>(s.vertices, s.size(), x);
    const double factor = scale_ * stiffness_ * s.weight;
    if constexpr (Dim == 3) {
      if (s.is_mollified()) {
        const SpreadDistance q(s, p, false);
        const CrossSquared cross = edge_cross_squared_with_gradient(p.data());
        const Mollifier m(cross.value, s.mollifier_threshold);
        return factor * (m.first * barrier(q.D) * cross.gradient + m.value * barrier_first(q.D) * q.gradient);
      }
    }
    const auto pair = pair_distance<Dim>(s.kind, p.data());
    return factor * barrier_first(pair.squared) * squared_distance_gradient<Dim>(pair);
  };
  parallel_then_ordered<Vec<4 * Dim>>(stencils.size(), kBlock, gradient_of, [&](std::size_t i, const auto& local) {
    const ContactStencil& s = stencils[i];
    for (int k = 0; k < s.size(); ++k) gradient.segment<Dim>(Dim * s.vertices[k]) += local.template segment<Dim>(Dim * k);
  });
}

template <int Dim>
void ContactEnergy<Dim>::add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const {
  const auto& stencils = active(x, workspace);
  const auto block_of = [&](const ContactStencil& s) {
    const auto p = gather<Dim>(s.vertices, s.size(), x);
    const double factor = scale_ * stiffness_ * s.weight;
    Mat<4 * Dim> block;
    if (s.is_mollified()) {
      if constexpr (Dim == 3) {
        const SpreadDistance q(s, p, true);
        const CrossSquared cross = edge_cross_squared_with_gradient(p.data());
        const Mollifier m(cross.value, s.mollifier_threshold);
        const double b = barrier(q.D), b1 = barrier_first(q.D), b2 = barrier_second(q.D);
        const Mat<12> mixed = cross.gradient * q.gradient.transpose();
        block =
            factor *
            (b * (m.second * cross.gradient * cross.gradient.transpose() + m.first * edge_cross_squared_hessian(p.data())) +
             m.first * b1 * (mixed + mixed.transpose()) +
             m.value * (b2 * q.gradient * q.gradient.transpose() + b1 * q.hessian));
        if (psd != PsdProjection::none) project_to_psd<12, 9>(relative_motions(), psd, block);
        return block;
      }
    }
    const auto pair = pair_distance<Dim>(s.kind, p.data());
    const Vec<4 * Dim> gradient = squared_distance_gradient<Dim>(pair);
    block = factor * (barrier_second(pair.squared) * gradient * gradient.transpose() +
                      barrier_first(pair.squared) * pair_distance_hessian<Dim>(s.kind, p.data()));
    if (psd != PsdProjection::none) project_to_psd<4 * Dim, Dim + 2>(pair_distance_range<Dim>(s.kind, pair), psd, block);
    return block;
  };
  // The sink reads the rows and columns of the pair's vertices alone.
  const auto pack = [](int size, Mat<4 * Dim>& block) {
    const int n = Dim * size;
    for (int j = 1; j < n; ++j) std::copy_n(block.data() + 4 * Dim * j, n, block.data() + n * j);
  };
  auto& blocks = workspace.get<HessianBlocks>().blocks;
  if (blocks.size() < std::min(kBatch, stencils.size())) blocks.resize(std::min(kBatch, stencils.size()));
  for (std::size_t first = 0; first < stencils.size(); first += kBatch) {
    const std::size_t count = std::min(kBatch, stencils.size() - first);
    parallel_blocks(count, kBlock, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const ContactStencil& s = stencils[first + i];
        blocks[i] = block_of(s);
        pack(s.size(), blocks[i]);
      }
    });
    for (std::size_t i = 0; i < count; ++i) {
      const ContactStencil& s = stencils[first + i];
      sink.add<Dim>(std::span(s.vertices.data(), s.size()), blocks[i].data());
    }
  }
}

template <int Dim>
double ContactEnergy<Dim>::max_step(ConstVectorView x, ConstVectorView dx, Workspace& workspace) const {
  return walk<Dim>(*surface_, x, dx, dhat_, workspace, [&](ConstVectorView from, ConstVectorView motion) {
    double least = 1;
    for (const auto& [kind, list] : workspace.get<ContactCandidates<Dim>>().all()) {
      // Later pairs of a block are only asked about the part of the way that earlier ones left over; blocks do not depend on
      // the number of threads.
      const auto& pairs = *list;
      const auto step_of = [&, kind = kind](std::size_t begin, std::size_t end) {
        double step = 1;
        for (std::size_t i = begin; i < end; ++i) {
          const auto vertices = vertices_of(*surface_, kind, pairs[i]);
          const auto p = gather<Dim>(vertices, pair_size(kind), from);
          auto q = gather<Dim>(vertices, pair_size(kind), motion);
          for (int k = 0; k < pair_size(kind); ++k) q[k] = p[k] + step * q[k];
          step *= free_fraction<Dim>(kind, p, q, {.passing_ratio = passing_ratio_});
        }
        return step;
      };
      least = std::min(least, parallel_min(pairs.size(), kBatch, step_of));
    }
    return least;
  });
}

template <int Dim>
bool ContactEnergy<Dim>::get_vertex_steps(ConstVectorView x, ConstVectorView dx, VectorView steps,
                                          Workspace& workspace) const {
  auto& candidates = workspace.get<ContactCandidates<Dim>>();
  auto& part = workspace.get<PartOfStep>().motion;
  if (candidates.update(*surface_, x, dx, dhat_, part) == 1)
    steps = dx;
  else
    steps = part.view();
  auto& fraction = workspace.get<Fractions>().of_vertex;
  fraction.assign(surface_->area.size(), 1);
  for (const auto& [kind, list] : candidates.all()) {
    const auto& pairs = *list;
    const auto fractions_of = [&, kind = kind](std::size_t i) {
      const auto vertices = vertices_of(*surface_, kind, pairs[i]);
      const int size = pair_size(kind);
      return planar_fractions<Dim>(kind, gather<Dim>(vertices, size, x), gather<Dim>(vertices, size, steps), dhat_);
    };
    const auto note = [&, kind = kind](std::size_t i, const std::array<double, 4>& fractions) {
      const auto vertices = vertices_of(*surface_, kind, pairs[i]);
      for (int k = 0; k < pair_size(kind); ++k) fraction[vertices[k]] = std::min(fraction[vertices[k]], fractions[k]);
    };
    parallel_then_ordered<std::array<double, 4>>(pairs.size(), kBlock, fractions_of, note);
  }
  for (const int v : surface_->vertices) steps.segment<Dim>(Dim * v) *= fraction[v];
  return true;
}

template <int Dim>
bool ContactEnergy<Dim>::find_blocking(ConstVectorView x, ConstVectorView dx, double fraction, BlockingPairs& blocking,
                                       Workspace& workspace) const {
  auto& candidates = workspace.get<ContactCandidates<Dim>>();
  fraction = std::min(fraction, candidates.update(*surface_, x, dx, dhat_, workspace.get<PartOfStep>().motion,
                                                  blocking.takes_first ? fraction : 1));
  return find_blocking_pairs(*surface_, candidates, x, dx, fraction, dhat_, blocking);
}

template <int Dim>
void ContactEnergy<Dim>::predict_motion(ConstVectorView x, const VectorX& dx, Workspace& workspace) const {
  workspace.get<ContactCandidates<Dim>>().predict_motion(*surface_, x, dx, dhat_, workspace.get<PartOfStep>().motion);
}

template <int Dim>
StepLimit ContactEnergy<Dim>::step_limit(ConstVectorView x, ConstVectorView dx, Workspace& workspace) const {
  constexpr CcdOptions kNear{.passing_ratio = 1};  // what comes near is told too: it is what holds back
  StepLimit least;
  least.step = walk<Dim>(*surface_, x, dx, dhat_, workspace, [&](ConstVectorView from, ConstVectorView motion) {
    const VectorX end = from + motion;
    for (const auto& [kind, pairs] : workspace.get<ContactCandidates<Dim>>().all())
      for (const auto& pair : *pairs) {
        const auto vertices = vertices_of(*surface_, kind, pair);
        const int size = pair_size(kind);
        const double t =
            free_fraction<Dim>(kind, gather<Dim>(vertices, size, from), gather<Dim>(vertices, size, end), kNear);
        if (t < least.step) least = {t, name_of(kind), {vertices.begin(), vertices.begin() + size}};
      }
    return least.step;
  });
  if (least.kind.empty()) least.step = 1;  // the parts that were walked are free
  return least;
}

template class ContactEnergy<2>;
template class ContactEnergy<3>;

}  // namespace itr
