#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

#include "node/machine_time.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// Publishes ~io_states: each change of an output or an input with a name, from a thread of its
/// own. Without any it publishes only once.
class IoPublisher {
 public:
  /// @param node the node's private handle.
  /// @param machine, and the clock of the time, outlive the publisher.
  IoPublisher(ros::NodeHandle node, machine::Machine& machine, const MachineTime& time);
  /// Publishes what is left, and ends the thread.
  ~IoPublisher();
  IoPublisher(const IoPublisher&) = delete;
  IoPublisher& operator=(const IoPublisher&) = delete;

 private:
  struct Change {
    machine::IoStates states;
    MachineTime::Now seen;
  };

  void add(const machine::IoStates& states);
  void run();
  void publish(const Change& change);

  machine::Machine& machine_;
  const MachineTime time_;
  ros::Publisher publisher_;

  std::mutex mutex_;
  std::condition_variable added_;
  std::deque<Change> changes_;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace stepdriver::ros_node
