#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::gpio {

/// Writes the lines that aren't timed by the pulse thread: one thread for each GPIO chip, so that a
/// chip that hangs delays nobody but itself. Writes to one chip are done in their order.
class LineWriters {
 public:
  /// A write that is over.
  struct Done {
    std::uint64_t id = 0;
    int error = 0;  ///< errno; ETIMEDOUT: it has not returned in time. 0: it was done.
  };

  /// @param threaded else write() writes at once.
  /// @param timeout_ns on the steady clock: a write that takes longer counts as failed.
  /// @param told called from a writing thread when there is something to collect.
  LineWriters(std::shared_ptr<Lines> lines, bool threaded, std::int64_t timeout_ns,
              std::function<void()> told);
  /// Threads whose write hangs are left behind; they keep the lines.
  ~LineWriters();
  LineWriters(const LineWriters&) = delete;
  LineWriters& operator=(const LineWriters&) = delete;

  void write(std::uint64_t id, const LineWrite& write);

  /// What is over since this was called last, with what has timed out by now.
  std::vector<Done> collect();

  /// Steady time at which the next write times out; none if none is under way.
  std::optional<std::int64_t> deadline() const;
  bool idle() const { return !deadline(); }

 private:
  struct Job {
    std::uint64_t id = 0;
    LineWrite write{};
    std::int64_t deadline_ns = 0;
    bool told = false;  // that it has timed out
  };
  struct Shared;
  struct Chip;

  static void run(const std::shared_ptr<Shared>& shared, const std::shared_ptr<Chip>& chip);

  const bool threaded_;
  const std::int64_t timeout_ns_;
  const std::shared_ptr<Shared> shared_;
  std::map<std::size_t, std::shared_ptr<Chip>> chips_;
};

}  // namespace stepdriver::gpio
