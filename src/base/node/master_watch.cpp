// SPDX-License-Identifier: BSD-3-Clause
#include "base/node/master_watch.h"

#include <ros/master.h>
#include <ros/this_node.h>

#include <chrono>
#include <thread>

namespace kurumaisu {
namespace {

constexpr double kQuestions = 5;  // in a timeout

/// Whether the master, which answers, has this node on its books.
bool isKnown() {
  XmlRpc::XmlRpcValue request;
  XmlRpc::XmlRpcValue response;
  XmlRpc::XmlRpcValue payload;
  request[0] = request[1] = ros::this_node::getName();
  return ros::master::execute("lookupNode", request, response, payload, false);
}

}  // namespace

MasterWatch::MasterWatch(double timeout) : timeout_(timeout) {
  if (timeout > 0) std::thread(watch, shared_, timeout / kQuestions).detach();
}

MasterWatch::~MasterWatch() {
  const std::lock_guard<std::mutex> lock(shared_->mutex);
  shared_->stop = true;
  shared_->wake.notify_all();
}

void MasterWatch::watch(const std::shared_ptr<Shared>& shared, double period) {
  while (true) {
    const bool answers = ros::master::check();
    const bool known = answers && isKnown();
    const bool still = answers && (known || ros::master::check());  // or it died between both questions
    std::unique_lock<std::mutex> lock(shared->mutex);
    if (answers) shared->answered = ros::SteadyTime::now();
    if (still) shared->forgotten = !known;
    if (shared->wake.wait_for(lock, std::chrono::duration<double>(period), [&] { return shared->stop; }))
      return;
  }
}

bool MasterWatch::lost() const {
  if (timeout_ == 0) return false;
  const std::lock_guard<std::mutex> lock(shared_->mutex);
  return (ros::SteadyTime::now() - shared_->answered).toSec() > timeout_;
}

bool MasterWatch::forgotten() const {
  const std::lock_guard<std::mutex> lock(shared_->mutex);
  return shared_->forgotten;
}

}  // namespace kurumaisu
