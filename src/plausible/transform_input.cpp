// SPDX-License-Identifier: BSD-3-Clause
#include "plausible/transform_input.h"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "plausible/messages.h"

namespace kurumaisu {
namespace {

constexpr double kWarningPeriod = 5.0;  // [s] of throttled warnings
constexpr double kMemory = 10.0;        // [s] of a buffer: later ones of a child keep those before out
constexpr std::uint32_t kQueue = 100;   // messages that may wait, as with tf2_ros

geometry_msgs::TransformStamped checked(geometry_msgs::TransformStamped transform, const ros::Time& now,
                                        bool is_static) {
  requireStamp(transform.header.stamp, is_static ? ros::Time() : now);
  const auto& place = transform.transform.translation;
  require(plausible::kPosition, "translation.x", place.x);
  require(plausible::kPosition, "translation.y", place.y);
  require(plausible::kPosition, "translation.z", place.z);
  transform.header.frame_id = frameOf(transform.header.frame_id);
  transform.child_frame_id = frameOf(transform.child_frame_id);
  return transform;
}

}  // namespace

TransformInput::TransformInput(tf2_ros::Buffer& buffer, std::string prefix)
    : buffer_(&buffer), prefix_(std::move(prefix)) {
  nh_.setCallbackQueue(&queue_);
  moving_ = hear("/tf", false);
  fixed_ = hear("/tf_static", true);
  spinner_.start();
}

ros::Subscriber TransformInput::hear(const std::string& topic, bool is_static) {
  const boost::function<void(const Event&)> take = [this, is_static](const Event& event) {
    this->take(event, is_static);
  };
  return nh_.subscribe<tf2_msgs::TFMessage, const Event&>(topic, kQueue, take);
}

void TransformInput::take(const Event& event, bool is_static) {
  const ros::Time now = ros::Time::now();
  if (secondsFrom(now, last_clock_) > kTimeJump) buffer_->clear();
  last_clock_ = now;
  for (const auto& transform : event.getConstMessage()->transforms) {
    try {
      if (!is_static) requireNear(transform, now);
      buffer_->setTransform(checked(transform, now, is_static), event.getPublisherName(), is_static);
    } catch (const std::exception& error) {  // of any kind: this thread must go on
      refuse(transform.header.frame_id + " -> " + transform.child_frame_id + ": " + error.what());
    }
  }
}

/// One alone that is ahead of this clock is a mistake; if all are, the clock is another computer's.
void TransformInput::requireNear(const geometry_msgs::TransformStamped& transform, const ros::Time& now) {
  ros::Time& last = stamps_[transform.child_frame_id];
  const ros::Time before = std::exchange(last, transform.header.stamp);
  if (std::abs(secondsFrom(before, last)) > kMemory) requireStamp(last, now, kMemory);
}

void TransformInput::refuse(const std::string& why) {
  ++refused_;
  ROS_WARN_THROTTLE(kWarningPeriod, "%s_BAD_TRANSFORM: tf: refused, %lu so far: %s", prefix_.c_str(),
                    refused_.load(), why.c_str());
}

}  // namespace kurumaisu
