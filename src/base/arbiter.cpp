// SPDX-License-Identifier: BSD-3-Clause
#include "base/arbiter.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace kurumaisu {
namespace {

double restOr(double rate, double least) { return std::abs(rate) < least ? 0 : rate; }

}  // namespace

Arbiter::Arbiter(const ArbiterSettings& settings)
    : settings_(settings),
      by_priority_(settings.inputs.size()),
      inputs_(settings.inputs.size()),
      locks_(settings.locks.size()) {
  std::iota(by_priority_.begin(), by_priority_.end(), 0);
  std::stable_sort(by_priority_.begin(), by_priority_.end(), [&](std::size_t a, std::size_t b) {
    return settings.inputs[a].priority > settings.inputs[b].priority;
  });
}

bool Arbiter::command(std::size_t input, const std::string& publisher, const Rates& wish, double t) {
  Input& to = inputs_.at(input);
  const double timeout = settings_.inputs[input].timeout;
  const std::optional<double> heard = to.heard || settings_.first_word_is_rest ? to.heard : since_;
  if (heard && t - *heard > timeout) to.released = true;
  to.heard = t;
  ++counts_.commands;
  // Written so that NaN is beyond every bound.
  if (!(std::abs(wish.v) <= settings_.absurd.v) || !(std::abs(wish.w) <= settings_.absurd.w)) {
    ++counts_.refused;
    return false;
  }
  const Rates rates{restOr(wish.v, settings_.rest.v), restOr(wish.w, settings_.rest.w)};
  if (rates.zero()) to.released = true;
  to.commands[publisher] = {rates, t, counts_.commands};
  return true;
}

void Arbiter::lock(std::size_t lock, const Speaker& by, bool engages, double t) {
  locks_.at(lock).hear(by, engages, t);
}

void Arbiter::forgetGone() {
  for (Words& lock : locks_) lock.forgetGone();
}

Choice Arbiter::choose(double t) {
  if (now_ && t < *now_) forgetTime();
  now_ = t;
  if (!since_) since_ = t;
  const Choice before = last_;
  prune(t);
  last_ = judge(t);
  count(before, last_);
  return last_;
}

/// After the clock ran backwards nobody knows how old anything is.
void Arbiter::forgetTime() {
  reset();
  for (Words& lock : locks_) lock.forgetTimes();
}

void Arbiter::reset() {
  for (Input& input : inputs_) input = {};
  since_.reset();
  last_ = {};
}

void Arbiter::disarm() {
  for (Input& input : inputs_) input.released = false;
}

void Arbiter::prune(double t) {
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    auto& commands = inputs_[i].commands;
    for (auto it = commands.begin(); it != commands.end();) {
      it = t - it->second.t > settings_.inputs[i].timeout ? commands.erase(it) : std::next(it);
    }
  }
}

std::optional<std::size_t> Arbiter::loudest() const {
  for (const std::size_t input : by_priority_) {
    if (!inputs_[input].commands.empty()) return input;
  }
  return std::nullopt;
}

bool Arbiter::isEngaged(std::size_t lock, double t) const {
  const LockSettings& settings = settings_.locks[lock];
  const Words& words = locks_[lock];
  if (words.anyHolds()) return true;
  if (settings.timeout == 0 || (words.empty() && !settings.from_start)) return false;
  const std::optional<double> heard = words.oldest();
  return !heard || t - *heard > settings.timeout;
}

std::optional<std::size_t> Arbiter::lockOver(std::size_t input, double t) const {
  for (std::size_t i = 0; i < locks_.size(); ++i) {
    if (settings_.inputs[input].priority >= settings_.locks[i].priority) continue;
    if (isEngaged(i, t)) return i;
  }
  return std::nullopt;
}

Choice Arbiter::judge(double t) const {
  Choice choice;
  choice.input = loudest();
  if (!choice.input) return choice;
  const Input& input = inputs_[*choice.input];
  choice.lock = lockOver(*choice.input, t);
  if (choice.lock) {
    choice.reason = Reason::kLocked;
  } else if (input.commands.size() > 1 && !settings_.inputs[*choice.input].allow_several) {
    choice.reason = Reason::kSeveral;
  } else if (!input.released) {
    choice.reason = Reason::kUnreleased;
  } else {
    choice.reason = Reason::kDriving;
    const auto newest =
        std::max_element(input.commands.begin(), input.commands.end(),
                         [](const auto& a, const auto& b) { return a.second.order < b.second.order; });
    choice.command = newest->second.rates;
  }
  return choice;
}

void Arbiter::count(const Choice& before, const Choice& now) {
  const bool was_moving = before.reason == Reason::kDriving && !before.command.zero();
  if (was_moving && inputs_[*before.input].commands.empty()) ++counts_.timeouts;
  if (now.reason == before.reason) return;
  if (now.reason == Reason::kLocked) ++counts_.locked;
  if (now.reason == Reason::kSeveral) ++counts_.conflicts;
  if (now.reason == Reason::kUnreleased) ++counts_.unreleased;
}

bool Arbiter::moving(double t) const {
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    for (const auto& [publisher, command] : inputs_[i].commands) {
      if (t - command.t <= settings_.inputs[i].timeout && !command.rates.zero()) return true;
    }
  }
  return false;
}

std::vector<std::string> Arbiter::publishers(std::size_t input) const {
  std::vector<std::string> names;
  for (const auto& [name, command] : inputs_.at(input).commands) names.push_back(name);
  return names;
}

}  // namespace kurumaisu
