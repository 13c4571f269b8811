#include <gtest/gtest.h>
#include <ros/message_traits.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "node/actions/follow_joint_trajectory.h"
#include "node/actions/trajectory_tolerances.h"
#include "node/topics/trajectory_message.h"
#include "support/says.h"

// Tests how the node reads the messages of a trajectory, without a node.

namespace stepdriver::node_test {
namespace {

using ros_node::AxisOfJoint;
using ros_node::BadTrajectory;
using ros_node::trajectoryRequest;

const AxisOfJoint kAxes{{"shoulder", "x"}, {"elbow", "y"}};
const ros::Time kNow(1000.0);
constexpr double kRounding = 1e-9;

trajectory_msgs::JointTrajectory message(const std::vector<std::string>& joints,
                                         const std::vector<double>& times) {
  trajectory_msgs::JointTrajectory trajectory;
  trajectory.joint_names = joints;
  for (const double time : times) {
    trajectory.points.emplace_back();
    trajectory.points.back().positions.assign(joints.size(), 0.1 * time);
    trajectory.points.back().time_from_start = ros::Duration(time);
  }
  return trajectory;
}

std::vector<double> timesOf(const motion::TrajectoryRequest& request) {
  std::vector<double> times;
  for (const auto& point : request.points) times.push_back(point.time);
  return times;
}

void expectTimes(const motion::TrajectoryRequest& request, const std::vector<double>& times) {
  ASSERT_EQ(request.points.size(), times.size());
  for (std::size_t i = 0; i < times.size(); ++i) {
    EXPECT_NEAR(timesOf(request)[i], times[i], kRounding) << "point " << i;
  }
}

template <typename Action>
void expectBad(BadTrajectory::Kind kind, const std::string& words, const Action& action) {
  try {
    action();
    FAIL() << "nothing is wrong, but this was expected: " << words;
  } catch (const BadTrajectory& bad) {
    EXPECT_EQ(static_cast<int>(bad.kind()), static_cast<int>(kind)) << bad.what();
    expectSays(bad.what(), words);
  }
}

void expectBadMessage(BadTrajectory::Kind kind, const std::string& words,
                      const trajectory_msgs::JointTrajectory& trajectory) {
  expectBad(kind, words, [&] { trajectoryRequest(trajectory, kAxes, kNow); });
}

TEST(ReadingTrajectories, NamesTheAxesOfTheJointsInTheirOrder) {
  const motion::TrajectoryRequest read =
      trajectoryRequest(message({"elbow", "shoulder"}, {1.0}), kAxes, kNow);
  EXPECT_EQ(read.names, (std::vector<std::string>{"y", "x"}));
}

TEST(ReadingTrajectories, TakesAllThatAPointHas) {
  auto given = message({"shoulder"}, {0.5});
  given.points[0].velocities = {0.25};
  given.points[0].accelerations = {-2.0};
  const motion::TrajectoryRequest read = trajectoryRequest(given, kAxes, kNow);
  ASSERT_EQ(read.points.size(), 1U);
  const motion::TrajectoryPoint& point = read.points[0];
  EXPECT_EQ(point.time, 0.5);
  EXPECT_EQ(point.positions, std::vector<double>{0.05});
  EXPECT_EQ(point.velocities, std::vector<double>{0.25});
  EXPECT_EQ(point.accelerations, std::vector<double>{-2.0});
}

TEST(ReadingTrajectories, RefusesJointsThatAreNotThereNoneAndOneTwice) {
  using Kind = BadTrajectory::Kind;
  expectBadMessage(Kind::kJoints, "no joint wrist (joints: elbow, shoulder)",
                   message({"shoulder", "wrist"}, {1.0}));
  expectBadMessage(Kind::kJoints, "names no joint", message({}, {1.0}));
  expectBadMessage(Kind::kJoints, "elbow is named twice",
                   message({"elbow", "shoulder", "elbow"}, {1.0}));
  expectBadMessage(Kind::kInvalid, "no points", message({"elbow"}, {}));
}

TEST(ReadingTrajectories, StartsAtOnceWithoutAStampAndLaterWithOneAhead) {
  auto given = message({"elbow"}, {0.5, 1.0});
  motion::TrajectoryRequest read = trajectoryRequest(given, kAxes, kNow);
  EXPECT_EQ(read.begin_in, 0.0);
  expectTimes(read, {0.5, 1.0});
  given.header.stamp = kNow + ros::Duration(0.25);
  read = trajectoryRequest(given, kAxes, kNow);
  EXPECT_NEAR(read.begin_in, 0.25, kRounding);
  expectTimes(read, {0.5, 1.0});
}

TEST(ReadingTrajectories, ComesSoonerByWhatOfItHasGoneBy) {
  auto given = message({"elbow"}, {0.0, 0.5, 1.0});
  given.header.stamp = kNow - ros::Duration(0.2);
  const motion::TrajectoryRequest read = trajectoryRequest(given, kAxes, kNow);
  EXPECT_EQ(read.begin_in, 0.0);
  expectTimes(read, {0.0, 0.3, 0.8});
}

TEST(ReadingTrajectories, DropsPointsInThePast) {
  auto given = message({"elbow"}, {0.0, 0.5, 1.0, 1.5});
  for (std::size_t i = 0; i < 4; ++i) given.points[i].positions = {0.1 * static_cast<double>(i)};
  given.header.stamp = kNow - ros::Duration(0.75);
  motion::TrajectoryRequest read = trajectoryRequest(given, kAxes, kNow);
  expectTimes(read, {0.25, 0.75});
  EXPECT_EQ(read.points[0].positions, std::vector<double>{0.1 * 2.0});
  given.header.stamp = kNow - ros::Duration(1.0);
  read = trajectoryRequest(given, kAxes, kNow);
  expectTimes(read, {0.5});
  EXPECT_EQ(read.begin_in, 0.0);
}

TEST(ReadingTrajectories, RefusesOneThatIsWhollyInThePast) {
  auto given = message({"elbow"}, {0.0, 0.5, 1.0});
  given.header.stamp = kNow - ros::Duration(1.25);
  expectBadMessage(
      BadTrajectory::Kind::kOldStamp,
      "all of its points are in the past: the last one, 1 s after header.stamp, by 0.25 s", given);
  auto only = message({"elbow"}, {0.0});
  only.header.stamp = kNow - ros::Duration(0.001);
  expectBadMessage(BadTrajectory::Kind::kOldStamp, "all of its points are in the past", only);
}

// ros::Time counts to 2106, but a difference of more than 68 years is no ros::Duration.
TEST(ReadingTrajectories, TakesAStampOfAnyYear) {
  auto given = message({"elbow"}, {1.0});
  given.header.stamp = ros::Time(4'294'967'295, 0);
  EXPECT_NEAR(trajectoryRequest(given, kAxes, kNow).begin_in, 4'294'967'295.0 - kNow.toSec(), 1e-5);
  given.header.stamp = ros::Time(1, 0);
  expectBad(BadTrajectory::Kind::kOldStamp, "after header.stamp, by 4294967293 s",
            [&] { trajectoryRequest(given, kAxes, ros::Time(4'294'967'295, 0)); });
}

TEST(ReadingTrajectories, HasNoLimitWhereNoToleranceIsGivenOrItIsLifted) {
  ros_node::action_msgs::FollowJointTrajectoryGoal goal;
  goal.trajectory = message({"elbow", "shoulder"}, {1.0});
  goal.path_tolerance.resize(2);
  goal.path_tolerance[0].name = "shoulder";
  goal.path_tolerance[0].position = 0.01;
  goal.path_tolerance[1].name = "elbow";
  goal.path_tolerance[1].position = -1.0;
  const auto read = ros_node::readTolerances(goal);
  EXPECT_TRUE(std::isinf(read.path.at(0)));
  EXPECT_EQ(read.path.at(1), 0.01);
  EXPECT_TRUE(std::isinf(read.goal.at(0)) && std::isinf(read.goal.at(1)));
  EXPECT_TRUE(std::isinf(read.goal_time));
  goal.path_tolerance[0].velocity = 0.5;
  goal.goal_tolerance.resize(1);
  goal.goal_tolerance[0].name = "elbow";
  goal.goal_tolerance[0].velocity = 0.25;
  const auto again = ros_node::readTolerances(goal);
  EXPECT_TRUE(std::isinf(again.path_velocity.at(0)));
  EXPECT_EQ(again.path_velocity.at(1), 0.5);
  EXPECT_EQ(again.goal_velocity.at(0), 0.25);
  EXPECT_TRUE(std::isinf(again.goal_velocity.at(1)));
}

TEST(ReadingTrajectories, RefusesTolerancesOfOtherJointsAndOfNoNumber) {
  ros_node::action_msgs::FollowJointTrajectoryGoal goal;
  goal.trajectory = message({"elbow"}, {1.0});
  goal.goal_tolerance.resize(1);
  goal.goal_tolerance[0].name = "shoulder";
  expectBad(BadTrajectory::Kind::kInvalid,
            "goal_tolerance names the joint shoulder, but the trajectory has elbow",
            [&] { ros_node::readTolerances(goal); });
  goal.goal_tolerance[0].name = "elbow";
  goal.goal_tolerance[0].position = std::numeric_limits<double>::quiet_NaN();
  expectBad(BadTrajectory::Kind::kInvalid,
            "goal_tolerance of the joint elbow is nan, but must be a number",
            [&] { ros_node::readTolerances(goal); });
  goal.goal_tolerance[0].position = 0.0;
  goal.goal_tolerance[0].velocity = std::numeric_limits<double>::quiet_NaN();
  expectBad(BadTrajectory::Kind::kInvalid,
            "goal_tolerance's velocity of the joint elbow is nan, but must be a number",
            [&] { ros_node::readTolerances(goal); });
}

TEST(ReadingTrajectories, QuotesControlCharactersOfAClientAsEscapes) {
  ros_node::action_msgs::FollowJointTrajectoryGoal goal;
  goal.trajectory = message({"el\tbow", "a\nb"}, {1.0});
  goal.goal_tolerance.resize(1);
  goal.goal_tolerance[0].name = "\x1b[2K";
  expectBad(BadTrajectory::Kind::kInvalid,
            R"(names the joint \x1b[2K, but the trajectory has el\tbow, a\nb)",
            [&] { ros_node::readTolerances(goal); });
  expectBadMessage(BadTrajectory::Kind::kJoints, R"(there is no joint el\tbow)", goal.trajectory);
}

TEST(ReadingTrajectories, SaysWhichJointIsTooFarOff) {
  const std::vector<ros_node::TrajectoryJoint> joints{{"elbow", config::Kind::kRotary, 509.3},
                                                      {"slide", config::Kind::kLinear, 80'000.0}};
  const std::vector<double> limits{0.1, 1e-6};
  const auto said = [&](const std::vector<double>& actual) {
    return ros_node::violation("path_tolerance", joints, limits, {1.0, 0.02}, actual);
  };
  EXPECT_EQ(said({1.1 - 1e-12, 0.020001 - 1e-12}), "");
  EXPECT_EQ(said({0.75, 0.02}),
            "elbow is at 0.75 rad, 0.25 rad from 1 rad; path_tolerance is 0.1 rad");
  EXPECT_EQ(said({1.0, 0.0200125 + 1e-17}),
            "slide is at 0.02001 m, 0.00001 m from 0.02 m; path_tolerance is 1e-06 m");
  EXPECT_EQ(ros_node::violation("goal_tolerance", joints, limits, {1.0, 0.02 + 0.4 / 80'000.0},
                                {1.0, 0.02}),
            "slide is at 0.02 m, 0.000005 m from 0.020005 m; goal_tolerance is 1e-06 m");
}

TEST(ReadingTrajectories, SaysWhichJointHasAnotherVelocity) {
  const std::vector<ros_node::TrajectoryJoint> joints{{"elbow", config::Kind::kRotary, 509.3},
                                                      {"slide", config::Kind::kLinear, 80'000.0}};
  const std::vector<double> limits{0.1, 1e-3};
  const auto said = [&](const std::vector<double>& actual) {
    return ros_node::velocityViolation("path_tolerance", joints, limits, {1.0, 0.02}, actual);
  };
  EXPECT_EQ(said({1.09, 0.0191}), "");
  EXPECT_EQ(said({1.0, 0.0175}),
            "slide moves at 0.0175 m/s, 0.0025 m/s from 0.02 m/s; path_tolerance is 0.001 m/s");
}

TEST(ReadingTrajectories, TakesVelocitiesOverATenthOfASecondOrALittleMore) {
  ros_node::MeanVelocities means;
  // At 1 per second by the plan, and a quarter of it lost.
  for (int i = 0; i < 100; ++i) {
    const double time = 5.0 + 0.03 * i;
    const auto velocities = means.add(time, {{0.03 * i}, {0.0225 * i}});
    ASSERT_EQ(velocities.has_value(), i >= 4) << i;
    if (!velocities) continue;
    EXPECT_NEAR(velocities->planned.at(0), 1.0, 1e-9);
    EXPECT_NEAR(velocities->actual.at(0), 0.75, 1e-9);
  }
}

// The figures are those of clients of control_msgs 1.5 (MoveIt, rosserial's libraries).
TEST(FollowJointTrajectory, HasTheMd5sumsOfControlMsgs) {
  using ros::message_traits::md5sum;
  namespace msgs = ros_node::action_msgs;
  EXPECT_STREQ(md5sum<msgs::JointTolerance>(), "f544fe9c16cf04547e135dd6063ff5be");
  EXPECT_STREQ(md5sum<msgs::FollowJointTrajectoryGoal>(), "69636787b6ecbde4d61d711979bc7ecb");
  EXPECT_STREQ(md5sum<msgs::FollowJointTrajectoryResult>(), "493383b18409bfb604b4e26c676401d2");
  EXPECT_STREQ(md5sum<msgs::FollowJointTrajectoryFeedback>(), "10817c60c2486ef6b33e97dcd87f4474");
  EXPECT_STREQ(md5sum<msgs::JointTrajectoryControllerState>(), "10817c60c2486ef6b33e97dcd87f4474");
  EXPECT_STREQ(md5sum<msgs::FollowJointTrajectoryActionGoal>(), "cff5c1d533bf2f82dd0138d57f4304bb");
  EXPECT_STREQ(md5sum<msgs::FollowJointTrajectoryActionResult>(),
               "c4fb3b000dc9da4fd99699380efcc5d9");
  EXPECT_STREQ(md5sum<msgs::FollowJointTrajectoryActionFeedback>(),
               "d8920dc4eae9fc107e00999cce4be641");
  EXPECT_STREQ(md5sum<msgs::FollowJointTrajectoryAction>(), "bc4f9b743838566551c0390c65f1a248");
}

}  // namespace
}  // namespace stepdriver::node_test
