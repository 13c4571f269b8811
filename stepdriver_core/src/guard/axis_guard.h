#pragma once

#include <atomic>
#include <cstdint>
#include <optional>

#include "channel/channel_config.h"
#include "channel/channel_state.h"
#include "channel/watched_lines.h"
#include "shared_ends.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// Why a motion must end.
struct Objection {
  EndReason reason = EndReason::kDone;
  LineFailure failure;  ///< only for kLineError
};

/// Whether the steps of an axis may go out, and whether its motion may end: by its switches, the
/// fault and in-position outputs of its chips, and how far its motors are apart. For the pulse
/// thread; what others may know of it is in the ChannelState.
class AxisGuard {
 public:
  /// @param config, state, lines outlive this.
  AxisGuard(const ChannelConfig& config, ChannelState& state, WatchedLines& lines);

  /// It has no input that could object to a step, and its motors are in step.
  bool isIdle() const { return idle_; }

  /// @name Motors
  /// @{
  std::size_t motors() const { return 1 + config_.twins.size(); }
  bool has(std::optional<Signal> MotorSignals::*signal) const;
  /// How a motion from rest is made, see Follow.
  struct Manner {
    bool squares = false;
    bool is_square = false;
    bool until_block = false;
  };
  /// A motion begins from rest. @param now clock time.
  void begin(const Manner& manner, Nanoseconds now);
  void end();
  /// @}

  /// @name Reservation, while the chip's other pins are being written
  /// @{
  bool reserved() const { return reserved_; }
  void reserve();
  void release();
  /// @}

  /// @name Fault outputs
  /// @{
  /// Its fault outputs must be read before the next step: a chip may wake with a fault that it had
  /// before, of which its line tells nothing then.
  bool unchecked() const { return unchecked_; }
  void check() { unchecked_ = false; }
  /// Reads the fault output of a motor's chip. Counts a new fault.
  std::optional<Objection> readFault(std::size_t motor);
  /// Counts a fault that a port has seen, unless it is known.
  void noteFault(std::size_t motor);
  /// @}

  /// @name Steps
  /// @{
  /// Reads the switches of its motors in a direction. @param direction +1, -1 or 0
  std::optional<Objection> mayStep(int direction);
  /// The input that tells of a block has become active at a clock time. It may be inactive again by
  /// the next step. From any thread.
  void noteBlock(Nanoseconds time) { block_edge_.store(time, std::memory_order_release); }
  /// @}

  /// @name The end of a profile that settles
  /// @{
  /// Whether the in-position outputs of all motors are active, waiting for them if not.
  enum class Settling { kDone, kWaits, kTooLong, kFailed };
  Settling settle(Nanoseconds now);
  /// The output that could not be read.
  const LineFailure& failure() const { return failure_; }
  bool settling() const { return settling_; }
  /// Clock time before which the end of the profile needn't be looked at.
  Nanoseconds lookAt() const { return look_at_; }
  void lookAgain(Nanoseconds now) { look_at_ = now; }
  /// Another profile is followed. @param steps it makes some: the wait begins again.
  void adopted(bool steps);
  /// @}

 private:
  const MotorSignals& motor(std::size_t number) const {
    return number == 0 ? config_ : config_.twins[number - 1];
  }
  std::optional<Objection> readSwitch(std::size_t motor, bool forward);
  std::optional<Objection> readSharedSwitch(int direction);
  std::optional<Objection> readBlock();
  void countFault(std::size_t motor);
  bool wouldSkew(int direction) const;
  std::int64_t skewAfter(int direction) const;

  const ChannelConfig& config_;
  ChannelState& state_;
  WatchedLines& lines_;
  const MotorSet all_motors_;
  const bool has_switch_;
  const bool idle_;
  SharedEnds shared_;
  bool squares_ = false;  // the current motion does
  bool until_block_ = false;
  Nanoseconds began_ = 0;  // clock time
  std::atomic<Nanoseconds> block_edge_{-1};
  bool reserved_ = false;
  bool unchecked_ = false;
  MotorSet faulty_ = 0;        // the motors with a fault, by the last readings of the fault lines
  MotorCounts square_lags_{};  // ChannelState::lags when it was square
  bool settling_ = false;
  Nanoseconds settling_since_ = 0;
  Nanoseconds look_at_ = 0;
  LineFailure failure_;
};

}  // namespace stepdriver::pulse
