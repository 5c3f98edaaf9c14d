// SPDX-License-Identifier: MIT
#include "itr/transfer.hpp"

#include <limits>
#include <optional>

#include "fem/locator.hpp"
#include "geometry/bvh.hpp"
#include "geometry/distance.hpp"
#include "geometry/measures.hpp"

namespace itr {

namespace {

std::vector<int> compose(const std::vector<int>& first, const std::vector<int>& second) {
  std::vector<int> both;
  both.reserve(first.size());
  for (const int id : first) both.push_back(id == kNone ? kNone : second[id]);
  return both;
}

double squared_distance(const Vec<2>& p, const Mesh<2>& mesh, FacetId f) {
  return point_edge_distance_squared<2>(p, mesh.rest(mesh.facet(f)[0]), mesh.rest(mesh.facet(f)[1]));
}
double squared_distance(const Vec<3>& p, const Mesh<3>& mesh, FacetId f) {
  const auto& [a, b, c] = mesh.facet(f);
  return point_triangle_distance_squared(p, mesh.rest(a), mesh.rest(b), mesh.rest(c));
}

template <int Dim>
std::array<Vec<Dim>, Dim> rest_of(const Mesh<Dim>& mesh, const typename MeshTypes<Dim>::Facet& facet) {
  std::array<Vec<Dim>, Dim> corners;
  for (int k = 0; k < Dim; ++k) corners[k] = mesh.rest(facet[k]);
  return corners;
}

/// The facets of `before` that are gone, to look up where new ones lie.
template <int Dim>
class LostFacets {
 public:
  LostFacets(const Mesh<Dim>& before, const std::vector<FacetId>& number) : before_(before) {
    std::vector<Box<Dim>> boxes;
    for (FacetId f = 0; f < before.facet_slots(); ++f) {
      if (number[f] != kNone) continue;
      Box<Dim> box;
      for (const int v : before.facet(f)) box.include(before.rest(v));
      lost_.push_back(f);
      boxes.push_back(box.inflated(1e-6 * (box.max - box.min).norm()));
    }
    tree_.build(boxes);
  }

  /// The nearest one with this tag (empty: with any) that looks to the same side of the same connected part.
  FacetId find(const RestPoint<Dim>& X, std::optional<int> tag) const {
    std::vector<int> hits;
    tree_.query({X, X}, hits);
    FacetId nearest = kNone;
    double least = std::numeric_limits<double>::infinity();
    for (const int i : hits) {
      const auto& facet = before_.facet(lost_[i]);
      if (tag && before_.facet_tag(lost_[i]) != *tag) continue;
      if (before_.part_of_vertex(facet[0]) != X.part) continue;
      if (inward_normal(rest_of(before_, facet)).dot(X.inward) <= 0) continue;
      const double distance = squared_distance(X, before_, lost_[i]);
      if (distance >= least) continue;
      least = distance;
      nearest = lost_[i];
    }
    return nearest;
  }

 private:
  const Mesh<Dim>& before_;
  std::vector<FacetId> lost_;
  Bvh<Dim> tree_;
};

template <int Dim>
struct TransferArrays {
  std::vector<Vec<Dim>> rest;
  std::vector<std::array<int, Dim + 1>> cells;
  std::vector<double> density;
  bool axisymmetric;

