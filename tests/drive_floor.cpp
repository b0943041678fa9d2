// SPDX-License-Identifier: BSD-3-Clause
// drive_floor RATE: base_node's topics and wake-ups with nothing in between, for scripts/bench drive: what roscpp itself
// costs. A command is answered with a voltage at once; voltages, odom, cmd_vel_out and tf come RATE times a second.
#include <geometry_msgs/TransformStamped.h>
#include <geometry_msgs/Twist.h>
#include <geometry_msgs/TwistStamped.h>
#include <kurumaisu/Voltages.h>
#include <nav_msgs/Odometry.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <tf2_ros/transform_broadcaster.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

namespace {

class Floor {
 public:
  explicit Floor(ros::NodeHandle& nh)
      : voltages_(nh.advertise<kurumaisu::Voltages>("voltages", 10)),
        odom_(nh.advertise<nav_msgs::Odometry>("odom", 10)),
        survived_(nh.advertise<geometry_msgs::TwistStamped>("cmd_vel_out", 10)),
        commands_(
            nh.subscribe("experiment_vel", 1, &Floor::onCommand, this, ros::TransportHints().tcpNoDelay())) {}

  void run(double rate) {
    for (ros::SteadyTime due = ros::SteadyTime::now(); ros::ok();) {
      const double left = (due - ros::SteadyTime::now()).toSec();
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(std::max(left, 0.0)));
      if (ros::SteadyTime::now() < due) continue;
      due += ros::WallDuration(1 / rate);
      put();
      publish();
    }
  }

 private:
  void onCommand(const geometry_msgs::Twist& command) {
    v_ = command.linear.x;
    put();
  }

  void put() {
    kurumaisu::Voltages voltages;
    voltages.header.stamp = ros::Time::now();
    voltages.v = v_;
    voltages_.publish(voltages);
  }

  void publish() {
    nav_msgs::Odometry odometry;
    odometry.header.stamp = ros::Time::now();
    odometry.header.frame_id = "odom";
    odometry.child_frame_id = "base_link";
    odometry.pose.pose.orientation.w = 1;
    odom_.publish(odometry);
    geometry_msgs::TransformStamped transform;
    transform.header = odometry.header;
    transform.child_frame_id = odometry.child_frame_id;
    transform.transform.rotation.w = 1;
    tf_.sendTransform(transform);
    geometry_msgs::TwistStamped survived;
    survived.header.stamp = odometry.header.stamp;
    survived.twist.linear.x = v_;
    survived_.publish(survived);
  }

  double v_ = 0;
  ros::Publisher voltages_;
  ros::Publisher odom_;
  ros::Publisher survived_;
  ros::Subscriber commands_;
  tf2_ros::TransformBroadcaster tf_;
};

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "drive_floor");
  if (argc != 2) {
    std::fprintf(stderr, "usage: drive_floor RATE\n");
    return 2;
  }
  ros::NodeHandle nh;
  Floor(nh).run(std::atof(argv[1]));
  return 0;
}
