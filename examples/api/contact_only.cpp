// SPDX-License-Identifier: MIT
// Contact alone, for a program with its own model and solver: a rope of springs falls onto a roof. The library gives barrier
// energy, gradient, Hessian (blocks, here into a sparse matrix) and the part of a step that is free of collisions.
#include <Eigen/SparseCholesky>
#include <cstdio>
#include <itr/contact.hpp>

namespace {

constexpr int kRope = 40, kVertices = kRope + 3;
constexpr double kMass = 0.01, kSpring = 500, kStep = 0.01, kLink = 0.05;

using itr::VectorX;
using Triplets = std::vector<Eigen::Triplet<double>>;

/// The host's own potential: inertia and springs (with a positive semi-definite Hessian).
double own_energy(const VectorX& x, const VectorX& predictor, VectorX* g, Triplets* H) {
  double energy = 0;
  for (int i = 0; i < 2 * kRope; ++i) {
    const double d = x[i] - predictor[i];
    energy += 0.5 * kMass * d * d;
    if (g) (*g)[i] += kMass * d;
    if (H) H->emplace_back(i, i, kMass);
  }
  for (int v = 0; v + 1 < kRope; ++v) {
    const itr::Vec<2> r = x.segment<2>(2 * v + 2) - x.segment<2>(2 * v);
    const double length = r.norm(), k = kStep * kStep * kSpring, tension = k * (length - kLink);
    const itr::Vec<2> n = r / length;
    energy += 0.5 * k * (length - kLink) * (length - kLink);
    if (g) g->segment<2>(2 * v) -= tension * n, g->segment<2>(2 * v + 2) += tension * n;
    const itr::Mat<2> B =
        k * n * n.transpose() + std::max(0.0, tension / length) * (itr::Mat<2>::Identity() - n * n.transpose());
    for (int i = 0; H && i < 4; ++i)
      for (int j = 0; j < 4; ++j) H->emplace_back(2 * v + i, 2 * v + j, (i / 2 == j / 2 ? 1 : -1) * B(i % 2, j % 2));
  }
  return energy;
}

}  // namespace

int main() {
  std::vector<itr::Vec<2>> rest;
  std::vector<std::array<int, 2>> edges;
  for (int v = 0; v < kRope; ++v) rest.emplace_back(kLink * v - 0.9, 0.5);
  rest.insert(rest.end(), {{-1.5, -1}, {0, 0}, {1.5, -1}});  // the roof
  for (int v = 0; v + 1 < kVertices; ++v)
    if (v + 1 != kRope) edges.push_back({v, v + 1});
  std::vector<char> counts(kVertices, 0);  // pairs of two roof vertices do not count
  std::fill_n(counts.begin(), kRope, 1);
  const auto surface = itr::collision_surface<2>(edges, {}, {}, rest, counts);
  const itr::ContactOptions options{.enabled = true, .dhat = 0.01};
  const itr::ContactEnergy<2> contact(*surface, options, 1e6, kStep * kStep);
  itr::Workspace workspace;

  VectorX x(2 * kVertices), v = VectorX::Zero(2 * kVertices);
  for (int i = 0; i < kVertices; ++i) x.segment<2>(2 * i) = rest[i];
  for (int step = 0; step < 100; ++step) {
    VectorX predictor = x + kStep * v, start = x;
    for (int i = 0; i < kRope; ++i) predictor[2 * i + 1] -= 9.81 * kStep * kStep;
    const auto energy = [&](const VectorX& y) {
      return own_energy(y, predictor, nullptr, nullptr) + contact.value(y, workspace);
    };
    for (int iteration = 0; iteration < 100; ++iteration) {
      VectorX g = VectorX::Zero(x.size());
      Triplets H;
      own_energy(x, predictor, &g, &H);
      contact.add_gradient(x, g, workspace);
      itr::HessianSink sink([&](std::span<const int> vertices, const double* block) {
        const int n = 2 * static_cast<int>(vertices.size());
        for (int i = 0; i < n; ++i)
          for (int j = 0; j < n; ++j) {
            const int a = 2 * vertices[i / 2] + i % 2, b = 2 * vertices[j / 2] + j % 2;
            if (a < 2 * kRope && b < 2 * kRope) H.emplace_back(a, b, block[i + n * j]);  // the roof stands still
          }
      });
      contact.add_hessian(x, itr::PsdProjection::clamp, sink, workspace);
      Eigen::SparseMatrix<double> A(2 * kRope, 2 * kRope);
      A.setFromTriplets(H.begin(), H.end());
      VectorX dx = VectorX::Zero(x.size());
      dx.head(2 * kRope) = -Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(A).solve(g.head(2 * kRope));
      if (dx.lpNorm<Eigen::Infinity>() < 1e-7) break;
      double a = contact.max_step(x, dx, workspace);  // no collision on the way
      for (const double before = energy(x); a > 1e-12 && !(energy(x + a * dx) <= before); a /= 2) continue;
      x += a * dx;
    }
    v = (x - start) / kStep;
  }
  const double distance = contact.min_distance(x, workspace);
  std::printf("after 1 s the middle is at y = %.4f m, contacts are %.2g m apart\n", x[kRope + 1], distance);
  return distance > 0 && distance < 0.01 ? 0 : 1;
}
