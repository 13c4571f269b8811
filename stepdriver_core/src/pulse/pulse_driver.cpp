#include "stepdriver_core/pulse/pulse_driver.h"

#include <pthread.h>

#include <algorithm>
#include <chrono>

#include "stepdriver_core/error.h"

namespace stepdriver::pulse {
namespace {

// Of a thread that waits for the pulse thread.
constexpr std::chrono::microseconds kSpin{50};
constexpr std::chrono::microseconds kShortestNap{20};
constexpr std::chrono::microseconds kNapGrowth{2};
constexpr std::chrono::microseconds kLongestNap{1000};

}  // namespace

PulseDriver::PulseDriver(PulseEngine& engine, Clock& clock, bool threaded,
                         const std::string& latency_device)
    : engine_(engine), clock_(clock) {
  if (!threaded) return;
  if (clock_.realtime()) {
    lock_error_ = lockMemory();
    if (!latency_device.empty()) latency_.emplace(latency_device);
  }
  thread_ = std::thread([this] { run(); });
}

PulseDriver::~PulseDriver() { stop(); }

void PulseDriver::stop() {
  if (!thread_.joinable()) return;
  stopping_ = true;
  clock_.wake();
  thread_.join();
  latency_.reset();
}

void PulseDriver::post(const Command& command) {
  const std::lock_guard<std::mutex> lock(posting_);
  waitFor([&] { return engine_.post(command); });
}

void PulseDriver::run() {
  pthread_setname_np(pthread_self(), "pulse");
  if (clock_.realtime()) {
    scheduler_error_ = askForScheduler();
    touchStack();
  }
  while (!stopping_) clock_.waitUntil(engine_.serve());
}

void PulseDriver::waitFor(const std::function<bool()>& ready) {
  if (thread_.joinable()) {
    // Most waits are over when the pulse thread has woken; one for a move may last. Without a
    // yield: on a busy machine that gives milliseconds away, and who sleeps has its turn when it
    // wakes.
    const auto spun = std::chrono::steady_clock::now() + kSpin;
    while (std::chrono::steady_clock::now() < spun) {
      if (ready()) return;
    }
    for (auto nap = kShortestNap; !ready(); nap = std::min(nap + kNapGrowth, kLongestNap)) {
      std::this_thread::sleep_for(nap);
    }
    return;
  }
  while (!ready()) {
    const Nanoseconds due = engine_.serve();
    if (ready()) return;
    if (due == kNever) throw Error("nothing is under way that could end this wait");
    clock_.waitUntil(due);
  }
}

void PulseDriver::advance(Nanoseconds time) {
  const Nanoseconds end = clock_.now() + time;
  for (;;) {
    const Nanoseconds due = engine_.serve();
    if (due > end && clock_.now() >= end) return;
    clock_.waitUntil(std::min(due, end));
  }
}

RealtimeRights PulseDriver::rights() const {
  return {scheduler_error_.load(), lock_error_.load(), latency_ ? latency_->error() : -1};
}

}  // namespace stepdriver::pulse
