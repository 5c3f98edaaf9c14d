// SPDX-License-Identifier: MIT
#include "energy/mortar.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "fem/locator.hpp"
#include "fem/quadratic.hpp"
#include "fem/quadrature.hpp"
#include "geometry/bvh.hpp"
#include "geometry/closed_faces.hpp"
#include "geometry/facet_area.hpp"

namespace itr {

namespace {

constexpr double kOpposite = -0.5;      ///< most cosine between the normals of facets that are bonded
constexpr double kSliver = 1e-12;       ///< of a facet: less overlap is round-off
constexpr double kOnFacet = 1e-10;      ///< barycentric weights below it are 0
constexpr double kLeastOverlap = 0.25;  ///< of a function's facets, for a condition of its own

template <int Dim>
using Corners = std::array<Vec<Dim>, Dim>;

template <int Dim>
double longest_edge(const Corners<Dim>& p) {
  double longest = 0;
  for (int k = 0; k < Dim; ++k) longest = std::max(longest, (p[(k + 1) % Dim] - p[k]).norm());
  return longest;
}

/// The part of `own` that is under the projection of `other` along own's normal, in simplices; empty where normals are not
/// opposite or the other is farther off than `most`.
std::vector<Corners<2>> overlap_of(const Corners<2>& own, const Corners<2>& other, double most) {
  const Vec<2> along = own[1] - own[0], across = other[1] - other[0];
  if (along.dot(across) > kOpposite * along.norm() * across.norm()) return {};
  const auto place = [&](const Vec<2>& p) { return (p - own[0]).dot(along) / along.squaredNorm(); };
  const double first = place(other[1]), last = place(other[0]);
  const double low = std::max(0.0, first), high = std::min(1.0, last);
  if (high - low < kSliver) return {};
  const Vec<2> middle = own[0] + (low + high) / 2 * along;
  const Vec<2> beside = other[1] + ((low + high) / 2 - first) / (last - first) * (other[0] - other[1]);
  if ((beside - middle).norm() > most) return {};
  return {{own[0] + low * along, own[0] + high * along}};
}

/// Clips a polygon by the half plane at the left of a -> b (Sutherland & Hodgman 1974).
std::vector<Vec<2>> clipped(const std::vector<Vec<2>>& polygon, const Vec<2>& a, const Vec<2>& b) {
  const auto side = [&](const Vec<2>& p) { return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]); };
  std::vector<Vec<2>> inside;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec<2>&p = polygon[i], &q = polygon[(i + 1) % polygon.size()];
    const double at_p = side(p), at_q = side(q);
    if (at_p >= 0) inside.push_back(p);
    if ((at_p > 0 && at_q < 0) || (at_p < 0 && at_q > 0)) inside.push_back(p + at_p / (at_p - at_q) * (q - p));
  }
  return inside;
}

std::vector<Corners<3>> overlap_of(const Corners<3>& own, const Corners<3>& other, double most) {
  const Vec<3> normal = (own[1] - own[0]).cross(own[2] - own[0]).normalized();
  const Vec<3> of_other = (other[1] - other[0]).cross(other[2] - other[0]).normalized();
  const double cosine = normal.dot(of_other);
  if (cosine > kOpposite) return {};
  const Vec<3> first = (own[1] - own[0]).normalized(), second = normal.cross(first);
  const auto in_plane = [&](const Vec<3>& p) { return Vec<2>((p - own[0]).dot(first), (p - own[0]).dot(second)); };
  std::vector<Vec<2>> polygon{in_plane(other[2]), in_plane(other[1]), in_plane(other[0])};
  for (int k = 0; k < 3; ++k) polygon = clipped(polygon, in_plane(own[k]), in_plane(own[(k + 1) % 3]));
  if (polygon.size() < 3) return {};
  Vec<2> middle = Vec<2>::Zero();
  for (const Vec<2>& p : polygon) middle += p / static_cast<double>(polygon.size());
  const auto in_space = [&](const Vec<2>& p) { return Vec<3>(own[0] + p[0] * first + p[1] * second); };
  if (std::abs((other[0] - in_space(middle)).dot(of_other) / cosine) > most) return {};
  std::vector<Corners<3>> triangles;
  for (std::size_t i = 1; i + 1 < polygon.size(); ++i)
    triangles.push_back({in_space(polygon[0]), in_space(polygon[i]), in_space(polygon[i + 1])});
  std::erase_if(triangles, [&](const auto& t) { return facet_area(t) < kSliver * facet_area(own); });
  return triangles;
}

