// SPDX-License-Identifier: BSD-3-Clause
// Where the driver's thread writes what others read, and others write what it is to do.
#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "laser/fan.h"
#include "laser/status.h"

namespace kurumaisu::laser {

/// The driver's status, and what is told of it.
class Monitor {
 public:
  using Now = std::function<double()>;
  using Log = std::function<void(const Report&)>;

  Monitor(Now now, Log log) : now_(std::move(now)), log_(std::move(log)) {}

  /// Notes what happened and passes it on: of one code (what stands before the first colon) at most once a second, the
  /// same words every ten. From the driver's thread only.
  void tell(Report::Level level, const std::string& text);

  /// Changes the status by a function of it.
  template <typename Change>
  void update(const Change& change) {
    const std::lock_guard<std::mutex> guard(mutex_);
    change(status_);
  }

  Status status() const {
    const std::lock_guard<std::mutex> guard(mutex_);
    return status_;
  }

 private:
  Now now_;
  Log log_;
  mutable std::mutex mutex_;
  Status status_;
  struct Told {
    std::string text;
    double time = 0;  // [s] steady
  };
  std::map<std::string, Told> told_;  // by code
};

/// What the driver is to do.
class Control {
 public:
  explicit Control(const Window& window) : window_(window) {}

  void stop();
  void restart();
  void change(const Window& window);

  bool stopped() const;
  bool changed() const;

  /// Must the connection be given up? True once for each restart().
  bool takeRestart();

  /// The window to ask for; changed() is false from then on.
  Window takeWindow();

  /// Waits so long [s], or until told to do something.
  void sleep(double seconds);

 private:
  mutable std::mutex mutex_;
  std::condition_variable told_;
  Window window_;
  bool stop_ = false;
  bool restart_ = false;
  bool changed_ = false;
  int orders_ = 0;
};

}  // namespace kurumaisu::laser
