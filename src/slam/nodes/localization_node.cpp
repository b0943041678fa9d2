// SPDX-License-Identifier: BSD-3-Clause
// scan, tf, odom and map in; amcl_pose, particlecloud, tf map -> odom and diagnostics out: AMCL's names. What it does
// with them is in localizer.h.
#include <diagnostic_updater/diagnostic_updater.h>
#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <nav_msgs/GetMap.h>
#include <nav_msgs/OccupancyGrid.h>
#include <nav_msgs/Odometry.h>
#include <nav_msgs/SetMap.h>
#include <ros/ros.h>
#include <std_srvs/Empty.h>
#include <tf2_ros/transform_broadcaster.h>

#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "clock_watch.h"
#include "command_line.h"
#include "slam/basics/pose.h"
#include "slam/localization/report.h"
#include "slam/nodes/localization_settings.h"
#include "slam/nodes/messages.h"
#include "slam/nodes/scan_feed.h"
#include "standard_streams.h"

namespace k = kurumaisu;

namespace {

using PoseMessage = geometry_msgs::PoseWithCovarianceStamped;
using Status = diagnostic_updater::DiagnosticStatusWrapper;

constexpr const char* kHelp = R"(usage: localization_node

Estimate the chair's pose in a known map, from scans and odometry. Replaces
amcl. localization.launch starts it:
roslaunch kurumaisu localization.launch map:=FILE.yaml

subscribes to:
  scan
  /tf, /tf_static          odom -> base_link, and base_link -> laser
  odom                     its covariance
  map                      or, with use_map_topic false, the service static_map
  initialpose              where the chair is
publishes:
  amcl_pose                where the chair is, with covariance
  particlecloud
  /tf                      map -> odom
  /diagnostics             also how well the scan fits the map
services:
  global_localization      the chair may be anywhere in the map
  request_nomotion_update  use the next scan even if the chair stands
  set_map                  another map
parameters:
  launch/localization_node.yaml. model: launch/md100.yaml

More: docs/localization.md
)";

constexpr double kPollPeriod = 0.01;      // [s] between looks whether scans have their transforms
constexpr double kAskPeriod = 1.0;        // [s] between two calls of static_map
constexpr std::size_t kQueue = 100;       // odometry that may wait
constexpr double kOdometryMemory = 10.0;  // [s] of covariances
constexpr double kOdometryGap = 0.2;      // [s] a covariance holds for scans so near at most
constexpr double kAhead = 10.0;  // [s] an initial pose stamped farther in the future is of another clock
constexpr double kWarningPeriod = 5.0;  // [s] of throttled warnings

// Apart, because the macro counts as a handful of branches.
void warnFrame(const std::string& frame, const std::string& taken_for) {
  ROS_WARN("LOCALIZATION_MAP_FRAME: the map is in %s, and used as if it were in %s", frame.c_str(),
           taken_for.c_str());
}

void warnPose(const char* source, std::uint64_t refused, const char* why) {
  ROS_WARN("LOCALIZATION_BAD_POSE: %s: refused, %lu so far: %s", source, refused, why);
}

void warnWallTime(double stamp) {
  ROS_WARN(
      "LOCALIZATION_POSE_STAMP: initialpose: stamp %.3f s is the wall's time, while this clock is /clock, "
      "%.3f s: "
      "taken as of now; set /use_sim_time before its sender starts",
      stamp, ros::Time::now().toSec());
}

void warnOdometry(std::uint64_t refused, const char* why) {
  ROS_WARN_THROTTLE(kWarningPeriod, "LOCALIZATION_BAD_ODOMETRY: odom: refused, %lu so far: %s", refused, why);
}

class LocalizationNode {
 public:
  LocalizationNode(ros::NodeHandle& nh, k::LocalizationNodeSettings settings);

 private:
  void onOdometry(const nav_msgs::Odometry& odometry);
  void onMap(const nav_msgs::OccupancyGrid& map);
  void onInitialPose(const PoseMessage& message);
  bool setMap(nav_msgs::SetMap::Request& request, nav_msgs::SetMap::Response& response);
  void advertise(ros::NodeHandle& nh);
  void askForMap();
  void add(const k::ScanQueue::Ready& ready);
  void publish(const k::ScanQueue::Ready& ready, const k::Localizer::Estimate& estimate, bool is_news);
  void publishCloud(const ros::Time& stamp);
  void save(const k::Gaussian& pose);
  void begin();
  void reset();
  std::optional<Eigen::Matrix3d> covarianceAt(const ros::Time& stamp) const;
  bool setPose(const char* source, const PoseMessage& message);
  void requirePose(const PoseMessage& message) const;
  void diagnose(Status& status);

