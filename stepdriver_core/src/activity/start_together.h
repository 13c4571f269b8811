#pragma once

#include <memory>
#include <vector>

#include "follow_goal.h"
#include "script.h"

namespace stepdriver::activity {

/// Goals of several axes that begin at the same motion time. If some axes are idle, all wait until
/// they are awake. When they begin, this activity ends, and each goal is an activity of its own:
/// from then on nothing that happens to one axis concerns another.
class StartTogether : public Script {
 public:
  /// A goal, and the call that waits for its beginning.
  struct Start {
    Order order;
    SharedCall call;
  };

  /// @param starts streamed goals.
  StartTogether(Context& context, std::vector<Start> starts);

  void prepare() override;
  bool leavesLaterMotions() const override { return true; }
  void hold(const SharedCall& call) override { end(kEndedByHold, call); }
  std::vector<Part> takeParts() override;
  bool isStreamed() const override { return true; }
  bool followsSetpoints() const override {
    return starts_.front().order.goal.isSetpointOfPosition();
  }

 protected:
  Steps plan() override;

 private:
  std::vector<Start> starts_;
  std::vector<std::unique_ptr<FollowGoal>> goals_;  // they are ready to begin
  bool may_begin_ = false;
};

}  // namespace stepdriver::activity
