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

#include <boost/container/small_vector.hpp>
#include "energy/elastic/point.hpp"
#include "energy/load_points.hpp"
#include "geometry/measures.hpp"
#include "itr/fem/mass.hpp"
#include "remesh/curved_cell.hpp"
#include "remesh/edits.hpp"

namespace itr {

namespace {

/// Energy of cells, and what it does when one of their vertices moves.
template <int Dim>
class QuadraticModel {
 public:
  explicit QuadraticModel(const StepContext<Dim>& context) : context_(context) {}

  struct Corners {
    std::array<Vec<Dim>, Dim + 1> rest, x, predictor;
  };
  /// What is the same whichever of a cell's corners moves.
  struct CellAt {
    CellAt(const StepContext<Dim>& context, const Corners& corners, int body) : at(corners) {
      const Mat<Dim> edges = edge_matrix<Dim>(at.rest);
      inverse = edges.inverse();
      volume = simplex_volume<Dim>(edges);
      const Material& material = context.materials.at(body);
      Vec<Dim> center = Vec<Dim>::Zero();
      for (const auto& p : at.rest) center += p / (Dim + 1);
      moduli = elastic_moduli<Dim>(material, center);
      F = edge_matrix<Dim>(at.x) * inverse;
      mass = mass_density<Dim>(material, center) * volume;
    }
    const Corners& at;
    Mat<Dim> inverse, F;
    double volume, mass;
    ElasticModuli moduli;
  };
  void add_cell(const CellAt& cell) {
    energy_ += context_.scaling * cell.volume * elastic_density<Dim>(cell.F, cell.moduli);
    add_inertia_and_load(cell, kNone);
  }
  /// The same where its corner `moving` moves; the response is the cell's.
  void add_cell(const CellAt& cell, const ElasticPoint<Dim>& response, int moving) {
    const double s = context_.scaling, V = cell.volume;
    const Vec<Dim> gradient = barycentric_gradient<Dim>(cell.inverse, moving);
    energy_ += s * V * response.density();
    gradient_ += s * V * response.gradient(gradient);
    hessian_ += s * V * response.hessian(gradient);
    add_inertia_and_load(cell, moving);
  }
  /// `moving`: the corner that moves, or kNone.
  void add_cell(const Corners& at, int body, int moving) {
    const CellAt cell(context_, at, body);
    if (moving == kNone)
      add_cell(cell);
    else
      add_cell(cell, ElasticPoint<Dim>(cell.F, cell.moduli), moving);
  }

  /// What splitting a cell of constant moduli at the middle of its edge from corner `a` to `b` changes: both halves deform
  /// and move as the whole did, so that without loads the energy stays, and the new vertex feels them at once.
  void add_split_cell(const Mesh<Dim>& mesh, CellId c, const Corners& at, int a, int b) {
    const Material& material = context_.materials.at(mesh.body(c));
    const ElasticModuli moduli = elastic_moduli<Dim>(material, at.rest[0]);
    const Mat<Dim>& inverse = mesh.inverse_rest_edges(c);
    const Mat<Dim> F = edge_matrix<Dim>(at.x) * inverse;
    const ElasticPoint<Dim> response(F, moduli);
    const Vec<Dim> ga = barycentric_gradient<Dim>(inverse, a), gb = barycentric_gradient<Dim>(inverse, b);
    const double sV = context_.scaling * mesh.volume(c), mass = material.density * mesh.volume(c);
    gradient_ += sV * response.gradient(ga + gb);
    hessian_ += 2 * sV * (response.hessian(ga) + response.hessian(gb));
    if (context_.has_inertia) {
      const ElementMass<Dim> matrix(context_.mass, mass);
      Vec<Dim> total = Vec<Dim>::Zero();
      for (int k = 0; k <= Dim; ++k) total += at.x[k] - at.predictor[k];
      gradient_ += matrix.product(total, Vec<Dim>((at.x[a] - at.predictor[a] + at.x[b] - at.predictor[b]) / 2));
      hessian_.diagonal().array() += matrix.diagonal();
    }
    if (!context_.loads.acceleration) return;
    add_load(at.rest, at.x, -context_.scaling * mass, context_.loads.acceleration, kNone);
    for (const int end : {a, b}) {
      auto rest = at.rest, x = at.x;
      rest[end] = (at.rest[a] + at.rest[b]) / 2;
      x[end] = (at.x[a] + at.x[b]) / 2;
      add_load(rest, x, context_.scaling * mass / 2, context_.loads.acceleration, end);
    }
  }

