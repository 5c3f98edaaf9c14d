// SPDX-License-Identifier: MIT
// Not preCICE: what examples/api/precice_adapter.cpp needs of its Participant, to compile the example where preCICE is not
// there and to hold it against preCICE's rules of when a mesh may be reset and data read. The partner is a spring at the tip
// of the flap that is pulled; each window takes three iterations.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace precice {

using VertexID = int;

class Participant {
 public:
  Participant(std::string_view name, std::string_view, int rank, int size) {
    require(name == "Solid" && rank == 0 && size == 1, "one participant Solid");
  }
  void setMeshVertices(std::string_view mesh, std::span<const double> positions, std::span<VertexID> ids) {
    require(mesh == "Solid-Mesh" && can_define_, "vertices are set before initialize() or after resetMesh()");
    require(!ids.empty() && positions.size() == 2 * ids.size(), "two coordinates a vertex");
    for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = static_cast<int>(i);
    positions_.assign(positions.begin(), positions.end());
    can_define_ = false;
  }
  void initialize() {
    require(!positions_.empty(), "vertices before initialize()");
    is_initialized_ = true;
    needs_checkpoint_ = true;
  }
  bool isCouplingOngoing() const { return window_ < kWindows; }
  double getMaxTimeStepSize() const { return kWindow; }
  bool isTimeWindowComplete() const { return is_complete_; }
  bool requiresWritingCheckpoint() { return std::exchange(needs_checkpoint_, false); }
  bool requiresReadingCheckpoint() { return std::exchange(needs_restore_, false); }
  void resetMesh(std::string_view) {
    require(is_complete_ && advances_ > 0, "a mesh is reset in the first iteration of a window, and not of the first one");
    can_define_ = is_reset_ = true;
    ++resets_;
  }
  void readData(std::string_view, std::string_view data, std::span<const VertexID> ids, double time,
                std::span<double> values) const {
    require(data == "Force" && values.size() == 2 * ids.size() && time >= 0 && time <= kWindow, "forces on the vertices");
    require(!is_reset_, "nothing is read from a mesh that was reset");
    std::fill(values.begin(), values.end(), 0.0);
    values[2 * tip()] = kStiffness * (kPull * (window_ + 1) / kWindows - tip_displacement_);
  }
  void writeData(std::string_view, std::string_view data, std::span<const VertexID> ids, std::span<const double> values) {
    require(data == "Displacement" && 2 * ids.size() == positions_.size() && values.size() == 2 * ids.size(),
            "displacements of the vertices");
    require(!can_define_, "vertices before data");
    tip_displacement_ += 0.5 * (values[2 * tip()] - tip_displacement_);
  }
  void advance(double dt) {
    require(is_initialized_ && dt == kWindow && !needs_checkpoint_ && !needs_restore_, "checkpoints before advance()");
    ++advances_;
    is_reset_ = false;
    is_complete_ = ++iteration_ == kIterations;
    needs_restore_ = !is_complete_;
    needs_checkpoint_ = is_complete_;
    if (is_complete_) iteration_ = 0, ++window_;
  }
  void finalize() {
    std::printf("the tip is at %.4f m, %d resets of the mesh, %zu vertices\n", tip_displacement_, resets_,
                positions_.size() / 2);
    require(resets_ > 0 && tip_displacement_ > 0.1 * kPull, "a flap that follows the spring on other meshes");
  }

 private:
  static constexpr int kWindows = 20, kIterations = 3;
  static constexpr double kWindow = 0.02, kStiffness = 2e4, kPull = 0.3;

  static void require(bool is_so, const char* rule) {
    if (!is_so) throw std::logic_error(std::string("stand-in of preCICE: expected ") + rule);
  }
  /// The topmost vertex.
  std::size_t tip() const {
    std::size_t best = 0;
    for (std::size_t i = 0; i < positions_.size() / 2; ++i)
      if (positions_[2 * i + 1] > positions_[2 * best + 1]) best = i;
    return best;
  }

  std::vector<double> positions_;
  double tip_displacement_ = 0;
  int window_ = 0, iteration_ = 0, advances_ = 0, resets_ = 0;
  bool is_initialized_ = false, can_define_ = true, is_reset_ = false, is_complete_ = false;
  bool needs_checkpoint_ = false, needs_restore_ = false;
};

}  // namespace precice
