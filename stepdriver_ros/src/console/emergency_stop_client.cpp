#include "emergency_stop_client.h"

#include <ros/node_handle.h>
#include <ros/service_client.h>
#include <std_srvs/Trigger.h>

#include <chrono>
#include <utility>

#include "common/ask_service.h"

namespace stepdriver::console {
namespace {

// How soon a broken connection is made again.
constexpr std::chrono::milliseconds kCheckPeriod{500};

}  // namespace

EmergencyStopClient::EmergencyStopClient(std::string service)
    : service_(std::move(service)), thread_([this] { run(); }) {}

EmergencyStopClient::~EmergencyStopClient() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ending_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void EmergencyStopClient::press() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    wanted_ = true;
    answer_.reset();
  }
  changed_.notify_one();
}

std::optional<client::Answer> EmergencyStopClient::takeAnswer() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return wanted_ ? std::nullopt : std::exchange(answer_, std::nullopt);
}

void EmergencyStopClient::run() {
  ros::NodeHandle node;
  ros::ServiceClient client;
  std::unique_lock<std::mutex> lock(mutex_);
  while (!ending_) {
    const bool stop = std::exchange(wanted_, false);
    lock.unlock();
    if (!client.isValid()) client = node.serviceClient<std_srvs::Trigger>(service_, true);
    std::optional<client::Answer> answer;
    if (stop) {
      answer = client::ask<std_srvs::Trigger>(client);
      if (!answer->success) answer = client::askService<std_srvs::Trigger>(service_);
    }
    lock.lock();
    if (answer) answer_ = std::move(answer);
    changed_.wait_for(lock, kCheckPeriod, [this] { return ending_ || wanted_; });
  }
}

}  // namespace stepdriver::console
