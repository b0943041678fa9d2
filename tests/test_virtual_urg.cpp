// SPDX-License-Identifier: BSD-3-Clause
// The virtual sensor: its bytes against those of the specification, of a real sensor, and of each fault.
#include <gtest/gtest.h>

#include "sensor_file.h"
#include "virtual_urg/device.h"

namespace v = kurumaisu::virtual_urg;

TEST(Smoke, Smoke) {
  v::Model m = v::modelOf(SOURCE_DIR "/launch/urg/urg_04lx.yaml");
  v::Device d(m, {}, {}, 0);
  std::cout << d.receive("V\nVV\nSCIP2.0\n", 0).bytes
            << d.receive("VV\nPP\nII;hallo\nBM\nCR00\nHS0\nMD0044072500000\nXX\n", 6.487).bytes;
  v::Measurement q;
  q.ranges.assign(682, 1.234);
  std::cout << d.measure(q, 0.1).bytes;
}

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
