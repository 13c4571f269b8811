#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "context.h"
#include "goal.h"

namespace stepdriver::activity {

/// A motion of one axis, or of several along one path, from the first order to the engine to the
/// standstill at its end. It plans and orders, plans again if the engine refuses an order, slows
/// down and resumes, and reports how each axis's goal ended.
///
/// The engine may refuse an order because it came too late, or because the motion that it continues
/// has ended. The order is then planned again from the current motion of the axes, as long as it
/// makes sense.
class MotionExecution {
 public:
  /// @param join of orders that are kTogether; empty for one order alone.
  /// @param start of one order alone that begins at the same time as others; may be empty.
  /// @param begins_ns motion time before which it doesn't begin.
  MotionExecution(Context& context, std::vector<Order> orders, JoinPath join = {},
                  std::shared_ptr<const CommonStart> start = {}, std::int64_t begins_ns = 0);

  /// Plans the first order; nothing is ordered yet.
  ///
  /// @return the move of each axis. @throw Refused, GpioError
  std::vector<axis::Move> prepare();
  /// Orders what was prepared.
  /// @param predecessors the goals of the axes until now.
  /// @param call is answered when the engine has accepted the order.
  void begin(std::vector<Predecessor> predecessors, SharedCall call);
  /// Comes to rest from the motion of another execution. @param predecessors as above.
  void beginStop(std::vector<Predecessor> predecessors, const EarlyEnd& why);

  /// There is news from the engine, or time has passed. @return whether the execution has ended.
  bool poll();
  /// How the first axis's goal ended, once poll() has said that the execution has.
  const axis::MoveResult& result() const { return result_; }
  /// Why it did not begin; empty if it did.
  const std::optional<Failure>& failure() const { return failure_; }

  /// Slows down to rest, along the path of axes that move together.
  /// @param call is answered when the axes decelerate.
  void stop(const EarlyEnd& why, const SharedCall& call = {});
  /// The same, and keeps the goals.
  void hold(const SharedCall& call);
  bool isHeld() const { return held_; }
  /// @throw Refused if it is held, and can't be resumed now.
  void refuseUnlessResumable() const;
  /// @pre refuseUnlessResumable() has just returned.
  /// @param call is answered when the engine has accepted the motion.
  void resume(const SharedCall& call);
  /// The override or the limits have changed.
  void replan(const SharedCall& call);

  /// Continues the path that the axes follow. If it comes too late, they come to rest at the end of
  /// that path, and continue from there.
  ///
  /// @param call is answered when the engine has accepted the motion. It fails as outdated if the
  ///   axes follow another path by now, or may have left the part that both paths share when the
  ///   new one takes over.
  void extend(Extension extension, const SharedCall& call);
  /// The path that the axes follow; nullptr if they don't, or not yet.
  std::shared_ptr<const motion::SharedPath> sharedPath() const { return course_.path; }
  /// The motion along it that was ordered last.
  std::shared_ptr<const motion::Profile> motionAlong() const { return path_; }

  /// Leaves the axes to another execution, which takes over during the motion.
  std::vector<Predecessor> handOver();

  /// The goal of an axis; nullptr if the axis has no part in it.
  const Goal* goalOf(const axis::AxisModel& axis) const;
  /// Reports how a goal ended that no other goal has replaced.
  static void conclude(const Context& context, const Predecessor& ended);
  bool slowsDown() const { return mode_ != Mode::kRun; }

 private:
  enum class Mode { kRun, kStop, kHold };

  struct Planned {
    // empty if the axis is at rest while others stop
    std::optional<motion::PlannedMotion> motion;
    double overshoot = 0.0;
    motion::MotionLimits limits;  // see motor::Motion
    std::int64_t slows_ns = motor::Motion::kNeverSlows;
  };
  struct Plans {
    std::int64_t at = 0;
    std::vector<Planned> planned;
    std::shared_ptr<const motion::Profile> path;  // the motion along the shared path
  };

  /// The shared path and its end.
  struct Course {
    std::shared_ptr<const motion::SharedPath> path;
    std::vector<double> targets;  // [microsteps] one for each joint
  };

