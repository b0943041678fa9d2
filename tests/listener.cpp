// SPDX-License-Identifier: BSD-3-Clause
// listener SECONDS TOPIC...: hears the topics, whatever their types, and says how many messages came in so many seconds
// after the first of each. Drives a circle on every topic that ends in cmd_vel. For benchmarks: cheap as roscpp can be.
#include <geometry_msgs/Twist.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>

#include <cstdlib>
#include <iostream>
#include <map>
#include <string>
#include <vector>

/// A message of any type, left unread.
struct Any {};

namespace {

constexpr double kPatience = 20.0;             // [s] for every topic's first message
constexpr double kForward = 0.3, kTurn = 0.5;  // [m/s, rad/s]

using Counts = std::map<std::string, long>;

bool allHeard(const Counts& counts) {
  for (const auto& item : counts) {
    if (item.second == 0) return false;
  }
  return true;
}

void print(const Counts& counts) {
  for (const auto& item : counts) std::cout << item.first << ' ' << item.second << ' ';
  std::cout << '\n' << std::flush;  // flushed: who reads it takes the time
}

bool isCommand(const std::string& topic) {
  const std::string end = "cmd_vel";
  return topic.size() >= end.size() && topic.compare(topic.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

namespace ros::message_traits {
template <>
struct MD5Sum<Any> {
  static const char* value() { return "*"; }
  static const char* value(const Any& /*unused*/) { return "*"; }
};
template <>
struct DataType<Any> {
  static const char* value() { return "*"; }
  static const char* value(const Any& /*unused*/) { return "*"; }
};
template <>
struct Definition<Any> {
  static const char* value() { return ""; }
  static const char* value(const Any& /*unused*/) { return ""; }
};
}  // namespace ros::message_traits

namespace ros::serialization {
template <>
struct Serializer<Any> {
  template <typename Stream>
  static void read(Stream& /*unused*/, Any& /*unused*/) {}
};
}  // namespace ros::serialization

int main(int argc, char** argv) {
  ros::init(argc, argv, "listener", ros::init_options::AnonymousName | ros::init_options::NoRosout);
  ros::NodeHandle node;
  Counts counts;
  std::vector<ros::Subscriber> subscribers;
  std::vector<ros::Publisher> publishers;
  for (int i = 2; i < argc; ++i) {
    const std::string topic = argv[i];
    if (isCommand(topic)) {
      publishers.push_back(node.advertise<geometry_msgs::Twist>(topic, 1, true));
      geometry_msgs::Twist circle;
      circle.linear.x = kForward;
      circle.angular.z = kTurn;
      publishers.back().publish(circle);
    } else {
      long& count = counts[topic];
      subscribers.push_back(node.subscribe<Any>(
          topic, 10000, [&count](const boost::shared_ptr<Any const>& /*unused*/) { ++count; }));
    }
  }
  ros::CallbackQueue& queue = *ros::getGlobalCallbackQueue();
  const ros::WallTime last = ros::WallTime::now() + ros::WallDuration(kPatience);
  while (ros::ok() && !allHeard(counts) && ros::WallTime::now() < last)
    queue.callAvailable(ros::WallDuration(0.01));
  print(counts);
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(argc > 1 ? std::atof(argv[1]) : 0.0);
  while (ros::ok() && ros::WallTime::now() < end) queue.callAvailable(ros::WallDuration(0.01));
  print(counts);
  return allHeard(counts) ? 0 : 1;
}
