#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "activity.h"
#include "motion_execution.h"

namespace stepdriver::activity {

/// A part of a script. It begins once, and poll() is called until it is done. Both may throw an
/// Error, which makes the script fail.
class Step {
 public:
  Step() = default;
  virtual ~Step() = default;
  Step(const Step&) = delete;
  Step& operator=(const Step&) = delete;

  virtual void begin() {}
  /// @return whether it is done.
  virtual bool poll() = 0;
  /// The script has been ended: a motion comes to rest, anything else is completed.
  virtual void end(const EarlyEnd& /*why*/, const SharedCall& /*call*/) {}
  virtual pulse::Nanoseconds due() const { return pulse::kNever; }
  /// Its motion; nullptr if it makes none. A step with a motion waits while the machine is on hold.
  virtual MotionExecution* execution() { return nullptr; }
};

using Steps = std::vector<std::unique_ptr<Step>>;

/// An activity that is a list of steps, one after the other. If it is ended, the current step
/// finishes and the others are left out.
class Script : public Activity {
 public:
  Script(Context& context, std::vector<axis::AxisModel*> axes, Handover handover, SharedCall call)
      : Activity(context, std::move(axes), handover), call_(std::move(call)) {}

  bool canHandOver() const override;
  std::vector<Predecessor> handOver(const std::string& by) override;
  void hold(const SharedCall& call) override;
  void refuseUnlessResumable() const override;
  void resume(const SharedCall& call) override;
  void speedChanged(const SharedCall& call) override;
  void extend(const Extension& extension, const SharedCall& call) override;
  pulse::Nanoseconds due() const override;
  const MotionExecution* motion() const override;

 protected:
  void onBegin(std::vector<Predecessor> predecessors) override;
  void onLook() override { run(); }
  void onEnd(const EarlyEnd& why, const SharedCall& call) override;
  void onAbandon(const EarlyEnd& why) override;

  /// Makes its steps when it begins. May throw an Error.
  virtual Steps plan() = 0;
  /// The failure for its call if it ends before it has carried out the request. @param why in words
  virtual Failure notDone(const std::string& why) const;
  /// Inserts steps before the remaining ones.
  void insert(Steps steps);
  void add(Steps& steps, std::unique_ptr<Step> step) { steps.push_back(std::move(step)); }
  /// The call of the client that waits until it is done or, for a motion, until it begins.
  const SharedCall& call() const { return call_; }
  SharedCall takeCall() { return std::exchange(call_, nullptr); }
  /// The goals that it takes over.
  std::vector<Predecessor> takePredecessors() { return std::exchange(predecessors_, {}); }
  Step* current() { return current_.get(); }
  const Step* current() const { return current_.get(); }

 private:
  void run();
  void fail(const Failure& failure);

  SharedCall call_;
  std::deque<std::unique_ptr<Step>> steps_;
  std::unique_ptr<Step> current_;
  std::vector<Predecessor> predecessors_;
  std::optional<EarlyEnd> ended_;
};

}  // namespace stepdriver::activity
