#include "line_writers.h"

#include <pthread.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

#include "steady_now.h"

namespace stepdriver::gpio {

// Shared by the threads; it outlives a thread that hangs in a write.
struct LineWriters::Shared {
  std::shared_ptr<Lines> lines;
  std::mutex mutex;
  std::function<void()> told;  // empty: nobody listens anymore
  std::function<void(const LineWrite&)> written;
  std::vector<bool> safe_levels;  // by output
  std::vector<Done> done;

  /// Unlocks the mutex while the line is written. @return 0 or errno.
  int write(const LineWrite& write, std::unique_lock<std::mutex>& lock) {
    lock.unlock();
    const int error = lines->write(&write, 1);
    lock.lock();
    if (error == 0 && written) written(write);
    return error;
  }
};

struct LineWriters::Chip {
  std::condition_variable changed;
  std::deque<Job> jobs;  // the first one is being written
  bool ending = false;
  bool ended = false;
  std::thread thread;

  bool awaitsWriteOf(int output) const {
    return std::any_of(jobs.begin(), jobs.end(),
                       [output](const Job& job) { return job.write.output == output; });
  }
};

LineWriters::LineWriters(std::shared_ptr<Lines> lines, std::vector<bool> safe_levels, bool threaded,
                         std::int64_t timeout_ns, std::function<void()> told,
                         std::function<void(const LineWrite&)> written)
    : threaded_(threaded), timeout_ns_(timeout_ns), shared_(std::make_shared<Shared>()) {
  shared_->lines = std::move(lines);
  shared_->told = std::move(told);
  shared_->written = std::move(written);
  shared_->safe_levels = std::move(safe_levels);
}

LineWriters::~LineWriters() {
  std::unique_lock<std::mutex> lock(shared_->mutex);
  shared_->told = nullptr;
  shared_->written = nullptr;
  for (auto& [number, chip] : chips_) {
    chip->ending = true;
    chip->changed.notify_all();
  }
  for (auto& [number, chip] : chips_) {
    const bool ended = chip->changed.wait_for(lock, std::chrono::nanoseconds(timeout_ns_),
                                              [&ended_chip = *chip] { return ended_chip.ended; });
    if (ended) {
      lock.unlock();
      chip->thread.join();
      lock.lock();
    } else {
      chip->thread.detach();
    }
  }
}

void LineWriters::write(std::uint64_t id, const LineWrite& write) {
  if (!threaded_) {
    const int error = shared_->lines->write(&write, 1);
    if (error == 0 && shared_->written) shared_->written(write);
    shared_->done.push_back({id, error});
    shared_->told();
    return;
  }
  const std::size_t number = shared_->lines->outputChip(write.output);
  std::shared_ptr<Chip>& chip = chips_[number];
  if (chip == nullptr) {
    chip = std::make_shared<Chip>();
    try {
      chip->thread = std::thread([shared = shared_, chip] { run(shared, chip); });
    } catch (const std::system_error& error) {
      chips_.erase(number);
      {
        const std::lock_guard<std::mutex> lock(shared_->mutex);
        shared_->done.push_back({id, error.code().value()});
      }
      shared_->told();
      return;
    }
  }
  const std::lock_guard<std::mutex> lock(shared_->mutex);
  // The timeout also counts while a write waits behind one that hangs, so its caller is told in
  // time.
  chip->jobs.push_back({id, write, steadyNow() + timeout_ns_});
  chip->changed.notify_all();
}

void LineWriters::run(const std::shared_ptr<Shared>& shared, const std::shared_ptr<Chip>& chip) {
  pthread_setname_np(pthread_self(), "line writer");
  std::unique_lock<std::mutex> lock(shared->mutex);
  for (;;) {
    chip->changed.wait(lock, [&chip] { return chip->ending || !chip->jobs.empty(); });
    if (chip->jobs.empty()) break;
    const Job job = chip->jobs.front();
    // A write that timed out while it waited behind another one isn't made.
    const int error = job.told ? ETIMEDOUT : shared->write(job.write, lock);
    const bool told = chip->jobs.front().told;
    chip->jobs.pop_front();
    if (told) {
      const int output = job.write.output;
      const bool safe = shared->safe_levels[static_cast<std::size_t>(output)];
      // Nobody learns whether this succeeds: the write has been reported as failed.
      if (!chip->awaitsWriteOf(output)) (void)shared->write({output, safe}, lock);
      continue;
    }
    shared->done.push_back({job.id, error});
    if (shared->told) shared->told();
  }
  chip->ended = true;
  chip->changed.notify_all();
}

std::vector<LineWriters::Done> LineWriters::collect() {
  const std::lock_guard<std::mutex> lock(shared_->mutex);
  const std::int64_t now = steadyNow();
  for (auto& [number, chip] : chips_) {
    for (Job& job : chip->jobs) {
      if (job.told || now < job.deadline_ns) continue;
      job.told = true;
      shared_->done.push_back({job.id, ETIMEDOUT});
    }
  }
  return std::exchange(shared_->done, {});
}

std::optional<std::int64_t> LineWriters::deadline() const {
  const std::lock_guard<std::mutex> lock(shared_->mutex);
  std::optional<std::int64_t> earliest;
  for (const auto& [number, chip] : chips_) {
    for (const Job& job : chip->jobs) {
      if (!job.told) earliest = std::min(earliest.value_or(job.deadline_ns), job.deadline_ns);
    }
  }
  return earliest;
}

}  // namespace stepdriver::gpio
