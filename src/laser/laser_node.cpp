// SPDX-License-Identifier: BSD-3-Clause
// The laser driver as a ROS node: scan, laser_status and diagnostics out; no algorithm here.
#include <diagnostic_updater/diagnostic_updater.h>
#include <dynamic_reconfigure/server.h>
#include <ros/callback_queue.h>
#include <ros/package.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "clock_watch.h"
#include "command_line.h"
#include "laser/diagnosis.h"
#include "laser/driver.h"
#include "laser/messages.h"
#include "laser/self_test.h"
#include "laser/settings.h"
#include "laser/shipped.h"
#include "plausible/quantity.h"
#include "standard_streams.h"

namespace {

namespace k = kurumaisu::laser;
using diagnostic_msgs::DiagnosticStatus;
using kurumaisu::LaserConfig;
using std_srvs::Trigger;

constexpr const char* kHelp = R"(usage: laser_node

The driver of a Hokuyo URG or UTM laser scanner. Replaces urg_node.
laser.launch starts it:
roslaunch kurumaisu laser.launch serial_port:=/dev/ttyACM0

publishes:
  scan                    sensor_msgs/LaserScan
  laser_status            the state of the sensor, when it changes
  /diagnostics
services:
  update_laser_status     publish laser_status again
  ~restart                open the port again
  ~self_test              likewise, and wait for three good scans
parameters:
  launch/laser_node.yaml, which the node reads itself. The sensor is at
  ip_address and ip_port, or at serial_port
  angle_min, angle_max, skip and more, while it runs: dynamic_reconfigure

More: docs/laser_node.md
)";

constexpr double kLongestWait = 0.02;   // [s] for a callback, so that a stop is soon noticed
constexpr double kWarningPeriod = 1.0;  // [s] between two equal warnings
constexpr std::uint32_t kQueue = 20;    // scans, urg_node's

double now() { return ros::Time::now().toSec(); }

std::string place(const k::DriverSettings& settings) {
  if (settings.ip_address.empty()) return settings.serial_port;
  return settings.ip_address + ":" + std::to_string(settings.ip_port);
}

std::string hardwareId(const k::Status& status) {
  const std::string serial = k::serialNumber(status.device);
  return serial.empty() ? "none" : serial;
}

void log(ros::console::levels::Level level, const std::string& text) {
  ROS_LOG(level, ROSCONSOLE_DEFAULT_NAME, "%s", text.c_str());
}

void warn(const std::string& text) { log(ros::console::levels::Warn, text); }

void say(const k::Report& report) {
  switch (report.level) {
    case k::Report::Level::kInfo:
      return log(ros::console::levels::Info, report.text);
    case k::Report::Level::kWarning:
      return warn(report.text);
    default:
      return log(ros::console::levels::Error, report.text);
  }
}

class LaserNode {
 public:
  LaserNode(ros::NodeHandle& nh, const k::NodeSettings& settings, const k::NodeSettings& shipped);

  /// Works until asked to stop.
  void run();

 private:
  using Reconfigure = dynamic_reconfigure::Server<LaserConfig>;
  using Answer = Trigger::Response;

  void serve(ros::NodeHandle& nh, const std::string& name, void (LaserNode::*action)(Answer&));
  void offerReconfigure(const k::NodeSettings& shipped);
  void publish(const k::Scan& scan);
  void reconfigure(LaserConfig& config);
  void tick();
  void diagnoseScans(DiagnosticStatus& status);
  void publishStatus(const k::Status& status);
  void updateStatus(Answer& answer);
  void restart(Answer& answer);
  void selfTest(Answer& answer);

  std::mutex mutex_;  // of what the driver's thread uses, too: frame_id, time_offset, rhythm_
  k::NodeSettings settings_;
  k::Rhythm rhythm_;
  k::Counts reported_;  // at the last diagnostics
  std::string told_;    // what the last laser_status was about
  ros::SteadyTime last_diagnostics_;
  ros::NodeHandle private_nh_{"~"};
  ros::Publisher scan_;
  ros::Publisher status_;
  std::vector<ros::ServiceServer> services_;
  diagnostic_updater::Updater diagnostics_;
  boost::recursive_mutex reconfigure_mutex_;
  std::unique_ptr<Reconfigure> reconfigure_;
  k::Driver driver_;  // last, so that its thread ends before what it uses
};

LaserNode::LaserNode(ros::NodeHandle& nh, const k::NodeSettings& settings, const k::NodeSettings& shipped)
    : settings_(settings),
      rhythm_(settings.diagnostics_window_time),
      scan_(nh.advertise<sensor_msgs::LaserScan>("scan", kQueue)),
      status_(nh.advertise<DiagnosticStatus>("laser_status", 1, true)),
      driver_(
          settings.driver, [this](const k::Scan& scan) { publish(scan); }, now, say) {
  serve(nh, "update_laser_status", &LaserNode::updateStatus);
  serve(private_nh_, "restart", &LaserNode::restart);
  serve(private_nh_, "self_test", &LaserNode::selfTest);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("Hardware Status", [this](diagnostic_updater::DiagnosticStatusWrapper& status) {
    const k::Status state = driver_.status();
    k::fill(status, k::diagnoseDevice(state, reported_, settings_.driver, settings_.time_offset));
    reported_ = state.counts;
  });
  diagnostics_.add("Laser Scan",
                   [this](diagnostic_updater::DiagnosticStatusWrapper& status) { diagnoseScans(status); });
  offerReconfigure(shipped);
}

