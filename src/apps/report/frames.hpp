// SPDX-License-Identifier: MIT
// Stored frames as a page keeps them. A vertex, cell or facet that stays from frame to frame is stored once, with the frames
// between which it lives: so topology takes room only where it changes, and edits are what is born and what dies.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <unordered_map>
#include <vector>

#include "output/frame_file.hpp"

namespace itr::output {

/// Rows of integers, each of which is there from frame `birth` to the one before `death`.
class LivingRows {
 public:
  using Key = std::array<std::uint64_t, 5>;  ///< of one kind of rows all as long, and then 0
  explicit LivingRows(int columns) : columns_(columns) {}
  void begin(int frame) { frame_ = frame; }
  /// The row of this key, which is a new one where the frame before has none: `row` is copied then.
  int touch(const Key& key, const std::vector<int>& row);
  /// Rows that were not touched are no more.
  void end();
  int size() const { return static_cast<int>(birth_.size()); }
  int birth(int id) const { return birth_[id]; }
  /// Number of rows that were born or have died in the last frame.
  int changes() const { return changes_; }
  /// Ascending: those that the last frame has.
  const std::vector<int>& alive() const { return alive_; }
  /// Columns, births and deaths, see encode_integers.
  std::string encode() const;

  struct Hash {
    std::size_t operator()(const Key& key) const;
  };

 private:
  int columns_, frame_ = 0, changes_ = 0, first_unborn_ = 0;
  std::vector<int> rows_, birth_, death_, touched_, alive_;
  std::unordered_map<Key, int, Hash> ids_;
  std::vector<Key> keys_;
};

/// Column by column, differences from the row above, their bytes sorted by weight: what compresses well.
std::string encode_integers(const std::vector<int>& values, int columns);

/// For each facet of the surface the cell that has it.
std::vector<int> cells_of_facets(const StoredFrame& frame);

struct FieldName {
  std::string name, unit;
};

struct EncodedFrame {
  int step = 0;
  double t = 0;
  int mesh = 0;                                         ///< frames with the same number have the same mesh
  int vertices = 0, cells = 0;                          ///< of the bodies
  std::map<std::string, std::array<double, 3>> forces;  ///< resultants of the forces by vertex [N]
};

struct EncodedChunk {
  int first = 0, count = 0;             ///< frames
  std::array<double, 3> low{}, high{};  ///< box of the displacements
  std::string bytes;                    ///< compressed
};

/// Takes frames one after another.
class FrameEncoder {
 public:
  /// `with_inside`: also cells of solids that have no facet on the surface.
  explicit FrameEncoder(bool with_inside) : with_inside_(with_inside) {}
  /// Throws InputError where its dimension or its obstacles are not those of the first.
  void add(const std::filesystem::path& path);
  void finish() { flush(); }

  int dim() const { return dim_; }
  const Units& units() const { return units_; }
  const std::array<double, 3>& origin() const { return origin_; }
  /// Box of the bodies over all frames [m].
  const std::array<double, 3>& low() const { return low_; }
  const std::array<double, 3>& high() const { return high_; }
  const std::vector<EncodedFrame>& frames() const { return frames_; }
  const std::vector<EncodedChunk>& chunks() const { return chunks_; }
  const std::vector<FieldName>& vertex_fields() const { return vertex_fields_; }
  const std::vector<FieldName>& cell_fields() const { return cell_fields_; }
  /// Bytes of all meshes, compressed; `counts` are the lengths of its tables, as JSON.
  std::string topology(std::string& counts) const;
  const std::vector<double>& largest() const { return largest_; }  ///< by field, those of vertices first
  /// By field: what few values of each frame exceed, for colours that a single peak does not take.
  const std::vector<double>& shown() const { return shown_; }
  double largest_u() const { return largest_u_; }
  /// Over all cells and frames, least and most.
  const std::array<double, 2>& volume_ratios() const { return volume_ratios_; }
  const std::array<double, 2>& longest_edges() const { return longest_edges_; }
  std::size_t bytes() const;  ///< of all that is compressed so far, without the topology

 private:
  struct Pending {
    std::vector<int> vertices, cells;                                  ///< ids
    std::array<std::vector<double>, 3> u;                              ///< by component, in the order of `vertices`
    std::vector<std::vector<std::uint16_t>> vertex_codes, cell_codes;  ///< by field
  };
  struct Shown;
  void start(const StoredFrame& frame, const std::vector<StoredField>& fields);
  std::array<double, 3> read_point(const std::vector<double>& from, int i) const;
  // Vertices, nodes, cells and facets of a frame, in this order, each by ids of the kinds before; then positions and fields.
  void touch_vertices(const StoredFrame& frame, Shown& shown);
  void touch_cells(const StoredFrame& frame, Shown& shown);
  void touch_facets(const StoredFrame& frame, const Shown& shown);
  void touch_curved_edges(const StoredFrame& frame, const Shown& shown);
  void add_positions(const StoredFrame& frame, const Shown& shown, Pending& pending);
  void add_vertex_fields(const std::vector<StoredField>& fields, const Shown& shown, Pending& pending, EncodedFrame& entry);
  void add_cell_fields(const std::vector<StoredField>& fields, const Shown& shown, Pending& pending);
  std::uint16_t code(std::size_t field, double value);
  void include_shown(std::size_t field, std::vector<double> values);
  void measure(const StoredFrame& frame, int cell);
  void flush();

  bool with_inside_;
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
  std::vector<EncodedChunk> chunks_;
  std::vector<Pending> pending_;
};

}  // namespace itr::output
