// SPDX-License-Identifier: BSD-3-Clause
// The D/A converter as a topic: for the simulator and for drivers in other processes.
#pragma once

#include <kurumaisu/Voltages.h>
#include <ros/node_handle.h>

#include "base/dac.h"

namespace kurumaisu {

class TopicDac : public Dac {
 public:
  explicit TopicDac(ros::NodeHandle& nh)
      : stamp(ros::Time::now()), publisher_(nh.advertise<Voltages>("voltages", 10)) {}

  void put(const Output& output) override {
    Voltages message;
    message.header.stamp = stamp;
    message.translation = output.translation;
    message.steering = output.steering;
    message.reference = output.reference;
    message.v = output.v;
    message.w = output.w;
    publisher_.publish(message);
  }

  ros::Time stamp;  ///< of the next sample

 private:
  ros::Publisher publisher_;
};

}  // namespace kurumaisu
