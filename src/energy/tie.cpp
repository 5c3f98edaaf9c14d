// SPDX-License-Identifier: MIT
#include "energy/tie.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "fem/cell_set.hpp"
#include "fem/locator.hpp"
#include "geometry/bvh.hpp"

namespace itr {

namespace {

constexpr double kStiffness = 1e4;     ///< of a tie by that of the cells beside it
constexpr double kLargestRatio = 1e3;  ///< of the stiffness at constant width to Young's modulus, which ties follow
constexpr double kRoundOff = 1e-13;    ///< of the positions, at rest and now: smaller gaps are none

/// The stiffness by volume that a row's condition works against, of the softer side [N/m^Dim].
template <int Dim>
double stiffness_beside(const MortarRow<Dim>& row, const std::map<int, Material>& materials, bool has_inertia,
                        double scale) {
  double least = std::numeric_limits<double>::infinity();
  for (const int body : row.bodies) {
    const Material& material = materials.at(body);
    const double E = material.youngs_modulus, confined = material.lame_lambda(Dim) + 2 * material.lame_mu();
    double stiffness = std::clamp(confined, E, kLargestRatio * E) / row.length;
    if (has_inertia) stiffness += material.density * row.length / scale;
    least = std::min(least, stiffness);
  }
  return least;
}

/// Multipliers on the facets of a mortar's side 0, linear on each.
template <int Dim>
class MultiplierField {
 public:
  struct Facet {
    Vec<Dim> origin;  ///< of the cell
    Mat<Dim> inverse_edges;
    std::array<int, Dim> corners;  ///< the facet's in the cell
    std::array<Vec<Dim>, Dim> values;
  };
  MultiplierField(std::vector<Facet> facets, std::span<const Box<Dim>> boxes) : facets_(std::move(facets)), tree_(boxes) {}
  /// Zero where no facet is.
  Vec<Dim> operator()(const Vec<Dim>& X) const {
    constexpr double kOutside = -1e-6;
    std::vector<int> hits;
    tree_.query({X, X}, hits);
    std::sort(hits.begin(), hits.end());
    double best = kOutside;
    Vec<Dim> value = Vec<Dim>::Zero();
    for (const int f : hits) {
      const Facet& facet = facets_[f];
      const auto weights = barycentric_weights<Dim>(facet.origin, facet.inverse_edges, X);
      double least = std::numeric_limits<double>::infinity();
      Vec<Dim> here = Vec<Dim>::Zero();
      for (int k = 0; k < Dim; ++k) {
        least = std::min(least, weights[facet.corners[k]]);
        here += weights[facet.corners[k]] * facet.values[k];
      }
      if (least <= best) continue;
      best = least;
      value = here;
    }
    return value;
  }

