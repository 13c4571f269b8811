#include "io_publisher.h"

#include <pthread.h>
#include <stepdriver/IoStates.h>

#include <utility>

namespace stepdriver::ros_node {
namespace {

// Changes that wait for the thread, or in it for a subscriber: an input that never settles must not
// fill the memory. The latest states are always kept.
constexpr std::size_t kMostChanges = 1000;
constexpr int kIoQueueSize = 100;

}  // namespace

IoPublisher::IoPublisher(ros::NodeHandle node, machine::Machine& machine, const MachineTime& time)
    : machine_(machine), time_(time) {
  publisher_ = node.advertise<IoStates>("io_states", kIoQueueSize, true);
  const machine::IoStates states = machine.ioStates();
  if (states.outputs.empty() && states.inputs.empty()) {
    publish({states, time_.now()});
    return;
  }
  machine_.onIoChange([this](const machine::IoStates& changed) { add(changed); });
  add(machine.ioStates());  // those of the start, also if nothing changes
  thread_ = std::thread([this] { run(); });
}

IoPublisher::~IoPublisher() {
  if (!thread_.joinable()) return;
  machine_.onIoChange({});
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ending_ = true;
  }
  added_.notify_all();
  thread_.join();
}

void IoPublisher::add(const machine::IoStates& states) {
  Change change{states, time_.now()};
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (changes_.size() >= kMostChanges) changes_.pop_front();
    changes_.push_back(std::move(change));
  }
  added_.notify_all();
}

void IoPublisher::run() {
  pthread_setname_np(pthread_self(), "io states");
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    added_.wait(lock, [this] { return ending_ || !changes_.empty(); });
    if (changes_.empty()) return;
    const Change change = std::move(changes_.front());
    changes_.pop_front();
    lock.unlock();
    publish(change);
    lock.lock();
  }
}

void IoPublisher::publish(const Change& change) {
  IoStates message;
  message.header.stamp = change.seen.ros;
  const auto time_of = [&](const std::optional<pulse::Nanoseconds>& time) {
    return time ? time_.at(*time, change.seen) : ros::Time();
  };
  for (const machine::OutputState& output : change.states.outputs) {
    message.output_name.push_back(output.name);
    message.output_on.push_back(output.on);
    message.output_value.push_back(output.value);
    message.output_changed.push_back(time_of(output.changed));
    message.output_note.push_back(output.note);
    message.output_error.push_back(output.error);
    message.output_axis.push_back(output.axis);
    message.output_compared.push_back(output.compared);
    message.output_missed.push_back(output.missed);
  }
  for (const machine::InputState& input : change.states.inputs) {
    message.input_name.push_back(input.name);
    message.input_active.push_back(input.active);
    message.input_changed.push_back(time_of(input.changed));
    message.input_error.push_back(input.error);
  }
  publisher_.publish(message);
}

}  // namespace stepdriver::ros_node
