// SPDX-License-Identifier: BSD-3-Clause
// The laser driver as a ROS node: scan, laser_status and diagnostics out; no algorithm here.
#include <diagnostic_msgs/DiagnosticStatus.h>
#include <diagnostic_updater/diagnostic_updater.h>
#include <dynamic_reconfigure/server.h>
#include <kurumaisu/LaserConfig.h>
#include <ros/callback_queue.h>
#include <ros/package.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <std_srvs/Trigger.h>

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "laser/diagnosis.h"
#include "laser/driver.h"
#include "laser/scan.h"
#include "laser/settings.h"
#include "laser/shipped.h"

namespace {

namespace k = kurumaisu::laser;
using kurumaisu::LaserConfig;
using Trigger = std_srvs::Trigger;

constexpr double kLongestWait = 0.02;    // [s] for a callback, so that a stop is soon noticed
constexpr double kWarningPeriod = 1.0;   // [s] between two equal warnings
constexpr double kSelfTestPatience = 5;  // [s] for scans after a restart
constexpr std::uint64_t kSelfTestScans = 3;
constexpr std::uint32_t kQueue = 20;  // scans, urg_node's

double now() { return ros::Time::now().toSec(); }

std::uint8_t levelOf(k::Level level) {
  switch (level) {
    case k::Level::kOk:
      return diagnostic_msgs::DiagnosticStatus::OK;
    case k::Level::kWarn:
      return diagnostic_msgs::DiagnosticStatus::WARN;
    case k::Level::kError:
      return diagnostic_msgs::DiagnosticStatus::ERROR;
    default:
      return diagnostic_msgs::DiagnosticStatus::STALE;
  }
}

void fill(diagnostic_msgs::DiagnosticStatus& status, const k::Diagnosis& diagnosis) {
  status.level = levelOf(diagnosis.level);
  status.message = diagnosis.summary;
  for (const auto& [name, value] : diagnosis.values) {
    diagnostic_msgs::KeyValue item;
    item.key = name;
    item.value = value;
    status.values.push_back(item);
  }
}

sensor_msgs::LaserScan messageOf(const k::Scan& scan) {
  sensor_msgs::LaserScan message;
  message.angle_min = static_cast<float>(scan.angle_min);
  message.angle_max = static_cast<float>(scan.angle_max);
  message.angle_increment = static_cast<float>(scan.angle_increment);
  message.time_increment = static_cast<float>(scan.time_increment);
  message.scan_time = static_cast<float>(scan.scan_time);
  message.range_min = static_cast<float>(scan.range_min);
  message.range_max = static_cast<float>(scan.range_max);
  message.ranges = scan.ranges;
  message.intensities = scan.intensities;
  return message;
}

void setLive(LaserConfig& config, const k::LiveSettings& live) {
  config.angle_min = live.angle_min;
  config.angle_max = live.angle_max;
  config.cluster = live.cluster;
  config.skip = live.skip;
  config.publish_intensity = live.intensity;
}

LaserConfig configOf(const k::NodeSettings& settings) {
  LaserConfig config = LaserConfig::__getDefault__();
  config.frame_id = settings.frame_id;
  config.time_offset = settings.time_offset;
  setLive(config, settings.driver.live);
  return config;
}

std::string place(const k::DriverSettings& settings) {
  if (settings.ip_address.empty()) return settings.serial_port;
  return settings.ip_address + ":" + std::to_string(settings.ip_port);
}

void say(const k::Report& report) {
  if (report.level == k::Report::Level::kInfo) {
    ROS_INFO("%s", report.text.c_str());
  } else if (report.level == k::Report::Level::kWarning) {
    ROS_WARN("%s", report.text.c_str());
  } else {
    ROS_ERROR("%s", report.text.c_str());
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
  void diagnoseScans(diagnostic_msgs::DiagnosticStatus& status);
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
      status_(nh.advertise<diagnostic_msgs::DiagnosticStatus>("laser_status", 1, true)),
      driver_(
          settings.driver, [this](const k::Scan& scan) { publish(scan); }, now, say) {
  serve(nh, "update_laser_status", &LaserNode::updateStatus);
  serve(private_nh_, "restart", &LaserNode::restart);
  serve(private_nh_, "self_test", &LaserNode::selfTest);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("Hardware Status", [this](diagnostic_updater::DiagnosticStatusWrapper& status) {
    const k::Status state = driver_.status();
    fill(status, k::diagnoseDevice(state, reported_, settings_.driver, settings_.time_offset));
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
  const LaserConfig config = configOf(settings_);
  config.__toServer__(private_nh_);  // where its own start reads them
  reconfigure_ = std::make_unique<Reconfigure>(reconfigure_mutex_, private_nh_);
  reconfigure_->setConfigDefault(configOf(shipped));
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
  sensor_msgs::LaserScan message = messageOf(scan);
  double stamp = scan.stamp;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    message.header.frame_id = settings_.frame_id;
    stamp += settings_.time_offset;
    rhythm_.add(now());
  }
  if (stamp < 0) {  // at the start of simulated time; ROS has no such time
    ROS_WARN_THROTTLE(kWarningPeriod, "LASER_STAMP: a scan of %g s, before time began, is dropped", stamp);
    return;
  }
  message.header.stamp = ros::Time(stamp);
  scan_.publish(message);
}

/// Takes what can be had; the rest of the request is set back, which its sender sees.
void LaserNode::reconfigure(LaserConfig& config) {
  const k::LiveSettings live{config.angle_min, config.angle_max, config.cluster, config.skip,
                             config.publish_intensity};
  try {
    k::validate(live);
    driver_.reconfigure(live);
    settings_.driver.live = live;
  } catch (const std::invalid_argument& problem) {
    ROS_WARN("LASER_REFUSED: %s", problem.what());
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    settings_.frame_id = k::frame(config.frame_id);
    settings_.time_offset = k::finite("time_offset", config.time_offset);
  } catch (const std::invalid_argument& problem) {
    ROS_WARN("LASER_REFUSED: %s", problem.what());
  }
  config = configOf(settings_);
}

void LaserNode::tick() {
  const k::Status status = driver_.status();
  const auto of = [](const std::map<std::string, std::string>& values, const char* key) {
    const auto found = values.find(key);
    return found == values.end() ? std::string() : found->second;
  };
  const std::string serial = of(status.device.version, "SERI");
  const std::string about = std::string(k::name(status.state)) + serial + of(status.device.state, "STAT");
  if (about != told_) {
    told_ = about;
    ROS_INFO("%s: %s %s", place(settings_.driver).c_str(), k::name(status.state), serial.c_str());
    diagnostics_.setHardwareID(serial.empty() ? "none" : serial);
    publishStatus(status);
  }
  const ros::SteadyTime time = ros::SteadyTime::now();
  if ((time - last_diagnostics_).toSec() < settings_.diagnostic_period) return;
  last_diagnostics_ = time;
  diagnostics_.force_update();  // update() would go by a clock that may be set back, or stand
}

void LaserNode::diagnoseScans(diagnostic_msgs::DiagnosticStatus& status) {
  const double time = now();
  std::optional<double> rate;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    rate = rhythm_.rate(time);
  }
  fill(status, k::diagnoseScans(driver_.status(), rate, time, settings_.diagnostics_tolerance,
                                settings_.driver.stale_timeout));
}

void LaserNode::publishStatus(const k::Status& status) {
  diagnostic_msgs::DiagnosticStatus message;
  message.name = ros::this_node::getName();
  const auto serial = status.device.version.find("SERI");
  if (serial != status.device.version.end()) message.hardware_id = serial->second;
  fill(message, k::diagnoseDevice(status, status.counts, settings_.driver, settings_.time_offset));
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
  answer.message = "the port is opened anew";
}

/// Begins anew, which asks the sensor how it is, and wants a few good scans. Holds up other callbacks meanwhile.
void LaserNode::selfTest(Answer& answer) {
  const k::Counts before = driver_.status().counts;
  std::optional<k::Counts> begun;  // with the first scan after the restart, before which scans are lost
  const ros::SteadyTime deadline = ros::SteadyTime::now() + ros::WallDuration(kSelfTestPatience);
  k::Status status;
  driver_.restart();
  do {
    ros::WallDuration(kLongestWait).sleep();
    status = driver_.status();
    const bool streams = status.counts.reconnects > before.reconnects && status.state == k::State::kStreaming;
    if (!begun && streams) begun = status.counts;
    if (begun && status.counts.scans >= begun->scans + kSelfTestScans) break;
  } while (ros::ok() && ros::SteadyTime::now() < deadline);
  const k::Diagnosis diagnosis = k::diagnoseDevice(status, begun.value_or(before), settings_.driver, 0);
  const bool scans = begun && status.counts.scans >= begun->scans + kSelfTestScans;
  answer.success = scans && diagnosis.level == k::Level::kOk;
  answer.message = (scans ? "" : "no scans within the self test; ") + diagnosis.summary;
}

k::NodeSettings read(const XmlRpc::XmlRpcValue& given) {
  const std::string path = ros::package::getPath("kurumaisu") + "/launch/laser_node.yaml";
  return k::readSettings(k::loadShipped(path), given, ros::this_node::getName());
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "laser_node");
  ros::NodeHandle nh;  // here, because ROS_FATAL is mute once the last one is gone
  try {
    XmlRpc::XmlRpcValue given;
    ros::param::get(ros::this_node::getName(), given);  // nothing given: all as shipped
    const k::NodeSettings settings = read(given);
    for (const std::string& warning : settings.warnings) ROS_WARN("%s", warning.c_str());
    LaserNode(nh, settings, read({})).run();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
  return 0;
}
