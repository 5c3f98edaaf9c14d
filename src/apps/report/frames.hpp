// SPDX-License-Identifier: MIT
// Stored frames as a page keeps them. A vertex, cell or facet that stays from frame to frame is stored once, with the frames
// between which it lives: so the mesh takes room only where it changes, and edits are born and dead rows.
#pragma once

#include <array>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "output/frame_file.hpp"

namespace itr::report {

using output::StoredField;
using output::StoredFrame;
using output::StoredSurface;

/// Rows of integers, each of which is there from frame `birth` to the one before `death`.
class LivingRows {
 public:
  using Key = std::array<double, 5>;
  static constexpr int kNever = 1 << 30;  ///< death of a row that is in the last frame

  explicit LivingRows(int columns) : columns_(columns) {}
  void begin(int frame);
  /// Returns the id of the row of this key, which is a new one where the frame before has none: `row` is copied then.
  int touch(const Key& key, const std::vector<int>& row);
  /// Ends the life of rows that were not touched. Returns whether rows were born or have died.
  bool end();
  int size() const { return static_cast<int>(birth_.size()); }

  /// Rows that some of the chosen frames have.
  struct Chosen {
    std::vector<int> rows, birth, death;  ///< birth and death count the chosen frames
    std::vector<int> new_id;              ///< by id; -1: not chosen
  };
  Chosen choose(const std::vector<int>& frames) const;
  /// Column `k` of the chosen rows.
  std::vector<int> column(const Chosen& chosen, int k) const;

 private:
  int columns_, frame_ = 0;
  bool has_born_ = false;
  std::vector<int> rows_, birth_, death_;
  std::map<Key, int> before_, now_;  ///< ids in the frame before that were not yet touched, and in this frame
};

struct FieldName {
  std::string name, unit;
};

struct EncodedFrame {
  int step = 0;
  double t = 0;
  int mesh = 0;                                         ///< frames with the same number have the same mesh
  int vertices = 0, cells = 0;                          ///< of the bodies
  std::map<std::string, std::array<double, 3>> forces;  ///< resultants of the forces by vertex [N]
  std::array<double, 3> low{}, high{};                  ///< box of the displacements [m]
  std::string bytes;                                    ///< displacements and fields, compressed
};

/// Encodes frames one after another, each by itself: displacements as 16-bit fractions of their box in this frame, fields as
/// 16-bit logarithms, all in the order of the ids.
class FrameEncoder {
 public:
  /// Throws InputError where its dimension or its obstacles are not those of the first.
  void add(const std::filesystem::path& path);

  int dim() const { return dim_; }
  const Units& units() const { return units_; }
  const std::array<double, 3>& origin() const { return origin_; }
  /// Box of the bodies over all frames [m].
  const std::array<double, 3>& low() const { return low_; }
  const std::array<double, 3>& high() const { return high_; }
  const std::vector<EncodedFrame>& frames() const { return frames_; }
  const std::vector<FieldName>& vertex_fields() const { return vertex_fields_; }
  const std::vector<FieldName>& cell_fields() const { return cell_fields_; }
  /// Meshes of the chosen frames, compressed.
  struct Topology {
    std::string bytes;
    nlohmann::ordered_json counts;  ///< lengths of the tables in `bytes`
  };
  Topology topology(const std::vector<int>& frames) const;
  const std::vector<double>& largest() const { return largest_; }  ///< by field, those of vertices first
  /// By field: a bound that few values of each frame exceed, for colours that a single peak does not take.
  const std::vector<double>& shown() const { return shown_; }
  double largest_u() const { return largest_u_; }
  /// Over all cells and frames, least and most.
  const std::array<double, 2>& volume_ratios() const { return volume_ratios_; }
  const std::array<double, 2>& longest_edges() const { return longest_edges_; }

 private:
  struct Order {
    std::vector<int> id_of_node, id_of_cell;
    std::vector<std::pair<int, int>> vertices, cells;  ///< id, node (nodes of obstacles after the bodies'); id, cell
  };
  void start(const StoredFrame& frame, const std::vector<StoredField>& fields);
  std::array<double, 3> read_point(const std::vector<double>& from, int i) const;
  // Vertices, cells, facets and curved edges of a frame, in this order, each by ids of the kinds before. True: changed.
  bool touch_vertices(const StoredFrame& frame, Order& order);
  bool touch_cells(const StoredFrame& frame, Order& order);
  bool touch_facets(const StoredFrame& frame, const Order& order);
  bool touch_curved_edges(const StoredFrame& frame, const Order& order);
  void add_displacements(const StoredFrame& frame, const Order& order, EncodedFrame& entry, std::string& bytes);
  void add_vertex_fields(const std::vector<StoredField>& fields, const Order& order, EncodedFrame& entry,
                         std::string& bytes);
  void add_cell_fields(const std::vector<StoredField>& fields, const Order& order, std::string& bytes);
  void add_values(std::size_t field, std::vector<double> values, std::string& bytes);
  template <int Dim>
  void measure_cells(const StoredFrame& frame);

  int dim_ = 0;
  Units units_;
  std::array<double, 3> origin_{}, low_{}, high_{};
  LivingRows vertices_{1}, cells_{0}, facets_{0}, curved_{3};
  std::vector<std::array<double, 3>> rest_;  ///< by id of vertices_
  StoredSurface obstacles_;                  ///< of the first frame
  std::vector<FieldName> vertex_fields_, cell_fields_;
  std::vector<double> largest_, shown_;
  double largest_u_ = 0, gap_limit_ = 0;
  std::array<double, 2> volume_ratios_{INFINITY, -INFINITY}, longest_edges_{INFINITY, -INFINITY};
  std::vector<EncodedFrame> frames_;
};

}  // namespace itr::report
