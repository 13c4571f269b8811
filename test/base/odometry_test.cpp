#include "odometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "support/constants.h"
#include "support/vehicles.h"

namespace stepdriver::base {
namespace {

using test::kPi;

// The wheel of the STM32 example: a circumference of 0.1 pi m in 1600 microsteps.
constexpr double kStep = 0.1 * kPi / 1600.0;  // [m]
constexpr double kSeparation = 0.3;           // [m]
constexpr double kSamplePeriod = 0.02;        // [s] of joint_states

/// A stretch at a constant ratio of the wheels: their travels and its time, from rest to rest.
struct Leg {
  double left = 0.0;   // [m]
  double right = 0.0;  // [m]
  double seconds = 0.0;
};

/// How far a wheel is after a part of the time, with a ramp of a third at either end.
double ramped(double part) {
  const double t = std::clamp(part, 0.0, 1.0);
  if (t < 1.0 / 3.0) return t * t * 9.0 / 4.0;
  if (t > 2.0 / 3.0) return 1.0 - (1.0 - t) * (1.0 - t) * 9.0 / 4.0;
  return 0.25 + (t - 1.0 / 3.0) * 1.5;
}

/// A base that drives legs: the pose from its counts, and the exact one.
class DrivenLegs {
 public:
  void drive(const Leg& leg) {
    for (int i = 1; i * kSamplePeriod < leg.seconds + kSamplePeriod; ++i) {
      const double part = ramped(i * kSamplePeriod / leg.seconds);
      sample(left_ + leg.left * part, right_ + leg.right * part);
      const double angle = (leg.right - leg.left) / kSeparation;
      // The closed form of an arc: a circle, or a straight line.
      compare(arcFrom(exact_, (leg.left + leg.right) / 2.0 * part, angle * part));
    }
    left_ += leg.left;
    right_ += leg.right;
    exact_ = arcFrom(exact_, (leg.left + leg.right) / 2.0, (leg.right - leg.left) / kSeparation);
  }

  double worstPlace() const { return worst_place_; }
  double worstYaw() const { return worst_yaw_; }
  const Pose& pose() const { return odometry_.pose(); }

 private:
  static Pose arcFrom(const Pose& from, double length, double angle) {
    if (angle == 0.0) {
      return {from.x + length * std::cos(from.yaw), from.y + length * std::sin(from.yaw), from.yaw};
    }
    const double radius = length / angle;
    return {from.x + radius * (std::sin(from.yaw + angle) - std::sin(from.yaw)),
            from.y - radius * (std::cos(from.yaw + angle) - std::cos(from.yaw)), from.yaw + angle};
  }

  void sample(double left, double right) {
    odometry_.moveTo({std::round(left / kStep) * kStep, std::round(right / kStep) * kStep}, 0.0);
  }

  void compare(const Pose& exact) {
    const Pose& pose = odometry_.pose();
    worst_place_ = std::max(worst_place_, std::hypot(pose.x - exact.x, pose.y - exact.y));
    worst_yaw_ = std::max(worst_yaw_, std::abs(pose.yaw - exact.yaw));
  }