  /// What the bubble 4 l_a l_b of the edge from corner `a` to `b` feels in a cell of constant moduli. Its gradient is
  /// linear, 4 (l_a g_b + l_b g_a), and F constant: all integrals are exact but that of a load that varies.
  void add_curved_cell(const Mesh<Dim>& mesh, CellId c, const Corners& at, int a, int b) {
    const Material& material = context_.materials.at(mesh.body(c));
    const Mat<Dim>& inverse = mesh.inverse_rest_edges(c);
    const Mat<Dim> F = edge_matrix<Dim>(at.x) * inverse;
    const ElasticModuli moduli = elastic_moduli<Dim>(material, at.rest[0]);
    const ElasticPoint<Dim> response(F, moduli);
    const Vec<Dim> ga = barycentric_gradient<Dim>(inverse, a), gb = barycentric_gradient<Dim>(inverse, b);
    const double sV = context_.scaling * mesh.volume(c), mass = material.density * mesh.volume(c);
    constexpr double kFirst = 1.0 / (Dim + 1), kSecond = kFirst / (Dim + 2), kThird = kSecond / (Dim + 3),
                     kFourth = kThird / (Dim + 4);  // integrals of products of different coordinates, by the volume
    gradient_ += 4 * kFirst * sV * response.gradient(ga + gb);
    hessian_ += 16 * kSecond * sV * (response.hessian(ga) + response.hessian(gb) + response.hessian(ga + gb));
    if (context_.has_inertia) {
      Vec<Dim> total = at.x[a] - at.predictor[a] + at.x[b] - at.predictor[b];
      for (int k = 0; k <= Dim; ++k) total += at.x[k] - at.predictor[k];
      gradient_ += 4 * kThird * mass * total;
      hessian_.diagonal().array() += 16 * 4 * kFourth * mass;
    }
    if (context_.loads.acceleration)
      gradient_ -= context_.scaling * 4 * kSecond * mass * context_.loads.acceleration((at.rest[a] + at.rest[b]) / 2);
  }
  /// The same where other edges of the cell are curved, by the rules of quadrature that energy and mass have.
  void add_mixed_cell(const RemeshState<Dim>& state, CellId c, const EdgeKey& edge) {
    const Mesh<Dim>& mesh = state.mesh;
    const auto cell = curved_cell<Dim>(mesh.cell(c), [&](VertexId a, VertexId b) { return mesh.node_of(a, b); });
    const Material& material = context_.materials.at(mesh.body(c));
    const auto linear = barycentric_gradients<Dim>(mesh.inverse_rest_edges(c));
    const ElasticModuli moduli = elastic_moduli<Dim>(material, mesh.rest(mesh.cell(c)[0]));
    const auto place = [&](VertexId v) { return std::find(cell.nodes.begin(), cell.nodes.end(), v) - cell.nodes.begin(); };
    const auto a = place(edge[0]), b = place(edge[1]);
    const double sV = context_.scaling * mesh.volume(c), mass = material.density * mesh.volume(c);
    const auto x = at_nodes<Dim>(cell.nodes, state.fields.x);
    for (const auto& point : quadrature<Dim>(context_.quadrature_degree)) {
      const auto& l = point.weights;
      const Mat<Dim> F = x * quadratic_gradients<Dim, Dim>(cell.edges, l, linear).transpose();
      const ElasticPoint<Dim> response(F, moduli);
      const Vec<Dim> bubble = 4 * (l[a] * linear.col(b) + l[b] * linear.col(a));
      gradient_ += sV * point.share * response.gradient(bubble);
      hessian_ += sV * point.share * response.hessian(bubble);
    }
    const auto way = [&]() -> QuadraticCell<Dim> {
      if (!context_.has_inertia) return QuadraticCell<Dim>::Zero();
      return x - at_nodes<Dim>(cell.nodes, state.fields.predictor);
    }();
    for (const auto& point : quadrature<Dim>(kMassDegree)) {
      const double bubble = 4 * point.weights[a] * point.weights[b], weight = point.share * mass * bubble;
      if (context_.has_inertia) {
        gradient_ += weight * way * quadratic_shapes<Dim>(cell.edges, point.weights);
        hessian_.diagonal().array() += weight * bubble;
      }
      if (context_.loads.acceleration)
        gradient_ -= context_.scaling * weight * context_.loads.acceleration((mesh.rest(edge[0]) + mesh.rest(edge[1])) / 2);
    }
  }
  /// The energy of a cell with curved edges after an edit.
  void add_still_curved_cell(const RemeshState<Dim>& state, const CurvedCell<Dim>& cell, int body, const Edit<Dim>& edit) {
    std::array<Vec<Dim>, Dim + 1> rest;
    for (int k = 0; k <= Dim; ++k) rest[k] = state.mesh.rest(cell.nodes[k]);
    const Mat<Dim> edges = edge_matrix<Dim>(rest);
    const auto linear = barycentric_gradients<Dim>(edges.inverse());
    const Material& material = context_.materials.at(body);
    const double volume = simplex_volume<Dim>(edges);
    const auto place = [&](const auto& l) {
      Vec<Dim> X = Vec<Dim>::Zero();
      for (int k = 0; k <= Dim; ++k) X += l[k] * rest[k];
      return X;
    };
    const QuadraticCell<Dim> x = cell.values(state.fields.x, edit);
    for (const auto& point : quadrature<Dim>(context_.quadrature_degree)) {
      const ElasticModuli moduli = elastic_moduli<Dim>(material, place(point.weights));
      const Mat<Dim> F = x * quadratic_gradients<Dim, Dim>(kAllCurved<Dim>, point.weights, linear).transpose();
      energy_ += context_.scaling * volume * point.share * elastic_density<Dim>(F, moduli);
    }
    const QuadraticCell<Dim> way =
        context_.has_inertia ? QuadraticCell<Dim>(x - cell.values(state.fields.predictor, edit)) : x;
    for (const auto& point : quadrature<Dim>(kMassDegree)) {
      const auto shapes = quadratic_shapes<Dim>(kAllCurved<Dim>, point.weights);
      const Vec<Dim> X = place(point.weights);
      const double weight = point.share * mass_density<Dim>(material, X) * volume;
      if (context_.has_inertia) energy_ += 0.5 * weight * (way * shapes).squaredNorm();
      if (context_.loads.acceleration)
        energy_ -= context_.scaling * weight * context_.loads.acceleration(X).dot(x * shapes - X);
    }
  }
  /// The same of a facet at the edge.
  void add_curved_facet(const std::array<Vec<Dim>, Dim>& rest, const Vec<Dim>& middle, int tag) {
    constexpr double kSecond = 1.0 / (Dim * (Dim + 1));
    for (const auto& [loaded, traction] : context_.loads.tractions)
      if (loaded == tag) gradient_ -= context_.scaling * 4 * kSecond * facet_area(rest) * traction(middle);
  }

