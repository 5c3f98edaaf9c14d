// SPDX-License-Identifier: MIT
#include "remesh/carried_patches.hpp"

#include <algorithm>
#include <utility>

#include "energy/elastic/patched_volume.hpp"
#include "energy/elastic/strain.hpp"
#include "geometry/intersection.hpp"
#include "geometry/measures.hpp"
#include "remesh/edits.hpp"

namespace itr {

namespace {

template <int Dim>
double integral_of_change(const Mesh<Dim>& mesh, CellId c, const VectorX& x) {
  const auto& cell = mesh.cell(c);
  const auto u = [&](VertexId v) -> Vec<Dim> { return x.segment<Dim>(Dim * v) - mesh.rest(v); };
  Mat<Dim> edges;
  const Vec<Dim> first = u(cell[0]);
  for (int k = 0; k < Dim; ++k) edges.col(k) = u(cell[k + 1]) - first;
  const Mat<Dim> G = edges * mesh.inverse_rest_edges(c);
  return mesh.volume(c) * (G.trace() + sum_of_minors(G));
}

template <typename Shares>
void add_share(int patch, double weight, Shares& shares) {
  const auto same = std::ranges::find_if(shares, [&](const auto& share) { return share.patch == patch; });
  if (same == shares.end())
    shares.push_back({patch, weight});
  else
    same->weight += weight;
}

}  // namespace

bool any_averages_volume(const std::map<int, Material>& materials) {
  return std::ranges::any_of(materials, [](const auto& entry) { return entry.second.volume == VolumeForm::patches; });
}

template <int Dim>
CarriedPatches<Dim>::CarriedPatches(const Mesh<Dim>& mesh, const VectorX& x, const std::map<int, Material>& materials)
    : shares_(mesh.cell_slots()), change_(mesh.cell_slots(), 0.0) {
  CellSet<Dim> cells = whole_mesh(mesh, {});
  add_patches(materials, cells);
  if (!cells.patches) return;
  body_ = cells.patches->body;
  volume_ = cells.patches->volume;
  total_.assign(volume_.size(), 0);
  written_.assign(volume_.size(), 0);
  for (std::size_t e = 0; e < cells.elements.size(); ++e) {
    const CellId c = cells.elements[e].cell;
    const int patch = cells.patches->patch_of[e][VolumePatches<Dim>::kLeft];
    if (patch == kNone) continue;
    shares_[c] = {{patch, 1.0}};
    change_[c] = integral_of_change(mesh, c, x);
    add(c, 1, 0);
  }
}

template <int Dim>
bool CarriedPatches<Dim>::act_in(std::span<const CellId> cells) const {
  return std::ranges::any_of(cells, [&](CellId c) { return !shares_[c].empty(); });
}

template <int Dim>
void CarriedPatches<Dim>::add(CellId c, double sign, unsigned commit) {
  for (const auto& [patch, weight] : shares_[c]) {
    total_[patch] += sign * weight * change_[c];
    written_[patch] = commit;
  }
}

template <int Dim>
std::vector<typename CarriedPatches<Dim>::Shares> CarriedPatches<Dim>::shares_after(const Mesh<Dim>& mesh,
                                                                                    const Edit<Dim>& edit) const {
  using Kind = typename Edit<Dim>::Kind;
  std::vector<Shares> after(edit.inserted_cells.size());
  if (!act_in(edit.removed_cells)) return after;
  if (edit.kind == Kind::split) {
    for (std::size_t i = 0; i < after.size(); ++i) after[i] = shares_[edit.removed_cells[i / 2]];
    return after;
  }
  std::vector<Simplex<Dim>> old_cells;
  for (const CellId c : edit.removed_cells) {
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = mesh.rest(mesh.cell(c)[k]);
    old_cells.emplace_back(p);
  }
  for (std::size_t i = 0; i < after.size(); ++i) {
    const auto& cell = edit.inserted_cells[i];
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = rest_after(mesh, edit, cell.vertices[k]);
    const Simplex<Dim> here(p);
    OverlapIntegrals<Dim> overlap;
    double covered = 0;
    for (std::size_t j = 0; j < old_cells.size(); ++j) {
      const CellId c = edit.removed_cells[j];
      if (mesh.body(c) != cell.body || shares_[c].empty() || !integrate_overlap(here, old_cells[j], overlap)) continue;
      covered += overlap.volume();
      for (const auto& [patch, weight] : shares_[c]) add_share(patch, weight * overlap.volume(), after[i]);
    }
    for (Share& share : after[i]) share.weight /= covered;
  }
  return after;
}

template <int Dim>
std::shared_ptr<const SharedPatches<Dim>> CarriedPatches<Dim>::in(const CellSet<Dim>& cells,
                                                                  const std::vector<Shares>& inserted,
                                                                  std::span<const CellId> before) const {
  std::vector<int> ids;  // of patches, ascending
  for (const CellId c : before)
    for (const Share& share : shares_[c]) ids.push_back(share.patch);
  if (ids.empty()) return nullptr;
  std::ranges::sort(ids);
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  const auto number = [&](int id) { return static_cast<int>(std::ranges::lower_bound(ids, id) - ids.begin()); };

  const auto patches = std::make_shared<SharedPatches<Dim>>();
  for (const int id : ids) {
    patches->body.push_back(body_[id]);
    patches->volume.push_back(volume_[id]);
    patches->outside.push_back(total_[id]);
  }
  for (const CellId c : before)
    for (const auto& [patch, weight] : shares_[c]) patches->outside[number(patch)] -= weight * change_[c];
  std::size_t next = 0;
  for (std::size_t e = 0; e < cells.elements.size(); ++e) {
    const CellId c = cells.elements[e].cell;
    for (const auto& [id, weight] : c == kNone ? inserted[next++] : shares_[c])
      patches->shares.push_back({number(id), weight});
    patches->first_share.push_back(patches->shares.size());
  }
  patches->list_members(cells);
  return patches;
}

template <int Dim>
void CarriedPatches<Dim>::follow(const Mesh<Dim>& mesh, const Edit<Dim>& edit, std::vector<Shares> inserted,
                                 std::span<const CellId> new_cells, std::span<const VertexId> moved, const VectorX& x,
                                 unsigned commit) {
  for (const CellId c : edit.removed_cells) {
    add(c, -1, commit);
    shares_[c].clear();
  }
  shares_.resize(mesh.cell_slots());
  change_.resize(mesh.cell_slots(), 0);
  for (std::size_t i = 0; i < new_cells.size(); ++i) shares_[new_cells[i]] = std::move(inserted[i]);
  std::vector<CellId> changed(new_cells.begin(), new_cells.end());
  for (const VertexId v : moved) {
    const auto around = mesh.cells_of(v);
    changed.insert(changed.end(), around.begin(), around.end());
  }
  std::ranges::sort(changed);
  changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
  for (const CellId c : changed) {
    if (shares_[c].empty()) continue;
    if (!std::ranges::count(new_cells, c)) add(c, -1, commit);
    change_[c] = integral_of_change(mesh, c, x);
    add(c, 1, commit);
  }
}

template <int Dim>
bool CarriedPatches<Dim>::was_written(CellId c, unsigned since) const {
  return std::ranges::any_of(shares_[c], [&](const Share& share) { return written_[share.patch] > since; });
}

template class CarriedPatches<2>;
template class CarriedPatches<3>;

}  // namespace itr
