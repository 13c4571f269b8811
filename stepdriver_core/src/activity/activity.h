#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "context.h"
#include "goal.h"
#include "stepdriver_core/axis/axis_state.h"

namespace stepdriver::activity {

class Manoeuvre;

/// Something that takes time. It owns its axes from the moment at which it is accepted until it has
/// finished: nobody else orders a motion of them or writes their pins.
///
/// Its calls come one at a time, from the controller's turns. None of them blocks.
class Activity {
 public:
  /// When it may begin on axes that do something else.
  enum class Handover {
    kAtSpeed,    ///< it takes a motion over
    kAfterRest,  ///< it waits until what its axes do has come to rest
  };

  /// What it does to its axes: that decides what a command that needs them is told.
  enum class Work {
    kMoves,
    kWritesPins,
    kDisables,           ///< writes pins, and the motor has no current afterwards
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

  /// It is about to take its axes over at speed: it plans that. @throw Refused; then nothing
  /// happens.
  virtual void prepare() {}
  /// It owns its axes. @param predecessors what it takes over from.
  void begin(std::vector<Predecessor> predecessors);
  /// Something may have happened: the engine has said something, a pin was written, an input has
  /// another level, time has passed.
  void look();
  /// Ends it before its time: it comes to rest, tells whoever waits for it why, and finishes. Of a
  /// sequence of pins it completes what it has begun.
  /// @param call is answered when the axes decelerate.
  void end(const Why& why, const Ack& call = {});

  /// A motion that another one can take over now.
  virtual bool canHandOver() const { return false; }
  /// Leaves its axes. @param by who takes over, in words. @pre canHandOver()
  virtual std::vector<Predecessor> handOver(const std::string& /*by*/) { return {}; }
  /// Others wait for it instead of being refused: it does something that nobody has asked for.
  virtual bool isInBackground() const { return false; }

  virtual void hold(const Ack& /*call*/) {}
  /// @throw Refused if it can't be resumed.
  virtual void resume(const Ack& /*call*/) {}
  /// The speed override or the limits have changed.
  virtual void speedChanged(const Ack& /*call*/) {}
  /// The caller of these homings doesn't wait any more.
  virtual void cancelHomings(const std::vector<std::uint64_t>& /*ids*/) {}
  /// @return false if it does not disable its axis; else this call waits for that too.
  virtual bool joinDisable(const Ack& /*call*/) { return false; }

  /// Clock time at which look() has something to do at the latest.
  virtual pulse::Nanoseconds due() const { return pulse::kNever; }
  /// It looks at the levels of inputs.
  virtual bool watchesInputs() const { return false; }

  /// @name What a reader of the state is shown
  /// @{
  virtual Work work() const { return Work::kMoves; }
  virtual axis::HomingPhase homingPhase() const { return axis::HomingPhase::kNone; }
  /// The motion that it makes, or that is held; nullptr if it makes none now.
  virtual const Manoeuvre* motion() const { return nullptr; }
  /// @}

 protected:
  virtual void onBegin(std::vector<Predecessor> predecessors) = 0;
  virtual void onLook() = 0;
  virtual void onEnd(const Why& why, const Ack& call) = 0;
  /// It was ended before it began.
  virtual void onAbandon(const Why& why) = 0;
  /// Else it is done whatever comes.
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
