// SPDX-License-Identifier: MIT
#include "itr/energy/inertia.hpp"

#include "itr/core/parallel.hpp"
#include "itr/energy/elastic/laws.hpp"

namespace itr {

namespace {
constexpr std::size_t kBlock = 256;

struct FromPredictor {
  KeptVector way;
};
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
  mass_.reserve(cells_.elements.size());
  for (const auto& element : cells_.elements)
    mass_.push_back(mass_density<Dim>(materials.at(element.body), rest_barycenter(cells_, element)) * element.volume);
  predictor_ = predictor;
  residual_.resize(0);
  loss_ = 0;
}

template <int Dim>
void InertiaEnergy<Dim>::set_unrepresented_history(ConstVectorView residual, double loss) {
  residual_ = residual;
  loss_ = loss;
}

template <int Dim>
double InertiaEnergy<Dim>::value(ConstVectorView x, Workspace&) const {
  const ConstVectorView predictor = predictor_.view();
  double sum = parallel_sum(mass_.size(), kBlock, [&](std::size_t begin, std::size_t end) {
    double part = 0;
    for (std::size_t e = begin; e < end; ++e) {
      Vec<Dim> total = Vec<Dim>::Zero();
      double squares = 0;
      for (const int v : cells_.elements[e].vertices) {
        const Vec<Dim> d = x.segment<Dim>(Dim * v) - predictor.segment<Dim>(Dim * v);
        total += d;
        squares += d.squaredNorm();
      }
      const ElementMass<Dim> mass(kind_, mass_[e]);
      part += 0.5 * (mass.off * total.squaredNorm() + mass.extra * squares);
    }
    return part;
  });
  if (residual_.size() > 0) sum += residual_.view().dot(x - predictor) + loss_;
  return sum;
}

template <int Dim>
void InertiaEnergy<Dim>::add_mass_product(ConstVectorView x, VectorView y) const {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Dim, Eigen::RowMajor>;
  const Eigen::Map<const Rows> from(x.data(), x.size() / Dim, Dim);
  Eigen::Map<Rows> to(y.data(), y.size() / Dim, Dim);
  for (std::size_t e = 0; e < mass_.size(); ++e)
    ElementMass<Dim>(kind_, mass_[e]).add_product(cells_.elements[e].vertices, from, to);
}

template <int Dim>
void InertiaEnergy<Dim>::add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const {
  VectorView way = workspace.get<FromPredictor>().way.resize(x.size());
  way = x - predictor_.view();
  add_mass_product(way, gradient);
  if (residual_.size() > 0) gradient += residual_.view();
}

template <int Dim>
void InertiaEnergy<Dim>::add_hessian(ConstVectorView, PsdProjection, HessianSink& sink, Workspace&) const {
  constexpr int kDofs = Dim * (Dim + 1);
  const ElementMass<Dim> unit_mass(kind_, 1);
  Mat<kDofs> unit = Mat<kDofs>::Zero();
  for (int i = 0; i <= Dim; ++i)
    for (int j = 0; j <= Dim; ++j)
      for (int c = 0; c < Dim; ++c) unit(Dim * i + c, Dim * j + c) = unit_mass.off + (i == j ? unit_mass.extra : 0);
  sink.add_multiples<Dim>(cells_, mass_, unit);
}

template <int Dim>
void get_unit_mass_diagonal(const CellSet<Dim>& cells, VectorView diagonal) {
  diagonal.setZero();
  for (const auto& element : cells.elements)
    for (const int v : element.vertices)
      diagonal.segment<Dim>(Dim * v).array() += 2 * element.volume / ((Dim + 1) * (Dim + 2));
  const auto used = (diagonal.array() > 0).count();
  const double mean = used > 0 ? diagonal.sum() / static_cast<double>(used) : 1;
  for (double& entry : diagonal)
    if (entry == 0) entry = mean;
}

#define ITR_INSTANTIATE(Dim)         \
  template class InertiaEnergy<Dim>; \
  template void get_unit_mass_diagonal<Dim>(const CellSet<Dim>&, VectorView);
ITR_INSTANTIATE(2)
ITR_INSTANTIATE(3)
#undef ITR_INSTANTIATE

}  // namespace itr
