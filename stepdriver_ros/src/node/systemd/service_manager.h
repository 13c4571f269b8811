#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// Tells systemd how the node is: ready, alive, ending (sd_notify(3), Type=notify). If the unit has
/// a WatchdogSec=, a thread tells several times in that period that the thread of the machine that
/// all axes wait for still works. If that one hangs, nothing is told, and systemd ends the node.
/// Does nothing if systemd didn't start the node.
class ServiceManager {
 public:
  /// Begins to tell that the node is alive. @param machine outlives it.
  explicit ServiceManager(const machine::Machine& machine);
  /// Ends that.
  ~ServiceManager();
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  static void notifyReady();
  static void notifyEnding();

 private:
  void run(std::chrono::microseconds period);

  const machine::Machine& machine_;
  std::mutex mutex_;
  std::condition_variable stop_asked_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace stepdriver::ros_node
