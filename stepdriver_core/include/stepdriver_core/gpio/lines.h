#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/bias.h"

/// Lines in, lines out. Levels here are physical: true is high. Polarity is the responsibility of
/// the callers, who know the wiring (see config/axis_config.h); nothing below this interface
/// inverts anything.
namespace stepdriver::gpio {

/// An output line.
struct OutputRequest {
  std::string line;      ///< `chip:offset`, `label:offset` or the kernel's name of the line
  bool safe_level;       ///< driven without a glitch from the request on, and again before release
  bool keep_on_release;  ///< keep the last level on release instead of driving the safe one
};

/// An input line.
struct InputRequest {
  std::string line;
  Bias bias = Bias::kAsIs;  ///< refused if the library or the kernel can't set one
  bool edges = false;       ///< its edges wake up Lines::waitForEdges()
};

/// An output, by its index in the request, and its new level.
struct LineWrite {
  static constexpr std::uint16_t kWhole = 65'535;
  int output;
  bool level;
  /// Of a PWM output that becomes high: how far the length of its pulses is from that of low to
  /// that of high, in parts of kWhole. Other outputs don't have it.
  std::uint16_t part = kWhole;
};

/// What has become of an output's writes that another thread makes after Lines::write() has
/// returned. Writes have numbers that rise, from 1.
struct LateWrites {
  std::uint64_t ordered = 0;  ///< the number of the last one; 0: this output has had no such write
  std::uint64_t ended = 0;    ///< this one has ended, and all before it
  std::uint64_t failed = 0;   ///< the number of the last one that has failed; 0: none has
  int error = 0;              ///< errno of that one
};

/// An edge of an input. It is only a wake-up and a time: edges may be lost, doubled or late, so use
/// read() for the level.
struct EdgeEvent {
  int input;   ///< by its index in the request
  bool level;  ///< right after the edge, according to the event: a hint
  /// CLOCK_MONOTONIC, as stamped by the kernel; on simulated lines, their own time.
  std::int64_t time_ns;
};

/// The lines of one request, which are held until destruction.
///
/// write() and read() may be called from several threads. They neither throw nor allocate, because
/// the pulse thread calls them.
///
/// @code{.cpp}
/// const auto lines = backend.request({{"gpiochip0:17", false, false}}, {{"gpiochip0:20"}});
/// const gpio::LineWrite high{0, true};  // the first output
/// const int error = lines->write(&high, 1);
/// if (error != 0) std::cerr << std::strerror(error) << "\n";
/// const bool pressed = lines->read(0) == 1;  // the first input
/// @endcode
class Lines {
 public:
  Lines() = default;
  Lines(const Lines&) = delete;
  Lines& operator=(const Lines&) = delete;

  /// Drives the safe levels (see OutputRequest) and releases the lines.
  virtual ~Lines() = default;

  /// Sets outputs that change at one instant; the others keep their levels.
  ///
  /// A kernel driver may set the lines one after the other, in any order: if the order of lines
  /// matters, write them in separate calls.
  ///
  /// @return 0, or the errno of the failed call; each of these outputs may then have changed or
  ///   not. For the pulse thread, the end of a write of a PWM output is in lateWrites().
  [[nodiscard]] virtual int write(const LineWrite* writes, std::size_t count) noexcept = 0;

  /// The writes of an output for which write() doesn't wait, by its index in the request.
  [[nodiscard]] virtual LateWrites lateWrites(int /*output*/) const noexcept { return {}; }

  /// @return the level of an input, by its index in the request (0 or 1), or -errno.
  [[nodiscard]] virtual int read(int input) noexcept = 0;

  /// Waits for edges of the inputs that were requested with edges. For one watching thread, never
  /// the pulse thread.
  ///
  /// @param timeout_ns on CLOCK_MONOTONIC, on simulated lines too; negative: no timeout.
  /// @param capacity of `events`, above 0. The next call reports the edges that don't fit.
  /// @return the number of events; 0 after the timeout, an interrupt() or a signal, if nothing is
  ///   left to report; or -errno, which is reported once if a chip was removed.
  [[nodiscard]] virtual int waitForEdges(std::int64_t timeout_ns, EdgeEvent* events,
                                         std::size_t capacity) noexcept = 0;

  /// Ends a waitForEdges() in progress in another thread; if there is none, ends the next one.
  virtual void interrupt() noexcept = 0;

  /// A line as messages name it, with its chip, by its index in the request.
  virtual const std::string& outputName(int output) const = 0;
  virtual const std::string& inputName(int input) const = 0;

  /// What has happened to the chip of a line that can't be used any more, in words, if more is
  /// known of it than the errno of a call; else empty. The line is an input or an output, by its
  /// index. For any thread.
  virtual std::string failureText(bool /*input*/, int /*line*/) const { return {}; }

  /// The number of an output's chip, which is the same for all outputs of a chip: a chip that hangs
  /// must not delay writes to others.
  virtual std::size_t outputChip(int /*output*/) const { return 0; }
};

/// Provides lines.
class Backend {
 public:
  virtual ~Backend() = default;

  /// Requests all lines; if one fails, none is held.
  ///
  /// @throw GpioError naming the line, the reason and the remedy.
  virtual std::unique_ptr<Lines> request(const std::vector<OutputRequest>& outputs,
                                         const std::vector<InputRequest>& inputs) = 0;

  /// Sends bytes to a serial port that is simulated, with or without a pause since the last ones,
  /// and returns what is heard at once. For one thread at a time.
  using SerialExchange = std::function<std::vector<std::uint8_t>(const std::uint8_t* bytes,
                                                                 std::size_t count, bool pause)>;

  /// @return empty: the port is a device of this computer. Otherwise the backend outlives it.
  virtual SerialExchange simulatedSerial(const std::string& /*port*/) { return {}; }
};

}  // namespace stepdriver::gpio
