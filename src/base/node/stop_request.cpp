// SPDX-License-Identifier: BSD-3-Clause
#include "base/node/stop_request.h"

#include <ros/xmlrpc_manager.h>

#include <atomic>
#include <csignal>

namespace kurumaisu {
namespace {

std::atomic<bool> requested{false};

void onShutdownCall(XmlRpc::XmlRpcValue& /*parameters*/, XmlRpc::XmlRpcValue& result) {
  requested = true;
  result = ros::xmlrpc::responseInt(1, "", 0);
}

}  // namespace

void catchStopRequests() {
  for (const int signal : {SIGINT, SIGTERM}) {
    std::signal(signal, [](int /*signal*/) { requested = true; });
  }
  ros::XMLRPCManager::instance()->unbind("shutdown");
  ros::XMLRPCManager::instance()->bind("shutdown", onShutdownCall);
}

bool isStopRequested() { return requested; }

}  // namespace kurumaisu
