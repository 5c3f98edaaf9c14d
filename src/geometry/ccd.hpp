// SPDX-License-Identifier: MIT
// Conservative continuous collision detection of linear motions: time moves forward by a lower bound of the time that the
// primitives need to come within a fraction of their initial distance (Mirtich 1996; Li et al. 2021, "Codimensional
// Incremental Potential Contact", section 5). It may stop early, never late.
#pragma once

#include "itr/types.hpp"

namespace itr {

struct CcdOptions {
  double min_separation_ratio = 0.2;  ///< stop at this fraction of the initial distance
  double passing_ratio = 1e-10;       ///< but not where the primitives never come nearer than this one
  int max_iterations = 200;           ///< it stops early where they do not do
};

/// 1 if the point p and the edge a b, moving from *0 to *1, keep a distance of at least `passing_ratio` of their initial
/// one; else the largest t such that on [0, t] they keep at least `min_separation_ratio` of it. Both conservative estimates;
/// 0 only if they touch at the start. No motion brings primitives nearer than 1e-14 of their largest coordinate, where
/// round-off could decide on which side they are: from such a distance, 0 unless they move apart.
/// Pairs of input within round-off stay: 0.
template <int Dim>
double point_edge_ccd(const Vec<Dim>& p0, const Vec<Dim>& a0, const Vec<Dim>& b0, const Vec<Dim>& p1, const Vec<Dim>& a1,
                      const Vec<Dim>& b1, const CcdOptions& options = {});

double edge_edge_ccd(const Vec<3>& a0, const Vec<3>& b0, const Vec<3>& c0, const Vec<3>& d0, const Vec<3>& a1,
                     const Vec<3>& b1, const Vec<3>& c1, const Vec<3>& d1, const CcdOptions& options = {});
double point_triangle_ccd(const Vec<3>& p0, const Vec<3>& a0, const Vec<3>& b0, const Vec<3>& c0, const Vec<3>& p1,
                          const Vec<3>& a1, const Vec<3>& b1, const Vec<3>& c1, const CcdOptions& options = {});

}  // namespace itr
