// SPDX-License-Identifier: MIT
#include "fem/locator.hpp"

#include <algorithm>

#include "fem/cell_set.hpp"
#include "fem/quadratic.hpp"
#include "geometry/bvh.hpp"

namespace itr {

namespace {
constexpr double kAtVertex = 1e-13;                                       ///< of weights: nearer to a vertex is there
constexpr double kAtFacet = 1e-9;                                         ///< of weights: nearer to a facet is on it
constexpr double kRoundOff = 8 * std::numeric_limits<double>::epsilon();  ///< of positions
constexpr double kReach = 1e-12;  ///< of the extent: how far from a box a point may be by round-off
}  // namespace

template <int Dim>
struct Locator<Dim>::Impl {
  struct Cell {
    CellId id;
    int body, part;
    std::array<VertexId, kQuadraticNodes<Dim>> nodes;
    CurvedEdges curved;
    Vec<Dim> origin;
    Mat<Dim> inverse_edges;
  };
  std::vector<Cell> cells;
  Bvh<Dim> tree;
  int num_nodes;
  double extent = 0;  ///< [m]

  Impl(const Mesh<Dim>& mesh, std::span<const CellId> ids) : num_nodes(mesh.node_slots()) {
    std::vector<Box<Dim>> boxes;
    Box<Dim> all;
    for (const CellId c : ids) {
      Box<Dim> box;
      for (const int v : mesh.cell(c)) box.include(mesh.rest(v));
      all.include(box);
      boxes.push_back(box);
      const auto element = element_of(mesh, c);
      cells.push_back({c, element.body, element.part, element.nodes(), element.curved, mesh.rest(element.vertices[0]),
                       element.inverse_edges});
    }
    if (!ids.empty()) extent = (all.max - all.min).norm();
    tree.build(boxes);
  }
};

template <int Dim>
Fit<Dim> fit_of(const RestPoint<Dim>& X, const std::array<double, Dim + 1>& weights, const Mat<Dim>& inverse_edges) {
  Fit<Dim> fit;
  fit.depth = *std::min_element(weights.begin(), weights.end());
  const double length = X.inward.norm();
  if (!(length > 0)) return fit;
  fit.has = true;
  double least = 2;
  for (int k = 0; k <= Dim; ++k) {
    const Vec<Dim> gradient = barycentric_gradient<Dim>(inverse_edges, k);
    const double steepness = gradient.norm();
    const double tolerance = kAtFacet + kRoundOff * steepness * X.template lpNorm<Eigen::Infinity>();
    fit.has = fit.has && weights[k] >= -tolerance;
    if (weights[k] <= tolerance) least = std::min(least, gradient.dot(X.inward) / (steepness * length));
  }
  fit.facing = least < 2 ? least : 0;
  return fit;
}

template <std::size_t N>
void tidy(std::array<double, N>& weights) {
  double sum = 0;
  for (double& w : weights) sum += w = w < kAtVertex ? 0 : w;
  for (double& w : weights) w = w > (1 - kAtVertex) * sum ? 1 : w / sum;
  if (std::find(weights.begin(), weights.end(), 1.0) != weights.end())
    for (double& w : weights) w = w == 1 ? 1 : 0;
}
template void tidy(std::array<double, 3>&);
template void tidy(std::array<double, 4>&);

namespace {

template <int Dim>
std::vector<CellId> alive_cells(const Mesh<Dim>& mesh) {
  std::vector<CellId> cells;
  for (const CellId c : mesh.live_cells()) cells.push_back(c);
  return cells;
}

}  // namespace

template <int Dim>
Locator<Dim>::Locator(const Mesh<Dim>& mesh, std::span<const CellId> cells) : impl_(std::make_unique<Impl>(mesh, cells)) {}
template <int Dim>
Locator<Dim>::Locator(const Mesh<Dim>& mesh) : Locator(mesh, alive_cells(mesh)) {}
template <int Dim>
Locator<Dim>::~Locator() = default;
template <int Dim>
Locator<Dim>::Locator(Locator&&) noexcept = default;

template <int Dim>
typename Locator<Dim>::Place Locator<Dim>::find(const RestPoint<Dim>& X, int body) const {
  Place best;
  Fit<Dim> best_fit;
  std::vector<int> hits;
  double reach = kReach * impl_->extent;
  const auto look = [&](int i) {
    const auto& cell = impl_->cells[i];
    if ((body != kNone && cell.body != body) || (X.part != kNone && cell.part != X.part)) return;
    const auto weights = barycentric_weights<Dim>(cell.origin, cell.inverse_edges, X);
    const Fit<Dim> fit = fit_of<Dim>(X, weights, cell.inverse_edges);
    if (best.cell != kNone && !fit.is_better_than(best_fit)) return;
    best_fit = fit;
    best = {cell.id, cell.nodes, cell.curved, weights};
  };
  for (; best.cell == kNone && reach < 4 * impl_->extent; reach *= 1000) {
    hits.clear();
    impl_->tree.query(Box<Dim>{X, X}.inflated(reach), hits);
    for (const int i : hits) look(i);
  }
  for (std::size_t i = 0; best.cell == kNone && i < impl_->cells.size(); ++i) look(static_cast<int>(i));
  if (best_fit.has && best_fit.depth < 0) {  // a cell that shares the facet, edge or vertex has the point inside
    const Place at_side = best;
    const auto shares_all = [&](const auto& nodes) {
      const auto end = nodes.begin() + Dim + 1;
      for (int k = 0; k <= Dim; ++k)
        if (at_side.weights[k] > kAtFacet && std::find(nodes.begin(), end, at_side.nodes[k]) == end) return false;
      return true;
    };
    for (const int i : hits) {
      const auto& cell = impl_->cells[i];
      if ((body != kNone && cell.body != body) || !shares_all(cell.nodes)) continue;
      const auto weights = barycentric_weights<Dim>(cell.origin, cell.inverse_edges, X);
      const double depth = *std::min_element(weights.begin(), weights.end());
      if (depth <= best_fit.depth) continue;
      best_fit.depth = depth;
      best = {cell.id, cell.nodes, cell.curved, weights};
    }
  }
  if (best.cell == kNone && X.part != kNone) return find(RestPoint<Dim>(X, X.inward, kNone), body);
  if (best.cell != kNone) tidy(best.weights);
  return best;
}

template <int Dim>
int Locator<Dim>::num_nodes() const {
  return impl_->num_nodes;
}

template <int Dim>
std::function<VectorX(const RestPoint<Dim>& X)> nodal_function(std::shared_ptr<const Locator<Dim>> locator, VectorX values,
                                                               int components) {
  const bool is_by_node = values.size() == Eigen::Index{components} * locator->num_nodes();
  return [locator = std::move(locator), values = std::move(values), components, is_by_node](const RestPoint<Dim>& X) {
    auto place = locator->find(X);
    if (!is_by_node) place.curved = 0;
    VectorX sum = VectorX::Zero(components);
    for_each_weight<Dim>(place,
                         [&](int node, double weight) { sum += weight * values.segment(components * node, components); });
    return sum;
  };
}

template class Locator<2>;
template class Locator<3>;
template Fit<2> fit_of(const RestPoint<2>&, const std::array<double, 3>&, const Mat<2>&);
template Fit<3> fit_of(const RestPoint<3>&, const std::array<double, 4>&, const Mat<3>&);
template std::function<VectorX(const RestPoint<2>&)> nodal_function<2>(std::shared_ptr<const Locator<2>>, VectorX, int);
template std::function<VectorX(const RestPoint<3>&)> nodal_function<3>(std::shared_ptr<const Locator<3>>, VectorX, int);

}  // namespace itr
