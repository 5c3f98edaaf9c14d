// SPDX-License-Identifier: MIT
#pragma once

namespace itr {

struct OutputOptions {
  int skip_frames = 1;  ///< store every n-th step
};

}  // namespace itr
