#include <gtest/gtest.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AppendPath.h>
#include <stepdriver/FollowPath.h>
#include <stepdriver/FollowPathAction.h>
#include <stepdriver/IoStates.h>
#include <stepdriver/PathSegment.h>
#include <stepdriver/PlanPath.h>

#include <cmath>
#include <csignal>
#include <cstdint>
#include <functional>
#include <future>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "support/motion_client.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/two_axes.h"
#include "support/wait.h"

// The service and action follow_path; the core tests the geometry and the timing of paths.

namespace stepdriver::node_test {
namespace {

PathSegment line(const std::vector<double>& end) {
  PathSegment segment;
  segment.end = end;
  return segment;
}

PathSegment arc(std::uint8_t shape, const std::vector<double>& point,
                const std::vector<double>& end) {
  PathSegment segment = line(end);
  segment.shape = shape;
  segment.plane = {"x", "y"};
  segment.point = point;
  return segment;
}

class PathTest : public testing::Test {
 protected:
  PathTest() { addSecondAxis(node); }

  using Change = std::function<void(FollowPath::Request&)>;

  FollowPath::Response follow(const std::vector<PathSegment>& segments, const Change& change = {}) {
    FollowPath::Request request;
    request.name = {"x", "y"};
    request.segments = segments;
    request.wait = true;
    if (change) change(request);
    return node.call<FollowPath>("follow_path", request);
  }

  AppendPath::Response append(std::uint64_t path, const std::vector<PathSegment>& segments,
                              bool more_follows) {
    AppendPath::Request request;
    request.path = path;
    request.segments = segments;
    request.more_follows = more_follows;
    return node.call<AppendPath>("append_path", request);
  }

  void expectNoViolation() {
    const auto report = node.rig();
    for (std::size_t i = 0; i < report.violations.size(); ++i) {
      EXPECT_EQ(report.violations[i], 0) << report.name[i] << ": " << report.violation_kinds[i];
    }
  }

  NodeUnderTest node;
};

const std::vector<PathSegment> kSquare = {line({0.02, 0.0}), line({0.02, 0.02}), line({0.0, 0.02}),
                                          line({0.0, 0.0})};

TEST_F(PathTest, IsPlannedWithoutAMotion) {
  node.set("axes/y/enable_on_start", false);
  node.start();
  PlanPath::Request request;
  request.name = {"x", "y"};
  request.segments = {line({0.05, 0.0}), line({0.05, 0.05})};
  request.tolerance = 0.001;
  const auto plan = node.call<PlanPath>("plan_path", request);
  ASSERT_TRUE(plan.success) << plan.message;
  expectSays(plan.message, "the path would take ");
  EXPECT_GT(plan.duration, 1.5) << "100 mm, half of them at 50 mm/s";
  EXPECT_LT(plan.duration, 2.5);
  request.begin = {0.05, 0.0};
  EXPECT_LT(node.call<PlanPath>("plan_path", request).duration, plan.duration);
  request.segments.push_back(line({9.0, 0.0}));
  const auto refused = node.call<PlanPath>("plan_path", request);
  EXPECT_FALSE(refused.success);
  expectSays(refused.message, "segment 2");
  EXPECT_EQ(refused.duration, 0.0);
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(PathTest, RoundsItsCornersWithinTheTolerance) {
  node.start();
  const auto stopping = follow(kSquare);
  ASSERT_TRUE(stopping.success) << stopping.message;
  const auto sharp = node.rig();
  EXPECT_EQ(sharp.pulses_forward, (std::vector<std::int64_t>{1600, 1600}));
  EXPECT_EQ(sharp.pulses_backward, (std::vector<std::int64_t>{1600, 1600}));

  const auto rounded = follow(kSquare, [](auto& request) { request.tolerance = 0.0005; });
  ASSERT_TRUE(rounded.success) << rounded.message;
  EXPECT_EQ(rounded.target, (std::vector<double>{0.0, 0.0}));
  EXPECT_EQ(rounded.position, (std::vector<double>{0.0, 0.0}));
  EXPECT_LT(rounded.duration, 0.9 * stopping.duration);
  // It still reaches the middle of each side.
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward, (std::vector<std::int64_t>{3200, 3200}));
  EXPECT_EQ(report.pulses_backward, (std::vector<std::int64_t>{3200, 3200}));
  expectNoViolation();
}

TEST_F(PathTest, SwitchesOutputsWhereItsSegmentsBegin) {
  node.set("outputs/pen/pin", "pen");
  node.set("outputs/pen/min_on_ms", 100.0);
  node.start();
  std::vector<PathSegment> segments = kSquare;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    OutputSwitch& wanted = segments[i].outputs.emplace_back();
    wanted.name = "pen";
    wanted.on = i % 2 == 0;
  }
  const auto answer = follow(segments, [](auto& request) { request.tolerance = 0.0005; });
  EXPECT_TRUE(answer.success) << answer.message;
  segments[1].end = {0.02, 0.00001};
  segments[2].outputs[0].name = "pan";
  expectSays(follow(segments).message,
             "segment 2 of the path switches the output pan, but there are pen");
  segments[2].outputs.clear();
  segments[0].end = {0.0, 0.001};
  expectSays(follow(segments).message, "but min_on_ms of it is 0.1 s");
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward, (std::vector<std::int64_t>{1600, 1600}));
  expectNoViolation();
}

