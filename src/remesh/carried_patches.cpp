// SPDX-License-Identifier: MIT
#include "remesh/carried_patches.hpp"

#include <algorithm>
#include <map>
#include <numbers>
#include <utility>

#include "energy/elastic/patched_volume.hpp"
#include "energy/elastic/strain.hpp"
#include "geometry/intersection.hpp"
#include "geometry/measures.hpp"
#include "remesh/edits.hpp"

namespace itr {

namespace {

/// Moments of a function that times the radius is linear, with these products at corners.
template <int Dim>
ElementMoments<Dim> turned_moments(const Vec<Dim + 1>& f, double area) {
  const double factor = 2 * std::numbers::pi * area;
  ElementMoments<Dim> moments{factor * f.mean()};
  moments.first = factor / ((Dim + 1) * (Dim + 2)) * (f.template tail<Dim>().array() - f.mean());
  return moments;
}

/// Moments of J - 1. In a turned cell J R - R is linear: det F in the plane times r, less R.
template <int Dim>
ElementMoments<Dim> change_in(const Mesh<Dim>& mesh, CellId c, const VectorX& x) {
  const auto& cell = mesh.cell(c);
  const auto u = [&](VertexId v) -> Vec<Dim> { return x.segment<Dim>(Dim * v) - mesh.rest(v); };
  Mat<Dim> edges;
  const Vec<Dim> first = u(cell[0]);
  for (int k = 0; k < Dim; ++k) edges.col(k) = u(cell[k + 1]) - first;
  const Mat<Dim> G = edges * mesh.inverse_rest_edges(c);
  const double change = G.trace() + sum_of_minors(G);
  if (!mesh.is_axisymmetric()) return {mesh.volume(c) * change};
  Vec<Dim + 1> f;
  for (int k = 0; k <= Dim; ++k) f[k] = change * x[Dim * cell[k]] + u(cell[k])[0];
  return turned_moments<Dim>(f, mesh.volume(c));
}

/// Moments of 1.
template <int Dim>
ElementMoments<Dim> size_of(const Mesh<Dim>& mesh, CellId c) {
  if (!mesh.is_axisymmetric()) return {mesh.volume(c)};
  Vec<Dim + 1> R;
  for (int k = 0; k <= Dim; ++k) R[k] = mesh.rest(mesh.cell(c)[k])[0];
  return turned_moments<Dim>(R, mesh.volume(c));
}

/// A linear function of these values at corners.
template <int Dim>
typename SharedPatches<Dim>::Share linear_share(int patch, const Vec<Dim + 1>& at_corners) {
  return {patch, at_corners.mean(), at_corners.template tail<Dim>().array() - at_corners[0]};
}
template <int Dim>
Vec<Dim + 1> at_corners(const typename SharedPatches<Dim>::Share& share) {
  Vec<Dim + 1> values;
  values[0] = share.weight - share.lean.sum() / (Dim + 1);
  values.template tail<Dim>() = share.lean.array() + values[0];
  return values;
}

template <int Dim>
Simplex<Dim> simplex_of(const Mesh<Dim>& mesh, CellId c) {
  std::array<Vec<Dim>, Dim + 1> p;
  for (int k = 0; k <= Dim; ++k) p[k] = mesh.rest(mesh.cell(c)[k]);
  return Simplex<Dim>(p);
}
template <int Dim>
Simplex<Dim> simplex_after(const Mesh<Dim>& mesh, const Edit<Dim>& edit, std::size_t i) {
  std::array<Vec<Dim>, Dim + 1> p;
  for (int k = 0; k <= Dim; ++k) p[k] = rest_after(mesh, edit, edit.inserted_cells[i].vertices[k]);
  return Simplex<Dim>(p);
}

/// Means over a cell of weights on cells that cover it, or, where these are turned, the linear functions with the same
/// integrals times linear functions: J R is one.
template <int Dim>
class ShareProjection {
 public:
  using Share = typename SharedPatches<Dim>::Share;

  explicit ShareProjection(bool is_turned) : is_turned_(is_turned) {}
  void add(const std::vector<Share>& shares, const OverlapIntegrals<Dim>& overlap) {
    const double volume = overlap.volume();
    covered_ += volume;
    for (const Share& share : shares) {
      const auto same = std::ranges::find(found_, share.patch, &Share::patch);
      const std::size_t i = static_cast<std::size_t>(same - found_.begin());
      if (same == found_.end()) {
        found_.push_back({share.patch, 0});
        moments_.push_back(Vec<Dim + 1>::Zero());
      }
      found_[i].weight += share.weight * volume;
      if (is_turned_) moments_[i] += overlap.ab * at_corners<Dim>(share);
    }
  }
  std::vector<Share> shares() {
    for (std::size_t i = 0; i < found_.size(); ++i) {
      if (is_turned_) {
        const Vec<Dim + 1> centred = moments_[i].array() - moments_[i].sum() / (Dim + 2);
        found_[i] = linear_share<Dim>(found_[i].patch, (Dim + 1) * (Dim + 2) / covered_ * centred);
      } else {
        found_[i].weight /= covered_;
      }
    }
    return std::move(found_);
  }

 private:
  bool is_turned_;
  double covered_ = 0;
  std::vector<Share> found_;
  std::vector<Vec<Dim + 1>> moments_;  ///< of these: integrals times shape functions of the cell
};

}  // namespace

bool any_averages_volume(const std::map<int, Material>& materials) {
  return std::ranges::any_of(materials, [](const auto& entry) { return entry.second.volume == VolumeForm::patches; });
}

template <int Dim>
CarriedPatches<Dim>::CarriedPatches(const Mesh<Dim>& mesh, const VectorX& x, const std::map<int, Material>& materials)
    : shares_(mesh.cell_slots()), change_(mesh.cell_slots()), size_(mesh.cell_slots()) {
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
    change_[c] = change_in(mesh, c, x);
    size_[c] = size_of(mesh, c);
    add(c, 1, 0);
  }
}

