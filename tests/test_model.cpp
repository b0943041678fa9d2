// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "model/voltage_law.h"

namespace k = kurumaisu;

TEST(VoltageLaw, HandComputed) {
  const k::AxisLaw translation{{1.32402, 0.127906}, {2.07369, -0.108783}};
  EXPECT_DOUBLE_EQ(translation.volts(0.5), 0.789916);
}

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