void LaserNode::serve(ros::NodeHandle& nh, const std::string& name, void (LaserNode::*action)(Answer&)) {
  const boost::function<bool(Trigger::Request&, Answer&)> callback = [this, action](Trigger::Request&,
                                                                                    Answer& answer) {
    (this->*action)(answer);
    return true;
  };
  services_.push_back(nh.advertiseService(name, callback));
}

void LaserNode::offerReconfigure(const k::NodeSettings& shipped) {
  const LaserConfig config = k::configOf(settings_);
  config.__toServer__(private_nh_);  // where its own start reads them
  reconfigure_ = std::make_unique<Reconfigure>(reconfigure_mutex_, private_nh_);
  reconfigure_->setConfigDefault(k::configOf(shipped));
  reconfigure_->setCallback([this](LaserConfig& wanted, std::uint32_t /*level*/) { reconfigure(wanted); });
}

void LaserNode::run() {
  while (ros::ok()) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(kLongestWait));
    // Simulated time may not have begun; without it a scan cannot be stamped.
    if (driver_.status().state == k::State::kStopped && ros::Time::isValid()) driver_.start();
    tick();
  }
}

void LaserNode::publish(const k::Scan& scan) {
  sensor_msgs::LaserScan message = k::messageOf(scan);
  double stamp = scan.stamp;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    message.header.frame_id = settings_.frame_id;
    stamp += settings_.time_offset;
    rhythm_.add(now());
  }
  try {  // below 0 at the start of simulated time; ROS has no such time, and throws beyond its last one
    kurumaisu::require(kurumaisu::plausible::kStamp, "stamp", stamp);
  } catch (const std::invalid_argument& error) {
    ROS_WARN_THROTTLE(kWarningPeriod, "LASER_STAMP: a scan is dropped: %s", error.what());
    return;
  }
  message.header.stamp = ros::Time(stamp);
  scan_.publish(message);
}

/// Takes what can be had; the rest of the request is set back, which its sender sees.
void LaserNode::reconfigure(LaserConfig& config) {
  const auto take = [](const std::function<void()>& part) {
    try {
      part();
    } catch (const std::invalid_argument& problem) {
      warn(std::string("LASER_REFUSED: ") + problem.what());
    }
  };
  take([&] {
    const k::LiveSettings live = k::liveOf(config);
    k::validate(live);
    driver_.reconfigure(live);
    settings_.driver.live = live;
  });
  const std::lock_guard<std::mutex> lock(mutex_);
  take([&] { settings_.frame_id = k::frame(config.frame_id); });
  take([&] { settings_.time_offset = k::finite("time_offset", config.time_offset); });
  config = k::configOf(settings_);
}

void LaserNode::tick() {
  const k::Status status = driver_.status();
  const std::string about = std::string(k::name(status.state)) + " " + k::serialNumber(status.device) + " " +
                            k::health(status.device);
  if (about != told_) {
    told_ = about;
    log(ros::console::levels::Info, place(settings_.driver) + ": " + about);
    diagnostics_.setHardwareID(hardwareId(status));
    publishStatus(status);
  }
  const ros::SteadyTime time = ros::SteadyTime::now();
  if ((time - last_diagnostics_).toSec() < settings_.diagnostic_period) return;
  last_diagnostics_ = time;
  diagnostics_.force_update();  // update() would go by a clock that may be set back, or stand
}

void LaserNode::diagnoseScans(DiagnosticStatus& status) {
  const double time = now();
  std::optional<double> rate;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    rate = rhythm_.rate(time);
  }
  k::fill(status, k::diagnoseScans(driver_.status(), rate, time, settings_.diagnostics_tolerance,
                                   settings_.driver.stale_timeout));
}

void LaserNode::publishStatus(const k::Status& status) {
  DiagnosticStatus message;
  message.name = ros::this_node::getName();
  message.hardware_id = hardwareId(status);
  k::fill(message, k::diagnoseDevice(status, status.counts, settings_.driver, settings_.time_offset));
  status_.publish(message);
}

void LaserNode::updateStatus(Answer& answer) {
  const k::Status status = driver_.status();
  publishStatus(status);
  answer.success = status.state == k::State::kStreaming;
  answer.message = k::name(status.state);
}

void LaserNode::restart(Answer& answer) {
  driver_.restart();
  answer.success = true;
  answer.message = "the port is opened again";
}

/// Holds up other callbacks meanwhile.
void LaserNode::selfTest(Answer& answer) {
  const k::Verdict verdict = k::selfTest(driver_, settings_.driver, [] {
    ros::WallDuration(kLongestWait).sleep();
    return ros::ok();
  });
  answer.success = verdict.passed;
  answer.message = verdict.words;
}

k::NodeSettings read(const XmlRpc::XmlRpcValue& given) {
  const std::string path = ros::package::getPath("kurumaisu") + "/launch/laser_node.yaml";
  return k::readSettings(k::loadShipped(path), given, ros::this_node::getName());
}

}  // namespace

int main(int argc, char** argv) {
  kurumaisu::holdStandardStreams();
  if (const auto code = kurumaisu::answered(argc, argv, kHelp)) return *code;
  ros::init(argc, argv, "laser_node");
  ros::NodeHandle nh;  // here, because ROS's log is mute once the last one is gone
  const kurumaisu::ClockWatch clock(nh);
  try {
    XmlRpc::XmlRpcValue given;
    ros::param::get(ros::this_node::getName(), given);  // nothing given: all as shipped
    const k::NodeSettings settings = read(given);
    for (const std::string& warning : settings.warnings) warn(warning);
    LaserNode(nh, settings, read({})).run();
  } catch (const std::exception& error) {
    log(ros::console::levels::Fatal, error.what());
    return 1;
  }
  return 0;
}
