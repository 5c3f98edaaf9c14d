// SPDX-License-Identifier: MIT
#include "mesh/strata.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/check.hpp"
#include "mesh/cell_of_facet.hpp"
#include "mesh/rest_box.hpp"

namespace itr {

namespace {

/// Beside the tolerance by the size of the mesh, the sine of the angle between facets or edges that count as one plane or
/// line: what keeps small facets from counting as flat whatever they do.
constexpr double kAngle = 1e-6;

/// Area-weighted normal of a facet: of its length in 2D, twice its area in 3D.
Vec<2> facet_normal(const Mesh<2>& mesh, const std::array<int, 2>& f) {
  const Vec<2> along = mesh.rest(f[1]) - mesh.rest(f[0]);
  return {along[1], -along[0]};
}
Vec<3> facet_normal(const Mesh<3>& mesh, const std::array<int, 3>& f) {
  return (mesh.rest(f[1]) - mesh.rest(f[0])).cross(mesh.rest(f[2]) - mesh.rest(f[0]));
}

/// Distance from the vertex of a facet opposite its k-th ridge to that ridge.
double altitude(const Mesh<2>&, const std::array<int, 2>&, int, double length) { return length; }
double altitude(const Mesh<3>& mesh, const std::array<int, 3>& f, int k, double double_area) {
  return double_area / (mesh.rest(f[(k + 1) % 3]) - mesh.rest(f[(k + 2) % 3])).norm();
}

/// A facet of the boundary or between bodies while patches are found. What it is called (body and tag, or two bodies) must
/// be the same all over a patch.
template <int Dim>
struct InputSheet {
  typename MeshTypes<Dim>::Facet vertices;  ///< seen from outside, of an interface from the body of the larger id
  std::array<int, 3> called;
  FacetId facet;                      ///< kNone for an interface
  Vec<Dim> normal;                    ///< not normalised
  double size;                        ///< its length
  std::array<int, Dim> neighbours{};  ///< across the ridge opposite each vertex, where a patch may go on
  int patch = kNone;
};

template <int Dim>
std::vector<InputSheet<Dim>> find_sheets(const Mesh<Dim>& mesh) {
  std::vector<InputSheet<Dim>> sheets;
  const auto add = [&](const typename MeshTypes<Dim>::Facet& vertices, const std::array<int, 3>& called, FacetId f) {
    const Vec<Dim> normal = facet_normal(mesh, vertices);
    sheets.push_back({vertices, called, f, normal, normal.norm()});
    sheets.back().neighbours.fill(kNone);
  };
  for (const FacetId f : mesh.live_facets()) {
    add(mesh.facet(f), {0, mesh.body(cell_of_facet(mesh, f)), mesh.facet_tag(f)}, f);
  }
  std::vector<char> between(mesh.node_slots());
  for (VertexId v = 0; v < mesh.node_slots(); ++v) between[v] = mesh.is_on_interface(v);
  std::vector<std::pair<typename MeshTypes<Dim>::Facet, std::array<int, 3>>> faces;  // vertices, body, cell, place in it
  for (const CellId c : mesh.live_cells()) {
    for (int k = 0; k <= Dim; ++k) {
      const auto face = opposite_facet<Dim>(mesh.cell(c), k);
      if (std::all_of(face.begin(), face.end(), [&](int v) { return between[v]; }))
        faces.push_back({ascending(face), {mesh.body(c), c, k}});
    }
  }
  std::sort(faces.begin(), faces.end());
  for (std::size_t i = 1; i < faces.size(); ++i) {
    const auto& [face, a] = faces[i - 1];
    const auto& b = faces[i].second;
    if (faces[i].first == face && a[0] != b[0]) add(opposite_facet<Dim>(mesh.cell(a[1]), a[2]), {1, a[0], b[0]}, kNone);
  }
  return sheets;
}

/// Across ridges where exactly two sheets meet that are called the same.
template <int Dim>
void find_neighbours(std::vector<InputSheet<Dim>>& sheets) {
  struct Ridge {
    std::array<int, Dim - 1> vertices;
    int sheet, place;
  };
  std::vector<Ridge> ridges;
  for (std::size_t s = 0; s < sheets.size(); ++s)
    for (int k = 0; k < Dim; ++k) {
      Ridge ridge{{}, static_cast<int>(s), k};
      for (int i = 0, to = 0; i < Dim; ++i)
        if (i != k) ridge.vertices[to++] = sheets[s].vertices[i];
      ridge.vertices = ascending(ridge.vertices);
      ridges.push_back(ridge);
    }
  std::stable_sort(ridges.begin(), ridges.end(), [](const Ridge& a, const Ridge& b) { return a.vertices < b.vertices; });
  for (std::size_t begin = 0, end = 0; begin < ridges.size(); begin = end) {
    while (end < ridges.size() && ridges[end].vertices == ridges[begin].vertices) ++end;
    const Ridge &a = ridges[begin], &b = ridges[end - 1];
    if (end - begin != 2 || sheets[a.sheet].called != sheets[b.sheet].called) continue;
    sheets[a.sheet].neighbours[a.place] = b.sheet;
    sheets[b.sheet].neighbours[b.place] = a.sheet;
  }
}

/// Whether the sheet goes on from its ridge opposite vertex `k` in the plane.
template <int Dim>
bool is_flat(const Mesh<Dim>& mesh, const InputSheet<Dim>& sheet, int k, const Vec<Dim>& point, const Vec<Dim>& normal,
             double tolerance) {
  const auto distance = [&](int v) { return std::abs((mesh.rest(v) - point).dot(normal)); };
  return sheet.normal.dot(normal) > 0 &&
         distance(sheet.vertices[k]) <= kAngle * altitude(mesh, sheet.vertices, k, sheet.size) &&
         std::all_of(sheet.vertices.begin(), sheet.vertices.end(), [&](int v) { return distance(v) <= tolerance; });
}

/// Sets as visited all of `n` items that are joined with `first`; returns their number.
template <typename Joined>
int visit_component(int n, int first, std::vector<char>& visited, const Joined& joined) {
  std::vector<int> found = {first};
  visited[first] = 1;
  for (std::size_t i = 0; i < found.size(); ++i)
    for (int j = 0; j < n; ++j)
      if (!visited[j] && joined(found[i], j)) {
        visited[j] = 1;
        found.push_back(j);
      }
  return static_cast<int>(found.size());
}

}  // namespace

std::string_view name(Stratum stratum) {
  static constexpr std::string_view kNames[] = {"volume", "surface", "feature", "corner", "non-manifold"};
  return kNames[static_cast<int>(stratum)];
}

template <int Dim>
Strata<Dim>::Strata(const Mesh<Dim>& mesh, double flatness) {
  tolerance_ = mesh.num_vertices() > 0 ? flatness * rest_box(mesh).diagonal().norm() : 0;

  auto sheets = find_sheets(mesh);
  find_neighbours<Dim>(sheets);
  // Patches grow from their largest sheet, whose plane is known best.
  std::vector<int> order(sheets.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return sheets[a].size > sheets[b].size; });
  std::vector<int> front;
  for (const int seed : order) {
    if (sheets[seed].patch != kNone) continue;
    const Plane plane{mesh.rest(sheets[seed].vertices[0]), sheets[seed].normal / sheets[seed].size};
    const int patch = num_patches();
    planes_.push_back(plane);
    sheets[seed].patch = patch;
    front = {seed};
    while (!front.empty()) {
      const int from = front.back();
      front.pop_back();
      for (const int to : sheets[from].neighbours) {
        if (to == kNone || sheets[to].patch != kNone) continue;
        const auto& back = sheets[to].neighbours;
        const int k = static_cast<int>(std::find(back.begin(), back.end(), from) - back.begin());
        if (!is_flat<Dim>(mesh, sheets[to], k, plane.point, plane.normal, tolerance_)) continue;
        sheets[to].patch = patch;
        front.push_back(to);
      }
    }
  }
  patches_.assign(mesh.facet_slots(), kNone);
  for (const auto& sheet : sheets) {
    if (sheet.facet != kNone)
      patches_[sheet.facet] = sheet.patch;
    else
      interfaces_[ascending(sheet.vertices)] = sheet.patch;
  }
  vertices_.assign(mesh.node_slots(), Stratum::corner);
  for (VertexId v = 0; v < mesh.node_slots(); ++v)
    vertices_[v] = mesh.is_vertex_alive(v) ? classify(mesh, v) : Stratum::volume;
}

