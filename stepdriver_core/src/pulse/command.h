#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "channel/channel_config.h"
#include "channel/channel_state.h"
#include "channel/output_line.h"
#include "profile/marks.h"
#include "profile/shaped_axes.h"
#include "profile/shaped_profile.h"
#include "stepdriver_core/pulse/clock.h"
#include "timeline/compare_track.h"

namespace stepdriver::pulse {

/// A profile for a channel to follow from its start time on, replacing the one before it. The
/// engine refuses it if the state that it was planned from has changed.
struct Follow {
  int channel = 0;
  std::uint64_t serial = 0;
  motion::ShapedProfile profile;  ///< its data live until the channel stops following it
  /// Serial of the profile that this one was planned to continue, the last one that was ordered;
  /// 0: from rest. If the channel has ended that one, this one is refused.
  std::uint64_t continues = 0;
  /// Steps planned closer than this are at a speed that the motor can't start from or stop at
  /// without a ramp.
  Nanoseconds restart_interval = 0;
  /// Channels of the same group end together, unless it is 0: anything that ends one of them early
  /// ends all others at once.
  std::uint64_t group = 0;
  /// PulseEngine::stopsServed() as it was known when this was planned. If an emergency stop has
  /// been requested since, this one is refused.
  std::uint64_t stops = 0;
  /// ChannelState::faults() as it was known when this was planned. If a fault has come since, this
  /// one is refused.
  std::uint64_t faults = 0;
  /// It brings the channel to rest: it is followed also in the ramp of an emergency stop.
  bool slows = false;
  /// Its end is a target that was asked for: not a stop, and nothing that the machine does before,
  /// as taking up a backlash.
  bool arrives = false;
  /// At its end it waits for the in-position outputs, if the channel has any.
  bool settles = false;
  /// [microsteps] A full step: steps may be late by ChannelConfig::late_steps of it. 0: each step
  /// may only be late by a quarter of its interval.
  int full_step = 0;
  /// @name Orders from rest; profiles that continue them keep these. All but the last are for an
  /// axis
  ///   with several motors.
  /// @{
  MotorSet still = 0;  ///< these motors make no steps
  /// Each motor stops at its own endstop, and the others continue. The motion ends as at an endstop
  /// when all motors have stopped, and as kSkewed if they get too far apart
  /// (ChannelConfig::max_skew). A motor without an endstop in the direction continues to the end.
  bool squares = false;
  bool is_square = false;    ///< the motors are square: their skew counts from here
  bool until_block = false;  ///< it ends when the motor is blocked, see ChannelConfig::block
  /// @}
};

/// The marks of an output with a name along a path, for a motion along it that its axes follow. The
/// engine refuses it with the motions of its command.
struct FollowMarks {
  std::size_t output = 0;    ///< the output's number in the configuration
  std::uint64_t serial = 0;  ///< counts the orders for this output, above 0
  std::uint64_t group = 0;   ///< Follow::group of the path
  /// Live until the output reads a later order, or none, see OutputLineState::reads.
  const motion::Profile* along = nullptr;
  const motion::OutputMarks* marks = nullptr;
  const motion::ShapedAxes* axes = nullptr;  ///< see MarkFollower
  /// The path hasn't had the output yet: it begins with its first mark. Otherwise the order does
  /// nothing if the path's part has ended.
  bool begins = false;
  /// @name The state of the output, if it begins
  /// @{
  std::uint64_t changes = 0;  ///< OutputLineState::changes, as far as it is known
  WrittenOutput written;
  /// @}
};

/// The position of an axis switches an output from now on. The order does nothing if the axis
/// moves.
struct Compare {
  std::size_t output = 0;    ///< by its number in the configuration
  std::uint64_t serial = 0;  ///< of the orders for this output, above 0
  int channel = 0;
  const CompareTrack* track = nullptr;  ///< lives until the output reads a later order, or none
  /// @name The state of the output
  /// @{
  std::uint64_t changes = 0;  ///< OutputLineState::changes, as far as it is known
  WrittenOutput written;
  /// @}
};

/// An order to the pulse thread. Serials rise by one on each channel.
struct Command {
  /// What the command orders.
  enum class Kind {
    kFollow,    ///< follow the profiles: all of them, or none if one can't be accepted
    kReserve,   ///< the chip's other pins are being written: make no step, ignore the fault line
    kRelease,   ///< ends a reservation
    kFault,     ///< a chip of the channel has reported a fault over its port, see ramps_at_fault
    kBlocked,   ///< a chip of the channel has told over its port that its motor is blocked
    kCompare,   ///< the position of an axis switches an output
    kEndMarks,  ///< motions no longer switch an output: what is left of its marks is given up
  };

  Kind kind = Kind::kFollow;
  const Follow* follows = nullptr;  ///< for kFollow; valid until the channels have handled it
  std::size_t follow_count = 0;
  const FollowMarks* marks = nullptr;  ///< accepted or refused with the profiles; valid as they are
  std::size_t marks_count = 0;
  const Compare* compare = nullptr;  ///< for kCompare; valid until the output has handled it
  std::size_t output = 0;            ///< for kCompare and kEndMarks, with the serial
  int channel = 0;                   ///< for all others, like all below
  std::uint64_t serial = 0;
  Nanoseconds ready = 0;  ///< for kRelease: clock time before which no step goes out
  /// The motor's position in the microsteps of a new mode.
  struct Scale {
    std::int64_t count = 0;
    double taken_up = 0.0;  ///< the part of the backlash that is taken up, see ChannelState
    double backlash = 0.0;
    double switch_release = 0.0;  ///< see ChannelConfig
  };
  std::optional<Scale> scale;  ///< for kRelease
  /// For kRelease, if lines switch the coils of the motors: their current from now on.
  std::optional<CoilCurrent> coils;
};

}  // namespace stepdriver::pulse