  TransferArrays(const Mesh<Dim>& mesh, const std::map<int, double>& by_body) : axisymmetric(mesh.is_axisymmetric()) {
    for (VertexId v = 0; v < mesh.num_vertices(); ++v) rest.push_back(mesh.rest(v));
    for (CellId c = 0; c < mesh.cell_slots(); ++c) {
      const auto found = by_body.find(mesh.body(c));
      cells.push_back(mesh.cell(c));
      density.push_back(found == by_body.end() ? 1 : found->second);
    }
  }
  TransferMesh<Dim> view() const { return {rest, cells, density, {}, {}, axisymmetric}; }
};

}  // namespace

MeshRenumbering compose(const MeshRenumbering& first, const MeshRenumbering& second) {
  return {compose(first.vertex, second.vertex), compose(first.cell, second.cell), compose(first.facet, second.facet)};
}

template <int Dim>
MeshChange<Dim> describe_change(const Mesh<Dim>& before, const Mesh<Dim>& mesh, const MeshRenumbering& renumbering) {
  MeshChange<Dim> change;
  const auto head = [](const std::vector<int>& ids, int n) { return std::vector<int>(ids.begin(), ids.begin() + n); };
  change.vertex = head(renumbering.vertex, before.num_vertices());
  change.cell = head(renumbering.cell, before.cell_slots());
  change.facet = head(renumbering.facet, before.facet_slots());

  std::vector<char> is_old_cell(mesh.cell_slots(), 0);
  for (CellId c = 0; c < before.cell_slots(); ++c)
    if (change.cell[c] == kNone)
      change.touched.old_cells.push_back(c);
    else
      is_old_cell[change.cell[c]] = 1;
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    if (!is_old_cell[c]) change.touched.new_cells.push_back(c);

  change.facet_parent.assign(mesh.facet_slots(), kNone);
  for (FacetId f = 0; f < before.facet_slots(); ++f)
    if (change.facet[f] != kNone) change.facet_parent[change.facet[f]] = f;
  const LostFacets<Dim> lost(before, change.facet);
  for (FacetId f = 0; f < mesh.facet_slots(); ++f) {
    if (change.facet_parent[f] != kNone) continue;
    Vec<Dim> middle = Vec<Dim>::Zero();
    for (const int v : mesh.facet(f)) middle += mesh.rest(v) / Dim;
    const RestPoint<Dim> point(middle, inward_normal(rest_of(mesh, mesh.facet(f))), mesh.part_of_vertex(mesh.facet(f)[0]));
    change.facet_parent[f] = lost.find(point, mesh.facet_tag(f));
    if (change.facet_parent[f] == kNone)
      change.facet_parent[f] = lost.find(point, std::nullopt);  // a fluid has come or gone
  }

  std::vector<VertexId> stayed(mesh.num_vertices(), kNone);
  for (VertexId v = 0; v < before.num_vertices(); ++v)
    if (change.vertex[v] != kNone && mesh.rest(change.vertex[v]) == before.rest(v)) stayed[change.vertex[v]] = v;
  const Locator<Dim> locator(before, change.touched.old_cells);
  std::vector<Eigen::Triplet<double>> entries;
  for (VertexId v = 0; v < mesh.num_vertices(); ++v) {
    if (stayed[v] != kNone) {
      entries.emplace_back(v, stayed[v], 1);
      continue;
    }
    const auto place = locator.find(mesh.point(v), mesh.body(mesh.cells_of(v)[0]));
    for (int k = 0; k <= Dim; ++k)
      if (place.weights[k] > 0) entries.emplace_back(v, place.nodes[k], place.weights[k]);
  }
  change.interpolation.resize(mesh.num_vertices(), before.num_vertices());
  change.interpolation.setFromTriplets(entries.begin(), entries.end());
  return change;
}

template <int Dim>
MatrixX project_fields(const Mesh<Dim>& before, const Mesh<Dim>& mesh, const MeshChange<Dim>& change, const MatrixX& fields,
                       const std::map<int, double>& density) {
  const TransferArrays<Dim> from(before, density), to(mesh, density);
  TransferReport report;
  return project_l2<Dim>(from.view(), to.view(), change.touched, fields, change.interpolation * fields, {}, report);
}

#define ITR_INSTANTIATE(Dim)                                                                                       \
  template MeshChange<Dim> describe_change<Dim>(const Mesh<Dim>&, const Mesh<Dim>&, const MeshRenumbering&);       \
  template MatrixX project_fields<Dim>(const Mesh<Dim>&, const Mesh<Dim>&, const MeshChange<Dim>&, const MatrixX&, \
                                       const std::map<int, double>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
