#include "end_requests.h"

#include <pthread.h>
#include <ros/init.h>
#include <ros/xmlrpc_manager.h>
#include <unistd.h>

#include <ctime>

#include "end_signals.h"

namespace stepdriver::ros_node {

namespace {

sigset_t signalsOf(EndRequests::Usr1 usr1) {
  sigset_t signals = endSignals();
  if (usr1 == EndRequests::Usr1::kAsksForARecording) sigaddset(&signals, SIGUSR1);
  return signals;
}

}  // namespace

EndRequests::EndRequests(Usr1 usr1) : signals_(signalsOf(usr1)) {
  pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
}

void EndRequests::takeOverShutdownCall() {
  const ros::XMLRPCManagerPtr& manager = ros::XMLRPCManager::instance();
  manager->unbind("shutdown");
  manager->bind("shutdown", [this](XmlRpc::XmlRpcValue& /*call*/, XmlRpc::XmlRpcValue& result) {
    shutdown_called_ = true;
    kill(getpid(), SIGTERM);  // ends the wait
    result[0] = 1;
    result[1] = std::string();
    result[2] = 0;
  });
}

std::string EndRequests::waitFor(std::chrono::milliseconds time) {
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(time);
  const std::chrono::nanoseconds rest = time - seconds;
  const timespec timeout{static_cast<time_t>(seconds.count()), static_cast<long>(rest.count())};
  const int number = sigtimedwait(&signals_, nullptr, &timeout);
  if (shutdown_called_ || ros::isShuttingDown()) return "a shutdown call (rosnode kill)";
  recording_ = recording_ || number == SIGUSR1;
  for (const EndSignal& signal : kEndSignals) {
    if (signal.number == number) return signal.name;
  }
  return {};
}

}  // namespace stepdriver::ros_node
