// SPDX-License-Identifier: BSD-3-Clause
// Commands in; voltages, cmd_vel_out, odom, tf and diagnostics out. What it does with them is in drive.h.
#include <diagnostic_updater/diagnostic_updater.h>
#include <geometry_msgs/TwistStamped.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <ros/xmlrpc_manager.h>
#include <std_msgs/String.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <exception>
#include <memory>
#include <stdexcept>

#include "base/command_input.h"
#include "base/guard_dac.h"
#include "base/last_word.h"
#include "base/limits_server.h"
#include "base/master_watch.h"
#include "base/odometry_input.h"
#include "base/odometry_output.h"
#include "base/odometry_report.h"
#include "base/report.h"
#include "base/settings.h"
#include "base/topic_dac.h"
#include "guard/realtime.h"
#include "steady.h"

namespace k = kurumaisu;

namespace {

using Status = diagnostic_updater::DiagnosticStatusWrapper;

constexpr double kGlance = 0.02;     // [s] longest wait for anything
constexpr int kLastSamples = 5;      // of neutral at the end, with
constexpr double kLastPause = 0.02;  // [s] after each, time for it to leave the process

std::atomic<bool> stop_requested{false};

void warn(const std::string& text) { ROS_WARN("%s", text.c_str()); }

void logLaw(const std::string& name, const std::string& ambiguity) {
  ROS_INFO("voltage law: %s", name.c_str());
  if (!ambiguity.empty()) warn("BASE_AMBIGUOUS_LAW: " + name + ": " + ambiguity);
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
  void onTick();
  ros::SteadyTime tickAfter(const ros::SteadyTime& due);
  static ros::SteadyTime listen(const ros::SteadyTime& until);
  void act();
  void publish();
  void tell();
  bool isForgotten();
  void finish();
  void reportOdometry(Status& status);
  void reportGuard(Status& status);
  static void diagnose(Status& status, const k::Report& report);

  k::BaseSettings settings_;
  std::unique_ptr<k::GuardDac> guard_;  ///< or none
  k::TopicDac dac_;
  k::Drive drive_;
  k::LastWord last_word_;
  k::Tally told_;                    ///< at the last tick
  k::Tally reported_;                ///< at the last diagnostics
  std::string state_;                ///< at the last tick
  k::guard::Status reported_guard_;  ///< at the last diagnostics
  double last_diagnostics_ = 0;      ///< [s]
  bool heard_ = false;               ///< a word that may change what is put out
  diagnostic_updater::Updater diagnostics_;
  k::OdometryOutput odom_;
  k::OdometryInput odom_input_;
  k::GyroCounts reported_gyro_;  ///< at the last diagnostics
  ros::Publisher cmd_vel_out_;
  ros::Publisher active_input_;
  k::CommandInput input_;
  k::LimitsServer limits_;
  k::MasterWatch master_;
  ros::Timer timer_;  ///< of simulated time
};

BaseNode::BaseNode(ros::NodeHandle& nh, const k::BaseSettings& settings)
    : settings_(settings),
      guard_(settings.dac.guard
                 ? std::make_unique<k::GuardDac>(*settings.dac.guard, settings.drive.outlet.law)
                 : nullptr),
      dac_(nh, guard_.get()),
      drive_(settings.drive, dac_),
      last_word_([this] { finish(); }),
      odom_(nh, settings.odometry.names),
      odom_input_(nh, drive_, settings.odometry, loopTime),
      cmd_vel_out_(nh.advertise<geometry_msgs::TwistStamped>("cmd_vel_out", 10)),
      active_input_(nh.advertise<std_msgs::String>("active_input", 1, true)),
      input_(
          nh, settings.topics, drive_, [] { return loopTime(ros::Time::now()); }, [this] { heard_ = true; }),
      limits_(settings.limit_names, drive_),
      master_(settings.master_timeout) {
  logLaw(settings_.law_name, k::ambiguity(drive_.outlet()));
  const std::string unfollowed = k::unfollowedWarning(settings.effects.unfollowed);
  if (!unfollowed.empty()) warn(unfollowed);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("voltage law", [this](Status& status) {
    diagnose(status, k::reportLaw(drive_.outlet(), settings_.law_name));
  });
  diagnostics_.add("commands", [this](Status& status) {
    diagnose(status, k::reportCommands(drive_, reported_));
    reported_ = k::tally(drive_);
  });
  diagnostics_.add("odometry", [this](Status& status) { reportOdometry(status); });
  const std::string refusal = guard_ ? k::guard::favourThreads(settings_.dac.favour) : "";
  if (!refusal.empty()) warn("BASE_NOT_FAVOURED: busy cores may delay commands, and neutral: " + refusal);
  if (guard_) diagnostics_.add("guard", [this](Status& status) { reportGuard(status); });
  if (ros::Time::isSimTime()) {
    timer_ =
        nh.createTimer(ros::Duration(1.0 / settings_.rate), [this](const ros::TimerEvent&) { onTick(); });
  }
}

void BaseNode::run() {
  try {
    ros::SteadyTime due = ros::SteadyTime::now();
    while (ros::ok() && !stop_requested && !isForgotten()) {
      due = ros::Time::isSimTime() ? listen(due) : tickAfter(due);
    }
  } catch (...) {
    finish();
    throw;
  }
  finish();
  if (isForgotten()) {
    throw std::runtime_error(
        "BASE_MASTER_FORGOT: another ROS master has taken the place of the one that knew this node");
  }
}

/// Whether it is time to end, for somebody to start it anew: nobody finds this node any more, and it stands.
bool BaseNode::isForgotten() {
  return master_.forgotten() && drive_.output().v == 0 && drive_.output().w == 0;
}

/// Works on what comes until the tick that is due, and ticks; returns when the next one is due. No ros::Timer:
/// a system clock that is set back would stall it, and the chair would drive on; and its thread costs as much
/// as all this.
ros::SteadyTime BaseNode::tickAfter(const ros::SteadyTime& due) {
  const ros::SteadyTime now = listen(due);
  if (now < due) {
    if (heard_) act();
    return due;
  }
  heard_ = false;
  onTick();
  const ros::SteadyTime next = due + ros::WallDuration(1.0 / settings_.rate);
  return next < now ? now : next;  // ticks that were missed are not made up for
}

/// Works on what comes, waiting for it until a time, but not so long that a signal waits; returns the time.
ros::SteadyTime BaseNode::listen(const ros::SteadyTime& until) {
  const double wait = ros::Time::isSimTime() ? kGlance : (until - ros::SteadyTime::now()).toSec();
  ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(std::clamp(wait, 0.0, kGlance)));
  return ros::SteadyTime::now();
}