 private:
  std::vector<Facet> facets_;
  Bvh<Dim> tree_;
};

}  // namespace

template <int Dim>
TieEnergy<Dim>::TieEnergy(const CellSet<Dim>& cells, const std::vector<Mortar<Dim>>& mortars,
                          const std::map<int, Material>& materials, bool has_inertia, double scale)
    : cells_(cells), mortars_(mortars), rest_(rest_positions<Dim>(cells)), scale_(scale) {
  extent_ = rest_.cwiseAbs().maxCoeff();
  for (const auto& mortar : mortars)
    for (const auto& row : mortar.rows)
      rows_.push_back({&row, &mortar, kStiffness * stiffness_beside(row, materials, has_inertia, scale), Vec<Dim>::Zero(),
                       Vec<Dim>::Zero(), Vec<Dim>::Zero()});
}

template <int Dim>
Vec<Dim> TieEnergy<Dim>::jump(const MortarRow<Dim>& row, ConstVectorView field) {
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (std::size_t i = 0; i < row.nodes.size(); ++i) sum += row.weights[i] * field.segment<Dim>(Dim * row.nodes[i]);
  for (int c = 0; c < Dim; ++c)
    if (!row.components[c]) sum[c] = 0;
  return sum;
}

template <int Dim>
Vec<Dim> TieEnergy<Dim>::gap(const Row& row, ConstVectorView x) const {
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (std::size_t i = 0; i < row.of->nodes.size(); ++i) {
    const int at = Dim * row.of->nodes[i];
    sum += row.of->weights[i] * (x.segment<Dim>(at) - rest_.segment<Dim>(at));
  }
  for (int c = 0; c < Dim; ++c)
    if (!row.of->components[c]) sum[c] = 0;
  return sum - row.target;
}

template <int Dim>
Vec<Dim> TieEnergy<Dim>::gap(const Row& row, const Increment& at) const {
  return row.start + jump(*row.of, at.d);
}

template <int Dim>
double TieEnergy<Dim>::value_of(const Row& row, const Vec<Dim>& gap) const {
  return scale_ * (row.multiplier.dot(gap) + factor_ * row.stiffness / row.of->measure * gap.squaredNorm() / 2);
}

template <int Dim>
void TieEnergy<Dim>::add_gradient_of(const Row& row, const Vec<Dim>& gap, VectorView gradient) const {
  const Vec<Dim> force = scale_ * traction(row, gap);
  for (std::size_t i = 0; i < row.of->nodes.size(); ++i)
    gradient.segment<Dim>(Dim * row.of->nodes[i]) += row.of->weights[i] * force;
}

template <int Dim>
double TieEnergy<Dim>::value(ConstVectorView x, Workspace&) const {
  double sum = 0;
  for (const Row& row : rows_) sum += value_of(row, gap(row, x));
  return sum;
}

template <int Dim>
void TieEnergy<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace&) const {
  for (const Row& row : rows_) add_gradient_of(row, gap(row, x), gradient);
}

template <int Dim>
double TieEnergy<Dim>::value_at(const Increment& at, Workspace&) const {
  double sum = 0;
  for (const Row& row : rows_) sum += value_of(row, gap(row, at));
  return sum;
}

template <int Dim>
void TieEnergy<Dim>::add_gradient_at(const Increment& at, VectorView gradient, Workspace&) const {
  for (const Row& row : rows_) add_gradient_of(row, gap(row, at), gradient);
}

template <int Dim>
void TieEnergy<Dim>::add_hessian(ConstVectorView, PsdProjection, HessianSink& sink, Workspace&) const {
  MatrixX block;
  for (const Row& row : rows_) {
    const auto nodes = static_cast<Eigen::Index>(row.of->nodes.size());
    const Eigen::Map<const VectorX> weights(row.of->weights.data(), nodes);
    const double stiffness = scale_ * factor_ * row.stiffness / row.of->measure;
    block.setZero(Dim * nodes, Dim * nodes);
    for (Eigen::Index i = 0; i < nodes; ++i)
      for (Eigen::Index j = 0; j < nodes; ++j)
        for (int c = 0; c < Dim; ++c)
          if (row.of->components[c]) block(Dim * i + c, Dim * j + c) = stiffness * weights[i] * weights[j];
    sink.add<Dim>(row.of->nodes, block.data());
  }
}

template <int Dim>
void TieEnergy<Dim>::set_jumps(std::span<const Tie> ties, double t) {
  for (Row& row : rows_) {
    const Tie& tie = ties[static_cast<std::size_t>(row.mortar->tie)];
    if (!tie.jump) continue;
    const Vec<Dim> jump = (row.mortar->is_own_b ? 1 : -1) * tie.jump(t).template head<Dim>();
    for (int c = 0; c < Dim; ++c)
      row.target[c] = row.of->components[c] && row.of->against == kNone ? row.of->measure * jump[c] : 0;
  }
}

template <int Dim>
void TieEnergy<Dim>::begin_at(ConstVectorView base) {
  for (Row& row : rows_) row.start = gap(row, base);
}

template <int Dim>
void TieEnergy<Dim>::add_targets(double fraction, ConstVectorView field) {
  for (Row& row : rows_) row.target += fraction * jump(*row.of, field);
}

