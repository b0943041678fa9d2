// SPDX-License-Identifier: BSD-3-Clause
// The driver against the virtual sensor, with every fault that it has.
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

namespace l = kurumaisu::laser;
namespace v = kurumaisu::virtual_urg;

namespace {

constexpr double kLong = 6;       // [s] after which a test gives up waiting
constexpr double kJitter = 0.05;  // [s] that an idle computer may be late

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

Result run(const Case& what) {
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
std::map<std::string, Result> runAll(const Cases& cases) {
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

}  // namespace

namespace {

constexpr double kPeriod = 0.1;    // [s] of the sensors below
constexpr double kRecovery = 0.6;  // [s] after the sensor answers again
constexpr double kAway = 0.5;      // [s] for which it is away, where it is

/// What a fault may cost.
struct Cost {
  double gap = kPeriod;  // [s] the longest, but for this computer's lateness
  std::uint64_t lost = 0;
  std::function<bool(const l::Counts&)> counted = [](const l::Counts&) { return true; };
  std::string told;  // code
};

Cost free() { return {}; }

Cost recovered(double away, const std::string& told) {
  return {away + kRecovery, 99, [](const l::Counts& counts) { return counts.reconnects == 1; }, told};
}

/// What must hold whatever happened.
void expectTruth(const Result& result) {
  for (std::size_t i = 0; i < result.scans.size(); ++i) {
    const auto& [time, scan] = result.scans[i];
    EXPECT_GT(time - scan.stamp, 0.05) << i;
    EXPECT_LT(time - scan.stamp, 0.2 + result.jitter) << i;
    if (i == 0) continue;
    EXPECT_GE(scan.stamp, result.scans[i - 1].scan.stamp) << i;
    EXPECT_TRUE(scan.clock != result.scans[i - 1].scan.clock || result.status.counts.reconnects > 0) << i;
  }
  EXPECT_LT(result.cpu, 0.05);
  EXPECT_LT(result.stopping, 0.25 + result.jitter);
  EXPECT_EQ(result.status.counts.scans, result.scans.size());
}

void expectRoom(const l::Scan& scan) {
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    ASSERT_FLOAT_EQ(scan.ranges[i], static_cast<float>(rangeOf(i))) << i;
  }
}

const std::map<std::string, Cost>& streamFaults() {
  static const auto damaged = [](const l::Counts& c) { return c.damaged == 1 && c.bad_sums == 1; };
  static const auto unreadable = [](const l::Counts& c) { return c.unreadable == 1; };
  const auto status = [](const char* number) {
    return [number](const l::Counts& c) { return c.errors.count(number) == 1 && c.errors.at(number) == 1; };
  };
  static const std::map<std::string, Cost> faults{
      {"corrupt@5", {2 * kPeriod, 1, damaged, "LASER_DAMAGED"}},
      {"trunc@5", {3 * kPeriod, 2, [](const l::Counts& c) { return c.unreadable + c.damaged >= 1; }, ""}},
      {"noend@5", {3 * kPeriod, 2, unreadable, "LASER_UNREADABLE"}},
      {"badlf@1", {kPeriod, 1, unreadable, "LASER_UNREADABLE"}},
      {"badlf@5", {2 * kPeriod, 1, unreadable, "LASER_UNREADABLE"}},
      {"garbage", {kPeriod, 0, [](const l::Counts& c) { return c.stray_bytes > 0; }, ""}},
      {"dup@5", {kPeriod, 0, [](const l::Counts& c) { return c.duplicates == 1; }, "LASER_DUPLICATE"}},
      {"err50@5", {2 * kPeriod, 1, status("50"), "LASER_STATUS: the sensor reports 50"}},
      {"err98@5", {2 * kPeriod, 1, status("98"), "LASER_STATUS: the sensor reports 98"}},
      {"stall@5", recovered(0, "")},
      {"stall@5=0.5", recovered(kAway, "")},
      {"close@5", recovered(0, "LASER_CLOSED")},
      {"rst@5", recovered(0, "LASER_CLOSED")},
      {"hangup@5=0.5", recovered(kAway, "LASER_CLOSED")},
      {"reboot@5=0", recovered(0, "")},
      {"reboot@5=0.5", recovered(kAway, "")},
      {"t0=16776716", free()},
      {"dribble", free()},
      {"vv-badsum", {kPeriod, 0, [](const l::Counts& c) { return c.bad_sums > 0; }, "LASER_BAD_SUM: VV"}},
      {"scip1", free()},
  };
  return faults;
}

}  // namespace

namespace {

void expectCosts(bool serial) {
  Cases cases;
  for (const auto& [fault, cost] : streamFaults()) cases[fault] = {{fault}, serial};
  for (const auto& [name, result] : runAll(cases)) {
    SCOPED_TRACE((serial ? "pty " : "tcp ") + name);
    const Cost& cost = streamFaults().at(name);
    expectTruth(result);
    ASSERT_GE(result.scans.size(), cases.at(name).scans) << result.status.last_error;
    for (const Came& came : result.scans) ASSERT_NO_FATAL_FAILURE(expectRoom(came.scan));
    EXPECT_LE(result.longestGap(), cost.gap + result.jitter);
    EXPECT_LE(result.status.counts.lost, cost.lost);
    EXPECT_TRUE(cost.counted(result.status.counts));
    EXPECT_TRUE(cost.told.empty() || result.tells(cost.told));
  }
}

}  // namespace

/// One bad frame costs one scan, a sensor that was away is back in 0.6 s, and nothing false is ever published.
TEST(Driver, BearsEveryFaultOfAStream) {
  for (const bool serial : {false, true}) expectCosts(serial);
}

/// RS-232: at power-up SCIP 1.1 at 19200 baud, and what comes at another rate is garbage.
TEST(Driver, FindsAColdSensorAtItsRate) {
  const std::map<std::string, double> away{{"strict-baud", 0},
                                           {"reboot@5=0", 0},
                                           {"reboot@5=0.5", kAway},
                                           {"hangup@5=0.5", kAway},
                                           {"stall@5", 0}};
  Cases cases;
  for (const auto& [fault, time] : away) cases[fault] = {{"strict-baud", fault}, true, "urg_04lx"};
  for (const auto& [name, result] : runAll(cases)) {
    SCOPED_TRACE(name);
    expectTruth(result);
    ASSERT_GE(result.scans.size(), cases.at(name).scans) << result.status.last_error;
    for (const Came& came : result.scans) ASSERT_NO_FATAL_FAILURE(expectRoom(came.scan));
    EXPECT_LE(result.longestGap(), away.at(name) + kRecovery + result.jitter);
    EXPECT_EQ(result.status.device.baud, 115200);
  }
}

/// What cannot work is told, without a spin, a hang or a scan.
TEST(Driver, TellsWhySensorsRefuse) {
  struct Refusal {
    l::State state;
    std::string told;
  };
  using l::State;
  const std::map<std::string, Refusal> refusals{
      {"bm01", {State::kRefused, "LASER_NO_LIGHT: BM is answered by status 01"}},
      {"md0e", {State::kRefused, "LASER_REFUSED: MD0044072501000 is answered by status 0E"}},
      {"pp-ares0", {State::kRefused, "LASER_BAD_PP: the sensor says what cannot be: PP: ARES"}},
      {"pp-crossed", {State::kRefused, "LASER_BAD_PP: the sensor says what cannot be: PP: AMIN 725"}},
      {"blackhole", {State::kConnecting, "LASER_NO_PORT"}},
      {"close-on-accept", {State::kConnecting, "LASER_CLOSED"}},
      {"rst-after-cmd", {State::kConnecting, "LASER_CLOSED"}}};
  Cases cases;
  for (const auto& [fault, refusal] : refusals) cases[fault] = {{fault}, false, "urg_04lx_ug01", 1, 1.0};
  for (const auto& [name, result] : runAll(cases)) {
    SCOPED_TRACE(name);
    expectTruth(result);
    EXPECT_EQ(result.scans.size(), 0U);
    EXPECT_EQ(result.status.state, refusals.at(name).state) << l::name(result.status.state);
    EXPECT_TRUE(result.tells(refusals.at(name).told)) << result.status.last_error;
    EXPECT_GE(result.status.counts.attempts, 2U);
    EXPECT_LE(result.status.counts.attempts, 11U);
  }
}

TEST(Driver, AddsLittleLatency) {
  constexpr std::size_t kScans = 40;
  Sensor sensor({{}, true, "utm_30lx"});
  Watched watched(sensor.settings());
  std::vector<double> latencies;
  for (std::uint64_t scan = 1; scan <= kScans; ++scan) {
    ASSERT_TRUE(watched.awaitStatus([=](const l::Status& s) { return s.counts.scans >= scan; }, kLong));
    latencies.push_back(watched.driver().status().latency);
  }
  std::sort(latencies.begin(), latencies.end());
  EXPECT_LT(latencies[kScans / 2], 1e-3);
  EXPECT_LT(watched.stop().cpu, 0.08);  // 40 scans of 1081 beams a second
}

TEST(Driver, PublishesCodesAsNoMeasurement) {
  for (const auto& [name, result] : runAll({{"zeros", {{"zeros"}, false, "urg_04lx_ug01", 2}},
                                            {"codes", {{"codes"}, false, "urg_04lx_ug01", 2}}})) {
    ASSERT_GE(result.scans.size(), 2U) << name;
    for (const float range : result.scans[1].scan.ranges) {
      EXPECT_TRUE(std::isnan(range) || std::isinf(range)) << name << " " << range;
    }
  }
}

TEST(Driver, SendsIntensitiesWhereThereAreAny) {
  const auto wanted = [](l::DriverSettings& settings) { settings.live.intensity = true; };
  const auto results = runAll({{"has", {{}, false, "utm_30lx", 5, kLong, wanted}},
                               {"has none", {{"no-me"}, false, "utm_30lx", 5, kLong, wanted}}});
  const Result& has = results.at("has");
  ASSERT_GE(has.scans.size(), 5U) << has.status.last_error;
  EXPECT_TRUE(has.status.intensity);
  for (const Came& came : has.scans) {
    expectRoom(came.scan);
    ASSERT_EQ(came.scan.intensities.size(), came.scan.ranges.size());
    for (std::size_t i = 0; i < came.scan.intensities.size(); ++i) {
      ASSERT_EQ(came.scan.intensities[i], 100.0F + static_cast<float>(i));
    }
  }
  const Result& none = results.at("has none");
  ASSERT_GE(none.scans.size(), 5U) << none.status.last_error;
  EXPECT_FALSE(none.status.intensity);
  EXPECT_TRUE(none.scans.back().scan.intensities.empty());
  EXPECT_TRUE(none.tells("LASER_NO_INTENSITY: ME"));
}

TEST(Driver, ChangesTheWindowLive) {
  Sensor sensor({{}, false, "utm_30lx"});
  Watched watched(sensor.settings());
  ASSERT_TRUE(watched.await(3, kLong));
  EXPECT_THROW(watched.driver().reconfigure({2.5, 2.6, 1, 0, false}), std::invalid_argument);
  EXPECT_THROW(watched.driver().reconfigure({0.5, 0.1, 1, 0, false}), std::invalid_argument);
  watched.driver().reconfigure({-0.5, 1.0, 3, 1, false});
  const double period = 0.05;
  EXPECT_TRUE(watched.awaitStatus(
      [&](const l::Status& status) { return std::abs(status.scan_period - period) < 1e-9; }, 1));
  const std::uint64_t before = watched.driver().status().counts.scans;
  ASSERT_TRUE(watched.await(before + 4, kLong));
  const Result result = watched.stop();
  const l::Scan& last = result.scans.back().scan;
  EXPECT_NEAR(last.angle_increment, 3 * 2 * M_PI / 1440, 1e-9);
  EXPECT_GE(last.angle_min, -0.5);
  EXPECT_LE(last.angle_max, 1.0);
  EXPECT_NEAR(last.scan_time, period, 1e-9);
  EXPECT_EQ(result.status.counts.reconnects, 0U);
  EXPECT_EQ(result.status.counts.lost, 0U);
  EXPECT_LT(result.longestGap(), kRecovery);
}

TEST(Driver, BeginsAnewWhenTold) {
  Sensor sensor({{}, true, "utm_30lx"});
  Watched watched(sensor.settings());
  ASSERT_TRUE(watched.await(2, kLong));
  watched.driver().restart();
  EXPECT_TRUE(watched.awaitStatus([](const l::Status& status) { return status.counts.reconnects == 1; }, 1));
  const std::uint64_t before = watched.driver().status().counts.scans;
  EXPECT_TRUE(watched.await(before + 2, kLong));
}

TEST(Driver, LeavesAPortToItsOwner) {
  Sensor sensor({{}, true, "utm_30lx"});
  auto first = std::make_unique<Watched>(sensor.settings());
  ASSERT_TRUE(first->await(2, kLong));
  Watched second(sensor.settings());
  EXPECT_TRUE(second.awaitStatus(
      [](const l::Status& status) { return status.last_error.find("LASER_IN_USE") == 0; }, kLong));
  const std::uint64_t before = first->driver().status().counts.scans;
  EXPECT_TRUE(first->await(before + 5, kLong));
  EXPECT_EQ(first->driver().status().counts.lost, 0U);
  EXPECT_EQ(second.driver().status().counts.scans, 0U);
  first.reset();
  EXPECT_TRUE(second.await(2, kLong));
}

TEST(Driver, AsksTheClockWhenTold) {
  const auto result = run(
      {{}, false, "utm_30lx", 3, kLong, [](l::DriverSettings& settings) { settings.calibrate_time = true; }});
  ASSERT_GE(result.scans.size(), 3U) << result.status.last_error;
  EXPECT_TRUE(result.status.clock.calibrated);
  EXPECT_FALSE(result.tells("LASER_NO_CALIBRATION"));
}

/// The simulator has been paused: the sensor's time stands, and so does the host's.
TEST(Driver, WaitsWhileTimeStands) {
  Sensor sensor({{"stall@3"}});
  std::atomic<bool> stands{true};
  std::atomic<std::uint64_t> scans{0};
  l::Driver driver(
      sensor.settings(), [&](const l::Scan&) { ++scans; },
      [&] { return stands ? 100.0 : kurumaisu::steadyTime(); }, [](const l::Report&) {});
  driver.start();
  const auto await = [&](std::uint64_t count, double seconds) {
    const double until = kurumaisu::steadyTime() + seconds;
    while (scans < count && kurumaisu::steadyTime() < until)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    return scans >= count;
  };
  ASSERT_TRUE(await(2, kLong));
  EXPECT_FALSE(await(4, 1.0));  // longer than it takes for a sensor to be stale
  EXPECT_EQ(driver.status().counts.reconnects, 0U);
  stands = false;
  EXPECT_TRUE(await(4, kLong));
}

TEST(Driver, RefusesSettingsThatCannotBe) {
  const Sensor sensor({{}, false, "utm_30lx"});
  const auto problem = [&](const std::function<void(l::DriverSettings&)>& change) -> std::string {
    l::DriverSettings settings = sensor.settings();
    change(settings);
    try {
      l::Driver(
          settings, [](const l::Scan&) {}, kurumaisu::steadyTime, [](const l::Report&) {});
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "nothing";
  };
  EXPECT_EQ(problem([](auto&) {}), "nothing");
  EXPECT_EQ(problem([](auto& s) { s.serial_port = "/dev/ttyACM0"; }).find("either serial_port or ip_address"),
            0U);
  EXPECT_EQ(problem([](auto& s) { s.ip_address.clear(); }).find("either serial_port or ip_address"), 0U);
  EXPECT_EQ(problem([](auto& s) { s.ip_port = 0; }).find("ip_port"), 0U);
  EXPECT_EQ(problem([](auto& s) { s.stale_timeout = 0; }).find("stale_timeout"), 0U);
  EXPECT_EQ(problem([](auto& s) { s.retry_max = 0; }).find("retry_max"), 0U);
  EXPECT_EQ(problem([](auto& s) { s.live.cluster = 0; }).find("cluster"), 0U);
  EXPECT_EQ(problem([](auto& s) { s.live.skip = 10; }).find("skip"), 0U);
  EXPECT_EQ(problem([](auto& s) {
              s.ip_address.clear();
              s.serial_port = "/dev/ttyACM0";
              s.serial_baud = 9600;
            }).find("serial_baud"),
            0U);
}

/// The window of one sensor may lie outside what another sees.
TEST(Driver, WaitsForSettingsThatFitTheSensor) {
  Sensor sensor({{}, false, "utm_30lx"});
  l::DriverSettings settings = sensor.settings();
  settings.live.angle_min = 3.0;
  Watched watched(settings);
  ASSERT_TRUE(watched.awaitStatus(
      [](const l::Status& status) { return status.state == l::State::kMisconfigured; }, kLong));
  EXPECT_EQ(watched.driver().status().last_error.find("LASER_SETTINGS: angle_min"), 0U);
  watched.driver().reconfigure({-1, 1, 1, 0, false});
  EXPECT_TRUE(watched.await(2, kLong));
}

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
