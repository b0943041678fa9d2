// SPDX-License-Identifier: BSD-3-Clause
// The D/A converter as a topic: for the simulator, for drivers in other processes, and for the record.
#pragma once

#include <kurumaisu/Voltages.h>
#include <ros/node_handle.h>

#include <limits>

#include "base/dac.h"

namespace kurumaisu {

class TopicDac : public Dac {
 public:
  /// converter: gets every sample first, and what it really holds is published; or none.
  TopicDac(ros::NodeHandle& nh, Dac* converter)
      : stamp(ros::Time::now()), converter_(converter), publisher_(nh.advertise<Voltages>("voltages", 10)) {}

  Output put(const Output& asked) override {
    const Output output = converter_ != nullptr ? converter_->put(asked) : asked;
    Voltages message;
    message.header.stamp = stamp;
    message.translation = output.translation;
    message.steering = output.steering;
    message.reference = output.reference;
    message.v = output.v;
    message.w = output.w;
    publisher_.publish(message);
    return output;
  }

  double patience() const override {
    return converter_ != nullptr ? converter_->patience() : std::numeric_limits<double>::infinity();
  }

  ros::Time stamp;  ///< of the next sample

 private:
  Dac* converter_;
  ros::Publisher publisher_;
};

}  // namespace kurumaisu
