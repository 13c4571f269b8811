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

/// Threads shared by several queues of calls. They sleep until there is a call, without a timeout;
/// another one starts when a call finds all of them busy, and stays.
///
/// Created, started and stopped by one thread.
class CallPool {
 public:
  CallPool() = default;
  ~CallPool() { stop(); }
  CallPool(const CallPool&) = delete;
  CallPool& operator=(const CallPool&) = delete;

  /// Serves the present and all later calls.
  ///
  /// @param threads that exist from the beginning.
  void start(std::size_t threads);

  /// Waits for the calls in progress, and ends the threads. Later calls wait for ever.
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
  std::deque<PooledQueue*> ready_;  // one entry for each call that may begin
  std::vector<std::thread> threads_;
  std::size_t free_ = 0;  // idle threads
  bool serving_ = false;
};

/// A queue whose calls use threads of a pool, but never more than its share, so that waiting calls
/// of one queue don't delay those of another. They begin in their order.
class PooledQueue : public ros::CallbackQueue {
 public:
  /// @param pool outlives the queue's last call.
  /// @param most its share: how many calls run at once.
  PooledQueue(CallPool& pool, int most) : pool_(pool), most_(most) {}

  /// Safe from any thread.
  void addCallback(const ros::CallbackInterfacePtr& callback, std::uint64_t removal_id) override;

 private:
  friend class CallPool;

  CallPool& pool_;
  const int most_;
  // Both under the pool's mutex.
  int under_way_ = 0;
  std::size_t waiting_ = 0;  // calls that wait because the share is used up
};

}  // namespace stepdriver::ros_node
