// SPDX-License-Identifier: MIT
// Isotropic energy densities as functions of the principal logarithmic strains e_i = ln s_i of F. They are made of sums of
// powers of stretches, in which neither values nor derivatives cancel at small strains or at equal stretches.
#pragma once

#include "energy/elastic/volume_response.hpp"
#include "itr/types.hpp"

namespace itr {

/// A symmetric function of the strains, with its derivatives by them.
struct StretchSum {
  double value = 0;
  Vec<3> first = Vec<3>::Zero();
  Mat<3> second = Mat<3>::Zero();
  Vec<3> divided = Vec<3>::Zero();  ///< [k]: (first[i] - first[j]) / (e_i - e_j) of the other two, its limit where e_i = e_j
};

/// sinh(x) / x.
double sinh_ratio(double x);

/// bulk/4 (J^2 - 1 - 2 ln J), by ln J.
VolumeResponse square_bulk(double bulk, double log_J);

/// Accumulates W at given strains. `first` are then principal Kirchhoff stresses [Pa].
class StretchResponse {
 public:
  /// `dimension`: how many stretches the law has, 3, or 2 where those in the plane are all. `log_J` is their sum. With
  /// `is_split` the sum has no volumetric parts. What is added by `add` counts `deviator` times; without `has_bulk` there is
  /// nothing else.
  StretchResponse(int dimension, const Vec<3>& strains, double log_J, bool is_split = false, double deviator = 1,
                  bool has_bulk = true)
      : dimension_(dimension),
        strains_(strains),
        log_J_(log_J),
        is_split_(is_split || !has_bulk),
        deviator_(deviator),
        bulk_(has_bulk ? 1 : 0) {}

  int dimension() const { return dimension_; }
  double log_J() const { return log_J_; }
  const StretchSum& sum() const { return sum_; }
  const VolumeResponse& volume() const { return volume_; }  ///< volumetric parts, by ln J

  /// sum_i (t_i^alpha - 1) of isochoric stretches t_i = J^(-1/dimension) s_i.
  StretchSum isochoric_powers(double alpha) const;
  /// sum_i (t_i^alpha - 1) of t_i = J^(-share/dimension) s_i.
  StretchSum powers_by_volume(double alpha, double share) const;
  /// sum_i (s_i^alpha - 1) - alpha ln J.
  StretchSum powers(double alpha) const;

  /// Adds f(S); `d1`, `d2`: f' and f''.
  void add(double f, double d1, double d2, const StretchSum& S);
  void add(double factor, const StretchSum& S) { add(factor * S.value, factor, 0, S); }
  /// Adds factor sum_i e_i^2, of which factor / dimension (ln J)^2 is no change of shape.
  void add_squares(double factor);
  /// Adds U(ln J) with its derivatives by ln J, as a volumetric part.
  void add_volume(double U, double d1, double d2);
  /// Adds a function of ln J that stays in the cells.
  void add_to_cell(const VolumeResponse& by_log_J);

 private:
  StretchSum powers_of(double alpha, const Vec<3>& strains) const;

  int dimension_;
  Vec<3> strains_;
  double log_J_;
  bool is_split_;
  double deviator_, bulk_;
  StretchSum sum_;
  VolumeResponse volume_;
};

}  // namespace itr