/// The facets of one side of a tie.
template <int Dim>
struct Side {
  using Element = typename CellSet<Dim>::Element;
  std::vector<std::array<int, Dim>> facets;
  std::vector<Corners<Dim>> corners;
  std::vector<const Element*> elements;
  std::vector<int> tags;
  double area = 0;
};

template <int Dim>
struct Piece {
  int own, other;  ///< facets of the sides
  Corners<Dim> corners;
};

/// Sides by their tags, with the cell of each facet.
template <int Dim>
class Sides {
 public:
  explicit Sides(const CellSet<Dim>& cells) : cells_(cells) {}
  Side<Dim> find(const std::vector<int>& tags) {
    Side<Dim> side;
    side.tags = tags;
    for (const auto& facet : cells_.facets) {
      if (std::ranges::find(tags, facet.tag) == tags.end()) continue;
      Corners<Dim> corners;
      for (int k = 0; k < Dim; ++k) corners[k] = cells_.rest[facet.vertices[k]];
      side.facets.push_back(facet.vertices);
      side.corners.push_back(corners);
      side.elements.push_back(element_of(facet.vertices));
      side.area += facet_area(corners);
    }
    return side;
  }

 private:
  const typename CellSet<Dim>::Element* element_of(std::array<int, Dim> facet) {
    if (by_facet_.empty()) {
      std::vector<char> is_on_boundary(cells_.rest.size(), 0);
      for (const auto& of_boundary : cells_.facets)
        for (const int v : of_boundary.vertices) is_on_boundary[v] = 1;
      for (const auto& element : cells_.elements)
        for (int k = 0; k <= Dim; ++k) {
          const auto vertices = opposite_facet<Dim>(element.vertices, k);
          if (std::ranges::all_of(vertices, [&](int v) { return is_on_boundary[v] != 0; }))
            by_facet_.emplace(ascending(vertices), &element);
        }
    }
    return by_facet_.at(ascending(facet));
  }

  const CellSet<Dim>& cells_;
  std::map<std::array<int, Dim>, const typename CellSet<Dim>::Element*> by_facet_;
};

/// The overlaps of both sides, in the order of the facets of `own`.
template <int Dim>
std::vector<Piece<Dim>> pieces_of(const Side<Dim>& own, const Side<Dim>& other) {
  std::vector<Box<Dim>> boxes;
  for (const auto& corners : other.corners) {
    Box<Dim> box;
    for (const Vec<Dim>& p : corners) box.include(p);
    boxes.push_back(box.inflated(kLargestTieGap * longest_edge<Dim>(corners)));
  }
  const Bvh<Dim> tree(boxes);
  std::vector<Piece<Dim>> pieces;
  std::vector<int> hits;
  for (int f = 0; f < static_cast<int>(own.facets.size()); ++f) {
    Box<Dim> box;
    for (const Vec<Dim>& p : own.corners[f]) box.include(p);
    const double edge = longest_edge<Dim>(own.corners[f]);
    hits.clear();
    tree.query(box.inflated(kLargestTieGap * edge), hits);
    std::sort(hits.begin(), hits.end());
    for (const int g : hits) {
      const double most = kLargestTieGap * std::max(edge, longest_edge<Dim>(other.corners[g]));
      for (const auto& corners : overlap_of(own.corners[f], other.corners[g], most)) pieces.push_back({f, g, corners});
    }
  }
  return pieces;
}

template <int Dim>
double covered_by(const std::vector<Piece<Dim>>& pieces, const Side<Dim>& side) {
  double area = 0;
  for (const auto& piece : pieces) area += facet_area(piece.corners);
  return side.area > 0 ? area / side.area : 0;
}

/// Barycentric coordinates of a point near a cell's facet; those that are round-off become 0, and their sum is 1.
template <int Dim>
std::array<double, Dim + 1> weights_at(const CellSet<Dim>& cells, const typename CellSet<Dim>::Element& element,
                                       const Vec<Dim>& X) {
  auto weights = barycentric_weights<Dim>(cells.rest[element.vertices[0]], element.inverse_edges, X);
  const auto largest = std::max_element(weights.begin(), weights.end()) - weights.begin();
  double others = 0;
  for (int k = 0; k <= Dim; ++k) {
    if (std::abs(weights[k]) < kOnFacet) weights[k] = 0;
    if (k != largest) others += weights[k];
  }
  weights[largest] = 1 - others;
  return weights;
}

