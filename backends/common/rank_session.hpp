// SPDX-License-Identifier: MIT
// Rank 0 and those who serve it: a communicator of their own, commands that rank 0 sends, and data cut into parts.
#pragma once

#include <mpi.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <type_traits>
#include <vector>

#include "mpi_session.hpp"

namespace itr::backends {

/// Command that rank 0 sends: a job for one of its instances.
struct RankCommand {
  int job = 0;  ///< 0: the session is over
  int instance = 0;
  int argument = 0;
};

/// One a module, used under its lock.
class RankSession {
 public:
  bool is_shared() const { return communicator_ != MPI_COMM_NULL; }
  /// Communicator of rank 0 and those who serve; of this rank alone where nobody does.
  MPI_Comm communicator() const { return is_shared() ? communicator_ : MPI_COMM_SELF; }
  int ranks() const { return ranks_; }
  /// Grows with each session that begins or ends: shared instances of an older one are void.
  int number() const { return number_; }
  int new_instance() { return ++instances_; }

  /// Collective over rank 0 and those who serve. `communicator` points to an MPI_Comm; null: all ranks of the launch.
  bool join(const void* communicator) {
    if (prepare_mpi(communicator == nullptr) != ITR_OK || is_shared()) return false;
    const MPI_Comm all = communicator ? *static_cast<const MPI_Comm*>(communicator) : MPI_COMM_WORLD;
    if (MPI_Comm_dup(all, &communicator_) != MPI_SUCCESS) return false;  // our messages do not meet the caller's
    MPI_Comm_size(communicator_, &ranks_);
    ++number_;
    return true;
  }
  void leave() {
    MPI_Comm_free(&communicator_);
    communicator_ = MPI_COMM_NULL;
    ranks_ = 1;
    ++number_;
  }
  /// On rank 0: lets the others go.
  void end() {
    if (!is_shared() || !mpi_is_running()) return;
    send({});
    leave();
  }

  void send(const RankCommand& command) const {
    for (int rank = 1; rank < ranks_; ++rank) MPI_Send(&command, kCommandSize, MPI_INT, rank, kCommandTag, communicator_);
  }
  /// Waits without burning the core that rank 0 may be using.
  RankCommand next_command() const {
    using namespace std::chrono_literals;
    constexpr auto kLongest = 200us;
    auto pause = 5us;
    for (int there = 0;; pause = std::min(2 * pause, kLongest)) {
      MPI_Iprobe(0, kCommandTag, communicator_, &there, MPI_STATUS_IGNORE);
      if (there) break;
      std::this_thread::sleep_for(pause);
    }
    RankCommand command;
    MPI_Recv(&command, kCommandSize, MPI_INT, 0, kCommandTag, communicator_, MPI_STATUS_IGNORE);
    return command;
  }

 private:
  static constexpr int kCommandTag = 71, kCommandSize = 3;

  MPI_Comm communicator_ = MPI_COMM_NULL;
  int ranks_ = 1;
  int number_ = 0;
  int instances_ = 0;
};

}  // namespace itr::backends
