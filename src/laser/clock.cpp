// SPDX-License-Identifier: BSD-3-Clause
#include "laser/clock.h"

#include <algorithm>
#include <cmath>

namespace kurumaisu::laser {
namespace {

constexpr std::int64_t kWrap = std::int64_t{1} << 24U;  // [ms]
constexpr std::int64_t kTurnMost = 1000;                // [ms] of a mirror
constexpr double kMillisecond = 1e-3;                   // [s]
constexpr double kEarly = 0.02;      // [s] below the line: no delay, one of the clocks was set
constexpr double kDriftMax = 0.005;  // of a sensor's clock, while it was not heard
constexpr double kLate = 0.12;       // [s] above the line: a stall, or a clock was set
constexpr double kPatience = 2;      // [s] after which it is no stall
constexpr double kDeviceApart = 1;   // [s] from the host's time: the sensor's clock is not the host's
constexpr double kSendDelayMost =
    0.3;  // [s] what was told is not the clock that stamps scans, or none came in time
constexpr double kCalibrationAge = 30;  // [s] after which drift spoils it

/// The time [s] nearest to the host's at which a clock that counts the host's milliseconds has a reading.
double nearest(std::uint32_t clock, double host) {
  const double turns = std::round((host / kMillisecond - clock) / static_cast<double>(kWrap));
  return (clock + turns * static_cast<double>(kWrap)) * kMillisecond;
}

}  // namespace

double DeviceClock::stamp(std::uint32_t clock, double first_byte, double least_delay) {
  const double latest = first_byte - least_delay;
  state_.stands = mode_ != TimeMode::kHost && newest_ == clock;
  newest_ = clock;
  if (state_.stands) restart();
  const double device = follow(clock, first_byte, least_delay);
  double time = latest;
  if (mode_ != TimeMode::kHost) time = std::min(device + envelope_.at(device) - state_.send_delay, latest);
  if (mode_ == TimeMode::kDevice) {
    const double own = nearest(clock, first_byte);
    state_.fallback = !isHosts(own, first_byte) || state_.stands;
    if (!state_.fallback) time = own;
  }
  if (stamped_ && first_byte >= stamped_->host) time = std::max(time, stamped_->stamp);
  stamped_ = Stamped{first_byte, time};
  state_.offset = time - device;
  state_.drift = 1 / (1 + envelope_.slope()) - 1;
  state_.latency = latest - time;
  state_.span = envelope_.span();
  return time;
}

/// Is a time [s] by the sensor's clock the host's?
///
/// Who was held up himself finds bytes and the host's time of different moments, for a short while; a sensor that was
/// off finds another clock.
bool DeviceClock::isHosts(double own, double host) {
  if (std::abs(own - host) <= kDeviceApart) {
    own_ = Own{own, std::nullopt};
    return true;
  }
  if (!own_) return false;
  const bool goes_on = own > own_->newest && own - own_->newest < kPatience;
  if (!own_->apart) own_->apart = own;
  own_->newest = own;
  if (!goes_on || own - *own_->apart > kPatience) own_.reset();
  return own_.has_value();
}

/// Brings the envelope up to a scan; returns the sensor's time [s] of it.
double DeviceClock::follow(std::uint32_t clock, double first_byte, double least_delay) {
  const double sent = first_byte - least_delay;
  const double unheard = last_ ? first_byte - last_->host : 0;
  double device = read(clock, first_byte);
  if (isEarly({device, sent - device}, kDriftMax * unheard)) {
    if (envelope_.span() > kPatience) {
      restart();
      ++state_.resets;
      device = read(clock, first_byte);
    } else {
      envelope_.restart();  // the first scans were late
    }
  }
  const Point point{device, sent - device};
  envelope_.expire(device);
  if (isLateForLong(point, first_byte)) {
    envelope_.restart();
    envelope_.add(late_->lowest);
    late_.reset();
    ++state_.resets;
  }
  envelope_.add(point);
  measureSendDelay(device);
  return device;
}

/// The sensor's time [s]: its clock, counted on where it wraps; by the host's time where it did so unheard.
double DeviceClock::read(std::uint32_t clock, double host) {
  if (!last_) {
    last_ = Reading{clock, clock, host};
  } else {
    std::int64_t ahead = (std::int64_t{clock} - last_->clock + kWrap) % kWrap;
    if (last_->told && ahead > kWrap - kTurnMost) ahead -= kWrap;
    const double unheard = (host - last_->host) / kMillisecond - static_cast<double>(ahead);
    const double wraps = std::max(0.0, std::round(unheard / static_cast<double>(kWrap)));
    last_ = Reading{clock, last_->device + ahead + static_cast<std::int64_t>(wraps) * kWrap, host};
  }
  return static_cast<double>(last_->device) * kMillisecond;
}

/// Before it can have been sent: the sensor was switched on anew, or a clock was set.
bool DeviceClock::isEarly(const Point& point, double doubt) const {
  return !envelope_.empty() && point.y < envelope_.at(point.x) - kEarly - doubt;
}

/// All scans of the last while came late: no stall, a clock was set.
bool DeviceClock::isLateForLong(const Point& point, double host) {
  if (envelope_.empty() || point.y <= envelope_.at(point.x) + kLate) {
    late_.reset();
    return false;
  }
  if (!late_) late_ = Late{host, point};
  if (point.y < late_->lowest.y) late_->lowest = point;
  return host - late_->since > kPatience;
}

void DeviceClock::restart() {
  envelope_.restart();
  last_.reset();
  late_.reset();
  calibration_.reset();
}

void DeviceClock::calibrate(std::uint32_t clock, double sent, double received) {
  const double host = 0.5 * (sent + received);
  const double doubt = received - sent;
  const double unheard = last_ ? received - last_->host : 0;
  double device = read(clock, host);
  if (isEarly({device, host - device}, doubt + kDriftMax * unheard)) {
    restart();
    ++state_.resets;
    device = read(clock, host);
  }
  last_->told = true;
  if (calibration_ && doubt > calibration_->doubt && device - calibration_->point.x < kCalibrationAge) return;
  calibration_ = Calibration{{device, host - device}, doubt};
}

/// What the line has too much: even the fastest scan was on its way for a while.
void DeviceClock::measureSendDelay(double device) {
  if (!calibration_ || device - calibration_->point.x > kCalibrationAge) return;
  const double delay = envelope_.at(calibration_->point.x) - calibration_->point.y;
  if (delay > kSendDelayMost) return;
  state_.calibrated = true;
  state_.send_delay = std::max(0.0, delay);
}

void DeviceClock::reset() { *this = DeviceClock(mode_); }

}  // namespace kurumaisu::laser
