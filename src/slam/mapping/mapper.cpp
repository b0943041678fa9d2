// SPDX-License-Identifier: BSD-3-Clause
#include "slam/mapping/mapper.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "slam/basics/percent.h"
#include "slam/basics/pose.h"
#include "slam/localization/motion.h"
#include "slam/mapping/extent.h"
#include "slam/mapping/filter.h"
#include "slam/mapping/matcher.h"
#include "slam/mapping/slip.h"
#include "slam/mapping/start.h"

namespace kurumaisu {

namespace {

constexpr double kLeastFit = 0.6;  // share of the first scan's readings that a map to go on from must explain
constexpr int kFewestReadings = 3;       // fewer do not say where a scan was taken
constexpr double kOdometryPeriod = 0.1;  // [s] odometry may come in steps so far apart
constexpr double kMostDistance = 1.0;    // [m] deviation of the pose to go on from
constexpr double kMostAngle = 0.5;       // [rad]

Pose2D scaled(const Pose2D& rate, double duration) {
  return {rate.x * duration, rate.y * duration, rate.theta * duration};
}

Eigen::Matrix3d turned(const Eigen::Matrix3d& covariance, double angle) {
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  turn.topLeftCorner<2, 2>() << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  return turn * covariance * turn.transpose();
}

}  // namespace

class Mapper::Impl {
 public:
  Impl(const MapperSettings& settings, std::uint32_t seed)
      : settings_(settings), matcher_(settings.match), slip_(settings.slip_gain), seed_(seed) {}

  void resume(SavedMap map, const Gaussian& map_from_base) {
    if (!steps_.empty()) throw std::invalid_argument("a map can be continued only before the first scan");
    const auto& covariance = map_from_base.covariance;
    const bool sound = covariance(0, 0) > 0 && covariance(1, 1) > 0 && covariance(2, 2) > 0 &&
                       std::sqrt(std::fmax(covariance(0, 0), covariance(1, 1))) <= kMostDistance &&
                       std::sqrt(covariance(2, 2)) <= kMostAngle;
    if (!sound) throw std::invalid_argument("the start must be known to within 1 m and 0.5 rad");
    if (map.grid.cells.empty()) throw std::invalid_argument("the map to continue is empty");
    settings_.resolution = map.grid.resolution;
    Extent extent;
    extent.add(map.grid);
    extent.check(settings_);
    extent_ = extent;
    resumed_ = std::move(map);
    start_ = map_from_base;
  }

