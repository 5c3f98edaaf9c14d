// SPDX-License-Identifier: MIT
#include "periodic.hpp"

#include <algorithm>
#include <limits>

#include "../defaults.hpp"
#include "../function.hpp"
#include "../supports.hpp"
#include "mesh/facet_tags.hpp"
#include "mesh/rest_box.hpp"

namespace itr::scene {

namespace {

/// The displacement gradient H of the cell in the mean, by time. A component that is free is NaN.
template <int Dim>
class Gradient {
 public:
  /// Reads the matrix that one node gives and the list of fixed components, row by row, that another one does. Without a
  /// matrix H is 0.
  Gradient(const Node& matrix, const Node& fixed) {
    components_.fill([](double) { return 0.0; });
    if (!matrix.exists()) {
      if (fixed.exists()) fixed.fail(abbreviate(fixed.json()) + ", which has no effect", "the displacement gradient, too");
      return;
    }
    read(matrix);
    std::array<bool, Dim * Dim> is_fixed{};
    for (const Node& item : fixed.items()) {
      const int component = item.integer(-1);
      if (component < 0 || component >= Dim * Dim) item.fail("0 to " + std::to_string(Dim * Dim - 1) + ", row by row");
      is_fixed[static_cast<std::size_t>(component)] = true;
    }
    // A turn of the whole cell costs no energy: one of the two components that it mixes stays.
    for (int i = 0; i < Dim; ++i)
      for (int j = i + 1; j < Dim; ++j)
        if (!is_fixed[at(i, j)] && !is_fixed[at(j, i)]) is_fixed[at(i, j)] = true;
    for (std::size_t k = 0; k < is_fixed.size(); ++k)
      if (!is_fixed[k]) components_[k] = [](double) { return std::numeric_limits<double>::quiet_NaN(); };
  }

  /// H L by time.
  std::function<Vec<3>(double)> times(const Vec<Dim>& period) const {
    return [components = components_, period](double t) {
      Vec<3> jump = Vec<3>::Zero();
      for (int i = 0; i < Dim; ++i)
        for (int j = 0; j < Dim; ++j)
          if (period[j] != 0) jump[i] += components[at(i, j)](t) * period[j];
      return jump;
    };
  }

 private:
  static std::size_t at(int i, int j) { return static_cast<std::size_t>(i * Dim + j); }
  void read(const Node& matrix) {
    const std::vector<Node> rows = matrix.items();
    if (rows.size() != Dim) matrix.fail(std::to_string(Dim) + " rows");
    for (int i = 0; i < Dim; ++i) {
      const Node& row = rows[static_cast<std::size_t>(i)];
      if (row.items().size() != Dim) row.fail(std::to_string(Dim) + " numbers or expressions of t");
      for (int j = 0; j < Dim; ++j) {
        const Node value = row.items()[static_cast<std::size_t>(j)];
        const ScalarFunction<Dim> component = read_scalar_function<Dim>(value.without_units(), value["no such key"]);
        if (component.uses_space) value.fail(abbreviate(value.json()) + ", which varies in space", "one of t at most");
        components_[at(i, j)] = [f = component.function](double t) { return f(Vec<Dim>::Zero(), t); };
      }
    }
  }

