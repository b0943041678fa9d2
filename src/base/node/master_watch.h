// SPDX-License-Identifier: BSD-3-Clause
// Whether the ROS master is there and knows this node. Without it nobody new can reach the chair, not even to stop it.
#pragma once

#include <ros/time.h>

#include <condition_variable>
#include <memory>
#include <mutex>

namespace kurumaisu {

/// Asks in a thread of its own: a master that does not answer may block whoever asks for minutes.
class MasterWatch {
 public:
  /// timeout [s]; 0: it does not watch.
  explicit MasterWatch(double timeout);
  MasterWatch(const MasterWatch&) = delete;
  MasterWatch& operator=(const MasterWatch&) = delete;

  /// Ends the thread, at its next breath where it is asking; it touches nothing that dies with the node.
  ~MasterWatch();

  /// Whether the master has not answered for longer than the timeout.
  bool lost() const;

  /// Whether it answers, but does not know this node: another one, started in its place.
  bool forgotten() const;

 private:
  struct Shared {
    std::mutex mutex;
    std::condition_variable wake;
    bool stop = false;
    bool forgotten = false;
    ros::SteadyTime answered = ros::SteadyTime::now();
  };

  static void watch(const std::shared_ptr<Shared>& shared, double period);

  double timeout_;
  std::shared_ptr<Shared> shared_ = std::make_shared<Shared>();
};

}  // namespace kurumaisu
