// SPDX-License-Identifier: MIT
#include "frames.hpp"

#include <algorithm>
#include <cmath>

#include "deflate.hpp"
#include "gap.hpp"
#include "geometry/measures.hpp"
#include "itr/core.hpp"

namespace itr::report {

namespace {

constexpr double kGapFraction = 0.02;    // of the bodies' diagonal: gaps beyond are not told apart
constexpr double kNothing = 1e-9;        // times the largest value: is shown as zero, as its digits are round-off
constexpr double kShownFraction = 0.98;  // of the values of a frame that have colours of their own

enum Kind { vertex_kind, node_kind, obstacle_kind };

/// Appends the lowest bytes of all values, then the next ones: deflate finds more to repeat in this order.
template <typename T>
void append_planar(std::string& bytes, const std::vector<T>& values) {
  const auto* from = reinterpret_cast<const char*>(values.data());
  for (std::size_t k = 0; k < sizeof(T); ++k)
    for (std::size_t i = 0; i < values.size(); ++i) bytes += from[i * sizeof(T) + k];
}

double magnitude(const double* values, int columns) {
  double sum = 0;
  for (int k = 0; k < columns; ++k) sum += values[k] * values[k];
  return std::sqrt(sum);
}

void include(std::array<double, 2>& range, double value) {
  if (!std::isfinite(value)) return;
  range[0] = std::min(range[0], value);
  range[1] = std::max(range[1], value);
}

double diagonal(const StoredFrame& frame) {
  double sum = 0;
  for (int k = 0; k < frame.dim; ++k) {
    std::array<double, 2> range{INFINITY, -INFINITY};
    for (std::size_t i = k; i < frame.x.size(); i += frame.dim) include(range, frame.x[i]);
    if (range[0] < range[1]) sum += (range[1] - range[0]) * (range[1] - range[0]);
  }
  return std::sqrt(sum);
}

LivingRows::Key sorted_key(std::vector<int> ids) {
  std::sort(ids.begin(), ids.end());
  LivingRows::Key key{};
  std::copy(ids.begin(), ids.end(), key.begin());
  return key;
}

/// For each facet of the surface the cell that has it; -1: none.
std::vector<int> cells_of_facets(const StoredFrame& frame) {
  const int dim = frame.dim, corners = dim + 1;
  using Facet = std::vector<std::int64_t>;
  const auto sorted_row = [](const std::vector<std::int64_t>& rows, std::size_t at, int columns) {
    Facet row(rows.begin() + at, rows.begin() + at + columns);
    std::sort(row.begin(), row.end());
    return row;
  };
  std::map<Facet, int> cells;
  for (std::size_t i = 0; i < frame.surface.size(); i += dim) cells[sorted_row(frame.surface, i, dim)] = -1;
  for (std::size_t i = 0; i < frame.simplices.size(); i += corners) {
    const Facet cell = sorted_row(frame.simplices, i, corners);
    for (int k = 0; k < corners; ++k) {
      Facet facet = cell;
      facet.erase(facet.begin() + k);
      if (const auto found = cells.find(facet); found != cells.end()) found->second = static_cast<int>(i) / corners;
    }
  }
  std::vector<int> found;
  for (std::size_t i = 0; i < frame.surface.size(); i += dim) found.push_back(cells[sorted_row(frame.surface, i, dim)]);
  return found;
}

}  // namespace

void LivingRows::begin(int frame) {
  frame_ = frame;
  has_born_ = false;
  before_ = std::move(now_);
  now_.clear();
}

int LivingRows::touch(const Key& key, const std::vector<int>& row) {
  const auto [place, is_first] = now_.try_emplace(key, size());
  if (!is_first) return place->second;
  if (const auto known = before_.find(key); known != before_.end()) {
    place->second = known->second;
    before_.erase(known);
    return place->second;
  }
  has_born_ = true;
  rows_.insert(rows_.end(), row.begin(), row.end());
  birth_.push_back(frame_);
  death_.push_back(kNever);
  return place->second;
}

bool LivingRows::end() {
  for (const auto& [key, id] : before_) death_[id] = frame_;
  return has_born_ || !before_.empty();
}

LivingRows::Chosen LivingRows::choose(const std::vector<int>& frames) const {
  const auto at = [&](int frame) {
    return static_cast<int>(std::lower_bound(frames.begin(), frames.end(), frame) - frames.begin());
  };
  Chosen chosen;
  for (int id = 0; id < size(); ++id) {
    const int birth = at(birth_[id]), death = at(death_[id]);
    const bool is_seen = birth < death;
    chosen.new_id.push_back(is_seen ? static_cast<int>(chosen.rows.size()) : -1);
    if (!is_seen) continue;
    chosen.rows.push_back(id);
    chosen.birth.push_back(birth);
    chosen.death.push_back(death);
  }
  return chosen;
}

std::vector<int> LivingRows::column(const Chosen& chosen, int k) const {
  std::vector<int> values;
  for (const int id : chosen.rows) values.push_back(rows_[id * columns_ + k]);
  return values;
}

void FrameEncoder::start(const StoredFrame& frame, const std::vector<StoredField>& fields) {
  dim_ = frame.dim;
  units_ = frame.units;
  cells_ = LivingRows(dim_ + 2);
  facets_ = LivingRows(dim_ + 1);
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

void FrameEncoder::add(const std::filesystem::path& path) {
  const StoredFrame frame = output::read_frame(path);
  std::vector<StoredField> fields = output::read_frame_fields(path);
  if (frames_.empty()) gap_limit_ = kGapFraction * diagonal(frame);
  if (std::vector<double> values = gaps(frame, gap_limit_); !values.empty())
    fields.push_back({"gap", "m", 1, std::move(values)});
  if (frames_.empty()) start(frame, fields);
  if (frame.dim != dim_)
    throw InputError(
        {path.string(), "/fields/x", std::to_string(frame.dim) + " columns", std::to_string(dim_) + " as before"});
  if (frame.obstacles.x.size() != obstacles_.x.size() || frame.obstacles.edges != obstacles_.edges ||
      frame.obstacles.faces != obstacles_.faces)
    throw InputError({path.string(), "/obstacles", "other obstacles", "those of the first frame, at any place"});

  Order order;
  bool is_changed = touch_vertices(frame, order);
  is_changed = touch_cells(frame, order) || is_changed;
  is_changed = touch_facets(frame, order) || is_changed;
  is_changed = touch_curved_edges(frame, order) || is_changed;
  dim_ == 2 ? measure_cells<2>(frame) : measure_cells<3>(frame);
  EncodedFrame entry;
  entry.step = output::step_of_frame(path);
  entry.t = output::read_frame_sizes(path).t;
  entry.vertices = static_cast<int>(frame.x.size()) / dim_ - static_cast<int>(frame.curved_edges.size()) / 2;
  entry.cells = static_cast<int>(frame.body.size());
  if (!frames_.empty()) entry.mesh = frames_.back().mesh + (is_changed ? 1 : 0);
  std::string bytes;
  add_displacements(frame, order, entry, bytes);
  add_vertex_fields(fields, order, entry, bytes);
  add_cell_fields(fields, order, bytes);
  entry.bytes = deflate(bytes);
  frames_.push_back(std::move(entry));
}

std::array<double, 3> FrameEncoder::read_point(const std::vector<double>& from, int i) const {
  std::array<double, 3> p{};
  for (int k = 0; k < dim_; ++k) p[k] = from[static_cast<std::size_t>(i) * dim_ + k];
  return p;
}

bool FrameEncoder::touch_vertices(const StoredFrame& frame, Order& order) {
  // Where vertices coincide, the first of them at a place is the first of them in the next frame.
  std::map<LivingRows::Key, int> repeats;
  vertices_.begin(static_cast<int>(frames_.size()));
  const auto touch_vertex = [&](Kind kind, const LivingRows::Key& key, const std::array<double, 3>& rest, int node) {
    const int known = vertices_.size(), id = vertices_.touch(key, {kind});
    if (id == known) rest_.push_back(rest);
    order.vertices.emplace_back(id, node);
    return id;
  };
  const int nodes = static_cast<int>(frame.x.size()) / dim_;
  const int num_vertices = nodes - static_cast<int>(frame.curved_edges.size()) / 2;
  for (int i = 0; i < nodes; ++i) {
    const Kind kind = i < num_vertices ? vertex_kind : node_kind;
    const std::array<double, 3> rest = read_point(frame.rest, i);
    LivingRows::Key key = {static_cast<double>(kind), 0, rest[0], rest[1], rest[2]};
    key[1] = repeats[key]++;
    order.id_of_node.push_back(touch_vertex(kind, key, rest, i));
  }
  const int num_obstacle = static_cast<int>(obstacles_.x.size()) / dim_;
  for (int i = 0; i < num_obstacle; ++i)
    touch_vertex(obstacle_kind, {obstacle_kind, static_cast<double>(i)}, read_point(obstacles_.x, i), nodes + i);
  std::sort(order.vertices.begin(), order.vertices.end());
  return vertices_.end();
}

bool FrameEncoder::touch_cells(const StoredFrame& frame, Order& order) {
  const int corners = dim_ + 1;
  cells_.begin(static_cast<int>(frames_.size()));
  for (int c = 0; c < static_cast<int>(frame.body.size()); ++c) {
    std::vector<int> row(corners);
    for (int k = 0; k < corners; ++k) row[k] = order.id_of_node[frame.simplices[c * corners + k]];
    const LivingRows::Key key = sorted_key(row);
    row.push_back(static_cast<int>(frame.body[c]));
    order.id_of_cell.push_back(cells_.touch(key, row));
    order.cells.emplace_back(order.id_of_cell.back(), c);
  }
  std::sort(order.cells.begin(), order.cells.end());
  return cells_.end();
}

bool FrameEncoder::touch_facets(const StoredFrame& frame, const Order& order) {
  facets_.begin(static_cast<int>(frames_.size()));
  const std::vector<int> owner = cells_of_facets(frame);
  for (std::size_t f = 0; f < owner.size(); ++f) {
    if (owner[f] < 0) continue;
    std::vector<int> row(dim_);
    for (int k = 0; k < dim_; ++k) row[k] = order.id_of_node[frame.surface[f * dim_ + k]];
    LivingRows::Key key = sorted_key(row);
    row.push_back(order.id_of_cell[owner[f]]);
    key[dim_] = row.back();
    facets_.touch(key, row);
  }
  return facets_.end();
}

bool FrameEncoder::touch_curved_edges(const StoredFrame& frame, const Order& order) {
  curved_.begin(static_cast<int>(frames_.size()));
  const std::size_t num_curved = frame.curved_edges.size() / 2, num_vertices = frame.x.size() / dim_ - num_curved;
  for (std::size_t e = 0; e < num_curved; ++e) {
    const std::vector<int> row = {order.id_of_node[frame.curved_edges[2 * e]],
                                  order.id_of_node[frame.curved_edges[2 * e + 1]], order.id_of_node[num_vertices + e]};
    curved_.touch(sorted_key(row), row);
  }
  return curved_.end();
}

template <int Dim>
void FrameEncoder::measure_cells(const StoredFrame& frame) {
  for (std::size_t c = 0; c < frame.body.size(); ++c) {
    std::array<Vec<Dim>, Dim + 1> rest, now;
    for (int i = 0; i <= Dim; ++i) {
      const auto at = static_cast<std::size_t>(frame.simplices[c * (Dim + 1) + i]) * Dim;
      rest[i] = Eigen::Map<const Vec<Dim>>(&frame.rest[at]);
      now[i] = Eigen::Map<const Vec<Dim>>(&frame.x[at]);
    }
    include(volume_ratios_, simplex_volume<Dim>(now) / simplex_volume<Dim>(rest));
    double longest = 0;
    for (int i = 0; i <= Dim; ++i)
      for (int j = 0; j < i; ++j) longest = std::max(longest, (now[i] - now[j]).norm());
    include(longest_edges_, longest);
  }
}

void FrameEncoder::add_displacements(const StoredFrame& frame, const Order& order, EncodedFrame& entry, std::string& bytes) {
  const int nodes = static_cast<int>(frame.x.size()) / dim_;
  for (int k = 0; k < dim_; ++k) {
    std::array<double, 2> box{INFINITY, -INFINITY};
    std::vector<double> u;
    for (const auto& [id, node] : order.vertices) {
      const double now = node < nodes ? frame.x[node * dim_ + k] : frame.obstacles.x[(node - nodes) * dim_ + k];
      include(box, u.emplace_back(now - rest_[id][k]));
      if (node >= nodes || !std::isfinite(now)) continue;
      low_[k] = std::min(low_[k], now);
      high_[k] = std::max(high_[k], now);
    }
    if (box[0] > box[1]) box = {0, 0};
    const double range = box[1] - box[0], scale = range > 0 ? 65535 / range : 0;
    std::vector<std::uint16_t> codes;
    for (const double value : u)
      codes.push_back(std::isfinite(value) ? static_cast<std::uint16_t>(std::round((value - box[0]) * scale)) : 0);
    append_planar(bytes, codes);
    entry.low[k] = box[0];
    entry.high[k] = box[1];
  }
  for (int i = 0; i < nodes; ++i) {
    std::array<double, 3> u = read_point(frame.x, i);
    for (int k = 0; k < dim_; ++k) u[k] -= frame.rest[i * dim_ + k];
    if (const double length = magnitude(u.data(), dim_); std::isfinite(length)) largest_u_ = std::max(largest_u_, length);
  }
}

/// Adds magnitudes, 512 codes an octave: three digits of all between 10^-21 and 10^17. 0 is zero.
void FrameEncoder::add_values(std::size_t field, std::vector<double> values, std::string& bytes) {
  for (double& value : values)
    if (!(value > 0) || !std::isfinite(value)) value = 0;
  for (const double value : values) largest_[field] = std::max(largest_[field], value);
  std::vector<std::uint16_t> codes;
  for (const double value : values)
    codes.push_back(value == 0 || value < kNothing * largest_[field]
                        ? 0
                        : static_cast<std::uint16_t>(std::clamp(std::round(512 * (std::log2(value) + 70)), 0.0, 65535.0)));
  append_planar(bytes, codes);
  std::erase(values, 0.0);  // forces and stresses are zero at most places
  if (values.empty()) return;
  const auto rank = static_cast<std::ptrdiff_t>(std::ceil(kShownFraction * static_cast<double>(values.size()))) - 1;
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  shown_[field] = std::max(shown_[field], values[rank]);
}

void FrameEncoder::add_vertex_fields(const std::vector<StoredField>& fields, const Order& order, EncodedFrame& entry,
                                     std::string& bytes) {
  const int nodes = static_cast<int>(order.id_of_node.size());
  for (std::size_t i = 0; i < vertex_fields_.size(); ++i) {
    const auto field = std::ranges::find(fields, vertex_fields_[i].name, &StoredField::name);
    const int columns = field != fields.end() ? field->columns : 0;
    const bool is_there = columns > 0 && field->values.size() == static_cast<std::size_t>(nodes) * columns;
    std::vector<double> magnitudes(order.vertices.size(), 0);
    for (std::size_t k = 0; k < order.vertices.size(); ++k)
      if (const int node = order.vertices[k].second; is_there && node < nodes)
        magnitudes[k] = magnitude(&field->values[static_cast<std::size_t>(node) * columns], columns);
    add_values(i, std::move(magnitudes), bytes);
    if (!is_there || !field->name.ends_with("_force")) continue;
    std::array<double, 3>& sum = entry.forces[field->name];
    for (std::size_t k = 0; k < field->values.size(); ++k) sum[k % dim_] += field->values[k];
  }
}

void FrameEncoder::add_cell_fields(const std::vector<StoredField>& fields, const Order& order, std::string& bytes) {
  for (std::size_t i = 0; i < cell_fields_.size(); ++i) {
    const auto field = std::ranges::find(fields, cell_fields_[i].name, &StoredField::name);
    const bool is_there = field != fields.end() && field->values.size() == order.cells.size();
    std::vector<double> values;
    for (const auto& [id, cell] : order.cells) values.push_back(is_there ? field->values[cell] : 0);
    add_values(vertex_fields_.size() + i, std::move(values), bytes);
  }
}

FrameEncoder::Topology FrameEncoder::topology(const std::vector<int>& frames) const {
  const LivingRows::Chosen vertices = vertices_.choose(frames), cells = cells_.choose(frames);
  const LivingRows::Chosen facets = facets_.choose(frames), curved = curved_.choose(frames);
  std::string bytes;
  for (int k = 0; k < dim_; ++k) {
    std::vector<float> rest;
    for (const int id : vertices.rows) rest.push_back(static_cast<float>(rest_[id][k] - origin_[k]));
    append_planar(bytes, rest);
  }
  const auto append = [&](const LivingRows& table, const LivingRows::Chosen& chosen,
                          const std::vector<const LivingRows::Chosen*>& ids_of) {
    for (std::size_t k = 0; k < ids_of.size(); ++k) {
      std::vector<int> column = table.column(chosen, static_cast<int>(k));
      if (ids_of[k])
        for (int& value : column) value = ids_of[k]->new_id[value];
      append_planar(bytes, column);
    }
    append_planar(bytes, chosen.birth);
    append_planar(bytes, chosen.death);
  };
  std::vector<const LivingRows::Chosen*> of_cell(dim_ + 1, &vertices), of_facet(dim_, &vertices);
  of_cell.push_back(nullptr);
  of_facet.push_back(&cells);
  append(vertices_, vertices, {nullptr});
  append(cells_, cells, of_cell);
  append(facets_, facets, of_facet);
  append(curved_, curved, {&vertices, &vertices, &vertices});
  const auto append_corners = [&](const std::vector<std::int64_t>& rows, int columns) {
    for (int k = 0; k < columns; ++k) {
      std::vector<int> column;
      for (std::size_t i = k; i < rows.size(); i += columns) column.push_back(static_cast<int>(rows[i]));
      append_planar(bytes, column);
    }
  };
  append_corners(obstacles_.edges, 2);
  append_corners(obstacles_.faces, 3);
  return {deflate(bytes),
          {{"vertices", vertices.rows.size()},
           {"cells", cells.rows.size()},
           {"facets", facets.rows.size()},
           {"curved", curved.rows.size()},
           {"obstacle_edges", obstacles_.edges.size() / 2},
           {"obstacle_faces", obstacles_.faces.size() / 3}}};
}

}  // namespace itr::report
