#include "end_requests.h"

#include <pthread.h>
#include <ros/init.h>
#include <ros/xmlrpc_manager.h>

#include <algorithm>
#include <csignal>
#include <ctime>

namespace stepdriver::ros_node {
namespace {

// How long a shutdown call, which ends no wait, goes unnoticed at most.
constexpr std::chrono::milliseconds kPoll{20};

sigset_t endSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  return signals;
}

}  // namespace

EndRequests::EndRequests() {
  const sigset_t signals = endSignals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
}

void EndRequests::takeOverShutdownCall() {
  const ros::XMLRPCManagerPtr& manager = ros::XMLRPCManager::instance();
  manager->unbind("shutdown");
  manager->bind("shutdown", [this](XmlRpc::XmlRpcValue& /*call*/, XmlRpc::XmlRpcValue& result) {
    shutdown_called_ = true;
    result[0] = 1;
    result[1] = std::string();
    result[2] = 0;
  });
}

std::string EndRequests::waitFor(std::chrono::milliseconds time) {
  const auto deadline = std::chrono::steady_clock::now() + time;
  const sigset_t signals = endSignals();
  for (;;) {
    const auto left = std::chrono::duration_cast<std::chrono::nanoseconds>(
        deadline - std::chrono::steady_clock::now());
    const auto nap = std::clamp<std::chrono::nanoseconds>(left, std::chrono::nanoseconds(0), kPoll);
    const timespec timeout{0, static_cast<long>(nap.count())};
    const int signal = sigtimedwait(&signals, nullptr, &timeout);
    if (signal == SIGINT) return "SIGINT";
    if (signal == SIGTERM) return "SIGTERM";
    if (shutdown_called_ || ros::isShuttingDown()) return "a shutdown call (rosnode kill)";
    if (left.count() <= 0) return {};
  }
}

}  // namespace stepdriver::ros_node
