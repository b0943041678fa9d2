// SPDX-License-Identifier: BSD-3-Clause
// cmd_vel in; voltages, odom, tf and diagnostics out. What it does with them is in drive.h.
#include <diagnostic_updater/diagnostic_updater.h>
#include <geometry_msgs/Twist.h>
#include <kurumaisu/Voltages.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <ros/xmlrpc_manager.h>

#include <atomic>
#include <csignal>
#include <exception>

#include "base/odometry_input.h"
#include "base/odometry_output.h"
#include "base/odometry_report.h"
#include "base/report.h"
#include "base/settings.h"

namespace k = kurumaisu;

namespace {

using Status = diagnostic_updater::DiagnosticStatusWrapper;

constexpr double kWarningPeriod = 1.0;  // [s] of throttled warnings
constexpr int kLastSamples = 5;         // of neutral at the end, with
constexpr double kLastPause = 0.02;     // [s] after each, time for it to leave the process

std::atomic<bool> stop_requested{false};

/// The D/A converter as a topic: for the simulator and for drivers in other processes.
class TopicDac : public k::Dac {
 public:
  explicit TopicDac(ros::NodeHandle& nh) : publisher_(nh.advertise<k::Voltages>("voltages", 10)) {
    stamp = ros::Time::now();
  }

  void put(const k::Output& output) override {
    k::Voltages message;
    message.header.stamp = stamp;
    message.translation = output.translation;
    message.steering = output.steering;
    message.reference = output.reference;
    message.v = output.v;
    message.w = output.w;
    publisher_.publish(message);
  }

  ros::Time stamp;  ///< of the next sample

 private:
  ros::Publisher publisher_;
};

void warn(const std::string& text) { ROS_WARN("%s", text.c_str()); }

void logLaw(const std::string& name, const std::string& ambiguity) {
  ROS_INFO("voltage law: %s", name.c_str());
  if (!ambiguity.empty()) warn("BASE_AMBIGUOUS_LAW: " + name + ": " + ambiguity);
}

void warnIgnored(const geometry_msgs::Twist& twist) {
  ROS_WARN_THROTTLE(kWarningPeriod,
                    "BASE_IGNORED_COMPONENT: cmd_vel: only linear.x and angular.z are obeyed: linear.y %g, "
                    "linear.z %g, angular.x %g, angular.y %g",
                    twist.linear.y, twist.linear.z, twist.angular.x, twist.angular.y);
}

void warnRefused(const geometry_msgs::Twist& twist) {
  ROS_WARN_THROTTLE(kWarningPeriod, "BASE_BAD_COMMAND: cmd_vel: refused: linear.x %g, angular.z %g",
                    twist.linear.x, twist.angular.z);
}

/// Time [s] of the control loop: simulated time, or one that nobody can set.
double loopTime(const ros::Time& stamp) {
  return ros::Time::isSimTime() ? stamp.toSec() : ros::SteadyTime::now().toSec();
}

class BaseNode {
 public:
  BaseNode(ros::NodeHandle& nh, const k::BaseSettings& settings);

  /// Works until asked to stop; neutral is the last thing put out.
  void run();

 private:
  void onCommand(const geometry_msgs::Twist& twist);
  void onTick();
  void finish();
  void reportOdometry(Status& status);
  static void diagnose(Status& status, const k::Report& report);