template <int Dim>
Strata<Dim>::Strata(const Record& record)
    : vertices_(record.vertices), patches_(record.patches), planes_(record.planes), tolerance_(record.tolerance) {
  for (const auto& row : record.interfaces) {
    Facet facet;
    std::copy_n(row.begin(), Dim, facet.begin());
    interfaces_[facet] = row[Dim];
  }
}

template <int Dim>
typename Strata<Dim>::Record Strata<Dim>::record() const {
  Record record{.vertices = vertices_, .patches = patches_, .interfaces = {}, .planes = planes_, .tolerance = tolerance_};
  for (const auto& [facet, patch] : interfaces_) {
    auto& row = record.interfaces.emplace_back();
    *std::copy(facet.begin(), facet.end(), row.begin()) = patch;
  }
  std::sort(record.interfaces.begin(), record.interfaces.end());
  return record;
}

template <int Dim>
Stratum Strata<Dim>::classify(const Mesh<Dim>& mesh, VertexId v) const {
  if (mesh.cells_of(v).empty() || mesh.vertex_tag(v) != kNoTag) return Stratum::corner;
  const auto sheets = sheets_of(mesh, v);
  if (sheets.empty()) return Stratum::volume;
  const int n = static_cast<int>(sheets.size());

  // Sheets at v by the ridges through v: v itself in 2D, the edges from v in 3D, named by their other end.
  std::vector<std::pair<VertexId, int>> at;  // ridge, sheet
  for (int s = 0; s < n; ++s) {
    if constexpr (Dim == 2) {
      at.emplace_back(v, s);
    } else {
      for (const int w : sheets[s].vertices)
        if (w != v) at.emplace_back(w, s);
    }
  }
  std::sort(at.begin(), at.end());
  struct Ridge {
    VertexId end;
    std::vector<int> sheets;
    bool is_feature;
  };
  std::vector<Ridge> ridges;
  for (const auto& [end, sheet] : at) {
    if (ridges.empty() || ridges.back().end != end) ridges.push_back({end, {}, false});
    ridges.back().sheets.push_back(sheet);
  }
  bool is_manifold = true;
  for (Ridge& ridge : ridges) {
    const auto boundary =
        std::count_if(ridge.sheets.begin(), ridge.sheets.end(), [&](int s) { return sheets[s].is_boundary; });
    is_manifold = is_manifold && (boundary == 0 || boundary == 2);
    ridge.is_feature = ridge.sheets.size() != 2 || sheets[ridge.sheets[0]].patch != sheets[ridge.sheets[1]].patch;
  }
  const auto joined = [&](int a, int b, auto&& through) {
    return std::any_of(ridges.begin(), ridges.end(), [&](const Ridge& ridge) {
      const auto& s = ridge.sheets;
      return through(ridge) && std::find(s.begin(), s.end(), a) != s.end() && std::find(s.begin(), s.end(), b) != s.end();
    });
  };
  std::vector<char> visited(n);
  const auto first_boundary = std::find_if(sheets.begin(), sheets.end(), [](const Sheet& s) { return s.is_boundary; });
  if (first_boundary != sheets.end()) {  // one cycle or, in 2D, one pair
    const int reached = visit_component(n, static_cast<int>(first_boundary - sheets.begin()), visited, [&](int a, int b) {
      return sheets[a].is_boundary && sheets[b].is_boundary && joined(a, b, [](const Ridge&) { return true; });
    });
    is_manifold = is_manifold && reached == static_cast<int>(mesh.facets_of(v).size());
  }
  if (!is_manifold) return Stratum::non_manifold;

  // Components of sheets that go on into each other within one patch.
  std::fill(visited.begin(), visited.end(), 0);
  int components = 0;
  for (int s = 0; s < n; ++s) {
    if (visited[s]) continue;
    ++components;
    visit_component(n, s, visited, [&](int a, int b) { return joined(a, b, [](const Ridge& r) { return !r.is_feature; }); });
  }
  std::vector<const Ridge*> features;
  for (const Ridge& ridge : ridges)
    if (ridge.is_feature) features.push_back(&ridge);
  if (features.empty()) return components == 1 ? Stratum::surface : Stratum::corner;
  if (Dim == 2 || features.size() != 2) return Stratum::corner;

  // A straight feature: one fan of each patch from one edge to the other, and both edges on one line.
  const auto patches_at = [&](const Ridge& ridge) {
    std::vector<int> patches;
    for (const int s : ridge.sheets) patches.push_back(sheets[s].patch);
    std::sort(patches.begin(), patches.end());
    return patches;
  };
  if (components != static_cast<int>(features[0]->sheets.size()) || patches_at(*features[0]) != patches_at(*features[1]))
    return Stratum::corner;
  const Vec<Dim> a = mesh.rest(features[0]->end) - mesh.rest(v), b = mesh.rest(features[1]->end) - mesh.rest(v);
  const Vec<Dim> along = (b - a).normalized();
  const double off = (a - along * along.dot(a)).norm();
  const bool straight = a.dot(b) < 0 && off <= tolerance_ && off <= kAngle * std::min(a.norm(), b.norm());
  return straight ? Stratum::feature : Stratum::corner;
}

