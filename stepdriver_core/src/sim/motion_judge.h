#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "stepdriver_core/sim/rig.h"

namespace stepdriver::sim {

/// How far the timeline of all motors may have slid by now: a step that comes too soon after a turn
/// waits for the times of DIR, and all later steps of all motors wait with it.
class Slides {
 public:
  /// A motor turns, and its next step may wait for up to this time.
  void add(std::int64_t longest_ns) { total_ns_ += longest_ns; }
  std::int64_t total() const { return total_ns_; }

 private:
  std::int64_t total_ns_ = 0;
};

/// Judges the steps of a motor by what its configuration allows. It sees their times and
/// directions, and nothing else.
///
/// A step from count k to k + 1, and one back, is where the motion crosses k + 1/2. So the places
/// at the times of steps are known exactly, and the mean velocities between them. If no
/// acceleration exceeds a, two means u over T and v over U that follow each other differ by at most
/// a (T + U)/2: the mean value theorem of the second divided difference. The judge compares means
/// over 1, 2, 4, ... steps, always two blocks of the same number of steps that follow each other,
/// which is two comparisons a step, however long the motion is. The small ones see a burst of a few
/// steps, and the large ones a slow drift, because the roundings count for less there.
///
/// What it has to allow for:
/// - The velocity may jump by the start rate, up or down.
/// - Steps may end at any time without a ramp (an emergency stop, an endstop, a fault). The next
///   one then belongs to a motion that starts from rest on a whole step, and comes no sooner than
///   half a step takes from there. After a pause of that length or longer, the motor may have
///   rested.
/// - Each time is rounded to a nanosecond, and the timeline may have slid (Slides).
/// - The curves of trajectories are approximated (kPlaceError, kMore).
class MotionJudge {
 public:
  /// [steps] How far a motion may be from the curve that keeps the limits: trajectories and paths
  /// are divided into cubics that stay within a hundredth of a step of it.
  static constexpr double kPlaceError = 0.01;
  /// Trajectories may exceed a limit by a hundredth of it.
  static constexpr double kMore = 1.01;
  /// Half a full step, at most, in the finest mode.
  static constexpr int kMostCaughtUp = 128;

  explicit MotionJudge(const MotorLimits& limits);

  /// The step went out.
  ///
  /// @param way [steps] in the unit of the limits: 1 in the configured microstep mode, with the
  ///   sign of its direction
  /// @param slides_ns Slides::total() at that time
  /// @return the limit that the motion has exceeded, if it has.
  std::optional<Violation> step(double way, std::int64_t time_ns, std::int64_t slides_ns);

  /// Steps may be late from now on: the next one of this motor isn't judged, nor those that catch
  /// up with the plan, nor what was before.
  void forget();

  /// The first violation, in words; empty if there is none.
  const std::string& firstViolation() const { return first_violation_; }

 private:
  struct Edge {
    double place = 0.0;  // [steps] where the crossing is
    std::int64_t time_ns = 0;
    std::int64_t slides_ns = 0;
    std::uint64_t rests = 0;    // how often the motor may have rested by then
    std::int64_t since_ns = 0;  // the first step after the last of these rests
  };
  /// The last ends of blocks of 2^n steps, the latest first.
  struct Scale {
    std::array<Edge, 3> ends;
    int known = 0;
  };
  /// Between two steps.
  struct Mean {
    double velocity = 0.0;  // [steps/s]
    double seconds = 0.0;
    double error = 0.0;  // the error of the velocity
  };
  static constexpr std::size_t kScales = 40;

  static Mean meanOf(const Edge& from, const Edge& to, double step);
  void rest(const Edge& last, Edge& next, double step) const;
  bool isTooFast(const Edge& from, const Edge& to, double step) const;
  bool isTooSudden(const Scale& scale, double step) const;
  void note(Violation violation, const Scale& scale, std::size_t steps);

  const double rate_;
  const double acceleration_;
  const double start_rate_;
  const double late_;
  std::uint64_t steps_ = 0;
  double position_ = 0.0;
  int forgets_ = 0;  // the next steps, this many
  std::array<Scale, kScales> scales_;
  std::string first_violation_;
};

}  // namespace stepdriver::sim
