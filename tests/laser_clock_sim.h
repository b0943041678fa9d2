// SPDX-License-Identifier: BSD-3-Clause
// A sensor's clock and the way of its scans to the host, both made up: the truth about them is known.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>

namespace laser_clock_sim {

constexpr double kScanTime = 0.1;  // [s] of the sensor's
constexpr double kLeastDelay =
    kScanTime * 725 / 1024;  // [s] from the stamp to the last step, as of a URG-04LX

/// How long bytes are on their way; every part may be 0.
struct Way {
  double least = 0;       ///< [s] of the fastest scan
  double tail = 0;        ///< [s] mean of what is added, exponential
  double stall = 0;       ///< [s] longest; a scan that stalls waits half of it or more
  double stall_rate = 0;  ///< share of the scans that stall
  double poll = 0;        ///< [s] the host looks at multiples of it only
};

/// USB's frames of 1 ms, an idle host; stalls of up to 50 ms.
constexpr Way kUsb{0.0008, 0.001, 0.05, 0.01, 0.001};
/// A serial converter that hands on bytes each 16 ms.
constexpr Way kPolled{0.0008, 0.0005, 0.05, 0.01, 0.016};
/// Ethernet.
constexpr Way kTcp{0.0002, 0.0001, 0.05, 0.001, 0};
/// A host with other things to do.
constexpr Way kBusy{0.0008, 0.008, 0.2, 0.05, 0.001};

struct Arrival {
  std::uint32_t clock = 0;  ///< [ms] 24 bits
  double truth = 0;         ///< [s] host's time when the sensor read it
  double first_byte = 0;    ///< [s] host's time
};

struct Answer {
  std::uint32_t clock = 0;  ///< [ms] 24 bits
  double sent = 0;          ///< [s] host's time of the question
  double received = 0;      ///< [s] host's time of the answer
};

/// Scans one after another.
class Sensor {
 public:
  /// drift: by how much the sensor's clock runs fast [s/s]; start: its reading [ms] at the host's time t0 [s].
  Sensor(const Way& way, double drift, double start, double t0, unsigned seed)
      : way_(way), drift_(drift), start_(start), origin_(t0), random_(seed) {
    phase_ = uniform_(random_) * kScanTime;
  }

  Arrival next() {
    const double device = phase_ + kScanTime * static_cast<double>(scan_++);  // [s] since the origin
    Arrival arrival;
    arrival.clock = reading(device);
    arrival.truth = origin_ + device / (1 + drift_) + step_;
    arrival.first_byte = std::max(last_, come(arrival.truth - step_ + kLeastDelay / (1 + drift_)) + step_);
    last_ = arrival.first_byte;
    return arrival;
  }

  /// The clock, asked for so long [s] before the next scan's stamp.
  Answer ask(double before) {
    const double next = (phase_ + kScanTime * static_cast<double>(scan_)) / (1 + drift_);
    const double sent = origin_ + next - before;
    const double read = sent + way_.least;
    return {reading((read - origin_) * (1 + drift_)), sent + step_, come(read) + step_};
  }

  /// Scans that never come.
  void lose(int scans) { scan_ += scans; }

  /// The sensor is switched off and on: its clock starts anew, some time [s] after the last scan.
  void reboot(double pause) {
    origin_ += (phase_ + kScanTime * static_cast<double>(scan_)) / (1 + drift_) + pause;
    scan_ = 0;
    start_ = 0;
    phase_ = uniform_(random_) * kScanTime;
  }

  /// The host's clock is set by so much [s].
  void stepHost(double step) {
    step_ += step;
    if (step < 0) last_ = -1e300;
  }

  /// From now on the sensor's clock runs fast by so much [s/s]: it warms up, or the host's is slewed.
  void setDrift(double drift) {
    const double device = phase_ + kScanTime * static_cast<double>(scan_);
    origin_ += device / (1 + drift_) - device / (1 + drift);
    drift_ = drift;
  }

 private:
  std::uint32_t reading(double device) const {
    return static_cast<std::uint32_t>(static_cast<std::int64_t>(std::floor(start_ + 1e3 * device)) &
                                      0xffffff);
  }

  /// When what the sensor sends at a time is read here [s].
  double come(double time) {
    time += way_.least;
    if (way_.tail > 0) time += std::exponential_distribution<double>(1 / way_.tail)(random_);
    if (uniform_(random_) < way_.stall_rate) time += way_.stall * (0.5 + 0.5 * uniform_(random_));
    if (way_.poll > 0) time = std::ceil(time / way_.poll) * way_.poll;
    return time;
  }

  Way way_;
  double drift_;
  double start_;
  double origin_;
  double phase_ = 0;
  double step_ = 0;
  double last_ = -1e300;
  std::int64_t scan_ = 0;
  std::mt19937_64 random_;
  std::uniform_real_distribution<double> uniform_{0, 1};
};

/// Bias, spread and worst case of errors [s].
class Errors {
 public:
  void add(double error) {
    ++count_;
    sum_ += error;
    squares_ += error * error;
    worst_ = std::max(worst_, std::abs(error));
  }
  double bias() const { return sum_ / count_; }
  double sd() const { return std::sqrt(std::max(0.0, squares_ / count_ - bias() * bias())); }
  double worst() const { return worst_; }

 private:
  double count_ = 0;
  double sum_ = 0;
  double squares_ = 0;
  double worst_ = 0;
};

}  // namespace laser_clock_sim