template <int Dim>
double TieEnergy<Dim>::error_at(const Increment& at) const {
  double largest = 0, error = 0, open = 0;
  for (const Row& row : rows_) {
    const Vec<Dim> g = gap(row, at), now = traction(row, g);
    largest = std::max({largest, now.norm(), row.multiplier.norm()});
    error = std::max(error, (now - row.multiplier).norm());
    open = std::max(open, g.norm() / row.of->measure);
  }
  const double extent = std::max(extent_, at.base.lpNorm<Eigen::Infinity>());
  return open <= kRoundOff * extent || largest == 0 ? 0 : error / largest;
}

template <int Dim>
void TieEnergy<Dim>::update(const Increment& at) {
  for (Row& row : rows_) row.multiplier = traction(row, gap(row, at));
}

template <int Dim>
std::string TieEnergy<Dim>::describe(const Increment& at, const Units& units) const {
  const VectorX x = at.base + at.d;
  double largest = 0;
  for (const Row& row : rows_) largest = std::max(largest, gap(row, x).norm() / row.of->measure);
  return fmt::format("tied surfaces stay apart by {}: conditions may hold both sides in different places",
                     units.text(largest, "m", 3));
}

template <int Dim>
double TieEnergy<Dim>::largest_gap(ConstVectorView field) const {
  double largest = 0;
  for (const Row& row : rows_) largest = std::max(largest, jump(*row.of, field).norm() / row.of->measure);
  return largest;
}

template <int Dim>
std::vector<TractionOfTie<Dim>> TieEnergy<Dim>::tractions() const {
  std::vector<TractionOfTie<Dim>> tractions;
  auto row = rows_.begin();
  for (const auto& mortar : mortars_) {
    std::map<std::pair<int, int>, double> values;  // by vertex and component
    for (std::size_t i = 0; i < mortar.rows.size(); ++i, ++row)
      for (int c = 0; c < Dim; ++c)
        if (row->of->components[c]) {
          values[{row->of->vertex, c}] += row->multiplier[c];
          if (row->of->against != kNone) values[{row->of->against, c}] -= row->of->share * row->multiplier[c];
        }
    std::vector<typename MultiplierField<Dim>::Facet> facets;
    std::vector<Box<Dim>> boxes;
    for (std::size_t f = 0; f < mortar.facets.size(); ++f) {
      const auto& element = *mortar.elements[f];
      auto& facet = facets.emplace_back();
      facet.origin = cells_.rest[element.vertices[0]];
      facet.inverse_edges = element.inverse_edges;
      Box<Dim> box;
      for (int k = 0; k < Dim; ++k) {
        const int v = mortar.facets[f][k];
        facet.corners[k] = static_cast<int>(std::ranges::find(element.vertices, v) - element.vertices.begin());
        box.include(cells_.rest[v]);
      }
      for (int c = 0; c < Dim; ++c) {  // those without conditions have the mean of the others
        double sum = 0;
        int count = 0;
        for (const int v : mortar.facets[f])
          if (const auto found = values.find({v, c}); found != values.end()) sum += found->second, ++count;
        for (int k = 0; k < Dim; ++k) {
          const auto found = values.find({mortar.facets[f][k], c});
          facet.values[k][c] = found != values.end() ? found->second : count > 0 ? sum / count : 0;
        }
      }
      boxes.push_back(box.inflated(kLargestTieGap * (box.max - box.min).norm()));
    }
    const auto field = std::make_shared<MultiplierField<Dim>>(std::move(facets), boxes);
    for (int side = 0; side < 2; ++side)
      for (const int tag : mortar.tags[side])
        tractions.emplace_back(tag, [field, sign = side == 0 ? -1.0 : 1.0, shift = Vec<Dim>(side * mortar.to_own)](
                                        const RestPoint<Dim>& X) { return Vec<Dim>(sign * (*field)(X + shift)); });
  }
  return tractions;
}

template <int Dim>
std::vector<std::vector<int>> TieEnergy<Dim>::bonds() const {
  std::vector<std::vector<int>> bonds;
  for (const Row& row : rows_) bonds.push_back(row.of->nodes);
  return bonds;
}

template class TieEnergy<2>;
template class TieEnergy<3>;

}  // namespace itr