/// Both sides of a tie, with what they overlap.
template <int Dim>
struct TieOverlap {
  Side<Dim> own, other;
  std::vector<Piece<Dim>> pieces;
  std::vector<int> vertices;  ///< of facets that overlap, ascending
  bool is_own_b = false;
  /// From where the pieces are to either side: with a jump, side b is laid upon side a.
  std::array<Vec<Dim>, 2> offsets{Vec<Dim>::Zero(), Vec<Dim>::Zero()};
};

template <int Dim>
Vec<Dim> centroid(const Side<Dim>& side) {
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (const auto& corners : side.corners)
    for (const Vec<Dim>& p : corners) sum += facet_area(corners) / Dim * p;
  return sum / side.area;
}

template <int Dim>
class MortarBuilder {
 public:
  using Element = typename CellSet<Dim>::Element;
  /// All three must outlive this.
  MortarBuilder(const CellSet<Dim>& cells, const TieOverlap<Dim>& overlap, const std::function<bool(int, int)>& is_weak)
      : cells_(cells), overlap_(overlap), is_weak_(is_weak) {
    std::map<int, double> all, covered;
    const Side<Dim>& own = overlap.own;
    for (std::size_t f = 0; f < own.facets.size(); ++f)
      for (const int v : own.facets[f]) all[v] += facet_area(own.corners[f]);
    for (const auto& piece : overlap.pieces)
      for (const int v : own.facets[piece.own]) covered[v] += facet_area(piece.corners);
    for (const auto& [v, area] : all)
      if (covered[v] < kLeastOverlap * area) hardly_overlap_.insert(v);
  }

  Mortar<Dim> build() {
    Mortar<Dim> mortar{.tags = {overlap_.own.tags, overlap_.other.tags},
                       .rows = {},
                       .facets = {},
                       .elements = {},
                       .vertices = overlap_.vertices};
    mortar.covered = covered_by<Dim>(overlap_.pieces, overlap_.own);
    mortar.is_own_b = overlap_.is_own_b;
    mortar.to_own = overlap_.offsets[0] - overlap_.offsets[1];
    for (auto piece = overlap_.pieces.begin(); piece != overlap_.pieces.end();) {
      const int f = piece->own;
      local_.clear();
      measure_.fill(0);
      plain_.fill(0);
      bodies_ = {overlap_.own.elements[f]->body, overlap_.other.elements[piece->other]->body};
      mortar.facets.push_back(overlap_.own.facets[f]);
      mortar.elements.push_back(overlap_.own.elements[f]);
      mortar.longest_edge = std::max(mortar.longest_edge, longest_edge<Dim>(overlap_.own.corners[f]));
      for (; piece != overlap_.pieces.end() && piece->own == f; ++piece) {
        add(*piece);
        mortar.longest_edge = std::max(mortar.longest_edge, longest_edge<Dim>(overlap_.other.corners[piece->other]));
      }
      scatter(overlap_.own.facets[f]);
    }
    for (auto& [key, sum] : rows_) add_row(key.first, key.second, sum, mortar.rows);
    return mortar;
  }

 private:
  struct Sum {
    std::map<int, double> weights;
    double measure = 0, plain = 0;
    std::array<int, 2> bodies{};
    bool operator==(const Sum& other) const { return weights == other.weights; }
  };

