// SPDX-License-Identifier: BSD-3-Clause
#include "slam/mapping/gmapping_names.h"

namespace kurumaisu {
namespace {

constexpr const char* kMatcher = "another scan matcher is used: match_*";
constexpr const char* kNoise = "the noise is that of the matched motion: distance_per_* and angle_per_*";
constexpr const char* kLikelihood = "another likelihood is used: hit_*";
constexpr const char* kSampling = "poses are not sampled around the best one";
constexpr const char* kGrows = "the map begins as large as a scan and grows";

}  // namespace

const std::vector<GmappingName>& gmappingNames() {
  static const std::vector<GmappingName> names{
      {"base_frame", "node", "base_frame"},
      {"odom_frame", "node", "odom_frame"},
      {"map_frame", "node", "map_frame"},
      {"map_update_interval", "node", "map_period"},
      {"transform_publish_period", "node", "transform_period"},
      {"tf_delay", "node", "transform_tolerance"},
      {"throttle_scans", "node", "throttle_scans"},
      {"occ_thresh", "node", "occ_thresh"},
      {"particles", "mapper", "particles"},
      {"delta", "mapper", "resolution"},
      {"maxUrange", "mapper", "range"},
      {"linearUpdate", "mapper", "localise_distance"},
      {"angularUpdate", "mapper", "localise_angle"},
      {"temporalUpdate", "mapper", "localise_time"},
      {"resampleThreshold", "mapper", "resample_below"},
      {"maxRange", nullptr, "the scan's own range_max says how far the laser sees"},
      {"minimumScore", nullptr, "MAPPING_BLIND tells when a scan shows nothing to match"},
      {"sigma", nullptr, kMatcher},
      {"kernelSize", nullptr, kMatcher},
      {"lstep", nullptr, kMatcher},
      {"astep", nullptr, kMatcher},
      {"iterations", nullptr, kMatcher},
      {"lsigma", nullptr, kLikelihood},
      {"ogain", nullptr, kLikelihood},
      {"lskip", nullptr, kLikelihood},
      {"srr", nullptr, kNoise},
      {"srt", nullptr, kNoise},
      {"str", nullptr, kNoise},
      {"stt", nullptr, kNoise},
      {"llsamplerange", nullptr, kSampling},
      {"llsamplestep", nullptr, kSampling},
      {"lasamplerange", nullptr, kSampling},
      {"lasamplestep", nullptr, kSampling},
      {"xmin", nullptr, kGrows},
      {"ymin", nullptr, kGrows},
      {"xmax", nullptr, kGrows},
      {"ymax", nullptr, kGrows},
      {"inverted_laser", nullptr, "tf says how the laser is mounted"}};
  return names;
}

}  // namespace kurumaisu
