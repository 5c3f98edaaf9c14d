// SPDX-License-Identifier: MIT
#include "energy/inertia.hpp"

#include "core/parallel.hpp"
#include "energy/elastic/laws.hpp"
#include "mass_block.hpp"

namespace itr {

namespace {
constexpr std::size_t kBlock = 256;

struct FromPredictor {
  ScratchVector distance;
};

/// The mass matrix of a cell by unit of its volume, with a density that varies and the turn.
template <int Dim, typename Density>
Mat<kQuadraticNodes<Dim>> varying_mass(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element,
                                       MassKind kind, const Density& density) {
  const int degree = degree_with_turn(kMassDegree, cells.axisymmetric);
  std::vector<double> densities;
  for (const auto& point : quadrature<Dim>(degree)) {
    const Vec<Dim> X = rest_position<Dim>(cells, element, point.weights);
    densities.push_back(density(X) * cells.turn(X));
  }
  return quadratic_mass<Dim>(kind, element.curved, densities, degree);
}
}  // namespace

template <int Dim>
InertiaEnergy<Dim>::InertiaEnergy(const CellSet<Dim>& cells, const std::map<int, Material>& materials, MassKind kind,
                                  ConstVectorView predictor)
    : cells_(cells) {
  renew(materials, kind, predictor);
}

template <int Dim>
void InertiaEnergy<Dim>::renew(const std::map<int, Material>& materials, MassKind kind, ConstVectorView predictor) {
  kind_ = kind;
  mass_.clear();
  mass_.reserve(cells_.straight().size());
  for (const auto& element : cells_.straight())
    mass_.push_back(mass_density<Dim>(materials.at(element.body), rest_barycenter(cells_, element)) * element.volume);
  renew_curved(materials);
  predictor_ = predictor;
  predicted_increment_.resize(0);
  residual_.resize(0);
  loss_ = 0;
}

template <int Dim>
void InertiaEnergy<Dim>::renew_curved(const std::map<int, Material>& materials) {
  matrices_.clear();
  curved_mass_.clear();
  constexpr std::size_t kAbsent = kAllCurved<Dim> + 1;
  std::array<std::size_t, kAllCurved<Dim> + 1> matrix_of;
  matrix_of.fill(kAbsent);
  for (const auto& element : cells_.curved()) {
    const Material& material = materials.at(element.body);
    if (material.density_at || cells_.axisymmetric) {
      const auto density = [&](const Vec<Dim>& X) { return mass_density<Dim>(material, X); };
      curved_mass_.push_back({element.volume, matrices_.size()});
      matrices_.push_back(varying_mass<Dim>(cells_, element, kind_, density));
      continue;
    }
    std::size_t& matrix = matrix_of[element.curved];
    if (matrix == kAbsent) {
      matrix = matrices_.size();
      matrices_.push_back(constant_quadratic_mass<Dim>(kind_, element.curved));
    }
    curved_mass_.push_back({material.density * element.volume, matrix});
  }
}

template <int Dim>
void InertiaEnergy<Dim>::set_unrepresented_history(ConstVectorView residual, double loss) {
  residual_ = residual;
  loss_ = loss;
}

template <int Dim>
double InertiaEnergy<Dim>::value_of(ConstVectorView distance) const {
  double sum = parallel_sum(mass_.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    double part = 0;
    for (std::size_t e = begin; e < end; ++e) {
      Vec<Dim> total = Vec<Dim>::Zero();
      double squares = 0;
      for (const int v : cells_.elements[e].vertices) {
        const Vec<Dim> d = distance.segment<Dim>(Dim * v);
        total += d;
        squares += d.squaredNorm();
      }
      part += ElementMass<Dim>(kind_, mass_[e]).energy(total, squares);
    }
    return part;
  });
  const auto curved = cells_.curved();
  for (std::size_t e = 0; e < curved_mass_.size(); ++e) {
    const auto d = at_nodes<Dim>(curved[e].nodes(), distance);
    sum += 0.5 * curved_mass_[e].mass * (d * matrices_[curved_mass_[e].matrix]).cwiseProduct(d).sum();
  }
  if (residual_.size() > 0) sum += residual_.view().dot(distance) + loss_;
  return sum;
}

template <int Dim>
double InertiaEnergy<Dim>::value(ConstVectorView x, Workspace& workspace) const {
  VectorView distance = workspace.get<FromPredictor>().distance.resize(x.size());
  distance = x - predictor_.view();
  return value_of(distance);
}

