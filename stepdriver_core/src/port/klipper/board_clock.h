#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::klipper {

using pulse::Nanoseconds;

/// The clock of a board against the engine's: the board's ticks at the engine's times.
///
///     clock.add({sent, received, ticks});                // once a second: an answer of get_clock
///     const std::int64_t tick = clock.tickAt(step.time);
///
/// Its estimate is a regression over the last answers, in which those that came quickly count more:
/// the board read its clock at some time between `sent` and `received`. What was converted before
/// isn't changed by a new answer: conversions continue from there with a rate that leads to the new
/// estimate, so the intervals of steps don't jump.
class BoardClock {
 public:
  /// @param frequency [Hz] nominal, above 0.
  explicit BoardClock(double frequency);

  struct Sample {
    Nanoseconds sent = 0;
    Nanoseconds received = 0;
    std::uint32_t ticks = 0;  ///< the lower half of the board's clock
  };
  void add(const Sample& sample);
  bool isKnown() const { return samples_ != 0; }

  /// Nothing is on its way to the board: the next conversion may be by the newest estimate alone.
  void settle() { settles_ = true; }
  /// The board's tick at a time, which is nothing before the last one that was converted.
  std::int64_t tickAt(Nanoseconds time);
  /// When the board has that tick, as far as is known.
  Nanoseconds timeOf(std::int64_t tick) const;
  /// The board's tick now, without converting anything.
  std::int64_t estimateAt(Nanoseconds time) const;
  /// A tick of which the board has told the lower half, near a time.
  std::int64_t widened(std::uint32_t ticks, Nanoseconds near) const;

  double nominal() const { return nominal_; }
  /// [Hz] by the computer's clock.
  double frequency() const { return frequency_; }
  /// [ppm] by which the board's clock is faster than nominal.
  double drift() const { return (frequency_ / nominal_ - 1.0) * 1e6; }
  /// [ns] How far off the estimate may be: half of the quickest round trip among the answers, and
  /// the deviation of the others from the line.
  Nanoseconds uncertainty() const { return uncertainty_; }
  /// The same at a time far from the answers, which gets worse by what isn't known of the
  /// frequency.
  Nanoseconds uncertaintyAt(Nanoseconds time) const;

 private:
  struct Point {
    Nanoseconds time = 0;  // in the middle of the round trip
    Nanoseconds half = 0;  // of it
    std::int64_t tick = 0;
  };

  void estimate();

  static constexpr std::size_t kPoints = 32;
  const double nominal_;
  double frequency_;
  std::array<Point, kPoints> points_{};
  std::size_t samples_ = 0;
  // The estimate: a tick at a time, and the frequency.
  Nanoseconds time_ = 0;
  double tick_ = 0.0;
  std::int64_t whole_ = 0;  // is added to tick_
  Nanoseconds uncertainty_ = 0;
  double frequency_deviation_ = 0.0;
  Nanoseconds mean_time_ = 0;  // of the answers
  // Conversions from this time on.
  bool settles_ = true;
  bool is_newer_ = false;  // there is an estimate that they don't lead to yet
  Nanoseconds from_ = 0;
  std::int64_t from_whole_ = 0;
  double from_tick_ = 0.0;
  double rate_ = 0.0;  // [ticks/ns]
  Nanoseconds last_ = 0;
};

}  // namespace stepdriver::klipper
