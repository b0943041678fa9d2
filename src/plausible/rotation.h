// SPDX-License-Identifier: BSD-3-Clause
// The yaw of a quaternion: one rule for all readers, in C++ and in Python.
#pragma once

namespace kurumaisu {

struct Quaternion {
  double x, y, z, w;
};

/// The yaw [rad] of a rotation (about z, y, x in turn); roll and pitch are dropped. Any length will do, as a person
/// types 1, 1 for a quarter turn. Throws std::invalid_argument for a length of 0, for what is no number, and for a
/// frame tilted so far that its heading says little.
double yawOf(const Quaternion& rotation);

}  // namespace kurumaisu
