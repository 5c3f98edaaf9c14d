// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/hdf5.hpp"
#include "mesh/facet_measure.hpp"
#include "polyfem/tessellation.hpp"
#include "readers.hpp"

namespace itr::scene {

namespace {

using Weights = Eigen::SparseMatrix<double, Eigen::RowMajor>;

/// The datasets `values`, `rows` and `cols` of /weight_triplets, and its attribute `shape`. Triplets for one entry are
/// summed.
Weights read_weights(const std::filesystem::path& path, std::int64_t rows, std::int64_t vertices, bool has_curved_edges) {
  const auto fail = [&](const std::string& place, const std::string& found, const std::string& expected) {
    throw InputError({path.string(), place, found, expected});
  };
  const std::string group = "weight_triplets";
  const hdf5::Session session;
  const hdf5::File file = hdf5::File::open(path);
  for (const char* name : {"values", "rows", "cols"})
    if (!file.contains(group) || !file.contains(group + "/" + name)) fail(group + "/" + name, "no such dataset", "it");
  const std::vector<std::int64_t> shape = file.read_integers_attribute(group, "shape");
  // How many edges are curved the simulation knows, which checks it.
  const std::int64_t columns = has_curved_edges && shape.size() == 2 && shape[1] > vertices ? shape[1] : vertices;
  if (shape != std::vector{rows, columns}) {
    std::string found;
    for (const std::int64_t n : shape) found += (found.empty() ? "" : " x ") + std::to_string(n);
    fail(group + ", attribute shape", found,
         std::to_string(rows) + " x " + std::to_string(columns) +
             ", vertices of the collision mesh by vertices of the bodies (those in no cell are left out)");
  }
  const std::vector<double> values = file.read_doubles(group + "/values").values;
  const auto read_indices = [&](const char* name, std::int64_t end) {
    std::vector<std::int64_t> indices = file.read_integers(group + "/" + name).values;
    if (indices.size() != values.size())
      fail(group + "/" + name, std::to_string(indices.size()) + " numbers", std::to_string(values.size()) + ", one a value");
    for (const std::int64_t i : indices)
      if (i < 0 || i >= end) fail(group + "/" + name, "index " + std::to_string(i), "0 to " + std::to_string(end) + " - 1");
    return indices;
  };
  const auto row = read_indices("rows", rows), column = read_indices("cols", columns);
  std::vector<Eigen::Triplet<double>> triplets;
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (!std::isfinite(values[k])) fail(group + "/values", "weight " + std::to_string(k) + " that is not finite", "numbers");
    triplets.emplace_back(static_cast<int>(row[k]), static_cast<int>(column[k]), values[k]);
  }
  Weights weights(rows, columns);
  weights.setFromTriplets(triplets.begin(), triplets.end());
  return weights;
}

template <int Dim>
int count_loose(const CollisionProxy<Dim>& proxy) {
  std::vector<char> is_used(proxy.rest.size(), 0);
  for (const auto& edge : proxy.edges)  // those of the faces are among them
    for (const int v : edge) is_used[v] = 1;
  return static_cast<int>(std::count(is_used.begin(), is_used.end(), 0));
}

int count_unsteady(const Weights& weights) {
  constexpr double kRounding = 1e-6;  // of files that hold single precision
  const VectorX sums = weights * VectorX::Ones(weights.cols());
  return static_cast<int>(((sums.array() - 1).abs() > kRounding).count());
}

}  // namespace

bool has_collision_mesh(const Node& root) {
  const Node node = root["contact"]["collision_mesh"];
  return node.exists() && node["enabled"].boolean(true) && root["contact"]["enabled"].boolean(false);
}

bool is_cut_boundary(const Node& root) {
  const Node node = root["contact"]["collision_mesh"];
  return node.has("max_edge_length") && !node.has("mesh");
}

namespace {

/// The boundary itself, cut into smaller triangles.
template <int Dim>
CollisionProxy<Dim> cut_boundary(const Node& node, const Mesh<Dim>& mesh, const std::map<int, int>& order) {
  if constexpr (Dim == 3) {
    constexpr int kParts = 9;  // of "regular", as PolyFEM takes them whatever the length is
    constexpr double kMostTriangles = 2e7;
    const Node length = node["max_edge_length"];
    const double longest = length.positive(1);
    const bool is_regular = node["tessellation_type"].choice({"regular", "irregular"}, 0) == 0;
    double area = 0;
    for (const FacetId f : mesh.live_facets()) area += facet_measure(mesh, f);
    if (!is_regular && area > kMostTriangles * longest * longest) length.fail("a larger length: too many triangles");
    return tessellate(mesh, order, {longest, is_regular ? kParts : 0});
  } else {
    node["max_edge_length"].fail("it in the plane", "a scene in space, or mesh and linear_map");
  }
}

}  // namespace

template <int Dim>
std::optional<CollisionProxy<Dim>> read_collision_mesh(const Node& root, const Geometries& geometries,
                                                       const Setup<Dim>& setup, MeshFiles& files,
                                                       std::vector<std::string>& warnings) {
  if (!has_collision_mesh(root)) return {};
  const Mesh<Dim>& mesh = setup.mesh;
  const Node node = root["contact"]["collision_mesh"];
  if (root["space"]["remesh"]["enabled"].boolean(false))
    node.fail("a collision mesh where the bodies' mesh changes", "one or the other (space/remesh/enabled)");
  for (const char* key : {"max_edge_length", "tessellation_type"})
    if (node.has(key) && !is_cut_boundary(root))
      node[key].fail(abbreviate(node[key].json()) + ", which has no effect", "max_edge_length without mesh");
  for (const char* key : {"mesh", "linear_map"})
    if (node.has(key) && is_cut_boundary(root)) node[key].fail("it beside max_edge_length", "one of both");
  if (is_cut_boundary(root)) return cut_boundary<Dim>(node, mesh, setup.order);
  for (const Node& geometry : geometries.bodies)
    if (geometry["n_refs"].integer(0) != 0) geometry["n_refs"].fail("0: a collision mesh follows the vertices of the file");
  Obstacles<Dim> surface = read_surface<Dim>(node, root["geometry"].items().front(), files);
  const auto vertices = static_cast<std::int64_t>(surface.rest.size());
  const Node order = root["space"]["discr_order"];
  const bool has_curved_edges = order.exists() && order.json() != 1;
  CollisionProxy<Dim> proxy{std::move(surface.rest), std::move(surface.edges), std::move(surface.triangles),
                            read_weights(MeshFiles::find(node["linear_map"], MeshFiles::kWeights), vertices,
                                         mesh.num_vertices(), has_curved_edges)};
  if (const int loose = count_loose(proxy); loose > 0)
    warnings.push_back(node["mesh"].pointer() + ": " + std::to_string(loose) +
                       " vertices in no edge and no face touch as points");
  if (const int unsteady = count_unsteady(proxy.weights); unsteady > 0)
    warnings.push_back(node["linear_map"].pointer() + ": the weights of " + std::to_string(unsteady) +
                       " vertices do not sum to 1: they do not follow where the bodies move as a whole");
  return proxy;
}

template std::optional<CollisionProxy<2>> read_collision_mesh(const Node&, const Geometries&, const Setup<2>&, MeshFiles&,
                                                              std::vector<std::string>&);
template std::optional<CollisionProxy<3>> read_collision_mesh(const Node&, const Geometries&, const Setup<3>&, MeshFiles&,
                                                              std::vector<std::string>&);

}  // namespace itr::scene
