#pragma once

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::test {

struct Edge {
  int line;
  bool level;
  pulse::Nanoseconds time;
  std::size_t write;  ///< number of the call that made it
};

/// Lines that remember what was written, and may fail.
class RecordingLines : public gpio::Lines {
 public:
  explicit RecordingLines(pulse::VirtualClock& clock) : clock_(clock) {}

  int write(const gpio::LineWrite* writes, std::size_t count) noexcept override {
    ++calls;
    if (fail_after-- == 0) return EIO;
    for (std::size_t i = 0; i < count; ++i) {
      if (writes[i].output == broken) return ENODEV;
      bool& level = levels[writes[i].output];
      if (level != writes[i].level) {
        edges.push_back({writes[i].output, writes[i].level, clock_.now(), calls});
      }
      level = writes[i].level;
    }
    if (write_cost > 0) {
      // The edges of a call are at its beginning: as close to the previous ones as they can be.
      clock_.waitUntil(clock_.now() + write_cost);
    }
    return 0;
  }

  int read(int input) noexcept override { return inputs[input]; }

  int waitForEdges(std::int64_t /*timeout_ns*/, gpio::EdgeEvent* /*events*/,
                   std::size_t /*capacity*/) noexcept override {
    return -ENOTSUP;
  }
  void interrupt() noexcept override {}

  const std::string& outputName(int /*output*/) const override { return name_; }
  const std::string& inputName(int /*input*/) const override { return name_; }

  std::vector<pulse::Nanoseconds> rises(int line) const {
    std::vector<pulse::Nanoseconds> times;
    for (const Edge& edge : edges) {
      if (edge.line == line && edge.level) times.push_back(edge.time);
    }
    return times;
  }

  std::vector<Edge> edges;
  std::map<int, bool> levels;
  std::map<int, int> inputs;
  std::size_t calls = 0;
  int fail_after = -1;  ///< after this many successful writes, one fails
  pulse::Nanoseconds write_cost = 0;
  int broken = -1;  ///< a write gets as far as this output, then fails

 private:
  pulse::VirtualClock& clock_;
  const std::string name_ = "a line";
};

}  // namespace stepdriver::test
