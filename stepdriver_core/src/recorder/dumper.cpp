#include "stepdriver_core/recorder/dumper.h"

#include <pthread.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "dump_files.h"
#include "start_thread.h"

namespace stepdriver::recorder {

Dumper::Dumper(machine::Machine& machine, DumperOptions options,
               std::function<void(const Dump&)> told)
    : machine_(machine), options_(std::move(options)), told_(std::move(told)) {
  thread_ = startThread([this] { run(); });
  machine_.onFault([this] {
    const std::lock_guard<std::mutex> lock(mutex_);
    fault_ = true;
    changed_.notify_all();
  });
}

Dumper::~Dumper() {
  machine_.onFault({});
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void Dumper::request(const std::string& reason) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (requested_.empty()) {
    requested_ = reason;
    ++asked_;
  }
  changed_.notify_all();
}

Dump Dumper::dump(const std::string& reason) {
  request(reason);
  std::unique_lock<std::mutex> lock(mutex_);
  const std::uint64_t mine = asked_;
  changed_.wait(lock, [&] { return done_ >= mine; });
  return latest_;
}

std::string Dumper::error() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return error_;
}

Dump Dumper::last() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return last_;
}

Dumper::Time Dumper::due() const {
  if (ending_) return fault_ || !requested_.empty() ? Time::min() : Time::max();
  Time due = Time::max();
  if (fault_) due = std::min(due, next_fault_);
  if (!requested_.empty()) due = std::min(due, next_request_);
  return due;
}

void Dumper::run() {
  pthread_setname_np(pthread_self(), "recorder");
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    const Time when = due();
    if (when <= std::chrono::steady_clock::now()) {
      write(lock);
    } else if (ending_) {
      return;
    } else if (when == Time::max()) {
      changed_.wait(lock);
    } else {
      changed_.wait_until(lock, when);
    }
  }
}

void Dumper::write(std::unique_lock<std::mutex>& lock) {
  // One recording serves a fault and all requests so far.
  std::string reason = std::exchange(requested_, {});
  const std::uint64_t served = asked_;
  if (std::exchange(fault_, false)) {
    reason = reason.empty() ? "fault" : reason + ", fault";
    next_fault_ = std::chrono::steady_clock::now() + options_.fault_pause;
  }
  next_request_ = std::chrono::steady_clock::now() + options_.request_pause;
  lock.unlock();
  Dump dump;
  dump.reason = reason;
  try {
    dump = writeFiles(machine_.recording(), reason, options_);
  } catch (const std::exception& error) {
    dump.error = error.what();
  }
  if (told_) told_(dump);
  lock.lock();
  error_ = dump.error;
  if (dump.error.empty()) last_ = dump;
  latest_ = std::move(dump);
  done_ = served;
  changed_.notify_all();
}

}  // namespace stepdriver::recorder
