// SPDX-License-Identifier: BSD-3-Clause
// What slam_gmapping's parameters are here. No ROS.
#pragma once

#include <vector>

namespace kurumaisu {

struct GmappingName {
  const char* name;
  const char* section;  ///< of our parameters; null where there is nothing of this meaning
  const char* key;      ///< in that section; or why there is nothing
};

const std::vector<GmappingName>& gmappingNames();

}  // namespace kurumaisu