TEST_F(PathTest, HasArcsABezierAndPlacesThatCountFromItsBegin) {
  node.start();
  PathSegment bezier = line({0.01, 0.02});
  bezier.shape = PathSegment::BEZIER;
  bezier.control1 = {0.02, 0.015};
  bezier.control2 = {0.015, 0.02};
  const std::vector<PathSegment> segments = {
      arc(PathSegment::ARC_AROUND, {0.01, 0.0}, {0.02, 0.0}),  // upwards through (0.01, -0.01)
      arc(PathSegment::ARC_THROUGH, {0.025, 0.005}, {0.02, 0.01}),
      bezier,
  };
  for (const double from : {0.0, 0.01}) {
    const auto answer = follow(segments, [](auto& request) {
      request.relative = true;
      request.tolerance = 0.0001;
    });
    ASSERT_TRUE(answer.success) << answer.message;
    EXPECT_NEAR(answer.position[0], from + 0.01, kHalfStep);
    EXPECT_NEAR(answer.position[1], 2.0 * from + 0.02, kHalfStep);
  }
  expectNoViolation();
}

TEST_F(PathTest, AnswersOnAcceptanceWithTargetsAndPlannedDuration) {
  node.set("simulation/speed", 1.0);
  node.start();
  const auto answer = follow({line({0.05, 0.0}), line({0.1, 0.04})}, [](auto& request) {
    request.wait = false;
    request.velocity = 0.05;
  });
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_EQ(answer.position, (std::vector<double>{0.1, 0.04}));
  expectSays(answer.message, "a path: x to 0.1 m, y to 0.04 m in 2.4");
  EXPECT_NEAR(answer.duration, 0.05 / 0.05 + std::hypot(0.05, 0.04) / 0.05 + 0.2, 0.03);
  EXPECT_LT(node.pulses(), 11200) << "the answer came after the path";
}

TEST_F(PathTest, EndsIfOneOfItsAxesIsStopped) {
  node.set("simulation/speed", 1.0);
  node.start();
  std::future<FollowPath::Response> path = std::async(std::launch::async, [this] {
    return follow({line({0.05, 0.05}), line({0.1, 0.0})});
  });
  ASSERT_TRUE(waitUntil([this] { return node.pulses() > 800; }));
  EXPECT_TRUE(node.call<std_srvs::Trigger>("x/stop").success);
  const auto answer = path.get();
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "stopped");
  ASSERT_EQ(answer.position.size(), 2U);
  EXPECT_NEAR(answer.position[0], answer.position[1], 2.0 * kHalfStep) << "not on the first line";
  expectNoViolation();
}

