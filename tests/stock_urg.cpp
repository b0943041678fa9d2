// SPDX-License-Identifier: BSD-3-Clause
// stock_urg DEVICE | stock_urg HOST PORT: MRPT's own driver as its users run it, for scripts/bench laser and faults.
// Prints what scan_listener prints, without ROS between; errors are counted on the last line of each second.
#include <mrpt/hwdrivers/CHokuyoURG.h>
#include <mrpt/obs/CObservation2DRangeScan.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>
#include <thread>
#include <vector>

namespace {

constexpr auto kPause = std::chrono::milliseconds(200);  // after an error, or it spins: it returns at once

template <typename Clock>
double now() {
  return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
}

void print(const mrpt::obs::CObservation2DRangeScan& scan) {
  const double arrival = now<std::chrono::steady_clock>();
  std::vector<long> measured;
  long codes = 0, invalid = 0;
  for (std::size_t i = 0; i < scan.getScanSize(); ++i) {
    const long range = std::lround(1000.0 * static_cast<double>(scan.getScanRange(i)));
    if (!scan.getScanRangeValidity(i))
      ++invalid;
    else if (range < 20)
      ++codes;
    else
      measured.push_back(range);
  }
  long middle = 0;
  if (!measured.empty()) {
    const auto half = measured.begin() + static_cast<std::ptrdiff_t>(measured.size() / 2);
    std::nth_element(measured.begin(), half, measured.end());
    middle = *half;
  }
  const auto others =
      static_cast<long>(measured.size()) - std::count(measured.begin(), measured.end(), middle);
  std::printf("scan /scan %.6f %.6f %.6f %ld %zu %ld %ld %ld 0\n", arrival, now<std::chrono::system_clock>(),
              mrpt::Clock::toDouble(scan.timestamp), middle, scan.getScanSize(), static_cast<long>(others),
              codes, invalid);
  std::fflush(stdout);
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

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  mrpt::hwdrivers::CHokuyoURG sensor;
  if (argc > 2)
    sensor.setIPandPort(argv[1], static_cast<unsigned>(std::stoul(argv[2])));
  else
    sensor.setSerialPort(argv[1]);
  std::puts("ready");
  std::fflush(stdout);
  while (!started(sensor)) std::this_thread::sleep_for(kPause);
  for (;;) {
    bool there = false, failed = false;
    mrpt::obs::CObservation2DRangeScan scan;
    try {
      sensor.doProcessSimple(there, scan, failed);
    } catch (const std::exception&) {
      failed = true;
    }
    if (there) print(scan);
    if (failed) std::this_thread::sleep_for(kPause);
  }
}