  /// Adds the integrals over a piece, by function of its facet.
  void add(const Piece<Dim>& piece) {
    const Element &own = *overlap_.own.elements[piece.own], &other = *overlap_.other.elements[piece.other];
    const double area = facet_area(piece.corners);
    const auto& facet = overlap_.own.facets[piece.own];
    for (const auto& point : quadrature<Dim - 1>(degree_with_turn(3, cells_.axisymmetric))) {
      Vec<Dim> X = Vec<Dim>::Zero();
      for (int k = 0; k < Dim; ++k) X += point.weights[k] * piece.corners[k];
      const double part = area * point.fraction;
      const auto at_own = weights_at<Dim>(cells_, own, X + overlap_.offsets[0]);
      const auto at_other = weights_at<Dim>(cells_, other, X + overlap_.offsets[1]);
      std::array<double, Dim> psi;
      for (int k = 0; k < Dim; ++k) {
        psi[k] = at_own[std::ranges::find(own.vertices, facet[k]) - own.vertices.begin()];
        plain_[k] += part * psi[k];
        psi[k] *= part * cells_.turn(X);
        measure_[k] += psi[k];
      }
      add_shapes(own, at_own, 1, psi);
      add_shapes(other, at_other, -1, psi);
    }
  }
  void add_shapes(const Element& element, const std::array<double, Dim + 1>& at, double sign,
                  const std::array<double, Dim>& psi) {
    const auto nodes = element.nodes();
    const auto shapes = quadratic_shapes<Dim>(element.curved, at);
    for (int n = 0; n < kQuadraticNodes<Dim>; ++n) {
      if (shapes[n] == 0) continue;
      auto& sum = local_.try_emplace(nodes[n], std::array<double, Dim>{}).first->second;
      for (int k = 0; k < Dim; ++k) sum[k] += sign * psi[k] * shapes[n];
    }
  }
  /// Adds a facet's integrals to the rows: functions without conditions share theirs out to the others of the facet.
  void scatter(const std::array<int, Dim>& facet) {
    for (int c = 0; c < Dim; ++c) {
      std::array<bool, Dim> is_weak;
      for (int k = 0; k < Dim; ++k) is_weak[k] = hardly_overlap_.contains(facet[k]) || is_weak_(facet[k], c);
      const auto weak = std::ranges::count(is_weak, true);
      if (weak == Dim) is_weak.fill(false);
      const double share = weak == Dim ? 0 : 1.0 / static_cast<double>(Dim - weak);
      for (int k = 0; k < Dim; ++k) {
        if (is_weak[k]) continue;
        Sum& sum = rows_[{facet[k], c}];
        const auto with_shares = [&](const std::array<double, Dim>& values) {
          double value = values[k];
          for (int j = 0; j < Dim; ++j)
            if (is_weak[j]) value += share * values[j];
          return value;
        };
        for (const auto& [node, values] : local_) sum.weights[node] += with_shares(values);
        sum.measure += with_shares(measure_);
        sum.plain += with_shares(plain_);
        sum.bodies = bodies_;
      }
    }
  }
  /// Adds the row of one component, or that to the row of another component of the vertex which is the same.
  void add_row(int vertex, int c, const Sum& sum, std::vector<MortarRow<Dim>>& rows) {
    for (int d = 0; d < c; ++d)
      if (const auto before = rows_.find({vertex, d}); before != rows_.end() && before->second == sum) {
        std::find_if(rows.rbegin(), rows.rend(), [&](const auto& row) {
          return row.vertex == vertex && row.components[d];
        })->components[c] = true;
        return;
      }
    MortarRow<Dim>& row = rows.emplace_back();
    row.vertex = vertex;
    row.components[c] = true;
    for (const auto& [node, weight] : sum.weights) {
      row.nodes.push_back(node);
      row.weights.push_back(weight);
    }
    row.measure = sum.measure;
    row.length = Dim == 2 ? sum.plain : std::sqrt(sum.plain);
    row.bodies = sum.bodies;
  }

  const CellSet<Dim>& cells_;
  const TieOverlap<Dim>& overlap_;
  const std::function<bool(int, int)>& is_weak_;
  std::set<int> hardly_overlap_;
  std::map<int, std::array<double, Dim>> local_;  ///< of a facet: by node the integrals with its functions
  std::array<double, Dim> measure_{}, plain_{};   ///< of its functions, with the turn and without it
  std::array<int, 2> bodies_{};
  std::map<std::pair<int, int>, Sum> rows_;  ///< by vertex and component
};

template <int Dim>
TieOverlap<Dim> overlap_of_tie(Sides<Dim>& sides, const Tie& tie) {
  TieOverlap<Dim> overlap{.own = sides.find(tie.a), .other = sides.find(tie.b), .pieces = {}, .vertices = {}};
  if (tie.jump) overlap.offsets[1] = centroid(overlap.other) - centroid(overlap.own);
  for (Corners<Dim>& corners : overlap.other.corners)
    for (Vec<Dim>& p : corners) p -= overlap.offsets[1];
  overlap.pieces = pieces_of(overlap.own, overlap.other);
  std::vector<Piece<Dim>> opposite = pieces_of(overlap.other, overlap.own);
  const double of_a = covered_by<Dim>(overlap.pieces, overlap.own), of_b = covered_by<Dim>(opposite, overlap.other);
  const bool is_finer = overlap.other.facets.size() > overlap.own.facets.size();
  if (of_b >= kLeastCovered ? is_finer || of_a < kLeastCovered : of_a < kLeastCovered && of_b > of_a) {
    std::swap(overlap.own, overlap.other);
    std::swap(overlap.offsets[0], overlap.offsets[1]);
    overlap.is_own_b = true;
    overlap.pieces = std::move(opposite);
  }
  std::set<int> vertices;
  for (const auto& piece : overlap.pieces) {
    vertices.insert(overlap.own.facets[piece.own].begin(), overlap.own.facets[piece.own].end());
    vertices.insert(overlap.other.facets[piece.other].begin(), overlap.other.facets[piece.other].end());
  }
  overlap.vertices.assign(vertices.begin(), vertices.end());
  return overlap;
}

