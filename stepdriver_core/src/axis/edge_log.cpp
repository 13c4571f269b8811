#include "stepdriver_core/axis/edge_log.h"

#include <algorithm>
#include <array>

namespace stepdriver::axis {
namespace {

// Several switches bounce into one log, each some dozen times.
constexpr std::size_t kRemembered = 512;

}  // namespace

int EdgeLog::watch(std::int64_t timeout_ns) {
  std::array<gpio::EdgeEvent, 16> events{};
  const int count = lines_.waitForEdges(timeout_ns, events.data(), events.size());
  const std::lock_guard<std::mutex> lock(mutex_);
  for (int i = 0; i < count; ++i) edges_.push_back(events.at(static_cast<std::size_t>(i)));
  while (edges_.size() > kRemembered) edges_.pop_front();
  return count;
}

std::vector<gpio::EdgeEvent> EdgeLog::since(int input, std::int64_t time_ns) {
  while (!watched_ && watch(0) > 0) {
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<gpio::EdgeEvent> found;
  std::copy_if(
      edges_.begin(), edges_.end(), std::back_inserter(found),
      [&](const gpio::EdgeEvent& edge) { return edge.input == input && edge.time_ns > time_ns; });
  return found;
}

}  // namespace stepdriver::axis
