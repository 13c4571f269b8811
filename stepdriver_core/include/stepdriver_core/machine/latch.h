#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/pulse/clock.h"

/// Where axes were when an input changed.
///
/// @code{.cpp}
/// machine::LatchRequest request;
/// request.input = "probe";
/// const machine::Latch latch = machine.latch(request);
/// machine.axis("x").moveTo(0.1);
/// const machine::LatchResult result = machine.wait(latch);
/// const double x = result.edge->axes.front().position;  // [m]
/// @endcode
namespace stepdriver::machine {

/// Which edges of an input count.
enum class LatchEdge { kActive, kInactive, kEither };

/// Edges count only while an axis is between two positions.
struct LatchWindow {
  std::string axis;
  double from = 0.0;  ///< [unit]
  double to = 0.0;    ///< [unit] at least `from`
};

/// A request for the positions of axes at edges of an input with a name.
struct LatchRequest {
  std::string input;
  LatchEdge edge = LatchEdge::kActive;
  bool every = false;             ///< false: the first edge ends it
  std::vector<std::string> axes;  ///< empty: all
  std::optional<LatchWindow> window;
};

/// A position that was latched.
struct LatchedAxis {
  std::string name;
  double position = 0.0;        ///< [unit] of the joint, as it was planned to be at that time
  bool position_valid = false;  ///< whether the position of the axis can be trusted
};

/// An edge of the input.
struct LatchedEdge {
  std::uint64_t number = 0;  ///< of the edges of this latch, from 1 on
  bool active = false;       ///< the input became active; false: inactive
  /// On the clock of the machine, by the kernel's time stamp; with a debounce time that of the
  /// first contact.
  pulse::Nanoseconds time = 0;
  /// The kernel has reported no such edge: it has lost it, and the time is that of the reading that
  /// shows the level. LatchResult::message and that of a probing say so.
  bool was_read = false;
  std::vector<LatchedAxis> axes;
};

/// How a latch ended.
struct LatchResult {
  bool latched = false;             ///< there was an edge
  std::string message;              ///< a sentence that says how it ended
  std::optional<LatchedEdge> edge;  ///< the last one
  std::uint64_t edges = 0;          ///< how many there were
};

/// What a latch has seen. Any thread may read it.
class LatchRecord {
 public:
  /// The edges since the last call. Of more than kMostKept only the latest are there.
  std::vector<LatchedEdge> take() {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto edges = std::exchange(edges_, {});
    return {edges.begin(), edges.end()};
  }
  /// Empty: it hasn't ended.
  std::optional<LatchResult> result() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return result_;
  }
  void add(LatchedEdge edge) {
    const std::lock_guard<std::mutex> lock(mutex_);
    edges_.push_back(std::move(edge));
    if (edges_.size() > kMostKept) edges_.pop_front();
  }
  /// Only the first result counts.
  void end(LatchResult result) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!result_) result_ = std::move(result);
  }

 private:
  static constexpr std::size_t kMostKept = 10'000;

  mutable std::mutex mutex_;
  std::deque<LatchedEdge> edges_;
  std::optional<LatchResult> result_;
};

/// A latch that was accepted.
struct Latch {
  std::uint64_t id = 0;
  std::shared_ptr<LatchRecord> record;
};

}  // namespace stepdriver::machine
