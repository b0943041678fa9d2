// SPDX-License-Identifier: BSD-3-Clause
// The driver against the virtual sensor, with every fault that it has.
#include <gtest/gtest.h>
#include <stdlib.h>
#include <time.h>

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

constexpr double kLong = 6;  // [s] after which a test gives up waiting

/// A case of the table: what the sensor does, and until when it is watched.
struct Case {
  std::string name;
  std::vector<std::string> faults;
  bool serial = false;
  std::string sensor = "urg_04lx_ug01";
  std::uint64_t scans = 10;  // until so many
  double at_most = kLong;    // [s] or so long
  std::function<void(l::DriverSettings&)> change = [](l::DriverSettings&) {};
};

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

/// A virtual sensor in a square room.
class Sensor {
 public:
  explicit Sensor(const Case& what) {
    std::vector<v::Fault> faults;
    for (const std::string& text : what.faults) faults.push_back(v::fault(text));
    std::unique_ptr<v::Endpoint> endpoint;
    if (what.serial) {
      endpoint = std::make_unique<v::Pty>(folder_.link());
    } else {
      endpoint = std::make_unique<v::Tcp>("127.0.0.1", 0);
    }
    const v::Model model = v::modelOf(SOURCE_DIR "/launch/urg/" + what.sensor + ".yaml");
    const v::Device device(model, {}, {}, 0);
    server_ =
        std::make_unique<v::Server>(model, faults, v::Clock{}, std::move(endpoint), v::Server::Options{});
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
    for (const double until = l::steadyTime() + seconds; l::steadyTime() < until;) {
      if (holds(driver_.status())) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return false;
  }

  Result stop() {
    const l::Status status = driver_.status();
    const double start = l::steadyTime();
    driver_.stop();
    const double end = l::steadyTime();
    Result result = result_;
    result.status = status;
    result.seconds = start - start_;
    result.cpu = cpu_ / (start - start_);
    result.stopping = end - start;
    return result;
  }

 private:
  void take(const l::Scan& scan) {
    const std::lock_guard<std::mutex> guard(mutex_);
    result_.scans.push_back({l::steadyTime(), scan});
    came_.notify_all();
  }

  /// Called by the driver's thread all the time, so it knows what that thread has used.
  double now() {
    timespec used{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
    cpu_ = static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
    return l::steadyTime();
  }

  const double start_ = l::steadyTime();
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

/// All of them at once: they mostly wait.
std::map<std::string, Result> runAll(const std::vector<Case>& cases) {
  std::map<std::string, Result> results;
  for (const Case& what : cases) results[what.name];
  std::vector<std::thread> threads;
  for (const Case& what : cases) threads.emplace_back([&] { results[what.name] = run(what); });
  for (std::thread& thread : threads) thread.join();
  return results;
}

void print(const std::map<std::string, Result>& results) {
  std::printf("%-22s %5s %7s %5s %5s %5s %5s %5s %5s %6s %6s  %s\n", "fault", "scans", "gap [s]", "lost",
              "sums", "unrd", "damgd", "dup", "recon", "cpu %", "lat ms", "last error");
  for (const auto& [name, result] : results) {
    const l::Counts& counts = result.status.counts;
    std::printf("%-22s %5zu %7.3f %5llu %5llu %5llu %5llu %5llu %5llu %6.2f %6.3f  %s\n", name.c_str(),
                result.scans.size(), result.longestGap(), (unsigned long long)counts.lost,
                (unsigned long long)counts.bad_sums, (unsigned long long)counts.unreadable,
                (unsigned long long)counts.damaged, (unsigned long long)counts.duplicates,
                (unsigned long long)counts.reconnects, 100 * result.cpu, 1e3 * result.status.latency,
                result.status.last_error.substr(0, 70).c_str());
  }
}

}  // namespace

TEST(Explore, All) {
  std::vector<Case> cases;
  for (const bool serial : {false, true}) {
    for (const char* f : {"",        "corrupt@5",    "trunc@5",      "noend@5",     "badlf@1", "badlf@5",
                          "garbage", "dup@5",        "err50@5",      "err98@5",     "stall@5", "close@5",
                          "rst@5",   "hangup@5=0.5", "reboot@5=0.5", "t0=16776716", "dribble", "vv-badsum",
                          "zeros",   "codes",        "no-me",        "scip1"}) {
      Case c;
      c.name = std::string(serial ? "pty " : "tcp ") + f;
      if (*f) c.faults = {f};
      c.serial = serial;
      cases.push_back(c);
    }
  }
  Case cold{"pty cold strict", {"strict-baud"}, true, "urg_04lx"};
  cases.push_back(cold);
  Case reboot{"pty reboot strict", {"strict-baud", "reboot@5=0.5"}, true, "urg_04lx"};
  cases.push_back(reboot);
  Case reboot0{"pty reboot0 strict", {"strict-baud", "reboot@5=0"}, true, "urg_04lx"};
  cases.push_back(reboot0);
  for (const char* f :
       {"bm01", "md0e", "pp-ares0", "pp-crossed", "blackhole", "close-on-accept", "rst-after-cmd"}) {
    Case c;
    c.name = f;
    c.faults = {f};
    c.at_most = 2;
    cases.push_back(c);
  }
  print(runAll(cases));
}

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
