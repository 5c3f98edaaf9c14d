// SPDX-License-Identifier: MIT
#include "itr/energy/point_forces.hpp"

#include <algorithm>
#include <map>
#include <memory>
#include <string>

#include "fem/locator.hpp"
#include "geometry/bvh.hpp"
#include "itr/core/error.hpp"
#include "itr/energy/energy.hpp"
#include "itr/energy/increment.hpp"
#include "itr/fem/cell_set.hpp"
#include "itr/fem/quadratic.hpp"

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

template <int Dim>
struct Points {
  std::vector<Vec<Dim>> X;
  std::vector<Vec<Dim>> force;
  std::vector<int> body;  ///< of one of the cells of the vertex
  Bvh<Dim> tree;
};

constexpr double kInside = -1e-9;  ///< least weight of a point in a cell

/// Adds the forces of the points that are in some cell of the set: each to the cell that it is deepest in, by the values of
/// its shape functions there.
template <int Dim>
void add_located(const Points<Dim>& points, const CellSet<Dim>& cells, VectorX& forces) {
  struct Best {
    double depth;
    bool is_curved;
    std::size_t element;
    std::array<double, Dim + 1> weights;
  };
  std::map<int, Best> best;
  std::vector<int> hits;
  const auto look_in = [&](bool is_curved, std::size_t e, const int* vertices, int body, const Mat<Dim>& inverse_edges) {
    Box<Dim> box;
    for (int k = 0; k <= Dim; ++k) box.include(cells.rest[vertices[k]]);
    hits.clear();
    points.tree.query(box.inflated(1e-9 * (box.max - box.min).norm()), hits);
    for (const int i : hits) {
      if (points.body[i] != body) continue;
      const auto weights = barycentric_weights<Dim>(cells.rest[vertices[0]], inverse_edges, points.X[i]);
      const double depth = *std::min_element(weights.begin(), weights.end());
      if (depth < kInside) continue;
      const auto [it, is_new] = best.try_emplace(i, Best{depth, is_curved, e, weights});
      if (!is_new && depth > it->second.depth) it->second = {depth, is_curved, e, weights};
    }
  };
  for (std::size_t e = 0; e < cells.elements.size(); ++e) {
    const auto& element = cells.elements[e];
    look_in(false, e, element.vertices.data(), element.body, element.inverse_edges);
  }
  for (std::size_t e = 0; e < cells.curved_elements.size(); ++e) {
    const auto& element = cells.curved_elements[e];
    look_in(true, e, element.nodes.data(), element.body, element.inverse_edges);
  }
  for (const auto& [i, place] : best) {
    if (!place.is_curved) {
      for (int k = 0; k <= Dim; ++k)
        forces.segment<Dim>(Dim * cells.elements[place.element].vertices[k]) += place.weights[k] * points.force[i];
      continue;
    }
    const auto& element = cells.curved_elements[place.element];
    const auto shapes = quadratic_shapes<Dim>(element.curved, place.weights);
    for (int k = 0; k < kQuadraticNodes<Dim>; ++k)
      forces.segment<Dim>(Dim * element.nodes[k]) += shapes[k] * points.force[i];
  }
}

/// Whether the points are the first vertices of the set, one by one.
template <int Dim>
bool are_vertices(const std::vector<Vec<Dim>>& X, const std::vector<Vec<Dim>>& rest) {
  return X.size() <= rest.size() && std::equal(X.begin(), X.end(), rest.begin());
}

}  // namespace

template <int Dim>
TermFactory<Dim> point_forces(const Mesh<Dim>& mesh, ConstVectorView forces, const Space& space) {
  const std::vector<Vec<Dim>> nodes = node_rest_positions(mesh, space);
  const auto n = static_cast<int>(nodes.size());
  if (forces.size() != Eigen::Index{Dim} * n)
    throw InputError({"", "forces", std::to_string(forces.size()) + " numbers",
                      std::to_string(Dim * n) + ", " + std::to_string(Dim) + " a node"});
  const auto all = std::make_shared<std::vector<Vec<Dim>>>();
  const auto given = std::make_shared<const VectorX>(forces);
  const auto loaded = std::make_shared<Points<Dim>>();
  std::vector<Box<Dim>> boxes;
  for (int v = 0; v < n; ++v) {
    const Vec<Dim> f = forces.segment<Dim>(Dim * v), X = nodes[v];
    if (!f.allFinite())
      throw InputError({"", "forces[" + std::to_string(v) + "]", "a number that is not finite", "numbers"});
    all->push_back(X);
    if (f.isZero(0)) continue;
    loaded->X.push_back(X);
    loaded->force.push_back(f);
    const VertexId end = v < mesh.vertex_slots() ? v : space.curved_edges()[v - mesh.vertex_slots()][0];
    loaded->body.push_back(mesh.cells_of(end).empty() ? 0 : mesh.body(mesh.cells_of(end)[0]));
    boxes.push_back({X, X});
  }
  loaded->tree.build(boxes);
  return [=](const CellSet<Dim>& cells, double, double scale) -> std::shared_ptr<const Energy> {
    if (loaded->X.empty()) return nullptr;
    VectorX nodal = VectorX::Zero(Dim * static_cast<Eigen::Index>(cells.rest.size()));
    if (are_vertices<Dim>(*all, cells.rest))
      nodal.head(given->size()) = *given;
    else
      add_located(*loaded, cells, nodal);
    if (nodal.isZero(0)) return nullptr;
    double rest_work = 0;
    for (std::size_t v = 0; v < cells.rest.size(); ++v)
      rest_work += nodal.segment<Dim>(Dim * static_cast<int>(v)).dot(cells.rest[v]);
    return std::make_shared<PointForces<Dim>>(std::move(nodal), rest_work, scale);
  };
}

template TermFactory<2> point_forces<2>(const Mesh<2>&, ConstVectorView, const Space&);
template TermFactory<3> point_forces<3>(const Mesh<3>&, ConstVectorView, const Space&);

}  // namespace itr