void BaseNode::finish() {
  for (int i = 0; i < kLastSamples; ++i) {
    dac_.stamp = ros::Time::now();
    drive_.stop(loopTime(dac_.stamp));
    ros::WallDuration(kLastPause).sleep();
  }
}

void BaseNode::onTick() {
  dac_.stamp = ros::Time::now();
  const double t = loopTime(dac_.stamp);
  drive_.cutOff(master_.lost() || master_.forgotten());
  const k::Drive::Tick tick = drive_.tick(t);
  if (tick == k::Drive::Tick::kReset) {
    warn("BASE_TIME_RESET: time ran backwards: neutral, odometry starts afresh");
  }
  odom_input_.check();
  if (tick != k::Drive::Tick::kRepeated) publish();
  tell();
  if (std::abs(t - last_diagnostics_) >= settings_.diagnostic_period) {
    last_diagnostics_ = t;
    diagnostics_.force_update();  // update() would fall silent when the clock is set back
  }
}

/// Words are obeyed at once, not at the next tick; those that came together, together. In simulated time there
/// are ticks only: one seed, one run.
void BaseNode::act() {
  heard_ = false;
  dac_.stamp = ros::Time::now();
  drive_.tick(loopTime(dac_.stamp));
}

void BaseNode::publish() {
  odom_.publish(drive_.odometry(), dac_.stamp);
  geometry_msgs::TwistStamped survived;
  survived.header.stamp = dac_.stamp;
  survived.header.frame_id = settings_.odometry.names.child_frame;
  survived.twist.linear.x = drive_.output().v;
  survived.twist.angular.z = drive_.output().w;
  cmd_vel_out_.publish(survived);
}

/// Says what has changed.
void BaseNode::tell() {
  const std::string warning = k::warningOf(drive_, told_, state_);
  if (!warning.empty()) warn(warning);
  told_ = k::tally(drive_);
  const std::string state = k::stateOf(drive_);
  if (state == state_) return;
  state_ = state;
  std_msgs::String active;
  active.data = k::activeInput(drive_);
  active_input_.publish(active);
}

void BaseNode::reportOdometry(Status& status) {
  const k::Reckoning& reckoning = drive_.reckoning();
  const k::KnownEffects& effects = settings_.effects;
  diagnose(status,
           k::reportOdometry(reckoning, effects.unfollowed, effects.noise.has_value(), reported_gyro_));
  if (reckoning.gyro()) reported_gyro_ = reckoning.gyro()->counts();
}

void BaseNode::reportGuard(Status& status) {
  diagnose(status, k::reportGuard(guard_->status(), reported_guard_, k::steadyTime()));
  reported_guard_ = guard_->status();
}

void BaseNode::diagnose(Status& status, const k::Report& report) {
  status.summary(report.error ? Status::ERROR : report.warning ? Status::WARN : Status::OK, report.summary);
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
