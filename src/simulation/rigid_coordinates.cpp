// SPDX-License-Identifier: MIT
#include "simulation/rigid_coordinates.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

namespace itr {

namespace {

/// By rigid body, the nodes of its cells, ascending.
template <int Dim>
std::map<const RigidBody*, std::vector<int>> nodes_of_bodies(const std::map<int, Material>& materials,
                                                             const CellSet<Dim>& cells) {
  std::map<int, const RigidBody*> rigid;
  for (const auto& [id, material] : materials) rigid[id] = rigid_body_of(material);
  std::map<const RigidBody*, std::vector<int>> nodes;
  for (const auto& element : cells.elements)
    if (const RigidBody* const body = rigid.at(element.body))
      nodes[body].insert(nodes[body].end(), element.vertices.begin(), element.vertices.end());
  for (auto& [body, of] : nodes) {
    std::sort(of.begin(), of.end());
    of.erase(std::unique(of.begin(), of.end()), of.end());
  }
  return nodes;
}

/// Rows of W that span the most: the first is farthest from the origin of the arms, each other one farthest from those
/// before it.
template <int Dim>
std::array<int, Dim + 1> find_anchors(Eigen::Matrix<double, Eigen::Dynamic, Dim + 1> W) {
  std::array<int, Dim + 1> rows{};
  for (int k = 0; k <= Dim; ++k) {
    Eigen::Index best = 0;
    W.rowwise().squaredNorm().maxCoeff(&best);
    rows[k] = static_cast<int>(best);
    const Eigen::Matrix<double, 1, Dim + 1> along = W.row(best).normalized();
    W -= (W * along.transpose()).eval() * along;
  }
  return rows;
}

Mat<2> rotation_by(const Mat<2>& skew, double& angle) {
  angle = std::atan(skew(1, 0));
  return Eigen::Rotation2Dd(angle).toRotationMatrix();
}
Mat<3> rotation_by(const Mat<3>& skew, double& angle) {
  const Vec<3> axis(skew(2, 1), skew(0, 2), skew(1, 0));
  angle = std::atan(axis.norm());
  return angle == 0 ? Mat<3>(Mat<3>::Identity()) : Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
}

}  // namespace

/// Which entries of a frame stay. Two of three turns that are held leave the third about its axis; one alone keeps the
/// body's next axis in the plane of that axis and the held one.
template <int Dim>
Eigen::Array<bool, Dim, Dim + 1> RigidCoordinates<Dim>::held_of(const RigidBody& body) {
  Eigen::Array<bool, Dim, Dim + 1> held = Eigen::Array<bool, Dim, Dim + 1>::Constant(false);
  for (int c = 0; c < Dim; ++c) held(c, 0) = body.held_position[c];
  const auto& turns = body.held_rotation;
  if constexpr (Dim == 2) {
    if (turns[2]) held.template rightCols<Dim>() = true;
  } else {
    const auto count = std::count(turns.begin(), turns.end(), true);
    if (count == 3) held.template rightCols<Dim>() = true;
    for (int c = 0; c < 3; ++c) {
      if (count == 2 && !turns[c]) held.col(1 + c) = true, held.row(c).template tail<Dim>() = true;
      if (count == 1 && turns[c]) held((c + 2) % 3, 1 + (c + 1) % 3) = true;
    }
  }
  return held;
}

template <int Dim>
typename RigidCoordinates<Dim>::Body RigidCoordinates<Dim>::make(const RigidBody& body, std::vector<int> nodes,
                                                                 const CellSet<Dim>& cells) {
  Body made{
      .rigid = &body, .nodes = std::move(nodes), .W = {}, .anchors = {}, .inverse = {}, .size = 0, .held = held_of(body)};
  Eigen::AlignedBox<double, Dim> box;
  for (const int v : made.nodes) box.extend(cells.rest[v]);
  made.size = box.diagonal().norm();
  made.W.resize(static_cast<Eigen::Index>(made.nodes.size()), Dim + 1);
  for (std::size_t i = 0; i < made.nodes.size(); ++i)
    made.W.row(static_cast<Eigen::Index>(i)) << 1,
        (cells.rest[made.nodes[i]] - body.about.template head<Dim>()).transpose() / made.size;
  const std::array<int, Dim + 1> rows = find_anchors<Dim>(made.W);
  Mat<Dim + 1> at_anchors;
  for (int k = 0; k <= Dim; ++k) {
    made.anchors[k] = made.nodes[rows[k]];
    at_anchors.row(k) = made.W.row(rows[k]);
  }
  made.inverse = at_anchors.inverse();
  return made;
}

template <int Dim>
RigidCoordinates<Dim>::RigidCoordinates(const std::map<int, Material>& materials, const CellSet<Dim>& cells) {
  const int n = static_cast<int>(cells.rest.size());
  std::vector<char> is_rigid(cells.rest.size(), 0);  // by node
  auto nodes = nodes_of_bodies(materials, cells);
  std::vector<Eigen::Triplet<double>> entries;
  for (const RigidBody* const body : rigid_bodies(materials)) {
    bodies_.push_back(make(*body, std::move(nodes[body]), cells));
    const Body& made = bodies_.back();
    for (std::size_t i = 0; i < made.nodes.size(); ++i) {
      is_rigid[made.nodes[i]] = 1;
      for (int k = 0; k <= Dim; ++k)
        entries.emplace_back(made.nodes[i], made.nodes[k], made.W(static_cast<Eigen::Index>(i), k));
    }
  }
  for (int v = 0; v < n; ++v)
    if (!is_rigid[v]) entries.emplace_back(v, v, 1);
  typename VertexMap<Dim>::Weights weights(n, n);
  weights.setFromTriplets(entries.begin(), entries.end());
  map_ = std::make_shared<VertexMap<Dim>>(weights, VectorX::Zero(Dim * n));
}

template <int Dim>
typename RigidCoordinates<Dim>::Frame RigidCoordinates<Dim>::frame(int body, ConstVectorView field) const {
  const Body& of = bodies_[body];
  Eigen::Matrix<double, Dim, Dim + 1> at_anchors;
  for (int k = 0; k <= Dim; ++k) at_anchors.col(k) = field.segment<Dim>(Dim * of.anchors[k]);
  return at_anchors * of.inverse.transpose();
}

template <int Dim>
void RigidCoordinates<Dim>::add_gradient(int body, const Frame& by_frame, VectorView gradient) const {
  const Body& of = bodies_[body];
  const Eigen::Matrix<double, Dim, Dim + 1> at_anchors = by_frame * of.inverse;
  for (int k = 0; k <= Dim; ++k) gradient.segment<Dim>(Dim * of.anchors[k]) += at_anchors.col(k);
}

template <int Dim>
typename RigidCoordinates<Dim>::Frame RigidCoordinates<Dim>::by_frame(const Body& body, ConstVectorView gradient) const {
  Frame sum = Frame::Zero();
  for (std::size_t i = 0; i < body.nodes.size(); ++i)
    sum += gradient.segment<Dim>(Dim * body.nodes[i]) * body.W.row(static_cast<Eigen::Index>(i));
  return sum;
}

template <int Dim>
VectorX RigidCoordinates<Dim>::coordinates_of(ConstVectorView field) const {
  VectorX z = field;
  for (int b = 0; b < count(); ++b) {
    const Frame of = frame(b, field);
    for (const int node : bodies_[b].nodes) z.segment<Dim>(Dim * node).setZero();
    for (int k = 0; k <= Dim; ++k) z.segment<Dim>(Dim * bodies_[b].nodes[k]) = of.col(k);
  }
  return z;
}

template <int Dim>
VectorX RigidCoordinates<Dim>::of_motion(ConstVectorView motion) const {
  VectorX z = coordinates_of(motion);
  for (const Body& body : bodies_)
    for (int k = 0; k <= Dim; ++k)
      for (int c = 0; c < Dim; ++c)
        if (body.held(c, k)) z[Dim * body.nodes[k] + c] = 0;
  return z;
}

template <int Dim>
std::vector<char> RigidCoordinates<Dim>::held(std::vector<char> held_nodes) const {
  for (const Body& body : bodies_)
    for (std::size_t i = 0; i < body.nodes.size(); ++i)
      for (int c = 0; c < Dim; ++c)
        held_nodes[Dim * body.nodes[i] + c] = i > Dim || body.held(c, static_cast<Eigen::Index>(i));
  return held_nodes;
}

template <int Dim>
VectorX RigidCoordinates<Dim>::weights_of(const VectorX& weights) const {
  VectorX result = weights;
  for (const Body& body : bodies_)
    for (int k = 0; k <= Dim; ++k)
      for (int c = 0; c < Dim; ++c) {
        double sum = 0;
        for (std::size_t i = 0; i < body.nodes.size(); ++i)
          sum += weights[Dim * body.nodes[i] + c] * std::pow(body.W(static_cast<Eigen::Index>(i), k), 2);
        result[Dim * body.nodes[k] + c] = sum;
      }
  return result;
}

template <int Dim>
VectorX RigidCoordinates<Dim>::without_reactions(VectorX gradient) const {
  for (int b = 0; b < count(); ++b) {
    const Body& body = bodies_[b];
    const Frame sum = body.held.select(0.0, by_frame(body, gradient).array()).matrix();
    for (const int node : body.nodes) gradient.segment<Dim>(Dim * node).setZero();
    add_gradient(b, sum, gradient);
  }
  return gradient;
}

template <int Dim>
VectorX RigidCoordinates<Dim>::reactions(ConstVectorView gradient) const {
  VectorX result = VectorX::Zero(gradient.size());
  for (int b = 0; b < count(); ++b) {
    const Body& body = bodies_[b];
    add_gradient(b, body.held.select(by_frame(body, gradient).array(), 0.0).matrix(), result);
  }
  return result;
}

template <int Dim>
double RigidCoordinates<Dim>::distortion(int body, ConstVectorView field) const {
  const Body& of = bodies_[body];
  const Frame frame_here = frame(body, field);
  double most = 0;
  for (std::size_t i = 0; i < of.nodes.size(); ++i)
    most = std::max(
        most,
        (frame_here * of.W.row(static_cast<Eigen::Index>(i)).transpose() - field.segment<Dim>(Dim * of.nodes[i])).norm());
  return most / of.size;
}

// With (A + dA) = A (1 + S + Q), S symmetric and Q not, the end of the arc is A (1 + S) R: strain is that of S alone, and
// the rotation R by the arc tangent of Q is the nearest one to 1 + Q.
template <int Dim>
double RigidCoordinates<Dim>::bend(const VectorX& at, VectorView step) const {
  double largest = 0;
  for (const Body& body : bodies_) {
    Mat<Dim> A, dA;
    for (int k = 0; k < Dim; ++k) {
      A.col(k) = at.segment<Dim>(Dim * body.nodes[1 + k]);
      dA.col(k) = step.segment<Dim>(Dim * body.nodes[1 + k]);
    }
    const Mat<Dim> change = A.inverse() * dA, symmetric = 0.5 * (change + change.transpose());
    double angle = 0;
    const Mat<Dim> R = rotation_by(Mat<Dim>(change - symmetric), angle);
    const Mat<Dim> chord = A * ((Mat<Dim>::Identity() + symmetric) * R - Mat<Dim>::Identity());
    if (!chord.allFinite()) continue;
    largest = std::max(largest, std::abs(angle));
    for (int k = 0; k < Dim; ++k)
      for (int c = 0; c < Dim; ++c)
        if (!body.held(c, 1 + k)) step[Dim * body.nodes[1 + k] + c] = chord(c, k);
  }
  return largest;
}

template class RigidCoordinates<2>;
template class RigidCoordinates<3>;

}  // namespace itr
