#pragma once

#include <string>
#include <utility>
#include <vector>

#include "activity.h"
#include "manoeuvre.h"

namespace stepdriver::activity {

/// Brings one axis to rest from a motion that another activity has begun and left.
class ComeToRest : public Activity {
 public:
  /// @param left the goals of the axis, at least one: the last, and those that it was to replace
  ///   when the engine had not yet accepted it.
  ComeToRest(Context& context, std::vector<Predecessor> left, Why why)
      : Activity(context, {left.back().axis}, Handover::kAtSpeed),
        manoeuvre_(context, {{left.back().axis, goalOf(left.back().goal)}}),
        replaced_(left.begin(), left.end() - 1),
        why_(std::move(why)) {}

  bool canHandOver() const override { return true; }
  const Manoeuvre* motion() const override { return &manoeuvre_; }
  std::vector<Predecessor> handOver(const std::string& /*by*/) override {
    finish();
    return manoeuvre_.handOver();
  }

 protected:
  void onBegin(std::vector<Predecessor> /*predecessors*/) override {
    manoeuvre_.beginStop(std::move(replaced_), why_);
    onLook();
  }
  void onLook() override {
    if (manoeuvre_.look()) finish();
  }
  void onEnd(const Why& why, const Ack& call) override { manoeuvre_.stop(why, call); }
  void onAbandon(const Why& /*why*/) override {}

 private:
  // The axis leaves its path.
  static Goal goalOf(Goal goal) {
    goal.kind = Goal::Kind::kMove;
    return goal;
  }

  Manoeuvre manoeuvre_;
  std::vector<Predecessor> replaced_;
  const Why why_;
};

}  // namespace stepdriver::activity
