#include "call_queues.h"

#include <thread>

namespace stepdriver::ros_node {
namespace {

constexpr int kControlThreads = 2;
constexpr int kTrajectoryThreads = 2;
constexpr int kSpareLineThreads = 3;
constexpr std::chrono::milliseconds kPoll{5};

}  // namespace

CallQueues::CallQueues(std::size_t axes) : axes_(axes) {}

void CallQueues::start() {
  for (ros::CallbackQueue& queue : axes_) spinners_.emplace_back(kThreadsPerAxis, &queue);
  spinners_.emplace_back(static_cast<std::uint32_t>(axes_.size()) + kSpareLineThreads, &lines_);
  spinners_.emplace_back(kTrajectoryThreads, &trajectories_);
  spinners_.emplace_back(kControlThreads, &control_);
  spinners_.emplace_back(1, &emergency_);
  for (ros::AsyncSpinner& spinner : spinners_) spinner.start();
}

void CallQueues::finish(std::chrono::milliseconds bound) {
  const auto deadline = std::chrono::steady_clock::now() + bound;
  while (!allAnswered() && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(kPoll);
  }
  // Each waits for the calls that its threads are in.
  for (ros::AsyncSpinner& spinner : spinners_) spinner.stop();
}

bool CallQueues::allAnswered() {
  // A queue is empty when nothing is in it and nothing from it is being called.
  bool empty = control_.isEmpty() && emergency_.isEmpty() && lines_.isEmpty();
  for (ros::CallbackQueue& queue : axes_) empty = empty && queue.isEmpty();
  return empty;
}

}  // namespace stepdriver::ros_node
