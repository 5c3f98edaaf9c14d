// SPDX-License-Identifier: MIT
#include "itr/remesh/edits.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "itr/geometry/measures.hpp"
#include "itr/geometry/predicates.hpp"

namespace itr {

namespace {

constexpr double kStraight = 1 - 1e-10;     ///< |cos| above which two boundary edges count as one straight line
constexpr double kLeastSwapShare = 0.1;     ///< of the pair's area, for each triangle after a swap
constexpr double kLeastVolumeShare = 1e-4;  ///< of the mean volume around, for each cell after an edit

template <std::size_t N>
std::array<int, N> replaced(std::array<int, N> ids, int from, int to) {
  std::replace(ids.begin(), ids.end(), from, to);
  return ids;
}

template <std::size_t N>
bool holds(const std::array<int, N>& ids, int v) {
  return std::find(ids.begin(), ids.end(), v) != ids.end();
}

/// Whether all inserted cells keep a positive rest volume that is not vanishing beside the removed ones.
bool has_valid_rest_shape(const Mesh<2>& mesh, const Edit<2>& edit) {
  double removed = 0;
  for (const CellId c : edit.removed_cells) removed += mesh.volume(c);
  const double least = kLeastVolumeShare * removed / static_cast<double>(edit.removed_cells.size());
  for (const auto& cell : edit.inserted_cells) {
    std::array<Vec<2>, 3> p;
    for (int k = 0; k < 3; ++k)
      p[k] = edit.value && cell.vertices[k] == edit.value->vertex ? edit.value->rest : mesh.rest(cell.vertices[k]);
    if (orientation(p[0], p[1], p[2]) <= 0 || simplex_volume<2>(p) < least) return false;
  }
  return true;
}

/// Neighbours that both vertices have in common.
std::vector<VertexId> common_neighbours(const Mesh<2>& mesh, VertexId a, VertexId b) {
  const auto ring = [&](VertexId v) {
    std::vector<VertexId> ids;
    for (const CellId c : mesh.cells_of(v))
      for (const int w : mesh.cell(c))
        if (w != v) ids.push_back(w);
    std::sort(ids.begin(), ids.end());
    ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
    return ids;
  };
  const auto ra = ring(a), rb = ring(b);
  std::vector<VertexId> common;
  std::set_intersection(ra.begin(), ra.end(), rb.begin(), rb.end(), std::back_inserter(common));
  return common;
}

/// Whether boundary vertex v can slide along the boundary edge v-w: its other boundary edge goes straight on with one tag.
bool can_slide(const Mesh<2>& mesh, VertexId v, VertexId w, FacetId edge) {
  const auto facets = mesh.facets_of(v);
  if (facets.size() != 2 || is_on_interface(mesh, v)) return false;
  const FacetId other = facets[0] == edge ? facets[1] : facets[0];
  if (mesh.facet_tag(other) != mesh.facet_tag(edge)) return false;
  const auto& f = mesh.facet(other);
  const VertexId far = f[0] == v ? f[1] : f[0];
  const Vec<2> a = (mesh.rest(w) - mesh.rest(v)).normalized(), b = (mesh.rest(far) - mesh.rest(v)).normalized();
  return -a.dot(b) > kStraight;
}

enum class End { first, second, middle };

/// Where the vertex that is left may stand, or nothing.
std::optional<End> collapse_target(const Mesh<2>& mesh, const EdgeKey& edge, FacetId facet) {
  const auto [a, b] = edge;
  if (facet != kNone) {
    const bool slides_a = can_slide(mesh, a, b, facet), slides_b = can_slide(mesh, b, a, facet);
    if (slides_a && slides_b) return End::middle;
    if (slides_b) return End::first;
    if (slides_a) return End::second;
    return std::nullopt;
  }
  const bool fixed_a = mesh.is_boundary(a) || is_on_interface(mesh, a);
  const bool fixed_b = mesh.is_boundary(b) || is_on_interface(mesh, b);
  if (fixed_a && fixed_b) return std::nullopt;
  return fixed_a ? End::first : fixed_b ? End::second : End::middle;
}

}  // namespace

template <int Dim>
bool is_on_interface(const Mesh<Dim>& mesh, VertexId vertex) {
  const auto cells = mesh.cells_of(vertex);
  return std::any_of(cells.begin(), cells.end(), [&](CellId c) { return mesh.body(c) != mesh.body(cells[0]); });
}

template <int Dim>
Edit<Dim> make_split(const Mesh<Dim>& mesh, const EdgeKey& edge) {
  const auto [a, b] = edge;
  Edit<Dim> edit{.kind = Edit<Dim>::Kind::split, .edge = edge};
  edit.removed_cells = mesh.cells_of_edge(edge);
  for (const CellId c : edit.removed_cells)
    for (const int end : {a, b}) edit.inserted_cells.push_back({replaced(mesh.cell(c), end, kNewVertex), mesh.body(c)});
  for (const FacetId f : mesh.facets_of(a)) {
    if (!holds(mesh.facet(f), b)) continue;
    edit.removed_facets.push_back(f);
    for (const int end : {a, b})
      edit.inserted_facets.push_back({replaced(mesh.facet(f), end, kNewVertex), mesh.facet_tag(f)});
  }
  typename Edit<Dim>::Value value{kNewVertex, 0.5 * (mesh.rest(a) + mesh.rest(b))};
  value.num_parents = 2;
  value.parents[0] = a;
  value.parents[1] = b;
  value.weights[0] = value.weights[1] = 0.5;
  edit.value = value;
  return edit;
}

std::optional<Edit<2>> make_collapse(const Mesh<2>& mesh, const EdgeKey& edge) {
  const auto [a, b] = edge;
  Edit<2> edit{.kind = Edit<2>::Kind::collapse, .edge = edge};
  const auto around_edge = mesh.cells_of_edge(edge);
  if (around_edge.empty() || common_neighbours(mesh, a, b).size() != around_edge.size()) return std::nullopt;
  const FacetId facet = mesh.find_facet({a, b});
  const auto target = collapse_target(mesh, edge, facet);
  if (!target) return std::nullopt;

  const VertexId kept = *target == End::second ? b : a, gone = kept == a ? b : a;
  Edit<2>::Value value{kept, *target == End::middle ? Vec<2>(0.5 * (mesh.rest(a) + mesh.rest(b))) : mesh.rest(kept)};
  value.parents = {kept, gone, kNone};
  value.weights = *target == End::middle ? std::array{0.5, 0.5, 0.0} : std::array{1.0, 0.0, 0.0};
  value.num_parents = *target == End::middle ? 2 : 1;
  edit.value = value;
  edit.removed_vertex = gone;

  std::vector<CellId> around(mesh.cells_of(gone).begin(), mesh.cells_of(gone).end());
  if (*target == End::middle)
    around.insert(around.end(), mesh.cells_of(kept).begin(), mesh.cells_of(kept).end());
  else
    around.insert(around.end(), around_edge.begin(), around_edge.end());
  std::sort(around.begin(), around.end());
  around.erase(std::unique(around.begin(), around.end()), around.end());
  for (const CellId c : around) {
    edit.removed_cells.push_back(c);
    const auto& cell = mesh.cell(c);
    if (!(holds(cell, a) && holds(cell, b))) edit.inserted_cells.push_back({replaced(cell, gone, kept), mesh.body(c)});
  }
  for (const FacetId f : mesh.facets_of(gone)) {
    edit.removed_facets.push_back(f);
    if (f != facet) edit.inserted_facets.push_back({replaced(mesh.facet(f), gone, kept), mesh.facet_tag(f)});
  }
  if (facet != kNone && *target == End::middle)  // the kept vertex moves, so its other edge changes its length
    for (const FacetId f : mesh.facets_of(kept)) {
      if (f == facet) continue;
      edit.removed_facets.push_back(f);
      edit.inserted_facets.push_back({mesh.facet(f), mesh.facet_tag(f)});
    }
  if (edit.inserted_cells.empty() || !has_valid_rest_shape(mesh, edit)) return std::nullopt;
  return edit;
}

std::optional<Edit<2>> make_swap(const Mesh<2>& mesh, const EdgeKey& edge) {
  const auto cells = mesh.cells_of_edge(edge);
  if (cells.size() != 2 || mesh.body(cells[0]) != mesh.body(cells[1])) return std::nullopt;
  std::array<VertexId, 2> opposite;
  for (int i = 0; i < 2; ++i)
    for (const int v : mesh.cell(cells[i]))
      if (v != edge[0] && v != edge[1]) opposite[i] = v;
  for (const CellId c : mesh.cells_of(opposite[0]))
    if (holds(mesh.cell(c), opposite[1])) return std::nullopt;  // that diagonal is there already
  Edit<2> edit{.kind = Edit<2>::Kind::swap, .edge = edge};
  edit.removed_cells = cells;
  const double area = mesh.volume(cells[0]) + mesh.volume(cells[1]);
  // In each triangle one end of the edge gives way to the other triangle's far vertex; that keeps the orientation.
  edit.inserted_cells.push_back({replaced(mesh.cell(cells[0]), edge[0], opposite[1]), mesh.body(cells[0])});
  edit.inserted_cells.push_back({replaced(mesh.cell(cells[0]), edge[1], opposite[1]), mesh.body(cells[0])});
  for (const auto& cell : edit.inserted_cells) {
    const std::array<Vec<2>, 3> p{mesh.rest(cell.vertices[0]), mesh.rest(cell.vertices[1]), mesh.rest(cell.vertices[2])};
    if (orientation(p[0], p[1], p[2]) <= 0 || simplex_volume<2>(p) < kLeastSwapShare * area) return std::nullopt;
  }
  return edit;
}

std::optional<Edit<2>> make_move(const Mesh<2>& mesh, VertexId vertex, const Vec<2>& target) {
  if (mesh.is_boundary(vertex) || is_on_interface(mesh, vertex)) return std::nullopt;
  Edit<2> edit{.kind = Edit<2>::Kind::smooth, .edge = {vertex, kNone}};
  Edit<2>::Value value{vertex, target};
  for (const CellId c : mesh.cells_of(vertex)) {
    edit.removed_cells.push_back(c);
    edit.inserted_cells.push_back({mesh.cell(c), mesh.body(c)});
    const auto& cell = mesh.cell(c);
    const Vec<2> weights = mesh.inverse_rest_edges(c) * (target - mesh.rest(cell[0]));
    const std::array<double, 3> barycentric{1 - weights.sum(), weights[0], weights[1]};
    if (value.num_parents == 0 && std::all_of(barycentric.begin(), barycentric.end(), [](double w) { return w >= 0; })) {
      value.parents = cell;
      value.weights = barycentric;
      value.num_parents = 3;
    }
  }
  edit.value = value;
  if (value.num_parents == 0 || !has_valid_rest_shape(mesh, edit)) return std::nullopt;
  return edit;
}

Vec<2> best_shaped_position(const Mesh<2>& mesh, VertexId vertex, int max_iterations) {
  const double half_root3 = std::sqrt(3.0) / 2;
  Mat<2> reference;
  reference << 1, 0.5, 0, half_root3;
  const Mat<2> inverse_reference = reference.inverse();
  // With the moving vertex first, the edge matrix is E - X (1 1): J = E R^-1 is affine in X, tr(J^T J) quadratic, det J
  // affine.
  const auto measure = [&](const Vec<2>& X, Vec<2>* gradient, Mat<2>* hessian) {
    double sum = 0;
    for (const CellId c : mesh.cells_of(vertex)) {
      auto cell = mesh.cell(c);
      std::rotate(cell.begin(), std::find(cell.begin(), cell.end(), vertex), cell.end());
      Mat<2> edges;
      edges << mesh.rest(cell[1]) - X, mesh.rest(cell[2]) - X;
      const Mat<2> J = edges * inverse_reference;
      const double det = J.determinant();
      if (det <= 0) return std::numeric_limits<double>::infinity();
      const Vec<2> row = -(inverse_reference.transpose() * Vec<2>::Ones());  // dJ = dX * row^T
      const double numerator = J.squaredNorm();
      sum += numerator / det;
      if (!gradient) continue;
      Mat<2> cofactor;
      cofactor << J(1, 1), -J(1, 0), -J(0, 1), J(0, 0);
      const Vec<2> dn = 2 * J * row, dd = cofactor * row;
      *gradient += dn / det - numerator * dd / (det * det);
      *hessian += 2 * row.squaredNorm() / det * Mat<2>::Identity() -
                  (dn * dd.transpose() + dd * dn.transpose()) / (det * det) +
                  2 * numerator * dd * dd.transpose() / (det * det * det);
    }
    return sum;
  };
  Vec<2> X = mesh.rest(vertex);
  for (int i = 0; i < max_iterations; ++i) {
    Vec<2> gradient = Vec<2>::Zero();
    Mat<2> hessian = Mat<2>::Zero();
    const double before = measure(X, &gradient, &hessian);
    Vec<2> step = -hessian.ldlt().solve(gradient);
    if (!(step.dot(gradient) < 0)) step = -gradient * (hessian.trace() > 0 ? 1 / hessian.trace() : 0);
    double scale = 1;
    while (scale > 1e-6 && !(measure(X + scale * step, nullptr, nullptr) < before)) scale /= 2;
    if (scale <= 1e-6) break;
    X += scale * step;
  }
  return X;
}

template Edit<2> make_split<2>(const Mesh<2>&, const EdgeKey&);
template Edit<3> make_split<3>(const Mesh<3>&, const EdgeKey&);
template bool is_on_interface<2>(const Mesh<2>&, VertexId);
template bool is_on_interface<3>(const Mesh<3>&, VertexId);

}  // namespace itr