TEST_F(PathTest, MovesNothingIfItIsRefused) {
  node.start();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::pair<Change, std::string>> bad = {
      {[](auto& r) {
         r.name = {"x", "z"};
       },
       "there is no axis z (axes: x, y)"},
      {[](auto& r) { r.segments.clear(); }, "the path has 0 segments, but must have 1 to 20000"},
      {[](auto& r) { r.segments.resize(20'001); },
       "the path has 20001 segments, but must have 1 to 20000"},
      {[](auto& r) { r.segments[2].shape = 4; },
       "segment 2 of the path has the shape 4, but must be 0 (a line), 1 or 2 (an arc), or 3"},
      {[](auto& r) { r.segments[1].shape = PathSegment::ARC_AROUND; },
       "segment 1 of the path is an arc with 0 names in plane, but must have 2"},
      {[](auto& r) {
         r.segments[1] = arc(PathSegment::ARC_THROUGH, {0.01}, {0.02, 0.02});
       },
       "segment 1 of the path is an arc with 1 numbers in point, but must have 2"},
      {[](auto& r) { r.segments[3].end = {0.0}; },
       "segment 3 of the path has 1 positions, but must have 2"},
      {[nan](auto& r) {
         r.segments[3].end = {0.0, nan};
       },
       "y: segment 3 of the path has nan among its positions, but they must be finite"},
      {[](auto& r) {
         r.segments[1].end = {5.0, 0.02};
       },
       "x: segment 1 of the path at 5 m"},
      {[nan](auto& r) { r.tolerance = nan; },
       "the tolerance of the path is nan, but must be a finite number from 0 on"},
      {[](auto& r) { r.velocity = -0.1; },
       "the velocity of the path is -0.1, but must be a finite number from 0 on"},
  };
  for (const auto& [change, message] : bad) {
    const auto answer = follow(kSquare, change);
    EXPECT_FALSE(answer.success) << message;
    expectSays(answer.message, message);
    EXPECT_TRUE(answer.target.empty());
  }
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(PathTest, IsFedWhileItIsFollowed) {
  node.set("simulation/speed", 2.0);
  node.start();
  const auto begun = follow({kSquare[0]}, [](auto& request) {
    request.tolerance = 0.0005;
    request.more_follows = true;
    request.wait = false;
  });
  ASSERT_TRUE(begun.success) << begun.message;
  ASSERT_NE(begun.path, 0U);
  for (std::size_t i = 1; i < 8; ++i) {
    const auto answer = append(begun.path, {kSquare[i % 4]}, i < 7);
    ASSERT_TRUE(answer.success) << answer.message;
    EXPECT_GE(answer.segments_ahead, 1U);
    EXPECT_GT(answer.time_ahead, 0.0);
    EXPECT_EQ(answer.target, kSquare[i % 4].end);
    expectSays(answer.message, i < 7 ? " s) ahead" : "to the end of the path");
  }
  const auto more = append(begun.path, {kSquare[0]}, true);
  EXPECT_FALSE(more.success);
  expectSays(more.message, "the path is complete");
  ASSERT_TRUE(waitUntil([this] { return node.pulses() >= 4 * 3200; }));
  ASSERT_TRUE(waitUntil([&] { return !append(begun.path, {}, true).success; })) << "it has no end";
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward, (std::vector<std::int64_t>{3200, 3200}));
  EXPECT_EQ(report.pulses_backward, (std::vector<std::int64_t>{3200, 3200}));
  expectNoViolation();
}

TEST_F(PathTest, RefusesABadAppendAndContinues) {
  node.set("simulation/speed", 1.0);
  node.start();
  const auto waits = follow(kSquare, [](auto& request) { request.more_follows = true; });
  EXPECT_FALSE(waits.success);
  expectSays(waits.message, "wait must be false if more_follows");
  const auto begun = follow({kSquare[0]}, [](auto& request) {
    request.more_follows = true;
    request.wait = false;
  });
  ASSERT_TRUE(begun.success) << begun.message;
  const auto far = append(begun.path, {kSquare[1], line({5.0, 0.0})}, true);
  EXPECT_FALSE(far.success);
  expectSays(far.message, "x: segment 1 of the path at 5 m");
  const auto other = append(begun.path + 1000, {kSquare[1]}, true);
  EXPECT_FALSE(other.success);
  expectSays(other.message, "doesn't continue: it has ended");
  EXPECT_TRUE(append(begun.path, {kSquare[1]}, false).success);
  ASSERT_TRUE(waitUntil([this] { return node.pulses() == 3200; }));
  expectNoViolation();
}

class PathActionTest : public PathTest {
 protected:
  void start(double speed) {
    node.set("simulation/speed", speed);
    node.start();
    client = std::make_unique<MotionClient<FollowPathAction>>(node.full("follow_path"));
  }
  static FollowPathGoal goal(const std::vector<PathSegment>& segments) {
    FollowPathGoal goal;
    goal.name = {"x", "y"};
    goal.segments = segments;
    goal.tolerance = 0.0005;
    return goal;
  }

  std::unique_ptr<MotionClient<FollowPathAction>> client;
};

TEST_F(PathActionTest, ReachesItsEndAndTellsHowFarItIs) {
  start(1.0);
  std::vector<FollowPathFeedback> told;
  client->sendGoal(goal(kSquare), {}, {},
                   [&](const FollowPathFeedbackConstPtr& feedback) { told.push_back(*feedback); });
  EXPECT_EQ(client->await(), State::SUCCEEDED);
  client->expectEnd(FollowPathResult::REACHED, "reached");
  const auto result = client->getResult();
  EXPECT_EQ(result->position, (std::vector<double>{0.0, 0.0}));
  ASSERT_GT(told.size(), 3U);
  double progress = 0.0;
  for (const FollowPathFeedback& now : told) {
    EXPECT_EQ(now.position.size(), 2U);
    EXPECT_GE(now.progress, progress);
    EXPECT_LE(now.progress, 1.0);
    EXPECT_LE(now.time_left, result->duration + 1e-3);
    progress = now.progress;
  }
  EXPECT_GT(progress, 0.5);
  expectNoViolation();
}

TEST_F(PathActionTest, KeepsItsProgressWhileItIsHeld) {
  start(1.0);
  const Recorder<FollowPathActionFeedback> told(node.full("follow_path/feedback"));
  ASSERT_TRUE(waitUntil([&] { return told.connected(); }));
  client->sendGoal(goal({line({0.1, 0.0}), line({0.1, 0.1})}));
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 1600; }));
  EXPECT_TRUE(node.call<std_srvs::Trigger>("hold").success);
  ASSERT_TRUE(told.waitForLatest([](const FollowPathActionFeedback& now) {
    return now.feedback.position.at(0) > 0.0 &&
           now.feedback.velocity == std::vector<double>{0.0, 0.0};
  }));
  const double progress = told.messages().back().feedback.progress;
  EXPECT_GT(progress, 0.0);
  EXPECT_LT(progress, 0.5);
  EXPECT_TRUE(node.call<std_srvs::Trigger>("resume").success);
  EXPECT_EQ(client->await(), State::SUCCEEDED);
  client->expectEnd(FollowPathResult::REACHED, "reached");
}

