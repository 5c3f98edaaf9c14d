// SPDX-License-Identifier: MIT
#pragma once

#include "direction.hpp"
#include "search.hpp"

namespace itr {

/// NewtonSummary::message of a solve that ends at a saddle.
inline constexpr const char* kFlatSaddle = "the Hessian has negative eigenvalues, but no way along them lowers the energy";

/// The way off a saddle, where Newton's method would end as if it were a minimum.
class Saddle {
 public:
  Saddle(const Task& task, Iterate& at, Direction& direction, Search& search);

  bool is_here();
  /// Called before a solve ends: leaves x if it is a saddle. Returns whether x has moved to a lower energy.
  bool leave() { return is_here() && descend(); }

 private:
  struct Kept {
    KeptVector candidate;
  };
  bool descend();
  bool find_way(VectorView way);
  bool asks_products() const;
  double curvature_by_products();

  const Task& task_;
  Iterate& at_;
  Direction& direction_;
  Search& search_;
  VectorView candidate_;
  VectorX eigenvector_;  ///< by products, of the curvature below
  double curvature_ = 0;
  int known_at_ = kNone;  ///< revision of x where that was
};

}  // namespace itr
