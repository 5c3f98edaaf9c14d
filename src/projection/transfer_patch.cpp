// SPDX-License-Identifier: MIT
#include "projection/transfer_patch.hpp"

#include <algorithm>
#include <numeric>
#include <span>
#include <unordered_map>
#include <unordered_set>
#include <utility>

namespace itr {

namespace {

/// Adds cells of a mesh to a numbering of their own.
template <int Dim>
class Numbering {
 public:
  Numbering(const Mesh<Dim>& mesh, const std::map<int, Material>& materials, TransferCells<Dim>& out)
      : mesh_(mesh), materials_(materials), out_(out) {}

  void add(CellId c) {
    const auto element = element_of(mesh_, c);
    out_.add(element.vertices, element.nodes(), element.curved, materials_.at(element.body).density,
             [&](int id) { return local(id); });
  }

 private:
  int local(int id) {
    const auto [it, is_new] = known_.try_emplace(id, static_cast<int>(out_.vertices.size()));
    if (is_new) {
      out_.vertices.push_back(id);
      out_.rest.push_back(mesh_.rest(id));
    }
    return it->second;
  }

  const Mesh<Dim>& mesh_;
  const std::map<int, Material>& materials_;
  TransferCells<Dim>& out_;
  std::unordered_map<VertexId, int> known_;
};

}  // namespace

template <int Dim>
MatrixX TransferCells<Dim>::gather(const VectorX& field) const {
  MatrixX rows(vertices.size(), Dim);
  for (std::size_t i = 0; i < vertices.size(); ++i)
    rows.row(static_cast<Eigen::Index>(i)) = field.segment<Dim>(Dim * vertices[i]).transpose();
  return rows;
}

template <int Dim>
TransferPatch<Dim> make_transfer_patch(const Mesh<Dim>& old_mesh, const Mesh<Dim>& mesh, const TouchedCells& touched,
                                       const std::map<int, Material>& materials, int rings) {
  TransferPatch<Dim> patch;
  Numbering<Dim> old_numbering(old_mesh, materials, patch.old_cells), numbering(mesh, materials, patch.new_cells);
  patch.old_cells.axisymmetric = patch.new_cells.axisymmetric = patch.cells.axisymmetric = mesh.is_axisymmetric();
  for (const CellId c : touched.old_cells) old_numbering.add(c);
  std::vector<CellId> ids = touched.new_cells;
  std::unordered_set<CellId> inside(ids.begin(), ids.end());
  for (const CellId c : ids) numbering.add(c);
  patch.touched.old_cells.resize(touched.old_cells.size());
  patch.touched.new_cells.resize(touched.new_cells.size());
  std::iota(patch.touched.old_cells.begin(), patch.touched.old_cells.end(), 0);
  std::iota(patch.touched.new_cells.begin(), patch.touched.new_cells.end(), 0);
  std::size_t first = 0;
  for (int ring = 0; ring <= rings; ++ring) {  // cells around the vertices of the ring before
    const std::size_t end = patch.new_cells.vertices.size();
    for (std::size_t i = std::exchange(first, end); i < end; ++i)
      for (const CellId c : mesh.cells_of(patch.new_cells.vertices[i]))  // of a curved edge's node none: its ends are there
        if (inside.insert(c).second) {
          ids.push_back(c);
          numbering.add(c);
        }
  }
  for (const int v : patch.new_cells.vertices) {
    std::vector<CellId> of_edge;
    if (const EdgeKey edge = mesh.edge_of_node(v); edge[0] != kNone) of_edge = mesh.cells_of_edge(edge);
    const std::span<const CellId> around = of_edge.empty() ? mesh.cells_of(v) : std::span<const CellId>(of_edge);
    patch.at_rim.push_back(!std::all_of(around.begin(), around.end(), [&](CellId c) { return inside.contains(c); }));
  }
  patch.cells.num_vertices = static_cast<int>(patch.new_cells.vertices.size());
  patch.cells.rest = patch.new_cells.rest;
  for (const bool is_curved : {false, true})  // in the order of CellSet, which else moves others for each
    for (std::size_t i = 0; i < ids.size(); ++i) {
      if (is_curved != (patch.new_cells.view().curved_edges(i) != 0)) continue;
      auto element = element_of(mesh, ids[i]);
      element.vertices = patch.new_cells.cells[i];
      element.edge_nodes.fill(element.vertices[0]);
      if (is_curved) {
        const auto& nodes = patch.new_cells.nodes[i];
        std::copy(nodes.begin() + Dim + 1, nodes.end(), element.edge_nodes.begin());
      }
      patch.cells.add(element);
    }
  return patch;
}

#define ITR_INSTANTIATE(Dim)                                                                                    \
  template struct TransferCells<Dim>;                                                                           \
  template TransferPatch<Dim> make_transfer_patch<Dim>(const Mesh<Dim>&, const Mesh<Dim>&, const TouchedCells&, \
                                                       const std::map<int, Material>&, int);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