/// `row` less what makes its gap that of a jump that `reference` measures, in component c alone.
template <int Dim>
MortarRow<Dim> less_jump(const MortarRow<Dim>& row, const MortarRow<Dim>& reference, int c) {
  MortarRow<Dim> result = row;
  result.components.fill(false);
  result.components[c] = true;
  result.against = reference.vertex;
  result.share = row.measure / reference.measure;
  std::map<int, double> weights;
  for (std::size_t i = 0; i < row.nodes.size(); ++i) weights[row.nodes[i]] += row.weights[i];
  for (std::size_t i = 0; i < reference.nodes.size(); ++i)
    weights[reference.nodes[i]] -= result.share * reference.weights[i];
  result.nodes.clear();
  result.weights.clear();
  for (const auto& [node, weight] : weights) {
    result.nodes.push_back(node);
    result.weights.push_back(weight);
  }
  return result;
}

/// Lets the jump be what it wants in component c: conditions are those of the gaps less that of the largest function.
template <int Dim>
void free_jump(int c, std::vector<MortarRow<Dim>>& rows) {
  std::optional<MortarRow<Dim>> reference;
  for (const MortarRow<Dim>& row : rows)
    if (row.components[c] && (!reference || row.measure > reference->measure)) reference = row;
  if (!reference) return;
  std::vector<MortarRow<Dim>> freed;
  for (MortarRow<Dim>& row : rows) {
    if (!row.components[c]) continue;
    if (row.vertex != reference->vertex) freed.push_back(less_jump(row, *reference, c));
    row.components[c] = false;
  }
  std::erase_if(rows, [](const MortarRow<Dim>& row) { return row.components == std::array<bool, Dim>{}; });
  rows.insert(rows.end(), freed.begin(), freed.end());
}

}  // namespace

template <int Dim>
std::vector<Mortar<Dim>> make_mortars(const CellSet<Dim>& cells, std::span<const Tie> ties,
                                      const std::function<bool(int node, int c)>& is_held) {
  Sides<Dim> sides(cells);
  std::vector<TieOverlap<Dim>> overlaps;
  std::map<int, int> ties_at;  // by vertex: how many
  for (const Tie& tie : ties) {
    overlaps.push_back(overlap_of_tie(sides, tie));
    for (const int v : overlaps.back().vertices) ++ties_at[v];
  }
  const std::function<bool(int, int)> is_weak = [&](int v, int c) { return ties_at[v] > 1 || is_held(v, c); };
  const std::function<bool(int, int)> is_never = [](int, int) { return false; };
  std::vector<Mortar<Dim>> mortars;
  for (std::size_t i = 0; i < ties.size(); ++i) {
    mortars.push_back(MortarBuilder<Dim>(cells, overlaps[i], ties[i].jump ? is_never : is_weak).build());
    mortars.back().tie = static_cast<int>(i);
    if (!ties[i].jump) continue;
    const Vec<3> jump = ties[i].jump(0);
    for (int c = 0; c < Dim; ++c)
      if (std::isnan(jump[c])) free_jump<Dim>(c, mortars.back().rows);
    mortars.back().covered *= std::min(1.0, overlaps[i].own.area / overlaps[i].other.area);  // of the larger
  }
  return mortars;
}

template <int Dim>
double distance_of_sides(const CellSet<Dim>& cells, const Tie& tie) {
  Sides<Dim> sides(cells);
  const Side<Dim> a = sides.find(tie.a), b = sides.find(tie.b);
  double least = std::numeric_limits<double>::infinity();
  for (const auto& p : a.corners)
    for (const auto& q : b.corners) least = std::min(least, simplex_distance_squared<Dim>(p, q));
  return std::sqrt(least);
}

#define ITR_INSTANTIATE(Dim)                                                                \
  template std::vector<Mortar<Dim>> make_mortars(const CellSet<Dim>&, std::span<const Tie>, \
                                                 const std::function<bool(int, int)>&);     \
  template double distance_of_sides(const CellSet<Dim>&, const Tie&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
