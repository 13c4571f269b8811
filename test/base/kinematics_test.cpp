#include "kinematics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "support/vehicles.h"

namespace stepdriver::base {
namespace {

constexpr int kRounds = 2000;
class Random {
 public:
  double from(double min, double max) {
    return std::uniform_real_distribution<double>(min, max)(engine_);
  }

 private:
  std::mt19937 engine_{20240611};
};

TEST(Kinematics, TurnsTheRightWheelFasterInALeftTurn) {
  const auto wheels = wheelVelocities(twoWheels(0.3), {0.5, 1.0}, 0.0);
  EXPECT_NEAR(wheels.at(0), 0.35, 1e-15);
  EXPECT_NEAR(wheels.at(1), 0.65, 1e-15);
}

TEST(Kinematics, ScalesRotaryAxesByTheRadius) {
  Kinematics kinematics = twoWheels(0.3);
  for (Wheel& wheel : kinematics.wheels) wheel.travel = 0.05;
  const auto wheels = wheelVelocities(kinematics, {0.5, 0.0}, 0.0);
  EXPECT_NEAR(wheels.at(0), 10.0, 1e-12) << "rad/s";
  EXPECT_NEAR(twistFrom(kinematics, {10.0, 10.0}, 0.0).linear, 0.5, 1e-15);
}

TEST(Kinematics, ForwardOfInverseIsTheTwist) {
  Random random;
  for (const Kinematics& kinematics : {twoWheels(0.3), fourWheels(0.4)}) {
    for (int i = 0; i < kRounds; ++i) {
      const Twist twist{random.from(-2.0, 2.0), random.from(-5.0, 5.0)};
      const Twist again = twistFrom(kinematics, wheelVelocities(kinematics, twist, 0.0), 0.0);
      ASSERT_NEAR(again.linear, twist.linear, 1e-12) << twist.angular;
      ASSERT_NEAR(again.angular, twist.angular, 1e-12) << twist.linear;
    }
  }
}

TEST(Kinematics, ForwardOfInverseIsTheTwistOfATricycle) {
  Random random;
  for (const Kinematics& kinematics :
       {tricycle({steeredWheel()}), tricycle({middleWheel()}), tricycle(twoWheels(0.5).wheels)}) {
    for (int i = 0; i < kRounds; ++i) {
      // A curvature that a steering of 85 degrees can make.
      const double linear = random.from(0.1, 2.0) * (i % 2 == 0 ? 1.0 : -1.0);
      const Twist twist{linear, linear * random.from(-20.0, 20.0)};
      const SteeredMotion motion = steeredMotion(*kinematics.steering, twist);
      ASSERT_TRUE(motion.exact) << twist.linear << " " << twist.angular;
      const Twist steered = twistOf(*kinematics.steering, motion.speed, motion.angle);
      const Twist again =
          twistFrom(kinematics, wheelVelocities(kinematics, steered, motion.angle), motion.angle);
      ASSERT_NEAR(again.linear, twist.linear, 1e-10) << twist.angular;
      ASSERT_NEAR(again.angular, twist.angular, 1e-10) << twist.linear;
    }
  }
}

TEST(Kinematics, TakesTheMeanOfTwoWheelsOnASide) {
  const Twist twist = twistFrom(fourWheels(0.4), {0.9, 1.1, 1.9, 2.1}, 0.0);
  EXPECT_NEAR(twist.linear, 1.5, 1e-15);
  EXPECT_NEAR(twist.angular, 2.5, 1e-12);
}

TEST(Kinematics, SteersToBothSidesForwardsAndBackwards) {
  const Steering steering{0.4, kRightAngle};
  EXPECT_NEAR(steeredMotion(steering, {0.4, 1.0}).angle, kRightAngle / 2.0, 1e-15);
  EXPECT_NEAR(steeredMotion(steering, {0.4, -1.0}).angle, -kRightAngle / 2.0, 1e-15);
  const SteeredMotion backwards = steeredMotion(steering, {-0.4, 1.0});
  EXPECT_NEAR(backwards.angle, -kRightAngle / 2.0, 1e-15);
  EXPECT_NEAR(backwards.speed, -0.4 * std::sqrt(2.0), 1e-15);
  const SteeredMotion on_the_spot = steeredMotion(steering, {0.0, 1.0});
  EXPECT_NEAR(on_the_spot.angle, kRightAngle, 1e-15);
  EXPECT_NEAR(on_the_spot.speed, 0.4, 1e-15);
}

TEST(Kinematics, KeepsTheLinearVelocityIfTheSteeringCannotTurnThatFar) {
  const Steering steering{0.4, kRightAngle / 2.0};
  const SteeredMotion motion = steeredMotion(steering, {0.2, 2.0});
  EXPECT_FALSE(motion.exact);
  const Twist twist = twistOf(steering, motion.speed, motion.angle);
  EXPECT_NEAR(twist.linear, 0.2, 1e-15);
  EXPECT_NEAR(twist.angular, 0.5, 1e-15) << "v tan(45 degrees) / 0.4 m";
  EXPECT_EQ(steeredMotion(steering, {0.0, 1.0}).speed, 0.0) << "it can't turn on the spot";
}

TEST(Kinematics, SaturationKeepsTheCurvature) {
  Random random;
  const Kinematics kinematics = fourWheels(0.4);
  int saturated = 0;
  for (int i = 0; i < kRounds; ++i) {
    const Twist twist{random.from(-3.0, 3.0), random.from(-6.0, 6.0)};
    std::vector<double> wheels = wheelVelocities(kinematics, twist, 0.0);
    const double factor = speedFactor(kinematics, wheels);
    double fastest = 0.0;
    for (double& wheel : wheels) {
      wheel *= factor;
      fastest = std::max(fastest, std::abs(wheel));
    }
    ASSERT_LE(fastest, kinematics.wheels[0].max_speed * (1.0 + 1e-15));
    const Twist scaled = twistFrom(kinematics, wheels, 0.0);
    ASSERT_NEAR(scaled.angular * twist.linear, twist.angular * scaled.linear, 1e-12);
    if (factor == 1.0) continue;
    ++saturated;
    ASSERT_NEAR(fastest, kinematics.wheels[0].max_speed, 1e-15) << "as fast as possible";
  }
  EXPECT_GT(saturated, kRounds / 4);
  EXPECT_LT(saturated, kRounds);
}

TEST(Kinematics, ChangesKeepToTheAccelerationOfEveryWheel) {
  const Kinematics kinematics = twoWheels(0.3);  // 0.5 m/s^2, and 1.5 m/s^2 to slow down
  EXPECT_NEAR(changeFraction(kinematics, {0.0, 0.0}, {0.2, 0.4}, 0.1), 0.05 / 0.4, 1e-15);
  EXPECT_NEAR(changeFraction(kinematics, {0.2, 0.4}, {0.0, 0.0}, 0.1), 0.15 / 0.4, 1e-15);
  EXPECT_NEAR(changeFraction(kinematics, {-0.2, 0.4}, {0.2, 0.4}, 0.1), 0.05 / 0.4, 1e-15)
      << "through standstill";
  EXPECT_EQ(changeFraction(kinematics, {0.2, 0.4}, {0.22, 0.41}, 0.1), 1.0);
  EXPECT_EQ(changeFraction(kinematics, {0.2, 0.4}, {0.2, 0.4}, 0.0), 1.0);
}

}  // namespace
}  // namespace stepdriver::base
