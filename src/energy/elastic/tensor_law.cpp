// SPDX-License-Identifier: MIT
// Quadratic laws of any anisotropy. With the strain e in Voigt's form and B = de/dF, the stress by F is B^T C e.
#include <Eigen/LU>

#include "energy/elastic/laws.hpp"
#include "law_table.hpp"

namespace itr {

namespace {

/// Places of Voigt's components in a tensor, shears after the diagonal: 23, 13, 12.
std::vector<std::array<int, 2>> voigt_places(int dim) {
  if (dim == 2) return {{0, 0}, {1, 1}, {0, 1}};
  return {{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}};
}
int dimension_of(const MatrixX& stiffness) { return stiffness.rows() == 3 ? 2 : 3; }

class TensorLaw final : public OwnLaw {
 public:
  TensorLaw(MatrixX stiffness, bool is_small_strain)
      : stiffness_(std::move(stiffness)),
        is_small_strain_(is_small_strain),
        dim_(dimension_of(stiffness_)),
        places_(voigt_places(dim_)) {}

  double density(const Eigen::Ref<const MatrixX>& F) const override {
    const VectorX e = strain(F);
    return e.dot(stiffness_ * e) / 2;
  }
  void stress(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> P) const override { P = frame(F) * inner_stress(F); }
  void hessian(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> H) const override {
    const MatrixX B = strain_derivative(F);
    H = B.transpose() * stiffness_ * B;
    if (is_small_strain_) return;
    const MatrixX S = inner_stress(F);
    for (int j = 0; j < dim_; ++j)
      for (int l = 0; l < dim_; ++l)
        for (int i = 0; i < dim_; ++i) H(i + dim_ * j, i + dim_ * l) += S(j, l);
  }
  bool has_small_strain() const override { return is_small_strain_; }

 private:
  VectorX strain(const Eigen::Ref<const MatrixX>& F) const {
    const MatrixX G = F - MatrixX::Identity(dim_, dim_);
    MatrixX twice = G + G.transpose();
    if (!is_small_strain_) twice += G.transpose() * G;
    VectorX e(static_cast<Eigen::Index>(places_.size()));
    for (std::size_t v = 0; v < places_.size(); ++v) {
      const auto [a, b] = places_[v];
      e[static_cast<Eigen::Index>(v)] = a == b ? twice(a, a) / 2 : twice(a, b);
    }
    return e;
  }
  /// The symmetric stress C e.
  MatrixX inner_stress(const Eigen::Ref<const MatrixX>& F) const {
    const VectorX s = stiffness_ * strain(F);
    MatrixX S(dim_, dim_);
    for (std::size_t v = 0; v < places_.size(); ++v) {
      const auto [a, b] = places_[v];
      S(a, b) = S(b, a) = s[static_cast<Eigen::Index>(v)];
    }
    return S;
  }
  MatrixX frame(const Eigen::Ref<const MatrixX>& F) const {
    return is_small_strain_ ? MatrixX(MatrixX::Identity(dim_, dim_)) : MatrixX(F);
  }
  MatrixX strain_derivative(const Eigen::Ref<const MatrixX>& F) const {
    const MatrixX A = frame(F);
    MatrixX B = MatrixX::Zero(static_cast<Eigen::Index>(places_.size()), dim_ * dim_);
    for (std::size_t v = 0; v < places_.size(); ++v) {
      const auto [a, b] = places_[v];
      for (int k = 0; k < dim_; ++k) {
        B(static_cast<Eigen::Index>(v), k + dim_ * a) = A(k, b);
        B(static_cast<Eigen::Index>(v), k + dim_ * b) = A(k, a);
      }
    }
    return B;
  }

  MatrixX stiffness_;
  bool is_small_strain_;
  int dim_;
  std::vector<std::array<int, 2>> places_;
};

}  // namespace

Material tensor_material(const MatrixX& stiffness, bool is_small_strain) {
  Material material{.law = MaterialLaw::own, .own = std::make_shared<TensorLaw>(stiffness, is_small_strain)};
  const int dim = dimension_of(stiffness), pairs = dim == 2 ? 1 : 3;
  const double along = stiffness.diagonal().head(dim).sum(), shears = stiffness.diagonal().tail(pairs).sum();
  const double across = (stiffness.topLeftCorner(dim, dim).sum() - along) / 2;
  const double bulk = (along + 2 * across) / (dim * dim);  // 2D: lambda + mu
  const double shear = dim == 2 ? (along - 2 * across + 4 * shears) / 8 : (along - across + 3 * shears) / 15;
  material.poisson_ratio = dim == 2 ? (bulk - shear) / (bulk + shear) : (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear));
  material.youngs_modulus = 2 * shear * (1 + material.poisson_ratio);
  return material;
}

MatrixX turned(const MatrixX& stiffness, const MatrixX& R) {
  const auto places = voigt_places(dimension_of(stiffness));
  const auto n = static_cast<Eigen::Index>(places.size());
  MatrixX of_stress(n, n);  // components of R S R^T by those of S
  for (Eigen::Index v = 0; v < n; ++v)
    for (Eigen::Index w = 0; w < n; ++w) {
      const auto [a, b] = places[static_cast<std::size_t>(v)];
      const auto [c, d] = places[static_cast<std::size_t>(w)];
      of_stress(v, w) = R(a, c) * R(b, d) + (c == d ? 0 : R(a, d) * R(b, c));
    }
  return of_stress * stiffness * of_stress.transpose();
}

template <int Dim>
Vec<Dim> holding_force(const Material& material, const Vec<Dim>& X, const Mat<Dim>& gradient,
                       const std::array<Mat<Dim>, Dim>& second) {
  const EigenSystem<Dim> system =
      elastic_eigensystem<Dim>(Mat<Dim>(Mat<Dim>::Identity() + gradient), elastic_moduli<Dim>(material, X));
  Vec<Dim> force = Vec<Dim>::Zero();
  for (int k = 0; k < Dim * Dim; ++k) {
    const Mat<Dim>& mode = system.modes[k];
    for (int j = 0; j < Dim; ++j) {
      double along = 0;  // the mode's part in dF/dX_j
      for (int i = 0; i < Dim; ++i) along += mode.row(i).dot(second[i].col(j));
      force -= system.values[k] * along * mode.col(j);
    }
  }
  return force;
}

template Vec<2> holding_force<2>(const Material&, const Vec<2>&, const Mat<2>&, const std::array<Mat<2>, 2>&);
template Vec<3> holding_force<3>(const Material&, const Vec<3>&, const Mat<3>&, const std::array<Mat<3>, 3>&);

}  // namespace itr
