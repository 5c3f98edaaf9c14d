// SPDX-License-Identifier: MIT
#include "simulation/shape_step.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <map>
#include <numbers>

#include "energy/inertia.hpp"
#include "geometry/measures.hpp"
#include "mesh/rest_box.hpp"
#include "simulation/moment.hpp"

namespace itr {

namespace {

template <int Dim>
constexpr int kModes = Dim == 2 ? 3 : 6;
template <int Dim>
using Momenta = Eigen::Matrix<double, kModes<Dim>, 1>;  ///< linear, then angular

/// Momenta about a point.
template <int Dim>
Momenta<Dim> momenta_at(const Vec<Dim>& x, const Vec<Dim>& about, const Vec<Dim>& p) {
  Momenta<Dim> momenta;
  momenta << p, moment(Vec<Dim>(x - about), p);
  return momenta;
}

/// Velocity of a rigid motion about a point.
Vec<2> rigid_velocity(const Momenta<2>& rate, const Vec<2>& arm) {
  return rate.head<2>() + rate[2] * Vec<2>(-arm[1], arm[0]);
}
Vec<3> rigid_velocity(const Momenta<3>& rate, const Vec<3>& arm) { return rate.head<3>() + rate.tail<3>().cross(arm); }

template <int Dim>
class Keeper {
 public:
  Keeper(const StepSetup<Dim>& setup, const State<Dim>& before, const State<Dim>& state)
      : setup_(setup), is_turned_(state.mesh.is_axisymmetric()), about_(rest_box(before.mesh).center()) {
    const MassKind kind = setup.lump_mass ? MassKind::lumped : MassKind::consistent;
    const auto make = [&](const State<Dim>& of, Side& side) {
      side.cells = whole_mesh(of.mesh, {});
      side.x = of.history.x[0];
      side.inertia.emplace(side.cells, setup.materials, kind, VectorX::Zero(Dim * Eigen::Index{of.mesh.num_nodes()}));
    };
    make(before, before_);
    make(state, after_);
  }

  /// Corrects the rate on the new mesh: that of the old one is `old_rate`, that of added pieces the i-th.
  void correct(const AddedMaterial<Dim>& added, const std::map<int, std::vector<char>>& patches, const VectorX& old_rate,
               std::size_t i, VectorX& rate) const {
    for (const auto& [body, is_free] : patches) {
      Momenta<Dim> excess = momenta(after_, body, rate) - momenta(before_, body, old_rate);
      for (const auto& piece : added.pieces)
        if (piece.body == body) excess -= momenta_of(piece, i);
      Eigen::Matrix<double, kModes<Dim>, kModes<Dim>> of_modes;
      for (int k = 0; k < kModes<Dim>; ++k)
        of_modes.col(k) = momenta(after_, body, rigid(Momenta<Dim>::Unit(k), is_free, rate.size()));
      const VectorX motion = rigid(of_modes.completeOrthogonalDecomposition().solve(excess), is_free, rate.size());
      rate -= motion;
    }
  }

 private:
  struct Side {
    CellSet<Dim> cells;
    VectorX x;
    std::optional<InertiaEnergy<Dim>> inertia;
  };

  Momenta<Dim> counted(Momenta<Dim> momenta) const {
    if (is_turned_) momenta = Momenta<Dim>::Unit(1) * momenta[1];
    return momenta;
  }
  Momenta<Dim> momenta(const Side& side, int body, const VectorX& rate) const {
    Momenta<Dim> sum = Momenta<Dim>::Zero();
    side.inertia->for_each_mass([&](int of_body, const auto& nodes, const auto& mass) {
      if (of_body != body) return;
      const auto product = (at_nodes<Dim>(nodes, rate) * mass).eval();
      for (std::size_t k = 0; k < nodes.size(); ++k)
        sum +=
            momenta_at<Dim>(side.x.template segment<Dim>(Dim * nodes[k]), about_, product.col(static_cast<Eigen::Index>(k)));
    });
    return counted(sum);
  }

  /// Momenta of a piece with linear fields.
  Momenta<Dim> momenta_of(const typename AddedMaterial<Dim>::Piece& piece, std::size_t i) const {
    const auto& rate = piece.rates[i];
    // Seen from inside, the corner that comes last lies beyond the facet.
    const double sign = Dim == 2 ? -1 : 1;
    const double mass =
        sign * edge_matrix<Dim>(piece.rest).determinant() / (Dim == 2 ? 2 : 6) * setup_.materials.at(piece.body).density;
    Momenta<Dim> sum = Momenta<Dim>::Zero();
    for (int k = 0; k <= Dim; ++k)
      for (int l = 0; l <= Dim; ++l) {
        const double share = setup_.lump_mass ? (k == l) / (Dim + 1.0) : (1.0 + (k == l)) / ((Dim + 1) * (Dim + 2));
        const double turn = is_turned_ ? 2 * std::numbers::pi * piece.rest[k][0] : 1;
        sum += turn * momenta_at<Dim>(piece.x[k], about_, mass * share * rate[l]);
      }
    return counted(sum);
  }

  VectorX rigid(const Momenta<Dim>& rate, const std::vector<char>& is_free, Eigen::Index size) const {
    VectorX motion = VectorX::Zero(size);
    const Momenta<Dim> of_modes = counted(rate);
    for (std::size_t v = 0; v < is_free.size(); ++v) {
      const auto at = Dim * static_cast<Eigen::Index>(v);
      if (is_free[v]) motion.segment<Dim>(at) = rigid_velocity(of_modes, after_.x.template segment<Dim>(at) - about_);
    }
    return motion;
  }

  const StepSetup<Dim>& setup_;
  bool is_turned_;
  Vec<Dim> about_;  ///< moments are about this point [m]
  Side before_, after_;
};

}  // namespace

template <int Dim>
void keep_momenta(const StepSetup<Dim>& setup, const State<Dim>& before, const AddedMaterial<Dim>& added,
                  State<Dim>& state) {
  const Mesh<Dim>& mesh = state.mesh;
  std::map<int, std::vector<char>> patches;  // by body: nodes of cells around moved vertices
  for (const VertexId moved : added.moved)
    for (const CellId c : mesh.cells_of(moved)) {
      auto& is_free = patches[mesh.body(c)];
      is_free.resize(mesh.num_nodes(), 0);
      for_each_node(mesh, mesh.cell(c), [&](VertexId v) {
        const EdgeKey ends = mesh.edge_of_node(v);
        is_free[v] =
            ends[0] == kNone ? !mesh.is_on_interface(v) : !mesh.is_on_interface(ends[0]) || !mesh.is_on_interface(ends[1]);
      });
    }
  if (patches.empty()) return;
  const Keeper<Dim> keeper(setup, before, state);
  std::size_t next = 0;
  const auto correct = [&](const std::vector<VectorX>& old_rates, std::vector<VectorX>& rates) {
    for (std::size_t i = 0; i < rates.size(); ++i) keeper.correct(added, patches, old_rates[i], next++, rates[i]);
  };
  correct(before.history.v, state.history.v);
  correct(before.history.a, state.history.a);
}

template void keep_momenta(const StepSetup<2>&, const State<2>&, const AddedMaterial<2>&, State<2>&);
template void keep_momenta(const StepSetup<3>&, const State<3>&, const AddedMaterial<3>&, State<3>&);

}  // namespace itr