template <int Dim>
int Strata<Dim>::interface_patch(const Facet& vertices) const {
  const auto found = interfaces_.find(ascending(vertices));
  return found == interfaces_.end() ? kNone : found->second;
}

/// Appends the interface facets of a cell that hold all of `held`, unless they are there already.
template <int Dim>
void Strata<Dim>::append_interfaces(const typename MeshTypes<Dim>::Cell& cell, std::span<const VertexId> held,
                                    std::vector<Sheet>& to) const {
  for (int k = 0; k <= Dim; ++k) {
    if (std::find(held.begin(), held.end(), cell[k]) != held.end()) continue;
    const Facet face = ascending(opposite_facet<Dim>(cell, k));
    const auto found = interfaces_.find(face);
    if (found == interfaces_.end()) continue;
    if (std::none_of(to.begin(), to.end(), [&](const Sheet& s) { return s.vertices == face; }))
      to.push_back({face, found->second, false});
  }
}

template <int Dim>
std::vector<typename Strata<Dim>::Sheet> Strata<Dim>::sheets_of(const Mesh<Dim>& mesh, VertexId v) const {
  std::vector<Sheet> sheets;
  if (vertices_[v] == Stratum::volume) return sheets;
  for (const FacetId f : mesh.facets_of(v)) sheets.push_back({mesh.facet(f), patches_[f], true});
  if (!interfaces_.empty() && mesh.is_on_interface(v))
    for (const CellId c : mesh.cells_of(v)) append_interfaces(mesh.cell(c), {{v}}, sheets);
  return sheets;
}

