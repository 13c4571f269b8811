#pragma once

#include <atomic>
#include <chrono>
#include <csignal>
#include <string>

namespace stepdriver::ros_node {

/// What asks the node to end: the signals of endSignals(), and the shutdown call of `rosnode kill`
/// and of the master. One object, made first thing in main(), that outlives ros::shutdown();
/// waitFor() is called by main's thread.
class EndRequests {
 public:
  /// Blocks the signals in this thread and in all that it starts from now on.
  EndRequests();
  EndRequests(const EndRequests&) = delete;
  EndRequests& operator=(const EndRequests&) = delete;

  /// Takes over the node's shutdown call, once ros::start() has been called. roscpp's own drops
  /// all connections at once: clients that wait would never hear how their moves ended.
  void takeOverShutdownCall();

  /// Waits for a request.
  ///
  /// @return who asked; empty: nobody in this time.
  std::string waitFor(std::chrono::milliseconds time);

 private:
  const sigset_t signals_;
  std::atomic<bool> shutdown_called_{false};
};

}  // namespace stepdriver::ros_node
