#include "pulse/pulse_thread.h"

#include <pthread.h>

#include <algorithm>

#include "pulse/realtime.h"

namespace stepdriver::pulse {

PulseThread::PulseThread(PulseEngine& engine, Clock& clock, NewsListener* listener,
                         const std::string& latency_device)
    : engine_(engine), clock_(clock), listener_(listener) {
  if (clock_.realtime()) {
    lock_error_ = lockMemory();
    if (!latency_device.empty()) latency_.emplace(latency_device);
  }
  thread_ = std::thread([this] { run(); });
}

PulseThread::~PulseThread() { stop(); }

void PulseThread::stop() {
  if (!thread_.joinable()) return;
  stopping_ = true;
  clock_.wake();
  thread_.join();
  latency_.reset();
}

void PulseThread::setAlarm(Nanoseconds time) {
  if (alarm_.exchange(time, std::memory_order_acq_rel) != time) clock_.wake();
}

void PulseThread::run() {
  pthread_setname_np(pthread_self(), "pulse");
  if (clock_.realtime()) {
    scheduler_error_ = askForScheduler(kRealtimePriority);
    touchStack();
  } else if (clock_.keepsRealTime()) {
    askForScheduler(kPromptPriority);  // a rig without that right is only slower
  }
  while (!stopping_) {
    const Nanoseconds due = engine_.serve();
    Nanoseconds alarm = alarm_.load(std::memory_order_acquire);
    if (alarm != kNever && listener_ != nullptr && clock_.now() >= alarm) {
      // It goes off once; an alarm that was set meanwhile is checked in the next pass.
      if (alarm_.compare_exchange_strong(alarm, kNever)) listener_->onNews();
      continue;
    }
    clock_.waitUntil(std::min(due, alarm));
  }
}

RealtimeRights PulseThread::rights() const {
  return {scheduler_error_.load(), lock_error_.load(), latency_ ? latency_->error() : -1};
}

}  // namespace stepdriver::pulse
