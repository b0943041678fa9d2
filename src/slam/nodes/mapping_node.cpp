// SPDX-License-Identifier: BSD-3-Clause
// scan and tf in; map, map_metadata, entropy, tf map -> odom, the trajectory and diagnostics out: slam_gmapping's names,
// and more. What it does with them is in mapper.h.
#include <diagnostic_updater/diagnostic_updater.h>
#include <kurumaisu/StateFile.h>
#include <nav_msgs/GetMap.h>
#include <ros/package.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include <cmath>
#include <csignal>
#include <optional>
#include <utility>

#include "clock_watch.h"
#include "command_line.h"
#include "slam/basics/pose.h"
#include "slam/mapping/mapper.h"
#include "slam/mapping/report.h"
#include "slam/nodes/mapping_output.h"
#include "slam/nodes/mapping_parameters.h"
#include "slam/nodes/mapping_settings.h"
#include "slam/nodes/messages.h"
#include "slam/nodes/scan_feed.h"
#include "standard_streams.h"

namespace k = kurumaisu;

namespace {

using Status = diagnostic_updater::DiagnosticStatusWrapper;

constexpr const char* kHelp = R"(usage: mapping_node

Make a map from scans and odometry, and estimate the chair's pose in it.
Replaces slam_gmapping. slam.launch starts it: roslaunch kurumaisu slam.launch

subscribes to:
  scan
  /tf, /tf_static              odom -> base_link, and base_link -> laser
publishes:
  map, map_metadata
  trajectory, particlecloud
  ~pose                        with covariance
  ~trajectory_with_covariance
  ~entropy                     of the particles
  /tf                          map -> odom
  /diagnostics
services:
  dynamic_map                  the map
  ~save_map                    write it: .pgm, .yaml, .simplemap
  ~pause, ~resume              stop using scans, and continue
  ~reset                       start again
parameters:
  launch/mapping_node.yaml, which the node reads itself; also slam_gmapping's
  start_map: a .simplemap to continue, or static_map for the service's map

More: docs/mapping.md
)";

constexpr double kPollPeriod = 0.02;  // [s] between looks whether transforms have come
constexpr double kAskPeriod = 1.0;    // [s] between two calls of static_map, and two diagnostics
constexpr double kMapShare = 0.1;     // of the time may go into publishing the map

// Apart, because the macros count as a handful of branches each.
void say(const std::string& what) { ROS_INFO("mapping: %s", what.c_str()); }
void complain(const char* why) { ROS_ERROR("MAPPING_NOT_SAVED: %s", why); }

class MappingNode {
 public:
  MappingNode(ros::NodeHandle& nh, k::MappingNodeSettings settings, std::vector<std::string> unused);

  /// Saves the map where the settings say, if they do.
  void end();

 private:
  void advertise(ros::NodeHandle& nh);
  void offer(const char* name, const std::function<void(std_srvs::TriggerResponse&)>& call);
  void begin();
  void askForMap();
  void use(const k::ScanQueue::Ready& ready);
  void work();
  std::string save(const std::string& path) const;
  void diagnose(Status& status);

  k::MappingNodeSettings settings_;
  std::vector<std::string> unused_;  ///< parameters of slam_gmapping that mean nothing here
  ros::NodeHandle nh_, private_{"~"};
  std::optional<k::SavedMap> start_;  ///< the map to go on from, once it is there
  std::string start_problem_;
  std::optional<k::Mapper> mapper_;  ///< none while the map to go on from is not there
  std::optional<k::Mapper::Estimate> estimate_;
  k::Pose2D map_from_odom_{0, 0, 0};
  bool map_changed_ = false, path_changed_ = false, full_ = false;
  std::uint64_t jumps_ = 0;
  std::uint64_t reported_jumps_ = 0, reported_dropped_ = 0, reported_skipped_ = 0;
  ros::Time last_scan_;
  ros::SteadyTime next_map_;
  diagnostic_updater::Updater diagnostics_;
  k::MappingOutput output_;
  std::vector<ros::ServiceServer> services_;
  k::ScanFeed feed_;
  std::vector<ros::SteadyTimer> timers_;
};

