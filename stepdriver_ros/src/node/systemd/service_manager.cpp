#include "service_manager.h"

#include <pthread.h>
#include <systemd/sd-daemon.h>

#include <cstdint>

namespace stepdriver::ros_node {
namespace {

// A third of the watchdog's period: one late message does no harm.
constexpr int kMessagesInAPeriod = 3;

}  // namespace

ServiceManager::ServiceManager(const machine::Machine& machine) : machine_(machine) {
  std::uint64_t period = 0;
  if (sd_watchdog_enabled(0, &period) <= 0) return;
  thread_ =
      std::thread([this, period] { run(std::chrono::microseconds(period) / kMessagesInAPeriod); });
}

ServiceManager::~ServiceManager() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  stop_asked_.notify_all();
  thread_.join();
}

void ServiceManager::notifyReady() { sd_notify(0, "READY=1"); }

void ServiceManager::notifyEnding() { sd_notify(0, "STOPPING=1"); }

void ServiceManager::run(std::chrono::microseconds period) {
  pthread_setname_np(pthread_self(), "watchdog");
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stopping_) {
    lock.unlock();
    if (machine_.responds(period)) sd_notify(0, "WATCHDOG=1");
    lock.lock();
    stop_asked_.wait_for(lock, period, [this] { return stopping_; });
  }
}

}  // namespace stepdriver::ros_node
