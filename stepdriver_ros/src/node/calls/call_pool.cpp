#include "call_pool.h"

#include <pthread.h>
#include <ros/console.h>
#include <sys/prctl.h>

#include <algorithm>
#include <system_error>

namespace stepdriver::ros_node {

void CallPool::start(std::size_t threads) {
  const std::lock_guard<std::mutex> lock(mutex_);
  serving_ = true;
  while (threads_.size() < std::max(threads, ready_.size())) startThread();
}

void CallPool::stop() {
  std::vector<std::thread> threads;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    serving_ = false;
    threads.swap(threads_);
  }
  call_ready_.notify_all();
  for (std::thread& thread : threads) thread.join();
}

void CallPool::add(PooledQueue& queue) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (queue.under_way_ < queue.most_) {
    makeReady(queue);
  } else {
    ++queue.waiting_;
  }
}

void CallPool::makeReady(PooledQueue& queue) {
  ++queue.under_way_;
  ready_.push_back(&queue);
  call_ready_.notify_one();
  if (!serving_ || ready_.size() <= free_) return;
  try {
    startThread();
  } catch (const std::system_error& error) {
    ROS_ERROR_THROTTLE_NAMED(1.0, "node",
                             "A call waits until another ends: no thread can be started for it: %s",
                             error.what());
  }
}

void CallPool::startThread() {
  threads_.emplace_back([this] {
    pthread_setname_np(pthread_self(), "calls");
    // Calls wait for the pulse thread in naps shorter than the default slack, 50 us.
    prctl(PR_SET_TIMERSLACK, 1UL, 0, 0, 0);
    serve();
  });
  ++free_;
}

void CallPool::serve() {
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    call_ready_.wait(lock, [this] { return !serving_ || !ready_.empty(); });
    if (!serving_) return;
    --free_;
    PooledQueue& queue = *ready_.front();
    ready_.pop_front();
    lock.unlock();
    const auto result = queue.callOne();
    lock.lock();
    ++free_;
    --queue.under_way_;
    // A subscriber's next message can't be handled during the last one: it goes back to the queue.
    if (result == ros::CallbackQueue::TryAgain) ++queue.waiting_;
    if (queue.waiting_ == 0) continue;
    --queue.waiting_;
    makeReady(queue);
  }
}

void PooledQueue::addCallback(const ros::CallbackInterfacePtr& callback, std::uint64_t removal_id) {
  ros::CallbackQueue::addCallback(callback, removal_id);
  pool_.add(*this);
}

}  // namespace stepdriver::ros_node
