// SPDX-License-Identifier: BSD-3-Clause
#include "plausible/rotation.h"

#include <cmath>
#include <sstream>
#include <stdexcept>

namespace kurumaisu {
namespace {

constexpr double kLeast = 1e-3, kMost = 1e3;  // length of a quaternion that somebody meant
constexpr double kUpright = 0.5;              // cosine of the tilt: 60 degrees

std::invalid_argument refusal(const char* expected, const Quaternion& q) {
  std::ostringstream text;
  text << "orientation: must be a quaternion " << expected << ": x " << q.x << ", y " << q.y << ", z " << q.z
       << ", w " << q.w;
  return std::invalid_argument(text.str());
}

}  // namespace

double yawOf(const Quaternion& q) {
  const double square = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w;
  if (!(square >= kLeast * kLeast && square <= kMost * kMost)) {
    throw refusal("of finite numbers, not all 0", q);
  }
  if (q.x == 0 && q.y == 0) return q.w >= 0 ? 2 * std::atan2(q.z, q.w) : 2 * std::atan2(-q.z, -q.w);
  const double up = (q.w * q.w + q.z * q.z - q.x * q.x - q.y * q.y) / square;
  if (up < kUpright) throw refusal("about z, tilted by less than 60 degrees", q);
  return std::atan2(2 * (q.w * q.z + q.x * q.y), q.w * q.w + q.x * q.x - q.y * q.y - q.z * q.z);
}

}  // namespace kurumaisu
