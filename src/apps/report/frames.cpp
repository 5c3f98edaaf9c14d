// SPDX-License-Identifier: MIT
#include "frames.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "deflate.hpp"
#include "gap.hpp"
#include "itr/core/error.hpp"

namespace itr::output {

namespace {

constexpr int kFramesOfChunk = 16;    // decoded together: the more, the smaller; the fewer, the sooner the first is seen
constexpr int kNever = 1 << 30;       // a frame that there is not
constexpr double kGapShare = 0.02;    // of the bodies' diagonal: gaps beyond are not told apart
constexpr double kNothing = 1e-9;     // times the largest value: is shown as zero, as its digits are round-off
constexpr double kShownShare = 0.98;  // of the values of a frame that have colours of their own

enum Kind { vertex_kind, node_kind, obstacle_kind };

std::uint16_t zigzag(std::uint16_t difference) {
  const auto sign = static_cast<std::int16_t>(difference);
  return static_cast<std::uint16_t>((difference << 1) ^ (sign >> 15));
}

/// Low bytes, then high bytes.
void append_codes(std::string& bytes, const std::vector<std::uint16_t>& codes) {
  for (const std::uint16_t code : codes) bytes += static_cast<char>(code & 255);
  for (const std::uint16_t code : codes) bytes += static_cast<char>(code >> 8);
}

std::string encode_floats(const std::vector<float>& values) {
  std::string bytes;
  for (int k = 0; k < 4; ++k)
    for (const float value : values) bytes += static_cast<char>(std::bit_cast<std::uint32_t>(value) >> (8 * k) & 255);
  return bytes;
}

double magnitude(const double* values, int columns) {
  double sum = 0;
  for (int k = 0; k < columns; ++k) sum += values[k] * values[k];
  return std::sqrt(sum);
}

double diagonal(const StoredFrame& frame) {
  double sum = 0;
  for (int k = 0; k < frame.dim; ++k) {
    double low = INFINITY, high = -INFINITY;
    for (std::size_t i = k; i < frame.x.size(); i += frame.dim)
      low = std::min(low, frame.x[i]), high = std::max(high, frame.x[i]);
    if (low < high) sum += (high - low) * (high - low);
  }
  return std::sqrt(sum);
}

LivingRows::Key sorted_key(std::vector<int> ids) {
  std::sort(ids.begin(), ids.end());
  LivingRows::Key key{};
  std::copy(ids.begin(), ids.end(), key.begin());
  return key;
}

}  // namespace

std::vector<int> cells_of_facets(const StoredFrame& frame) {
  const int dim = frame.dim, corners = dim + 1;
  const std::size_t nodes = frame.x.size() / dim, facets = frame.surface.size() / dim;
  std::vector<int> first(nodes + 1), of_vertex(frame.simplices.size());
  for (const std::int64_t v : frame.simplices) ++first[v + 1];
  for (std::size_t v = 0; v < nodes; ++v) first[v + 1] += first[v];
  std::vector<int> next(first.begin(), first.end() - 1);
  for (std::size_t i = 0; i < frame.simplices.size(); ++i)
    of_vertex[next[frame.simplices[i]]++] = static_cast<int>(i) / corners;
  std::vector<int> found(facets, -1);
  for (std::size_t f = 0; f < facets; ++f) {
    const std::int64_t* facet = &frame.surface[f * dim];
    for (int k = first[facet[0]]; k < first[facet[0] + 1] && found[f] < 0; ++k) {
      const std::int64_t* cell = &frame.simplices[static_cast<std::size_t>(of_vertex[k]) * corners];
      const bool has_all = std::all_of(facet, facet + dim,
                                       [&](std::int64_t v) { return std::find(cell, cell + corners, v) != cell + corners; });
      if (has_all) found[f] = of_vertex[k];
    }
  }
  return found;
}

std::string encode_integers(const std::vector<int>& values, int columns) {
  std::string bytes;
  const std::size_t rows = columns ? values.size() / columns : 0;
  std::vector<std::uint32_t> coded(rows);
  for (int k = 0; k < columns; ++k) {
    for (std::size_t i = 0; i < rows; ++i) {
      const int above = i > 0 ? values[(i - 1) * columns + k] : 0;
      const auto difference = static_cast<std::uint32_t>(values[i * columns + k]) - static_cast<std::uint32_t>(above);
      coded[i] = (difference << 1) ^ static_cast<std::uint32_t>(static_cast<std::int32_t>(difference) >> 31);
    }
    for (int byte = 0; byte < 4; ++byte)
      for (const std::uint32_t value : coded) bytes += static_cast<char>(value >> (8 * byte) & 255);
  }
  return bytes;
}

std::size_t LivingRows::Hash::operator()(const Key& key) const {
  std::uint64_t hash = 0x9e3779b97f4a7c15;
  for (const std::uint64_t part : key) {
    hash = (hash ^ part) * 0xff51afd7ed558ccd;
    hash ^= hash >> 33;
  }
  return hash;
}

int LivingRows::touch(const Key& key, const std::vector<int>& row) {
  const auto [place, is_new] = ids_.try_emplace(key, size());
  if (is_new) {
    columns_ = static_cast<int>(row.size());
    rows_.insert(rows_.end(), row.begin(), row.end());
    birth_.push_back(frame_);
    death_.push_back(kNever);
    touched_.push_back(frame_);
    keys_.push_back(key);
  }
  touched_[place->second] = frame_;
  return place->second;
}

void LivingRows::end() {
  changes_ = 0;
  std::vector<int> now;
  for (const int id : alive_) {
    if (touched_[id] == frame_) {
      now.push_back(id);
      continue;
    }
    death_[id] = frame_;
    ids_.erase(keys_[id]);
    keys_[id] = {};
    ++changes_;
  }
  const int first_new = first_unborn_;
  for (int id = first_new; id < size(); ++id) now.push_back(id);
  changes_ += size() - first_new;
  first_unborn_ = size();
  alive_ = std::move(now);
}

std::string LivingRows::encode() const {
  return encode_integers(rows_, columns_) + encode_integers(birth_, 1) + encode_integers(death_, 1);
}

void FrameEncoder::start(const StoredFrame& frame, const std::vector<StoredField>& fields) {
  dim_ = frame.dim;
  units_ = frame.units;
  for (int k = 0; k < dim_ && !frame.x.empty(); ++k) {
    origin_[k] = frame.rest[k];
    low_[k] = high_[k] = frame.x[k];
  }
  obstacles_ = frame.obstacles;
  const std::size_t nodes = frame.x.size() / dim_, cells = frame.body.size();
  for (const StoredField& field : fields) {
    const bool is_by_vertex = field.columns == dim_ || field.columns == 1;
    if (is_by_vertex && field.values.size() == nodes * field.columns)
      vertex_fields_.push_back({field.name, field.unit});
    else if (field.columns == 0 && field.values.size() == cells)
      cell_fields_.push_back({field.name, field.unit});
  }
  largest_.assign(vertex_fields_.size() + cell_fields_.size(), 0);
  shown_ = largest_;
}

/// Logarithmic, 512 codes an octave: three digits of all between 10^-21 and 10^17. 0 is zero.
std::uint16_t FrameEncoder::code(std::size_t field, double value) {
  if (!(value > 0) || !std::isfinite(value)) return 0;
  largest_[field] = std::max(largest_[field], value);
  if (value < kNothing * largest_[field]) return 0;
  return static_cast<std::uint16_t>(std::clamp(std::round(512 * (std::log2(value) + 70)), 0.0, 65535.0));
}

/// Values that are not zero: forces and stresses are zero at most places.
void FrameEncoder::include_shown(std::size_t field, std::vector<double> values) {
  std::erase_if(values, [](double value) { return !(value > 0) || !std::isfinite(value); });
  if (values.empty()) return;
  const auto rank = static_cast<std::ptrdiff_t>(std::ceil(kShownShare * static_cast<double>(values.size()))) - 1;
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  shown_[field] = std::max(shown_[field], values[rank]);
}

namespace {

void include(std::array<double, 2>& range, double value) {
  if (!std::isfinite(value)) return;
  range[0] = std::min(range[0], value);
  range[1] = std::max(range[1], value);
}

/// Dim! times the volume of a simplex with these corners.
double volume_of(const std::array<std::array<double, 3>, 4>& p, int dim) {
  std::array<std::array<double, 3>, 3> m{};
  for (int i = 0; i < dim; ++i)
    for (int k = 0; k < dim; ++k) m[i][k] = p[i + 1][k] - p[0][k];
  if (dim == 2) return m[0][0] * m[1][1] - m[0][1] * m[1][0];
  return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
         m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

}  // namespace

void FrameEncoder::measure(const StoredFrame& frame, int cell) {
  std::array<std::array<double, 3>, 4> rest{}, now{};
  for (int i = 0; i <= dim_; ++i)
    for (int k = 0; k < dim_; ++k) {
      const auto at = static_cast<std::size_t>(frame.simplices[static_cast<std::size_t>(cell) * (dim_ + 1) + i]) * dim_ + k;
      rest[i][k] = frame.rest[at];
      now[i][k] = frame.x[at];
    }
  include(volume_ratios_, volume_of(now, dim_) / volume_of(rest, dim_));
  double longest = 0;
  for (int i = 0; i <= dim_; ++i)
    for (int j = 0; j < i; ++j) {
      double square = 0;
      for (int k = 0; k < dim_; ++k) square += (now[i][k] - now[j][k]) * (now[i][k] - now[j][k]);
      longest = std::max(longest, square);
    }
  include(longest_edges_, std::sqrt(longest));
}

/// Vertices, cells and fields of one frame that a page shows, with their ids.
struct FrameEncoder::Shown {
  int nodes, cells, num_curved, num_vertices;
  std::vector<int> owner;  ///< of facets of the surface
  std::vector<char> keep_cell, keep_node;
  std::vector<int> id_of, cell_id;                         ///< -1: not shown
  std::vector<std::pair<int, int>> order{}, cell_order{};  ///< id, node (nodes of obstacles after the bodies'); id, cell

