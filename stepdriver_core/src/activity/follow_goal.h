#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "script.h"
#include "steps.h"
#include "trajectory/line_path.h"
#include "trajectory/path_axis.h"

namespace stepdriver::activity {

/// A move or a jog of one axis, or a path of several, from any motion. If one of them is idle, all
/// come to rest first, and it is woken up.
class FollowGoal : public Script {
 public:
  /// @param join empty for a single axis. @param start, begins_ns see MotionExecution.
  FollowGoal(Context& context, std::vector<Order> orders, JoinPath join, SharedCall call,
             std::shared_ptr<const CommonStart> start = {}, std::int64_t begins_ns = 0);

  void prepare() override;
  void hold(const SharedCall& call) override;
  bool isStreamed() const override { return orders_.front().goal.isStreamed(); }
  bool followsSetpoints() const override { return orders_.front().goal.isSetpointOfPosition(); }
  bool leavesLaterMotions() const override { return begins_ns_ > 0 || isStreamed(); }

 protected:
  Steps plan() override;

 private:
  std::unique_ptr<FollowStep> follow();

  std::vector<Order> orders_;
  const JoinPath join_;
  const std::shared_ptr<const CommonStart> start_;
  const std::int64_t begins_ns_;
  std::unique_ptr<FollowStep> prepared_;
};

/// A straight line of several axes from rest: they come to rest, take up their backlash, one after
/// the other, and begin together.
class FollowLine : public Script {
 public:
  /// @param targets [microsteps] of the joints.
  /// @param velocity, duration see motion::LineRequest.
  FollowLine(Context& context, std::vector<Order> orders, double velocity, double duration,
             SharedCall call);

 protected:
  Steps plan() override;

 private:
  Failure notDone(const std::string& why) const override;
  void check() const;
  /// The line from where the axes stand. It is planned again only if an axis has moved since, to
  /// take up its backlash, or if its limits have changed.
  ///
  /// @throw Refused if the limits don't allow its velocity or its duration.
  const std::shared_ptr<const motion::LinePath>& linePath();
  Steps takeUp(const Order& order);
  Steps followLine();

  std::vector<Order> orders_;
  const double velocity_;
  const double duration_;
  std::shared_ptr<const motion::LinePath> path_;  // the last one
};

/// The states of axes at a motion time.
std::vector<motion::PathStart> startsOf(const std::vector<axis::AxisModel*>& axes, std::int64_t at);

/// The axes of orders.
std::vector<axis::AxisModel*> axesOf(const std::vector<Order>& orders);

}  // namespace stepdriver::activity
