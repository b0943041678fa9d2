// SPDX-License-Identifier: BSD-3-Clause
// What the guard's tests share: limits, messages, and an oracle that shares no code with the guard.
#pragma once

#include <cmath>
#include <cstdint>
#include <deque>
#include <optional>

#include "guard/guard.h"

namespace guarding {

namespace g = kurumaisu::guard;

/// Limits of the tests; not those that ship.
inline g::Limits limits() {
  g::Limits limits{};
  limits.translation = {-2.0, 2.0, 0.5, 20.0};
  limits.steering = {-1.0, 1.0, 0.4, 20.0};
  limits.reference = 2.5;
  limits.reference_tolerance = 0.01;
  limits.neutral = 0.004;
  limits.arming = 0.5;
  limits.silence = 0.15;
  limits.age = 0.1;
  return limits;
}

/// A stamp just before a time, however it is rounded [ns].
inline std::int64_t nanoseconds(double seconds) {
  return static_cast<std::int64_t>(std::floor(1e9 * seconds)) - 1;
}

/// A valid message made at a time [s].
inline g::Request request(std::uint64_t sequence, double made, double translation = 0, double steering = 0) {
  return {g::kMagic,
          g::kVersion,
          static_cast<std::uint16_t>(g::Kind::kPut),
          sequence,
          nanoseconds(made),
          translation,
          steering,
          2.5};
}

/// Watches a guard from outside: what it is given, and what it puts out.
///
/// It knows of `valid` only what holds of a message alone; so it demands necessary conditions, for safety.
class Watch {
 public:
  explicit Watch(const g::Limits& limits) : limits_(limits) {}

  /// A message that the guard is about to be given.
  void message(const g::Request& r, double now) {
    const double age = now - 1e-9 * static_cast<double>(r.time);
    const bool good = r.magic == g::kMagic && r.version == g::kVersion && r.kind == 1 && age >= 0 &&
                      age <= limits_.age && in(r.translation, limits_.translation) &&
                      in(r.steering, limits_.steering) &&
                      std::abs(r.reference - limits_.reference) <= limits_.reference_tolerance;
    if (!good) return broken();
    const double made = now - age;
    if (made - last_made_ > limits_.silence) neutral_since_.reset();
    const bool neutral =
        std::abs(r.translation) <= limits_.neutral && std::abs(r.steering) <= limits_.neutral;
    if (!neutral && !armable(now)) neutral_since_.reset();
    if (neutral && !neutral_since_) neutral_since_ = now;
    last_made_ = made;
    has_good_ = true;
  }

  /// Something that ends all trust: bytes that are no message, a client gone, a device fault.
  void broken() { neutral_since_.reset(); }

  /// The device is lost, or there again.
  void device(bool lost) {
    lost_ = lost;
    if (lost) broken();
  }

  /// What is wrong with an output at time now; nullptr: nothing. A trip that it sees ends all trust, too.
  const char* fault(const g::Guard& guard, double now) {
    if (guard.trips() != trips_) {
      broken();
      // the message that showed the trouble may begin the next holding
      if (guard.state() == g::State::kHolding) neutral_since_ = now;
    }
    trips_ = guard.trips();
    if (lost_ && guard.state() == g::State::kArmed) return "armed without a device";
    const auto out = guard.output();
    if (!in(out.translation, limits_.translation) || !in(out.steering, limits_.steering))
      return "outside its band";
    if (out.reference != limits_.reference) return "another reference";
    if (translation_.jumps(out.translation, limits_.translation, now) ||
        steering_.jumps(out.steering, limits_.steering, now))
      return "faster away from neutral than its rate";
    const bool moves = out.translation != 0 || out.steering != 0;
    if (guard.state() != g::State::kArmed) return moves ? "motion though not armed" : nullptr;
    if (!armable(now)) return "armed without neutral held since the last trouble";
    if (moves && (!has_good_ || now - last_made_ > limits_.silence)) return "motion without a recent message";
    return nullptr;
  }

 private:
  bool armable(double now) const { return neutral_since_ && now - *neutral_since_ >= limits_.arming; }

  /// NaN is in no band.
  static bool in(double volts, const g::Band& band) { return volts >= band.low && volts <= band.high; }

  /// The last outputs of one voltage.
  struct Track {
    std::deque<std::pair<double, double>> last;  ///< time [s], output [V]

    /// Whether it went further from neutral since any of them than a step, and what the time since then allows.
    bool jumps(double volts, const g::Band& band, double now) {
      bool result = false;
      for (const auto& [then, before] : last) {
        const double from = before * volts > 0 ? std::abs(before) : 0;
        result |= std::abs(volts) - from > band.step + band.rate * (now - then) + 1e-6;
      }
      last.emplace_back(now, volts);
      if (last.size() > 50) last.pop_front();
      return result;
    }
  };

  Track translation_;
  Track steering_;
  g::Limits limits_;
  std::optional<double> neutral_since_;
  double last_made_ = -1e9;
  bool has_good_ = false;
  std::uint32_t trips_ = 0;
  bool lost_ = false;
};

}  // namespace guarding
