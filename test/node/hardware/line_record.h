#pragma once

#include <cstdint>
#include <string>

#include "core/support/gpio_sim.h"
#include "kernel/kernel_trace.h"

namespace stepdriver::node_test {

/// Records what the kernel does to its GPIO lines from now on, in its own buffer.
class LineRecord {
 public:
  /// @throw std::runtime_error if the kernel has no gpio tracepoints.
  LineRecord();
  ~LineRecord();
  LineRecord(const LineRecord&) = delete;
  LineRecord& operator=(const LineRecord&) = delete;

  kernel::KernelTrace read() const;

  /// Since the machine was booted, as `run.sh --trace` records it.
  static kernel::KernelTrace sinceBoot();

 private:
  std::string folder_;
};

/// The line's number in the kernel's trace.
unsigned numberOf(const test::GpioSimLines& chip, unsigned offset);

/// Lines of an axis by the kernel's numbers; STEP is active high, DIR high is forward.
struct StepAndDir {
  unsigned step;
  unsigned dir;
};

/// STEP pulses forward minus those backward, if both lines are low at first.
std::int64_t pulsesIn(const kernel::KernelTrace& trace, const StepAndDir& lines);

/// Times at which the line was set to this level, whatever its level was before.
std::vector<std::int64_t> timesSet(const kernel::KernelTrace& trace, unsigned line, bool level);

/// The level that the line was set to last. @throw std::runtime_error if it never was.
bool lastSet(const kernel::KernelTrace& trace, unsigned line);

/// How often both lines changed in one write. This only works if each write names all lines of its
/// chip, as libgpiod 1 does: otherwise the end of a write can't be seen.
int changesTogether(const kernel::KernelTrace& trace, unsigned one, unsigned other);

}  // namespace stepdriver::node_test