  /// An order that the engine has not yet handled.
  struct OpenOrder {
    std::vector<std::uint64_t> serials;  // one for each axis; 0: it has no part in it
    Mode mode = Mode::kRun;
    Plans plans;
    Course course;
    SharedCall extension;  // the call is answered when the extension begins
    std::shared_ptr<std::vector<pulse::Follow>> follows;  // the motions in its command
  };

  /// The next order is its first, and begins at the same time as others.
  bool beginsTogether() const { return start_ && !started_ && mode_ == Mode::kRun; }
  Plans plan(pulse::Nanoseconds lead);
  std::shared_ptr<const motion::Profile> planPath(std::int64_t at);
  void order(Plans plans, const SharedCall& extension = {});
  void orderMarks(const Plans& plans, const std::shared_ptr<std::vector<pulse::Follow>>& follows);
  std::vector<const axis::AxisModel*> axesAlong() const;
  void takeOutputs(const motion::SharedPath& path);
  bool mustWaitForOutputs(Plans& plans) const;
  void follow(Course course);
  void tryExtension();
  bool mayExtend(const Extension& extension) const;
  Failure noContinuation() const;
  void orderExtension(const Extension& extension, const SharedCall& call);
  /// It stands at a place of its path from which it will continue.
  bool isParked() const { return held_ || awaits_; }
  bool endsInWait() const;
  void change(Mode mode, const SharedCall& call);
  bool anyMoves() const;
  /// Its last motions have come to their planned ends.
  bool isDone() const;
  bool isOpen() const;
  bool wasAccepted(const OpenOrder& order) const;
  void accept(const OpenOrder& order);
  void refused();
  void tryAgain();
  void fail(Failure failure);
  void rested();
  void drop();
  void finish();
  void concludeGoals();
  void concludePredecessors();
  axis::MoveResult resultOf(const Order& order) const;
  axis::MoveResult droppedResult(const Order& order, bool by_it) const;
  axis::MoveResult replacedResult(const Predecessor& before, const Order& by,
                                  const motion::Profile& profile) const;
  std::string endedWith(const axis::AxisModel& axis) const;

  Context& context_;
  std::vector<Order> orders_;
  const JoinPath join_;
  const std::shared_ptr<const CommonStart> start_;
  const std::int64_t begins_ns_;
  Course course_;           // the course that was joined last
  Course accepted_course_;  // the one that the engine follows
  std::optional<std::pair<Extension, SharedCall>>
      extension_;  // waits until the engine has handled all
  std::uint64_t group_ = 0;
  std::shared_ptr<MarksOfPath> marks_;  // empty: its path has none
  std::vector<Predecessor> predecessors_;
  std::optional<Plans> prepared_;

  Mode mode_ = Mode::kRun;
  EarlyEnd why_;                     // why it stops
  Mode accepted_mode_ = Mode::kRun;  // how the engine follows it
  std::vector<OpenOrder> open_;
  // the last order begins at rest: it is the first one, or that of a resume
  bool from_rest_ = true;
  bool started_ = false;  // the engine has accepted an order
  bool held_ = false;
  bool awaits_ = false;  // rests at the end of a path that waits there for its continuation
  bool over_ = false;
  axis::MoveResult result_;
  std::optional<Failure> failure_;
  pulse::Nanoseconds lead_;
  std::shared_ptr<const motion::Profile> path_;           // as last ordered
  std::shared_ptr<const motion::Profile> accepted_path_;  // as the engine follows it
  SharedCall call_;                                       // waits for the beginning
  std::vector<SharedCall> calls_;                         // wait for the open orders
};

/// Only for a goal that isStreamed().
inline const EarlyEnd kEndedByHold{axis::MoveEnd::kStopped,
                                   "it was held, which ends jogs and setpoints"};

/// "x stands at 0.01 m, not at 0.02 m: it was stopped"
std::string standsAt(const axis::AxisModel& axis, const Goal& goal, const std::string& why);

/// An error, for the answer to a call.
Failure failureOf(const std::exception& error);

}  // namespace stepdriver::activity
