// SPDX-License-Identifier: BSD-3-Clause
// scan_listener TOPIC...: prints a line for each sensor_msgs/LaserScan that comes on the topics, and for each status on
// /diagnostics. For scripts/bench laser and faults, whose sensor shows all beams the same range, another one each scan:
//   scan TOPIC ARRIVAL NOW STAMP RANGE BEAMS OTHERS CODES NANS INFS
// ARRIVAL is [s] of the monotonic clock, NOW and STAMP [s] of the host's, RANGE the median [mm], OTHERS how many measured
// beams are not at the median, CODES how many are below 20 mm, where the sensor's error codes lie.
//   status LEVEL NAME<tab>MESSAGE<tab>KEY=VALUE<tab>...
#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

namespace {

constexpr float kCodes = 0.02F;  // [m]

double monotonic() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

long median(std::vector<long> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void heard(const std::string& topic, const sensor_msgs::LaserScan& scan) {
  const double arrival = monotonic();
  const double now = ros::WallTime::now().toSec();
  std::vector<long> measured;
  long codes = 0, nans = 0, infs = 0;
  for (const float range : scan.ranges) {
    if (std::isnan(range))
      ++nans;
    else if (std::isinf(range))
      ++infs;
    else if (range < kCodes)
      ++codes;
    else
      measured.push_back(std::lround(1000.0 * static_cast<double>(range)));
  }
  const long middle = median(measured);
  const auto others =
      static_cast<long>(measured.size()) - std::count(measured.begin(), measured.end(), middle);
  std::printf("scan %s %.6f %.6f %.6f %ld %zu %ld %ld %ld %ld\n", topic.c_str(), arrival, now,
              scan.header.stamp.toSec(), middle, scan.ranges.size(), static_cast<long>(others), codes, nans,
              infs);
  std::fflush(stdout);
}

std::string line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\n' || c == '\t'; }, ' ');
  return text;
}

void diagnosed(const diagnostic_msgs::DiagnosticArray::ConstPtr& array) {
  for (const auto& status : array->status) {
    std::printf("status %d %s\t%s", static_cast<int>(status.level), line(status.name).c_str(),
                line(status.message).c_str());
    for (const auto& item : status.values)
      std::printf("\t%s=%s", line(item.key).c_str(), line(item.value).c_str());
    std::puts("");
  }
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "scan_listener", ros::init_options::AnonymousName | ros::init_options::NoRosout);
  ros::NodeHandle node;
  std::vector<ros::Subscriber> subscribers;
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  for (int i = 1; i < argc; ++i) {
    const std::string topic = argv[i];
    subscribers.push_back(node.subscribe<sensor_msgs::LaserScan>(
        topic, 100, [topic](const sensor_msgs::LaserScan::ConstPtr& scan) { heard(topic, *scan); }, nullptr,
        hints));
  }
  subscribers.push_back(node.subscribe("/diagnostics", 100, diagnosed));
  std::puts("ready");
  std::fflush(stdout);
  ros::spin();
}
