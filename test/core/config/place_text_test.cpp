#include <gtest/gtest.h>

#include <limits>

#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::config {
namespace {

TEST(PlaceText, HasAsManyDigitsAsAMicrostepIsWorth) {
  const auto text = [](double at) { return placeText(at, Kind::kLinear, 80'000.0); };
  EXPECT_EQ(text(0.05), "0.05 m");
  EXPECT_EQ(text(0.1 + 0.2), "0.3 m");
  EXPECT_EQ(text(6.9e-18), "0 m");
  EXPECT_EQ(text(-6.9e-18), "0 m");
  EXPECT_EQ(text(6.25e-6), "0 m") << "half a microstep is no place";
  EXPECT_EQ(text(12.5e-6), "0.00001 m") << "a microstep is";
  EXPECT_EQ(text(-37.5e-6), "-0.00004 m");
  EXPECT_EQ(text(12.0), "12 m");
  EXPECT_EQ(placeText(1.0 / 3.0, Kind::kRotary, 509.3), "0.333 rad");
  EXPECT_EQ(placeText(1250.0, Kind::kLinear, 0.01), "1250 m") << "a step of 100 m";
}

TEST(PlaceText, IsShortForWhatIsFarAway) {
  EXPECT_EQ(placeText(1e300, Kind::kLinear, 80'000.0), "1e+300 m");
  EXPECT_EQ(placeText(std::numeric_limits<double>::quiet_NaN(), Kind::kLinear, 1.0), "nan m");
}

TEST(DistanceText, OfLessThanAMicrostepHasTwoDigits) {
  const auto text = [](double by) { return distanceText(by, Kind::kLinear, 80'000.0); };
  EXPECT_EQ(text(0.0126 - 0.0125), "0.0001 m");
  EXPECT_EQ(text(12.5e-6), "0.00001 m");
  EXPECT_EQ(text(6.25e-6), "0.0000063 m");
  EXPECT_EQ(text(2e-7), "0.0000002 m");
  EXPECT_EQ(text(6.9e-18), "0 m");
  EXPECT_EQ(distanceText(1.0 / 3000.0, Kind::kRotary, 509.3), "0.00033 rad");
}

}  // namespace
}  // namespace stepdriver::config
