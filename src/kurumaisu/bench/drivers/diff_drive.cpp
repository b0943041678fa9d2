// SPDX-License-Identifier: BSD-3-Clause
// diff_drive RATE: ros_controllers' diff_drive_controller as scripts/bench drive --peer wants it: commands in on
// experiment_vel, the speed that its wheels are told out on voltages. A loop as controller_manager's, without it: callbacks in a
// spinner's thread, update() by the clock. At its end it says what an update() took.
#include <diff_drive_controller/diff_drive_controller.h>
#include <hardware_interface/robot_hw.h>
#include <kurumaisu/Voltages.h>
#include <ros/ros.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace {

constexpr double kRadius = 0.16;      // [m] of the wheels
constexpr double kSeparation = 0.53;  // [m]

/// A wheel that does what it is told.
struct Wheel {
  double position = 0;
  double velocity = 0;
  double effort = 0;
  double command = 0;

  void turn(double dt) {
    velocity = command;
    position += dt * velocity;
  }
};

void setParameters(const ros::NodeHandle& nh, double rate) {
  nh.setParam("left_wheel", "left");
  nh.setParam("right_wheel", "right");
  nh.setParam("wheel_radius", kRadius);
  nh.setParam("wheel_separation", kSeparation);
  nh.setParam("publish_rate", rate);
  nh.setParam("publish_cmd", true);
  for (const char* name : {"pose_covariance_diagonal", "twist_covariance_diagonal"})
    nh.setParam(name, std::vector<double>(6, 0.01));
  nh.setParam("linear/x/has_velocity_limits", true);
  nh.setParam("linear/x/max_velocity", 1.5);
  nh.setParam("linear/x/has_acceleration_limits", true);
  nh.setParam("linear/x/max_acceleration", 5.0);
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(ros::M_string{{"/diff_drive/cmd_vel", "/experiment_vel"}}, "diff_drive");
  if (argc != 2) {
    std::fprintf(stderr, "usage: diff_drive RATE\n");
    return 2;
  }
  ros::NodeHandle root, own("~");
  const double rate = std::atof(argv[1]);
  setParameters(own, rate);
  std::array<Wheel, 2> wheels;
  hardware_interface::JointStateInterface states;
  hardware_interface::VelocityJointInterface velocities;
  for (std::size_t i = 0; i < 2; ++i) {
    Wheel& wheel = wheels[i];
    states.registerHandle({i == 0 ? "left" : "right", &wheel.position, &wheel.velocity, &wheel.effort});
    velocities.registerHandle({states.getHandle(i == 0 ? "left" : "right"), &wheel.command});
  }
  diff_drive_controller::DiffDriveController controller;
  hardware_interface::RobotHW robot;
  robot.registerInterface(&velocities);
  controller_interface::ControllerBase& base = controller;
  controller_interface::ControllerBase::ClaimedResources claimed;
  if (!base.initRequest(&robot, root, own, claimed)) return 1;
  ros::Publisher voltages = root.advertise<kurumaisu::Voltages>("voltages", 10);
  ros::AsyncSpinner spinner(1);
  spinner.start();
  base.startRequest(ros::Time::now());
  double spent = 0;
  long updates = 0;
  for (ros::WallRate loop(rate); ros::ok(); loop.sleep()) {
    for (Wheel& wheel : wheels) wheel.turn(1 / rate);
    kurumaisu::Voltages said;
    said.header.stamp = ros::Time::now();
    const auto begin = std::chrono::steady_clock::now();
    controller.update(said.header.stamp, ros::Duration(1 / rate));
    spent += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    ++updates;
    said.v = kRadius * (wheels[0].command + wheels[1].command) / 2;
    voltages.publish(said);
  }
  std::fprintf(stderr, "update(): %.2f us\n", 1e6 * spent / static_cast<double>(updates));
  return 0;
}