  Shown(const StoredFrame& frame, bool with_inside)
      : nodes(static_cast<int>(frame.x.size()) / frame.dim),
        cells(static_cast<int>(frame.body.size())),
        num_curved(static_cast<int>(frame.curved_edges.size()) / 2),
        num_vertices(nodes - num_curved),
        owner(cells_of_facets(frame)),
        keep_cell(cells, with_inside || frame.dim == 2),
        keep_node(nodes, 0),
        id_of(nodes, -1),
        cell_id(cells, -1) {
    const int corners = frame.dim + 1;
    for (const int cell : owner)
      if (cell >= 0) keep_cell[cell] = 1;
    for (int c = 0; c < cells; ++c)
      if (keep_cell[c])
        for (int k = 0; k < corners; ++k) keep_node[frame.simplices[c * corners + k]] = 1;
    for (int e = 0; e < num_curved; ++e)
      keep_node[num_vertices + e] = keep_node[frame.curved_edges[2 * e]] && keep_node[frame.curved_edges[2 * e + 1]];
  }
};

void FrameEncoder::add(const std::filesystem::path& path) {
  const StoredFrame frame = read_frame(path);
  std::vector<StoredField> fields = read_frame_fields(path);
  if (frames_.empty()) gap_limit_ = kGapShare * diagonal(frame);
  if (std::vector<double> values = gaps(frame, gap_limit_); !values.empty())
    fields.push_back({"gap", "m", 1, std::move(values)});
  if (frames_.empty()) start(frame, fields);
  if (frame.dim != dim_)
    throw InputError(
        {path.string(), "/fields/x", std::to_string(frame.dim) + " columns", std::to_string(dim_) + " as before"});
  if (frame.obstacles.x.size() != obstacles_.x.size() || frame.obstacles.edges != obstacles_.edges ||
      frame.obstacles.faces != obstacles_.faces)
    throw InputError({path.string(), "/obstacles", "other obstacles", "those of the first frame, at any place"});

  Shown shown(frame, with_inside_);
  touch_vertices(frame, shown);
  touch_cells(frame, shown);
  touch_facets(frame, shown);
  touch_curved_edges(frame, shown);
  EncodedFrame entry{step_of_frame(path), read_frame_sizes(path).t, 0, shown.num_vertices, shown.cells, {}};
  const bool is_changed = vertices_.changes() + cells_.changes() + facets_.changes() + curved_.changes() > 0;
  if (!frames_.empty()) entry.mesh = frames_.back().mesh + (is_changed ? 1 : 0);
  Pending pending;
  add_positions(frame, shown, pending);
  add_vertex_fields(fields, shown, pending, entry);
  add_cell_fields(fields, shown, pending);
  frames_.push_back(std::move(entry));
  pending_.push_back(std::move(pending));
  if (pending_.size() == kFramesOfChunk) flush();
}

std::array<double, 3> FrameEncoder::read_point(const std::vector<double>& from, int i) const {
  std::array<double, 3> p{};
  for (int k = 0; k < dim_; ++k) p[k] = from[static_cast<std::size_t>(i) * dim_ + k];
  return p;
}

void FrameEncoder::touch_vertices(const StoredFrame& frame, Shown& shown) {
  // Where vertices coincide, the first of them at a place is the first of them in the next frame.
  std::unordered_map<LivingRows::Key, int, LivingRows::Hash> repeats;
  vertices_.begin(static_cast<int>(frames_.size()));
  const auto touch_vertex = [&](Kind kind, const LivingRows::Key& key, const std::array<double, 3>& rest) {
    const int known = vertices_.size();
    const int id = vertices_.touch(key, {kind});
    if (id == known) rest_.push_back(rest);
    return id;
  };
  for (int i = 0; i < shown.nodes; ++i) {
    if (!shown.keep_node[i]) continue;
    const Kind kind = i < shown.num_vertices ? vertex_kind : node_kind;
    const std::array<double, 3> rest = read_point(frame.rest, i);
    LivingRows::Key key = {static_cast<std::uint64_t>(kind), 0};
    for (int k = 0; k < dim_; ++k) key[2 + k] = std::bit_cast<std::uint64_t>(rest[k] + 0.0);
    key[1] = repeats[key]++;
    shown.id_of[i] = touch_vertex(kind, key, rest);
    shown.order.emplace_back(shown.id_of[i], i);
  }
  const int num_obstacle = static_cast<int>(obstacles_.x.size()) / dim_;
  for (int i = 0; i < num_obstacle; ++i)
    shown.order.emplace_back(
        touch_vertex(obstacle_kind, {obstacle_kind, static_cast<std::uint64_t>(i)}, read_point(obstacles_.x, i)),
        shown.nodes + i);
  vertices_.end();
  std::sort(shown.order.begin(), shown.order.end());
}

void FrameEncoder::touch_cells(const StoredFrame& frame, Shown& shown) {
  const int corners = dim_ + 1;
  cells_.begin(static_cast<int>(frames_.size()));
  for (int c = 0; c < shown.cells; ++c) {
    if (!shown.keep_cell[c]) continue;
    measure(frame, c);
    std::vector<int> row(corners);
    for (int k = 0; k < corners; ++k) row[k] = shown.id_of[frame.simplices[c * corners + k]];
    LivingRows::Key key = sorted_key(row);
    row.push_back(static_cast<int>(frame.body[c]));
    shown.cell_id[c] = cells_.touch(key, row);
    shown.cell_order.emplace_back(shown.cell_id[c], c);
  }
  cells_.end();
  std::sort(shown.cell_order.begin(), shown.cell_order.end());
}

void FrameEncoder::touch_facets(const StoredFrame& frame, const Shown& shown) {
  facets_.begin(static_cast<int>(frames_.size()));
  for (std::size_t f = 0; f < shown.owner.size(); ++f) {
    if (shown.owner[f] < 0) continue;
    std::vector<int> row(dim_);
    for (int k = 0; k < dim_; ++k) row[k] = shown.id_of[frame.surface[f * dim_ + k]];
    LivingRows::Key key = sorted_key(row);
    row.push_back(shown.cell_id[shown.owner[f]]);
    key[dim_] = shown.cell_id[shown.owner[f]];
    facets_.touch(key, row);
  }
  facets_.end();
}

void FrameEncoder::touch_curved_edges(const StoredFrame& frame, const Shown& shown) {
  curved_.begin(static_cast<int>(frames_.size()));
  for (int e = 0; e < shown.num_curved; ++e) {
    if (!shown.keep_node[shown.num_vertices + e]) continue;
    const std::vector<int> row = {shown.id_of[frame.curved_edges[2 * e]], shown.id_of[frame.curved_edges[2 * e + 1]],
                                  shown.id_of[shown.num_vertices + e]};
    curved_.touch(sorted_key(row), row);
  }
  curved_.end();
}

void FrameEncoder::add_positions(const StoredFrame& frame, const Shown& shown, Pending& pending) {
  const int nodes = shown.nodes;
  for (const auto& [id, node] : shown.order) {
    const std::array<double, 3> now = node < nodes ? read_point(frame.x, node) : read_point(frame.obstacles.x, node - nodes);
    pending.vertices.push_back(id);
    double u2 = 0;
    for (int k = 0; k < dim_ && node < nodes; ++k) u2 += (now[k] - rest_[id][k]) * (now[k] - rest_[id][k]);
    if (std::isfinite(u2)) largest_u_ = std::max(largest_u_, std::sqrt(u2));
    for (int k = 0; k < dim_; ++k) {
      pending.u[k].push_back(now[k] - rest_[id][k]);
      if (node >= nodes || !std::isfinite(now[k])) continue;
      low_[k] = std::min(low_[k], now[k]);
      high_[k] = std::max(high_[k], now[k]);
    }
  }
  for (const auto& [id, cell] : shown.cell_order) pending.cells.push_back(id);
}

void FrameEncoder::add_vertex_fields(const std::vector<StoredField>& fields, const Shown& shown, Pending& pending,
                                     EncodedFrame& entry) {
  const auto& order = shown.order;
  for (std::size_t i = 0; i < vertex_fields_.size(); ++i) {
    std::vector<std::uint16_t>& codes = pending.vertex_codes.emplace_back();
    const auto field = std::ranges::find(fields, vertex_fields_[i].name, &StoredField::name);
    const int columns = field != fields.end() ? field->columns : 0;
    const bool is_there = columns > 0 && field->values.size() == static_cast<std::size_t>(shown.nodes) * columns;
    std::vector<double> magnitudes(order.size(), 0);
    for (std::size_t k = 0; k < order.size(); ++k)
      if (const int node = order[k].second; is_there && node < shown.nodes)
        magnitudes[k] = magnitude(&field->values[static_cast<std::size_t>(node) * columns], columns);
    for (const double value : magnitudes) codes.push_back(code(i, value));
    include_shown(i, std::move(magnitudes));
    if (!is_there || !field->name.ends_with("_force")) continue;
    std::array<double, 3>& sum = entry.forces[field->name];
    for (std::size_t k = 0; k < field->values.size(); ++k) sum[k % dim_] += field->values[k];
  }
}

void FrameEncoder::add_cell_fields(const std::vector<StoredField>& fields, const Shown& shown, Pending& pending) {
  for (std::size_t i = 0; i < cell_fields_.size(); ++i) {
    std::vector<std::uint16_t>& codes = pending.cell_codes.emplace_back();
    const auto field = std::ranges::find(fields, cell_fields_[i].name, &StoredField::name);
    const bool is_there = field != fields.end() && field->values.size() == static_cast<std::size_t>(shown.cells);
    for (const auto& [id, cell] : shown.cell_order)
      codes.push_back(is_there ? code(vertex_fields_.size() + i, field->values[cell]) : 0);
    if (is_there) include_shown(vertex_fields_.size() + i, field->values);
  }
}

namespace {

/// Predicts codes and keeps the differences: from the frames before, along a line if `by_line`, or for new ones from the
/// code before.
class Predictor {
 public:
  Predictor(int ids, bool by_line) : last_(ids), before_(ids), by_line_(by_line) {}
  std::vector<std::uint16_t> differences(const std::vector<int>& ids, const std::vector<int>& ages,
                                         const std::vector<std::uint16_t>& codes) {
    std::vector<std::uint16_t> found(codes.size());
    std::uint16_t neighbour = 0;
    for (std::size_t i = 0; i < codes.size(); ++i) {
      const int id = ids[i];
      int guess = neighbour;
      if (ages[i] >= 1) guess = last_[id];
      if (ages[i] >= 2 && by_line_) guess = 2 * last_[id] - before_[id];
      found[i] = zigzag(static_cast<std::uint16_t>(codes[i] - guess));
      before_[id] = last_[id];
      last_[id] = neighbour = codes[i];
    }
    return found;
  }

