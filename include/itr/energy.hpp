// SPDX-License-Identifier: MIT
// Terms of the incremental potential: the interface of each (paper eq. 4), the cells that it sums over, and what a program
// may add.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <string_view>
#include <typeindex>
#include <vector>

#include "itr/mesh.hpp"
#include "itr/types.hpp"

namespace itr {

struct BlockingPairs;
template <int Dim>
struct VolumePatches;

/// Cells with a vertex numbering of their own: the whole mesh, or the patch around an edit. Every energy term is built from
/// one, so global and local problems share all their code.
template <int Dim>
struct CellSet {
  struct Element {
    std::array<int, Dim + 1> vertices;  ///< local ids
    int body;
    double volume;           ///< rest volume [m^Dim]
    Mat<Dim> inverse_edges;  ///< inverse of the matrix of rest edges
    int part = kNone;        ///< Mesh::part
    CellId cell = kNone;     ///< in the mesh
    CurvedEdges curved = 0;
    std::array<int, kSimplexEdges<Dim>> edge_nodes{};  ///< local ids; at a straight edge its first vertex

    /// Vertices, then nodes of edges: at a straight edge its first vertex, of shape function 0.
    std::array<int, kQuadraticNodes<Dim>> nodes() const { return joined(vertices, edge_nodes); }
  };
  struct BoundaryFacet {
    std::array<int, Dim> vertices;  ///< local ids
    int tag;
    int part = kNone;  ///< of its cell
    CurvedEdges curved = 0;
    std::array<int, kSimplexEdges<Dim - 1>> edge_nodes{};  ///< as those of an element

    std::array<int, kQuadraticNodes<Dim - 1>> nodes() const { return joined(vertices, edge_nodes); }
  };
  int num_vertices = 0;           ///< length of fields / Dim; may exceed the cells' vertices (obstacles)
  bool axisymmetric = false;      ///< positions are (r, z), and integrals go over the full turn
  std::vector<Vec<Dim>> rest;     ///< per local vertex
  std::vector<Element> elements;  ///< those without curved edges first; in any order where all are turned
  std::vector<BoundaryFacet> facets;
  std::shared_ptr<const VolumePatches<Dim>> patches{};  ///< null: all volumetric energies are taken at each point

  /// The elements with integrals in closed form, and those with integrals by quadrature: with curved edges, or turned.
  std::span<const Element> straight() const { return {elements.data(), num_straight()}; }
  std::span<const Element> curved() const { return std::span(elements).subspan(num_straight()); }
  bool has_curved() const {
    if (axisymmetric) return std::ranges::any_of(elements, [](const Element& element) { return element.curved != 0; });
    return !elements.empty() && elements.back().curved;
  }
  /// Adds an element in its place.
  void add(const Element& element) {
    const bool is_last = element.curved || axisymmetric;
    elements.insert(is_last ? elements.end() : elements.begin() + static_cast<std::ptrdiff_t>(num_straight()), element);
  }
  /// Length of the circle that a rest position is turned along [m]; 1 where nothing is turned.
  double turn(const Vec<Dim>& X) const { return axisymmetric ? 2 * std::numbers::pi * X[0] : 1; }

 private:
  std::size_t num_straight() const {
    if (axisymmetric) return 0;
    if (!has_curved()) return elements.size();
    const auto is_straight = [](const Element& element) { return element.curved == 0; };
    return static_cast<std::size_t>(std::partition_point(elements.begin(), elements.end(), is_straight) - elements.begin());
  }
  template <std::size_t M, std::size_t N>
  static std::array<int, M + N> joined(const std::array<int, M>& vertices, const std::array<int, N>& of_edges) {
    std::array<int, M + N> nodes;
    std::copy(of_edges.begin(), of_edges.end(), std::copy(vertices.begin(), vertices.end(), nodes.begin()));
    return nodes;
  }
};

/// Projection of a stencil's Hessian to a positive semidefinite one: none, or its negative eigenvalues become 0.
enum class PsdProjection { none, clamp };

/// Takes blocks (column-major) as they come, over all dofs.
using BlockReceiver = std::function<void(std::span<const int> vertices, const double* block)>;

class HessianTarget;

/// Where a term adds the blocks of its Hessian. A program makes one over a receiver, to fill a matrix of its own.
class ITR_EXPORT HessianSink {
 public:
  explicit HessianSink(BlockReceiver receiver);
  /// Serves the library's own solves (src/fem/hessian_sink.hpp); `target` must outlive this.
  explicit HessianSink(HessianTarget& target) : target_(&target) {}

  /// Adds the symmetric `block` (column-major, Dim * vertices.size() squared) of a stencil.
  template <int Dim>
  void add(std::span<const int> vertices, const double* block);
  HessianTarget& target() { return *target_; }

 private:
  std::shared_ptr<HessianTarget> own_;  ///< of a receiver
  HessianTarget* target_;
};

/// Scratch of one solve, owned by the caller: terms keep no mutable caches, so solves never meet. What is in it never
/// changes a result, only the time that it takes.
class Workspace {
 public:
  /// The one object of type T of this workspace.
  template <typename T>
  T& get() {
    auto& slot = slots_[std::type_index(typeid(T))];
    if (!slot) slot = std::make_shared<T>();
    return *static_cast<T*>(slot.get());
  }