  k::LocalizationNodeSettings settings_;
  ros::NodeHandle nh_, private_{"~"};
  std::optional<nav_msgs::OccupancyGrid> map_;
  std::string bad_map_;
  std::optional<k::Localizer> localizer_;
  std::optional<k::Localizer::Estimate> estimate_;
  std::map<ros::Time, Eigen::Matrix3d> covariances_;  ///< of odometry
  ros::Time last_transform_;
  ros::SteadyTime last_cloud_, last_save_;
  std::uint64_t reported_skipped_ = 0, reported_dropped_ = 0;
  std::uint64_t refused_poses_ = 0, refused_odometry_ = 0;
  tf2_ros::TransformBroadcaster broadcaster_;
  diagnostic_updater::Updater diagnostics_;
  ros::Publisher pose_, cloud_;
  std::vector<ros::Subscriber> subscribers_;
  std::vector<ros::ServiceServer> services_;
  k::ScanFeed feed_;
  std::vector<ros::SteadyTimer> timers_;
};

LocalizationNode::LocalizationNode(ros::NodeHandle& nh, k::LocalizationNodeSettings settings)
    : settings_(std::move(settings)),
      nh_(nh),
      feed_(
          nh,
          {{settings_.odom_frame, settings_.base_frame, settings_.transform_deadline},
           settings_.chair.laser,
           "LOCALIZATION",
           settings_.backlog,
           1},
          [this](const k::ScanQueue::Ready& ready) { add(ready); }, [this](const char*) { reset(); }) {
  diagnostics_.setHardwareID("none");
  diagnostics_.add("localization", this, &LocalizationNode::diagnose);
  pose_ = nh.advertise<PoseMessage>("amcl_pose", 2, true);
  cloud_ = nh.advertise<geometry_msgs::PoseArray>("particlecloud", 2, true);
  subscribers_.push_back(nh.subscribe("odom", kQueue, &LocalizationNode::onOdometry, this));
  subscribers_.push_back(nh.subscribe("initialpose", 2, &LocalizationNode::onInitialPose, this));
  if (settings_.map_topic) subscribers_.push_back(nh.subscribe("map", 1, &LocalizationNode::onMap, this));
  advertise(nh);
  // Steady timers: timers of simulated time stall when it is set back.
  const auto every = [&](double period, auto call) {
    timers_.push_back(
        nh.createSteadyTimer(ros::WallDuration(period), [call](const ros::SteadyTimerEvent&) { call(); }));
  };
  every(kPollPeriod, [this] { feed_.work(); });
  every(kAskPeriod, [this] {
    diagnostics_.force_update();  // update() waits for a time that may have been set back
    if (!settings_.map_topic && !map_) askForMap();
  });
}

void LocalizationNode::advertise(ros::NodeHandle& nh) {
  using std_srvs::Empty;
  services_.push_back(nh.advertiseService<Empty::Request, Empty::Response>(
      "global_localization", [this](Empty::Request&, Empty::Response&) {
        if (localizer_) localizer_->forget();
        return localizer_.has_value();
      }));
  services_.push_back(nh.advertiseService<Empty::Request, Empty::Response>(
      "request_nomotion_update", [this](Empty::Request&, Empty::Response&) {
        if (localizer_) localizer_->updateOnce();
        return localizer_.has_value();
      }));
  services_.push_back(nh.advertiseService("set_map", &LocalizationNode::setMap, this));
}

void LocalizationNode::onOdometry(const nav_msgs::Odometry& odometry) try {
  const ros::Time stamp = odometry.header.stamp;
  k::requireStamp(stamp, ros::Time::now());
  const Eigen::Matrix3d covariance = k::planarOf(odometry.pose.covariance);
  if (!(covariance(0, 0) > 0)) return;  // it has none
  covariances_[stamp] = covariance;
  const auto is_far = [&stamp](const auto& item) {
    return std::abs(k::secondsFrom(item.first, stamp)) > kOdometryMemory;
  };
  while (is_far(*covariances_.begin())) covariances_.erase(covariances_.begin());
  while (is_far(*covariances_.rbegin()))
    covariances_.erase(std::prev(covariances_.end()));  // of another time
} catch (const std::invalid_argument& error) {
  warnOdometry(++refused_odometry_, error.what());
}

