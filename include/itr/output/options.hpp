// SPDX-License-Identifier: MIT
#pragma once

#include "itr/core/units.hpp"

namespace itr {

struct OutputOptions {
  int skip_frames = 1;  ///< store every n-th step
  double checkpoint_period =
      30;            ///< least time between checkpoints, from which a run can be resumed [s]; 0: every stored step
  bool vtu = false;  ///< stored frames as VTU files too
  Units units{};     ///< of all that is written but checkpoints
};

}  // namespace itr