template <int Dim>
bool CarriedPatches<Dim>::act_in(std::span<const CellId> cells) const {
  return std::ranges::any_of(cells, [&](CellId c) { return !shares_[c].empty(); });
}

template <int Dim>
void CarriedPatches<Dim>::add(CellId c, double sign, unsigned commit) {
  for (const Share& share : shares_[c]) {
    total_[share.patch] += sign * share.integral(change_[c]);
    written_[share.patch] = commit;
  }
}

/// The weights in a half of a cell that a split makes.
template <int Dim>
typename CarriedPatches<Dim>::Shares CarriedPatches<Dim>::halved(const Mesh<Dim>& mesh, const Edit<Dim>& edit,
                                                                 std::size_t i) const {
  const CellId whole = edit.removed_cells[i / 2];
  Shares shares = shares_[whole];
  if (!mesh.is_axisymmetric() || shares.size() < 2) return shares;
  const Simplex<Dim> before = simplex_of(mesh, whole), half = simplex_after(mesh, edit, i);
  for (Share& share : shares) {
    const Vec<Dim + 1> values = at_corners<Dim>(share);
    Vec<Dim + 1> of_half;
    for (int k = 0; k <= Dim; ++k) of_half[k] = before.barycentric(half.corners[k]).dot(values);
    share = linear_share<Dim>(share.patch, of_half);
  }
  return shares;
}

template <int Dim>
std::vector<typename CarriedPatches<Dim>::Shares> CarriedPatches<Dim>::shares_after(const Mesh<Dim>& mesh,
                                                                                    const Edit<Dim>& edit) const {
  using Kind = typename Edit<Dim>::Kind;
  std::vector<Shares> after(edit.inserted_cells.size());
  if (!act_in(edit.removed_cells)) return after;
  if (edit.kind == Kind::split) {
    for (std::size_t i = 0; i < after.size(); ++i) after[i] = halved(mesh, edit, i);
    return after;
  }
  std::vector<Simplex<Dim>> old_cells;
  for (const CellId c : edit.removed_cells) old_cells.push_back(simplex_of(mesh, c));
  for (std::size_t i = 0; i < after.size(); ++i) {
    const Simplex<Dim> here = simplex_after(mesh, edit, i);
    ShareProjection<Dim> projection(mesh.is_axisymmetric());
    OverlapIntegrals<Dim> overlap;
    for (std::size_t j = 0; j < old_cells.size(); ++j) {
      const CellId c = edit.removed_cells[j];
      if (mesh.body(c) == edit.inserted_cells[i].body && !shares_[c].empty() &&
          integrate_overlap(here, old_cells[j], overlap))
        projection.add(shares_[c], overlap);
    }
    after[i] = projection.shares();
  }
  return after;
}

template <int Dim>
std::shared_ptr<const SharedPatches<Dim>> CarriedPatches<Dim>::in(const CellSet<Dim>& cells,
                                                                  const std::vector<Shares>& inserted,
                                                                  std::span<const CellId> before,
                                                                  std::span<const CellId> star) const {
  std::map<int, int> number;  // by patch
  for (const CellId c : before)
    for (const Share& share : shares_[c]) number[share.patch] = 0;
  if (number.empty()) return nullptr;
  std::map<int, double> left, of_star;  // volumes by patch, and by body
  for (const auto& [id, _] : number) left[id] = volume_[id];
  for (const CellId c : star)
    for (const Share& share : shares_[c]) {
      const double volume = share.integral(size_[c]);
      left[share.patch] -= volume;
      of_star[body_[share.patch]] += volume;
    }
  const auto patches = std::make_shared<SharedPatches<Dim>>();
  const auto add_patch = [&](int body, double volume, double outside) {
    patches->body.push_back(body);
    patches->volume.push_back(volume);
    patches->outside.push_back(outside);
    return static_cast<int>(patches->body.size()) - 1;
  };
  constexpr double kNothing = 1e-9;  // of a patch
  std::map<int, int> new_of;
  for (auto& [id, at] : number) at = left[id] > kNothing * volume_[id] ? add_patch(body_[id], left[id], total_[id]) : kNone;
  for (const auto& [body, volume] : of_star) new_of[body] = add_patch(body, volume, 0);
  for (const CellId c : before)
    for (const Share& share : shares_[c])
      if (const int at = number.at(share.patch); at != kNone) patches->outside[at] -= share.integral(change_[c]);
  std::size_t next = 0;
  for (std::size_t e = 0; e < cells.elements.size(); ++e) {
    const CellId c = cells.elements[e].cell;
    const Shares& of_cell = c == kNone ? inserted[next++] : shares_[c];
    const bool is_of_star = !star.empty() && (c == kNone || std::ranges::count(star, c) > 0);
    if (is_of_star && !of_cell.empty())
      patches->shares.push_back({new_of.at(cells.elements[e].body), 1});
    else
      for (const Share& share : of_cell)
        if (const int at = number.at(share.patch); at != kNone) patches->shares.push_back({at, share.weight, share.lean});
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
  change_.resize(mesh.cell_slots());
  size_.resize(mesh.cell_slots());
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
    change_[c] = change_in(mesh, c, x);
    size_[c] = size_of(mesh, c);
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
