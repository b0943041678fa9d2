// SPDX-License-Identifier: BSD-3-Clause
#include "laser/settings.h"

#include <algorithm>
#include <map>
#include <utility>

#include "plausible/quantity.h"

namespace kurumaisu::laser {
namespace {

using Value = XmlRpc::XmlRpcValue;

// Protocol: two digits for a cluster, one for the scans left out. All limits are msg/Laser.cfg's, too.
constexpr int kMaxCluster = 99;
constexpr int kMaxSkip = 9;
constexpr double kPi = 3.14159265358979323846;  // [rad]
constexpr double kPiRounding = 0.01;            // [rad] 3.15 and 3.1416 are meant as pi, -180 is not
constexpr double kMaxTimeOffset = 10;           // [s]
constexpr int kMaxPort = 65535;

/// Parameters of urg_node that ask for what is not done here.
const std::map<std::string, std::string>& notDone() {
  static const std::map<std::string, std::string> words{
      {"publish_multiecho", "scans hold one echo for each beam"},
      {"synchronize_time", "time_mode says how scans are stamped"},
      {"get_detailed_status", "the zones of UAM sensors are not read"},
      {"tf_prefix", "frame_id is the whole name"}};
  return words;
}

/// Does a value ask for something? false, 0 and nothing do not.
bool asks(const Value& value) {
  std::ostringstream out;
  value.write(out);
  const std::string text = out.str();
  return !(text.empty() || text == "0" || text == "false");
}

/// Keeps what this node reads, and says what of the rest was asked for in vain.
Value merged(const Value& shipped, const Value& given, const std::string& name,
             std::vector<std::string>& warnings) {
  Value result = shipped;
  if (given.getType() != Value::TypeStruct) return result;
  for (const auto& [key, value] : given) {
    const auto other = notDone().find(key);
    if (key == "analyzers") continue;  // urg_node left its diagnostic_aggregator's there
    if (other == notDone().end()) {
      result[key] = value;
    } else if (asks(value)) {
      std::ostringstream out;
      out << "LASER_IGNORED_PARAMETER: " << name << "/" << key << ": " << other->second;
      warnings.push_back(out.str());
    }
  }
  return result;
}

bool givesText(const Value& given, const std::string& key) {
  if (given.getType() != Value::TypeStruct || !given.hasMember(key)) return false;
  const Value& value = given[key];
  return value.getType() == Value::TypeString && !std::string(Value(value)).empty();
}

/// Where the sensor is: the shipped port counts unless an address is given.
void readPlace(Section& node, bool port_given, DriverSettings& driver) {
  driver.ip_address = node.textOrNone("ip_address");
  driver.ip_port = node.integer("ip_port", 1, kMaxPort);
  driver.serial_port = node.textOrNone("serial_port");
  driver.serial_baud = node.integer("serial_baud", 1);
  if (driver.ip_address.empty() && driver.serial_port.empty()) {
    throw node.error("serial_port", "is empty, and so is ip_address: give one of them");
  }
  if (driver.ip_address.empty()) return;
  if (port_given) {
    throw node.error("serial_port", "contradicts ip_address: " + driver.serial_port + ", " +
                                        driver.ip_address + ": give only one of them");
  }
  driver.serial_port.clear();
}

double readAngle(Section& node, const std::string& key) {
  return std::clamp(node.within(key, -kPi - kPiRounding, kPi + kPiRounding), -kPi, kPi);
}

LiveSettings readLive(Section& node) {
  LiveSettings live{};
  live.angle_min = readAngle(node, "angle_min");
  live.angle_max = readAngle(node, "angle_max");
  live.cluster = node.integer("cluster", 1, kMaxCluster);
  live.skip = node.integer("skip", 0, kMaxSkip);
  live.intensity = node.flag("publish_intensity");
  try {
    validate(live);
  } catch (const std::invalid_argument& problem) {
    throw node.error("", problem.what());
  }
  return live;
}

TimeMode timeMode(const std::string& mode) {
  if (mode == "device") return TimeMode::kDevice;
  return mode == "host" ? TimeMode::kHost : TimeMode::kEnvelope;
}

void readTime(Section& node, DriverSettings& driver) {
  const std::string mode = node.choice("time_mode", {"envelope", "device", "host"});
  driver.time_mode = timeMode(mode);
  driver.calibrate_time = node.flag("calibrate_time");
  if (driver.calibrate_time && mode != "envelope") {
    throw node.error("calibrate_time", "contradicts time_mode " + mode + ", which needs no calibration");
  }
}

void readRecovery(Section& node, DriverSettings& driver) {
  driver.stale_timeout = node.above("stale_timeout", 0);
  driver.error_limit = node.integer("error_limit", 0);
  driver.connect_timeout = node.above("connect_timeout", 0);
  driver.answer_timeout = node.above("answer_timeout", 0);
  driver.retry_min = node.above("reconnect_delay_min", 0);
  driver.retry_max = node.atLeast("reconnect_delay_max", driver.retry_min);
}

std::string readFrame(Section& node, std::vector<std::string>& warnings) {
  const std::string given = node.textOrNone("frame_id");
  try {
    std::string result = frame(given);
    if (result != given) {
      warnings.push_back("LASER_FRAME_SLASH: frame_id: tf2 allows no leading slash: " + given);
    }
    return result;
  } catch (const std::invalid_argument& problem) {
    throw node.error("", problem.what());
  }
}

}  // namespace

NodeSettings readSettings(const Value& shipped, const Value& given, const std::string& name) {
  NodeSettings settings{};
  Section node(merged(shipped, given, name, settings.warnings), name);
  readPlace(node, givesText(given, "serial_port"), settings.driver);
  settings.driver.live = readLive(node);
  readTime(node, settings.driver);
  readRecovery(node, settings.driver);
  settings.frame_id = readFrame(node, settings.warnings);
  settings.time_offset = node.within("time_offset", -kMaxTimeOffset, kMaxTimeOffset);
  settings.diagnostic_period = node.above("diagnostic_period", 0);
  settings.diagnostics_tolerance = node.within("diagnostics_tolerance", 0, 1);
  settings.diagnostics_window_time = node.above("diagnostics_window_time", 0);
  node.end();
  return settings;
}

void validate(const LiveSettings& live) {
  if (live.angle_min < live.angle_max) return;
  std::ostringstream out;
  out << "angle_min must be less than angle_max: " << live.angle_min << ", " << live.angle_max;
  throw std::invalid_argument(out.str());
}

std::string frame(const std::string& frame_id) {
  std::string frame = frameOf(frame_id);
  if (frame.empty()) throw std::invalid_argument("frame_id must not be empty: " + frame_id);
  return frame;
}

double finite(const std::string& key, double value) {
  if (std::isfinite(value)) return value;
  std::ostringstream out;
  out << key << " must be finite: " << value;
  throw std::invalid_argument(out.str());
}

}  // namespace kurumaisu::laser