  void add_facet(const std::array<Vec<Dim>, Dim>& rest, const std::array<Vec<Dim>, Dim>& x, int tag, int moving) {
    for (const auto& [loaded, traction] : context_.loads.tractions)
      if (loaded == tag) add_load(rest, x, context_.scaling * facet_area(rest), traction, moving);
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
  /// The same where some components are held.
  double relaxed(const std::array<bool, Dim>& held) {
    for (int c = 0; c < Dim; ++c)
      if (held[c]) {
        hessian_.row(c).setZero();
        hessian_.col(c).setZero();
        hessian_(c, c) = 1;
        gradient_[c] = 0;
      }
    return relaxed();
  }

 private:
  void add_inertia_and_load(const CellAt& cell, int moving) {
    if (context_.has_inertia) add_inertia(cell.at, cell.mass, moving);
    if (context_.loads.acceleration)
      add_load(cell.at.rest, cell.at.x, context_.scaling * cell.mass, context_.loads.acceleration, moving);
  }
  template <std::size_t N>
  void add_load(const std::array<Vec<Dim>, N>& rest, const std::array<Vec<Dim>, N>& x, double weight,
                const std::function<Vec<Dim>(const Vec<Dim>&)>& load, int moving) {
    using Point = LoadPoint<N>;
    std::array<Vec<Dim>, N> u;
    Vec<Dim> sum = Vec<Dim>::Zero();
    for (std::size_t k = 0; k < N; ++k) {
      u[k] = x[k] - rest[k];
      sum += u[k];
    }
    for_each_load_point<Dim>(rest, weight, load, [&](std::size_t q, const Vec<Dim>& force) {
      energy_ -= force.dot(Point::at(q, u, sum));
      if (moving != kNone) gradient_ -= (static_cast<int>(q) == moving ? Point::kNear : Point::kFar) * force;
    });
  }

  void add_inertia(const Corners& at, double mass, int moving) {
    Vec<Dim> total = Vec<Dim>::Zero();
    double squares = 0;
    for (int k = 0; k <= Dim; ++k) {
      const Vec<Dim> d = at.x[k] - at.predictor[k];
      total += d;
      squares += d.squaredNorm();
    }
    const ElementMass<Dim> matrix(context_.mass, mass);
    energy_ += matrix.energy(total, squares);
    if (moving == kNone) return;
    gradient_ += matrix.product(total, Vec<Dim>(at.x[moving] - at.predictor[moving]));
    hessian_.diagonal().array() += matrix.diagonal();
  }

  const StepContext<Dim>& context_;
  double energy_ = 0;
  Vec<Dim> gradient_ = Vec<Dim>::Zero();
  Mat<Dim> hessian_ = Mat<Dim>::Zero();
};

/// Of a cell on vertices of the mesh.
template <int Dim>
typename QuadraticModel<Dim>::Corners corners_of(const RemeshState<Dim>& state, const typename MeshTypes<Dim>::Cell& cell) {
  typename QuadraticModel<Dim>::Corners corners;
  for (int k = 0; k <= Dim; ++k) {
    corners.rest[k] = state.mesh.rest(cell[k]);
    corners.x[k] = state.fields.x.template segment<Dim>(Dim * cell[k]);
    if (state.context.has_inertia) corners.predictor[k] = state.fields.predictor.template segment<Dim>(Dim * cell[k]);
  }
  return corners;
}

constexpr double kUnknown = std::numeric_limits<double>::infinity();
/// One side of an edit that sets no vertex: as it is, and with each of some vertices moving by itself.
template <int Dim>
class MovingModels {
 public:
  MovingModels(const RemeshState<Dim>& state, std::span<const VertexId> vertices)
      : state_(state), vertices_(vertices), still_(state.context), moving_(vertices.size(), still_) {}
  void add_cell(const typename MeshTypes<Dim>::Cell& cell, int body) {
    const auto corners = corners_of(state_, cell);
    const typename QuadraticModel<Dim>::CellAt at(state_.context, corners, body);
    const ElasticPoint<Dim> response(at.F, at.moduli);
    still_.add_cell(at);
    for (int k = 0; k <= Dim; ++k) moving_[index(cell[k])].add_cell(at, response, k);
  }
  void add_facet(const typename MeshTypes<Dim>::Facet& facet, int tag) {
    std::array<Vec<Dim>, Dim> X, x;
    for (int k = 0; k < Dim; ++k) {
      X[k] = state_.mesh.rest(facet[k]);
      x[k] = state_.fields.x.template segment<Dim>(Dim * facet[k]);
    }
    still_.add_facet(X, x, tag, kNone);
    for (int k = 0; k < Dim; ++k) moving_[index(facet[k])].add_facet(X, x, tag, k);
  }
  double energy() const { return still_.energy(); }
  const QuadraticModel<Dim>& operator[](std::size_t i) const { return moving_[i]; }

