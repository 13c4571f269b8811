#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace stepdriver::sim {

/// A pin of the rig in a trace: one scope for each axis.
struct TracePin {
  std::string scope;     ///< name of the axis; machine, outputs or inputs
  std::string variable;  ///< step, dir (or cw, ccw), enable, ms1, ms2, ms3, sleep, reset,
                         ///< endstop_min or _max, fault, in_position
  /// The level of a pulse, of forward, of an energized motor and so on. If it is known, a file says
  /// so; otherwise its readers take the first level for the inactive one.
  std::optional<bool> active = {};
  bool both_edges = false;  ///< each edge of this line is a step, which a file says
};

/// Receives the rig's edges: the levels are those of the line, the times are in nanoseconds and
/// never decrease.
class PinTrace {
 public:
  virtual ~PinTrace() = default;

  /// Called once, before any edge: the pins (an edge names one by its index) and their levels.
  virtual void begin(const std::vector<TracePin>& pins, const std::vector<bool>& levels,
                     std::int64_t time_ns) = 0;
  /// A pin changed to this level. Called in the order of time.
  virtual void edge(int pin, bool level, std::int64_t time_ns) = 0;

  /// Words about the whole trace. Called after the last edge.
  virtual void summary(const std::string& /*text*/) {}

  /// Makes all edges so far visible to readers of the growing trace.
  virtual void flush() {}
};

/// Keeps every edge in memory, for tests. Read it while nothing moves.
///
/// @code{.cpp}
/// const auto trace = std::make_shared<sim::MemoryTrace>();
/// sim::Rig rig({}, trace);
/// for (const std::int64_t time : trace->times("x", "step", true)) std::cout << time << " ns\n";
/// @endcode
class MemoryTrace : public PinTrace {
 public:
  /// A pin that changed to a level.
  struct Edge {
    int pin;
    bool level;
    std::int64_t time_ns;
  };

  void begin(const std::vector<TracePin>& pins, const std::vector<bool>& levels,
             std::int64_t time_ns) override;
  void edge(int pin, bool level, std::int64_t time_ns) override;

  const std::vector<TracePin>& pins() const { return pins_; }
  const std::vector<bool>& levels() const { return levels_; }  ///< the levels at begin()
  const std::vector<Edge>& edges() const { return edges_; }

  /// @return index of the pin. @throw Error if there is no such pin.
  int pin(const std::string& scope, const std::string& variable) const;

  /// Times at which the pin changed to this level; its level at begin() isn't included.
  std::vector<std::int64_t> times(const std::string& scope, const std::string& variable,
                                  bool level) const;

 private:
  std::vector<TracePin> pins_;
  std::vector<bool> levels_;
  std::vector<Edge> edges_;
};

}  // namespace stepdriver::sim
