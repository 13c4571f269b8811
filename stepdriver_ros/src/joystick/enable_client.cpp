#include "enable_client.h"

#include <ros/node_handle.h>
#include <std_srvs/SetBool.h>

#include <utility>

namespace stepdriver::joystick {

EnableClient::EnableClient(std::string service)
    : service_(std::move(service)), thread_([this] { run(); }) {}

EnableClient::~EnableClient() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ending_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void EnableClient::call(bool on) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    wanted_ = on;
  }
  changed_.notify_one();
}

std::optional<EnableClient::Answer> EnableClient::takeAnswer() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::exchange(answer_, std::nullopt);
}

void EnableClient::run() {
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return ending_ || wanted_; });
    if (ending_) return;
    const bool on = *std::exchange(wanted_, std::nullopt);
    lock.unlock();
    Answer answer = ask(on);
    lock.lock();
    answer_ = std::move(answer);
  }
}

EnableClient::Answer EnableClient::ask(bool on) const {
  std_srvs::SetBool call;
  call.request.data = on;
  // Persistent: of the other kind roscpp may report a call as failed that was carried out.
  if (!ros::NodeHandle().serviceClient<std_srvs::SetBool>(service_, true).call(call)) {
    return {false, "nobody answers"};
  }
  return {call.response.success != 0, call.response.message};
}

}  // namespace stepdriver::joystick