MappingNode::MappingNode(ros::NodeHandle& nh, k::MappingNodeSettings settings,
                         std::vector<std::string> unused)
    : settings_(std::move(settings)),
      unused_(std::move(unused)),
      nh_(nh),
      output_(nh, settings_.map_frame, settings_.odom_frame, settings_.occ_thresh),
      feed_(
          nh,
          {{settings_.odom_frame, settings_.base_frame, settings_.transform_deadline},
           settings_.laser_error,
           "MAPPING",
           settings_.backlog,
           settings_.every},
          [this](const k::ScanQueue::Ready& ready) { use(ready); }, [this](const char*) { begin(); }) {
  const bool from_file = !settings_.start_map.empty() && settings_.start_map != k::kStaticMap;
  if (from_file) start_ = k::savedMapOf(k::readSimplemap(settings_.start_map), settings_.mapper);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("mapping", this, &MappingNode::diagnose);
  advertise(nh);
  begin();
  // Steady timers: timers of simulated time stall when it is set back.
  const auto every = [&](double period, auto call) {
    timers_.push_back(
        nh.createSteadyTimer(ros::WallDuration(period), [call](const ros::SteadyTimerEvent&) { call(); }));
  };
  every(kPollPeriod, [this] { work(); });
  if (settings_.transform_period > 0) {
    every(settings_.transform_period, [this] {
      const ros::Time until = k::later(ros::Time::now(), settings_.transform_tolerance);
      if (estimate_) output_.transform(map_from_odom_, until);
    });
  }
  every(kAskPeriod, [this] {
    diagnostics_.force_update();  // update() waits for a time that may have been set back
    if (!mapper_) askForMap();
  });
}

void MappingNode::advertise(ros::NodeHandle& nh) {
  using nav_msgs::GetMap;
  services_.push_back(nh.advertiseService<GetMap::Request, GetMap::Response>(
      "dynamic_map", [this](GetMap::Request&, GetMap::Response& response) {
        if (mapper_) response.map = output_.mapOf(*mapper_, last_scan_);
        return response.map.info.width > 0;
      }));
  using kurumaisu::StateFile;
  services_.push_back(private_.advertiseService<StateFile::Request, StateFile::Response>(
      "save_map", [this](StateFile::Request& request, StateFile::Response& response) {
        try {
          response.message = save(request.file);
          response.success = 1;
        } catch (const std::exception& error) {
          response.message = error.what();
        }
        return true;
      }));
  offer("reset", [this](auto& response) {
    begin();
    response.message = "the map starts again";
  });
  offer("pause", [this](auto& response) {
    feed_.pause(true);
    response.message = "scans are not used";
  });
  offer("resume", [this](auto& response) {
    feed_.pause(false);
    response.message = "scans are used";
  });
}

void MappingNode::offer(const char* name, const std::function<void(std_srvs::TriggerResponse&)>& call) {
  services_.push_back(private_.advertiseService<std_srvs::TriggerRequest, std_srvs::TriggerResponse>(
      name, [call](std_srvs::TriggerRequest&, std_srvs::TriggerResponse& response) {
        call(response);
        response.success = 1;
        return true;
      }));
}

/// As the node begins: with the map to go on from, or none.
void MappingNode::begin() {
  mapper_.reset();
  estimate_.reset();
  map_changed_ = path_changed_ = full_ = false;
  last_scan_ = ros::Time();
  output_.forget();
  next_map_ = ros::SteadyTime();
  start_problem_.clear();
  if (!settings_.start_map.empty() && !start_) {
    start_problem_ = "waits for the map of the service " + nh_.resolveName(k::kStaticMap);
    return;
  }
  k::Mapper mapper(settings_.mapper, settings_.seed);
  if (start_) mapper.resume(*start_, settings_.start);
  mapper_.emplace(std::move(mapper));
  map_changed_ = start_.has_value();
}

void MappingNode::askForMap() try {
  ros::ServiceClient client = nh_.serviceClient<nav_msgs::GetMap>(k::kStaticMap);
  nav_msgs::GetMap call;
  if (!client.exists() || !client.call(call)) return;
  k::OccupancyGrid grid = k::gridOf(call.response.map);
  const k::Pose2D corner = k::planarOf(call.response.map.info.origin);
  if (std::abs(corner.theta) > 1e-6) throw std::invalid_argument("its origin is rotated");
  grid.x = corner.x;
  grid.y = corner.y;
  start_ = k::SavedMap{std::move(grid), {}};
  begin();
} catch (const std::invalid_argument& error) {
  start_.reset();
  start_problem_ = "the map of " + nh_.resolveName(k::kStaticMap) + ": " + error.what();
}

void MappingNode::use(const k::ScanQueue::Ready& ready) {
  if (!mapper_) return;
  try {
    estimate_ = mapper_->add(ready.scan, ready.start, ready.end);
  } catch (const k::StartError& error) {
    start_problem_ = error.what();
    throw;
  }
  start_problem_.clear();
  map_from_odom_ = k::compose(estimate_->map_from_base, k::between(ready.start, {0, 0, 0}));
  last_scan_ = ready.stamp;
  jumps_ += estimate_->jumped ? 1 : 0;
  if (estimate_->map_updated || estimate_->full) full_ = estimate_->full;
  map_changed_ = map_changed_ || estimate_->map_updated;
  if (!estimate_->localised) return;
  path_changed_ = true;
  output_.estimate(*mapper_, *estimate_, last_scan_);
}