  k::BaseSettings settings_;
  TopicDac dac_;
  k::Drive drive_;
  k::DriveCounts reported_;      ///< at the last diagnostics
  double last_diagnostics_ = 0;  ///< [s]
  diagnostic_updater::Updater diagnostics_;
  k::OdometryOutput odom_;
  k::OdometryInput odom_input_;
  k::GyroCounts reported_gyro_;  ///< at the last diagnostics
  ros::Subscriber cmd_vel_;
  ros::Timer timer_;
  ros::SteadyTimer steady_timer_;
};

BaseNode::BaseNode(ros::NodeHandle& nh, const k::BaseSettings& settings)
    : settings_(settings),
      dac_(nh),
      drive_(settings.drive, dac_),
      odom_(nh, settings.odometry.names),
      odom_input_(nh, drive_, settings.odometry, loopTime) {
  logLaw(settings_.law_name, k::ambiguity(drive_));
  const std::string unfollowed = k::unfollowedWarning(settings.effects.unfollowed);
  if (!unfollowed.empty()) warn(unfollowed);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("voltage law",
                   [this](Status& status) { diagnose(status, k::reportLaw(drive_, settings_.law_name)); });
  diagnostics_.add("commands", [this](Status& status) {
    diagnose(status, k::reportCommands(drive_, reported_));
    reported_ = drive_.counts();
  });
  diagnostics_.add("odometry", [this](Status& status) { reportOdometry(status); });
  cmd_vel_ = nh.subscribe("cmd_vel", 10, &BaseNode::onCommand, this, ros::TransportHints().tcpNoDelay());
  const double period = 1.0 / settings_.rate;
  if (ros::Time::isSimTime()) {
    timer_ = nh.createTimer(ros::Duration(period), [this](const ros::TimerEvent&) { onTick(); });
  } else {
    // A system clock that is set back would stall ros::Timer, and the chair would drive on.
    steady_timer_ =
        nh.createSteadyTimer(ros::WallDuration(period), [this](const ros::SteadyTimerEvent&) { onTick(); });
  }
}

void BaseNode::run() {
  const ros::WallDuration longest_wait(0.02);
  try {
    while (ros::ok() && !stop_requested) ros::getGlobalCallbackQueue()->callAvailable(longest_wait);
  } catch (...) {
    finish();
    throw;
  }
  finish();
}

void BaseNode::finish() {
  for (int i = 0; i < kLastSamples; ++i) {
    dac_.stamp = ros::Time::now();
    drive_.stop(loopTime(dac_.stamp));
    ros::WallDuration(kLastPause).sleep();
  }
}

void BaseNode::onCommand(const geometry_msgs::Twist& twist) {
  if (twist.linear.y != 0 || twist.linear.z != 0 || twist.angular.x != 0 || twist.angular.y != 0) {
    drive_.countIgnored();
    warnIgnored(twist);
  }
  if (!drive_.command(twist.linear.x, twist.angular.z, loopTime(ros::Time::now()))) warnRefused(twist);
}

void BaseNode::onTick() {
  dac_.stamp = ros::Time::now();
  const double t = loopTime(dac_.stamp);
  const std::uint64_t timeouts = drive_.counts().timeouts;
  const k::Drive::Tick tick = drive_.tick(t);
  if (drive_.counts().timeouts > timeouts) {
    warn("BASE_COMMAND_TIMEOUT: cmd_vel: nothing for " + std::to_string(settings_.drive.command_timeout) +
         " s: neutral");
  }
  if (tick == k::Drive::Tick::kReset) {
    warn("BASE_TIME_RESET: time ran backwards: neutral, odometry starts afresh");
  }
  odom_input_.check();
  if (tick != k::Drive::Tick::kRepeated) odom_.publish(drive_.odometry(), dac_.stamp);
  if (std::abs(t - last_diagnostics_) >= settings_.diagnostic_period) {
    last_diagnostics_ = t;
    diagnostics_.force_update();  // update() would fall silent when the clock is set back
  }
}

void BaseNode::reportOdometry(Status& status) {
  const k::Reckoning& reckoning = drive_.reckoning();
  const k::KnownEffects& effects = settings_.effects;
  diagnose(status,
           k::reportOdometry(reckoning, effects.unfollowed, effects.noise.has_value(), reported_gyro_));
  if (reckoning.gyro()) reported_gyro_ = reckoning.gyro()->counts();
}

void BaseNode::diagnose(Status& status, const k::Report& report) {
  status.summary(report.warning ? Status::WARN : Status::OK, report.summary);
  for (const auto& [name, value] : report.values) status.add(name, value);
}

/// Replaces what roscpp does at `rosnode kill`: it would close the topics before neutral is out.
void onShutdownCall(XmlRpc::XmlRpcValue& /*parameters*/, XmlRpc::XmlRpcValue& result) {
  stop_requested = true;
  result = ros::xmlrpc::responseInt(1, "", 0);
}

void stopGracefully() {
  for (const int signal : {SIGINT, SIGTERM}) {
    std::signal(signal, [](int /*signal*/) { stop_requested = true; });
  }
  ros::XMLRPCManager::instance()->unbind("shutdown");
  ros::XMLRPCManager::instance()->bind("shutdown", onShutdownCall);
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "base_node", ros::init_options::NoSigintHandler);
  ros::NodeHandle nh;  // here, because ROS_FATAL is mute once the last one is gone
  stopGracefully();
  try {
    BaseNode node(nh, k::readBaseSettings(k::Section::load(ros::this_node::getName())));
    node.run();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
  return 0;
}
