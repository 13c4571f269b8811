#include "state_keeper.h"

#include <chrono>
#include <utility>

#include "start_thread.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {
namespace {

constexpr std::chrono::milliseconds kPeriod(200);

}  // namespace

StateKeeper::~StateKeeper() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ended_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

StateKeeper::Loaded StateKeeper::load() {
  Loaded loaded;
  loaded.source = "the state file " + file_.path();
  try {
    if (auto kept = file_.load()) {
      loaded.state = *std::move(kept);
      loaded.why_none = loaded.source + " doesn't contain this axis";
    } else {
      loaded.why_none = loaded.source + " didn't exist yet";
    }
  } catch (const Error& error) {
    loaded.why_none = error.what();
  }
  return loaded;
}

void StateKeeper::start(std::function<Memories()> read, bool threaded) {
  read_ = std::move(read);
  keep();
  if (const std::string wrong = error(); !wrong.empty()) throw Error(wrong);
  if (threaded) thread_ = startThread([this] { run(); });
}

void StateKeeper::run() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!ended_) {
    wake_.wait_for(lock, kPeriod, [this] { return ended_ || motion_begins_; });
    motion_begins_ = false;
    lock.unlock();
    const bool written = keep();
    lock.lock();
    // The disk has at least this long between two writes, whatever the axes do.
    if (written) wake_.wait_for(lock, kPeriod, [this] { return ended_; });
  }
}

// Without the mutex, which is held while the disk writes. If the thread misses a call because of
// that, it sees the change after the period.
void StateKeeper::noteMotion() noexcept {
  motion_begins_ = true;
  wake_.notify_all();
}

bool StateKeeper::merge(const Memories& memories) {
  bool changed = !saved_;
  for (const auto& [name, memory] : memories) {
    axis::AxisMemory& known = state_.axes[name];
    changed = changed || !(known == memory);
    known = memory;
  }
  return changed;
}

bool StateKeeper::keep() {
  if (!read_) return false;
  const Memories memories = read_();
  const std::lock_guard<std::mutex> lock(mutex_);
  if (ended_ || !merge(memories)) return false;
  save();
  return true;
}

void StateKeeper::close(const Memories& last) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (ended_) return;
  merge(last);
  ended_ = true;
  state_.clean = true;
  save();
}

std::string StateKeeper::error() const {
  const std::lock_guard<std::mutex> lock(error_mutex_);
  return error_;
}

void StateKeeper::save() {
  std::string why;
  try {
    file_.save(state_);
  } catch (const Error& error) {
    why = error.what();
  }
  saved_ = why.empty();
  const std::lock_guard<std::mutex> lock(error_mutex_);
  error_ = std::move(why);
}

}  // namespace stepdriver::machine
