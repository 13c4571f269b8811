#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "context.h"
#include "goal.h"
#include "stepdriver_core/axis/axis.h"

namespace stepdriver::activity {

class MotionExecution;

/// Something that takes time. It owns its axes from its acceptance until it has finished: nothing
/// else orders a motion of them or writes their pins.
///
/// Its calls come one at a time, from the controller's turns. None of them blocks.
class Activity {
 public:
  /// When it may begin on busy axes.
  enum class Handover {
    kAtSpeed,    ///< it takes over a motion
    kAfterRest,  ///< it waits until its axes are at rest
  };

  /// Its effect on the axes, which decides the answer to other commands that need them.
  enum class Work {
    kMoves,
    kWritesPins,
    kDisables,           ///< writes pins, and the motor is without current afterwards
    kChangesMicrosteps,  ///< may move before it writes pins
  };

  Activity(Context& context, std::vector<axis::AxisModel*> axes, Handover handover)
      : context_(context), axes_(std::move(axes)), handover_(handover) {}
  virtual ~Activity() = default;
  Activity(const Activity&) = delete;
  Activity& operator=(const Activity&) = delete;

  const std::vector<axis::AxisModel*>& axes() const { return axes_; }
  Handover handover() const { return handover_; }
  bool isFinished() const { return finished_; }
  bool hasBegun() const { return begun_; }

  /// Called before it takes over its axes at speed, to plan that. @throw Refused; then nothing
  /// happens.
  virtual void prepare() {}
  /// It owns its axes now. @param predecessors the goals that it takes over.
  void begin(std::vector<Predecessor> predecessors);
  /// Something may have happened: there is news from the engine, a pin was written, an input has
  /// changed, or time has passed.
  void poll();
  /// Ends it early: it comes to rest, tells its waiting callers why, and finishes. It completes a
  /// sequence of pins that it has begun.
  /// @param call is answered when the axes decelerate.
  void end(const EarlyEnd& why, const SharedCall& call = {});

  /// Whether it is a motion that another one can take over now.
  virtual bool canHandOver() const { return false; }
  /// Leaves its axes. @param by the successor, in words. @pre canHandOver()
  virtual std::vector<Predecessor> handOver(const std::string& /*by*/) { return {}; }
  /// What continues for it when it has finished: they begin at once on its axes, each on its own.
  struct Part {
    std::unique_ptr<Activity> activity;
    std::vector<Predecessor> predecessors;
  };
  virtual std::vector<Part> takeParts() { return {}; }
  /// Whether it lasts only as long as its client sends messages, also before it moves.
  virtual bool isStreamed() const { return false; }
  /// Whether it belongs to a stream of setpoints of position, which any other command ends.
  virtual bool followsSetpoints() const { return false; }
  /// Whether other commands wait for it instead of being refused, because no client has requested
  /// it.
  virtual bool isInBackground() const { return false; }
  /// Whether motions that begin later on its axes, see Schedule, are kept when it begins.
  virtual bool leavesLaterMotions() const { return isInBackground(); }

  virtual void hold(const SharedCall& /*call*/) {}
  /// @throw Refused if it is held, and can't be resumed now.
  virtual void refuseUnlessResumable() const {}
  /// @pre refuseUnlessResumable() has just returned.
  virtual void resume(const SharedCall& /*call*/) {}
  /// The speed override or the limits have changed.
  virtual void speedChanged(const SharedCall& /*call*/) {}
  /// Continues the path of its motion, see MotionExecution::extend().
  virtual void extend(const Extension& extension, const SharedCall& call);
  /// The caller of these homings no longer waits.
  virtual void cancelHomings(const std::vector<std::uint64_t>& /*ids*/) {}
  /// @return false if it does not disable its axis; otherwise this call waits for that too.
  virtual bool joinDisable(const SharedCall& /*call*/) { return false; }

  /// Clock time by which poll() must be called.
  virtual pulse::Nanoseconds due() const { return pulse::kNever; }
  /// Whether it uses the levels of inputs.
  virtual bool watchesInputs() const { return false; }

  /// @name What readers of the state ask
  /// @{
  virtual Work work() const { return Work::kMoves; }
  virtual axis::HomingPhase homingPhase() const { return axis::HomingPhase::kNone; }
  /// Its current or held motion; nullptr if there is none.
  virtual const MotionExecution* motion() const { return nullptr; }
  /// @}

 protected:
  virtual void onBegin(std::vector<Predecessor> predecessors) = 0;
  virtual void onLook() = 0;
  virtual void onEnd(const EarlyEnd& why, const SharedCall& call) = 0;
  /// It was ended before it began.
  virtual void onAbandon(const EarlyEnd& why) = 0;
  /// If false, it is carried out in any case.
  virtual bool endsBeforeItBegins() const { return true; }

  void finish() { finished_ = true; }
  Context& context() { return context_; }
  const Context& context() const { return context_; }

 private:
  Context& context_;
  const std::vector<axis::AxisModel*> axes_;
  const Handover handover_;
  bool begun_ = false;
  bool finished_ = false;
};

}  // namespace stepdriver::activity
