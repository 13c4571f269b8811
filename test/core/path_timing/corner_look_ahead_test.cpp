#include "path_timing/corner_look_ahead.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <optional>
#include <random>
#include <vector>

// The speeds at the corners between lines: stops and passes, against the durations of both.

namespace stepdriver {
namespace {

using motion::LineBetweenCorners;
using motion::LineLimits;
using motion::LinePhase;
using motion::RoundedCorner;

constexpr double kInfinite = 1e300;  // s

// [s] Of the motion along the lines at these speeds.
double durationAt(const std::vector<LineBetweenCorners>& lines,
                  const std::vector<RoundedCorner>& corners, const std::vector<double>& speeds) {
  double duration = 0.0;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const double begin = i == 0 ? 0.0 : speeds[i - 1];
    const double end = i == speeds.size() ? 0.0 : speeds[i];
    double length = lines[i].length;
    if (begin > 0.0) length -= lines[i].in_first;
    if (end > 0.0) length -= lines[i].in_last;
    const auto phases = motion::planLine(length, begin, end, lines[i].limits);
    if (!phases) return kInfinite;
    for (const LinePhase& phase : *phases) duration += phase.duration;
    if (end > 0.0) duration += corners[i].length / end;
  }
  return duration;
}

const LineLimits kLimits{100.0, 1000.0, 1000.0, 20'000.0};

TEST(CornerLookAhead, StopsAtATightCornerAndPassesAGentleOne) {
  const std::vector<LineBetweenCorners> lines(2, {10.0, 0.1, 0.1, kLimits});
  // From rest to rest a line of 10 takes 0.318 s: its peak is 63.
  EXPECT_EQ(motion::cornerSpeeds(lines, {{0.15, 1.0}}), std::vector<double>{0.0});
  EXPECT_EQ(motion::cornerSpeeds(lines, {{0.15, 50.0}}), std::vector<double>{50.0});
}

TEST(CornerLookAhead, PassesMoreSlowlyBeforeAShortLine) {
  const std::vector<LineBetweenCorners> lines{
      {50.0, 0.1, 0.1, kLimits}, {1.0, 0.1, 0.1, kLimits}, {50.0, 0.1, 0.1, kLimits}};
  const std::vector<RoundedCorner> corners{{0.15, 90.0}, {0.15, 5.0}};
  const std::vector<double> speeds = motion::cornerSpeeds(lines, corners);
  EXPECT_LT(durationAt(lines, corners, speeds), kInfinite);
  EXPECT_LT(speeds[0], 30.0) << "the short line can't slow down from more";
  EXPECT_GT(speeds[0], 0.0);
}

TEST(CornerLookAhead, IsNeverSlowerThanMoreStops) {
  std::mt19937 random(8);
  const auto number = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int i = 0; i < 300; ++i) {
    std::vector<LineBetweenCorners> lines;
    std::vector<RoundedCorner> corners;
    const auto count = static_cast<std::size_t>(number(2.0, 12.0));
    for (std::size_t k = 0; k < count; ++k) {
      const double length = std::pow(10.0, number(-1.0, 2.0));
      lines.push_back({length, number(0.0, 0.5) * length, number(0.0, 0.5) * length, kLimits});
      if (k > 0) corners.push_back({number(0.1, 1.0), std::pow(10.0, number(-1.0, 2.0))});
    }
    const std::vector<double> speeds = motion::cornerSpeeds(lines, corners);
    const double duration = durationAt(lines, corners, speeds);
    EXPECT_LE(duration, durationAt(lines, corners, std::vector<double>(corners.size(), 0.0)));
    for (std::size_t k = 0; k < corners.size(); ++k) {
      EXPECT_LE(speeds[k], corners[k].speed);
      std::vector<double> other = speeds;
      other[k] = 0.0;
      EXPECT_LE(duration, durationAt(lines, corners, other) * (1.0 + 1e-9))
          << "path " << i << " corner " << k;
    }
  }
}

}  // namespace
}  // namespace stepdriver
