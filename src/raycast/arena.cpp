// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/arena.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

namespace kurumaisu {
namespace {

constexpr double kFarthest = 1e7;  // [m] from the map's origin; beyond, a double no longer tells nanometres
constexpr int kMostThreads = 256;
constexpr std::size_t kMostSamples = 1000000;  // of a fan: more is a slip of the pen

[[noreturn]] void refuse(const char* what, std::size_t i, const std::string& why) {
  throw std::invalid_argument(std::string(what) + " " + std::to_string(i) + why);
}

bool within(double value) { return std::abs(value) <= kFarthest; }  // not NaN either

void requirePose(const Pose& p, const char* what, std::size_t i) {
  if (within(p.x) && within(p.y) && within(p.z) && within(p.heading)) return;
  refuse(what, i, " is not finite, or beyond 1e7 (m or rad)");
}

void requireFace(const Face& f, const char* what, std::size_t i) {
  if (!within(f.line.ax) || !within(f.line.ay) || !within(f.line.bx) || !within(f.line.by))
    refuse(what, i, ": its ends are not finite, or beyond 1e7 m");
  if (!(f.z_low <= f.z_high)) {
    const std::string low = std::to_string(f.z_low);
    refuse(what, i, ": z_low " + low + " must not be above z_high " + std::to_string(f.z_high));
  }
  if (std::isnan(f.ranger_return)) refuse(what, i, ": its ranger return is not a number");
}

void requireFan(const Beams& fan, std::size_t i) {
  if (!within(fan.first)) refuse("fan", i, ": its first bearing is not finite, or beyond 1e7 rad");
  if (!(std::abs(fan.increment) <= kTurn)) refuse("fan", i, ": its increment must be within a turn");
  if (fan.samples > kMostSamples)
    refuse("fan", i, ": " + std::to_string(fan.samples) + " samples are more than 1000000");
  if (!(fan.range_max > 0))
    refuse("fan", i, ": range_max must be positive, not " + std::to_string(fan.range_max));
}

std::vector<Wall> checked(std::vector<Wall> walls) {
  for (std::size_t i = 0; i < walls.size(); ++i) requireFace(walls[i].face, "wall", i);
  return walls;
}

int checkedThreads(int threads) {
  if (threads >= 1 && threads <= kMostThreads) return threads;
  throw std::invalid_argument("threads must be from 1 to 256, not " + std::to_string(threads));
}

Echo echoOf(const Hit& hit, const Layer& layer, const std::vector<Wall>& walls) {
  if (hit.segment < 0 || std::isinf(hit.range)) return {hit.range, 0.0};
  const auto wall = static_cast<std::size_t>(layer.members[static_cast<std::size_t>(hit.segment)]);
  return {hit.range, walls[wall].face.ranger_return};
}

}  // namespace

Arena::Arena(std::vector<Wall> walls, int threads)
    : walls_(checked(std::move(walls))), layers_(walls_), pool_(checkedThreads(threads)) {}

int Arena::add(std::vector<Face> faces, int tree) {
  for (std::size_t i = 0; i < faces.size(); ++i) requireFace(faces[i], "face", i);
  const std::lock_guard<std::mutex> lock(mutex_);
  return bodies_.add(std::move(faces), tree);
}

void Arena::remove(int body) {
  const std::lock_guard<std::mutex> lock(mutex_);
  requireKnown({body});
  bodies_.remove(body);
}

void Arena::requireKnown(const std::vector<int>& bodies) const {
  for (const int body : bodies) {
    if (body < 0 || static_cast<std::size_t>(body) >= bodies_.size() || !bodies_[body].present)
      throw std::invalid_argument("there is no body " + std::to_string(body));
  }
}

void Arena::setPoses(const std::vector<int>& bodies, const Pose* poses) {
  const std::lock_guard<std::mutex> lock(mutex_);
  requireKnown(bodies);
  for (std::size_t i = 0; i < bodies.size(); ++i) requirePose(poses[i], "pose", i);
  for (std::size_t i = 0; i < bodies.size(); ++i) bodies_.place(bodies[i], poses[i]);
}

void Arena::scan(const std::vector<Viewpoint>& from, const std::vector<Beams>& fans, double* ranges,
                 double* returns) {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<const Layer*> layers;
  std::vector<std::size_t> offsets{0};
  for (std::size_t i = 0; i < from.size(); ++i) {
    requirePose(from[i].pose, "origin", i);
    requireFan(fans[i], i);
    layers.push_back(&layers_.at(from[i].pose.z, from[i].tree));
    offsets.push_back(offsets.back() + fans[i].samples);
  }
  pool_.run(from.size(), [&](std::size_t begin, std::size_t end) {
    std::vector<Hit> hits;
    std::vector<Echo> echoes;
    for (std::size_t i = begin; i < end; ++i) {
      const Beams& fan = fans[i];
      const Pose& pose = from[i].pose;
      hits.resize(fan.samples);
      echoes.resize(fan.samples);
      layers[i]->scene.castFan({pose.x, pose.y, pose.heading}, fan.first, fan.increment, fan.samples,
                               fan.range_max, hits.data());
      for (std::size_t j = 0; j < fan.samples; ++j) echoes[j] = echoOf(hits[j], *layers[i], walls_);
      seeBodies(bodies_, from[i], fan, echoes.data());
      for (std::size_t j = 0; j < fan.samples; ++j) {
        ranges[offsets[i] + j] = echoes[j].range;
        returns[offsets[i] + j] = echoes[j].ranger_return;
      }
    }
  });
}

void Arena::cast(const std::vector<Viewpoint>& from, double range_max, double* ranges, double* returns) {
  if (!(range_max > 0))
    throw std::invalid_argument("range_max must be positive, not " + std::to_string(range_max));
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<const Layer*> layers;
  for (std::size_t i = 0; i < from.size(); ++i) {
    requirePose(from[i].pose, "origin", i);
    layers.push_back(&layers_.at(from[i].pose.z, from[i].tree));
  }
  pool_.run(from.size(), [&](std::size_t begin, std::size_t end) {
    std::vector<Echo> echoes;
    for (std::size_t i = begin; i < end; ++i) {
      const Pose& pose = from[i].pose;
      const Hit wall = layers[i]->scene.cast(pose.x, pose.y, pose.heading, range_max);
      echoes.push_back(echoOf(wall, *layers[i], walls_));
    }
    seeBodies(bodies_, from.data() + begin, end - begin, range_max, echoes.data());
    for (std::size_t i = begin; i < end; ++i) {
      ranges[i] = echoes[i - begin].range;
      returns[i] = echoes[i - begin].ranger_return;
    }
  });
}

const Contact& Arena::contact() {
  if (!contact_) contact_ = std::make_unique<Contact>(walls_);
  return *contact_;
}

void Arena::touches(const std::vector<int>& bodies, bool* out) {
  const std::lock_guard<std::mutex> lock(mutex_);
  requireKnown(bodies);
  for (std::size_t i = 0; i < bodies.size(); ++i) out[i] = contact().touches(bodies_, bodies[i]);
}

void Arena::move(const std::vector<int>& bodies, const Pose* poses, const std::vector<int>& groups,
                 bool* stalled) {
  const std::lock_guard<std::mutex> lock(mutex_);
  requireKnown(bodies);
  for (std::size_t i = 0; i < bodies.size(); ++i) requirePose(poses[i], "pose", i);
  std::size_t end = 0;
  for (std::size_t begin = 0; begin < bodies.size(); begin = end) {
    end = begin + 1;
    while (!groups.empty() && end < bodies.size() && groups[end] == groups[begin]) ++end;
    std::fill(stalled + begin, stalled + end, !moveGroup(&bodies[begin], poses + begin, end - begin));
  }
}

bool Arena::moveGroup(const int* bodies, const Pose* poses, std::size_t count) {
  std::vector<Pose> before;
  for (std::size_t i = 0; i < count; ++i) {
    before.push_back(bodies_[bodies[i]].pose);
    bodies_.place(bodies[i], poses[i]);
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (!contact().touches(bodies_, bodies[i])) continue;
    for (std::size_t j = count; j-- > 0;) bodies_.place(bodies[j], before[j]);  // one may be there twice
    return false;
  }
  return true;
}

}  // namespace kurumaisu