  std::array<std::function<double(double)>, Dim * Dim> components_;
};

/// Tags of the facets in a plane across an axis, which get one where they have none.
template <int Dim>
std::vector<int> tags_of_side(const Node& node, int axis, double place, double tolerance, int& free_tag, Mesh<Dim>& mesh) {
  std::set<int> tags, elsewhere;
  const int own = free_tag++;
  for (const FacetId f : mesh.live_facets()) {
    const bool is_in =
        std::ranges::all_of(mesh.facet(f), [&](VertexId v) { return std::abs(mesh.rest(v)[axis] - place) <= tolerance; });
    if (is_in && mesh.facet_tag(f) == kNoTag) mesh.set_facet_tag(f, own);
    (is_in ? tags : elsewhere).insert(mesh.facet_tag(f));
  }
  if (tags.empty())
    node.fail("no facets in the plane " + std::string(1, static_cast<char>('x' + axis)) + " = " + std::to_string(place),
              "bodies that reach the sides of their box");
  for (const int tag : tags)
    if (elsewhere.contains(tag))
      node.fail("the surface " + std::to_string(tag) + ", which goes around an edge of the box", "sides of their own");
  return {tags.begin(), tags.end()};
}

template <int Dim>
void check_correspondence(const Node& node) {
  const std::vector<Node> vectors = node.items();
  for (int i = 0; i < static_cast<int>(vectors.size()); ++i) {
    const std::vector<double> vector = vectors[static_cast<std::size_t>(i)].numbers();
    bool is_along = vector.size() == Dim;
    for (int j = 0; is_along && j < Dim; ++j) is_along = (vector[static_cast<std::size_t>(j)] != 0) == (i == j);
    if (!is_along) node.fail("directions along the axes, in their order");
  }
}

/// Holds the vertex of the smallest coordinates against translations.
template <int Dim>
void hold_one_vertex(int tag, Setup<Dim>& setup) {
  Mesh<Dim>& mesh = setup.mesh;
  VertexId least = kNone;
  for (VertexId v = 0; v < mesh.num_vertices(); ++v)
    if (mesh.is_boundary(v) && (least == kNone || mesh.rest(v).sum() < mesh.rest(least).sum())) least = v;
  mesh.set_vertex_tag(least, tag);
  std::array<bool, Dim> all;
  all.fill(true);
  setup.dirichlet.push_back({tag, all, [](const RestPoint<Dim>&, double) { return Vec<Dim>(Vec<Dim>::Zero()); }});
}

/// From the facets of one side to those of the other.
template <int Dim>
Vec<Dim> period_between(const Mesh<Dim>& mesh, const std::vector<int>& a, const std::vector<int>& b) {
  std::array<Eigen::AlignedBox<double, Dim>, 2> boxes;
  for (const FacetId f : mesh.live_facets())
    for (const VertexId v : mesh.facet(f)) {
      if (std::ranges::find(a, mesh.facet_tag(f)) != a.end()) boxes[0].extend(mesh.rest(v));
      if (std::ranges::find(b, mesh.facet_tag(f)) != b.end()) boxes[1].extend(mesh.rest(v));
    }
  Vec<Dim> period = boxes[1].min() - boxes[0].min();
  int axis = 0;
  period.cwiseAbs().maxCoeff(&axis);
  return period[axis] * Vec<Dim>::Unit(axis);
}

}  // namespace

template <int Dim>
void read_periodic_boundary(const Node& root, const Sets& sets, Setup<Dim>& setup) {
  const Node conditions = root["boundary_conditions"], box_sides = conditions["periodic_boundary"];
  const Node pairs = conditions["periodic"], constraint = root["constraints"]["macro_displacement_gradient"];
  const bool is_of_box = box_sides["enabled"].boolean(false);
  if (!is_of_box && !pairs.exists()) {
    if (constraint.exists()) constraint.fail("it without boundary_conditions/periodic", "periodic sides, too");
    return;
  }
  const Node given = is_of_box ? box_sides : pairs;
  if (!is_polyfem_set(root)) given.fail("it with other defaults than PolyFEM's", "/ties/*/periodic");
  if (is_of_box && pairs.exists()) pairs.fail("it beside periodic_boundary", "one of both");
  Mesh<Dim>& mesh = setup.mesh;
  const Gradient<Dim> gradient =
      is_of_box ? Gradient<Dim>(box_sides["linear_displacement_offset"], box_sides["fixed_macro_strain"])
                : Gradient<Dim>(constraint["value"], constraint["fixed_components"]);
  int free_tag = 1;
  for (const auto& [label, ids] : sets.surfaces.all())
    for (const int id : ids) free_tag = std::max(free_tag, id + 1);
  if (is_of_box) {
    check_correspondence<Dim>(box_sides["correspondence"]);
    const Eigen::AlignedBox<double, Dim> box = rest_box(mesh);
    const Vec<Dim> size = box.sizes();
    const double tolerance = box_sides["tolerance"].positive(1e-5) * size.maxCoeff();
    for (int axis = 0; axis < Dim; ++axis) {
      const std::vector<int> low = tags_of_side<Dim>(box_sides, axis, box.min()[axis], tolerance, free_tag, mesh);
      const std::vector<int> high = tags_of_side<Dim>(box_sides, axis, box.max()[axis], tolerance, free_tag, mesh);
      setup.ties.push_back({low, high, gradient.times(size[axis] * Vec<Dim>::Unit(axis))});
    }
  } else {
    const std::set<int> with_facets = sets.facet_tags(mesh);
    for (const Node& pair : pairs.items()) {
      const std::vector<Node> ids = pair["boundary_ids"].items();
      if (ids.size() != 2) pair["boundary_ids"].fail("the ids of two opposite sides");
      const auto side = [&](const Node& id) { return read_surfaces(id, sets, with_facets, "the id of a side"); };
      const std::vector<int> a = side(ids[0]), b = side(ids[1]);
      setup.ties.push_back({a, b, gradient.times(period_between(mesh, a, b))});
    }
  }
  if (setup.dirichlet.empty()) hold_one_vertex<Dim>(free_tag, setup);
}

#define ITR_INSTANTIATE(Dim) template void read_periodic_boundary(const Node&, const Sets&, Setup<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr::scene
