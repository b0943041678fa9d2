// SPDX-License-Identifier: BSD-3-Clause
// Commands in; voltages, cmd_vel_out, odom, tf and diagnostics out. What it does with them is in drive.h.
#include <geometry_msgs/TwistStamped.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_msgs/String.h>

#include <algorithm>
#include <exception>
#include <memory>
#include <stdexcept>

#include "base/guard_dac.h"
#include "base/last_word.h"
#include "base/node/command_input.h"
#include "base/node/diagnostics_output.h"
#include "base/node/host_gate.h"
#include "base/node/limits_server.h"
#include "base/node/master_watch.h"
#include "base/node/odometry_input.h"
#include "base/node/odometry_output.h"
#include "base/node/settings.h"
#include "base/node/stop_request.h"
#include "base/node/topic_dac.h"
#include "base/report.h"
#include "clock_watch.h"
#include "command_line.h"
#include "guard/crash.h"
#include "guard/realtime.h"
#include "sleep_watch.h"
#include "standard_streams.h"

namespace k = kurumaisu;

namespace {

constexpr const char* kHelp = R"(usage: base_node

The base controller: follows the commands of one input at a time, within limits;
puts out voltages and computes odometry from them.
base.launch starts it: roslaunch kurumaisu base.launch

subscribes to:
  joy_vel, key_vel, viewer_vel, experiment_vel, cmd_vel
                    commands, those of the highest priority first
  hold, dead_man, passenger_holds
                    locks: while one is engaged, lower inputs do not drive
  e_stop            the emergency stop
  speed_cap         [m/s] at most
  imu               if odometry/imu/use is true
publishes:
  voltages          the output
  cmd_vel_out       the command after all limits
  odom, /tf
  active_input      the input that drives
  /diagnostics
services:
  ~e_stop, ~reset   stop, and release the stop
  ~reset_odometry, ~set_odometry
parameters:
  launch/base_node.yaml: also inputs, locks and their topics
  model: launch/md100.yaml. guard: launch/guard.yaml
  limits, while it runs: dynamic_reconfigure at ~limits/NAME

More: docs/base.md
)";

constexpr double kGlance = 0.02;     // [s] longest wait for anything
constexpr int kLastSamples = 5;      // of neutral at the end, with
constexpr double kLastPause = 0.02;  // [s] after each, time for it to leave the process

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
  void favour();

  k::BaseSettings settings_;
  std::unique_ptr<k::GuardDac> guard_;  ///< or none
  k::TopicDac dac_;
  k::Drive drive_;
  k::LastWord last_word_;
  k::Tally told_;       ///< at the last tick
  std::string state_;   ///< at the last tick
  int unfavoured_ = 0;  ///< threads, at the last tick
  bool heard_ = false;  ///< a word that may change what is put out
  k::SleepWatch sleep_;
  k::DiagnosticsOutput diagnostics_;
  k::OdometryOutput odom_;
  k::OdometryInput odom_input_;
  ros::Publisher cmd_vel_out_;
  ros::Publisher active_input_;
  k::CommandInput input_;
  k::LimitsServer limits_;
  k::MasterWatch master_;
  ros::Timer timer_;  ///< of simulated time
};

BaseNode::BaseNode(ros::NodeHandle& nh, const k::BaseSettings& settings)
    : settings_(settings),
      guard_(settings.dac.guard ? std::make_unique<k::GuardDac>(*settings.dac.guard, settings.dac.silence,
                                                                settings.drive.outlet.law)
                                : nullptr),
      dac_(nh, guard_.get()),
      drive_(settings.drive, dac_),
      last_word_([this] { finish(); }),
      diagnostics_(settings_, drive_, guard_.get()),
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
  const std::string no_dead_man = k::lockWarning(drive_.arbiter());
  if (!no_dead_man.empty()) warn(no_dead_man);
  if (guard_) favour();
  if (ros::Time::isSimTime()) {
    timer_ =
        nh.createTimer(ros::Duration(1.0 / settings_.rate), [this](const ros::TimerEvent&) { onTick(); });
  }
}

/// With a guard, dying must not wait for busy cores, and who is crashed from outside may leave a core file.
void BaseNode::favour() {
  k::guard::catchCrashes();
  const std::string refusal = k::guard::favourThreads(settings_.dac.favour);
  if (!refusal.empty()) warn("BASE_NOT_FAVOURED: busy cores may delay commands, and neutral: " + refusal);
}

void BaseNode::run() {
  try {
    ros::SteadyTime due = ros::SteadyTime::now();
    while (ros::ok() && !k::isStopRequested() && !isForgotten()) {
      due = ros::Time::isSimTime() ? listen(due) : tickAfter(due);
    }
  } catch (...) {
    finish();
    throw;
  }
  finish();
  if (isForgotten()) {
    throw std::runtime_error(
        "BASE_MASTER_FORGOT: a new ROS master is running, which does not know this node");
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
  const ros::Time stamp = ros::Time::now();
  if (ros::Time::isSimTime() && stamp == dac_.stamp) return;  // made up for a tick that was late
  dac_.stamp = stamp;
  const double t = loopTime(dac_.stamp);
  if (sleep_.hasSlept()) {
    warn("BASE_SLEPT: this computer was suspended: neutral, every input must be released anew");
    drive_.stop(t);
  }
  drive_.cutOff(master_.lost() || master_.forgotten());
  const k::Drive::Tick tick = drive_.tick(t);
  if (tick == k::Drive::Tick::kReset) {
    warn("BASE_TIME_RESET: time ran backwards: neutral, odometry restarts");
  }
  odom_input_.check();
  if (tick != k::Drive::Tick::kRepeated) publish();
  tell();
  diagnostics_.tick(t);
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
  if (k::guard::unfavoured() > unfavoured_)
    warn("BASE_NOT_FAVOURED: a thread ran for too long without a wait");
  unfavoured_ = k::guard::unfavoured();
  const std::string state = k::stateOf(drive_);
  if (state == state_) return;
  state_ = state;
  std_msgs::String active;
  active.data = k::activeInput(drive_);
  active_input_.publish(active);
}

}  // namespace

int main(int argc, char** argv) {
  k::holdStandardStreams();
  if (const auto code = k::answered(argc, argv, kHelp)) return *code;
  ros::init(argc, argv, "base_node", ros::init_options::NoSigintHandler);
  ros::NodeHandle nh;  // here, because ROS_FATAL is mute once the last one is gone
  const k::ClockWatch clock(nh);
  k::catchStopRequests();
  try {
    const k::BaseSettings settings = k::readBaseSettings(k::Section::load(ros::this_node::getName()));
    k::allowHosts(settings.allowed_hosts);
    BaseNode node(nh, settings);
    node.run();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
  return 0;
}
