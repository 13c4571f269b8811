#include "stick.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

namespace stepdriver::joystick {
namespace {

constexpr double kRounding = 1e-8;  // from rounding the dead band to a float

Stick stick() {
  Stick stick;
  stick.max_speed = 0.1;
  stick.dead_band = 0.2;
  return stick;
}

TEST(Stick, GivesNothingInTheDeadBand) {
  for (const double deflection : {0.0, -0.0, 0.1, -0.1, 0.2, -0.2}) {
    EXPECT_EQ(velocityOf(stick(), deflection), 0.0) << deflection;
  }
  for (const float dead_band : {0.05F, 0.1F, 0.15F, 0.2F, 0.3F}) {
    Stick shape = stick();
    shape.dead_band = std::stod(std::to_string(dead_band));  // as in a configuration file
    EXPECT_EQ(velocityOf(shape, dead_band), 0.0) << dead_band << ", as a joystick says it";
  }
}

TEST(Stick, BeginsFromNothingBesideTheDeadBandAndEndsAtTheMaximum) {
  EXPECT_NEAR(velocityOf(stick(), 0.2 + 1e-6), 0.0, 1e-6);
  EXPECT_GT(velocityOf(stick(), 0.2 + 1e-6), 0.0);
  EXPECT_NEAR(velocityOf(stick(), 0.6), 0.05, kRounding);
  EXPECT_NEAR(velocityOf(stick(), -0.6), -0.05, kRounding);
  EXPECT_DOUBLE_EQ(velocityOf(stick(), 1.0), 0.1);
  EXPECT_DOUBLE_EQ(velocityOf(stick(), 1.3), 0.1);
  EXPECT_DOUBLE_EQ(velocityOf(stick(), -5.0), -0.1);
}

TEST(Stick, GrowsWithTheDeflectionWhateverItsShape) {
  for (const double exponent : {0.1, 0.5, 1.0, 2.0, 10.0}) {
    for (const double dead_band : {0.0, 0.2, 0.99}) {
      Stick shape = stick();
      shape.exponent = exponent;
      shape.dead_band = dead_band;
      double before = -0.1;
      for (int i = -1000; i <= 1000; ++i) {
        const double velocity = velocityOf(shape, i / 1000.0);
        EXPECT_GE(velocity, before) << i << ", " << exponent << ", " << dead_band;
        EXPECT_DOUBLE_EQ(velocity, -velocityOf(shape, -i / 1000.0));
        before = velocity;
      }
      EXPECT_DOUBLE_EQ(before, 0.1);
    }
  }
}

TEST(Stick, IsFinerNearTheDeadBandByItsExponent) {
  Stick shape = stick();
  shape.exponent = 2.0;
  EXPECT_NEAR(velocityOf(shape, 0.6), 0.025, kRounding);
  EXPECT_DOUBLE_EQ(velocityOf(shape, 1.0), 0.1);
}

TEST(Stick, TurnsRoundWhereItIsInverted) {
  Stick shape = stick();
  shape.inverted = true;
  EXPECT_NEAR(velocityOf(shape, 0.6), -0.05, kRounding);
  EXPECT_DOUBLE_EQ(velocityOf(shape, -1.0), 0.1);
}

TEST(Stick, GivesNothingForWhatIsNoNumber) {
  EXPECT_EQ(velocityOf(stick(), std::numeric_limits<double>::quiet_NaN()), 0.0);
}

}  // namespace
}  // namespace stepdriver::joystick
