// SPDX-License-Identifier: BSD-3-Clause
#include "slam/localization/localizer.h"

#include <Eigen/LU>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>

#include "slam/basics/pose.h"
#include "slam/localization/doubt.h"
#include "slam/localization/finder.h"
#include "slam/localization/places.h"
#include "slam/localization/vague.h"

namespace kurumaisu {
namespace {

constexpr int kRounds = 4;            // of the last alignment
constexpr double kNearby = 0.3;       // [m] around a doubted pose is searched first
constexpr double kNearbyTurn = 0.15;  // [rad]
constexpr double kSearchAgain = 3;    // times found_way after which a search that led to nothing is repeated
constexpr double kTurnPerWay = 0.5;   // [m/rad] a turn shows as much as so much way

void check(const Scan& scan, const Odometry& start, const Pose2D& end, const std::optional<Odometry>& last) {
  validate(scan);
  for (const double value :
       {start.pose.x, start.pose.y, start.pose.theta, end.x, end.y, end.theta, scan.stamp}) {
    if (!std::isfinite(value)) throw std::invalid_argument("odometry and stamp must be finite");
  }
  if (last && !(start.stamp > last->stamp)) {
    throw std::invalid_argument("a scan of " + std::to_string(start.stamp) + " s after one of " +
                                std::to_string(last->stamp) + " s");
  }
}

}  // namespace

class Localizer::Impl {
 public:
  Impl(const LocalizerSettings& settings, const Chair& chair, std::uint32_t seed, const OccupancyGrid& grid,
       const Pose2D& map_from_grid)
      : settings_(settings),
        process_(chair.process),
        doubt_(settings_.recovery),
        field_(grid, map_from_grid, settings.reading.max_distance),
        sensor_(field_, settings_.reading, chair.laser),
        particles_(settings_, seed),
        places_(sensor_, settings_.recovery),
        finder_(sensor_, settings_, process_) {}

  void setPose(const Gaussian& map_from_base) {
    settle(map_from_base);
    doubt_.clear();
    health_ = {};
  }

  void forget() {
    start(Knowledge::kLost);
    known_ = false;
  }

  void updateOnce() { once_ = true; }

  Estimate add(const Scan& scan, const Odometry& start, const Pose2D& end) {
    check(scan, start, end, last_);
    Pose2D sweep = between(start.pose, end);
    sweep.theta = wrapAngle(sweep.theta);
    const Beams beams = pick(scan, sweep, settings_.reading);
    if (!at_) at_ = start;
    const Gaussian motion = motionBetween(*at_, start, settings_.motion, process_);
    const double way = last_ ? wayOf(between(last_->pose, start.pose)) : 0;
    travelled_ += way;
    const bool blind = beams.beams.size() < kLeastReadings;
    blind_ = blind ? blind_ + way : 0;
    last_ = start;
    const bool moves = std::hypot(motion.mean.x, motion.mean.y) >= settings_.update_min_d ||
                       std::abs(motion.mean.theta) >= settings_.update_min_a;
    const bool update = moves || once_;
    Estimate estimate{moved(pose_, motion), knowledge_, 0, 0, 0, 0, update, blind};
    if (knowledge_ == Knowledge::kTracking) {
      track(beams, motion, update, estimate);
    } else if (knowledge_ == Knowledge::kLost) {
      lose(beams, estimate);
    } else {
      follow(beams, motion, update, estimate);
    }
    if (update) once_ = false;
    estimate.knowledge = told(estimate.map_from_base);
    estimate.map_from_base.covariance.topLeftCorner<2, 2>() += ofMap(field_) * Eigen::Matrix2d::Identity();
    if (estimate.knowledge == Knowledge::kAmbiguous) {
      blur(estimate.map_from_base.covariance, settings_.ambiguous_spread);
    }
    estimate.fit = health_.fast;
    estimate.fit_usual = health_.slow;
    return estimate;
  }

  std::vector<Weighted> particles() const {
    return knowledge_ == Knowledge::kTracking ? particles_.all() : places_.all();
  }

 private:
  static double wayOf(const Pose2D& motion) {
    return std::hypot(motion.x, motion.y) + kTurnPerWay * std::abs(wrapAngle(motion.theta));
  }

  void start(Knowledge knowledge) {
    knowledge_ = knowledge;
    places_ = Places(sensor_, settings_.recovery);
    finder_.reset();
    travelled_ = 0;
    verified_ = false;
  }

  /// At one place from now on.
  void settle(const Gaussian& pose) {
    particles_.reset(pose);
    pose_ = pose;
    at_ = last_;
    start(Knowledge::kTracking);
    once_ = true;
  }

  /// Particles that are spread wide do not know one place either, nor does who has seen nothing for long.
  Knowledge told(const Gaussian& pose) const {
    const double largest = std::sqrt(std::fmax(pose.covariance(0, 0), pose.covariance(1, 1)));
    const bool doubtful =
        largest > settings_.ambiguous_spread || doubt_.standing() || blind_ > settings_.recovery.found_way;
    return doubtful && knowledge_ == Knowledge::kTracking ? Knowledge::kAmbiguous : knowledge_;
  }

  void setBase(const Gaussian& pose) {
    pose_ = pose;
    at_ = last_;
  }