 private:
  std::size_t index(VertexId v) const {
    return static_cast<std::size_t>(std::lower_bound(vertices_.begin(), vertices_.end(), v) - vertices_.begin());
  }
  const RemeshState<Dim>& state_;
  std::span<const VertexId> vertices_;
  QuadraticModel<Dim> still_;
  std::vector<QuadraticModel<Dim>> moving_;
};

/// Of vertices under the forces that an edit adds: cells around resist, too, and are not in the model.
constexpr double kShareOfRelaxation = 0.25;

/// One side of an edit that replaces cells with curved edges: as it is, and with each vertex and node moving by itself.
template <int Dim>
class NodalModels {
 public:
  struct Model {
    VertexId id;
    Vec<Dim> gradient = Vec<Dim>::Zero();
    Mat<Dim> hessian = Mat<Dim>::Zero();
  };
  NodalModels(const RemeshState<Dim>& state, const Edit<Dim>& edit) : state_(state), edit_(edit) {}

  /// A cell after the edit; `is_after`: its vertices and nodes may be of the edit.
  void add_cell(const typename MeshTypes<Dim>::Cell& vertices, int body, bool is_after) {
    const Edit<Dim> none{.kind = edit_.kind};
    const Edit<Dim>& edit = is_after ? edit_ : none;
    const StepContext<Dim>& context = state_.context;
    const auto cell =
        curved_cell<Dim>(vertices, [&](VertexId a, VertexId b) { return node_after(state_.mesh, edit, a, b); });
    PlacedCell placed{cell.edges, {}, cell.values(state_.fields.x, edit), context.materials.at(body), {}};
    for (int k = 0; k <= Dim; ++k) {
      const VertexId v = vertices[k];
      placed.rest[k] = edit.value && v == edit.value->vertex ? edit.value->rest : state_.mesh.rest(v);
    }
    for (int k = 0; k < kQuadraticNodes<Dim>; ++k)
      if (k <= Dim || cell.edges >> (k - Dim - 1) & 1) model(cell.nodes[k]);
    for (int k = 0; k < kQuadraticNodes<Dim>; ++k)  // all are there: none moves any more
      if (k <= Dim || cell.edges >> (k - Dim - 1) & 1) placed.models[k] = &model(cell.nodes[k]);
    add_elasticity(placed);
    if (!context.has_inertia && !context.loads.acceleration) return;
    QuadraticCell<Dim> way = placed.x;
    if (context.has_inertia) way -= cell.values(state_.fields.predictor, edit);
    add_mass_and_weight(placed, way);
  }
  double energy() const { return energy_; }
  const auto& models() const { return models_; }
  const Model* find(VertexId id) const {
    const auto it = std::find_if(models_.begin(), models_.end(), [&](const Model& model) { return model.id == id; });
    return it == models_.end() ? nullptr : &*it;
  }

