#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "support/bench.h"

namespace stepdriver::test {

/// Records the edges of the STEP and DIR lines of a bench, and those of its outputs and flags, from
/// which pictures of a motion are drawn.
class MotionTrace {
 public:
  struct Step {
    double time = 0.0;       ///< [s] when the edge came, after the trace began
    std::int64_t count = 0;  ///< [microsteps] where the axis is after the edge
  };

  /// The level of an output, or of a flag that a carriage presses.
  struct Level {
    double time = 0.0;  ///< [s] when the line took it, after the trace began; 0: it had it then
    bool level = false;
  };

  /// @param bench outlives the trace, and its axes are at 0.
  explicit MotionTrace(Bench& bench) : bench_(bench), begin_ns_(bench.clock.now()) {}

  double now() const { return seconds(bench_.clock.now()); }

  /// Puts a label at this time into the picture.
  void mark(const std::string& words) { marks_.emplace_back(now(), words); }

  std::vector<Step> steps(const std::string& axis) const {
    const sim::MemoryTrace& trace = *bench_.trace;
    const int step = trace.pin(axis, "step");
    const int dir = trace.pin(axis, "dir");
    bool forward = trace.levels()[static_cast<std::size_t>(dir)];
    std::vector<Step> steps;
    std::int64_t count = 0;
    for (const sim::MemoryTrace::Edge& edge : trace.edges()) {
      if (edge.pin == dir) forward = edge.level;
      if (edge.pin != step || !edge.level) continue;
      count += forward ? 1 : -1;
      steps.push_back({seconds(edge.time_ns), count});
    }
    return steps;
  }

  /// [steps/s] Between the two steps around a time.
  double speedAt(const std::string& axis, double time) const {
    const std::vector<Step> all = steps(axis);
    for (std::size_t i = 1; i < all.size(); ++i) {
      if (all[i].time < time) continue;
      return static_cast<double>(all[i].count - all[i - 1].count) / (all[i].time - all[i - 1].time);
    }
    return 0.0;
  }

  /// @param scope, variable of the pin in the rig's trace
  std::vector<Level> levels(const std::string& scope, const std::string& variable) const {
    const sim::MemoryTrace& trace = *bench_.trace;
    const int pin = trace.pin(scope, variable);
    std::vector<Level> found{{0.0, trace.levels()[static_cast<std::size_t>(pin)]}};
    for (const sim::MemoryTrace::Edge& edge : trace.edges()) {
      if (edge.pin == pin) found.push_back({seconds(edge.time_ns), edge.level});
    }
    return found;
  }
  /// [s] When a pin took this level.
  std::vector<double> times(const std::string& scope, const std::string& variable,
                            bool level) const {
    std::vector<double> found;
    for (const std::int64_t time : bench_.trace->times(scope, variable, level)) {
      found.push_back(seconds(time));
    }
    return found;
  }

  /// Adds a curve to the picture: its points, by their times [s].
  void add(const std::string& name, std::vector<std::pair<double, double>> points) {
    curves_.emplace_back(name, std::move(points));
  }

  /// If the environment variable STEPDRIVER_TRACES names a folder, writes the trace to NAME.csv
  /// there: `step,AXIS,TIME_NS,COUNT` for each step, `mark,,TIME_NS,WORDS`,
  /// `curve,NAME,TIME_NS,VALUE` for each point of a curve, in thousandths, and
  /// `level,NAME,TIME_NS,LEVEL` for each level of an output or a flag.
  void keep(const std::string& name) const {
    const char* const folder = std::getenv("STEPDRIVER_TRACES");
    if (folder == nullptr) return;
    std::ofstream file(std::string(folder) + "/" + name + ".csv");
    for (const auto& [time, words] : marks_) file << "mark,," << ns(time) << ',' << words << '\n';
    for (const auto& [curve, points] : curves_) {
      for (const auto& [time, value] : points) {
        file << "curve," << curve << ',' << ns(time) << ',' << std::llround(1000.0 * value) << '\n';
      }
    }
    for (const std::string& axis : bench_.rig.axes()) {
      for (const Step& step : steps(axis)) {
        file << "step," << axis << ',' << ns(step.time) << ',' << step.count << '\n';
      }
    }
    for (const sim::TracePin& pin : bench_.trace->pins()) {
      if (pin.scope != "outputs" && pin.variable.rfind("flag", 0) != 0) continue;
      for (const Level& each : levels(pin.scope, pin.variable)) {
        file << "level," << pin.variable << ',' << ns(each.time) << ',' << each.level << '\n';
      }
    }
  }

 private:
  double seconds(std::int64_t clock_ns) const {
    return static_cast<double>(clock_ns - begin_ns_) * 1e-9;
  }
  static std::int64_t ns(double seconds) { return std::llround(seconds * 1e9); }

  Bench& bench_;
  std::int64_t begin_ns_;
  std::vector<std::pair<double, std::string>> marks_;
  std::vector<std::pair<std::string, std::vector<std::pair<double, double>>>> curves_;
};

}  // namespace stepdriver::test
