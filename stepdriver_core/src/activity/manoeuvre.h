#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "context.h"
#include "goal.h"

namespace stepdriver::activity {

/// A motion of one axis, or of several along one path, from the first order to the engine to the
/// rest at its end: it plans, orders, plans again what the engine refuses, slows down and resumes,
/// and tells how each axis's goal ended.
///
/// An order can be refused: it came too late, or what it was planned from has ended meanwhile. It
/// is then planned again from what the axes do now, as long as it makes sense.
class Manoeuvre {
 public:
  /// @param join of orders that are kTogether; empty for one order alone.
  Manoeuvre(Context& context, std::vector<Order> orders, JoinPath join = {});

  /// Plans the first order; nothing is ordered yet.
  ///
  /// @return what each axis is to do. @throw Refused, GpioError
  std::vector<axis::Move> prepare();
  /// Orders what was prepared.
  /// @param predecessors what the axes did until now.
  /// @param call is answered when the engine has taken the order.
  void begin(std::vector<Predecessor> predecessors, Ack call);
  /// Comes to rest from what another manoeuvre has begun.
  void beginStop(const Why& why);

  /// The engine has said something, or time has passed. @return whether all is over.
  bool look();
  bool isOver() const { return over_; }
  /// How the first axis's goal ended. @pre isOver()
  const axis::MoveResult& result() const { return result_; }
  /// Why it was not begun after all; none if it was.
  const std::optional<Failure>& failure() const { return failure_; }

  /// Slows down to rest, along the path of axes that move together.
  /// @param call is answered when the axes decelerate.
  void stop(const Why& why, const Ack& call = {});
  /// The same, and keeps the goals.
  void hold(const Ack& call);
  bool isHeld() const { return held_; }
  /// @throw Refused if it can't be resumed; it stays held then.
  void resume(const Ack& call);
  /// The override or the limits have changed.
  void replan(const Ack& call);

  /// Leaves the axes to another one, which takes over in the midst of the motion.
  std::vector<Predecessor> handOver();

  /// What an axis was asked to do; nullptr if it has no part in it.
  const Goal* goalOf(const axis::AxisModel& axis) const;
  /// Tells how a goal ended that nobody has taken over from.
  static void conclude(const Context& context, const Predecessor& ended);
  bool slowsDown() const { return mode_ != Mode::kRun; }

 private:
  enum class Mode { kRun, kStop, kHold };

  struct Planned {
    std::shared_ptr<const motion::Profile> profile;  // none if the axis stands while others stop
    double overshoot = 0.0;
  };
  struct Plans {
    std::int64_t at = 0;
    std::vector<Planned> planned;
    std::shared_ptr<const motion::Profile> path;  // how the shared path is run through
  };

  /// What the engine has not yet dealt with.
  struct OpenOrder {
    std::vector<std::uint64_t> serials;  // by axis; 0: it has no part in it
    Mode mode = Mode::kRun;
    Plans plans;
  };

  Plans plan(pulse::Nanoseconds lead);
  std::shared_ptr<const motion::Profile> planPath(std::int64_t at);
  void order(Plans plans);
  void change(Mode mode, const Ack& call);
  bool anyMoves() const;
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
  std::shared_ptr<const axis::SharedPath> shared_path_;  // that was joined last
  std::uint64_t group_ = 0;
  std::vector<Predecessor> predecessors_;
  std::optional<Plans> prepared_;

  Mode mode_ = Mode::kRun;
  Why why_;                          // of a stop
  Mode accepted_mode_ = Mode::kRun;  // of what the engine follows
  std::vector<OpenOrder> open_;
  bool from_rest_ = true;  // the last order begins at rest: the first one, or that of a resume
  bool started_ = false;   // the engine has taken one
  bool held_ = false;
  bool over_ = false;
  axis::MoveResult result_;
  std::optional<Failure> failure_;
  pulse::Nanoseconds lead_;
  std::shared_ptr<const motion::Profile> path_;           // of the last order
  std::shared_ptr<const motion::Profile> accepted_path_;  // of what the engine follows
  Ack call_;                                              // of the beginning
  std::vector<Ack> calls_;                                // of what is open
};

/// "x stands at 0.01 m, not at 0.02 m: it was stopped"
std::string standsAt(const axis::AxisModel& axis, const Goal& goal, const std::string& why);

/// An error as a call is told it.
Failure failureOf(const std::exception& error);

}  // namespace stepdriver::activity