/// Interpolated; a covariance that grows in steps would grow by none, or by two.
std::optional<Eigen::Matrix3d> LocalizationNode::covarianceAt(const ros::Time& stamp) const {
  const auto after = covariances_.lower_bound(stamp);
  if (after == covariances_.end() || after == covariances_.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const double gap = k::secondsFrom(before->first, after->first);
  if (gap > kOdometryGap) return std::nullopt;
  const double part = k::secondsFrom(before->first, stamp) / gap;
  return (1 - part) * before->second + part * after->second;
}

void LocalizationNode::onMap(const nav_msgs::OccupancyGrid& map) {
  if (settings_.first_map_only && localizer_) return;
  const std::string frame = k::frameOf(map.header.frame_id);
  if (frame != settings_.map_frame) warnFrame(frame, settings_.map_frame);
  const bool tracking = estimate_ && estimate_->knowledge == k::Knowledge::kTracking;
  const k::Gaussian here = tracking ? estimate_->map_from_base : settings_.start;
  map_ = map;
  begin();
  if (localizer_ && tracking) localizer_->setPose(here);  // a new map of the same place
}

bool LocalizationNode::setMap(nav_msgs::SetMap::Request& request, nav_msgs::SetMap::Response& response) {
  map_ = request.map;
  begin();
  response.success = setPose("set_map", request.initial_pose);
  return true;
}

void LocalizationNode::askForMap() {
  ros::ServiceClient client = nh_.serviceClient<nav_msgs::GetMap>("static_map");
  nav_msgs::GetMap call;
  if (client.exists() && client.call(call)) onMap(call.response.map);
}

/// A new localiser on the map, at the start.
void LocalizationNode::begin() {
  localizer_.reset();
  estimate_.reset();
  bad_map_.clear();
  if (!map_) return;
  try {
    k::OccupancyGrid grid = k::gridOf(*map_);
    localizer_.emplace(settings_.localizer, settings_.chair, settings_.seed, std::move(grid),
                       k::planarOf(map_->info.origin));
    if (settings_.known_start) localizer_->setPose(settings_.start);
  } catch (const std::exception& error) {
    bad_map_ = error.what();
    ROS_ERROR("LOCALIZATION_BAD_MAP: %s", error.what());
  }
}

void LocalizationNode::onInitialPose(const PoseMessage& message) { setPose("initialpose", message); }

bool LocalizationNode::setPose(const char* source, const PoseMessage& message) try {
  requirePose(message);
  localizer_->setPose({k::planarOf(message.pose.pose), k::planarOf(message.pose.covariance)});
  return true;
} catch (const std::invalid_argument& error) {
  warnPose(source, ++refused_poses_, error.what());
  return false;
}

/// Throws std::invalid_argument with the reason for a pose that cannot be one in this map, now.
void LocalizationNode::requirePose(const PoseMessage& message) const {
  if (!localizer_) throw std::invalid_argument("there is no map yet, or none that makes sense");
  const std::string frame = k::frameOf(message.header.frame_id);
  if (!frame.empty() && frame != settings_.map_frame) {
    throw std::invalid_argument("frame_id: must be " + settings_.map_frame + ", or empty: " + frame);
  }
  if (k::isWallTime(message.header.stamp)) {
    warnWallTime(message.header.stamp.toSec());
  } else {
    k::requireStamp(message.header.stamp, ros::Time::now(), kAhead);
  }
}

void LocalizationNode::add(const k::ScanQueue::Ready& ready) {
  if (!localizer_) return;
  const auto estimate =
      localizer_->add(ready.scan, {ready.scan.stamp, ready.start, covarianceAt(ready.stamp)}, ready.end);
  const bool is_news = !estimate_ || estimate_->knowledge != estimate.knowledge;
  if (is_news) ROS_INFO("localization: %s", k::nameOf(estimate.knowledge));
  estimate_ = estimate;
  publish(ready, estimate, is_news);
}

void LocalizationNode::publish(const k::ScanQueue::Ready& ready, const k::Localizer::Estimate& estimate,
                               bool is_news) {
  const ros::Time until = k::later(ready.stamp, settings_.transform_tolerance);
  if (settings_.broadcast && until > last_transform_) {  // tf refuses the same time twice
    last_transform_ = until;
    const k::Pose2D map_from_odom =
        k::compose(estimate.map_from_base.mean, k::between(ready.start, {0, 0, 0}));
    broadcaster_.sendTransform(k::stamped(map_from_odom, until, settings_.map_frame, settings_.odom_frame));
  }
  if (!estimate.updated && !is_news) return;
  PoseMessage message;
  message.header.stamp = ready.stamp;
  message.header.frame_id = settings_.map_frame;
  message.pose = k::messageOf(estimate.map_from_base);
  pose_.publish(message);
  publishCloud(ready.stamp);
  if (estimate.knowledge == k::Knowledge::kTracking) save(estimate.map_from_base);
}

void LocalizationNode::publishCloud(const ros::Time& stamp) {
  const ros::SteadyTime now = ros::SteadyTime::now();
  if (settings_.cloud_period < 0 || (now - last_cloud_).toSec() < settings_.cloud_period) return;
  last_cloud_ = now;
  geometry_msgs::PoseArray cloud;
  cloud.header.stamp = stamp;
  cloud.header.frame_id = settings_.map_frame;
  for (const auto& [pose, weight] : localizer_->particles()) cloud.poses.push_back(k::messageOf(pose));
  cloud_.publish(cloud);
}

void LocalizationNode::save(const k::Gaussian& pose) {
  const ros::SteadyTime now = ros::SteadyTime::now();
  if (settings_.save_period < 0 || (now - last_save_).toSec() < settings_.save_period) return;
  last_save_ = now;
  private_.setParam("initial_pose_x", pose.mean.x);
  private_.setParam("initial_pose_y", pose.mean.y);
  private_.setParam("initial_pose_a", k::wrapAngle(pose.mean.theta));
  private_.setParam("initial_cov_xx", pose.covariance(0, 0));
  private_.setParam("initial_cov_yy", pose.covariance(1, 1));
  private_.setParam("initial_cov_aa", pose.covariance(2, 2));
}

void LocalizationNode::reset() {
  covariances_.clear();
  last_transform_ = ros::Time();
  begin();
}

void LocalizationNode::diagnose(Status& status) {
  const auto& queue = feed_.queue();
  const std::uint64_t lost = queue.dropped().lost();
  const k::LocalizationState state{feed_.clockProblem(settings_.silence),
                                   map_.has_value(),
                                   bad_map_,
                                   feed_.silence(),
                                   settings_.silence,
                                   feed_.missing(settings_.silence),
                                   estimate_ ? &*estimate_ : nullptr,
                                   lost - std::exchange(reported_dropped_, lost),
                                   feed_.skipped() - std::exchange(reported_skipped_, feed_.skipped())};
  const k::LocalizationVerdict verdict = k::judge(state);
  status.summary(static_cast<unsigned char>(verdict.level), verdict.summary);
  if (estimate_) {
    status.add("knowledge", estimate_->blind ? "blind" : k::nameOf(estimate_->knowledge));
    status.add("fit", estimate_->fit);
    status.add("usual fit", estimate_->fit_usual);
    status.add("particles", estimate_->particles);
  }
  status.add("scans", feed_.used());
  status.add("dropped without transform", queue.dropped().no_transform);
  status.add("dropped as senseless", queue.dropped().bad_scan);
  status.add("dropped as too old", queue.dropped().too_old);
  status.add("skipped", feed_.skipped());
  status.add("last dropped", queue.reason());
  status.add("refused initial poses", refused_poses_);
  status.add("refused odometry", refused_odometry_);
  status.add("refused transforms", feed_.refusedTransforms());
  status.add("processor time per scan [ms]",
             feed_.used() > 0 ? 1000 * feed_.seconds() / static_cast<double>(feed_.used()) : 0);
}

}  // namespace

int main(int argc, char** argv) {
  k::holdStandardStreams();
  if (const auto code = k::answered(argc, argv, kHelp)) return *code;
  ros::init(argc, argv, "localization_node");
  ros::NodeHandle nh;  // here, because ROS_FATAL is mute once the last one is gone
  const k::ClockWatch clock(nh);
  try {
    LocalizationNode node(nh, k::readLocalizationNodeSettings(ros::this_node::getName()));
    ros::spin();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
  return 0;
}