 private:
  std::map<std::type_index, std::shared_ptr<void>> slots_;
};

/// Tightest limit of a step: which cell or pair stops it.
struct StepLimit {
  double step = 1;            ///< fraction of the step that it leaves; 1: nothing limits it
  std::string kind;           ///< "cell", "vertex-edge pair", "vertex-triangle pair" or "edge-edge pair"
  std::vector<int> vertices;  ///< of the cell or of the pair, in the order of `kind`
};

/// A part factor v v^T of a Hessian that no stencil has: it is never assembled. The factor is not negative.
struct RankOne {
  VectorX vector;  ///< over all dofs
  double factor = 0;
};

/// E: R^n -> R, +infinity outside the feasible set; x interleaved positions [m], n = Dim * num_vertices.
class ITR_EXPORT Energy {
 public:
  virtual ~Energy() = default;
  virtual std::string_view name() const = 0;  ///< for logs and per-term statistics
  virtual double value(ConstVectorView x, Workspace& workspace) const = 0;
  virtual void add_gradient(ConstVectorView x, VectorView gradient, Workspace& workspace) const = 0;
  virtual void add_hessian(ConstVectorView x, PsdProjection psd, HessianSink& sink, Workspace& workspace) const = 0;
  /// Adds the gradient, and to `sizes` the absolute forces of which it is the sum: those of each term.
  virtual void add_gradient_and_sizes(ConstVectorView x, VectorView gradient, VectorView sizes, Workspace& workspace) const;
  /// By how much round-off may change the value: epsilon times the size of what is summed. By default that of the value and
  /// of the work of its forces along x.
  virtual double value_round_off(ConstVectorView x, Workspace& workspace) const;
  /// Adds by how much round-off may change each entry of the gradient: the change where each number that it is computed from
  /// changes in its last bits.
  virtual void add_gradient_round_off(ConstVectorView x, VectorView round_off, Workspace& workspace) const;
  /// Largest a in [0, 1] such that x + s dx is feasible for all s in [0, a] (conservative).
  virtual double max_step(ConstVectorView x, ConstVectorView dx, Workspace& workspace) const;
  /// The motion dx with each vertex' step as long as it is feasible whatever stops others, for where max_step cuts dx short
  /// as a whole. False where the term cannot tell; `steps` is as long as dx, and undefined then.
  virtual bool get_vertex_steps(ConstVectorView x, ConstVectorView dx, VectorView steps, Workspace& workspace) const;
  /// Adds the pairs that stop dx before `fraction` of it, and bounds the gaps of all pairs in `blocking` at its end. False
  /// where the term cannot tell.
  virtual bool find_blocking(ConstVectorView x, ConstVectorView dx, double fraction, BlockingPairs& blocking,
                             Workspace& workspace) const;
  /// Adds the parts of the Hessian that add_hessian leaves out.
  virtual void add_rank_ones(ConstVectorView x, std::vector<RankOne>& parts) const;
};

/// Makes a term for some cells: E(x) [J] times `scale` (alpha h^2 [s^2]) at the time t [s] of the end of a step, or null if
/// it does not act there. It is called for the whole mesh in each step and, with remeshing, for patches before and after an
/// edit. So E must be a sum over cells, facets or points at rest positions, because vertex numbers change. `cells` outlives
/// the energy.
template <int Dim>
using TermFactory = std::function<std::shared_ptr<const Energy>(const CellSet<Dim>& cells, double t, double scale)>;

/// Receives the symmetric block of some vertices, column-major, (Dim * vertices.size())^2 numbers [N/m].
using StiffnessReceiver = std::function<void(std::span<const int> vertices, const double* block)>;

/// Forces that depend on present positions and need no potential. A step linearises them at the last solution and solves
/// again until they balance. Remeshing uses those at the solution on the step's first mesh.
template <int Dim>
struct FollowerForces {
  /// Adds forces [N] on the vertices of `mesh` at positions x [m] and the time t [s], both interleaved. Empty: no forces.
  std::function<void(const Mesh<Dim>& mesh, ConstVectorView x, double t, VectorView forces)> forces;
  /// Passes blocks of the symmetric part of -df/dx, which saves rounds. Empty: no blocks.
  std::function<void(const Mesh<Dim>& mesh, ConstVectorView x, double t, const StiffnessReceiver& add)> stiffness;
};

/// Forces [N] on the nodes (vertices, then those of curved edges) of a compact mesh, interleaved, as dead loads at their
/// rest positions: minus the work that they do from rest. They stay at these points of the bodies however the mesh changes:
/// on another mesh the vertices of the cell that a point is in share its force, which keeps resultant and moment. Throws
/// InputError for a wrong length or numbers that are not finite.
template <int Dim>
ITR_EXPORT TermFactory<Dim> point_forces(const Mesh<Dim>& mesh, ConstVectorView forces);

}  // namespace itr