template <int Dim>
std::vector<typename Strata<Dim>::Sheet> Strata<Dim>::sheets_of_edge(const Mesh<Dim>& mesh, const EdgeKey& edge) const {
  std::vector<Sheet> sheets;
  if (vertices_[edge[0]] == Stratum::volume || vertices_[edge[1]] == Stratum::volume) return sheets;
  for (const FacetId f : mesh.facets_of(edge[0]))
    if (holds(mesh.facet(f), edge[1])) sheets.push_back({mesh.facet(f), patches_[f], true});
  if (!interfaces_.empty())
    for (const CellId c : mesh.cells_of_edge(edge)) append_interfaces(mesh.cell(c), edge, sheets);
  return sheets;
}

template <int Dim>
Stratum Strata<Dim>::edge(const Mesh<Dim>& mesh, const EdgeKey& edge) const {
  const auto sheets = sheets_of_edge(mesh, edge);
  if (sheets.empty()) return Stratum::volume;
  if constexpr (Dim == 2) return Stratum::surface;
  const auto boundary = std::count_if(sheets.begin(), sheets.end(), [](const Sheet& s) { return s.is_boundary; });
  if (boundary != 0 && boundary != 2) return Stratum::non_manifold;
  return sheets.size() == 2 && sheets[0].patch == sheets[1].patch ? Stratum::surface : Stratum::feature;
}

template <int Dim>
std::vector<VertexId> Strata<Dim>::feature_neighbours(const Mesh<Dim>& mesh, VertexId v) const {
  std::vector<VertexId> ends;
  if constexpr (Dim == 3) {
    std::vector<VertexId> around;
    for (const Sheet& sheet : sheets_of(mesh, v))
      for (const int w : sheet.vertices)
        if (w != v && std::find(around.begin(), around.end(), w) == around.end()) around.push_back(w);
    for (const int w : around)
      if (edge(mesh, edge_key(v, w)) >= Stratum::feature) ends.push_back(w);
  }
  return ends;
}

template <int Dim>
Mat<Dim> Strata<Dim>::tangent_projector(const Mesh<Dim>& mesh, VertexId v) const {
  switch (vertices_[v]) {
    case Stratum::volume:
      return Mat<Dim>::Identity();
    case Stratum::surface: {
      const Vec<Dim>& normal = planes_[sheets_of(mesh, v)[0].patch].normal;
      return Mat<Dim>::Identity() - normal * normal.transpose();
    }
    case Stratum::feature: {
      const auto ends = feature_neighbours(mesh, v);
      ITR_CHECK(ends.size() == 2, v, ends.size());
      const Vec<Dim> along = (mesh.rest(ends[1]) - mesh.rest(ends[0])).normalized();
      return along * along.transpose();
    }
    default:
      return Mat<Dim>::Zero();
  }
}

