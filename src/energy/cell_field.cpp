// SPDX-License-Identifier: MIT
#include "cell_field.hpp"

#include <Eigen/LU>
#include <algorithm>

namespace itr {

namespace {
constexpr int kSampleDegree = 4;
}

template <int Dim>
CellField<Dim>::CellField(const Mesh<Dim>& mesh, double t, std::vector<Records> by_cell)
    : rest_(mesh.rest().begin(), mesh.rest().begin() + mesh.num_vertices()), t_(t), by_cell_(std::move(by_cell)) {
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    cells_.push_back(mesh.cell(c));
    body_.push_back(mesh.body(c));
  }
}

/// Whether an element is a cell of the field's mesh.
template <int Dim>
bool CellField<Dim>::has(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element) const {
  if (element.cell < 0 || element.cell >= static_cast<int>(cells_.size()) || body_[element.cell] != element.body)
    return false;
  for (int k = 0; k <= Dim; ++k)
    if (rest_[cells_[element.cell][k]] != cells.rest[element.vertices[k]]) return false;
  return true;
}

template <int Dim>
const Locator<Dim>& CellField<Dim>::locator() const {
  std::call_once(once_, [this] { locator_ = std::make_unique<Locator<Dim>>(Mesh<Dim>(rest_, cells_, body_)); });
  return *locator_;
}

template <int Dim>
std::array<double, Dim + 1> CellField<Dim>::weights_in(CellId c, const Vec<Dim>& X) const {
  const auto& vertices = cells_[c];
  Mat<Dim> edges;
  for (int k = 0; k < Dim; ++k) edges.col(k) = rest_[vertices[k + 1]] - rest_[vertices[0]];
  return barycentric_weights<Dim>(rest_[vertices[0]], Mat<Dim>(edges.inverse()), X);
}

template <int Dim>
typename CellField<Dim>::Records CellField<Dim>::on(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element,
                                                    VectorX* variance) const {
  if (has(cells, element)) return by_cell_[element.cell];
  const auto& rule = quadrature<Dim>(kSampleDegree);
  std::vector<CellId> found;
  for (const auto& point : rule)
    found.push_back(locator().find(rest_position<Dim>(cells, element, point.weights), element.body).cell);
  Records records;
  if (std::ranges::all_of(found, [&](CellId c) { return c == found[0]; })) {
    const Records& whole = by_cell_[found[0]];
    records.resize(whole.rows(), Dim + 1);
    for (int k = 0; k <= Dim; ++k)
      records.col(k) = whole * weights_of(weights_in(found[0], cells.rest[element.vertices[k]]));
    return records;
  }
  Records moments = Records::Zero(by_cell_[found[0]].rows(), Dim + 1);
  MatrixX values(moments.rows(), static_cast<Eigen::Index>(rule.size()));
  for (std::size_t q = 0; q < rule.size(); ++q) {
    const Vec<Dim> X = rest_position<Dim>(cells, element, rule[q].weights);
    const auto column = static_cast<Eigen::Index>(q);
    values.col(column) = by_cell_[found[q]] * weights_of(weights_in(found[q], X));
    moments += rule[q].fraction * values.col(column) * weights_of(rule[q].weights).transpose();
  }
  const VectorX mean = moments.rowwise().sum();
  if (is_constant(cells, element))
    records = mean.replicate(1, Dim + 1);
  else  // by the mass matrix of linear functions, (1 + delta) / ((d + 1) (d + 2))
    records = (Dim + 1) * (Dim + 2) * (moments - (mean / (Dim + 2)).replicate(1, Dim + 1));
  if (!variance) return records;
  if (variance->size() == 0) variance->setZero(mean.size());
  for (std::size_t q = 0; q < rule.size(); ++q)
    *variance +=
        rule[q].fraction * (values.col(static_cast<Eigen::Index>(q)) - records * weights_of(rule[q].weights)).cwiseAbs2();
  return records;
}

/// Inverts the matrix of the points' weights: of each point one weight is larger than the others.
template <int Dim>
typename CellField<Dim>::Records at_vertices(const typename CellField<Dim>::Records& at_points, int points) {
  if (points == 1) return at_points.col(0).replicate(1, Dim + 1);
  const auto& rule = quadrature<Dim>(kStateDegree);
  Mat<Dim + 1> weights;
  for (int q = 0; q <= Dim; ++q) weights.col(q) = weights_of(rule[static_cast<std::size_t>(q)].weights);
  return at_points * weights.inverse();
}

#define ITR_INSTANTIATE(Dim)     \
  template class CellField<Dim>; \
  template typename CellField<Dim>::Records at_vertices<Dim>(const typename CellField<Dim>::Records&, int);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
