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

/// Writes the lines that the pulse thread doesn't time. Each GPIO chip has a thread of its own, so
/// that a chip that hangs delays only itself. Writes to one chip keep their order.
///
/// A write that has timed out counts as failed, but it can't be recalled. When its chip answers
/// again, the line therefore gets its safe level, unless a write that is still awaited follows.
class LineWriters {
 public:
  /// A write that has ended.
  struct Done {
    std::uint64_t id = 0;
    int error = 0;  ///< errno; ETIMEDOUT: it has not returned in time; 0: it succeeded.
  };

  /// @param threaded false: write() writes at once.
  /// @param safe_levels of all outputs, see OutputRequest.
  /// @param timeout_ns on the steady clock: a write that takes longer counts as failed.
  /// @param told called from the thread that has written when there is something to collect.
  /// @param written called after each write that succeeded, also after its timeout: one call at a
  ///   time, from any writing thread. May be empty.
  LineWriters(std::shared_ptr<Lines> lines, std::vector<bool> safe_levels, bool threaded,
              std::int64_t timeout_ns, std::function<void()> told,
              std::function<void(const LineWrite&)> written = {});
  /// Threads whose write hangs are abandoned; they keep the lines.
  ~LineWriters();
  LineWriters(const LineWriters&) = delete;
  LineWriters& operator=(const LineWriters&) = delete;

  void write(std::uint64_t id, const LineWrite& write);

  /// The writes that have ended or timed out since the last call.
  std::vector<Done> collect();

  /// Steady time at which the next write times out; empty if no write is in progress.
  std::optional<std::int64_t> deadline() const;
  bool idle() const { return !deadline(); }

 private:
  struct Job {
    std::uint64_t id = 0;
    LineWrite write{};
    std::int64_t deadline_ns = 0;
    bool told = false;  // its timeout has been reported
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
