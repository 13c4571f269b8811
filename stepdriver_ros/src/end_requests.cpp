#include "end_requests.h"

#include <pthread.h>
#include <ros/init.h>
#include <ros/xmlrpc_manager.h>

#include <algorithm>
#include <ctime>

#include "end_signals.h"

namespace stepdriver::ros_node {
namespace {

// How long a shutdown call, which ends no wait, goes unnoticed at most.
constexpr std::chrono::milliseconds kPoll{20};

}  // namespace

EndRequests::EndRequests() : signals_(endSignals()) {
  pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
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
  for (;;) {
    const auto left = std::chrono::duration_cast<std::chrono::nanoseconds>(
        deadline - std::chrono::steady_clock::now());
    const auto nap = std::clamp<std::chrono::nanoseconds>(left, std::chrono::nanoseconds(0), kPoll);
    const timespec timeout{0, static_cast<long>(nap.count())};
    const int number = sigtimedwait(&signals_, nullptr, &timeout);
    for (const EndSignal& signal : kEndSignals) {
      if (signal.number == number) return signal.name;
    }
    if (shutdown_called_ || ros::isShuttingDown()) return "a shutdown call (rosnode kill)";
    if (left.count() <= 0) return {};
  }
}

}  // namespace stepdriver::ros_node
