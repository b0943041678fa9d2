// SPDX-License-Identifier: BSD-3-Clause
#include "base/node/command_input.h"

#include <ros/console.h>

#include <utility>

namespace kurumaisu {
namespace {

constexpr double kWarningPeriod = 1.0;  // [s] of throttled warnings
constexpr int kQueue = 10;
constexpr int kAll = 0;  // a queue that drops nothing: a press must not be lost among releases

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

/// A publisher is there as long as its connection is: only that holds what it introduced itself with.
template <typename Message>
Speaker speakerOf(const ros::MessageEvent<const Message>& event) {
  const boost::weak_ptr<ros::M_string> connection = event.getConnectionHeaderPtr();
  return {event.getPublisherName(), [connection] { return !connection.expired(); }};
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
  hear<geometry_msgs::Twist>(nh, topic, kQueue, [this, input, topic](const Command& event) {
    onCommand(input, topic, event);
    act_();
  });
}

template <typename Message>
void CommandInput::hear(ros::NodeHandle& nh, const std::string& topic, std::uint32_t queue,
                        const boost::function<void(const ros::MessageEvent<const Message>&)>& action) {
  subscribers_.push_back(nh.subscribe<Message, const ros::MessageEvent<const Message>&>(
      topic, queue, action, ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay()));
}

void CommandInput::hearOthers(ros::NodeHandle& nh, const BaseTopics& topics) {
  for (std::size_t i = 0; i < topics.locks.size(); ++i) {
    hear<std_msgs::Bool>(nh, topics.locks[i], kAll, [this, i](const auto& event) {
      const unsigned word = event.getConstMessage()->data;
      const bool blocks_on = drive_.arbiter().settings().locks[i].blocks_on;
      drive_.arbiter().lock(i, speakerOf(event), word > 1 || (word != 0) == blocks_on, clock_());
      act_();
    });
  }
  hear<std_msgs::Bool>(nh, topics.estop, kAll, [this](const auto& event) {
    drive_.eStop().hear(speakerOf(event), event.getConstMessage()->data != 0, clock_());
    act_();
  });
  hear<std_msgs::Float64>(nh, topics.speed_cap, kQueue, [this](const auto& event) {
    const double cap = event.getConstMessage()->data;
    if (drive_.speedCap().hear(event.getPublisherName(), cap, clock_())) return;
    ROS_WARN_THROTTLE(kWarningPeriod, "BASE_BAD_CAP: %s says %g m/s, not from 0 on: stops",
                      event.getPublisherName().c_str(), cap);
    act_();
  });
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
