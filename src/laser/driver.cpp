// SPDX-License-Identifier: BSD-3-Clause
#include "laser/driver.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <thread>
#include <utility>

#include "laser/session.h"

namespace kurumaisu::laser {
namespace {

constexpr std::array<int, 7> kBauds{19200, 38400, 57600, 115200, 250000, 500000, 750000};  // of SCIP 2.0
constexpr int kLastPort = 65535;
constexpr double kRise = 1.2;  // of the time between attempts while there is no port

void require(bool holds, const std::string& what) {
  if (!holds) throw std::invalid_argument(what);
}

/// Throws for a window that no sensor can do.
void check(const Window& window) {
  scip::Parameters all_round;
  all_round.distance_max = 1;
  all_round.steps_per_turn = 1440;
  all_round.last = all_round.steps_per_turn - 1;
  all_round.front = all_round.steps_per_turn / 2;
  all_round.rpm = 1;
  Fan(all_round, window);
}

void checkPlace(const DriverSettings& settings) {
  const bool is_tty = settings.ip_address.empty();
  require(is_tty != settings.serial_port.empty(), "either serial_port or ip_address must be given: " +
                                                      settings.serial_port + ", " + settings.ip_address);
  require(is_tty || (settings.ip_port > 0 && settings.ip_port <= kLastPort),
          "ip_port is not a port: " + std::to_string(settings.ip_port));
  require(!is_tty || std::find(kBauds.begin(), kBauds.end(), settings.serial_baud) != kBauds.end(),
          "serial_baud is not a rate of SCIP 2.0: " + std::to_string(settings.serial_baud));
}

DriverSettings checked(DriverSettings settings) {
  checkPlace(settings);
  for (const auto& [name, time] : {std::pair("stale_timeout", settings.stale_timeout),
                                   {"connect_timeout", settings.connect_timeout},
                                   {"answer_timeout", settings.answer_timeout},
                                   {"retry_min", settings.retry_min}}) {
    require(time > 0, std::string(name) + " must be more than 0 s: " + std::to_string(time));
  }
  require(settings.retry_max >= settings.retry_min,
          "retry_max must not be less than retry_min: " + std::to_string(settings.retry_max));
  require(settings.error_limit >= 0,
          "error_limit must not be negative: " + std::to_string(settings.error_limit));
  check(settings.live);
  return settings;
}

}  // namespace

class Driver::Impl {
 public:
  Impl(DriverSettings settings, Sink sink, Now now, Log log)
      : settings_(checked(std::move(settings))),
        sink_(std::move(sink)),
        now_(std::move(now)),
        monitor(now_, std::move(log)),
        control(settings_.live),
        memory_{DeviceClock(settings_.time_mode), {}, {}, false, 0, false, false} {}

  void start() {
    if (!thread_.joinable()) thread_ = std::thread([this] { run(); });
  }

  void stop() {
    control.stop();
    if (thread_.joinable()) thread_.join();
  }

 private:
  void run();
  void attempt();
  void fail(State state, Report::Level level, const std::string& text);

  const DriverSettings settings_;
  const Sink sink_;
  const Now now_;

 public:
  Monitor monitor;
  Control control;

 private:
  Memory memory_;
  double pause_ = 0;  // [s] from one attempt to the next
  std::thread thread_;
};

void Driver::Impl::run() {
  pause_ = settings_.retry_min;
  monitor.update([](Status& status) { status.state = State::kConnecting; });
  while (!control.stopped()) {
    const double start = steadyTime();
    monitor.update([](Status& status) { ++status.counts.attempts; });
    try {
      attempt();
    } catch (const LinkLost& problem) {
      fail(State::kConnecting, Report::Level::kWarning, problem.what());
    } catch (const Refused& problem) {
      pause_ = settings_.retry_max;
      fail(State::kRefused, Report::Level::kError, problem.what());
    } catch (const std::invalid_argument& problem) {
      fail(State::kMisconfigured, Report::Level::kError, std::string("LASER_SETTINGS: ") + problem.what());
      while (!control.stopped() && !control.changed() && !control.takeRestart()) control.sleep(1);
    } catch (const std::exception& problem) {
      fail(State::kConnecting, Report::Level::kError, std::string("LASER_UNEXPECTED: ") + problem.what());
    }
    control.takeRestart();
    control.sleep(start + pause_ - steadyTime());
  }
  monitor.update([](Status& status) { status.state = State::kStopped; });
}

void Driver::Impl::attempt() {
  std::unique_ptr<Session> session;
  try {
    session = std::make_unique<Session>(Surroundings{settings_, sink_, now_, control, monitor, memory_});
  } catch (const LinkLost&) {
    pause_ = std::min(pause_ * kRise, settings_.retry_max);
    throw;
  }
  pause_ = settings_.retry_min;
  session->run();
}

void Driver::Impl::fail(State state, Report::Level level, const std::string& text) {
  if (control.stopped()) return;
  monitor.update([state](Status& status) { status.state = state; });
  monitor.tell(level, text);
}

Driver::Driver(DriverSettings settings, Sink sink, Now now, Log log)
    : impl_(std::make_unique<Impl>(std::move(settings), std::move(sink), std::move(now), std::move(log))) {}

Driver::~Driver() { stop(); }

void Driver::start() { impl_->start(); }

void Driver::stop() { impl_->stop(); }

void Driver::reconfigure(const LiveSettings& live) {
  check(live);
  if (const auto sensor = impl_->monitor.status().device.parameters) Fan(*sensor, live);
  impl_->control.change(live);
}

void Driver::restart() { impl_->control.restart(); }

Status Driver::status() const { return impl_->monitor.status(); }

}  // namespace kurumaisu::laser
