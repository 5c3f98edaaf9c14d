// SPDX-License-Identifier: MIT
#include "itr/itr.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <ranges>

#include "arrays.hpp"

namespace itr {

namespace {

template <int N>
std::vector<Vec<N>> as_points(std::span<const double> values) {
  std::vector<Vec<N>> points(values.size() / N);
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = Eigen::Map<const Vec<N>>(values.data() + N * i);
  return points;
}

template <std::size_t N>
std::vector<std::array<int, N>> as_rows(std::span<const int> ids) {
  std::vector<std::array<int, N>> rows(ids.size() / N);
  for (std::size_t i = 0; i < ids.size(); ++i) rows[i / N][i % N] = ids[i];
  return rows;
}

}  // namespace

Model::Model(int dimension) : dimension_(dimension) {
  if (dimension != 2 && dimension != 3) refuse("dimension", std::to_string(dimension), "2 or 3");
}

Model Model::from_scene(const std::string& file, const std::vector<scene::Override>& overrides) {
  scene::Scene scene = scene::read(file, overrides);
  Model model(scene.setup.index() == 0 ? 2 : 3);
  model.scene_ = std::move(scene);
  model.scene_file_ = file;
  model.overrides_ = overrides;
  return model;
}

void Model::set_options(const std::string& json) {
  if (scene_) refuse("options", "a model that was read from a scene", "its file, with overrides");
  auto options = nlohmann::json::parse(json, nullptr, false);
  if (!options.is_object())
    refuse("options", options.is_discarded() ? "text that is no JSON" : "no object", "a JSON object");
  auto merged = nlohmann::json::parse(options_);
  merged.merge_patch(options);
  options_ = merged.dump();
}

void Model::set_option(const std::string& pointer, const std::string& value) {
  if (!scene_) {
    overrides_.push_back({pointer, value});
    return;
  }
  auto overrides = overrides_;
  overrides.push_back({pointer, value});
  *this = from_scene(scene_file_, overrides);
}

void Model::set_mesh(std::span<const double> vertices, std::span<const int> cells, std::span<const int> bodies) {
  if (scene_) refuse("mesh", "a model that was read from a scene", "one mesh");
  check_multiple("vertices", vertices.size(), dimension_);
  check_finite("vertices", vertices);
  check_multiple("cells", cells.size(), dimension_ + 1);
  check_ids("cells", cells, vertices.size() / dimension_);
  if (!bodies.empty() && bodies.size() != cells.size() / (dimension_ + 1))
    refuse("bodies", fmt::format("{} numbers", bodies.size()),
           fmt::format("{}, one a cell", cells.size() / (dimension_ + 1)));
  vertices_.assign(vertices.begin(), vertices.end());
  cells_.assign(cells.begin(), cells.end());
  bodies_.assign(bodies.begin(), bodies.end());
  if (bodies_.empty()) bodies_.assign(cells.size() / (dimension_ + 1), 0);
  boundaries_.clear();
}

void Model::set_quadratic_mesh(std::span<const double> nodes, std::span<const int> cells, std::span<const int> bodies) {
  constexpr std::array<std::array<int, 2>, 6> kEdges = {{{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}}};
  constexpr double kTolerance = 1e-6;  // of the edge's length: digits of text files
  const auto d = static_cast<std::size_t>(dimension_), edges = d * (d + 1) / 2, row = d + 1 + edges;
  check_multiple("nodes", nodes.size(), dimension_);
  check_finite("nodes", nodes);
  check_multiple("cells", cells.size(), static_cast<int>(row));
  check_ids("cells", cells, nodes.size() / d);
  enum Kind : char { unused, vertex, middle };
  std::vector<Kind> kinds(nodes.size() / d, unused);
  const auto mark = [&](std::size_t at, Kind kind) {
    Kind& known = kinds[static_cast<std::size_t>(cells[at])];
    if (known != unused && known != kind)
      refuse(fmt::format("cells[{}]", at), fmt::format("node {} at a corner and at an edge", cells[at]), "one of both");
    known = kind;
  };
  const auto X = [&](int node, std::size_t c) { return nodes[d * static_cast<std::size_t>(node) + c]; };
  for (std::size_t first = 0; first < cells.size(); first += row) {
    for (std::size_t k = 0; k < row; ++k) mark(first + k, k <= d ? vertex : middle);
    for (std::size_t e = 0; e < edges; ++e) {
      const int a = cells[first + kEdges[e][0]], b = cells[first + kEdges[e][1]], m = cells[first + d + 1 + e];
      double length = 0, off = 0;
      for (std::size_t c = 0; c < d; ++c) {
        length = std::hypot(length, X(a, c) - X(b, c));
        off = std::hypot(off, X(m, c) - (X(a, c) + X(b, c)) / 2);
      }
      if (!(off <= kTolerance * length))
        refuse(fmt::format("nodes[{}]", m), fmt::format("{:.3g} m off the middle of the edge {}-{}", off, a, b),
               "a mesh whose edges are straight at rest");
    }
  }
  std::vector<int> vertex_of(kinds.size(), kNone);
  std::vector<double> vertices;
  for (std::size_t n = 0; n < kinds.size(); ++n) {
    if (kinds[n] != vertex) continue;
    vertex_of[n] = static_cast<int>(vertices.size() / d);
    vertices.insert(vertices.end(), nodes.begin() + static_cast<std::ptrdiff_t>(d * n),
                    nodes.begin() + static_cast<std::ptrdiff_t>(d * (n + 1)));
  }
  std::vector<int> corners;
  for (std::size_t first = 0; first < cells.size(); first += row)
    for (std::size_t k = 0; k <= d; ++k) corners.push_back(vertex_of[static_cast<std::size_t>(cells[first + k])]);
  set_mesh(vertices, corners, bodies);
  set_option("/space/discr_order", "2");
}

int Model::next_id(const std::string& name) const {
  for (const auto* parts : {&boundaries_, &obstacles_})
    for (const Part& part : *parts)
      if (part.name == name) refuse("name", "'" + name + "' twice", "another name");
  return 1 + static_cast<int>(boundaries_.size() + obstacles_.size());
}

int Model::add_boundary(const std::string& name, std::span<const int> facets) {
  check_multiple("boundary '" + name + "'", facets.size(), dimension_);
  check_ids("boundary '" + name + "'", facets, vertices_.size() / dimension_);
  Part part{name, next_id(name), {}, {}, {}, {facets.begin(), facets.end()}};
  boundaries_.push_back(std::move(part));
  return boundaries_.back().id;
}

/// Facets of the mesh that stand in one cell only.
int Model::add_facets(const std::string& name, const std::function<bool(const std::vector<int>& facet)>& takes) {
  std::map<std::vector<int>, int> count;
  const int corners = dimension_ + 1;
  for (std::size_t c = 0; c < cells_.size(); c += corners)
    for (int k = 0; k < corners; ++k) {
      std::vector<int> facet;
      for (int i = 0; i < corners; ++i)
        if (i != k) facet.push_back(cells_[c + i]);
      std::sort(facet.begin(), facet.end());
      ++count[facet];
    }
  std::vector<int> facets;
  for (const auto& [facet, cells] : count)
    if (cells == 1 && takes(facet)) facets.insert(facets.end(), facet.begin(), facet.end());
  if (facets.empty()) refuse("boundary '" + name + "'", "no facets", "some of the mesh's boundary");
  return add_boundary(name, facets);
}

int Model::add_boundary(const std::string& name, std::span<const double> box_min, std::span<const double> box_max) {
  for (const auto box : {box_min, box_max})
    if (box.size() != static_cast<std::size_t>(dimension_))
      refuse("box of boundary '" + name + "'", fmt::format("{} numbers", box.size()), std::to_string(dimension_));
  return add_facets(name, [&](const std::vector<int>& facet) {
    return std::all_of(facet.begin(), facet.end(), [&](int v) {
      for (int c = 0; c < dimension_; ++c)
        if (const double X = vertices_[dimension_ * v + c]; X < box_min[c] || X > box_max[c]) return false;
      return true;
    });
  });
}

int Model::add_boundary(const std::string& name, const std::function<bool(const double* X)>& rule) {
  return add_facets(name, [&](const std::vector<int>& facet) {
    std::array<double, 3> middle{};
    for (const int v : facet)
      for (int c = 0; c < dimension_; ++c) middle[c] += vertices_[dimension_ * v + c] / dimension_;
    return rule(middle.data());
  });
}

int Model::add_obstacle(const std::string& name, std::span<const double> vertices, std::span<const int> edges,
                        std::span<const int> triangles) {
  if (scene_) refuse("obstacle '" + name + "'", "a model that was read from a scene", "obstacles of its file");
  const std::string place = "obstacle '" + name + "'";
  check_multiple(place + ".vertices", vertices.size(), dimension_);
  check_finite(place + ".vertices", vertices);
  const std::size_t count = vertices.size() / dimension_;
  check_multiple(place + ".edges", edges.size(), 2);
  check_ids(place + ".edges", edges, count);
  check_multiple(place + ".triangles", triangles.size(), 3);
  check_ids(place + ".triangles", triangles, count);
  if (dimension_ == 2 && !triangles.empty())
    refuse(place + ".triangles", fmt::format("{} numbers", triangles.size()), "none in 2D");
  obstacles_.push_back({name,
                        next_id(name),
                        {vertices.begin(), vertices.end()},
                        {edges.begin(), edges.end()},
                        {triangles.begin(), triangles.end()},
                        {}});
  return obstacles_.back().id;
}

template <int Dim>
scene::Geometry<Dim> Model::geometry() const {
  if (cells_.empty()) refuse("mesh", "no cells", "set_mesh before");
  scene::Geometry<Dim> geometry;
  geometry.mesh = Mesh<Dim>(as_points<Dim>(vertices_), as_rows<Dim + 1>(cells_), bodies_);
  std::map<FacetId, std::vector<int>> parts_of;
  for (std::size_t p = 0; p < boundaries_.size(); ++p) {
    const Part& part = boundaries_[p];
    const auto facets = as_rows<Dim>(part.facets);
    for (std::size_t i = 0; i < facets.size(); ++i) {
      const FacetId f = geometry.mesh.find_facet(facets[i]);
      if (f == kNone)
        refuse(fmt::format("boundary '{}', facet {}", part.name, i), fmt::format("vertices {}", fmt::join(facets[i], " ")),
               "a facet of the mesh's boundary");
      auto& parts = parts_of[f];
      if (parts.empty() || parts.back() != static_cast<int>(p)) parts.push_back(static_cast<int>(p));
    }
    geometry.surfaces[part.name] = {part.id};
  }
  // Facets of several boundaries have a tag of their own.
  int next = 1;
  for (const auto* list : {&boundaries_, &obstacles_})
    for (const Part& part : *list) next = std::max(next, part.id + 1);
  std::map<std::vector<int>, int> tags;
  for (const auto& [f, parts] : parts_of) {
    const auto [tag, is_new] = tags.try_emplace(parts, parts.size() == 1 ? boundaries_[parts[0]].id : next);
    if (is_new && parts.size() > 1) {
      for (const int p : parts) geometry.surfaces[boundaries_[p].name].push_back(next);
      ++next;
    }
    geometry.mesh.set_facet_tag(f, tag->second);
  }
  Obstacles<Dim>& obstacles = geometry.obstacles;
  for (const Part& part : obstacles_) {
    const int first = static_cast<int>(obstacles.rest.size());
    for (const auto& X : as_points<Dim>(part.vertices)) obstacles.rest.push_back(X);
    for (const auto& [a, b] : as_rows<2>(part.edges)) obstacles.edges.push_back({first + a, first + b});
    for (const auto& [a, b, c] : as_rows<3>(part.triangles))
      obstacles.triangles.push_back({first + a, first + b, first + c});
    geometry.id.resize(obstacles.rest.size(), part.id);
    geometry.surfaces[part.name] = {part.id};
  }
  geometry.bodies = body_names_;
  return geometry;
}

void Model::set_law(int body, std::shared_ptr<const OwnLaw> law) {
  if (!law) refuse(fmt::format("law of body {}", body), "none", "a law");
  laws_[body] = std::move(law);
}

template <int Dim>
Setup<Dim> Model::setup(std::vector<std::string>& warnings) const {
  Setup<Dim> setup;
  if (scene_) {
    warnings = scene_->warnings;
    setup = std::get<Setup<Dim>>(scene_->setup);
  } else {
    setup = scene::make_setup<Dim>(geometry<Dim>(), options_, overrides_, warnings);
  }
  for (const auto& [body, law] : laws_) {
    const auto material = setup.materials.find(body);
    if (material == setup.materials.end())
      refuse(fmt::format("law of body {}", body), "no such body",
             fmt::format("one of {}", fmt::join(std::views::keys(setup.materials), ", ")));
    material->second.law = MaterialLaw::own;
    material->second.own = law;
  }
  return setup;
}

int Model::max_threads() const { return scene_ ? scene_->max_threads : scene::read_max_threads(options_, overrides_); }

template Setup<2> Model::setup<2>(std::vector<std::string>&) const;
template Setup<3> Model::setup<3>(std::vector<std::string>&) const;

}  // namespace itr
