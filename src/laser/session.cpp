// SPDX-License-Identifier: BSD-3-Clause
#include "laser/session.h"

#include <algorithm>
#include <utility>

#include "laser/calibrate.h"
#include "laser/tcp.h"
#include "laser/tty.h"

namespace kurumaisu::laser {
namespace {

constexpr double kSlice = 0.05;        // [s] between two looks at the time
constexpr double kQuietPeriods = 2.5;  // without a byte: ask whether the sensor is still there
constexpr double kQuietLeast = 0.2;    // [s] the same, for those that send often
constexpr int kMostPatience = 3;       // starts without a scan that add to the wait for one

std::unique_ptr<Port> openPort(const DriverSettings& settings, const std::function<bool()>& interrupted) {
  if (settings.ip_address.empty()) return std::make_unique<Tty>(settings.serial_port, settings.serial_baud);
  return std::make_unique<Tcp>(settings.ip_address, settings.ip_port, settings.connect_timeout, interrupted);
}

}  // namespace

Session::Session(const Surroundings& surroundings)
    : with_(surroundings),
      link_(openPort(with_.settings, [this] { return with_.control.stopped(); }), with_.now,
            [this] { return with_.control.stopped(); }),
      tell_([this](Report::Level level, const std::string& text) { with_.monitor.tell(level, text); }),
      before_(with_.monitor.status().counts) {}

Session::~Session() {
  updateCounts();
  try {
    link_.send("QT");
  } catch (const LinkLost&) {
    // then there is nothing to quiet
  }
}

void Session::run() {
  for (;;) {
    identify();
    if (with_.settings.calibrate_time)
      calibrate(link_, with_.memory.clock, with_.now, with_.settings.answer_timeout, tell_);
    std::shared_ptr<ScipStream> stream;
    std::unique_ptr<Urg> urg = start(stream);
    if (with_.memory.has_streamed) with_.monitor.update([](Status& status) { ++status.counts.reconnects; });
    while (!streamUntilQuiet(*urg, *stream)) urg = start(stream);
  }
}

void Session::shake() try {
  const auto& settings = with_.settings;
  sensor_ = handshake(link_, {settings.serial_baud, settings.answer_timeout, with_.memory.ask_once}, tell_);
} catch (const WentSilent&) {
  with_.memory.ask_once = true;
  throw;
}

void Session::identify() {
  shake();
  is_first_ = true;
  Device device{scip::keyed(sensor_.version), sensor_.state, sensor_.parameters, sensor_.baud};
  if (device.version["SERI"] != with_.memory.serial) {
    with_.memory.clock.reset();
    with_.memory.sequence.reset();
    with_.memory.serial = device.version["SERI"];
  }
  if (sensor_.time) with_.memory.clock.calibrate(sensor_.time->clock, sensor_.time->host, sensor_.time->host);
  with_.monitor.update([&](Status& status) {
    status.state = State::kStarting;
    status.device = std::move(device);
  });
  if (with_.settings.stale_timeout > 2 * sensor_.parameters.scanTime()) return;
  throw std::invalid_argument("stale_timeout " + std::to_string(with_.settings.stale_timeout) +
                              " s must be longer than two scans, which take " +
                              std::to_string(2 * sensor_.parameters.scanTime()) + " s");
}

std::unique_ptr<Urg> Session::start(std::shared_ptr<ScipStream>& stream) {
  if (with_.control.changed()) with_.memory.wedged = false;
  Window window = with_.control.takeWindow();
  window.intensity = window.intensity && !with_.memory.wedged;
  try {
    return startForm(stream, window);
  } catch (const NoIntensity& refusal) {
    tell_(Report::Level::kWarning, refusal.what());
  } catch (const NoAnswer&) {
    if (!window.intensity) throw;
    with_.memory.wedged = true;  // some URG-04LX fall silent when asked for intensities
    throw LinkLost("LASER_NO_INTENSITY: the sensor has not answered to ME and is not asked again");
  }
  window.intensity = false;
  return startForm(stream, window);
}

std::unique_ptr<Urg> Session::startForm(std::shared_ptr<ScipStream>& stream, const Window& window) {
  fan_ = std::make_unique<Fan>(sensor_.parameters, window);
  period_ = sensor_.parameters.scanTime() * (window.skip + 1);
  stream = std::make_shared<ScipStream>(link_, sensor_, fan_->request(), with_.settings.answer_timeout);
  auto urg = std::make_unique<Urg>(stream, window.intensity);
  ++with_.memory.starts_without_scan;
  with_.monitor.update([&](Status& status) {
    status.intensity = window.intensity;
    status.scan_period = period_;
  });
  return urg;
}

/// True once the sensor has fallen quiet and must be asked what it is; false once another window is wanted.
bool Session::streamUntilQuiet(Urg& urg, ScipStream& stream) {
  Watch watch{with_.now(), steadyTime()};
  while (!with_.control.changed()) {
    if (with_.control.takeRestart()) throw LinkLost("LASER_RESTART: told to restart");
    const std::optional<Arrival> arrival = stream.await(kSlice);
    updateCounts();
    if (arrival) handle(*arrival, urg, watch);
    if (isQuiet(watch)) return true;
  }
  link_.ask("QT", with_.settings.answer_timeout, with_.settings.answer_timeout);
  with_.memory.sequence.reset();
  return false;
}

void Session::handle(const Arrival& arrival, Urg& urg, Watch& watch) {
  if (arrival.kind == Arrival::Kind::kScan) {
    const std::optional<scip::Rotation> scan = urg.take();
    if (!scan || !(*scan == arrival.rotation))
      throw LinkLost("LASER_MRPT: MRPT decodes a good scan differently");
    publish(*scan, arrival.first_byte);
    watch = {with_.now(), steadyTime()};
    return;
  }
  complain(arrival);
  if (++watch.errors <= with_.settings.error_limit) return;
  throw LinkLost("LASER_ERRORS: " + std::to_string(watch.errors) + " in a row, the last: " + arrival.text);
}

/// A sensor that was asked anew may have been off, which its clock need not show by going back.
void Session::checkClock(std::uint32_t clock, double first_byte) {
  Memory& memory = with_.memory;
  if (!std::exchange(is_first_, false) || memory.sequence.continues(clock, first_byte)) return;
  memory.sequence.reset();
  if (!with_.settings.calibrate_time) memory.clock.restart();
}

void Session::publish(const scip::Rotation& rotation, double first_byte) {
  Memory& memory = with_.memory;
  checkClock(rotation.clock, first_byte);
  const std::uint64_t missing = memory.sequence.missing(rotation.clock, first_byte, period_);
  const double time = memory.clock.stamp(rotation.clock, first_byte, fan_->leastDelay());
  Scan scan = fan_->convert(rotation, time);
  scan.latency = memory.clock.state().latency;
  with_.sink(scan);
  const double latency = steadyTime() - link_.lastByte();
  memory.has_streamed = true;
  memory.starts_without_scan = 0;
  with_.monitor.update([&](Status& status) {
    status.state = State::kStreaming;
    ++status.counts.scans;
    status.counts.lost += missing;
    status.last_scan_time = with_.now();
    status.latency = latency;
    status.clock = memory.clock.state();
  });
}

void Session::complain(const Arrival& arrival) {
  using Kind = Arrival::Kind;
  with_.monitor.update([&](Status& status) {
    if (arrival.kind == Kind::kDamaged) ++status.counts.damaged;
    if (arrival.kind == Kind::kDuplicate) ++status.counts.duplicates;
    if (arrival.kind == Kind::kStatus) ++status.counts.errors[arrival.text];
  });
  if (arrival.kind == Kind::kDamaged)
    tell_(Report::Level::kWarning, "LASER_DAMAGED: a scan is dropped: " + arrival.text);
  if (arrival.kind == Kind::kDuplicate)
    tell_(Report::Level::kWarning, "LASER_DUPLICATE: a scan came twice: " + arrival.text);
  if (arrival.kind != Kind::kStatus) return;
  tell_(arrival.text == "98" ? Report::Level::kWarning : Report::Level::kError,
        "LASER_STATUS: the sensor reports " + arrival.text + ": " + meaning(arrival.text));
}

/// Has the sensor sent nothing for so long that it must be asked whether it is still there? Throws LinkLost where there
/// was no scan for too long. Both go by the host's time, which may stand, and by no one's, as it may run fast.
bool Session::isQuiet(Watch& watch) const {
  const double now = with_.now();
  const double steady = steadyTime();
  watch.scan = std::min(watch.scan, now);  // the host's time was set back
  const int starts = with_.memory.starts_without_scan;
  const int patience = 1 + std::clamp(starts - 1, 0, kMostPatience);  // for those that take long to start
  const double stale = with_.settings.stale_timeout * patience + period_ - sensor_.parameters.scanTime();
  if (std::min(now - watch.scan, steady - watch.steady_scan) > stale)
    throw LinkLost("LASER_STALE: no scan for " + std::to_string(stale) + " s");
  const double silence = std::min(now - std::max(link_.lastArrival(), watch.scan),
                                  steady - std::max(link_.lastByte(), watch.steady_scan));
  return starts == 0 && silence > std::max(kQuietPeriods * period_, kQuietLeast);
}

void Session::updateCounts() {
  const scip::Assembler::Counts& counts = link_.counts();
  const std::uint64_t unreadable = counts.unreadable + counts.cut;
  if (unreadable > unreadable_)
    tell_(Report::Level::kWarning, "LASER_UNREADABLE: the bytes are not a reply, or were cut short");
  unreadable_ = unreadable;
  with_.monitor.update([&](Status& status) {
    status.counts.bad_sums = before_.bad_sums + counts.bad_sums;
    status.counts.unreadable = before_.unreadable + unreadable;
    status.counts.stray_bytes = before_.stray_bytes + counts.stray_bytes;
  });
}

}  // namespace kurumaisu::laser
