// SPDX-License-Identifier: BSD-3-Clause
// The topics and services by which others drive, hold and stop the chair.
#pragma once

#include <geometry_msgs/Twist.h>
#include <ros/message_event.h>
#include <ros/node_handle.h>
#include <std_msgs/Bool.h>
#include <std_msgs/Float64.h>
#include <std_srvs/Trigger.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "base/drive.h"
#include "base/node/settings.h"

namespace kurumaisu {

class CommandInput {
 public:
  using Clock = std::function<double()>;  ///< time of the control loop [s]

  using Action = std::function<void()>;

  /// act: called after every word that may change what is put out. drive must outlive this object.
  CommandInput(ros::NodeHandle& nh, const BaseTopics& topics, Drive& drive, Clock clock, Action act);

 private:
  using Command = ros::MessageEvent<const geometry_msgs::Twist>;
  using Answer = std_srvs::Trigger::Response;

  template <typename Message>
  void hear(ros::NodeHandle& nh, const std::string& topic, std::uint32_t queue,
            const boost::function<void(const ros::MessageEvent<const Message>&)>& action);
  void hearInput(ros::NodeHandle& nh, std::size_t input, const std::string& topic);
  void hearOthers(ros::NodeHandle& nh, const BaseTopics& topics);
  void serve(ros::NodeHandle& nh, const std::string& name, const std::function<void(Answer&)>& action);
  void onCommand(std::size_t input, const std::string& topic, const Command& event);
  void onReset(Answer& answer);

  Drive& drive_;
  Clock clock_;
  Action act_;
  std::vector<ros::Subscriber> subscribers_;
  std::vector<ros::ServiceServer> services_;
};

}  // namespace kurumaisu
