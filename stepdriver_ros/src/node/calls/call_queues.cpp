#include "call_queues.h"

#include <thread>

namespace stepdriver::ros_node {
namespace {

constexpr int kControlThreads = 2;
constexpr int kTrajectoryThreads = 2;
constexpr int kSpareLineThreads = 3;
// Threads that exist before any call waits.
constexpr int kFirstThreads = 2;
constexpr std::chrono::milliseconds kPoll{5};

}  // namespace

CallQueues::CallQueues(std::size_t axes, std::size_t outputs)
    : lines_(waiting_pool_, static_cast<int>(axes) + kSpareLineThreads),
      trajectories_(waiting_pool_, kTrajectoryThreads),
      streams_(waiting_pool_, static_cast<int>(axes) + 1),
      outputs_(waiting_pool_, static_cast<int>(3 * outputs) + 1),
      recordings_(waiting_pool_, 1),
      control_(control_pool_, kControlThreads),
      stops_("stops"),
      emergency_("emergency stop") {
  for (std::size_t i = 0; i < axes; ++i) {
    axes_.emplace_back(waiting_pool_, kThreadsPerAxis);
    power_.emplace_back(waiting_pool_, kPowerThreadsPerAxis);
  }
  power_.emplace_back(waiting_pool_, kPowerThreadsPerAxis);
}

void CallQueues::start() {
  waiting_pool_.start(kFirstThreads);
  control_pool_.start(kControlThreads);
  stops_.start();
  emergency_.start();
}

void CallQueues::finish(std::chrono::milliseconds bound) {
  const auto deadline = std::chrono::steady_clock::now() + bound;
  while (!allAnswered() && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(kPoll);
  }
  stop();
  for (TriggerServer* server : {&stops_, &emergency_}) {
    const auto left = deadline - std::chrono::steady_clock::now();
    server->finish(std::chrono::ceil<std::chrono::milliseconds>(left));
  }
}

void CallQueues::stop() {
  waiting_pool_.stop();
  control_pool_.stop();
}

bool CallQueues::allAnswered() {
  // A queue is empty when it contains no call and none of its calls is running.
  bool empty =
      control_.isEmpty() && lines_.isEmpty() && outputs_.isEmpty() && recordings_.isEmpty();
  for (ros::CallbackQueue& queue : axes_) empty = empty && queue.isEmpty();
  for (ros::CallbackQueue& queue : power_) empty = empty && queue.isEmpty();
  return empty;
}

}  // namespace stepdriver::ros_node
