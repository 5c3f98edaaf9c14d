// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "itr/module.h"

namespace itr::backends {

/// Our name of an ordering and the library's number for it.
using Ordering = std::pair<std::string_view, int>;

/// The library's number for the option ordering=NAME; none for another option or name.
template <std::size_t N>
std::optional<int> find_ordering(const Ordering (&table)[N], std::string_view key, std::string_view value) {
  if (key != "ordering") return {};
  for (const auto& [name, number] : table)
    if (name == value) return number;
  return {};
}

/// The fill-reducing order of an analysis, for later ones of patterns that are much alike: contacts come and go.
class KeptOrder {
 public:
  /// `permutation` as the library gives and takes it; `flops` of a factorisation, as its analysis predicts them.
  void keep(const int* permutation, int order, double flops) {
    permutation_.assign(permutation, permutation + order);
    flops_ = flops;
  }
  /// Whether there is one that may serve this analysis. Where none may, it is forgotten: what comes must not depend on it.
  bool recall(const itr_pattern& pattern, const itr_hints& hints) {
    if (hints.may_keep_order == 0) permutation_.clear();
    return permutation_.size() == static_cast<std::size_t>(pattern.order);
  }
  int* permutation() { return permutation_.data(); }
  /// Whether a factorisation in this order is still worth what it costs.
  bool is_good(double flops) const { return flops <= kWorse * flops_; }

 private:
  static constexpr double kWorse = 1.2;
  std::vector<int> permutation_;
  double flops_ = 0;  ///< of a factorisation when it was new
};

}  // namespace itr::backends
