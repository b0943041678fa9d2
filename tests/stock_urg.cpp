// SPDX-License-Identifier: BSD-3-Clause
// stock_urg DEVICE | stock_urg HOST PORT: MRPT's own driver as its users run it, without ROS, for scripts/bench laser.
// Prints a line for each scan (scan_line.h); beams that MRPT calls invalid are NaN.
#include <mrpt/hwdrivers/CHokuyoURG.h>
#include <mrpt/obs/CObservation2DRangeScan.h>

#include <chrono>
#include <cstdio>
#include <exception>
#include <limits>
#include <string>
#include <thread>

#include "scan_line.h"

namespace {

constexpr auto kPause = std::chrono::milliseconds(200);  // after an error, or it spins: it returns at once

void print(const mrpt::obs::CObservation2DRangeScan& scan) {
  ScanLine line("/scan");
  for (std::size_t i = 0; i < scan.getScanSize(); ++i) {
    line.add(scan.getScanRangeValidity(i) ? static_cast<double>(scan.getScanRange(i))
                                          : std::numeric_limits<double>::quiet_NaN());
  }
  line.print(mrpt::Clock::toDouble(scan.timestamp));
}

bool started(mrpt::hwdrivers::CGenericSensor& sensor) {
  try {
    sensor.initialize();
    return true;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return false;
  }
}

/// Takes a scan if there is one. False after an error.
bool step(mrpt::hwdrivers::CHokuyoURG& sensor) {
  bool there = false;
  bool failed = false;
  mrpt::obs::CObservation2DRangeScan scan;
  try {
    sensor.doProcessSimple(there, scan, failed);
  } catch (const std::exception&) {
    failed = true;
  }
  if (there) print(scan);
  return !failed;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  mrpt::hwdrivers::CHokuyoURG sensor;
  if (argc > 2) {
    sensor.setIPandPort(argv[1], static_cast<unsigned>(std::stoul(argv[2])));
  } else {
    sensor.setSerialPort(argv[1]);
  }
  std::puts("ready");
  std::fflush(stdout);
  while (!started(sensor)) std::this_thread::sleep_for(kPause);
  for (;;) {
    if (!step(sensor)) std::this_thread::sleep_for(kPause);
  }
}
