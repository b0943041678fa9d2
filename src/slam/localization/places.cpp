// SPDX-License-Identifier: BSD-3-Clause
#include "slam/localization/places.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "slam/basics/pose.h"

namespace kurumaisu {
namespace {

constexpr double kHopeless = 20;    // nats behind the best
constexpr double kSame = 0.3;       // [m] places nearer than this
constexpr double kSameAngle = 0.2;  // [rad] and no more turned than this are one
constexpr double kHeadStart = 5;    // log-odds of the place that was believed
constexpr int kFirstRounds = 12;
constexpr int kPlaceRounds = 4;
constexpr double kFitGain = 0.3;  // share of a scan in the mean of a place's fit

}  // namespace

void Places::align(Place& place, const Beams& beams, int rounds) const {
  const Aligned found = sensor_->align(beams, place.pose.mean, place.pose.covariance.inverse(), rounds);
  place.pose = {found.pose, found.information.inverse()};
}

Places::Place Places::placeAt(const Pose2D& pose, const Beams& beams) const {
  Eigen::Matrix3d start = Eigen::Matrix3d::Zero();
  start.diagonal() << settings_->step * settings_->step, settings_->step * settings_->step,
      settings_->angle_step * settings_->angle_step;
  Place place{{pose, start}, 0, 0, false};
  align(place, beams, kFirstRounds);
  const Fit fit = sensor_->look(beams, place.pose.mean);
  place.fit = fit.share();
  place.log_weight = settings_->power * fit.log_likelihood;
  return place;
}

void Places::add(const std::vector<Pose2D>& poses, const Beams& beams) {
  for (const Pose2D& pose : poses) places_.push_back(placeAt(pose, beams));
  tidy();
}

void Places::addDoubted(const Pose2D& pose, const Beams& beams) {
  Place place = placeAt(pose, beams);
  place.log_weight += kHeadStart;
  place.doubted = true;
  places_.push_back(place);
  tidy();
}

void Places::update(const Gaussian& motion, const Beams& beams) {
  for (Place& place : places_) {
    place.pose = moved(place.pose, motion);
    align(place, beams, kPlaceRounds);
    const Fit fit = sensor_->look(beams, place.pose.mean);
    place.fit += kFitGain * (fit.share() - place.fit);
    place.log_weight += settings_->power * fit.log_likelihood;
  }
  tidy();
}

void Places::merge(const Places& others) {
  places_.insert(places_.end(), others.places_.begin(), others.places_.end());
  tidy();
}

void Places::tidy() {
  std::stable_sort(places_.begin(), places_.end(),
                   [](const Place& a, const Place& b) { return a.log_weight > b.log_weight; });
  std::vector<Place> kept;
  for (const Place& place : places_) {
    const bool hopeless = !kept.empty() && place.log_weight < kept.front().log_weight - kHopeless;
    const bool full = kept.size() >= static_cast<std::size_t>(settings_->places);
    if ((hopeless || full) && !place.doubted) continue;
    const auto same = [&place](const Place& other) {
      const Pose2D off = between(place.pose.mean, other.pose.mean);
      return std::hypot(off.x, off.y) < kSame && std::abs(wrapAngle(off.theta)) < kSameAngle;
    };
    const auto likelier = std::find_if(kept.begin(), kept.end(), same);
    if (likelier == kept.end()) {
      kept.push_back(place);
    } else if (place.doubted) {
      likelier->doubted = true;
    }
  }
  places_ = std::move(kept);
  const double best = places_.empty() ? 0 : places_.front().log_weight;
  for (Place& place : places_) place.log_weight -= best;
}

Gaussian Places::best() const { return places_.front().pose; }

std::vector<Places::Place>::const_iterator Places::doubted() const {
  return std::find_if(places_.begin(), places_.end(), [](const Place& place) { return place.doubted; });
}

Gaussian Places::shown() const { return hasDoubted() ? doubted()->pose : best(); }

double Places::bestFit() const { return places_.empty() ? 0 : places_.front().fit; }

double Places::odds() const {
  double others = 0;
  for (std::size_t i = 1; i < places_.size(); ++i) others += std::exp(places_[i].log_weight);
  return others > 0 ? 1 / others : std::numeric_limits<double>::infinity();
}

std::vector<Weighted> Places::all() const {
  std::vector<Weighted> out;
  double total = 0;
  for (const Place& place : places_) {
    out.push_back({place.pose.mean, std::exp(place.log_weight)});
    total += out.back().weight;
  }
  for (Weighted& each : out) each.weight /= total;
  return out;
}

}  // namespace kurumaisu
