// SPDX-License-Identifier: BSD-3-Clause
// A driver of a virtual sensor that has faults, and what came of it.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>
#include <time.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "laser/driver.h"
#include "laser/port.h"
#include "sensor_file.h"
#include "virtual_urg/pty.h"
#include "virtual_urg/server.h"
#include "virtual_urg/tcp.h"

namespace watching {

namespace l = kurumaisu::laser;
namespace v = kurumaisu::virtual_urg;

constexpr double kRecovery = 0.6;  // [s] after the sensor answers again
constexpr double kLong = 6;        // [s] after which a test gives up waiting
constexpr double kJitter = 0.05;   // [s] that an idle computer may be late

/// What a sensor does, and until when it is watched.
struct Case {
  std::vector<std::string> faults;
  bool serial = false;
  std::string sensor = "urg_04lx_ug01";
  std::uint64_t scans = 10;  // until so many
  double at_most = kLong;    // [s] or so long
  std::function<void(l::DriverSettings&)> change = [](l::DriverSettings&) {};
};

using Cases = std::map<std::string, Case>;

struct Came {
  double time;  // [s]
  l::Scan scan;
};

struct Result {
  std::vector<Came> scans;
  std::vector<std::string> told;
  l::Status status;
  v::Counters sensor;
  double seconds = 0;
  double cpu = 0;       // of a core, taken by the driver's thread
  double stopping = 0;  // [s] that stop() took
  double jitter = 0;    // [s] that may be this computer's fault

