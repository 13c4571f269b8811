#include "node/calls/call_pool.h"

#include <gtest/gtest.h>
#include <ros/callback_queue_interface.h>

#include <atomic>
#include <condition_variable>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <set>
#include <thread>
#include <utility>
#include <vector>

#include "node/calls/call_queues.h"
#include "support/wait.h"

namespace stepdriver::ros_node {
namespace {

using node_test::kBound;

using Result = ros::CallbackInterface::CallResult;

class Call : public ros::CallbackInterface {
 public:
  explicit Call(std::function<Result()> action) : action_(std::move(action)) {}
  Result call() override { return action_(); }

 private:
  std::function<Result()> action_;
};

void add(ros::CallbackQueue& queue, const std::function<void()>& action) {
  queue.addCallback(boost::make_shared<Call>([action] {
                      action();
                      return Result::Success;
                    }),
                    1);
}

bool comes(std::promise<void>& promise) {
  return promise.get_future().wait_for(kBound) == std::future_status::ready;
}

/// Calls wait at it until the test opens it.
class Gate {
 public:
  ~Gate() { open(); }
  void wait() {
    std::unique_lock<std::mutex> lock(mutex_);
    ++waiting_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return open_; });
  }
  void open() {
    const std::lock_guard<std::mutex> lock(mutex_);
    open_ = true;
    changed_.notify_all();
  }
  bool awaitWaiting(int calls) {
    std::unique_lock<std::mutex> lock(mutex_);
    return changed_.wait_for(lock, kBound, [this, calls] { return waiting_ >= calls; });
  }
  int waiting() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return waiting_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool open_ = false;
  int waiting_ = 0;
};

TEST(CallPool, AQueueWhoseCallsWaitHoldsUpNoOther) {
  CallPool pool;
  PooledQueue waiting(pool, 3);
  PooledQueue other(pool, 1);
  Gate gate;
  std::promise<void> called;
  pool.start(1);
  for (int i = 0; i < 10; ++i) add(waiting, [&gate] { gate.wait(); });
  ASSERT_TRUE(gate.awaitWaiting(3));
  add(other, [&called] { called.set_value(); });
  ASSERT_TRUE(comes(called));
  EXPECT_EQ(gate.waiting(), 3) << "it has its share, and no more";
  gate.open();
  ASSERT_TRUE(gate.awaitWaiting(10));
  pool.stop();
}

TEST(CallPool, ServesWhatCameBeforeItsStartAndInOrder) {
  CallPool pool;
  PooledQueue queue(pool, 1);
  std::vector<int> order;
  std::promise<void> last;
  for (int i = 0; i < 100; ++i) add(queue, [&order, i] { order.push_back(i); });
  add(queue, [&last] { last.set_value(); });
  pool.start(2);
  ASSERT_TRUE(comes(last));
  ASSERT_EQ(order.size(), 100U);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(order[i], i);
  pool.stop();
}

TEST(CallPool, LosesNoCall) {
  constexpr int kCallers = 4;
  constexpr int kCalls = 5000;
  CallPool pool;
  std::vector<std::unique_ptr<PooledQueue>> queues;
  for (int share : {1, 2, 4}) queues.push_back(std::make_unique<PooledQueue>(pool, share));
  std::atomic<int> called{0};
  std::promise<void> last;
  pool.start(1);
  std::vector<std::future<void>> callers;
  callers.reserve(kCallers);
  for (int caller = 0; caller < kCallers; ++caller) {
    callers.push_back(std::async(std::launch::async, [&] {
      for (int i = 0; i < kCalls; ++i) {
        add(*queues[i % queues.size()], [&] {
          if (++called == kCallers * kCalls) last.set_value();
        });
      }
    }));
  }
  ASSERT_TRUE(comes(last));
  pool.stop();
  for (const auto& queue : queues) EXPECT_TRUE(queue->isEmpty());
}

TEST(CallPool, UsesItsThreadsAgain) {
  CallPool pool;
  PooledQueue queue(pool, 4);
  std::set<std::thread::id> threads;
  pool.start(1);
  for (int i = 0; i < 100; ++i) {
    std::promise<void> called;
    add(queue, [&] {
      threads.insert(std::this_thread::get_id());
      called.set_value();
    });
    ASSERT_TRUE(comes(called));
  }
  pool.stop();
  // The next call may come before the threads of the previous ones are free again.
  EXPECT_LE(threads.size(), 4U);
}

TEST(CallPool, CallsAgainWhatCannotBeCalledYet) {
  CallPool pool;
  PooledQueue queue(pool, 1);
  std::promise<void> called;
  int tries = 0;
  pool.start(1);
  queue.addCallback(boost::make_shared<Call>([&] {
                      if (++tries < 3) return Result::TryAgain;
                      called.set_value();
                      return Result::Success;
                    }),
                    1);
  ASSERT_TRUE(comes(called));
  EXPECT_EQ(tries, 3);
  pool.stop();
}

TEST(CallPool, StopWaitsForTheCallThatIsUnderWay) {
  CallPool pool;
  PooledQueue queue(pool, 1);
  Gate gate;
  std::atomic<bool> ended{false};
  pool.start(1);
  add(queue, [&] {
    gate.wait();
    ended = true;
  });
  ASSERT_TRUE(gate.awaitWaiting(1));
  auto stopping = std::async(std::launch::async, [&] {
    pool.stop();
    return ended.load();
  });
  gate.open();
  EXPECT_TRUE(stopping.get());
}

TEST(CallQueues, LetNoDisableWaitBehindOtherCallsThatWait) {
  constexpr int kMany = 10;
  CallQueues queues(1);
  Gate gate;
  queues.start();
  for (ros::CallbackQueue* queue :
       {&queues.control(), &queues.ofAxis(0), &queues.lines(), &queues.trajectories()}) {
    for (int i = 0; i < kMany; ++i) add(*queue, [&gate] { gate.wait(); });
  }
  ASSERT_TRUE(gate.awaitWaiting(2 + CallQueues::kThreadsPerAxis));
  std::promise<void> called;
  add(queues.power(0), [&called] { called.set_value(); });
  ASSERT_TRUE(comes(called));
  gate.open();
  queues.finish(kBound);
}

}  // namespace
}  // namespace stepdriver::ros_node