template <int Dim>
void Strata<Dim>::follow(const Edit<Dim>& edit, VertexId created) {
  const auto resolved = [&](Facet facet) {
    for (int& v : facet)
      if (v == kNewVertex) v = created;
    return ascending(facet);
  };
  if (created != kNone) {  // a split: the new vertex is what its edge was
    const std::size_t boundary = edit.removed_facets.size(), all = boundary + edit.removed_interfaces.size();
    Stratum stratum = all == 0 ? Stratum::volume : Dim == 2 ? Stratum::surface : Stratum::feature;
    if (Dim == 3 && boundary != 0 && boundary != 2) stratum = Stratum::non_manifold;
    if (Dim == 3 && all == 2 && stratum == Stratum::feature) {
      const auto patch_at = [&](std::size_t i) {
        return i < boundary ? patches_[edit.removed_facets[i]] : interface_patch(edit.removed_interfaces[i - boundary]);
      };
      if (patch_at(0) == patch_at(1)) stratum = Stratum::surface;
    }
    if (edit.value->tag != kNoTag && stratum != Stratum::non_manifold) stratum = Stratum::corner;
    vertices_.push_back(stratum);
  }
  add_nodes(static_cast<int>(edit.inserted_nodes.size()));
  for (const auto& facet : edit.inserted_facets) {
    ITR_CHECK(facet.parent != kNone, patches_.size());
    patches_.push_back(patches_[facet.parent]);
  }
  std::vector<std::pair<Facet, int>> inserted;
  for (const auto& facet : edit.inserted_interfaces)
    inserted.emplace_back(resolved(facet.vertices), interface_patch(facet.parent));
  for (const Facet& facet : edit.removed_interfaces) interfaces_.erase(ascending(facet));
  for (const auto& [facet, patch] : inserted) interfaces_[facet] = patch;
}

template <int Dim>
void Strata<Dim>::compact(const MeshRenumbering& map) {
  const auto is_kept = [](VertexId v) { return v != kNone; };
  std::vector<Stratum> vertices(std::count_if(map.vertex.begin(), map.vertex.end(), is_kept));
  for (std::size_t v = 0; v < map.vertex.size(); ++v)
    if (is_kept(map.vertex[v])) vertices[map.vertex[v]] = vertices_[v];
  std::vector<int> patches;
  for (std::size_t f = 0; f < map.facet.size(); ++f)
    if (map.facet[f] != kNone) patches.push_back(patches_[f]);
  decltype(interfaces_) interfaces;
  for (const auto& [vertices, patch] : interfaces_) {
    Facet facet = vertices;
    for (int& v : facet) v = map.vertex[v];
    interfaces[ascending(facet)] = patch;
  }
  vertices_ = std::move(vertices);
  patches_ = std::move(patches);
  interfaces_ = std::move(interfaces);
}

template <int Dim>
std::string Strata<Dim>::find_misfit(const Mesh<Dim>& mesh) const {
  if (static_cast<int>(vertices_.size()) != mesh.node_slots()) return "wrong number of vertices";
  if (static_cast<int>(patches_.size()) != mesh.facet_slots()) return "wrong number of facets";
  std::size_t interfaces = 0;
  for (const auto& sheet : find_sheets(mesh)) {
    const int patch = sheet.facet == kNone ? interface_patch(sheet.vertices) : patches_[sheet.facet];
    interfaces += sheet.facet == kNone;
    if (patch < 0 || patch >= num_patches()) return "a facet without a patch at vertex " + std::to_string(sheet.vertices[0]);
  }
  if (interfaces != interfaces_.size()) return "interface facets that are not in the mesh";
  for (const VertexId v : mesh.live_vertices()) {
    const bool held = mesh.is_boundary(v) || mesh.is_on_interface(v) || mesh.cells_of(v).empty();
    if (held != (vertices_[v] != Stratum::volume)) return "stratum of vertex " + std::to_string(v);
  }
  return {};
}

template <int Dim>
std::string Strata<Dim>::find_defect(const Mesh<Dim>& mesh) const {
  if (std::string misfit = find_misfit(mesh); !misfit.empty()) return misfit;
  for (const auto& sheet : find_sheets(mesh)) {
    const Plane& plane = planes_[sheet.facet == kNone ? interface_patch(sheet.vertices) : patches_[sheet.facet]];
    for (const int v : sheet.vertices)
      if (!(std::abs((mesh.rest(v) - plane.point).dot(plane.normal)) <= 2 * tolerance_))
        return "a vertex off the plane of its patch: " + std::to_string(v);
    if (!(sheet.normal.dot(plane.normal) > 0))
      return "a facet folded over in its patch at vertex " + std::to_string(sheet.vertices[0]);
  }
  return {};
}

template class Strata<2>;
template class Strata<3>;

}  // namespace itr