  Estimate add(const Scan& raw, const Pose2D& start, const Pose2D& end) {
    check(raw, start, end);
    if (steps_.empty()) return begin(raw, start, end);
    const double duration = raw.stamp - steps_.back().stamp;
    Pose2D motion = between(odom_, start);
    const bool jumped = isJump(motion, duration);
    if (jumped) motion = scaled(rate_, duration);  // as the chair went before
    const Scan scan = deskewed(raw, start, end);
    const auto match = matcher_.add(scan, jumped ? motion : slip_.corrected(motion, duration));
    const Pose2D matched = between(steps_.back().matched, match.pose);
    if (!jumped && match.found) slip_.learn(matched, motion, duration);
    rate_ = scaled(matched, 1 / duration);
    if (!match.found) doubt(match);
    odom_ = start;
    steps_.push_back({raw.stamp, match.pose, false});
    Estimate estimate = filter(scan, match.pose);
    estimate.jumped = jumped;
    estimate.blind = !match.found;
    return estimate;
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

  std::vector<UncertainPose> nodes() const {
    std::vector<UncertainPose> out;
    if (!filter_) return out;
    const auto path = filter_->bestPath();
    const auto covariances = filter_->pathCovariances();
    for (const Step& step : steps_) {
      if (step.localised) out.push_back({step.stamp, path[out.size()], covariances[out.size()]});
    }
    return out;
  }

  std::vector<Weighted> particles() const { return filter_ ? filter_->particles() : std::vector<Weighted>(); }

  double entropy() const { return filter_ ? filter_->entropy() : 0; }

  std::vector<KeyScan> keys() const {
    std::vector<KeyScan> out = resumed_ ? resumed_->keys : std::vector<KeyScan>();
    const auto all = nodes();
    for (const auto& [node, scan] : keys_) out.push_back({all[node].pose, all[node].covariance, scan});
    return out;
  }

  OccupancyGrid grid() const {
    if (filter_) return filter_->grid();
    return resumed_ ? resumed_->grid : OccupancyGrid{settings_.resolution, 0, 0, 0, 0, {}};
  }

 private:
  struct Key {
    std::size_t node;
    Scan scan;
  };
  struct Step {
    double stamp;
    Pose2D matched;
    bool localised;  ///< the filter's paths have a node here
  };

  void check(const Scan& raw, const Pose2D& start, const Pose2D& end) const {
    validate(raw);
    if (!steps_.empty() && !(raw.stamp > steps_.back().stamp)) {
      throw std::invalid_argument("a scan of " + std::to_string(raw.stamp) + " s after one of " +
                                  std::to_string(steps_.back().stamp) + " s");
    }
    for (const double value : {start.x, start.y, start.theta, end.x, end.y, end.theta, raw.stamp}) {
      if (!std::isfinite(value)) throw std::invalid_argument("odometry and stamp must be finite");
    }
  }

  bool isJump(const Pose2D& motion, double duration) const {
    const double time = std::fmax(duration, kOdometryPeriod);
    return std::hypot(motion.x, motion.y) > settings_.jump_speed * time ||
           std::abs(motion.theta) > settings_.jump_turn * time;
  }

  /// A jump during the scan is none of the chair's motion either.
  Scan deskewed(const Scan& raw, const Pose2D& start, const Pose2D& end) const {
    const double sweep = raw.fan.time_increment * static_cast<double>(raw.ranges.size() - 1);
    const Pose2D motion = between(start, end);
    const Scan scan = withoutDropouts(raw, settings_.dropout_beams);
    if (isJump(motion, sweep)) return deskew(scan, scaled(rate_, sweep));
    return deskew(scan, slip_.corrected(motion, sweep));
  }

  Estimate begin(const Scan& raw, const Pose2D& start, const Pose2D& end) {
    const Scan scan = deskewed(raw, start, end);
    Gaussian at{start, Eigen::Matrix3d::Zero()};
    if (resumed_) at = placed(scan);
    const auto match = matcher_.add(scan, at.mean);
    MapperSettings limited = settings_;
    limited.range = std::fmin(settings_.range, raw.fan.range_max);
    filter_ = std::make_unique<Filter>(limited, seed_, match.pose);
    if (resumed_) filter_->resume(resumed_->grid, at);
    odom_ = start;
    localised_ = match.pose;
    localised_at_ = raw.stamp;
    steps_.push_back({raw.stamp, match.pose, true});
    const bool inserted = insert(scan, match.pose);
    return {filter_->bestPose(), filter_->covariance(), true, inserted, false, false, !inserted};
  }

  Gaussian placed(const Scan& scan) const {
    const Start found = findStart(resumed_->grid, scan, *start_, settings_);
    if (found.fit >= kLeastFit) return found.map_from_base;
    throw StartError("the map to continue explains " + percent(found.fit) +
                     " of the scan's readings at best near the pose given, less than " + percent(kLeastFit));
  }

  /// Odometry alone says where the chair is, as uncertain as the matcher holds it to be; at rest it is certain.
  void doubt(const Matcher::Match& match) {
    const Pose2D& before = steps_.back().matched;
    const Pose2D motion = between(before, match.pose);
    if (std::hypot(motion.x, motion.y) < 1e-3 && std::abs(motion.theta) < 1e-3) return;
    doubt_ = moved({before, doubt_}, {motion, match.covariance}).covariance;
  }

  /// Runs the filter, and lets the map grow, where it is time.
  Estimate filter(const Scan& scan, const Pose2D& matched) {
    const bool sees = std::count_if(scan.ranges.begin(), scan.ranges.end(),
                                    [](float range) { return std::isfinite(range); }) >= kFewestReadings;
    const bool grow = sees && reached(inserted_, matched, settings_.insert_distance, settings_.insert_angle);
    const bool late = settings_.localise_time > 0 && scan.stamp - localised_at_ > settings_.localise_time;
    const bool localise =
        sees &&
        (grow || late || reached(localised_, matched, settings_.localise_distance, settings_.localise_angle));
    bool inserted = false;
    if (localise) {
      filter_->localise(scan, between(localised_, matched), turned(doubt_, -localised_.theta));
      localised_ = matched;
      localised_at_ = scan.stamp;
      doubt_.setZero();
      steps_.back().localised = true;
    }
    if (grow) inserted = insert(scan, matched);
    std::array<double, 9> covariance = filter_->covariance();
    for (int i = 0; i < 9; ++i) covariance[i] += doubt_(i / 3, i % 3);
    return {compose(filter_->bestPose(), between(localised_, matched)),
            covariance,
            localise,
            inserted,
            false,
            false,
            grow && !inserted};
  }

  /// False: the map would be too large.
  bool insert(const Scan& scan, const Pose2D& matched) {
    Extent larger = extent_;
    larger.add(filter_->bestPose(), scan, settings_.range);
    inserted_ = matched;
    if (larger.cells(settings_.resolution) > settings_.most_cells) return false;
    extent_ = larger;
    filter_->insert(scan);
    std::size_t node = 0;
    for (const Step& step : steps_) node += step.localised ? 1 : 0;
    keys_.push_back({node - 1, scan});
    return true;
  }

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
  Pose2D rate_{0, 0, 0};  ///< of the chair, as it was last matched [m/s, m/s, rad/s]
  Pose2D localised_{0, 0, 0};
  double localised_at_ = 0;
  Pose2D inserted_{0, 0, 0};
  Eigen::Matrix3d doubt_ = Eigen::Matrix3d::Zero();  ///< of what odometry alone has said since
  Extent extent_;
  std::optional<SavedMap> resumed_;
  std::optional<Gaussian> start_;
  std::vector<Key> keys_;
  std::vector<Step> steps_;
};

Mapper::Mapper(const MapperSettings& settings, std::uint32_t seed)
    : impl_(std::make_unique<Impl>(settings, seed)) {}
Mapper::~Mapper() = default;
Mapper::Mapper(Mapper&&) noexcept = default;
Mapper& Mapper::operator=(Mapper&&) noexcept = default;

void Mapper::resume(SavedMap map, const Gaussian& map_from_base) {
  impl_->resume(std::move(map), map_from_base);
}
Mapper::Estimate Mapper::add(const Scan& scan, const Pose2D& start, const Pose2D& end) {
  return impl_->add(scan, start, end);
}
std::vector<StampedPose> Mapper::trajectory() const { return impl_->trajectory(); }
std::vector<UncertainPose> Mapper::nodes() const { return impl_->nodes(); }
std::vector<Weighted> Mapper::particles() const { return impl_->particles(); }
double Mapper::entropy() const { return impl_->entropy(); }
std::vector<KeyScan> Mapper::keys() const { return impl_->keys(); }
OccupancyGrid Mapper::grid() const { return impl_->grid(); }

}  // namespace kurumaisu