TEST_F(PathActionTest, DeceleratesAlongThePathWhenItIsCancelled) {
  start(1.0);
  client->sendGoal(goal({line({0.1, 0.1}), line({0.2, 0.0})}));
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 1600; }));
  client->cancelGoal();
  EXPECT_EQ(client->await(), State::PREEMPTED);
  client->expectEnd(FollowPathResult::STOPPED, "stop");
  const auto place = client->getResult()->position;
  ASSERT_EQ(place.size(), 2U);
  EXPECT_LT(place[0], 0.09);
  EXPECT_NEAR(place[0], place[1], 2.0 * kHalfStep) << "not on the first line";
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward[0], std::llround(place[0] * 80'000.0));
  expectNoViolation();
}

PathSegment switching(PathSegment segment, const std::string& output, bool on) {
  OutputSwitch& wanted = segment.outputs.emplace_back();
  wanted.name = output;
  wanted.on = on;
  return segment;
}

TEST_F(PathActionTest, SwitchesOutputsAndCountsThoseThatACancelCutsOff) {
  node.set("outputs/pen/pin", "pen");
  node.set("outputs/pen/at_stop", "off");
  start(1.0);
  const Recorder<IoStates> states(node.full("io_states"));
  ASSERT_TRUE(waitUntil([&] { return states.connected(); }));
  FollowPathGoal wanted =
      goal({line({0.05, 0.0}), switching(line({0.15, 0.0}), "pen", true),
            switching(line({0.15, 0.15}), "pen", false), switching(line({0.0, 0.0}), "pen", true)});
  OutputLead& lead = wanted.leads.emplace_back();
  lead.name = "pan";
  client->sendGoal(wanted);
  EXPECT_EQ(client->await(), State::REJECTED);
  client->expectEnd(FollowPathResult::REFUSED,
                    "a lead of the path is for the output pan, but there are pen");
  wanted.leads.clear();
  client->sendGoal(wanted);
  const auto is = [](bool on) {
    return [on](const IoStates& now) { return now.output_on == std::vector<std::uint8_t>{on}; };
  };
  ASSERT_TRUE(states.waitForLatest(is(true)));
  EXPECT_GE(node.pulses(), 4000);
  client->cancelGoal();
  EXPECT_EQ(client->await(), State::PREEMPTED);
  client->expectEnd(FollowPathResult::STOPPED, "pen wasn't switched at 2 of its 3 places");
  EXPECT_EQ(client->getResult()->switched, 1U);
  EXPECT_EQ(client->getResult()->not_switched, 2U);
  EXPECT_TRUE(states.waitForLatest(is(false)));
  expectNoViolation();
}

