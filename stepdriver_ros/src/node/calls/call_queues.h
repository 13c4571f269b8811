#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>

#include <chrono>
#include <cstddef>
#include <deque>

#include "call_pool.h"
#include "trigger_server.h"

namespace stepdriver::ros_node {

/// The queues of service calls, the servers of those that stop motions, and the threads of both. A
/// waiting call never delays another.
///
/// Each axis has its own queue. A waiting move uses one thread of its share, because an axis makes
/// one move at a time, and a disable or a microstep change that waits for standstill uses another.
/// Calls that find the other threads busy wait no longer than a chip takes to wake up or to be
/// reset. Lines of several axes have a thread for each axis, because each moves in one line at a
/// time, and some more for lines that wait for their axes to come to rest. Threads start when that
/// many calls run at once, and are then shared by all axes. At rest no thread wakes up.
///
/// Nothing that stops a motion waits behind another call. Stops and holds have a socket and a
/// thread of their own, which serves them one after another, and so does the emergency stop: they
/// don't even wait while roscpp reads a long message. Enabling and disabling has its own share for
/// each axis, and one for all axes at once, because a disable waits for standstill.
///
/// Created and used by one thread; any thread may use the queues themselves.
class CallQueues {
 public:
  /// How many calls of an axis run at once, at most.
  static constexpr int kThreadsPerAxis = 4;
  /// In addition, how many calls that enable or disable an axis run at once.
  static constexpr int kPowerThreadsPerAxis = 2;

  /// @param axes, outputs how many there are; outputs are those with a name.
  explicit CallQueues(std::size_t axes, std::size_t outputs = 0);
  ~CallQueues() { stop(); }
  CallQueues(const CallQueues&) = delete;
  CallQueues& operator=(const CallQueues&) = delete;

  /// Calls that may take as long as a motion of this axis.
  ros::CallbackQueue& ofAxis(std::size_t axis) { return axes_.at(axis); }
  /// Calls that may take as long as a motion of several axes.
  ros::CallbackQueue& lines() { return lines_; }
  /// Trajectories: goals, messages, cancels and results. Planning one takes a while.
  ros::CallbackQueue& trajectories() { return trajectories_; }
  /// Messages of setpoints. One that must wake its axes waits for them.
  ros::CallbackQueue& streams() { return streams_; }
  /// Calls that switch outputs. Each may wait for the least time of its output.
  ros::CallbackQueue& outputs() { return outputs_; }
  /// Calls that write files, one after another.
  ros::CallbackQueue& recordings() { return recordings_; }
  /// Calls that enable or disable this axis.
  ros::CallbackQueue& power(std::size_t axis) { return power_.at(axis); }
  /// Calls that enable or disable all axes.
  ros::CallbackQueue& powerOfAll() { return power_.back(); }
  /// Recover, resume, and everything that answers at once.
  ros::CallbackQueue& control() { return control_; }
  /// Stops and holds, which answer at once.
  TriggerServer& stops() { return stops_; }
  TriggerServer& emergency() { return emergency_; }

  /// Starts the threads. Call it when everything has been advertised.
  void start();

  /// Waits until every call is answered, but no longer than the bound for calls that only begin;
  /// then ends the threads.
  void finish(std::chrono::milliseconds bound);

 private:
  bool allAnswered();
  void stop();

  CallPool waiting_pool_;
  CallPool control_pool_;
  std::deque<PooledQueue> axes_;
  // One for the calls of each axis, and the last for those of all axes.
  std::deque<PooledQueue> power_;
  PooledQueue lines_;
  PooledQueue trajectories_;
  PooledQueue streams_;
  PooledQueue outputs_;
  PooledQueue recordings_;
  PooledQueue control_;
  TriggerServer stops_;
  TriggerServer emergency_;
};

/// A handle whose callbacks a queue serves.
inline ros::NodeHandle onQueue(ros::CallbackQueue& queue, ros::NodeHandle node) {
  node.setCallbackQueue(&queue);
  return node;
}

}  // namespace stepdriver::ros_node
