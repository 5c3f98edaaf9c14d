// SPDX-License-Identifier: MIT
#include "fem/locator.hpp"

#include <algorithm>
#include <numeric>

#include "geometry/bvh.hpp"
#include "itr/fem/quadratic.hpp"

namespace itr {

namespace {
constexpr double kAtVertex = 1e-13;  ///< of weights: nearer to a vertex is there
constexpr double kReach = 1e-12;     ///< of the extent: how far from a box a point may be by round-off
}  // namespace

template <int Dim>
struct Locator<Dim>::Impl {
  struct Cell {
    CellId id;
    int body;
    std::array<VertexId, Dim + 1> vertices;
    Vec<Dim> origin;
    Mat<Dim> inverse_edges;
  };
  std::vector<Cell> cells;
  Bvh<Dim> tree;
  int num_vertices;
  double extent = 0;  ///< [m]

  Impl(const Mesh<Dim>& mesh, std::span<const CellId> ids) : num_vertices(mesh.vertex_slots()) {
    std::vector<Box<Dim>> boxes;
    Box<Dim> all;
    for (const CellId c : ids) {
      Box<Dim> box;
      for (const int v : mesh.cell(c)) box.include(mesh.rest(v));
      all.include(box);
      boxes.push_back(box);
      cells.push_back({c, mesh.body(c), mesh.cell(c), mesh.rest(mesh.cell(c)[0]), mesh.inverse_rest_edges(c)});
    }
    if (!ids.empty()) extent = (all.max - all.min).norm();
    tree.build(boxes);
  }
};

namespace {

/// Within the cell; at a vertex exactly there.
template <std::size_t N>
void tidy(std::array<double, N>& weights) {
  double sum = 0;
  for (double& w : weights) sum += w = w < kAtVertex ? 0 : w;
  for (double& w : weights) w = w > (1 - kAtVertex) * sum ? 1 : w / sum;
  if (std::find(weights.begin(), weights.end(), 1.0) != weights.end())
    for (double& w : weights) w = w == 1 ? 1 : 0;
}

template <int Dim>
std::vector<CellId> alive_cells(const Mesh<Dim>& mesh) {
  std::vector<CellId> cells;
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    if (mesh.is_cell_alive(c)) cells.push_back(c);
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
typename Locator<Dim>::Place Locator<Dim>::find(const Vec<Dim>& X, int body) const {
  Place best;
  double depth = -std::numeric_limits<double>::infinity();
  std::vector<int> hits;
  double reach = kReach * impl_->extent;
  const auto look = [&](int i) {
    const auto& cell = impl_->cells[i];
    if (body != kNone && cell.body != body) return;
    const auto weights = barycentric_weights<Dim>(cell.origin, cell.inverse_edges, X);
    const double least = *std::min_element(weights.begin(), weights.end());
    if (least <= depth && best.cell != kNone) return;
    depth = least;
    best = {cell.id, cell.vertices, weights};
  };
  for (; best.cell == kNone && reach < 4 * impl_->extent; reach *= 1000) {
    hits.clear();
    impl_->tree.query(Box<Dim>{X, X}.inflated(reach), hits);
    for (const int i : hits) look(i);
  }
  for (std::size_t i = 0; best.cell == kNone && i < impl_->cells.size(); ++i) look(static_cast<int>(i));
  if (best.cell != kNone) tidy(best.weights);
  return best;
}

template <int Dim>
int Locator<Dim>::num_vertices() const {
  return impl_->num_vertices;
}

template <int Dim>
std::function<VectorX(const Vec<Dim>& X)> nodal_function(std::shared_ptr<const Locator<Dim>> locator, VectorX values,
                                                         Space space) {
  const int vertices = locator->num_vertices();
  const int components = static_cast<int>(values.size()) / std::max(1, vertices + space.num_curved());
  return [locator = std::move(locator), values = std::move(values), space = std::move(space), vertices,
          components](const Vec<Dim>& X) {
    const auto place = locator->find(X);
    const auto at = [&](int node) { return values.segment(components * node, components); };
    VectorX sum = VectorX::Zero(components);
    for (int k = 0; k <= Dim; ++k)
      if (place.weights[k] > 0) sum += place.weights[k] * at(place.vertices[k]);
    if (space.is_linear()) return sum;
    for_each_edge<Dim>([&](int, int i, int j) {
      const double product = place.weights[i] * place.weights[j];
      const int a = place.vertices[i], b = place.vertices[j], curved = product > 0 ? space.find(a, b) : kNone;
      if (curved != kNone) sum += product * (4 * at(vertices + curved) - 2 * at(a) - 2 * at(b));
    });
    return sum;
  };
}

template class Locator<2>;
template class Locator<3>;
template std::function<VectorX(const Vec<2>&)> nodal_function<2>(std::shared_ptr<const Locator<2>>, VectorX, Space);
template std::function<VectorX(const Vec<3>&)> nodal_function<3>(std::shared_ptr<const Locator<3>>, VectorX, Space);

}  // namespace itr
