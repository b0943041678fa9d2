// SPDX-License-Identifier: BSD-3-Clause
#include "slam/nodes/scan_feed.h"

#include <ctime>
#include <sstream>
#include <stdexcept>

namespace kurumaisu {
namespace {

constexpr double kSlowWarningPeriod = 5.0;  // [s] of throttled warnings
constexpr double kWorkLimit = 0.1;          // [s] of work in a row before scans that wait are skipped
constexpr std::size_t kQueue = 100;         // scans that may wait
// Old scans alone, so many and for so long [s], are no mistake: time began anew. Beside others they are of another clock.
constexpr int kSeveral = 3;
constexpr double kOldFor = 2.0;

// Apart, because the macro counts as a handful of branches.
void warnSlow(const std::string& prefix, std::uint64_t skipped) {
  ROS_WARN_THROTTLE(kSlowWarningPeriod, "%s_TOO_SLOW: scan: skipped, %lu so far", prefix.c_str(), skipped);
}

std::string ageOf(const ros::Time& stamp, const ros::Time& last) {
  std::ostringstream text;
  text.precision(15);
  text << "stamp " << stamp.toSec() << " s, " << secondsFrom(stamp, last) << " s older than the last one";
  return text.str();
}

}  // namespace

ScanFeed::ScanFeed(ros::NodeHandle& nh, FeedSettings settings, Use use, Reset reset)
    : settings_(std::move(settings)),
      use_(std::move(use)),
      reset_(std::move(reset)),
      transforms_(buffer_, settings_.prefix),
      queue_(buffer_, settings_.frames, settings_.error, settings_.prefix, kQueue),
      scan_(nh.subscribe("scan", kQueue, &ScanFeed::onScan, this)) {}

void ScanFeed::onScan(const sensor_msgs::LaserScan::ConstPtr& scan) try {
  came_ = ros::SteadyTime::now();
  frame_ = frameOf(scan->header.frame_id);
  requireScan(*scan, ros::Time::now());
  if (isOld(scan->header.stamp)) return;
  if (paused_ || came_in_all_++ % settings_.every != 0) return;
  queue_.push(scan);
} catch (const std::invalid_argument& error) {
  queue_.refuse(error.what());
}

/// Whether a scan is to be dropped, because it is older than what has been used.
bool ScanFeed::isOld(const ros::Time& stamp) {
  if (secondsFrom(stamp, last_scan_) <= kTimeJump) {
    old_ = 0;
    return false;
  }
  lookAtClock();
  if (last_scan_.isZero()) return false;
  const ros::SteadyTime now = ros::SteadyTime::now();
  if (old_++ == 0) old_since_ = now;
  if (old_ >= kSeveral && (now - old_since_).toSec() >= kOldFor) {
    begin("all scans have been older than the last one for a while");
    return false;
  }
  queue_.refuseOld(ageOf(stamp, last_scan_));
  return true;
}

/// Begins anew if it was set back. It may be, without a word on /clock, before the scans say so.
void ScanFeed::lookAtClock() {
  const ros::Time now = ros::Time::now();
  if (secondsFrom(now, last_clock_) > kTimeJump) begin("time ran backwards");
  if (now != last_clock_) ticked_ = ros::SteadyTime::now();
  last_clock_ = now;
}

void ScanFeed::work() {
  lookAtClock();
  const ros::SteadyTime start = ros::SteadyTime::now();
  while (ros::ok()) {
    const auto ready = queue_.next();
    if (!ready) return;
    const bool is_slow = (ros::SteadyTime::now() - start).toSec() > kWorkLimit;
    if (is_slow && queue_.size() >= static_cast<std::size_t>(settings_.backlog)) {
      warnSlow(settings_.prefix, ++skipped_);
    } else {
      take(*ready);
    }
  }
}

void ScanFeed::take(const ScanQueue::Ready& ready) try {
  taken_ = ros::SteadyTime::now();
  if (!last_scan_.isZero() && ready.stamp <= last_scan_)
    return queue_.refuseOld(ageOf(ready.stamp, last_scan_));
  last_scan_ = ready.stamp;
  const std::clock_t start = std::clock();
  use_(ready);
  seconds_ += static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  ++used_;
  came_ = ros::SteadyTime::now();  // who works does not hear
} catch (const std::invalid_argument& error) {
  queue_.refuse(error.what());
}

void ScanFeed::pause(bool paused) {
  paused_ = paused;
  if (paused) queue_.forgetAfter(ros::Time());
  taken_ = ros::SteadyTime::now();
}

std::string ScanFeed::missing(double since) const {
  const bool waiting = silence() < since && (ros::SteadyTime::now() - taken_).toSec() > since;
  if (!waiting || paused_) return "";
  const auto& [odom, base, deadline] = settings_.frames;
  if (!buffer_.canTransform(odom, base, ros::Time())) return "no odometry: tf has no " + odom + " -> " + base;
  if (!buffer_.canTransform(base, frame_, ros::Time()))
    return "the mounting of the laser is unknown: tf has no " + base + " -> " + frame_;
  return "none is used; the last dropped: " + queue_.reason();
}

std::string ScanFeed::clockProblem(double since) const {
  const bool stands = ros::Time::isSimTime() && (ros::SteadyTime::now() - ticked_).toSec() > since;
  if (!stands) return "";
  if (last_clock_.isZero()) return "/use_sim_time is true, but nothing comes on /clock";
  return silence() < since ? "/use_sim_time is true, and scans come, but nothing on /clock"
                           : "";  // else a pause
}

void ScanFeed::begin(const char* why) {
  ROS_WARN("%s_TIME_RESET: %s: it restarts", settings_.prefix.c_str(), why);
  buffer_.clear();
  queue_.forgetAfter(later(ros::Time::now(), kTimeJump));
  last_scan_ = ros::Time();
  old_ = 0;
  reset_(why);
}

}  // namespace kurumaisu
