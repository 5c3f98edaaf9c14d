// SPDX-License-Identifier: MIT
#pragma once

namespace itr {

struct OutputOptions {
  bool vtu = false;     ///< frames as VTU too
  int skip_frames = 1;  ///< store every n-th step
  double checkpoint_period =
      30;  ///< least time between checkpoints, from which a run can be resumed [s]; 0: every stored step
};

}  // namespace itr
