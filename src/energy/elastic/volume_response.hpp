// SPDX-License-Identifier: MIT
#pragma once

namespace itr {

/// An energy density of volume changes [J/m^Dim], and its derivatives by J or by ln J.
struct VolumeResponse {
  double value = 0, first = 0, second = 0;
};

}  // namespace itr
