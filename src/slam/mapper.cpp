// SPDX-License-Identifier: BSD-3-Clause
#include "slam/mapper.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include "slam/filter.h"
#include "slam/matcher.h"
#include "slam/pose.h"

namespace kurumaisu {

class Mapper::Impl {
 public:
  Impl(const MapperSettings& settings, std::uint32_t seed)
      : settings_(settings), matcher_(settings.match), filter_(settings, seed) {}

  Estimate add(const Scan& raw, const Pose2D& start, const Pose2D& end) {
    validate(raw);
    if (!steps_.empty() && !(raw.stamp > steps_.back().stamp)) {
      throw std::invalid_argument("a scan of " + std::to_string(raw.stamp) + " s after one of " +
                                  std::to_string(steps_.back().stamp) + " s");
    }
    const bool first = steps_.empty();
    const Scan scan = deskew(raw, between(start, end));
    const auto match = matcher_.add(scan, first ? start : between(odom_, start));
    odom_ = start;
    steps_.push_back({raw.stamp, match.pose, false});
    const bool insert =
        first || reached(inserted_, match.pose, settings_.insert_distance, settings_.insert_angle);
    const bool localise =
        insert || reached(localised_, match.pose, settings_.localise_distance, settings_.localise_angle);
    if (first) filter_.start(match.pose);
    if (localise && !first) filter_.localise(scan, between(localised_, match.pose));
    if (localise) localised_ = match.pose;
    if (insert) {
      filter_.insert(scan);
      inserted_ = match.pose;
    }
    steps_.back().localised = localise;
    return {compose(filter_.bestPose(), between(localised_, match.pose)), filter_.covariance(), localise,
            insert};
  }

  std::vector<StampedPose> trajectory() const {
    std::vector<StampedPose> out;
    if (steps_.empty()) return out;
    const std::vector<Pose2D> path = filter_.bestPath();
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

  OccupancyGrid grid() const { return filter_.grid(); }

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
  Filter filter_;
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
