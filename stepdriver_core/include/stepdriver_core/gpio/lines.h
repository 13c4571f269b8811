#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/bias.h"

/// Lines in, lines out. Levels here are physical: true is high. Polarity belongs to who knows the
/// wiring (see config/axis_config.h); nothing below this interface inverts anything.
namespace stepdriver::gpio {

/// A line that is driven.
struct OutputRequest {
  std::string line;      ///< `chip:offset`, `label:offset` or the kernel's name of the line
  bool safe_level;       ///< driven from the request on, without a glitch, and again before release
  bool keep_on_release;  ///< leave the last level instead of driving the safe one before release
};

/// A line that is read.
struct InputRequest {
  std::string line;
  Bias bias = Bias::kAsIs;  ///< refused where the library or the kernel can't set one
  bool edges = false;       ///< its edges end Lines::waitForEdges()
};

/// An output, by its index in the request, and the level that it is to have.
struct LineWrite {
  int output;
  bool level;
};

/// An edge of an input. It is a wake-up and a time: edges may be lost, doubled or late, so that
/// only read() tells the level.
struct EdgeEvent {
  int input;             ///< by its index in the request
  bool level;            ///< right after the edge, as the event tells it: a hint
  std::int64_t time_ns;  ///< CLOCK_MONOTONIC, as the kernel stamped it; on simulated lines, theirs
};

/// The lines of one request, held until destruction.
///
/// write() and read() may be called from several threads. They neither throw nor allocate: they
/// are called by the pulse thread.
class Lines {
 public:
  Lines() = default;
  Lines(const Lines&) = delete;
  Lines& operator=(const Lines&) = delete;

  /// Drives the safe levels (see OutputRequest) and releases the lines.
  virtual ~Lines() = default;

  /// Sets outputs that change at one instant; the others keep their levels.
  ///
  /// A kernel driver may set the lines one after the other, in any order: lines whose order
  /// matters go in separate calls.
  ///
  /// @return 0, or the errno of the failed call; then any of these outputs may have changed or not.
  [[nodiscard]] virtual int write(const LineWrite* writes, std::size_t count) noexcept = 0;

  /// @return the level of an input, by its index in the request (0 or 1), or -errno.
  [[nodiscard]] virtual int read(int input) noexcept = 0;

  /// Waits for edges of the inputs that were requested with them. For one thread that watches, and
  /// never the pulse thread.
  ///
  /// @param timeout_ns on CLOCK_MONOTONIC, on simulated lines too; negative: no time-out.
  /// @param capacity of `events`, above 0. Edges that don't fit are told by the next call.
  /// @return the number of events; 0 after the time-out, an interrupt() or a signal; or -errno,
  ///   which is told once where a chip has gone.
  [[nodiscard]] virtual int waitForEdges(std::int64_t timeout_ns, EdgeEvent* events,
                                         std::size_t capacity) noexcept = 0;

  /// Ends the waitForEdges() under way in another thread, or else the next one.
  virtual void interrupt() noexcept = 0;

  /// A line as messages name it, with the chip that it is on, by its index in the request.
  virtual const std::string& outputName(int output) const = 0;
  virtual const std::string& inputName(int input) const = 0;

  /// The chip that an output is on, as a number that is the same for outputs of one chip: a chip
  /// that hangs must not delay what is written to others.
  virtual std::size_t outputChip(int /*output*/) const { return 0; }
};

/// Where lines come from.
class Backend {
 public:
  virtual ~Backend() = default;

  /// Takes all lines, or none.
  ///
  /// @throw GpioError naming the line, the reason and the remedy.
  virtual std::unique_ptr<Lines> request(const std::vector<OutputRequest>& outputs,
                                         const std::vector<InputRequest>& inputs) = 0;
};

}  // namespace stepdriver::gpio