  Odometry odometry_ = [] {
    Odometry odometry(twoWheels(kSeparation));
    odometry.moveTo({0.0, 0.0}, 0.0);
    return odometry;
  }();
  double left_ = 0.0;
  double right_ = 0.0;
  Pose exact_;
  double worst_place_ = 0.0;
  double worst_yaw_ = 0.0;
};

/// A travel that ends on a step, as every motion does.
double onStep(double travel) { return std::round(travel / kStep) * kStep; }

TEST(MovedBy, IsTheClosedFormOfAnArc) {
  const Pose quarter = movedBy({1.0, 2.0, kPi / 2.0}, {kPi / 2.0, kPi / 2.0});
  EXPECT_NEAR(quarter.x, 0.0, 1e-15);
  EXPECT_NEAR(quarter.y, 3.0, 1e-15);
  EXPECT_NEAR(quarter.yaw, kPi, 1e-15);
  const Pose straight = movedBy({0.0, 0.0, 0.0}, {1.0, 1e-12});
  EXPECT_NEAR(straight.x, 1.0, 1e-15);
  EXPECT_NEAR(straight.y, 5e-13, 1e-18);
}

TEST(MovedBy, DoesNotDependOnHowAnArcIsDivided) {
  const Twist arc{3.0, 7.0};
  const Pose whole = movedBy(Pose(), arc);
  for (const int parts : {2, 3, 1000}) {
    Pose pose;
    for (int i = 0; i < parts; ++i) pose = movedBy(pose, {arc.linear / parts, arc.angular / parts});
    EXPECT_NEAR(pose.x, whole.x, 1e-12) << parts;
    EXPECT_NEAR(pose.y, whole.y, 1e-12) << parts;
    EXPECT_NEAR(pose.yaw, whole.yaw, 1e-12) << parts;
  }
}

TEST(Odometry, IsWithinAStepOfASquareOfTenMetres) {
  DrivenLegs base;
  const double side = onStep(10.0);
  const double turn = onStep(kPi / 2.0 * kSeparation / 2.0);
  for (int i = 0; i < 4; ++i) {
    base.drive({side, side, 15.0});
    base.drive({-turn, turn, 2.0});
  }
  EXPECT_LT(base.worstPlace(), kStep) << "at any time";
  EXPECT_LT(base.worstYaw(), 2.0 * kStep / kSeparation) << "one step of each wheel";
  EXPECT_NEAR(base.pose().yaw, 8.0 * turn / kSeparation, 1e-9);
}

TEST(Odometry, IsWithinAStepAfterTenTurnsToEitherSide) {
  DrivenLegs base;
  // On circles of 1 m, then on the spot.
  const double inner = onStep(10.0 * 2.0 * kPi * (1.0 - kSeparation / 2.0));
  const double outer = onStep(10.0 * 2.0 * kPi * (1.0 + kSeparation / 2.0));
  const double spot = onStep(10.0 * 2.0 * kPi * kSeparation / 2.0);
  base.drive({inner, outer, 150.0});
  base.drive({outer, inner, 150.0});
  base.drive({-spot, spot, 40.0});
  base.drive({spot, -spot, 40.0});
  EXPECT_LT(base.worstPlace(), 2.0 * kStep) << "one step of each wheel, at any time";
  EXPECT_LT(base.worstYaw(), 2.0 * kStep / kSeparation);
  EXPECT_NEAR(base.pose().yaw, 0.0, 1e-9);
}

TEST(Odometry, CountsTurnsOfTheYaw) {
  Odometry odometry(twoWheels(kSeparation));
  for (const double turns : {0.0, 0.4, 0.8, 1.2, 1.6, 2.0}) {
    const double travel = turns * kPi * kSeparation;
    odometry.moveTo({-travel, travel}, 0.0);
  }
  EXPECT_NEAR(odometry.pose().yaw, 4.0 * kPi, 1e-12);
  EXPECT_NEAR(odometry.pose().x, 0.0, 1e-12);
}

TEST(Odometry, BeginsAtTheFirstPositionsAndAgainAfterTheyAreForgotten) {
  Odometry odometry(twoWheels(kSeparation));
  odometry.moveTo({5.0, 7.0}, 0.0);
  EXPECT_EQ(odometry.pose().x, 0.0);
  odometry.moveTo({6.0, 8.0}, 0.0);
  odometry.forgetPositions();
  odometry.moveTo({0.0, 0.0}, 0.0);
  EXPECT_NEAR(odometry.pose().x, 1.0, 1e-15);
  EXPECT_EQ(odometry.pose().yaw, 0.0);
}

TEST(Odometry, OfATricycleIsExactWhileTheSteeringStands) {
  const double angle = 0.7;
  Odometry odometry(tricycle({steeredWheel()}));
  odometry.moveTo({0.0}, angle);
  // A whole circle of the steered wheel, whose radius is L/sin(angle).
  const double circle = 2.0 * kPi * 0.4 / std::sin(angle);
  for (int i = 1; i <= 7; ++i) odometry.moveTo({circle * i / 7.0}, angle);
  EXPECT_NEAR(odometry.pose().x, 0.0, 1e-12);
  EXPECT_NEAR(odometry.pose().y, 0.0, 1e-12);
  EXPECT_NEAR(odometry.pose().yaw, 2.0 * kPi, 1e-12);
}

TEST(Odometry, OfATricycleConvergesWhileTheSteeringTurns) {
  // The steering turns from 0 to 1 rad while the wheel travels 1 m: a reference in small parts.
  const auto drive = [](int parts) {
    Odometry odometry(tricycle({steeredWheel()}));
    for (int i = 0; i <= parts; ++i) {
      const double part = static_cast<double>(i) / parts;
      odometry.moveTo({part}, part);
    }
    return odometry.pose();
  };
  const Pose reference = drive(100000);
  EXPECT_NEAR(reference.yaw, (1.0 - std::cos(1.0)) / 0.4, 1e-9) << "the integral of sin(angle)/L";
  const Pose sampled = drive(50);  // 1 s of joint_states
  EXPECT_NEAR(sampled.x, reference.x, kStep);
  EXPECT_NEAR(sampled.y, reference.y, kStep);
  EXPECT_NEAR(sampled.yaw, reference.yaw, kStep / 0.4);
}

}  // namespace
}  // namespace stepdriver::base
