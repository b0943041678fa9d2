// SPDX-License-Identifier: BSD-3-Clause
#include "laser/diagnosis.h"

#include <array>
#include <cmath>
#include <cstdio>

namespace kurumaisu::laser {
namespace {

std::string shown(const char* format, double value) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

std::string valueOf(const std::map<std::string, std::string>& values, const char* key) {
  const auto found = values.find(key);
  return found == values.end() ? "" : found->second;
}

std::uint64_t total(const std::map<std::string, std::uint64_t>& errors) {
  std::uint64_t sum = 0;
  for (const auto& item : errors) sum += item.second;
  return sum;
}

/// Errors of the sensor but the one that says that it is over, 98.
std::uint64_t severe(const std::map<std::string, std::uint64_t>& errors) {
  const auto over = errors.find("98");
  return total(errors) - (over == errors.end() ? 0 : over->second);
}

/// "3.3.00(18/Jan./2010)" is a version and its date.
std::pair<std::string, std::string> versionAndDate(const std::string& firmware) {
  const std::size_t open = firmware.find('(');
  if (open == std::string::npos) return {firmware, ""};
  const std::size_t close = firmware.find(')', open);
  return {firmware.substr(0, open), firmware.substr(open + 1, close - open - 1)};
}

/// What went wrong between two reports, in words; empty for nothing.
std::string troubles(const Counts& now, const Counts& before) {
  std::string text;
  const auto say = [&text](std::uint64_t count, const char* what) {
    if (count == 0) return;
    text += (text.empty() ? "" : "; ") + std::string(what) + ": " + std::to_string(count);
  };
  say(now.bad_sums - before.bad_sums, "bad sums");
  say(now.unreadable - before.unreadable, "unreadable replies");
  say(now.damaged - before.damaged, "damaged scans");
  say(now.duplicates - before.duplicates, "duplicate scans");
  say(now.lost - before.lost, "lost scans");
  say(total(now.errors) - total(before.errors), "errors of the sensor");
  say(now.reconnects - before.reconnects, "reconnects");
  return text;
}

std::pair<Level, std::string> judge(const Status& status, const Counts& before) {
  const std::string why = status.last_error.empty() ? "" : ": " + status.last_error;
  switch (status.state) {
    case State::kStreaming:
      break;
    case State::kStarting:
      return {Level::kWarn, std::string("Starting") + why};
    case State::kStopped:
      return {Level::kStale, "Stopped"};
    default:
      return {Level::kError, "Not connected: " + std::string(name(status.state)) + why};
  }
  const std::string stat = health(status.device);
  if (!stat.empty() && !isWell(stat)) return {Level::kError, "Abnormal status: " + stat};
  const std::string since = troubles(status.counts, before);
  if (severe(status.counts.errors) > severe(before.errors)) return {Level::kError, since};
  if (!since.empty()) return {Level::kWarn, since};
  return {Level::kOk, "Streaming"};
}

void addDevice(const Device& device, Diagnosis& diagnosis) {
  const auto add = [&diagnosis](const char* key, const std::string& value) {
    diagnosis.values.emplace_back(key, value);
  };
  const auto [version, date] = versionAndDate(valueOf(device.version, "FIRM"));
  add("Vendor Name", valueOf(device.version, "VEND"));
  add("Product Name", valueOf(device.version, "PROD"));
  add("Firmware Version", version);
  add("Firmware Date", date);
  add("Protocol Version", valueOf(device.version, "PROT"));
  add("Device ID", serialNumber(device));
  add("Model", device.parameters ? device.parameters->model : "");
  add("Device Status", health(device));
}

void addPlace(const DriverSettings& settings, const Device& device, Diagnosis& diagnosis) {
  if (settings.ip_address.empty()) {
    diagnosis.values.emplace_back("Serial Port", settings.serial_port);
    diagnosis.values.emplace_back("Serial Baud",
                                  std::to_string(device.baud ? device.baud : settings.serial_baud));
  } else {
    diagnosis.values.emplace_back("IP Address", settings.ip_address);
    diagnosis.values.emplace_back("IP Port", std::to_string(settings.ip_port));
  }
}

void addCounts(const Counts& counts, Diagnosis& diagnosis) {
  const auto add = [&diagnosis](const std::string& key, std::uint64_t value) {
    diagnosis.values.emplace_back(key, std::to_string(value));
  };
  add("Bad Sums", counts.bad_sums);
  add("Unreadable Replies", counts.unreadable);
  add("Damaged Scans", counts.damaged);
  add("Duplicate Scans", counts.duplicates);
  add("Lost Scans", counts.lost);
  add("Stray Bytes", counts.stray_bytes);
  add("Reconnects", counts.reconnects);
  add("Attempts to Connect", counts.attempts);
  for (const auto& [status, count] : counts.errors) add("Errors of Status " + status, count);
}

}  // namespace

std::string serialNumber(const Device& device) { return valueOf(device.version, "SERI"); }

std::string health(const Device& device) { return valueOf(device.state, "STAT"); }

void Rhythm::add(double time) {
  if (!times_.empty() && time < times_.back()) times_.clear();
  times_.push_back(time);
  while (times_.front() < time - window_) times_.pop_front();
}

std::optional<double> Rhythm::rate(double now) const {
  std::size_t first = 0;
  while (first < times_.size() && times_[first] < now - window_) ++first;
  const std::size_t count = times_.size() - first;
  if (count < 2 || times_.back() == times_[first]) return std::nullopt;
  return static_cast<double>(count - 1) / (times_.back() - times_[first]);
}

bool isWell(const std::string& stat) {
  // URG-04LX and UTM-30LX, their newer firmware, UAM
  for (const char* well : {"Sensor works well.", "Stable 000 no error.", "sensor is working normally"}) {
    if (stat == well) return true;
  }
  return false;
}

Diagnosis diagnoseDevice(const Status& status, const Counts& before, const DriverSettings& settings,
                         double time_offset) {
  auto [level, summary] = judge(status, before);
  Diagnosis diagnosis{level, std::move(summary), {}};
  diagnosis.values.emplace_back("State", name(status.state));
  addPlace(settings, status.device, diagnosis);
  addDevice(status.device, diagnosis);
  diagnosis.values.emplace_back("Computed Latency", shown("%.6f", status.latency));
  diagnosis.values.emplace_back("User Time Offset", shown("%.6f", time_offset));
  addCounts(status.counts, diagnosis);
  diagnosis.values.emplace_back("Last Error", status.last_error);
  diagnosis.values.emplace_back("Last Error Time",
                                status.last_error.empty() ? "" : shown("%.3f", status.last_error_time));
  return diagnosis;
}

Diagnosis diagnoseScans(const Status& status, std::optional<double> rate, double now, double tolerance,
                        double stale) {
  const double age = now - status.last_scan_time;
  const double expected = status.scan_period > 0 ? 1 / status.scan_period : 0;
  Diagnosis diagnosis{Level::kOk, "", {}};
  if (status.counts.scans == 0) {
    diagnosis.level = Level::kStale;
    diagnosis.summary = "No scan yet";
  } else if (age > stale + status.scan_period) {
    diagnosis.level = Level::kStale;
    diagnosis.summary = shown("No scan for %.1f s", age);
  } else if (rate && std::abs(*rate - expected) > tolerance * expected) {
    diagnosis.level = Level::kWarn;
    diagnosis.summary = shown("%.2f scans a second", *rate) + shown(" instead of %.2f", expected);
  } else if (status.clock.stands) {
    diagnosis.level = Level::kWarn;
    diagnosis.summary = "LASER_CLOCK: the sensor's clock stands: stamps are the host's";
  } else if (status.clock.fallback) {
    diagnosis.level = Level::kWarn;
    diagnosis.summary = "LASER_CLOCK: time_mode device, but the sensor's clock is not the host's";
  } else {
    diagnosis.summary = rate ? shown("%.2f scans a second", *rate) : "Too few scans for a rate";
  }
  const auto add = [&diagnosis](const char* key, const std::string& value) {
    diagnosis.values.emplace_back(key, value);
  };
  add("Scans", std::to_string(status.counts.scans));
  add("Rate [1/s]", rate ? shown("%.3f", *rate) : "");
  add("Expected rate [1/s]", shown("%.3f", expected));
  add("Intensities", status.intensity ? "yes" : "no");
  add("Latency [ms]", shown("%.3f", 1e3 * status.latency));
  add("Clock offset [s]", shown("%.6f", status.clock.offset));
  add("Clock drift [ppm]", shown("%.1f", 0.0 - 1e6 * status.clock.drift));
  add("Clock resets", std::to_string(status.clock.resets));
  add("Clock calibrated", status.clock.calibrated ? "yes" : "no");
  add("Scan to first byte [ms]", shown("%.3f", 1e3 * status.clock.latency));
  return diagnosis;
}

}  // namespace kurumaisu::laser
