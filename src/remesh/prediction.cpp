// SPDX-License-Identifier: MIT
#include "prediction.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "itr/energy/elastic/laws.hpp"
#include "itr/geometry/measures.hpp"

namespace itr {

namespace {

/// W, and its derivatives by the position of one vertex, whose shape function has this gradient.
template <int Dim>
struct ElasticResponse {
  double density;
  Vec<Dim> force;      ///< P gradient
  Mat<Dim> stiffness;  ///< of v -> v . d2W/dF2 : (v x gradient)
  ElasticResponse(const Mat<Dim>& F, const ElasticModuli& moduli, const Vec<Dim>& gradient) {
    if (moduli.law == MaterialLaw::neo_hookean) {  // with one inverse and one logarithm
      const double mu = moduli.lame.mu, lambda = moduli.lame.lambda, J = F.determinant(), log_J = std::log(J);
      const Vec<Dim> h = F.inverse().transpose() * gradient;
      density = J > 0 ? mu / 2 * (F.squaredNorm() - Dim - 2 * log_J) + lambda / 2 * log_J * log_J
                      : std::numeric_limits<double>::infinity();
      force = mu * F * gradient + (lambda * log_J - mu) * h;
      stiffness = mu * gradient.squaredNorm() * Mat<Dim>::Identity() + (mu - lambda * log_J + lambda) * h * h.transpose();
      return;
    }
    density = elastic_density<Dim>(F, moduli);
    force = elastic_stress<Dim>(F, moduli) * gradient;
    stiffness.setZero();
    const EigenSystem<Dim> system = elastic_eigensystem<Dim>(F, moduli);
    for (std::size_t k = 0; k < system.values.size(); ++k) {
      const Vec<Dim> w = system.modes[k] * gradient;
      stiffness += system.values[k] * w * w.transpose();
    }
  }
};

/// Energy of cells, and what it does when one of their vertices moves.
template <int Dim>
class QuadraticModel {
 public:
  explicit QuadraticModel(const StepContext<Dim>& context) : context_(context) {}

  struct Corners {
    std::array<Vec<Dim>, Dim + 1> rest, x, predictor;
  };
  /// `moving`: the corner that moves, or kNone.
  void add_cell(const Corners& at, int body, int moving) {
    const Mat<Dim> edges = edge_matrix<Dim>(at.rest), inverse = edges.inverse();
    const double V = simplex_volume<Dim>(edges), s = context_.scaling;
    const Material& material = context_.materials.at(body);
    Vec<Dim> center = Vec<Dim>::Zero();
    for (const auto& p : at.rest) center += p / (Dim + 1);
    const ElasticModuli moduli = elastic_moduli<Dim>(material, center);
    const Mat<Dim> F = edge_matrix<Dim>(at.x) * inverse;
    if (moving == kNone) {
      energy_ += s * V * elastic_density<Dim>(F, moduli);
    } else {
      const Vec<Dim> gradient =
          moving == 0 ? Vec<Dim>(-inverse.colwise().sum().transpose()) : Vec<Dim>(inverse.row(moving - 1).transpose());
      const ElasticResponse<Dim> response(F, moduli, gradient);
      energy_ += s * V * response.density;
      gradient_ += s * V * response.force;
      hessian_ += s * V * response.stiffness;
    }
    const double mass = mass_density<Dim>(material, center) * V;
    if (context_.has_inertia) add_inertia(at, mass, moving);
    if (context_.loads.acceleration) add_load(at.rest, at.x, s * mass, context_.loads.acceleration, moving);
  }

  void add_facet(const std::array<Vec<Dim>, Dim>& rest, const std::array<Vec<Dim>, Dim>& x, int tag, int moving) {
    for (const auto& [loaded, traction] : context_.loads.tractions)
      if (loaded == tag) add_load(rest, x, context_.scaling * area(rest), traction, moving);
  }

  double energy() const { return energy_; }
  const Vec<Dim>& gradient() const { return gradient_; }
  const Mat<Dim>& hessian() const { return hessian_; }
  /// What is left of it where the vertex finds its minimum; infinite below where there is none.
  double relaxed() const {
    const Eigen::LLT<Mat<Dim>> llt(hessian_);
    if (llt.info() != Eigen::Success) return -std::numeric_limits<double>::infinity();
    return energy_ - 0.5 * gradient_.dot(llt.solve(gradient_));
  }

 private:
  /// As LoadEnergy does it.
  template <std::size_t N>
  void add_load(const std::array<Vec<Dim>, N>& rest, const std::array<Vec<Dim>, N>& x, double weight,
                const std::function<Vec<Dim>(const Vec<Dim>&)>& load, int moving) {
    constexpr double kNear = near_vertex<N>(), kFar = (1 - kNear) / (N - 1);
    Vec<Dim> X_sum = Vec<Dim>::Zero(), u_sum = Vec<Dim>::Zero();
    for (std::size_t k = 0; k < N; ++k) {
      X_sum += rest[k];
      u_sum += x[k] - rest[k];
    }
    for (std::size_t q = 0; q < N; ++q) {
      const Vec<Dim> force = weight / N * load(kFar * X_sum + (kNear - kFar) * rest[q]);
      energy_ -= force.dot(kFar * u_sum + (kNear - kFar) * (x[q] - rest[q]));
      if (moving != kNone) gradient_ -= (static_cast<int>(q) == moving ? kNear : kFar) * force;
    }
  }
  static double area(const std::array<Vec<2>, 2>& p) { return (p[1] - p[0]).norm(); }
  static double area(const std::array<Vec<3>, 3>& p) {
    const Vec<3> a = p[1] - p[0], b = p[2] - p[0];
    return 0.5 * std::sqrt(std::max(0.0, a.squaredNorm() * b.squaredNorm() - a.dot(b) * a.dot(b)));
  }

