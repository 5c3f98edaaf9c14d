// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <map>
#include <memory>
#include <vector>

#include "energy/rigid_body.hpp"
#include "fem/cell_set.hpp"
#include "fem/hessian_sink.hpp"
#include "fem/vertex_map.hpp"

namespace itr {

/// Unknowns of rigid bodies in place of the positions of their nodes: of each body that of its point `about`, and Dim
/// vectors along its axes that are as long as it is large. Positions are linear in them, x = W z. They have the places of
/// the body's first nodes in a field, and the places of its other nodes stay 0; other nodes keep theirs.
template <int Dim>
class RigidCoordinates {
 public:
  /// Coordinates of one body: columns of a point and of the vectors.
  using Frame = Eigen::Matrix<double, Dim, Dim + 1>;

  RigidCoordinates(const std::map<int, Material>& materials, const CellSet<Dim>& cells);

  /// From z to positions or motions of nodes.
  const std::shared_ptr<const VertexMap<Dim>>& map() const { return map_; }
  /// z of positions, or of motions that are linear in each body.
  VectorX coordinates_of(ConstVectorView field) const;
  /// z of a step's motion: 0 in components that are held.
  VectorX of_motion(ConstVectorView motion) const;
  /// Holds what stays 0 in z's motion, beside what is held of other nodes.
  std::vector<char> held(std::vector<char> held_nodes) const;
  /// D of NewtonNorm by entry of z, from that by entry of x.
  VectorX weights_of(const VectorX& weights) const;
  /// The gradient without what keeps the bodies rigid and held, and that alone; each with the body's resultants.
  VectorX without_reactions(VectorX gradient) const;
  VectorX reactions(ConstVectorView gradient) const;
  /// Frame of a body by `field`: at rest, or any positions.
  Frame frame(int body, ConstVectorView field) const;
  const RigidBody& body(int body) const { return *bodies_[body].rigid; }
  int count() const { return static_cast<int>(bodies_.size()); }
  /// Gradient by x of a function with this one by the frame of a body.
  void add_gradient(int body, const Frame& by_frame, VectorView gradient) const;
  /// Nodes that a body's frame follows from, of which it is `coefficients` times the positions, as columns.
  const std::array<int, Dim + 1>& anchors(int body) const { return bodies_[body].anchors; }
  const Mat<Dim + 1>& coefficients(int body) const { return bodies_[body].inverse; }
  double size(int body) const { return bodies_[body].size; }  ///< [m]
  const std::vector<int>& nodes(int body) const { return bodies_[body].nodes; }
  /// The farthest that a body's node is from where its frame has it, by its size.
  double distortion(int body, ConstVectorView field) const;

  /// Makes a step of z the chord to where bodies come that turn along arcs instead of along their tangents; strains stay.
  /// Returns the largest turn [rad]. `at`: where they are.
  double bend(const VectorX& at, VectorView step) const;

 private:
  struct Body {
    const RigidBody* rigid;
    std::vector<int> nodes;                            ///< ascending; the first of them have the place of z
    Eigen::Matrix<double, Eigen::Dynamic, Dim + 1> W;  ///< positions of nodes by the frame: a row each
    std::array<int, Dim + 1> anchors;                  ///< nodes, far from each other
    Mat<Dim + 1> inverse;                              ///< of the rows of W at anchors
    double size;                                       ///< [m]
    Eigen::Array<bool, Dim, Dim + 1> held;             ///< of the frame
  };
  static Body make(const RigidBody& body, std::vector<int> nodes, const CellSet<Dim>& cells);
  static Eigen::Array<bool, Dim, Dim + 1> held_of(const RigidBody& body);
  Frame by_frame(const Body& body, ConstVectorView gradient) const;

  std::vector<Body> bodies_;
  std::shared_ptr<const VertexMap<Dim>> map_;
};

}  // namespace itr