 private:
  struct PlacedCell {
    CurvedEdges edges;
    std::array<Vec<Dim>, Dim + 1> rest;
    QuadraticCell<Dim> x;
    const Material& material;
    std::array<Model*, kQuadraticNodes<Dim>> models;  ///< null at straight edges
    Vec<Dim> place(const std::array<double, Dim + 1>& l) const {
      Vec<Dim> X = Vec<Dim>::Zero();
      for (int k = 0; k <= Dim; ++k) X += l[k] * rest[k];
      return X;
    }
  };

  Model& model(VertexId id) {
    const auto it = std::find_if(models_.begin(), models_.end(), [&](const Model& model) { return model.id == id; });
    if (it != models_.end()) return *it;
    models_.push_back({id});
    return models_.back();
  }

  void add_elasticity(const PlacedCell& cell) {
    const Mat<Dim> edges = edge_matrix<Dim>(cell.rest);
    const auto linear = barycentric_gradients<Dim>(edges.inverse());
    const double volume = simplex_volume<Dim>(edges);
    for (const auto& point : quadrature<Dim>(cell.edges ? state_.context.quadrature_degree : 1)) {
      const auto shapes = quadratic_gradients<Dim, Dim>(cell.edges, point.weights, linear);
      const ElasticModuli moduli = elastic_moduli<Dim>(cell.material, cell.place(point.weights));
      const Mat<Dim> F = cell.x * shapes.transpose();
      const ElasticPoint<Dim> response(F, moduli);
      const double weight = state_.context.scaling * volume * point.share;
      energy_ += weight * response.density();
      for (int k = 0; k < kQuadraticNodes<Dim>; ++k) {
        if (!cell.models[k]) continue;
        cell.models[k]->gradient += weight * response.gradient(shapes.col(k));
        cell.models[k]->hessian += weight * response.hessian(shapes.col(k));
      }
    }
  }

  /// `way`: from the predictor, where there is inertia.
  void add_mass_and_weight(const PlacedCell& cell, const QuadraticCell<Dim>& way) {
    const StepContext<Dim>& context = state_.context;
    const double volume = simplex_volume<Dim>(edge_matrix<Dim>(cell.rest));
    for (const auto& point : quadrature<Dim>(cell.edges ? kMassDegree : 2)) {
      const auto shapes = quadratic_shapes<Dim>(cell.edges, point.weights);
      const Vec<Dim> X = cell.place(point.weights);
      const double weight = point.share * mass_density<Dim>(cell.material, X) * volume;
      Vec<Dim> force = Vec<Dim>::Zero();
      if (context.has_inertia) {
        force = weight * way * shapes;
        energy_ += 0.5 / weight * force.squaredNorm();
      }
      if (context.loads.acceleration) {
        const Vec<Dim> load = context.scaling * weight * context.loads.acceleration(X);
        energy_ -= load.dot(cell.x * shapes - X);
        force -= load;
      }
      for (int k = 0; k < kQuadraticNodes<Dim>; ++k) {
        if (!cell.models[k]) continue;
        cell.models[k]->gradient += shapes[k] * force;
        if (context.has_inertia) cell.models[k]->hessian.diagonal().array() += weight * shapes[k] * shapes[k];
      }
    }
  }

