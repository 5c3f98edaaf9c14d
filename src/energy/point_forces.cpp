// SPDX-License-Identifier: MIT
#include "itr/energy.hpp"

#include <algorithm>
#include <map>
#include <memory>
#include <string>

#include "energy/energy.hpp"
#include "energy/increment.hpp"
#include "fem/cell_set.hpp"
#include "fem/locator.hpp"
#include "fem/quadratic.hpp"
#include "geometry/bvh.hpp"
#include "itr/core.hpp"

namespace itr {

namespace {

/// -scale f . (x - X).
template <int Dim>
class PointForces final : public Energy, public IncrementalTerm {
 public:
  PointForces(VectorX forces, double rest_work, double scale)
      : forces_(std::move(forces)), rest_work_(rest_work), scale_(scale) {}
  std::string_view name() const override { return "host forces"; }
  double value(ConstVectorView x, Workspace&) const override { return -scale_ * (forces_.dot(x) - rest_work_); }
  void add_gradient(ConstVectorView, VectorView gradient, Workspace&) const override { gradient -= scale_ * forces_; }
  void add_hessian(ConstVectorView, PsdProjection, HessianSink&, Workspace&) const override {}
  double value_at(const Increment& at, Workspace&) const override { return -scale_ * forces_.dot(at.d); }
  void add_gradient_at(const Increment& at, VectorView gradient, Workspace& workspace) const override {
    add_gradient(at.base, gradient, workspace);
  }

 private:
  VectorX forces_;
  double rest_work_;  ///< f . X [J]
  double scale_;
};

/// The forces on the nodes of a mesh.
template <int Dim>
struct Points {
  VectorX all;                    ///< on all nodes [N]
  CellSet<Dim> cells;             ///< of the mesh
  std::vector<RestPoint<Dim>> X;  ///< of the nodes with a force
  std::vector<Vec<Dim>> force;
  Bvh<Dim> tree;
};

/// Least cosine of a point's inward direction to the inner normals of a cell that is at its inward side, to round-off.
constexpr double kFaces = -1e-6;

/// Adds the forces of the points whose inward side is in some cell of the set, by the values of its shape functions there.
/// At the rim of a patch this leaves out forces on held nodes, which do no work.
template <int Dim>
void add_located(const Points<Dim>& points, const CellSet<Dim>& cells, VectorX& forces) {
  struct Best {
    Fit<Dim> fit;
    const typename CellSet<Dim>::Element* element;
    std::array<double, Dim + 1> weights;
  };
  std::map<int, Best> best;
  std::vector<int> hits;
  for (const auto& element : cells.elements) {
    Box<Dim> box;
    for (const int v : element.vertices) box.include(cells.rest[v]);
    hits.clear();
    points.tree.query(box.inflated(1e-9 * (box.max - box.min).norm()), hits);
    for (const int i : hits) {
      if (points.X[i].part != element.part) continue;
      auto weights = barycentric_weights<Dim>(cells.rest[element.vertices[0]], element.inverse_edges, points.X[i]);
      const Fit<Dim> fit = fit_of<Dim>(points.X[i], weights, element.inverse_edges);
      if (!fit.has || fit.facing < kFaces) continue;
      tidy(weights);
      const auto [it, is_new] = best.try_emplace(i, Best{fit, &element, weights});
      if (!is_new && fit.is_better_than(it->second.fit)) it->second = {fit, &element, weights};
    }
  }
  for (const auto& [i, place] : best) {
    const auto nodes = place.element->nodes();
    const auto shapes = quadratic_shapes<Dim>(place.element->curved, place.weights);
    for (int k = 0; k < kQuadraticNodes<Dim>; ++k) forces.segment<Dim>(Dim * nodes[k]) += shapes[k] * points.force[i];
  }
}

/// Whether the set has the cells of a mesh, with its nodes for its first ones.
template <int Dim>
bool has_cells_of(const CellSet<Dim>& mesh, const CellSet<Dim>& cells) {
  return mesh.rest.size() <= cells.rest.size() &&
         std::ranges::equal(mesh.elements, cells.elements, {}, &CellSet<Dim>::Element::nodes,
                            &CellSet<Dim>::Element::nodes) &&
         std::equal(mesh.rest.begin(), mesh.rest.end(), cells.rest.begin());
}

}  // namespace

template <int Dim>
TermFactory<Dim> point_forces(const Mesh<Dim>& mesh, ConstVectorView forces) {
  const int n = mesh.num_nodes();
  if (forces.size() != Eigen::Index{Dim} * n)
    throw InputError({"", "forces", std::to_string(forces.size()) + " numbers",
                      std::to_string(Dim * n) + ", " + std::to_string(Dim) + " a node"});
  const auto loaded = std::make_shared<Points<Dim>>();
  loaded->all = forces;
  loaded->cells = whole_mesh(mesh, {});
  std::vector<Box<Dim>> boxes;
  for (int v = 0; v < n; ++v) {
    const Vec<Dim> f = forces.segment<Dim>(Dim * v);
    if (!f.allFinite())
      throw InputError({"", "forces[" + std::to_string(v) + "]", "a number that is not finite", "numbers"});
    if (f.isZero(0)) continue;
    loaded->X.push_back(mesh.point_of_node(v));
    loaded->force.push_back(f);
    boxes.push_back({loaded->X.back(), loaded->X.back()});
  }
  loaded->tree.build(boxes);
  return [=](const CellSet<Dim>& cells, double, double scale) -> std::shared_ptr<const Energy> {
    if (loaded->X.empty()) return nullptr;
    VectorX nodal = VectorX::Zero(Dim * static_cast<Eigen::Index>(cells.rest.size()));
    if (has_cells_of(loaded->cells, cells))
      nodal.head(loaded->all.size()) = loaded->all;
    else
      add_located(*loaded, cells, nodal);
    if (nodal.isZero(0)) return nullptr;
    double rest_work = 0;
    for (std::size_t v = 0; v < cells.rest.size(); ++v)
      rest_work += nodal.segment<Dim>(Dim * static_cast<int>(v)).dot(cells.rest[v]);
    return std::make_shared<PointForces<Dim>>(std::move(nodal), rest_work, scale);
  };
}

template TermFactory<2> point_forces<2>(const Mesh<2>&, ConstVectorView);
template TermFactory<3> point_forces<3>(const Mesh<3>&, ConstVectorView);

}  // namespace itr
