#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "stepdriver_core/sim/pin_trace.h"

namespace stepdriver::search {

/// Reports each rising STEP edge of the rig, with the number of its axis.
class RiseWatch : public sim::PinTrace {
 public:
  explicit RiseWatch(std::vector<std::string> axes) : axes_(std::move(axes)) {}

  std::function<void(std::size_t axis, std::int64_t time_ns)> rose;

  void begin(const std::vector<sim::TracePin>& pins, const std::vector<bool>& /*levels*/,
             std::int64_t /*time_ns*/) override {
    axis_of_.assign(pins.size(), axes_.size());
    for (std::size_t i = 0; i < pins.size(); ++i) {
      if (pins[i].variable != "step") continue;
      for (std::size_t axis = 0; axis < axes_.size(); ++axis) {
        if (pins[i].scope == axes_[axis]) axis_of_[i] = axis;
      }
    }
  }

  void edge(int pin, bool level, std::int64_t time_ns) override {
    const std::size_t axis = axis_of_[static_cast<std::size_t>(pin)];
    if (level && axis < axes_.size() && rose) rose(axis, time_ns);
  }

 private:
  const std::vector<std::string> axes_;
  std::vector<std::size_t> axis_of_;
};

}  // namespace stepdriver::search
