#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>

#include <chrono>
#include <cstddef>
#include <deque>

#include "call_pool.h"

namespace stepdriver::ros_node {

/// The queues of service calls and their threads, made so that a call that waits holds up no other.
///
/// Each axis has a queue of its own. Of its share of threads a waiting move takes one, as an axis
/// moves once at a time, and a disable or a microstep change that waits for rest another; calls
/// that find the rest taken wait no longer than a chip takes to wake or to be reset. Lines of
/// several axes have a thread for each axis, as each moves in one line at a time, and some for
/// lines that wait for their axes to rest. Threads are started when so many calls are under way at
/// once, and then shared by all axes. At rest no thread wakes.
///
/// Nothing that stops a motion waits behind anything else. Stops and holds have a thread of their
/// own from the start, which takes them in the order in which they come, and so has the emergency
/// stop. Enabling and disabling has a share of its own for each axis, as a disable waits for rest.
///
/// Made and used by one thread; the queues themselves may be used by any.
class CallQueues {
 public:
  /// How many calls of an axis are under way at once, at most.
  static constexpr int kThreadsPerAxis = 4;
  /// How many of the calls that enable or disable an axis are, besides.
  static constexpr int kPowerThreadsPerAxis = 2;

  explicit CallQueues(std::size_t axes);
  ~CallQueues() { stop(); }
  CallQueues(const CallQueues&) = delete;
  CallQueues& operator=(const CallQueues&) = delete;

  /// Calls that may take as long as a motion of this axis.
  ros::CallbackQueue& ofAxis(std::size_t axis) { return axes_.at(axis); }
  /// Calls that may take as long as a motion of several axes.
  ros::CallbackQueue& lines() { return lines_; }
  /// Trajectories: goals, messages, cancels and what becomes of them. To plan one takes a while.
  ros::CallbackQueue& trajectories() { return trajectories_; }
  /// Calls that enable or disable this axis.
  ros::CallbackQueue& power(std::size_t axis) { return power_.at(axis); }
  /// Recover, resume, and all that answers at once.
  ros::CallbackQueue& control() { return control_; }
  /// Stops and holds, which answer at once.
  ros::CallbackQueue& stops() { return stops_; }
  ros::CallbackQueue& emergency() { return emergency_; }

  /// Starts the threads; to be called when everything has been advertised.
  void start();

  /// Waits until every call has its answer, but not longer than the bound for calls that only
  /// begin; then ends the threads.
  void finish(std::chrono::milliseconds bound);

 private:
  bool allAnswered();
  void stop();

  CallPool waiting_pool_;
  CallPool control_pool_;
  CallPool stop_pool_;
  CallPool emergency_pool_;
  std::deque<PooledQueue> axes_;
  std::deque<PooledQueue> power_;
  PooledQueue lines_;
  PooledQueue trajectories_;
  PooledQueue control_;
  PooledQueue stops_;
  PooledQueue emergency_;
};

/// A handle for what is to be served by a queue.
inline ros::NodeHandle onQueue(ros::CallbackQueue& queue, ros::NodeHandle node) {
  node.setCallbackQueue(&queue);
  return node;
}

}  // namespace stepdriver::ros_node
