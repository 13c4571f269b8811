#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "axis_impl.h"
#include "stepdriver_core/axis/homing.h"
#include "stepdriver_core/motion/profile.h"

namespace stepdriver::axis {

/// A homing under way: a row of strokes, each an ordinary move of the axis, and what to do at the
/// end of each.
///
/// It is a state machine that whoever waits for it turns, and has no thread: so several axes go at
/// once in one thread, and on a virtual clock that the waiting thread drives. Where nothing is to
/// move for a while, as until a switch has bounced out, it makes moves to where the axis stands:
/// each takes the lead time of a plan, about a millisecond, on any clock.
class Homing {
 public:
  /// Makes the axis one that homes; nothing moves before advance(). @throw Refused
  explicit Homing(Axis::Impl& axis);
  ~Homing();
  Homing(const Homing&) = delete;
  Homing& operator=(const Homing&) = delete;

  /// Why this axis can't be homed now. @pre the axis's lock is held. @throw Refused
  static void refuseUnlessReady(Axis::Impl& axis);

  /// Turns them all until the last is over.
  static std::vector<HomingResult> run(const std::vector<std::unique_ptr<Homing>>& homings,
                                       const std::function<bool()>& cancelled);

  bool isOver();
  /// Whether there is something for advance() to do.
  bool isDue();
  void advance();
  void cancel();

  // For the axis, which holds its lock.
  HomingPhase phase() const { return phase_; }
  /// Someone stops or disables the axis.
  void interrupt(const std::string& why);
  /// Feed hold: no stroke begins until it goes on, and the time doesn't count.
  void hold();
  void goOn();
  bool isHeld() const { return held_since_.has_value(); }

 private:
  void step();
  void underWay();
  void strokeEnded(MoveEnd end, const pulse::ChannelState& channel);
  void rested();

  void enter(HomingPhase phase);
  void resume();
  void stroke(std::int64_t target, double speed);
  void settle();
  void sample();
  void settled();
  void keepCourse(const pulse::ChannelState& channel);
  std::optional<std::int64_t> triggerEdge() const;
  double triggerCount() const;
  void pullOff();

  void fail(const std::string& why, HomingEnd end = HomingEnd::kFailed);
  void succeed();
  void finish(const std::string& message);

  bool leaves() const;
  bool isClosed() const { return *axis_.endstopActive(line_, endstop_); }
  bool isReplaced() const { return stroke_ != 0 && axis_.lastMove() != stroke_; }
  pulse::Nanoseconds now() const { return axis_.driver.clock().now(); }
  pulse::Nanoseconds slipped() const { return axis_.driver.engine().state().slipped; }
  std::string timeOver() const;

  Axis::Impl& axis_;
  const HomingConfig& config_;
  const std::optional<Endstop>& endstop_;
  const int line_;
  const double towards_;  // 1: the count rises towards the switch; -1: it falls
  const std::string switch_;
  const pulse::Nanoseconds debounce_;

  HomingPhase phase_ = HomingPhase::kNone;
  bool over_ = false;
  HomingResult result_;
  std::string failure_;
  std::string interrupted_;
  bool cancelled_ = false;
  pulse::Nanoseconds deadline_ = 0;
  std::optional<pulse::Nanoseconds> held_since_;

  std::uint64_t stroke_ = 0;  // the move that is under way or was the last; 0: none yet
  std::int64_t bound_ =
      0;                  // the joint's count at which the strokes of this phase end at the latest
  bool slowing_ = false;  // the switch has opened
  pulse::Nanoseconds phase_began_ = 0;

  // While the switch settles.
  bool settling_ = false;
  bool closed_ = false;
  pulse::Nanoseconds settle_began_ = 0;
  pulse::Nanoseconds steady_since_ = 0;

  // Of the latch: what the axis followed, and how that ended.
  std::optional<motion::Profile> course_;
  pulse::ChannelState latched_;
  pulse::Nanoseconds slipped_before_ = 0;
  pulse::Nanoseconds slipped_ = 0;
  double trigger_ = 0.0;  // [microsteps] of the joint
};

}  // namespace stepdriver::axis
