// SPDX-License-Identifier: MIT
// Symmetric systems for tests of linear solvers: dense ones, and linear elasticity on grids.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "itr/solver.hpp"

namespace itr::linear {

using Dense = Eigen::MatrixXd;

struct System {
  SparsityPattern pattern;
  std::vector<double> values;
  Dense full;
};

/// Lower triangle of a dense symmetric matrix; exact zeros off the diagonal are not stored.
inline System from_dense(const Dense& full) {
  System system;
  system.full = full;
  system.pattern.order = static_cast<int>(full.rows());
  system.pattern.column_starts.push_back(0);
  for (int j = 0; j < full.rows(); ++j) {
    for (int i = j; i < full.rows(); ++i)
      if (i == j || full(i, j) != 0) {
        system.pattern.row_indices.push_back(i);
        system.values.push_back(full(i, j));
      }
    system.pattern.column_starts.push_back(static_cast<int>(system.values.size()));
  }
  return system;
}

inline Dense tridiagonal(int n, double diagonal, double off) {
  Dense A = Dense::Identity(n, n) * diagonal;
  for (int i = 0; i + 1 < n; ++i) A(i, i + 1) = A(i + 1, i) = off;
  return A;
}

/// The seven-point Laplacian of a cube of `side`^3 nodes, held all around; without the dense matrix.
inline System laplacian(int side) {
  System system;
  const int n = side * side * side;
  system.pattern.order = n;
  const auto couple = [&](int node) {
    system.pattern.row_indices.push_back(node);
    system.values.push_back(-1);
  };
  for (int node = 0; node < n; ++node) {
    system.pattern.column_starts.push_back(static_cast<int>(system.values.size()));
    system.pattern.row_indices.push_back(node);
    system.values.push_back(6);
    if (node % side + 1 < side) couple(node + 1);
    if (node / side % side + 1 < side) couple(node + side);
    if (node + side * side < n) couple(node + side * side);
  }
  system.pattern.column_starts.push_back(static_cast<int>(system.values.size()));
  return system;
}

/// Name of a case of one solver: gtest takes letters and digits only.
inline std::string as_test_name(std::string name) {
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return name;
}

/// Solvers that `itr solvers` lists; here the program is the test, which lets modules start MPI.
inline Registry full_registry() {
  Registry registry;
  registry.allow_mpi_start();
  return registry;
}

/// A matrix with what Newton tells of it.
struct Elastic : System {
  int block_size = 1;
  std::vector<int> dofs;
  std::vector<double> coordinates;
  AnalyzeHints hints() const { return {.block_size = block_size, .dofs = dofs, .coordinates = coordinates}; }
};

/// Linear elasticity on a grid of `side`^dim nodes, each cell cut into dim! simplices along its diagonal (Kuhn). Nodes on
/// the first face are held, those on the last one in their first component only.
inline Elastic elasticity(int dim, int side, double poisson_ratio) {
  const double mu = 1 / (2 * (1 + poisson_ratio)), lambda = poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio));
  const double h = 1.0 / (side - 1);
  int nodes = 1;
  for (int d = 0; d < dim; ++d) nodes *= side;
  const auto grid = [&](int node) {
    Eigen::VectorXi index(dim);
    for (int d = 0; d < dim; ++d, node /= side) index[d] = node % side;
    return index;
  };
  const auto node_at = [&](const Eigen::VectorXi& index) {
    int node = 0;
    for (int d = dim - 1; d >= 0; --d) node = node * side + index[d];
    return node;
  };
  Elastic result;
  result.block_size = dim;
  std::vector<int> unknown(dim * nodes, -1);
  for (int i = 0; i < dim * nodes; ++i) {
    const Eigen::VectorXi index = grid(i / dim);
    if (index[0] == 0 || (index[0] == side - 1 && i % dim == 0)) continue;
    unknown[i] = static_cast<int>(result.dofs.size());
    result.dofs.push_back(i);
    for (int d = 0; d < dim; ++d) result.coordinates.push_back(h * index[d]);
  }
  std::map<std::pair<int, int>, double> entries;  // (column, row) of the lower triangle
  for (int cell = 0; cell < nodes; ++cell) {
    if ((grid(cell).array() == side - 1).any()) continue;
    std::vector<int> order(dim);
    std::iota(order.begin(), order.end(), 0);
    do {
      std::vector<int> corner = {cell};
      Eigen::VectorXi index = grid(cell);
      Dense edges(dim, dim);
      for (int k = 0; k < dim; ++k) {
        ++index[order[k]];
        corner.push_back(node_at(index));
        edges.col(k) = h * (index - grid(cell)).cast<double>();
      }
      Dense gradients(dim, dim + 1);  // of the shape functions
      gradients.rightCols(dim) = edges.inverse().transpose();
      gradients.col(0) = -gradients.rightCols(dim).rowwise().sum();
      const double volume = std::abs(edges.determinant()) / (dim == 2 ? 2 : 6);
      for (int a = 0; a <= dim; ++a)
        for (int b = 0; b <= dim; ++b) {
          const Eigen::VectorXd p = gradients.col(a), q = gradients.col(b);
          const Dense block =
              volume * (lambda * p * q.transpose() + mu * q * p.transpose() + mu * p.dot(q) * Dense::Identity(dim, dim));
          for (int i = 0; i < dim; ++i)
            for (int j = 0; j < dim; ++j) {
              const int row = unknown[dim * corner[a] + i], column = unknown[dim * corner[b] + j];
              if (column >= 0 && row >= column) entries[{column, row}] += block(i, j);
            }
        }
    } while (std::next_permutation(order.begin(), order.end()));
  }
  const int n = static_cast<int>(result.dofs.size());
  result.pattern.order = n;
  result.pattern.column_starts.assign(n + 1, 0);
  result.full = Dense::Zero(n, n);
  for (const auto& [place, value] : entries) {
    ++result.pattern.column_starts[place.first + 1];
    result.pattern.row_indices.push_back(place.second);
    result.values.push_back(value);
    result.full(place.first, place.second) = result.full(place.second, place.first) = value;
  }
  for (int j = 0; j < n; ++j) result.pattern.column_starts[j + 1] += result.pattern.column_starts[j];
  return result;
}

}  // namespace itr::linear
