// SPDX-License-Identifier: MIT
// ccd_queries FOLDER...: runs our continuous collision detection on the queries of all CSV files below the folders and
// compares with the known answers, twice: as sharp as it can be, which shows what it decides wrongly, and with the options
// of a simulation, which stops at a fifth of the initial distance where it calls something a hit. Ends with status 1 on
// a missed collision, on a time of 0 for a query that starts separated, or where too many of the queries without a collision
// are called hits; with status 2 if there is nothing to run or a file is malformed.
//
// A query is 8 rows of x numerator, x denominator, y.., y.., z.., z.., answer.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "geometry/ccd.hpp"
#include "geometry/predicates.hpp"

namespace {

using itr::Vec;

constexpr double kMostFalsePositives[] = {0.02, 0.02};  ///< sharp, of a simulation; by the queries that do not collide
constexpr double kSharp = 1e-10;                        ///< 1e-6 calls near passes hits; from 1e-14 on round-off misses some

struct Query {
  std::array<Vec<3>, 8> points;  ///< four at t = 0, then four at t = 1
  bool collides = false;
};

struct Tally {
  long queries = 0, negatives = 0, misses = 0, false_positives = 0, zeros = 0;  ///< negatives: those without a collision
  double seconds = 0;
  void add(const Tally& other) {
    queries += other.queries;
    negatives += other.negatives;
    misses += other.misses;
    false_positives += other.false_positives;
    zeros += other.zeros;
    seconds += other.seconds;
  }
  double false_positive_fraction() const { return negatives > 0 ? double(false_positives) / double(negatives) : 0; }
};

/// The queries come from doubles, so numerator and power-of-two denominator are exact in long double and so is the quotient.
double read_quotient(const char*& text) {
  char* end = nullptr;
  const long double numerator = std::strtold(text, &end);
  if (end == text || *end != ',') throw std::runtime_error("expected a numerator and a comma");
  text = end + 1;
  const long double denominator = std::strtold(text, &end);
  if (end == text || *end != ',' || denominator == 0) throw std::runtime_error("expected a denominator and a comma");
  text = end + 1;
  return static_cast<double>(numerator / denominator);
}

std::vector<Query> read_queries(const std::filesystem::path& path) {
  std::ifstream in(path);
  std::vector<Query> queries;
  std::string line;
  int row = 0;
  for (; std::getline(in, line); ++row) {
    if (row % 8 == 0) queries.emplace_back();
    const char* text = line.c_str();
    for (int c = 0; c < 3; ++c) queries.back().points[row % 8][c] = read_quotient(text);
    if (*text != '0' && *text != '1') throw std::runtime_error("expected the answer 0 or 1");
    queries.back().collides = *text == '1';
  }
  if (row == 0 || row % 8 != 0) throw std::runtime_error("expected 8 rows a query");
  return queries;
}

Vec<2> drop(const Vec<3>& p, int axis) { return {p[(axis + 1) % 3], p[(axis + 2) % 3]}; }

/// Whether p is in the closed triangle, which may be degenerate. Exact.
bool in_triangle(const Vec<2>& p, const Vec<2>& a, const Vec<2>& b, const Vec<2>& c) {
  const auto [low, high] = std::minmax({itr::orientation(a, b, p), itr::orientation(b, c, p), itr::orientation(c, a, p)});
  if (low < 0 && high > 0) return false;
  return (p.array() >= a.cwiseMin(b).cwiseMin(c).array()).all() && (p.array() <= a.cwiseMax(b).cwiseMax(c).array()).all();
}

/// Whether the primitives are apart at t = 0. Exact, and independent of the floating-point distances under test: coplanar
/// primitives meet if and only if their projections along all three axes do, because one of these is injective.
bool starts_separated(const Query& query, bool edges) {
  const auto& q = query.points;
  if (itr::orientation(q[0], q[1], q[2], q[3]) != 0) return true;
  for (int axis = 0; axis < 3; ++axis) {
    const Vec<2> a = drop(q[0], axis), b = drop(q[1], axis), c = drop(q[2], axis), d = drop(q[3], axis);
    if (!(edges ? itr::segments_intersect(a, b, c, d) : in_triangle(a, b, c, d))) return true;
  }
  return false;
}

double time_of(const Query& query, bool edges, const itr::CcdOptions& options) {
  const auto& q = query.points;
  return edges ? itr::edge_edge_ccd(q[0], q[1], q[2], q[3], q[4], q[5], q[6], q[7], options)
               : itr::point_triangle_ccd(q[0], q[1], q[2], q[3], q[4], q[5], q[6], q[7], options);
}

Tally run(const std::vector<Query>& queries, bool edges, const itr::CcdOptions& options) {
  std::vector<double> times(queries.size());
  const auto start = std::chrono::steady_clock::now();
  for (std::size_t i = 0; i < queries.size(); ++i) times[i] = time_of(queries[i], edges, options);
  Tally tally;
  tally.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  tally.queries = static_cast<long>(queries.size());
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const bool found = !(times[i] >= 1);
    tally.negatives += !queries[i].collides;
    tally.misses += queries[i].collides && !found;
    tally.false_positives += !queries[i].collides && found;
    tally.zeros += !(times[i] > 0) && starts_separated(queries[i], edges);
  }
  return tally;
}

/// Nothing if the path does not say which kind of query the file holds.
std::optional<bool> holds_edges(const std::filesystem::path& path) {
  if (path.string().find("edge-edge") != std::string::npos) return true;
  if (path.string().find("vertex-face") != std::string::npos) return false;
  return std::nullopt;
}

std::vector<std::filesystem::path> csv_files(const char* folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.path().extension() == ".csv") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

void print(const char* setting, const char* name, const Tally& t) {
  std::printf("%-7s %-12s %8ld queries %6ld misses %6ld zero when separated %6ld false positives of %8ld %8.0f ns a query\n",
              setting, name, t.queries, t.misses, t.zeros, t.false_positives, t.negatives,
              t.queries > 0 ? 1e9 * t.seconds / double(t.queries) : 0.0);
}

/// Tallies all queries with one setting.
Tally run_files(const std::vector<std::filesystem::path>& files, const char* setting, const itr::CcdOptions& options) {
  Tally kinds[2], total;
  for (const auto& file : files) {
    const auto edges = holds_edges(file);
    if (!edges) continue;
    try {
      const Tally tally = run(read_queries(file), *edges, options);
      if (tally.misses + tally.zeros > 0) print(setting, file.c_str(), tally);
      kinds[*edges].add(tally);
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(file.string() + ": " + error.what());
    }
  }
  total.add(kinds[0]);
  total.add(kinds[1]);
  print(setting, "vertex-face", kinds[0]);
  print(setting, "edge-edge", kinds[1]);
  print(setting, "all", total);
  if (total.queries == 0) throw std::runtime_error("found no queries");
  return total;
}

int run_folders(int count, char** folders) {
  std::vector<std::filesystem::path> files;
  for (int i = 0; i < count; ++i)
    for (const auto& file : csv_files(folders[i])) files.push_back(file);
  const Tally sharp = run_files(files, "sharp", {.min_separation_ratio = kSharp}), product = run_files(files, "product", {});
  const bool wrong = sharp.misses + sharp.zeros + product.misses + product.zeros > 0;
  const bool too_many =
      sharp.false_positive_fraction() > kMostFalsePositives[0] || product.false_positive_fraction() > kMostFalsePositives[1];
  return wrong || too_many ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: ccd_queries FOLDER...\n");
    return 2;
  }
  try {
    return run_folders(argc - 1, argv + 1);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "ccd_queries: %s\n", error.what());
    return 2;
  }
}
