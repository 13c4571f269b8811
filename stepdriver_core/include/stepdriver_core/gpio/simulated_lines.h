#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "stepdriver_core/gpio/lines.h"

namespace stepdriver::gpio {

/// Receives an input's edge: the level right after it and its time. It must not call the board.
using EdgeListener = std::function<void(bool level, std::int64_t time_ns)>;

/// The board that is wired to simulated lines: it sees every change of an output and decides the
/// level of every input.
///
/// The calls come one at a time, in the order of the changes, from the thread that writes. A line
/// is looked up by its name when it is requested, and has an index from then on.
class Board {
 public:
  virtual ~Board() = default;

  /// @return the board's index of a line, the same each time. Every name is a line.
  virtual int lineIndex(const std::string& line) = 0;

  /// The line was requested as an output and has this level from now on.
  virtual void onRequest(int line, bool level, std::int64_t time_ns) = 0;

  /// The output changed. Called once for each line that changed, not for a line that kept its
  /// level.
  virtual void onEdge(int line, bool level, std::int64_t time_ns) = 0;

  /// All edges of one write, or of a request, have been told. A board on which the lines of one
  /// write act together overrides this.
  virtual void onWriteEnd(std::int64_t time_ns);

  /// The output was released. Its last edge, if any, was to the safe level.
  virtual void onRelease(int line, std::int64_t time_ns) = 0;

  /// The level of an input now. Never called for outputs.
  virtual bool inputLevel(int line, std::int64_t time_ns) = 0;

  /// Called before each write, once for each line that it names, changed or not.
  ///
  /// @return 0, or the errno with which the write fails; all its lines then keep their levels.
  virtual int writeFault(int line, std::int64_t time_ns) = 0;

  /// From now on the board reports the input's edges to this listener; an empty listener ends that.
  /// When this returns, the earlier listener isn't called anymore. A board that doesn't know when
  /// its inputs change needn't override this: waiting for edges then ends with the timeout.
  virtual void watchInput(int line, EdgeListener listener);

  /// Whether a serial port leads to the board.
  virtual bool hasSerial(const std::string& port) const;

  /// A program has sent bytes to such a port. @param pause the wire was idle before.
  /// @return what it hears then: its own bytes, and the answers.
  virtual std::vector<std::uint8_t> onBytes(const std::string& port, const std::uint8_t* bytes,
                                            std::size_t count, bool pause, std::int64_t time_ns);
};

/// Simulated lines, with a Board wired to them. Every name is a line, and each can be held once.
///
/// Lines of one write change at the same time, and the board sees them in the order of the write.
/// A write or a read of an index that the request doesn't have fails with EINVAL. A bias changes
/// nothing: the board decides what an input reads.
///
/// @code{.cpp}
/// pulse::VirtualClock clock;
/// sim::Rig rig({});  // or another gpio::Board
/// gpio::SimulatedBackend backend(rig, [&clock] { return clock.now(); });
/// @endcode
class SimulatedBackend : public Backend {
 public:
  /// Nanoseconds on the clock that stamps the edges.
  using TimeSource = std::function<std::int64_t()>;

  /// @param board is wired to the lines; outlives the backend and its lines.
  SimulatedBackend(Board& board, TimeSource now);
  ~SimulatedBackend() override;

  /// @throw GpioError if a line is named twice or is held by an earlier request (EBUSY).
  std::unique_ptr<Lines> request(const std::vector<OutputRequest>& outputs,
                                 const std::vector<InputRequest>& inputs) override;
  SerialExchange simulatedSerial(const std::string& port) override;

 private:
  struct Shared;
  class HeldLines;
  std::shared_ptr<Shared> shared_;
};

}  // namespace stepdriver::gpio
