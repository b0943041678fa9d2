// SPDX-License-Identifier: BSD-3-Clause
#include "base/node/stop_request.h"

#include <ros/xmlrpc_manager.h>

#include <atomic>
#include <cerrno>
#include <csignal>

#include "guard/crash.h"
#include "signals.h"

namespace kurumaisu {
namespace {

std::atomic<bool> requested{false};

/// The guard need not wait for this loop's next turn.
void onSignal(int /*signal*/) {
  const int error = errno;
  requested = true;
  guard::hangUp();
  errno = error;
}

void onShutdownCall(XmlRpc::XmlRpcValue& /*parameters*/, XmlRpc::XmlRpcValue& result) {
  requested = true;
  result = ros::xmlrpc::responseInt(1, "", 0);
}

}  // namespace

void catchStopRequests() {
  for (int signal = 1; signal <= SIGRTMAX; ++signal) {
    if (isToEnd(signal) && !isCrash(signal)) std::signal(signal, onSignal);
  }
  guard::catchCrashes(onSignal);
  ros::XMLRPCManager::instance()->unbind("shutdown");
  ros::XMLRPCManager::instance()->bind("shutdown", onShutdownCall);
}

bool isStopRequested() { return requested; }

}  // namespace kurumaisu
