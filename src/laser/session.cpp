// SPDX-License-Identifier: BSD-3-Clause
#include "laser/session.h"

#include <algorithm>
#include <utility>

#include "laser/tcp.h"
#include "laser/tty.h"

namespace kurumaisu::laser {
namespace {

constexpr double kSlice = 0.05;        // [s] between two looks at the time
constexpr double kQuietPeriods = 2.5;  // without a byte: ask whether the sensor is still there
constexpr double kQuietLeast = 0.2;    // [s] the same, for those that send often
constexpr int kMostPatience = 3;       // starts without a scan that add to the wait for one
constexpr int kCalibrations = 10;      // times that the sensor's clock is asked
constexpr std::size_t kClockWidth = 4;

std::unique_ptr<Port> openPort(const DriverSettings& settings, const std::function<bool()>& interrupted) {
  if (settings.ip_address.empty()) return std::make_unique<Tty>(settings.serial_port, settings.serial_baud);
  return std::make_unique<Tcp>(settings.ip_address, settings.ip_port, settings.connect_timeout, interrupted);
}

std::string meaning(const std::string& status) {
  if (status == "10") return "its laser is off";
  if (status == "98") return "it has resumed after checking itself";
  if (status >= "21" && status <= "49") return "it has stopped to check itself";
  if (status >= "50" && status <= "97") return "its hardware is in trouble";
  return "unexpected while it streams";
}

}  // namespace

Session::Session(const Surroundings& surroundings)
    : with_(surroundings),
      link_(openPort(with_.settings, [this] { return with_.control.stopped(); }), with_.now,
            [this] { return with_.control.stopped(); }),
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
  for (bool again = true; again;) {
    identify();
    if (with_.settings.calibrate_time) calibrate();
    std::shared_ptr<ScipStream> scips;
    do {
      const std::unique_ptr<Urg> urg = start(scips);
      again = stream(*urg, *scips);
    } while (!again);
  }
}

void Session::identify() {
  const Tell tell = [this](Report::Level level, const std::string& text) { with_.monitor.tell(level, text); };
  sensor_ = handshake(link_, {with_.settings.serial_baud, with_.settings.answer_timeout}, tell);
  Device device{scip::keyed(sensor_.version), sensor_.state, sensor_.parameters, sensor_.baud};
  if (device.version["SERI"] != with_.memory.serial) {
    with_.memory.clock.reset();
    with_.memory.sequence.reset();
    with_.memory.serial = device.version["SERI"];
  }
  with_.monitor.update([&](Status& status) {
    status.state = State::kStarting;
    status.device = std::move(device);
  });
  if (with_.settings.stale_timeout > 2 * sensor_.parameters.scanTime()) return;
  throw std::invalid_argument("stale_timeout " + std::to_string(with_.settings.stale_timeout) +
                              " s must be longer than two scans, which take " +
                              std::to_string(2 * sensor_.parameters.scanTime()) + " s");
}

void Session::calibrate() {
  with_.memory.clock.reset();
  const double timeout = with_.settings.answer_timeout;
  const std::string status = link_.ask("TM0", timeout).status;
  for (int i = 0; status == "00" && i < kCalibrations; ++i) {
    const double sent = with_.now();
    const scip::Message reply = link_.ask("TM1", timeout);
    const bool is_good = reply.status == "00" && reply.bad_sums == 0 && reply.lines.size() == 1 &&
                         reply.lines[0].size() == kClockWidth;
    if (is_good) with_.memory.clock.calibrate(scip::decodeClock(reply.lines[0]), sent, with_.now());
  }
  link_.ask("TM2", timeout);
  if (status == "00") return;
  with_.monitor.tell(Report::Level::kWarning, "LASER_NO_CALIBRATION: TM0 is answered by status " + status +
                                                  "; calibrate_time has no effect");
}

std::unique_ptr<Urg> Session::start(std::shared_ptr<ScipStream>& stream) {
  Window window = with_.control.takeWindow();
  const bool asks = window.intensity;
  if (with_.memory.wedged) window.intensity = false;
  try {
    return startForm(stream, window);
  } catch (const NoIntensity& refusal) {
    with_.monitor.tell(Report::Level::kWarning, refusal.what());
  } catch (const LinkLost&) {
    // Some URG-04LX fall silent for good, others until they are asked for something else.
    with_.memory.wedged = asks && !with_.control.stopped();
    throw;
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
    if (with_.memory.has_streamed) ++status.counts.reconnects;
  });
  return urg;
}

