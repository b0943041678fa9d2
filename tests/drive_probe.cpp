// SPDX-License-Identifier: BSD-3-Clause
// drive_probe TOPIC RATE SECONDS: commands a speed that goes up and down a little at so many Hz, and prints the seconds
// from each command's publishing until a voltage that follows it has come; -1 where the next command came first.
#include <geometry_msgs/Twist.h>
#include <kurumaisu/Voltages.h>
#include <ros/ros.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace {

using Clock = std::chrono::steady_clock;

constexpr double kSpeed = 0.1;     // [m/s]
constexpr double kStep = 0.005;    // [m/s] up and down
constexpr double kMoved = 1.0e-6;  // [m/s] is an answer: limits may keep it from going all the way at once
constexpr double kSettling = 2.0;  // [s] that do not count: connections, and the ramp up to the speed

class Probe {
 public:
  explicit Probe(const std::string& topic) {
    publisher_ = nh_.advertise<geometry_msgs::Twist>(topic, 1);
    subscriber_ =
        nh_.subscribe("voltages", 100, &Probe::onVoltages, this, ros::TransportHints().tcpNoDelay());
  }

  void say(double v) {
    geometry_msgs::Twist twist;
    twist.linear.x = v;
    {
      const std::lock_guard<std::mutex> guard(mutex_);
      if (asked_) latencies_.push_back(-1);
      asked_ = Clock::now();
      up_ = v > kSpeed;
    }
    publisher_.publish(twist);
  }

  void rest() { publisher_.publish(geometry_msgs::Twist()); }

  void forget() {
    const std::lock_guard<std::mutex> guard(mutex_);
    latencies_.clear();
    asked_.reset();
  }

  std::vector<double> latencies() {
    const std::lock_guard<std::mutex> guard(mutex_);
    return latencies_;
  }

 private:
  void onVoltages(const kurumaisu::Voltages& voltages) {
    const Clock::time_point now = Clock::now();
    const std::lock_guard<std::mutex> guard(mutex_);
    const double moved = voltages.v - last_;
    last_ = voltages.v;
    if (!asked_ || !(up_ ? moved > kMoved : moved < -kMoved)) return;
    latencies_.push_back(std::chrono::duration<double>(now - *asked_).count());
    asked_.reset();
  }

  ros::NodeHandle nh_;
  ros::Publisher publisher_;
  ros::Subscriber subscriber_;
  std::mutex mutex_;
  std::optional<Clock::time_point> asked_;
  bool up_ = false;
  double last_ = 0;
  std::vector<double> latencies_;
};

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "drive_probe");
  if (argc != 4) {
    std::fprintf(stderr, "usage: drive_probe TOPIC RATE SECONDS\n");
    return 2;
  }
  Probe probe(argv[1]);
  ros::AsyncSpinner spinner(1);
  spinner.start();
  const auto period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / std::atof(argv[2])));
  const auto length =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(std::atof(argv[3])));
  const auto settling = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(kSettling));
  // An input obeys only after it has said zero.
  for (const auto end = Clock::now() + settling / 2; Clock::now() < end;) {
    probe.rest();
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  std::puts("ready");
  std::fflush(stdout);
  bool settled = false;
  Clock::time_point next = Clock::now();
  const Clock::time_point begin = next + settling, end = begin + length;
  for (int i = 0; next < end && ros::ok(); ++i, next += period) {
    std::this_thread::sleep_until(next);
    if (!settled && next >= begin) {
      settled = true;
      probe.forget();
    }
    probe.say(kSpeed + (i % 2 == 0 ? kStep : -kStep));
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  probe.rest();
  for (const double latency : probe.latencies()) std::printf("%.9f\n", latency);
  return 0;
}