void MappingNode::work() {
  feed_.work();
  if ((!map_changed_ && !path_changed_) || ros::SteadyTime::now() < next_map_) return;
  const ros::SteadyTime start = ros::SteadyTime::now();
  if (map_changed_) output_.map(*mapper_, last_scan_);
  if (path_changed_) output_.trajectory(*mapper_, last_scan_);
  map_changed_ = path_changed_ = false;
  const double cost = (ros::SteadyTime::now() - start).toSec();
  next_map_ = start + ros::WallDuration(std::fmax(settings_.map_period, cost / kMapShare));
}

/// What was written, in words. Throws std::runtime_error.
std::string MappingNode::save(const std::string& path) const {
  if (path.empty()) throw std::runtime_error("file: must not be empty");
  if (!mapper_) throw std::runtime_error("nothing has been mapped yet");
  k::writeMapPair(path, k::decided(mapper_->grid(), settings_.occ_thresh));
  const auto keys = mapper_->keys();
  if (keys.empty()) return "written: " + path + ".pgm, .yaml; no .simplemap: no scan has been mapped yet";
  k::writeSimplemap(path + ".simplemap", keys);
  const bool partial = start_ && start_->keys.empty();
  return "written: " + path + ".pgm, .yaml, .simplemap" +
         (partial ? "; the latter has only what was seen since" : "");
}

void MappingNode::end() {
  if (settings_.save_on_shutdown.empty()) return;
  try {
    say(save(settings_.save_on_shutdown));
  } catch (const std::exception& error) {
    complain(error.what());
  }
}

void MappingNode::diagnose(Status& status) {
  const auto& dropped = feed_.queue().dropped();
  const std::uint64_t lost = dropped.lost();
  k::MappingState state;
  state.clock_problem = feed_.clockProblem(settings_.silence);
  state.paused = feed_.paused();
  state.start_problem = start_problem_;
  state.silence = feed_.silence();
  state.silence_limit = settings_.silence;
  state.missing = feed_.missing(settings_.silence);
  state.begun = estimate_.has_value();
  state.full = full_;
  state.blind = estimate_ && estimate_->blind;
  if (estimate_) state.deviation = std::sqrt(estimate_->covariance[0] + estimate_->covariance[4]);
  state.jumps = jumps_ - std::exchange(reported_jumps_, jumps_);
  state.skipped = feed_.skipped() - std::exchange(reported_skipped_, feed_.skipped());
  state.dropped = lost - std::exchange(reported_dropped_, lost);
  state.reason = feed_.queue().reason();
  const k::MappingVerdict verdict = k::judge(state);
  status.summary(static_cast<unsigned char>(verdict.level), verdict.summary);
  status.add("scans", feed_.used());
  status.add("dropped without transform", dropped.no_transform);
  status.add("dropped as senseless", dropped.bad_scan);
  status.add("dropped as too old", dropped.too_old);
  status.add("last dropped", state.reason);
  status.add("refused transforms", feed_.refusedTransforms());
  status.add("skipped", feed_.skipped());
  status.add("jumps of odometry", jumps_);
  status.add("deviation [m]", state.deviation);
  status.add("processor time per scan [ms]",
             feed_.used() > 0 ? 1000 * feed_.seconds() / static_cast<double>(feed_.used()) : 0);
  for (const std::string& name : unused_) status.add("not used", name);
}

}  // namespace

int main(int argc, char** argv) {
  k::holdStandardStreams();
  if (const auto code = k::answered(argc, argv, kHelp)) return *code;
  ros::init(argc, argv, "mapping_node");
  std::signal(SIGTERM, [](int) { ros::requestShutdown(); });  // ros::init() sees to SIGINT only
  ros::NodeHandle nh;  // here, because ROS_FATAL is mute once the last one is gone
  const k::ClockWatch clock(nh);
  try {
    const std::string& name = ros::this_node::getName();
    const std::string launch = ros::package::getPath("kurumaisu") + "/launch/";
    auto unused = k::completeParameters(name, launch + "mapping_node.yaml", launch + "md100.yaml");
    MappingNode node(nh, k::readMappingNodeSettings(name), std::move(unused));
    ros::spin();
    node.end();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
  return 0;
}
