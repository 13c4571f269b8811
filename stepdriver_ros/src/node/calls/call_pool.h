#pragma once

#include <ros/callback_queue.h>

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <thread>
#include <vector>

namespace stepdriver::ros_node {

class PooledQueue;

/// Threads that several queues of calls share. They sleep until there is a call, without a
/// time-out; one more is started when a call finds them all busy, and stays.
///
/// Made, started and stopped by one thread.
class CallPool {
 public:
  CallPool() = default;
  ~CallPool() { stop(); }
  CallPool(const CallPool&) = delete;
  CallPool& operator=(const CallPool&) = delete;

  /// Serves the calls that there are by now, and those to come.
  ///
  /// @param threads that are there from the beginning.
  void start(std::size_t threads);

  /// Waits for the calls that are under way, and ends the threads. Calls that come later wait for
  /// ever.
  void stop();

 private:
  friend class PooledQueue;

  /// Another call is in a queue. Safe from any thread.
  void add(PooledQueue& queue);
  void serve();
  void makeReady(PooledQueue& queue);
  void startThread();

  std::mutex mutex_;
  std::condition_variable call_ready_;
  std::deque<PooledQueue*> ready_;  // each as often as one of its calls may begin
  std::vector<std::thread> threads_;
  std::size_t free_ = 0;  // threads that are in no call
  bool serving_ = false;
};

/// A queue whose calls take threads of a pool, but never more than its share: so calls of one queue
/// that wait don't hold up those of another. They begin in their order.
class PooledQueue : public ros::CallbackQueue {
 public:
  /// @param pool outlives the queue's last call.
  /// @param most how many of its calls are under way at once.
  PooledQueue(CallPool& pool, int most) : pool_(pool), most_(most) {}

  /// Safe from any thread.
  void addCallback(const ros::CallbackInterfacePtr& callback, std::uint64_t removal_id) override;

 private:
  friend class CallPool;

  CallPool& pool_;
  const int most_;
  // Both under the pool's mutex.
  int under_way_ = 0;
  std::size_t waiting_ = 0;  // calls that found all of its share taken
};

}  // namespace stepdriver::ros_node
