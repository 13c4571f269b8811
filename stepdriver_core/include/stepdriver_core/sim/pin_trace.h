#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace stepdriver::sim {

/// A pin of the rig as a trace shows it: one scope for each axis.
struct TracePin {
  std::string scope;     ///< name of the axis
  std::string variable;  ///< step, dir, enable, ms1, ms2, ms3, sleep, reset, endstop_min or _max
};

/// Where the rig's edges go: levels as they are on the line, times in nanoseconds, never falling.
class PinTrace {
 public:
  virtual ~PinTrace() = default;

  /// Called once, before any edge: the pins (an edge names one by its index) and their levels.
  virtual void begin(const std::vector<TracePin>& pins, const std::vector<bool>& levels,
                     std::int64_t time_ns) = 0;
  /// A pin changed to this level. Called in the order of time.
  virtual void edge(int pin, bool level, std::int64_t time_ns) = 0;

  /// Makes what came so far visible to whoever reads the trace while it grows.
  virtual void flush() {}
};

/// Keeps every edge in memory, for tests. Read it while nothing moves.
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
  const std::vector<bool>& levels() const { return levels_; }  ///< at begin()
  const std::vector<Edge>& edges() const { return edges_; }

  /// @return index of the pin. @throw std::out_of_range
  int pin(const std::string& scope, const std::string& variable) const;

  /// Times at which the pin took this level; the one that it had at begin() isn't among them.
  std::vector<std::int64_t> times(const std::string& scope, const std::string& variable,
                                  bool level) const;

 private:
  std::vector<TracePin> pins_;
  std::vector<bool> levels_;
  std::vector<Edge> edges_;
};

}  // namespace stepdriver::sim
