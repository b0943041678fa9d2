// SPDX-License-Identifier: BSD-3-Clause
#include "laser/monitor.h"

#include <chrono>

#include "laser/port.h"

namespace kurumaisu::laser {
namespace {

constexpr double kSame = 10;  // [s] after which the same is worth telling again
constexpr double kOther = 1;  // [s] the same for other words of that code

}  // namespace

const char* name(State state) {
  switch (state) {
    case State::kStopped:
      return "stopped";
    case State::kConnecting:
      return "connecting";
    case State::kStarting:
      return "starting";
    case State::kStreaming:
      return "streaming";
    case State::kRefused:
      return "refused";
    case State::kMisconfigured:
      return "misconfigured";
  }
  return "unknown";
}

std::string meaning(const std::string& status) {
  if (status == "10") return "its laser is off";
  if (status == "98") return "it has resumed after a self-check";
  if (status >= "21" && status <= "49") return "it has stopped for a self-check";
  if (status >= "50" && status <= "97") return "its hardware has a fault";
  return "unexpected while it streams";
}

void Monitor::tell(Report::Level level, const std::string& text) {
  if (level != Report::Level::kInfo) {
    update([&](Status& status) {
      status.last_error = text;
      status.last_error_time = now_();
    });
  }
  const double time = steadyTime();
  const auto [before, is_new] = told_.try_emplace(text.substr(0, text.find(':')));
  Told& told = before->second;
  if (!is_new && time < told.time + (text == told.text ? kSame : kOther)) return;
  told = {text, time};
  log_({level, text});
}

void Control::stop() {
  const std::lock_guard<std::mutex> guard(mutex_);
  stop_ = true;
  ++orders_;
  told_.notify_all();
}

void Control::restart() {
  const std::lock_guard<std::mutex> guard(mutex_);
  restart_ = true;
  ++orders_;
  told_.notify_all();
}

void Control::change(const Window& window) {
  const std::lock_guard<std::mutex> guard(mutex_);
  window_ = window;
  changed_ = true;
  ++orders_;
  told_.notify_all();
}

bool Control::stopped() const {
  const std::lock_guard<std::mutex> guard(mutex_);
  return stop_;
}

bool Control::changed() const {
  const std::lock_guard<std::mutex> guard(mutex_);
  return changed_;
}

bool Control::takeRestart() {
  const std::lock_guard<std::mutex> guard(mutex_);
  return std::exchange(restart_, false);
}

Window Control::takeWindow() {
  const std::lock_guard<std::mutex> guard(mutex_);
  changed_ = false;
  return window_;
}

void Control::sleep(double seconds) {
  std::unique_lock<std::mutex> guard(mutex_);
  told_.wait_for(guard, std::chrono::duration<double>(seconds),
                 [this, before = orders_] { return orders_ != before || stop_; });
}

}  // namespace kurumaisu::laser