/// Streams until the window changes (false) or the sensor falls quiet and must be asked what it is (true).
bool Session::stream(Urg& urg, ScipStream& stream) {
  Watch watch{with_.now()};
  while (!with_.control.changed()) {
    if (with_.control.takeRestart()) throw LinkLost("LASER_RESTART: told to begin anew");
    if (const std::optional<Arrival> arrival = stream.await(kSlice)) handle(*arrival, urg, watch);
    if (isSilent(watch)) return true;
  }
  link_.ask("QT", with_.settings.answer_timeout, with_.settings.answer_timeout);
  with_.memory.sequence.reset();
  return false;
}

void Session::handle(const Arrival& arrival, Urg& urg, Watch& watch) {
  updateCounts();
  mrpt::obs::CObservation2DRangeScan observation;
  if (arrival.kind == Arrival::Kind::kScan) {
    if (!urg.take(observation)) throw LinkLost("LASER_MRPT: MRPT does not take a good scan");
    watch = {with_.now()};
    publish(arrival);
    return;
  }
  complain(arrival);
  if (++watch.errors <= with_.settings.error_limit) return;
  throw LinkLost("LASER_ERRORS: " + std::to_string(watch.errors) + " in a row, the last: " + arrival.text);
}

void Session::publish(const Arrival& arrival) {
  const scip::Rotation& rotation = arrival.rotation;
  const std::uint64_t missing = with_.memory.sequence.missing(rotation.clock, arrival.first_byte, period_);
  const double time = with_.memory.clock.stamp(rotation.clock, arrival.first_byte, fan_->leastDelay());
  Scan scan = fan_->convert(rotation, time);
  const DeviceClock::State& clock = with_.memory.clock.state();
  scan.latency = clock.latency;
  with_.sink(scan);
  with_.memory.has_streamed = true;
  with_.memory.starts_without_scan = 0;
  with_.monitor.update([&](Status& status) {
    status.state = State::kStreaming;
    ++status.counts.scans;
    status.counts.lost += missing;
    status.last_scan_time = with_.now();
    status.latency = steadyTime() - link_.lastByte();
    status.clock = clock;
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
    with_.monitor.tell(Report::Level::kWarning, "LASER_DAMAGED: a scan is dropped: " + arrival.text);
  if (arrival.kind == Kind::kDuplicate)
    with_.monitor.tell(Report::Level::kWarning, "LASER_DUPLICATE: a scan came twice: " + arrival.text);
  if (arrival.kind != Kind::kStatus) return;
  const auto level = arrival.text == "98" ? Report::Level::kWarning : Report::Level::kError;
  with_.monitor.tell(level,
                     "LASER_STATUS: the sensor reports " + arrival.text + ": " + meaning(arrival.text));
}

/// True if it must be asked whether it is still there. Throws LinkLost where there was no scan for too long.
bool Session::isSilent(Watch& watch) const {
  const double now = with_.now();
  watch.heard = std::min(watch.heard, now);  // the host's time was set back
  const int patience = 1 + std::min(std::max(with_.memory.starts_without_scan - 1, 0), kMostPatience);
  const double stale = with_.settings.stale_timeout * patience + period_ - sensor_.parameters.scanTime();
  if (now - watch.heard > stale) {
    throw LinkLost("LASER_STALE: no scan for " + std::to_string(now - watch.heard) + " s");
  }
  const bool has_scanned = with_.memory.starts_without_scan == 0;
  const double quiet = std::max(kQuietPeriods * period_, kQuietLeast);
  return has_scanned && now - std::max(link_.lastArrival(), watch.heard) > quiet;
}

void Session::updateCounts() {
  const scip::Assembler::Counts& counts = link_.counts();
  with_.monitor.update([&](Status& status) {
    status.counts.bad_sums = before_.bad_sums + counts.bad_sums;
    status.counts.unreadable = before_.unreadable + counts.unreadable + counts.cut;
    status.counts.stray_bytes = before_.stray_bytes + counts.stray_bytes;
  });
}

}  // namespace kurumaisu::laser
