// SPDX-License-Identifier: BSD-3-Clause
#include "base/node/odometry_settings.h"

#include <algorithm>
#include <array>
#include <map>

#include "model_file.h"
#include "plausible/quantity.h"

namespace kurumaisu {
namespace {

/// Effects of the base that act on what measures the chair, not on the chair.
constexpr std::array<const char*, 3> kOfTheReference{"base.clock_scale", "base.marker_x", "base.marker_y"};

bool isOfTheReference(const std::string& id) {
  return std::find(kOfTheReference.begin(), kOfTheReference.end(), id) != kOfTheReference.end();
}

OdometryNoise readNoise(Section section, const KnownEffects& known) {
  OdometryNoise noise{section.atLeast("forward_per_distance", 0), section.atLeast("forward_per_turn", 0),
                      section.atLeast("lateral_per_distance", 0), section.atLeast("heading_per_distance", 0),
                      section.atLeast("heading_per_turn", 0)};
  section.end();
  if (!known.noise) return noise;
  if (known.unfollowed.empty()) noise = {0, 0, 0, 0, 0};
  noise.rates = *known.noise;
  return noise;
}

std::string readFrame(Section& section, const std::string& key) {
  const std::string given = section.text(key);
  std::string name = frameOf(given);
  if (!name.empty() && name.find_first_of(" \t\n") == std::string::npos) return name;
  throw section.error(key, "must be a frame's name without blanks: " + given);
}

ImuSettings readImu(Section& section) {
  const std::map<std::string, ImuSettings::Axis> axes{
      {"tf", ImuSettings::Axis::kTf}, {"up", ImuSettings::Axis::kUp}, {"down", ImuSettings::Axis::kDown}};
  const ImuSettings::Axis axis = axes.at(section.choice("axis", {"tf", "up", "down"}));
  return {{section.above("timeout", 0), section.above("variance", 0), section.atLeast("scale_sd", 0),
           section.atLeast("bias_walk", 0), section.above("bias_limit", 0), section.atLeast("settle", 0),
           section.above("window", 0), section.above("still", 0)},
          axis};
}

}  // namespace

KnownEffects readEffects(Section& model) {
  KnownEffects known;
  for (Section effect : model.sections("effects")) {
    const std::string id = effect.text("id");
    const Section parameters = effect.section("parameters");  // of other ids the simulator reads them
    effect.end();
    if (id == "base.process_noise") {
      if (known.noise) throw effect.error("id", "is given twice: " + id);
      known.noise = readRateNoise(parameters);
    } else if (id.rfind("base.", 0) == 0 && !isOfTheReference(id)) {
      known.unfollowed.push_back(id);
    }
  }
  return known;
}

OdometrySettings readOdometry(Section section, const KnownEffects& known) {
  const std::string frame = readFrame(section, "frame");
  const std::string child = readFrame(section, "child_frame");
  if (child == frame) throw section.error("child_frame", "must differ from frame: " + child);
  OdometrySettings settings{
      {frame, child, section.flag("publish_tf")}, readNoise(section.section("noise"), known), std::nullopt};
  Section imu = section.section("imu");
  const bool use = imu.flag("use");
  const ImuSettings read = readImu(imu);
  imu.end();
  section.end();
  if (use) settings.imu = read;
  return settings;
}

}  // namespace kurumaisu
