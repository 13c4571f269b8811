#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::ros_node {

/// Publishes ~io_states: each change of an output or an input with a name, from a thread of its
/// own. Without any it publishes only once.
class IoPublisher {
 public:
  /// @param node the node's private handle.
  /// @param machine, clock outlive the publisher.
  /// @param speed of the clock: its seconds per second; 0: it doesn't follow the time.
  IoPublisher(ros::NodeHandle node, machine::Machine& machine, pulse::Clock& clock, double speed);
  /// Publishes what is left, and ends the thread.
  ~IoPublisher();
  IoPublisher(const IoPublisher&) = delete;
  IoPublisher& operator=(const IoPublisher&) = delete;

 private:
  struct Change {
    machine::IoStates states;
    ros::Time time;              // of ROS,
    pulse::Nanoseconds now = 0;  // and of the machine
  };

  void add(const machine::IoStates& states);
  void run();
  void publish(const Change& change);
  ros::Time rosTime(const Change& change, pulse::Nanoseconds time) const;

  machine::Machine& machine_;
  pulse::Clock& clock_;
  const double speed_;
  ros::Publisher publisher_;

  std::mutex mutex_;
  std::condition_variable added_;
  std::deque<Change> changes_;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace stepdriver::ros_node
