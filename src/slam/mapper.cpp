// SPDX-License-Identifier: BSD-3-Clause
#include "slam/mapper.h"

#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>

#include "slam/filter.h"
#include "slam/matcher.h"
#include "slam/pose.h"

namespace kurumaisu {

namespace {

/// How fast odometry goes wrong: its scale, drift and lag all show as a rate that changes slowly against the
/// scans. Uncorrected, the bend it leaves in every de-skewed scan adds up: 0.07 degrees a scan are 90 degrees
/// an hour.
class Slip {
 public:
  explicit Slip(double gain) : gain_(gain) {}

  /// What odometry says of a stretch of time [s], corrected.
  Pose2D corrected(const Pose2D& motion, double duration) const {
    return {motion.x + rate_.x * duration, motion.y + rate_.y * duration,
            motion.theta + rate_.theta * duration};
  }

  void learn(const Pose2D& matched, const Pose2D& odometry, double duration) {
    rate_.x += gain_ * ((matched.x - odometry.x) / duration - rate_.x);
    rate_.y += gain_ * ((matched.y - odometry.y) / duration - rate_.y);
    rate_.theta += gain_ * ((matched.theta - odometry.theta) / duration - rate_.theta);
  }

 private:
  double gain_;
  Pose2D rate_{0, 0, 0};  ///< [m/s, m/s, rad/s] in the base's frame
};

}  // namespace

class Mapper::Impl {
 public:
  Impl(const MapperSettings& settings, std::uint32_t seed)
      : settings_(settings), matcher_(settings.match), slip_(settings.slip_gain), seed_(seed) {}

  Estimate add(const Scan& raw, const Pose2D& start, const Pose2D& end) {
    validate(raw);
    if (!steps_.empty() && !(raw.stamp > steps_.back().stamp)) {
      throw std::invalid_argument("a scan of " + std::to_string(raw.stamp) + " s after one of " +
                                  std::to_string(steps_.back().stamp) + " s");
    }
    for (const double value : {start.x, start.y, start.theta, end.x, end.y, end.theta, raw.stamp}) {
      if (!std::isfinite(value)) throw std::invalid_argument("odometry and stamp must be finite");
    }
    const bool first = steps_.empty();
    const Pose2D motion = first ? start : between(odom_, start);
    const double duration = first ? 0 : raw.stamp - steps_.back().stamp;
    const double sweep = raw.fan.time_increment * static_cast<double>(raw.ranges.size() - 1);
    const Scan scan = deskew(raw, slip_.corrected(between(start, end), sweep));
    const auto match = matcher_.add(scan, slip_.corrected(motion, duration));
    if (!first) slip_.learn(between(steps_.back().matched, match.pose), motion, duration);
    odom_ = start;
    steps_.push_back({raw.stamp, match.pose, false});
    const bool insert =
        first || reached(inserted_, match.pose, settings_.insert_distance, settings_.insert_angle);
    const bool localise =
        insert || reached(localised_, match.pose, settings_.localise_distance, settings_.localise_angle);
    if (first) {
      MapperSettings limited = settings_;
      limited.range = std::fmin(settings_.range, raw.fan.range_max);
      filter_ = std::make_unique<Filter>(limited, seed_, match.pose);
    }
    if (localise && !first) filter_->localise(scan, between(localised_, match.pose));
    if (localise) localised_ = match.pose;
    if (insert) {
      filter_->insert(scan);
      inserted_ = match.pose;
    }
    steps_.back().localised = localise;
    return {compose(filter_->bestPose(), between(localised_, match.pose)), filter_->covariance(), localise,
            insert};
  }

  std::vector<StampedPose> trajectory() const {
    std::vector<StampedPose> out;
    if (steps_.empty()) return out;
    const std::vector<Pose2D> path = filter_->bestPath();
    std::size_t node = 0;
    std::size_t begin = 0;  // step of the node
    for (std::size_t i = 1; i <= steps_.size(); ++i) {
      if (i < steps_.size() && !steps_[i].localised) continue;
      appendStretch(begin, i, path, node, out);
      begin = i;
      ++node;
    }
    return out;
  }

  OccupancyGrid grid() const {
    return filter_ ? filter_->grid() : OccupancyGrid{settings_.resolution, 0, 0, 0, 0, {}};
  }

 private:
  struct Step {
    double stamp;
    Pose2D matched;
    bool localised;  ///< the filter's paths have a node here
  };

  static bool reached(const Pose2D& from, const Pose2D& to, double distance, double angle) {
    const Pose2D way = between(from, to);
    return std::hypot(way.x, way.y) > distance || std::abs(way.theta) > angle;
  }

  /// Steps begin to end - 1 between two nodes: matched motion, with what the filter adds over the whole
  /// stretch spread over time, so that the path has no jumps.
  void appendStretch(std::size_t begin, std::size_t end, const std::vector<Pose2D>& path, std::size_t node,
                     std::vector<StampedPose>& out) const {
    const Step& from = steps_[begin];
    Pose2D gap{0, 0, 0};
    double duration = 1;
    if (end < steps_.size()) {
      gap = between(compose(path[node], between(from.matched, steps_[end].matched)), path[node + 1]);
      gap.theta = wrapAngle(gap.theta);
      duration = steps_[end].stamp - from.stamp;
    }
    for (std::size_t i = begin; i < end; ++i) {
      const Pose2D pose = compose(path[node], between(from.matched, steps_[i].matched));
      out.push_back({steps_[i].stamp, compose(pose, part(gap, (steps_[i].stamp - from.stamp) / duration))});
    }
  }

  MapperSettings settings_;
  Matcher matcher_;
  Slip slip_;
  std::uint32_t seed_;
  std::unique_ptr<Filter> filter_;  ///< from the first scan on, whose laser says how far it sees
  Pose2D odom_{0, 0, 0};
  Pose2D localised_{0, 0, 0};
  Pose2D inserted_{0, 0, 0};
  std::vector<Step> steps_;
};

Mapper::Mapper(const MapperSettings& settings, std::uint32_t seed)
    : impl_(std::make_unique<Impl>(settings, seed)) {}
Mapper::~Mapper() = default;
Mapper::Mapper(Mapper&&) noexcept = default;
Mapper& Mapper::operator=(Mapper&&) noexcept = default;

Mapper::Estimate Mapper::add(const Scan& scan, const Pose2D& start, const Pose2D& end) {
  return impl_->add(scan, start, end);
}
std::vector<StampedPose> Mapper::trajectory() const { return impl_->trajectory(); }
OccupancyGrid Mapper::grid() const { return impl_->grid(); }

}  // namespace kurumaisu
