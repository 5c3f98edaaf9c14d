// SPDX-License-Identifier: MIT
// Makes a MeshFile of nodes, elements and groups as formats have them: with numbers of their own, in any order.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "mesh/mesh_file.hpp"

namespace itr {

class MeshBuilder {
 public:
  explicit MeshBuilder(const std::filesystem::path& file) : file_(file) {}

  void add_node(std::int64_t tag, const Vec<3>& X);
  std::size_t num_nodes() const { return tags_.size(); }

  /// Adds an element of dimension 1, 2 or 3 by the tags of its corners and, if it is of second order, of the nodes of its
  /// edges 01, 12, 20, 03, 13, 23. `number` is for messages. Returns its index among those of its dimension.
  int add_element(int dim, std::span<const std::int64_t> nodes, std::int64_t number);
  /// How many nodes an element of first or second order has.
  static constexpr std::size_t num_nodes_of(int dim, bool is_second_order) {
    return static_cast<std::size_t>(is_second_order ? (dim + 1) * (dim + 2) / 2 : dim + 1);
  }

  /// The group with this number and name, made where there is none; what add_member takes.
  int group(int dim, int number, std::string_view name);
  /// Adds an element by its index, or in dimension 0 a node by its tag.
  void add_member(int group, std::int64_t member);

  /// The corners of an element.
  std::span<const std::int64_t> corners(int dim, std::int64_t index) const {
    return std::span(corners_[dim]).subspan(static_cast<std::size_t>((dim + 1) * index), dim + 1);
  }

  /// Whether the format lists an element once for each of its groups: they become one, with the first number as body.
  bool lists_elements_again = false;

  /// Node tags 1..n are positions; otherwise nodes are numbered as they come. Throws InputError for tags that are there
  /// twice and for unknown ones.
  MeshFile finish();

 private:
  struct Middle {
    std::array<std::int64_t, 3> tags;  ///< ends of an edge, its node
    std::int64_t element;
    int dim;
  };

  void number_nodes();
  int index_of(std::int64_t tag, const std::string& place) const;
  template <std::size_t N>
  void take_elements(std::vector<std::array<int, N>>& to);
  void take_groups();
  template <std::size_t N>
  void merge_repeated(std::vector<std::array<int, N>>& elements, int dim);
  bool measure_sag(const Middle& middle, int a, int b, int m);
  void drop_middles();
  std::string place_of(int dim, std::int64_t element) const;

  const std::filesystem::path& file_;
  MeshFile mesh_;
  std::vector<std::int64_t> tags_;  ///< of the nodes, as they come
  std::unordered_map<std::int64_t, int> index_;
  std::array<std::vector<std::int64_t>, 4> corners_, numbers_;  ///< by dimension
  std::array<std::vector<int>, 4> first_number_;                ///< by dimension: of each element's first group
  std::vector<Middle> middles_;
  std::map<std::tuple<int, int, std::string>, int> group_;
  std::vector<std::vector<std::int64_t>> members_;  ///< of the groups, as they come
};

}  // namespace itr
