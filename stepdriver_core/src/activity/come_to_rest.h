#pragma once

#include <string>
#include <utility>
#include <vector>

#include "activity.h"
#include "motion_execution.h"

namespace stepdriver::activity {

/// Brings one axis to rest from a motion that another activity has begun and left.
class ComeToRest : public Activity {
 public:
  /// @param left the goals of the axis, at least one: the last, and those that it was to replace
  ///   when the engine had not yet accepted it.
  ComeToRest(Context& context, std::vector<Predecessor> left, EarlyEnd why)
      : Activity(context, {left.back().axis}, Handover::kAtSpeed),
        execution_(context, {{left.back().axis, goalOf(left.back().goal)}}),
        replaced_(left.begin(), left.end() - 1),
        why_(std::move(why)) {}

  bool canHandOver() const override { return true; }
  const MotionExecution* motion() const override { return &execution_; }
  std::vector<Predecessor> handOver(const std::string& /*by*/) override {
    finish();
    return execution_.handOver();
  }

 protected:
  void onBegin(std::vector<Predecessor> /*predecessors*/) override {
    execution_.beginStop(std::move(replaced_), why_);
    onLook();
  }
  void onLook() override {
    if (execution_.poll()) finish();
  }
  void onEnd(const EarlyEnd& why, const SharedCall& call) override { execution_.stop(why, call); }
  void onAbandon(const EarlyEnd& /*why*/) override {}

 private:
  // The axis leaves its path.
  static Goal goalOf(Goal goal) {
    goal.kind = Goal::Kind::kMove;
    return goal;
  }

  MotionExecution execution_;
  std::vector<Predecessor> replaced_;
  const EarlyEnd why_;
};

}  // namespace stepdriver::activity
