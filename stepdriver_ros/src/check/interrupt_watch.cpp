#include "interrupt_watch.h"

#include <pthread.h>

#include <csignal>
#include <cstdint>
#include <ctime>
#include <utility>

#include "common/end_signals.h"

namespace stepdriver::check {
namespace {

constexpr std::chrono::milliseconds kPoll{50};
constexpr std::int64_t kSecond = 1'000'000'000;

}  // namespace

void InterruptWatch::block() {
  const sigset_t signals = ros_node::endSignals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
}

bool InterruptWatch::comesWithin(std::chrono::nanoseconds time) {
  const sigset_t signals = ros_node::endSignals();
  const timespec wait{static_cast<std::time_t>(time.count() / kSecond),
                      static_cast<long>(time.count() % kSecond)};
  return sigtimedwait(&signals, nullptr, &wait) > 0;
}

InterruptWatch::InterruptWatch(std::function<void()> act)
    : act_(std::move(act)), thread_([this] { watch(); }) {}

InterruptWatch::~InterruptWatch() {
  ended_ = true;
  thread_.join();
}

void InterruptWatch::watch() {
  while (!ended_ && !interrupted_) {
    if (!comesWithin(kPoll)) continue;
    interrupted_ = true;
    act_();
  }
}

}  // namespace stepdriver::check