  void add_inertia(const Corners& at, double mass, int moving) {
    Vec<Dim> total = Vec<Dim>::Zero();
    double squares = 0;
    for (int k = 0; k <= Dim; ++k) {
      const Vec<Dim> d = at.x[k] - at.predictor[k];
      total += d;
      squares += d.squaredNorm();
    }
    const bool lumped = context_.mass == MassKind::lumped;
    const double share = lumped ? mass / (Dim + 1) : mass / ((Dim + 1) * (Dim + 2));
    energy_ += 0.5 * share * (squares + (lumped ? 0 : total.squaredNorm()));
    if (moving == kNone) return;
    const Vec<Dim> d = at.x[moving] - at.predictor[moving];
    gradient_ += share * (lumped ? d : Vec<Dim>(total + d));
    hessian_.diagonal().array() += lumped ? share : 2 * share;
  }

  const StepContext<Dim>& context_;
  double energy_ = 0;
  Vec<Dim> gradient_ = Vec<Dim>::Zero();
  Mat<Dim> hessian_ = Mat<Dim>::Zero();
};

}  // namespace

template <int Dim>
double predict_gain(const RemeshState<Dim>& state, const Edit<Dim>& edit) {
  constexpr double kUnknown = std::numeric_limits<double>::infinity();
  const StepContext<Dim>& context = state.context;
  if (!context.loads.pressures.empty() || !context.damping.empty() || !context.host.empty()) return kUnknown;
  const VertexId set = edit.value ? edit.value->vertex : kNone;
  const auto at = [&](const VectorX& field, VertexId v, bool after) {
    return after && v == set ? RemeshFields<Dim>::interpolate(field, *edit.value) : Vec<Dim>(field.segment<Dim>(Dim * v));
  };
  const auto rest = [&](VertexId v, bool after) { return after && v == set ? edit.value->rest : state.mesh.rest(v); };
  const auto add_cell = [&](const auto& cell, int body, bool is_after, QuadraticModel<Dim>& model, VertexId mover) {
    typename QuadraticModel<Dim>::Corners corners;
    int moving = kNone;
    for (int k = 0; k <= Dim; ++k) {
      if (cell[k] == mover) moving = k;
      corners.rest[k] = rest(cell[k], is_after);
      corners.x[k] = at(state.fields.x, cell[k], is_after);
      if (context.has_inertia) corners.predictor[k] = at(state.fields.predictor, cell[k], is_after);
    }
    model.add_cell(corners, body, moving);
  };
  const auto cells_before = [&](VertexId mover) {
    QuadraticModel<Dim> model(context);
    for (const CellId c : edit.removed_cells) add_cell(state.mesh.cell(c), state.mesh.body(c), false, model, mover);
    return model;
  };
  const auto cells_after = [&](VertexId mover) {
    QuadraticModel<Dim> model(context);
    for (const auto& cell : edit.inserted_cells) add_cell(cell.vertices, cell.body, true, model, mover);
    return model;
  };
  if (!edit.value) {
    // Nothing is set: each vertex gives way, by itself, to what the edit adds to its forces. Here the cells of the edit
    // alone resist, in the mesh those around them too.
    constexpr double kShareOfRelaxation = 0.25;
    std::vector<VertexId> vertices;
    for (const auto& cell : edit.inserted_cells) vertices.insert(vertices.end(), cell.vertices.begin(), cell.vertices.end());
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    double gain = cells_before(kNone).energy() - cells_after(kNone).energy();
    for (const VertexId v : vertices) {
      const QuadraticModel<Dim> old = cells_before(v), now = cells_after(v);
      const Vec<Dim> force = now.gradient() - old.gradient();
      const Eigen::LLT<Mat<Dim>> llt(now.hessian());
      if (llt.info() != Eigen::Success) return kUnknown;
      gain += kShareOfRelaxation * 0.5 * force.dot(llt.solve(force));
    }
    return gain;
  }
  QuadraticModel<Dim> before = cells_before(kNone), after = cells_after(set);
  if (!context.loads.tractions.empty()) {
    const auto add_facet = [&](const auto& facet, int tag, bool is_after, QuadraticModel<Dim>& model) {
      std::array<Vec<Dim>, Dim> X, x;
      int moving = kNone;
      for (int k = 0; k < Dim; ++k) {
        if (is_after && facet[k] == set) moving = k;
        X[k] = rest(facet[k], is_after);
        x[k] = at(state.fields.x, facet[k], is_after);
      }
      model.add_facet(X, x, tag, moving);
    };
    for (const FacetId f : edit.removed_facets) add_facet(state.mesh.facet(f), state.mesh.facet_tag(f), false, before);
    for (const auto& facet : edit.inserted_facets) add_facet(facet.vertices, facet.tag, true, after);
  }
  return before.energy() - after.relaxed();
}

template double predict_gain(const RemeshState<2>&, const Edit<2>&);
template double predict_gain(const RemeshState<3>&, const Edit<3>&);

}  // namespace itr