  void track(const Beams& beams, const Gaussian& motion, bool update, Estimate& estimate) {
    if (update) {
      const double power = settings_.reading.power;
      particles_.update(motion, [&](const Pose2D& pose) { return power * sensor_.weigh(beams, pose); });
      const auto all = particles_.all();
      estimate.particles = static_cast<int>(all.size());
      Gaussian mean = spread(all);
      mean.covariance.diagonal().array() += 1e-8;  // all particles may be one
      estimate.map_from_base = {sensor_.align(beams, mean.mean, mean.covariance.inverse(), kRounds).pose,
                                mean.covariance};
      setBase(estimate.map_from_base);
    }
    look(beams, estimate.map_from_base.mean);
    switch (doubt_.judge(health_, travelled_)) {
      case Doubt::Step::kNone:
        return;
      case Doubt::Step::kWiden:
        return widen(estimate.map_from_base);
      case Doubt::Step::kSearch:
        known_ = true;
        start(Knowledge::kLost);
        return lose(beams, estimate);
    }
  }

  void look(const Beams& beams, const Pose2D& map_from_base) {
    const Fit fit = sensor_.look(beams, map_from_base);
    if (fit.readings() >= static_cast<int>(kLeastReadings)) health_.take(fit.share(), settings_.recovery);
  }

  /// A doubted pose may be a little off only: that is tried first.
  void widen(Gaussian pose) {
    pose.covariance.diagonal() +=
        Eigen::Vector3d(kNearby * kNearby, kNearby * kNearby, kNearbyTurn * kNearbyTurn);
    settle(pose);
  }

  void lose(const Beams& beams, Estimate& estimate) {
    estimate.map_from_base.covariance = anywhere(field_);
    const auto doubted = known_ ? std::optional<Pose2D>(estimate.map_from_base.mean) : std::nullopt;
    const auto found = finder_.step(beams, *last_, doubted);
    estimate.searched = finder_.progress();
    if (!found || found->empty()) return;
    places_ = *found;
    knowledge_ = Knowledge::kAmbiguous;
    health_ = {};
    estimate.updated = true;
    show(estimate);
    estimate.map_from_base.covariance += around(pose_.mean, places_.all());
  }

  void follow(const Beams& beams, const Gaussian& motion, bool update, Estimate& estimate) {
    Gaussian best = moved(places_.best(), motion);
    if (update || finder_.busy()) {
      places_.update(motion, beams);
      show(estimate);
      best = places_.best();
    }
    if (finder_.busy() || travelled_ >= kSearchAgain * settings_.recovery.found_way) searchAgain(beams);
    look(beams, best.mean);
    decide(best, estimate);
    if (knowledge_ == Knowledge::kAmbiguous) {
      estimate.map_from_base.covariance += around(pose_.mean, places_.all());
    }
  }

  void searchAgain(const Beams& beams) {
    const auto found = finder_.step(beams, *last_, std::nullopt);
    if (!found) return;
    places_.merge(*found);
    verified_ = true;
    travelled_ = 0;
  }

  /// Where it was believed to be: it does not leap through the map before it is sure.
  void show(Estimate& estimate) {
    setBase(places_.shown());
    estimate.map_from_base = pose_;
    estimate.particles = static_cast<int>(places_.size());
  }

  /// One place is taken when it has held against all others over some way, those of a second search among them.
  void decide(const Gaussian& best, Estimate& estimate) {
    const auto& s = settings_.recovery;
    if (finder_.busy() || travelled_ < s.found_way) return;
    if (health_.doubtful(s)) {
      known_ = places_.hasDoubted();
      start(Knowledge::kLost);
      estimate.map_from_base.covariance = anywhere(field_);
    } else if (places_.odds() >= s.found_odds && places_.bestFit() >= s.found_fit) {
      if (!verified_) {
        travelled_ = kSearchAgain * s.found_way;  // now
      } else {
        Gaussian wide = best;
        wide.covariance.diagonal() += Eigen::Vector3d(0.01, 0.01, 0.0025);  // 0.1 m, 3 degrees
        setPose(wide);
        estimate.map_from_base = std::move(wide);
      }
    }
  }

  LocalizerSettings settings_;
  RateNoise process_;
  Health health_;
  Doubt doubt_;
  Field field_;
  Sensor sensor_;
  Particles particles_;
  Places places_;
  Finder finder_;
  Knowledge knowledge_ = Knowledge::kLost;
  Gaussian pose_{{0, 0, 0}, Eigen::Matrix3d::Zero()};  ///< at at_
  std::optional<Odometry> at_;                         ///< of the last update
  std::optional<Odometry> last_;                       ///< of the last scan
  bool known_ = false;                                 ///< there was a pose before the search
  bool verified_ = false;  ///< the places have held against those of a second search
  bool once_ = false;
  double blind_ = 0;      ///< driven since a scan had readings [m]
  double travelled_ = 0;  ///< since all places were in question [m]
};

Localizer::Localizer(const LocalizerSettings& settings, const Chair& chair, std::uint32_t seed,
                     const OccupancyGrid& grid, const Pose2D& map_from_grid)
    : impl_(std::make_unique<Impl>(settings, chair, seed, grid, map_from_grid)) {}
Localizer::~Localizer() = default;
Localizer::Localizer(Localizer&&) noexcept = default;
Localizer& Localizer::operator=(Localizer&&) noexcept = default;

void Localizer::setPose(const Gaussian& map_from_base) { impl_->setPose(map_from_base); }
void Localizer::forget() { impl_->forget(); }
void Localizer::updateOnce() { impl_->updateOnce(); }
Localizer::Estimate Localizer::add(const Scan& scan, const Odometry& start, const Pose2D& end) {
  return impl_->add(scan, start, end);
}
std::vector<Weighted> Localizer::particles() const { return impl_->particles(); }

}  // namespace kurumaisu
