// SPDX-License-Identifier: BSD-3-Clause
// Who drives: inputs with priorities and timeouts, and locks that keep them from it. No ROS: time is an argument.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/limiter.h"
#include "base/words.h"

namespace kurumaisu {

struct InputSettings {
  std::string name;
  int priority;        ///< of those that speak, the highest drives
  double timeout;      ///< a command older than this is none [s]
  bool allow_several;  ///< publishers at a time; if not, a second one stops the chair
  std::size_t limits;  ///< which set of limits holds for it
};

struct LockSettings {
  std::string name;
  int priority;            ///< inputs below it are blocked
  double timeout;          ///< engages when silent for so long [s]; 0: silence means nothing
  bool blocks_on;          ///< the word that engages it: true for a lock, false for a dead-man that is held
  bool from_start = true;  ///< whether silence counts before the first word, too
};

struct ArbiterSettings {
  std::vector<InputSettings> inputs;
  std::vector<LockSettings> locks;
  Rates absurd;  ///< commands beyond these magnitudes are mistakes, not wishes [m/s, rad/s]
  /// Silence does not release an input that was never heard: its commander may hang.
  bool first_word_is_rest{};
  Rates rest{};  ///< below these magnitudes a rate is 0: the chair cannot go so slowly [m/s, rad/s]
};

/// Events since the start.
struct ArbiterCounts {
  std::uint64_t commands = 0;    ///< received
  std::uint64_t refused = 0;     ///< of those, not finite or absurd
  std::uint64_t timeouts = 0;    ///< times that whoever drove fell silent in motion
  std::uint64_t locked = 0;      ///< times that a lock stopped who would drive
  std::uint64_t conflicts = 0;   ///< times that two publishers on one input stopped the chair
  std::uint64_t unreleased = 0;  ///< times that a command was there before the chair could obey
};

/// Why the chair does what it does. All but kDriving lead to rest, by a ramp.
enum class Reason { kIdle, kDriving, kLocked, kSeveral, kUnreleased };

struct Choice {
  Reason reason = Reason::kIdle;
  std::optional<std::size_t> input;  ///< whose word counts; none when all are silent
  std::optional<std::size_t> lock;   ///< with kLocked
  Rates command;                     ///< with kDriving
};

/// An input obeys only after it was released: it said zero, or was silent for its timeout, since the start, the
/// last reset() or disarm(), and the last time that the clock ran backwards.
class Arbiter {
 public:
  explicit Arbiter(const ArbiterSettings& settings);

  /// Takes a command of a publisher on an input at time t [s]. A command that is not finite, or absurd, is
  /// refused (false): it neither moves the chair nor keeps the last command alive.
  bool command(std::size_t input, const std::string& publisher, const Rates& rates, double t);

  /// What a publisher of a lock's topic says at time t [s]. It is engaged as long as any of them engages it.
  void lock(std::size_t lock, const Speaker& by, bool engages, double t);

  /// Whether anybody has spoken on a lock's topic.
  bool hasHeard(std::size_t lock) const { return !locks_.at(lock).empty(); }

  /// Locks no longer heed those who spoke and are gone.
  void forgetGone();

  /// Who drives from time t [s] on.
  Choice choose(double t);

  /// Whether anybody commands more than rest at time t [s], heeded or not.
  bool moving(double t) const;

  /// Forgets every command; every input must be released anew. Locks keep their word.
  void reset();

  /// Every input must be released anew; its commands still count as heard.
  void disarm();

  const ArbiterSettings& settings() const { return settings_; }
  const ArbiterCounts& counts() const { return counts_; }
  const Choice& last() const { return last_; }

  /// The publishers that speak on an input, as of the last choose().
  std::vector<std::string> publishers(std::size_t input) const;

 private:
  struct Command {
    Rates rates;
    double t;
    std::uint64_t order;
  };
  struct Input {
    std::map<std::string, Command> commands;  ///< the last of each publisher
    std::optional<double> heard;              ///< anything, refused or not [s]
    bool released = false;
  };

  void forgetTime();
  void prune(double t);
  std::optional<std::size_t> loudest() const;
  bool isEngaged(std::size_t lock, double t) const;
  std::optional<std::size_t> lockOver(std::size_t input, double t) const;
  Choice judge(double t) const;
  void count(const Choice& before, const Choice& now);

  ArbiterSettings settings_;
  std::vector<std::size_t> by_priority_;
  std::vector<Input> inputs_;
  std::vector<Words> locks_;
  ArbiterCounts counts_;
  Choice last_;
  std::optional<double> since_;  ///< when listening began [s]
  std::optional<double> now_;    ///< of the last choose() [s]
};

}  // namespace kurumaisu
