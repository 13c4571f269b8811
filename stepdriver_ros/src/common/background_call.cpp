#include "background_call.h"

#include <utility>

namespace stepdriver::client {

BackgroundCall::BackgroundCall() : thread_([this] { run(); }) {}

BackgroundCall::~BackgroundCall() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ending_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void BackgroundCall::start(Ask ask) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    wanted_ = std::move(ask);
  }
  changed_.notify_one();
}

std::optional<Answer> BackgroundCall::takeAnswer() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::exchange(answer_, std::nullopt);
}

void BackgroundCall::run() {
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return ending_ || wanted_; });
    if (ending_) return;
    const Ask ask = std::exchange(wanted_, nullptr);
    lock.unlock();
    Answer answer = ask();
    lock.lock();
    answer_ = std::move(answer);
  }
}

}  // namespace stepdriver::client
