#pragma once

#include <atomic>
#include <chrono>
#include <csignal>
#include <string>

namespace stepdriver::ros_node {

/// Requests to end the node: the signals of endSignals(), and the shutdown call of `rosnode kill`
/// and of the master. There is one object, created first in main(), that outlives ros::shutdown();
/// the main thread calls waitFor().
class EndRequests {
 public:
  /// Blocks the signals in this thread and in all threads that it starts from now on.
  EndRequests();
  EndRequests(const EndRequests&) = delete;
  EndRequests& operator=(const EndRequests&) = delete;

  /// Takes over the node's shutdown call, after ros::start(). roscpp's own drops all connections at
  /// once: waiting clients would never learn how their moves ended.
  void takeOverShutdownCall();

  /// Waits for a request.
  ///
  /// @return who asked; empty: no request in this time.
  std::string waitFor(std::chrono::milliseconds time);

 private:
  const sigset_t signals_;
  std::atomic<bool> shutdown_called_{false};
};

}  // namespace stepdriver::ros_node