 private:
  std::vector<std::uint16_t> last_, before_;
  bool by_line_;
};

}  // namespace

void FrameEncoder::flush() {
  if (pending_.empty()) return;
  EncodedChunk chunk;
  chunk.count = static_cast<int>(pending_.size());
  chunk.first = static_cast<int>(frames_.size()) - chunk.count;
  for (int k = 0; k < dim_; ++k) {
    double low = INFINITY, high = -INFINITY;
    for (const Pending& frame : pending_)
      for (const double u : frame.u[k])
        if (std::isfinite(u)) low = std::min(low, u), high = std::max(high, u);
    if (!(low <= high)) low = high = 0;
    chunk.low[k] = low;
    chunk.high[k] = high;
  }
  const int num_vertices = vertices_.size(), num_cells = cells_.size();
  std::vector<Predictor> of_u(dim_, Predictor(num_vertices, true));
  std::vector<Predictor> of_vertices(vertex_fields_.size(), Predictor(num_vertices, false));
  std::vector<Predictor> of_cells(cell_fields_.size(), Predictor(num_cells, false));
  std::string bytes;
  for (int f = 0; f < chunk.count; ++f) {
    const Pending& frame = pending_[f];
    const auto ages = [&](const LivingRows& rows, const std::vector<int>& ids) {
      std::vector<int> found;
      for (const int id : ids) found.push_back(chunk.first + f - std::max(rows.birth(id), chunk.first));
      return found;
    };
    const std::vector<int> vertex_ages = ages(vertices_, frame.vertices), cell_ages = ages(cells_, frame.cells);
    for (int k = 0; k < dim_; ++k) {
      const double range = chunk.high[k] - chunk.low[k], scale = range > 0 ? 65535 / range : 0;
      std::vector<std::uint16_t> codes;
      for (const double u : frame.u[k])
        codes.push_back(std::isfinite(u) ? static_cast<std::uint16_t>(std::round((u - chunk.low[k]) * scale)) : 0);
      append_codes(bytes, of_u[k].differences(frame.vertices, vertex_ages, codes));
    }
    for (std::size_t i = 0; i < vertex_fields_.size(); ++i)
      append_codes(bytes, of_vertices[i].differences(frame.vertices, vertex_ages, frame.vertex_codes[i]));
    for (std::size_t i = 0; i < cell_fields_.size(); ++i)
      append_codes(bytes, of_cells[i].differences(frame.cells, cell_ages, frame.cell_codes[i]));
  }
  chunk.bytes = deflate(bytes);
  chunks_.push_back(std::move(chunk));
  pending_.clear();
}

std::string FrameEncoder::topology(std::string& counts) const {
  std::vector<float> rest;
  for (int k = 0; k < dim_; ++k)
    for (const auto& p : rest_) rest.push_back(static_cast<float>(p[k] - origin_[k]));
  std::vector<int> edges(obstacles_.edges.begin(), obstacles_.edges.end());
  std::vector<int> faces(obstacles_.faces.begin(), obstacles_.faces.end());
  counts = fmt::format(R"({{"vertices":{},"cells":{},"facets":{},"curved":{},"obstacle_edges":{},"obstacle_faces":{}}})",
                       vertices_.size(), cells_.size(), facets_.size(), curved_.size(), edges.size() / 2, faces.size() / 3);
  return deflate(encode_floats(rest) + vertices_.encode() + cells_.encode() + facets_.encode() + curved_.encode() +
                 encode_integers(edges, 2) + encode_integers(faces, 3));
}

std::size_t FrameEncoder::bytes() const {
  std::size_t sum = 0;
  for (const EncodedChunk& chunk : chunks_) sum += chunk.bytes.size();
  return sum;
}

}  // namespace itr::output
