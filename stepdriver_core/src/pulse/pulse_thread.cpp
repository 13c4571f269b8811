#include "pulse/pulse_thread.h"

#include <pthread.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <fstream>

#include "gpio/may_wait.h"
#include "pulse/realtime.h"
#include "start_thread.h"

namespace stepdriver::pulse {

PulseThread::PulseThread(PulseEngine& engine, Clock& clock, NewsListener* listener,
                         const RealtimeRequest& request)
    : engine_(engine), clock_(clock), listener_(listener), cpu_(request.cpu.value_or(-1)) {
  if (clock_.realtime()) {
    lock_error_ = lockMemory();
    if (!request.latency_device.empty()) latency_.emplace(request.latency_device);
  }
  thread_ = startThread([this] { run(); });
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
  gpio::this_thread_may_wait = false;
  id_ = gettid();
  if (clock_.realtime()) {
    scheduler_error_ = askForScheduler(kRealtimePriority);
    if (cpu_ >= 0) cpu_error_ = stayOnProcessor(cpu_);
    touchStack();
  } else if (clock_.keepsRealTime()) {
    askForScheduler(kPromptPriority);  // a rig without that right is only slower
  }
  for (std::uint64_t passes = 0; !stopping_; passes += 2) {
    passes_.store(passes + 1, std::memory_order_release);
    const Nanoseconds due = engine_.serve();
    passes_.store(passes + 2, std::memory_order_release);
    Nanoseconds alarm = alarm_.load(std::memory_order_acquire);
    if (alarm != kNever && listener_ != nullptr && clock_.now() >= alarm) {
      // It goes off once; an alarm that was set meanwhile is checked in the next pass.
      if (alarm_.compare_exchange_strong(alarm, kNever)) listener_->onNews();
      continue;
    }
    clock_.waitUntil(std::min(due, alarm));
  }
}

bool PulseThread::isBlocked() const {
  std::ifstream file("/proc/self/task/" + std::to_string(id_.load()) + "/stat");
  std::string text;
  std::getline(file, text);
  // 37 (pulse) S 1 ...
  const std::size_t name_end = text.rfind(')');
  return name_end != std::string::npos && text.size() > name_end + 2 && text[name_end + 2] != 'R';
}

RealtimeRights PulseThread::rights() const {
  return {scheduler_error_.load(), lock_error_.load(), latency_ ? latency_->error() : -1,
          cpu_error_.load(), cpu_};
}

}  // namespace stepdriver::pulse