template <int Dim>
ConstVectorView InertiaEnergy<Dim>::distance_at(const Increment& at, Workspace& workspace) const {
  VectorView distance = workspace.get<FromPredictor>().distance.resize(at.d.size());
  if (predicted_increment_.size() > 0)
    distance = at.d - predicted_increment_.view();
  else
    distance = at.d - (predictor_.view() - at.base);
  return distance;
}

template <int Dim>
double InertiaEnergy<Dim>::value_at(const Increment& at, Workspace& workspace) const {
  return value_of(distance_at(at, workspace));
}

template <int Dim>
void InertiaEnergy<Dim>::add_gradient_at(const Increment& at, VectorView gradient, Workspace& workspace) const {
  add_mass_product(distance_at(at, workspace), gradient);
  if (residual_.size() > 0) gradient += residual_.view();
}

template <int Dim>
void InertiaEnergy<Dim>::add_mass_product(ConstVectorView x, VectorView y) const {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Dim, Eigen::RowMajor>;
  const Eigen::Map<const Rows> from(x.data(), x.size() / Dim, Dim);
  Eigen::Map<Rows> to(y.data(), y.size() / Dim, Dim);
  for (std::size_t e = 0; e < mass_.size(); ++e)
    ElementMass<Dim>(kind_, mass_[e]).add_product(cells_.elements[e].vertices, from, to);
  const auto curved = cells_.curved();
  for (std::size_t e = 0; e < curved_mass_.size(); ++e) {
    const auto nodes = curved[e].nodes();
    const auto product = (curved_mass_[e].mass * at_nodes<Dim>(nodes, x) * matrices_[curved_mass_[e].matrix]).eval();
    for (int k = 0; k < kQuadraticNodes<Dim>; ++k) y.template segment<Dim>(Dim * nodes[k]) += product.col(k);
  }
}

template <int Dim>
void InertiaEnergy<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const {
  VectorView distance = workspace.get<FromPredictor>().distance.resize(x.size());
  distance = x - predictor_.view();
  add_mass_product(distance, gradient);
  if (residual_.size() > 0) gradient += residual_.view();
}

template <int Dim>
void InertiaEnergy<Dim>::add_hessian(ConstVectorView, PsdProjection, HessianSink& sink, Workspace&) const {
  sink.target().add_multiples<Dim>(cells_, mass_, unit_mass_block<Dim>(kind_));
  if (curved_mass_.empty()) return;
  std::vector<double> factors;  // and what else the blocks follow from, beside their stencils
  for (const CurvedMass& curved : curved_mass_) factors.push_back(curved.mass);
  const std::span kept(matrices_.front().data(), static_cast<std::size_t>(matrices_.size() * matrices_.front().size()));
  sink.target().add_curved_multiples<Dim>(
      cells_, factors, kept, [&](std::size_t e) -> const auto& { return matrices_[curved_mass_[e].matrix]; });
}

template <int Dim>
void get_unit_mass_diagonal(const CellSet<Dim>& cells, VectorView diagonal) {
  diagonal.setZero();
  for (const auto& element : cells.straight())
    for (const int v : element.vertices)
      diagonal.segment<Dim>(Dim * v).array() += 2 * element.volume / ((Dim + 1) * (Dim + 2));
  for (const auto& element : cells.curved()) {
    const auto one = [](const Vec<Dim>&) { return 1.0; };
    Vec<kQuadraticNodes<Dim>> mass = constant_quadratic_mass<Dim>(MassKind::consistent, element.curved).diagonal();
    if (cells.axisymmetric) mass = varying_mass<Dim>(cells, element, MassKind::consistent, one).diagonal();
    const auto nodes = element.nodes();
    for (int k = 0; k < kQuadraticNodes<Dim>; ++k) diagonal.segment<Dim>(Dim * nodes[k]).array() += element.volume * mass[k];
  }
  const auto used = (diagonal.array() > 0).count();
  const double mean = used > 0 ? diagonal.sum() / static_cast<double>(used) : 1;
  for (double& entry : diagonal)
    if (entry == 0) entry = mean;
}

#define ITR_INSTANTIATE(Dim)         \
  template class InertiaEnergy<Dim>; \
  template void get_unit_mass_diagonal<Dim>(const CellSet<Dim>&, VectorView);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
