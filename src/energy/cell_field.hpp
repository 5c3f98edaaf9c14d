// SPDX-License-Identifier: MIT
// The state of bodies that remember, as a field over their rest shape, and the points at which it is known.
#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "core/cell_history.hpp"
#include "core/parallel_reduce.hpp"
#include "energy/elastic/turned.hpp"
#include "fem/cell_set.hpp"
#include "fem/locator.hpp"
#include "fem/quadrature.hpp"

namespace itr {

inline constexpr int kStateDegree = 2;  ///< of the rule of the points at which a state becomes known

/// Records at one time, linear on each cell: constant on straight cells that are not turned.
template <int Dim>
class CellField : public CellHistory {
 public:
  using Records = Eigen::Matrix<double, Eigen::Dynamic, Dim + 1>;  ///< at the vertices of a cell; no rows: it has no state

  /// `by_cell` of a compact mesh.
  CellField(const Mesh<Dim>& mesh, double t, std::vector<Records> by_cell);
  double time() const { return t_; }
  const std::vector<Records>& by_cell() const { return by_cell_; }
  /// Records on an element of any mesh of the bodies: restricted exactly to one inside of a cell, else the nearest in L2.
  /// Adds to `variance` by record what that leaves out, the mean of the squares.
  Records on(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element, VectorX* variance = nullptr) const;

 private:
  bool has(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element) const;
  const Locator<Dim>& locator() const;
  std::array<double, Dim + 1> weights_in(CellId c, const Vec<Dim>& X) const;

  std::vector<Vec<Dim>> rest_;
  std::vector<std::array<VertexId, Dim + 1>> cells_;
  std::vector<int> body_;
  double t_;
  std::vector<Records> by_cell_;
  mutable std::once_flag once_;
  mutable std::unique_ptr<Locator<Dim>> locator_;
};

/// Records at the vertices of a cell by those at its points of kStateDegree, or at its one point: the first `points`
/// columns.
template <int Dim>
typename CellField<Dim>::Records at_vertices(const typename CellField<Dim>::Records& at_points, int points);

/// State and energies [J] at the end of a step.
struct HistoryEnd {
  std::shared_ptr<const CellHistory> state;
  double dissipation = 0;
  double loss = 0;  ///< by projection to the mesh
};

template <int LawDim>
Mat<3> gradient_in_space(const Mat<LawDim>& G) {
  Mat<3> all = Mat<3>::Zero();
  all.template topLeftCorner<LawDim, LawDim>() = G;
  return all;
}

template <int Dim>
Vec<3> point_in_space(const Vec<Dim>& X) {
  Vec<3> all = Vec<3>::Zero();
  all.template head<Dim>() = X;
  return all;
}

template <int Dim>
bool is_constant(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element) {
  return element.curved == 0 && !cells.axisymmetric;
}

/// f(site) for the points of an element by a rule, or for its barycenter where F is the same everywhere.
template <int Dim, typename F>
void visit_sites(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element, int degree, const F& f) {
  const auto& rule = quadrature<Dim>(is_constant(cells, element) ? 1 : degree);
  for (const auto& point : rule) {
    if constexpr (Dim == 2)
      if (cells.axisymmetric) {
        f(ElasticSite<2, 3>(cells, element, point));
        continue;
      }
    f(ElasticSite<Dim, Dim>(cells, element, point));
  }
}

template <std::size_t Columns>
auto weights_of(const std::array<double, Columns>& weights) {
  return Eigen::Map<const Vec<static_cast<int>(Columns)>>(weights.data());
}

/// The state of a mesh at a time t: of cells whose body has one by `update(cells, element, records)`, which returns their
/// dissipation and loss.
template <int Dim, typename HasState, typename Update>
HistoryEnd update_cells(const Mesh<Dim>& mesh, double t, const HasState& has_state, const Update& update) {
  constexpr std::size_t kElements = 64;  // of a task
  const CellSet<Dim> cells = whole_mesh(mesh, {});
  std::vector<typename CellField<Dim>::Records> by_cell(cells.elements.size());
  std::vector<std::array<double, 2>> lost(cells.elements.size());
  parallel_blocks(cells.elements.size(), kElements, [&](std::size_t first, std::size_t last) {
    for (std::size_t e = first; e < last; ++e) {
      const auto& element = cells.elements[e];
      if (has_state(element.body)) lost[e] = update(cells, element, by_cell[static_cast<std::size_t>(element.cell)]);
    }
  });
  HistoryEnd end;
  for (const auto& [dissipation, loss] : lost) {
    end.dissipation += dissipation;
    end.loss += loss;
  }
  end.state = std::make_shared<CellField<Dim>>(mesh, t, std::move(by_cell));
  return end;
}

}  // namespace itr
