#include "stepdriver_core/sim/pin_trace.h"

#include <fmt/format.h>

#include <cstddef>

#include "stepdriver_core/error.h"

namespace stepdriver::sim {

void MemoryTrace::begin(const std::vector<TracePin>& pins, const std::vector<bool>& levels,
                        std::int64_t /*time_ns*/) {
  pins_ = pins;
  levels_ = levels;
}

void MemoryTrace::edge(int pin, bool level, std::int64_t time_ns) {
  edges_.push_back({pin, level, time_ns});
}

int MemoryTrace::pin(const std::string& scope, const std::string& variable) const {
  for (std::size_t i = 0; i < pins_.size(); ++i) {
    if (pins_[i].scope == scope && pins_[i].variable == variable) return static_cast<int>(i);
  }
  throw Error(fmt::format("the trace has no pin {}.{}", scope, variable));
}

std::vector<std::int64_t> MemoryTrace::times(const std::string& scope, const std::string& variable,
                                             bool level) const {
  const int wanted = pin(scope, variable);
  std::vector<std::int64_t> times;
  for (const Edge& edge : edges_) {
    if (edge.pin == wanted && edge.level == level) times.push_back(edge.time_ns);
  }
  return times;
}

}  // namespace stepdriver::sim
