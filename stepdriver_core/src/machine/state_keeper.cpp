#include "state_keeper.h"

#include <chrono>

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

void StateKeeper::start(const Axes& axes, bool threaded) {
  std::optional<KeptState> kept;
  std::string why;
  try {
    kept = file_.load();
    if (!kept) why = "the state file " + file_.path() + " wasn't there yet";
  } catch (const Error& error) {
    why = error.what();
  }
  for (const auto& axis : axes) {
    const auto found = kept ? kept->axes.find(axis->config().name)
                            : std::map<std::string, axis::AxisMemory>::iterator{};
    if (kept && found != kept->axes.end()) {
      axis->restore(found->second, kept->clean);
    } else {
      axis->notePosition(kept ? "the state file " + file_.path() + " doesn't know this axis" : why);
    }
  }
  axes_ = &axes;
  keep();
  if (const std::string wrong = error(); !wrong.empty()) throw Error(wrong);
  if (threaded) thread_ = std::thread([this] { run(); });
}

void StateKeeper::run() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!wake_.wait_for(lock, kPeriod, [this] { return ended_; })) {
    lock.unlock();
    keep();
    lock.lock();
  }
}

void StateKeeper::keep() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (axes_ == nullptr || ended_) return;
  bool changed = !saved_;
  for (const auto& axis : *axes_) {
    const auto memory = axis->memory();
    if (!memory) continue;  // it moves
    axis::AxisMemory& known = state_.axes[axis->config().name];
    changed = changed || !(known == *memory);
    known = *memory;
  }
  if (changed) save();
}

void StateKeeper::close() {
  keep();
  const std::lock_guard<std::mutex> lock(mutex_);
  if (ended_) return;
  ended_ = true;
  state_.clean = true;
  save();
}

std::string StateKeeper::error() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return error_;
}

void StateKeeper::save() {
  try {
    file_.save(state_);
    saved_ = true;
    error_.clear();
  } catch (const Error& error) {
    saved_ = false;
    error_ = error.what();
  }
}

}  // namespace stepdriver::machine
