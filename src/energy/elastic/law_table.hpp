// SPDX-License-Identifier: MIT
// The table of laws that may be summed (docs/theory.md, "Sums of laws"): a row has the law's type and coefficients, as
// scenes call them, and its energy density. A scene's reader, derivatives and tests are made of the rows.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "energy/elastic/volume_response.hpp"
#include "itr/options.hpp"

namespace itr {

class StretchResponse;

/// A coefficient of a law, or a list of them.
struct LawCoefficient {
  enum class Range { any, positive, not_zero, share, third, compressible, above_one };

  const char* key;
  Range range;
  bool is_list = false;                           ///< of one length with the law's first list, unless `has_own_length`
  std::optional<double> fallback = std::nullopt;  ///< where a scene leaves it out; K may be left out in a sum
  bool has_own_length = false;
};

/// By coefficient of the row: its number, or its list.
using LawValues = std::vector<std::vector<double>>;

/// A fibre's energy density w(x) and its derivatives; x = M : C J^(-2/d) - 1, M the fibre's structure tensor.
struct FibreResponse {
  double value, first, second;
};

/// One law: isotropic, by `add`, or a fibre.
struct LawRow {
  const char* type;
  std::vector<LawCoefficient> coefficients;
  void (*add)(const LawValues& values, StretchResponse& response) = nullptr;
  FibreResponse (*fibre)(const LawValues& values, double x) = nullptr;
  bool has_lame = false;      ///< its first two coefficients are lambda and mu, which E and nu may stand for
  bool only_in_sums = false;  ///< alone another implementation stands for its type
  int dispersion = -1;        ///< of a fibre: which coefficient is kappa of M = kappa I + (1 - d kappa) a a^T; -1: 0
};
std::span<const LawRow> law_rows();

/// A sum of laws, the own law of a material.
class LawSum final : public OwnLaw {
 public:
  struct Term {
    const LawRow* row;
    LawValues values;
    std::function<Vec<3>(const Vec<3>& X)> direction{};  ///< of a fibre at rest position X, of length 1
    /// Which share of a fibre's energy acts at X and the time t [s], of [0, 1]; empty: all of it.
    std::function<double(const Vec<3>& X, double t)> share{};
  };
  std::vector<Term> terms;  ///< isotropic ones first
  int dimension = 3;        ///< d of all invariants; 2: PolyFEM's in 2D
  bool is_plane_stress = false;
  double time = 0;  ///< of shares [s]

  std::string name() const;

  // At the origin, as programs ask. Energies take sum_density and its like, which are more precise and know the place.
  double density(const Eigen::Ref<const MatrixX>& F) const override;
  void stress(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> P) const override;
  void hessian(const Eigen::Ref<const MatrixX>& F, Eigen::Ref<MatrixX> H) const override;
};

/// The sum that is a material's own law; null if it has another law.
inline const LawSum* sum_of(const Material& material) { return dynamic_cast<const LawSum*>(material.own.get()); }

/// Shear and bulk modulus (in 2 dimensions lambda + mu) of the isotropic part at rest [Pa].
struct RestModuli {
  double shear, bulk;
};
RestModuli rest_moduli(const LawSum& sum);

/// The sum of the volumetric parts, by ln J.
VolumeResponse volume_response(const LawSum& sum, double log_J);

/// Whether a material has constant moduli and a law with a part U(J), of which J may be averaged (VolumeForm::patches).
bool may_average_volume(const Material& material, int dim);
/// Whether it may, and point by point would lock linear elements: from nu = 0.48 on.
bool is_nearly_incompressible(const Material& material, int dim);

/// Why a material of bodies in `dim` dimensions (3 where they are turned) cannot be viscoelastic; empty: it can.
std::string why_not_viscous(const Material& material, int dim);

/// Why it cannot soften after Mullins, for which it needs an isochoric part; empty: it can.
std::string why_not_softening(const Material& material, int dim);

/// A material of the sum in a space of `dim` dimensions, whose moduli at rest must be > 0; E and nu are made of these.
Material material_of(const LawSum& sum, int dim);

/// A material of W = e : C e / 2 with the small strain e, or with Green's strain. `stiffness` is C in Voigt's form [Pa],
/// positive definite: 11, 22, 33, 23, 13, 12 (2D: 11, 22, 12), shears twice those of the tensor. E and nu are those of its
/// mean over all directions.
Material tensor_material(const MatrixX& stiffness, bool is_small_strain);
/// The stiffness of the same material turned by a rotation R, which maps its axes to those of space.
MatrixX turned(const MatrixX& stiffness, const MatrixX& R);

/// The body force by volume [N/m^Dim] that holds a material at X in a field of displacements u: -div P, by its gradient and
/// second[i], the derivatives of row i of that.
template <int Dim>
Vec<Dim> holding_force(const Material& material, const Vec<Dim>& X, const Mat<Dim>& gradient,
                       const std::array<Mat<Dim>, Dim>& second);

}  // namespace itr