  double longestGap() const {
    double longest = 0;
    for (std::size_t i = 1; i < scans.size(); ++i)
      longest = std::max(longest, scans[i].time - scans[i - 1].time);
    return longest;
  }
  bool tells(const std::string& code) const {
    for (const std::string& text : told) {
      if (text.find(code) != std::string::npos) return true;
    }
    return false;
  }
};

/// A folder that goes with its links.
class Folder {
 public:
  Folder() {
    if (mkdtemp(path_) == nullptr) throw std::runtime_error("no folder");
  }
  ~Folder() { rmdir(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::string link() const { return std::string(path_) + "/urg"; }

 private:
  char path_[32] = "/tmp/urg-XXXXXX";
};

/// [m] of the beam of a step; each is another one, so that no beam can stand for its neighbour.
double rangeOf(std::size_t beam) { return 1.0 + 0.001 * static_cast<double>(beam); }

/// A virtual sensor that always measures the same.
class Sensor {
 public:
  explicit Sensor(const Case& what) {
    std::vector<v::Fault> faults;
    faults.reserve(what.faults.size());
    for (const std::string& text : what.faults) faults.push_back(v::fault(text));
    std::unique_ptr<v::Endpoint> endpoint;
    if (what.serial) {
      endpoint = std::make_unique<v::Pty>(folder_.link());
    } else {
      endpoint = std::make_unique<v::Tcp>("127.0.0.1", 0);
    }
    v::Model model = v::modelOf(SOURCE_DIR "/launch/urg/" + what.sensor + ".yaml");
    for (auto& [key, value] : model.version) {
      if (key == "SERI") value = "H1234567";
    }
    const std::map<std::string, std::string> values(model.parameters.begin(), model.parameters.end());
    const int beams = std::stoi(values.at("AMAX")) - std::stoi(values.at("AMIN")) + 1;
    server_ = std::make_unique<v::Server>(std::move(model), faults, v::Clock{}, std::move(endpoint),
                                          v::Server::Options{});
    v::Measurement room;
    for (int i = 0; i < beams; ++i) {
      room.ranges.push_back(rangeOf(static_cast<std::size_t>(i)));
      room.intensities.push_back(100 + i);
    }
    server_->show(room);
  }

  v::Server& server() { return *server_; }

  l::DriverSettings settings() const {
    l::DriverSettings settings{};
    settings.serial_baud = 115200;
    const std::string address = server_->address();
    if (address[0] == '/') {
      settings.serial_port = address;
    } else {
      const std::size_t colon = address.rfind(':');
      settings.ip_address = address.substr(0, colon);
      settings.ip_port = std::stoi(address.substr(colon + 1));
    }
    settings.live = {-M_PI, M_PI, 1, 0, false};
    settings.stale_timeout = 0.5;
    settings.error_limit = 4;
    settings.connect_timeout = 0.3;
    settings.answer_timeout = 0.3;
    settings.retry_min = 0.1;
    settings.retry_max = 0.3;
    return settings;
  }

 private:
  Folder folder_;
  std::unique_ptr<v::Server> server_;
};

/// A driver, and what came from it.
class Watched {
 public:
  explicit Watched(const l::DriverSettings& settings)
      : driver_(
            settings, [this](const l::Scan& scan) { take(scan); }, [this] { return now(); },
            [this](const l::Report& report) {
              const std::lock_guard<std::mutex> guard(mutex_);
              result_.told.push_back(report.text);
            }) {
    driver_.start();
  }

  l::Driver& driver() { return driver_; }

  bool await(std::uint64_t scans, double seconds) {
    std::unique_lock<std::mutex> guard(mutex_);
    return came_.wait_for(guard, std::chrono::duration<double>(seconds),
                          [&] { return result_.scans.size() >= scans; });
  }

  bool awaitStatus(const std::function<bool(const l::Status&)>& holds, double seconds) const {
    for (const double until = kurumaisu::steadyTime() + seconds; l::steadyTime() < until;) {
      if (holds(driver_.status())) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return false;
  }

  Result stop() {
    const l::State state = driver_.status().state;
    const double start = kurumaisu::steadyTime();
    driver_.stop();
    const double end = kurumaisu::steadyTime();
    Result result = result_;
    result.status = driver_.status();
    result.status.state = state;
    result.seconds = start - start_;
    result.cpu = cpu_ / (start - start_);
    result.stopping = end - start;
    return result;
  }

 private:
  void take(const l::Scan& scan) {
    const std::lock_guard<std::mutex> guard(mutex_);
    result_.scans.push_back({kurumaisu::steadyTime(), scan});
    came_.notify_all();
  }

  /// Called by the driver's thread all the time, so it knows what that thread has used.
  double now() {
    timespec used{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
    cpu_ = static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
    return kurumaisu::steadyTime();
  }

  const double start_ = kurumaisu::steadyTime();
  std::mutex mutex_;
  std::condition_variable came_;
  std::atomic<double> cpu_{0};
  Result result_;
  l::Driver driver_;
};

inline Result run(const Case& what) {
  Sensor sensor(what);
  l::DriverSettings settings = sensor.settings();
  what.change(settings);
  Watched watched(settings);
  watched.await(what.scans, what.at_most);
  Result result = watched.stop();
  result.sensor = sensor.server().counters();
  return result;
}

/// How late this computer is with what it is asked to do: other programs may keep it busy.
class Lateness {
 public:
  Lateness() : thread_([this] { watch(); }) {}
  ~Lateness() { stop(); }
  Lateness(const Lateness&) = delete;
  Lateness& operator=(const Lateness&) = delete;

  /// [s] the worst since the start.
  double stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
    return worst_;
  }

 private:
  void watch() {
    constexpr double kNap = 0.005;  // [s]
    while (!stop_) {
      const double start = kurumaisu::steadyTime();
      std::this_thread::sleep_for(std::chrono::duration<double>(kNap));
      worst_ = std::max(worst_, kurumaisu::steadyTime() - start - kNap);
    }
  }

  std::atomic<bool> stop_{false};
  double worst_ = 0;
  std::thread thread_;
};

/// All of them at once: they mostly wait.
inline std::map<std::string, Result> runAll(const Cases& cases) {
  std::map<std::string, Result> results;
  Lateness lateness;
  for (const auto& [name, what] : cases) results[name];
  std::vector<std::thread> threads;
  for (const auto& [name, what] : cases) {
    threads.emplace_back([&result = results.at(name), &what = what] { result = run(what); });
  }
  for (std::thread& thread : threads) thread.join();
  const double jitter = kJitter + 4 * lateness.stop();  // sensor's side and driver's, there and back
  for (auto& [name, result] : results) result.jitter = jitter;
  return results;
}

inline void expectRoom(const l::Scan& scan) {
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    ASSERT_FLOAT_EQ(scan.ranges[i], static_cast<float>(rangeOf(i))) << i;
  }
}

}  // namespace watching