  const RemeshState<Dim>& state_;
  const Edit<Dim>& edit_;
  double energy_ = 0;
  std::vector<Model> models_;
};

/// What the edit sets moves under all forces on it, since all of its cells are here, the others under those that the edit
/// adds. Each moves by itself, which is an estimate of what they gain together. Forgotten history is left out.
template <int Dim>
double predict_gain_at_curves(const RemeshState<Dim>& state, const Edit<Dim>& edit) {
  if (!state.context.loads.tractions.empty() && !edit.inserted_facets.empty()) return kUnknown;
  NodalModels<Dim> before(state, edit), after(state, edit);
  for (const CellId c : edit.removed_cells) before.add_cell(state.mesh.cell(c), state.mesh.body(c), false);
  for (const auto& cell : edit.inserted_cells) after.add_cell(cell.vertices, cell.body, true);
  if (!std::isfinite(after.energy())) return kUnknown;  // inverted there
  double gain = before.energy() - after.energy();
  for (const auto& model : after.models()) {
    const bool is_set = (edit.value && model.id == edit.value->vertex) || model.id >= state.mesh.vertex_slots();
    const auto* old = is_set ? nullptr : before.find(model.id);
    const Vec<Dim> force = old ? Vec<Dim>(model.gradient - old->gradient) : model.gradient;
    const Eigen::LLT<Mat<Dim>> llt(model.hessian);
    if (llt.info() != Eigen::Success) return kUnknown;
    gain += (is_set ? 1 : kShareOfRelaxation) * 0.5 * force.dot(llt.solve(force));
  }
  return gain;
}

/// A swap sets no vertex. Each vertex moves by itself under the forces that the edit adds.
template <int Dim>
double predict_gain_of_swap(const RemeshState<Dim>& state, const Edit<Dim>& edit) {
  boost::container::small_vector<VertexId, 64> vertices;  // ascending
  for (const auto& cell : edit.inserted_cells) vertices.insert(vertices.end(), cell.vertices.begin(), cell.vertices.end());
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  const std::span<const VertexId> moving(vertices.data(), vertices.size());
  MovingModels<Dim> before(state, moving), after(state, moving);
  for (const CellId c : edit.removed_cells) before.add_cell(state.mesh.cell(c), state.mesh.body(c));
  for (const auto& cell : edit.inserted_cells) after.add_cell(cell.vertices, cell.body);
  if (!state.context.loads.tractions.empty()) {
    for (const FacetId f : edit.removed_facets) before.add_facet(state.mesh.facet(f), state.mesh.facet_tag(f));
    for (const auto& facet : edit.inserted_facets) after.add_facet(facet.vertices, facet.tag);
  }
  double gain = before.energy() - after.energy();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const Vec<Dim> force = after[i].gradient() - before[i].gradient();
    const Eigen::LLT<Mat<Dim>> llt(after[i].hessian());
    if (llt.info() != Eigen::Success) return kUnknown;
    gain += kShareOfRelaxation * 0.5 * force.dot(llt.solve(force));
  }
  return gain;
}

/// Share of the forgotten history that no relaxation regains (ball-wall 2D: a share of 1 refuses so many collapses that a
/// sixth more vertices stay).
constexpr double kLeastForgotten = 0.3;

}  // namespace

template <int Dim>
double least_forgotten(const RemeshState<Dim>& state, const Edit<Dim>& edit) {
  const auto after = [&](const VectorX& field, VertexId v) {
    return v == edit.value->vertex ? RemeshFields<Dim>::interpolate(field, *edit.value)
                                   : Vec<Dim>(field.segment<Dim>(Dim * v));
  };
  double forgotten = 0;
  for (const VertexId v : {edit.value->vertex, edit.removed_vertex}) {
    if (v == kNone || v == kNewVertex) continue;
    const Vec<Dim>& X = state.mesh.rest(v);
    double mass = 0;
    for (const CellId c : edit.removed_cells) {
      const auto& cell = state.mesh.cell(c);
      if (std::find(cell.begin(), cell.end(), v) != cell.end())
        mass += state.context.materials.at(state.mesh.body(c)).density * state.mesh.volume(c) / (Dim + 1);
    }
    // There in the new mesh.
    double deepest = -std::numeric_limits<double>::infinity();
    Vec<Dim> way = Vec<Dim>::Zero(), predictor = way;
    for (const auto& [cell, body] : edit.inserted_cells) {
      std::array<Vec<Dim>, Dim + 1> rest;
      for (int k = 0; k <= Dim; ++k) rest[k] = cell[k] == edit.value->vertex ? edit.value->rest : state.mesh.rest(cell[k]);
      const Vec<Dim> weights = edge_matrix<Dim>(rest).inverse() * (X - rest[0]);
      const double depth = std::min(weights.minCoeff(), 1 - weights.sum());
      if (depth <= deepest) continue;
      deepest = depth;
      way = predictor = Vec<Dim>::Zero();
      for (int k = 0; k <= Dim; ++k) {
        const double weight = k == 0 ? 1 - weights.sum() : weights[k - 1];
        const Vec<Dim> x_hat = after(state.fields.predictor, cell[k]);
        predictor += weight * x_hat;
        way += weight * (after(state.fields.x, cell[k]) - x_hat);
      }
    }
    const Vec<Dim> gap = state.fields.predictor.template segment<Dim>(Dim * v) - predictor;
    forgotten += mass * (gap.squaredNorm() / (Dim + 2) - gap.dot(way));
  }
  return kLeastForgotten * forgotten;
}

template <int Dim>
double predict_gain(const RemeshState<Dim>& state, const Edit<Dim>& edit) {
  const StepContext<Dim>& context = state.context;
  if (!is_predictable(context)) return kUnknown;
  if (state.mesh.has_nodes()) {
    const auto is_curved = [&](CellId c) { return state.mesh.is_curved(c); };
    if (std::any_of(edit.removed_cells.begin(), edit.removed_cells.end(), is_curved))
      return predict_gain_at_curves(state, edit);
  }
  if (!edit.value) return predict_gain_of_swap(state, edit);
  const VertexId set = edit.value->vertex;
  const auto at = [&](const VectorX& field, VertexId v, bool after) {
    return after && v == set ? RemeshFields<Dim>::interpolate(field, *edit.value) : Vec<Dim>(field.segment<Dim>(Dim * v));
  };
  const auto rest = [&](VertexId v) { return v == set ? edit.value->rest : state.mesh.rest(v); };
  QuadraticModel<Dim> before(context), after(context);
  for (const CellId c : edit.removed_cells)
    before.add_cell(corners_of(state, state.mesh.cell(c)), state.mesh.body(c), kNone);
  for (const auto& cell : edit.inserted_cells) {
    typename QuadraticModel<Dim>::Corners corners;
    int moving = kNone;
    for (int k = 0; k <= Dim; ++k) {
      const VertexId v = cell.vertices[k];
      if (v == set) moving = k;
      corners.rest[k] = rest(v);
      corners.x[k] = at(state.fields.x, v, true);
      if (context.has_inertia) corners.predictor[k] = at(state.fields.predictor, v, true);
    }
    after.add_cell(corners, cell.body, moving);
  }
  if (!context.loads.tractions.empty()) {
    const auto add_facet = [&](const auto& facet, int tag, bool is_after, QuadraticModel<Dim>& model) {
      std::array<Vec<Dim>, Dim> X, x;
      int moving = kNone;
      for (int k = 0; k < Dim; ++k) {
        if (is_after && facet[k] == set) moving = k;
        X[k] = is_after ? rest(facet[k]) : state.mesh.rest(facet[k]);
        x[k] = at(state.fields.x, facet[k], is_after);
      }
      model.add_facet(X, x, tag, moving);
    };
    for (const FacetId f : edit.removed_facets) add_facet(state.mesh.facet(f), state.mesh.facet_tag(f), false, before);
    for (const auto& facet : edit.inserted_facets) add_facet(facet.vertices, facet.tag, true, after);
  }
  double gain = before.energy() - after.relaxed();
  if (context.has_inertia && state.history == HistoryRule::function && !edit.is_nested())
    gain -= least_forgotten<Dim>(state, edit);
  return gain;
}

template <int Dim>
double predict_split(const RemeshState<Dim>& state, const EdgeKey& edge) {
  const StepContext<Dim>& context = state.context;
  const Mesh<Dim>& mesh = state.mesh;
  const auto around = mesh.cells_of(edge[0]);
  const auto varies = [&](CellId c) { return context.materials.at(mesh.body(c)).has_varying_moduli(); };
  if (!is_predictable(context) || context.mass == MassKind::lumped || !context.loads.tractions.empty() ||
      std::any_of(around.begin(), around.end(), varies))
    return predict_gain<Dim>(state, make_split<Dim>(mesh, edge));
  QuadraticModel<Dim> model(context);
  for (const CellId c : around) {
    const auto& cell = mesh.cell(c);
    const auto b = static_cast<int>(std::find(cell.begin(), cell.end(), edge[1]) - cell.begin());
    if (b > Dim) continue;
    const auto a = static_cast<int>(std::find(cell.begin(), cell.end(), edge[0]) - cell.begin());
    model.add_split_cell(mesh, c, corners_of(state, cell), a, b);
  }
  return -model.relaxed();
}

template <int Dim>
double predict_curve(const RemeshState<Dim>& state, const EdgeKey& edge) {
  constexpr double kCannotTell = std::numeric_limits<double>::quiet_NaN();
  const StepContext<Dim>& context = state.context;
  const Mesh<Dim>& mesh = state.mesh;
  if (!is_predictable(context)) return kCannotTell;
  const auto around = mesh.cells_of_edge(edge);
  const auto is_hard = [&](CellId c) { return context.materials.at(mesh.body(c)).has_varying_moduli(); };
  if (context.mass == MassKind::lumped || std::any_of(around.begin(), around.end(), is_hard)) return kCannotTell;
  QuadraticModel<Dim> model(context);
  for (const CellId c : around) {
    if (mesh.is_curved(c)) {
      model.add_mixed_cell(state, c, edge);
      continue;
    }
    const auto& cell = mesh.cell(c);
    const auto place = [&](VertexId v) { return static_cast<int>(std::find(cell.begin(), cell.end(), v) - cell.begin()); };
    model.add_curved_cell(mesh, c, corners_of(state, cell), place(edge[0]), place(edge[1]));
  }
  const Vec<Dim> middle = (mesh.rest(edge[0]) + mesh.rest(edge[1])) / 2;
  std::array<bool, Dim> held{};
  const auto hold_by = [&](int tag) {
    if (const auto it = context.held_components.find(tag); it != context.held_components.end())
      for (int c = 0; c < Dim; ++c) held[c] = held[c] || it->second[c];
  };
  if (const int tag = mesh.edge_tag(edge); tag != kNoTag) hold_by(tag);
  for (const FacetId f : mesh.facets_of_edge(edge)) {
    std::array<Vec<Dim>, Dim> rest;
    for (int k = 0; k < Dim; ++k) rest[k] = mesh.rest(mesh.facet(f)[k]);
    model.add_curved_facet(rest, middle, mesh.facet_tag(f));
    hold_by(mesh.facet_tag(f));
  }
  return -model.relaxed(held);
}

template <int Dim>
double cell_energy(const RemeshState<Dim>& state, const typename MeshTypes<Dim>::Cell& cell, int body,
                   const Edit<Dim>& edit) {
  QuadraticModel<Dim> model(state.context);
  const auto curved = curved_cell_after(state.mesh, edit, cell);
  if (curved.edges)
    model.add_still_curved_cell(state, curved, body, edit);
  else
    model.add_cell(corners_of(state, cell), body, kNone);
  return model.energy();
}

template double predict_gain(const RemeshState<2>&, const Edit<2>&);
template double predict_gain(const RemeshState<3>&, const Edit<3>&);
template double least_forgotten(const RemeshState<2>&, const Edit<2>&);
template double least_forgotten(const RemeshState<3>&, const Edit<3>&);
template double predict_split(const RemeshState<2>&, const EdgeKey&);
template double predict_split(const RemeshState<3>&, const EdgeKey&);
template double predict_curve(const RemeshState<2>&, const EdgeKey&);
template double predict_curve(const RemeshState<3>&, const EdgeKey&);
template double cell_energy<2>(const RemeshState<2>&, const MeshTypes<2>::Cell&, int, const Edit<2>&);
template double cell_energy<3>(const RemeshState<3>&, const MeshTypes<3>::Cell&, int, const Edit<3>&);

}  // namespace itr
