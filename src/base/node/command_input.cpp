// SPDX-License-Identifier: BSD-3-Clause
#include "base/node/command_input.h"

#include <ros/console.h>

#include <utility>

namespace kurumaisu {
namespace {

constexpr double kWarningPeriod = 1.0;  // [s] of throttled warnings
constexpr int kQueue = 10;

void warnIgnored(const std::string& topic, const geometry_msgs::Twist& twist) {
  ROS_WARN_THROTTLE(kWarningPeriod,
                    "BASE_IGNORED_COMPONENT: %s: only linear.x and angular.z are obeyed: linear.y %g, "
                    "linear.z %g, angular.x %g, angular.y %g",
                    topic.c_str(), twist.linear.y, twist.linear.z, twist.angular.x, twist.angular.y);
}

void warnRefused(const std::string& topic, const geometry_msgs::Twist& twist) {
  ROS_WARN_THROTTLE(kWarningPeriod, "BASE_BAD_COMMAND: %s: refused: linear.x %g, angular.z %g", topic.c_str(),
                    twist.linear.x, twist.angular.z);
}

void tellReset(const std::string& refusal) {
  const bool refused = !refusal.empty();
  ROS_LOG(refused ? ros::console::levels::Warn : ros::console::levels::Info, ROSCONSOLE_DEFAULT_NAME, "%s",
          refused ? ("BASE_RESET_REFUSED: " + refusal).c_str() : "the emergency stop is released");
}

}  // namespace

CommandInput::CommandInput(ros::NodeHandle& nh, const BaseTopics& topics, Drive& drive, Clock clock,
                           Action act)
    : drive_(drive), clock_(std::move(clock)), act_(std::move(act)) {
  for (std::size_t i = 0; i < topics.inputs.size(); ++i) hearInput(nh, i, topics.inputs[i]);
  hearOthers(nh, topics);
  ros::NodeHandle own("~");
  serve(own, "e_stop", [this](Answer& answer) {
    drive_.eStop().press();
    act_();
    answer.success = 1U;
  });
  serve(own, "reset", [this](Answer& answer) { onReset(answer); });
}

void CommandInput::hearInput(ros::NodeHandle& nh, std::size_t input, const std::string& topic) {
  const boost::function<void(const Command&)> hear = [this, input, topic](const Command& event) {
    onCommand(input, topic, event);
    act_();
  };
  subscribers_.push_back(nh.subscribe<geometry_msgs::Twist, const Command&>(
      topic, kQueue, hear, ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay()));
}

void CommandInput::hearOthers(ros::NodeHandle& nh, const BaseTopics& topics) {
  const ros::TransportHints soon = ros::TransportHints().tcpNoDelay();
  using Bool = std_msgs::Bool::ConstPtr;
  for (std::size_t i = 0; i < topics.locks.size(); ++i) {
    const boost::function<void(const Bool&)> lock = [this, i](const Bool& word) {
      drive_.arbiter().lock(i, word->data != 0, clock_());
      act_();
    };
    subscribers_.push_back(nh.subscribe<std_msgs::Bool>(topics.locks[i], kQueue, lock, {}, soon));
  }
  const boost::function<void(const Bool&)> stop = [this](const Bool& word) {
    drive_.eStop().hear(word->data != 0, clock_());
    act_();
  };
  subscribers_.push_back(nh.subscribe<std_msgs::Bool>(topics.estop, kQueue, stop, {}, soon));
  const boost::function<void(const std_msgs::Float64::ConstPtr&)> cap =
      [this](const std_msgs::Float64::ConstPtr& word) {
        if (drive_.speedCap().hear(word->data, clock_())) return;
        ROS_WARN_THROTTLE(kWarningPeriod, "BASE_BAD_CAP: refused: %g m/s", word->data);
      };
  subscribers_.push_back(nh.subscribe<std_msgs::Float64>(topics.speed_cap, kQueue, cap, {}, soon));
}

void CommandInput::serve(ros::NodeHandle& nh, const std::string& name,
                         const std::function<void(Answer&)>& action) {
  const boost::function<bool(std_srvs::Trigger::Request&, Answer&)> callback =
      [action](std_srvs::Trigger::Request&, Answer& answer) {
        action(answer);
        return true;
      };
  services_.push_back(nh.advertiseService(name, callback));
}

void CommandInput::onCommand(std::size_t input, const std::string& topic, const Command& event) {
  const geometry_msgs::Twist& twist = *event.getConstMessage();
  if (twist.linear.y != 0 || twist.linear.z != 0 || twist.angular.x != 0 || twist.angular.y != 0) {
    drive_.countIgnored();
    warnIgnored(topic, twist);
  }
  const Rates rates{twist.linear.x, twist.angular.z};
  if (!drive_.command(input, event.getPublisherName(), rates, clock_())) warnRefused(topic, twist);
}

void CommandInput::onReset(Answer& answer) {
  answer.message = drive_.resetEStop(clock_());
  answer.success = static_cast<unsigned char>(answer.message.empty());
  tellReset(answer.message);
}

}  // namespace kurumaisu