TEST_F(PathActionTest, SucceedsOnlyWhenItIsToldItsEnd) {
  start(2.0);
  const Recorder<FollowPathActionFeedback> told(node.full("follow_path/feedback"));
  ASSERT_TRUE(waitUntil([&] { return told.connected(); }));
  FollowPathGoal fed = goal({kSquare[0]});
  fed.more_follows = true;
  client->sendGoal(fed);
  ASSERT_TRUE(told.waitForLatest(
      [](const FollowPathActionFeedback& now) { return now.feedback.path != 0; }));
  const std::uint64_t path = told.messages().back().feedback.path;
  // It comes to rest, and waits.
  ASSERT_TRUE(told.waitForLatest([](const FollowPathActionFeedback& now) {
    return now.feedback.segments_ahead == 0 && now.feedback.position.at(0) > 0.0199;
  }));
  EXPECT_EQ(client->getState(), State::ACTIVE);
  EXPECT_TRUE(append(path, {kSquare[1], kSquare[2]}, true).success);
  EXPECT_TRUE(append(path, {kSquare[3]}, true).success);
  EXPECT_TRUE(append(path, {}, false).success);
  EXPECT_EQ(client->await(), State::SUCCEEDED);
  client->expectEnd(FollowPathResult::REACHED, "reached");
  EXPECT_EQ(client->getResult()->position, (std::vector<double>{0.0, 0.0}));
  expectNoViolation();
}

TEST_F(PathActionTest, IsRejectedWithTheReasonAndMovesNothing) {
  start(20.0);
  FollowPathGoal bad = goal(kSquare);
  bad.segments[1].end = {5.0, 0.02};
  client->sendGoal(bad);
  EXPECT_EQ(client->await(), State::REJECTED);
  client->expectEnd(FollowPathResult::REFUSED, "x: segment 1 of the path at 5 m");
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(PathActionTest, IsToldIfTheNodeEnds) {
  start(1.0);
  client->sendGoal(goal({line({0.18, 0.12})}));
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 1600; }));
  node.process().signal(SIGTERM);
  EXPECT_EQ(client->await(), State::ABORTED);
  client->expectEnd(FollowPathResult::STOPPED, "shut down");
}

}  // namespace
}  // namespace stepdriver::node_test
