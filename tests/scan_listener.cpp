// SPDX-License-Identifier: BSD-3-Clause
// scan_listener TOPIC...: prints a line for each sensor_msgs/LaserScan that comes on the topics (scan_line.h), and for each
// status on /diagnostics: status LEVEL NAME<tab>MESSAGE<tab>KEY=VALUE<tab>...
#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "scan_line.h"

namespace {

void heard(const std::string& topic, const sensor_msgs::LaserScan& scan) {
  ScanLine line(topic);
  for (const float range : scan.ranges) line.add(static_cast<double>(range));
  line.print(scan.header.stamp.toSec());
}

std::string onLine(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\n' || c == '\t'; }, ' ');
  return text;
}

void diagnosed(const diagnostic_msgs::DiagnosticArray::ConstPtr& array) {
  for (const auto& status : array->status) {
    std::printf("status %d %s\t%s", static_cast<int>(status.level), onLine(status.name).c_str(),
                onLine(status.message).c_str());
    for (const auto& item : status.values)
      std::printf("\t%s=%s", onLine(item.key).c_str(), onLine(item.value).c_str());
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
