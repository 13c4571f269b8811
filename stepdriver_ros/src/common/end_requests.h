#pragma once

#include <atomic>
#include <chrono>
#include <csignal>
#include <string>
#include <utility>

namespace stepdriver::ros_node {

/// Requests to end the node: the signals of endSignals(), and the shutdown call of `rosnode kill`
/// and of the master. The stepdriver node is also asked for recordings by SIGUSR1. There is one
/// object, created first in main(), that outlives ros::shutdown(); the main thread calls waitFor().
class EndRequests {
 public:
  enum class Usr1 { kEndsTheProgram, kAsksForARecording };

  /// Blocks the signals in this thread and in all threads that it starts from now on.
  explicit EndRequests(Usr1 usr1 = Usr1::kEndsTheProgram);
  EndRequests(const EndRequests&) = delete;
  EndRequests& operator=(const EndRequests&) = delete;

  /// Takes over the node's shutdown call, after ros::start(). roscpp's own drops all connections at
  /// once: waiting clients would never learn how their moves ended.
  void takeOverShutdownCall();

  /// Waits for a request.
  ///
  /// @return who asked; empty: no request in this time, or one for a recording.
  std::string waitFor(std::chrono::milliseconds time);

  /// Whether SIGUSR1 has come since the last call. From the thread that calls waitFor().
  bool takeRecordingRequest() { return std::exchange(recording_, false); }

 private:
  const sigset_t signals_;
  bool recording_ = false;
  std::atomic<bool> shutdown_called_{false};
};

}  // namespace stepdriver::ros_node
