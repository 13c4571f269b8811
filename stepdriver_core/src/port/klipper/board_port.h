#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "port/klipper/board.h"
#include "port/klipper/step_compressor.h"
#include "port/step_port.h"

namespace stepdriver::klipper {

/// Plays the steps of channels by the steppers of boards.
///
/// Steps are collected for a fifth of the horizon, compressed, and sent. The boards watch the
/// switches by themselves: each channel has a `trsync`, which stops its motors at one instant when
/// a switch of the direction that is played, or a fault output, becomes active, or when the steps
/// are taken back. The boards say where the motors stand: every 10 ms while they move, and after
/// each stop. Only that tells what was played.
class BoardPort final : public pulse::StepPort {
 public:
  /// A motor on its board.
  struct Motor {
    std::uint32_t oid = 0;      ///< of its stepper
    bool forward_level = true;  ///< of DIR
  };
  /// A switch that stops a channel.
  struct Switch {
    std::uint32_t oid = 0;  ///< of its endstop
    bool active = true;     ///< its level then
    pulse::EndReason reason = pulse::EndReason::kEndstopMin;
    int direction = 0;      ///< of the steps that it forbids; 0: both
    std::size_t motor = 0;  ///< whose fault output it is
  };
  struct Channel {
    Board* board = nullptr;
    std::uint32_t trsync = 0;
    std::vector<Motor> motors;
    std::vector<Switch> switches;
    std::uint32_t pulse_ticks = 0;  ///< width of a pulse
    Nanoseconds low = 0;            ///< from the end of a pulse to the next one
    Nanoseconds turn = 0;           ///< the same with a turn of DIR between them
    int line = -1;                  ///< of STEP, for messages
  };
  struct Options {
    Nanoseconds horizon = 50'000'000;
    /// How far the steps of a board may be from their times.
    Nanoseconds step_error = 0;  ///< 0: a tick
  };

  /// @param boards are configured; they outlive this.
  /// @param writes is called in serve(): it sends the outputs that other threads have set.
  /// @param hears is told what the boards say of other objects.
  BoardPort(std::vector<Board*> boards, pulse::Clock& clock, std::vector<Channel> channels,
            Options options, std::function<void()> writes,
            std::function<void(const Board&, const Heard&, Nanoseconds)> hears);
  ~BoardPort() override;

  Nanoseconds horizon() const override { return options_.horizon; }
  void begin(std::size_t channel, const Manner& manner) override;
  /// The steppers turn by themselves: the lanes accept either direction.
  void aim(std::size_t /*channel*/, int /*direction*/) override {}
  void put(const Step& step) override;
  void takeBack(std::size_t channel) override;
  void serve(Nanoseconds now) override;
  void recordTo(pulse::PinRing& /*ring*/) override {}

  /// For the thread that brings a board back: stops what its motors still make, disarms its
  /// switches, and asks where the motors stand. @pre Board::reopen() has succeeded.
  /// @throw BoardError
  void prepare(Board& board);

 private:
  struct Track;
  class Ear;

  struct Open {
    std::int64_t tick = 0;
    int direction = 0;
    pulse::MotorSet still = 0;
  };

  bool isUsable(Board& board);
  bool works(const Board& board) const;
  void takeOver(Board& board);
  /// Between these ticks a board has said where a motor stands.
  struct Window {
    std::int64_t least = 0;
    std::int64_t most = 0;
  };

  void heard(Board& board, const Heard& heard, Nanoseconds now);
  void lost(Board& board, Nanoseconds now);
  /// Steps are collected for a fifth of the horizon, so that they can be compressed; the rest is
  /// for the line, which may have to repeat them.
  Nanoseconds sentAhead() const { return options_.horizon - options_.horizon / 5; }
  std::int64_t closestTick(const Track& track, int direction) const;
  void flush(std::size_t channel, Nanoseconds now);
  bool flushMotor(Track& track, std::size_t motor, Nanoseconds now);
  void arm(Track& track, int direction, std::int64_t from);
  void disarm(Track& track);
  void stop(std::size_t channel, Nanoseconds now);
  void askPositions(Track& track, Nanoseconds now);
  std::size_t playedBy(const Track& track, std::size_t motor, const Window& window,
                       bool& fits) const;
  std::int64_t latestTick(const Track& track, Nanoseconds now) const;
  std::int64_t earliestTick(const Track& track) const;
  void tellPlayed(std::size_t channel, Nanoseconds now);
  void settle(std::size_t channel, Nanoseconds now);
  void close(std::size_t channel, std::size_t played, Nanoseconds now);
  void failChannel(std::size_t channel, int error, Nanoseconds now);
  void giveUp(std::size_t channel, int error, Nanoseconds now);
  void schedule(Nanoseconds now);
  std::size_t indexOf(const Board& board) const;
  std::size_t& entriesOf(const Board& board) { return entries_[indexOf(board)]; }

  const std::vector<Board*> boards_;
  pulse::Clock& clock_;
  const Options options_;
  const std::function<void()> writes_;
  const std::function<void(const Board&, const Heard&, Nanoseconds)> hears_;
  std::vector<std::unique_ptr<Track>> tracks_;
  std::vector<std::unique_ptr<Ear>> ears_;
  std::vector<std::size_t> entries_;    // of each board that are in use
  std::vector<std::int64_t> said_;      // the tick that each has last told
  std::vector<std::uint64_t> resumed_;  // Board::resumed() of each when it was taken over
  std::vector<char> usable_;            // what isUsable() has said of each
  Nanoseconds positions_due_ = 0;
};

}  // namespace stepdriver::klipper
