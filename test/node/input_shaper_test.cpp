#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/Imu.h>
#include <stepdriver/Plan.h>

#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include "support/node_under_test.h"
#include "support/program.h"
#include "support/says.h"
#include "support/temporary_file.h"
#include "support/vcd_reader.h"

namespace stepdriver::node_test {
namespace {

constexpr double kFrequency = 22.5;  // Hz
constexpr double kHalfPeriod = 0.5 / kFrequency;

/// The position of the plan: 4000 steps at 8000 steps/s and 400,000 steps/s^2.
double planned(double t) {
  constexpr double kRamp = 0.02;
  constexpr double kEnd = 0.52;
  const auto ramp = [](double at) { return 200'000.0 * at * at; };
  if (t <= 0.0) return 0.0;
  if (t < kRamp) return ramp(t);
  if (t < kEnd - kRamp) return 80.0 + 8'000.0 * (t - kRamp);
  return t < kEnd ? 4'000.0 - ramp(kEnd - t) : 4'000.0;
}

double shaped(double t) { return 0.5 * (planned(t) + planned(t - kHalfPeriod)); }

void prepare(NodeUnderTest& node, bool with_shaper) {
  node.set("axes/x/acceleration_mm_s2", 5000.0);
  node.set("simulation/axes/x/spring_hz", kFrequency);
  node.set("simulation/axes/x/spring_damping", 0.0);
  if (!with_shaper) return;
  node.set("axes/x/input_shaper/type", "zv");
  node.set("axes/x/input_shaper/frequency", kFrequency);
  node.set("axes/x/input_shaper/damping", 0.0);
}

TEST(InputShaper, EachEdgeIsWhereTheShapedCurveCrossesItsLine) {
  NodeUnderTest node;
  prepare(node, true);
  const std::string trace = node.traced();
  node.start();
  const auto moved = node.moveTo(0.05, true);
  EXPECT_TRUE(moved.success) << moved.message;
  EXPECT_NEAR(moved.duration, 0.52 + kHalfPeriod, 1e-6);
  node.process().signal(SIGTERM);
  EXPECT_EQ(node.process().waitForExit(kBound), 0);
  std::vector<double> times;
  const auto waveforms = readVcd(trace);
  for (const Waveform::Edge& edge : waveforms.at("x/step").edges) {
    if (edge.level) times.push_back(static_cast<double>(edge.time_ns) * 1e-9);
  }
  ASSERT_EQ(times.size(), 4'000U);
  // The first line is crossed when half of the ramp has made half a step.
  const double begin = times.front() - std::sqrt(0.5 / 100'000.0);
  for (std::size_t i = 0; i < times.size(); ++i) {
    const double line = static_cast<double>(i) + 0.5;
    ASSERT_NEAR(shaped(times[i] - begin), line, 8'000.0 * 5e-9) << i;
  }
}

TEST(InputShaper, WhatTheAxisPullsRestsWithIt) {
  double without = 0.0;
  for (const bool with_shaper : {false, true}) {
    NodeUnderTest node;
    prepare(node, with_shaper);
    node.start();
    EXPECT_TRUE(node.moveTo(0.05, true).success);
    const double ringing = node.rig().ringing.at(0);
    if (!with_shaper) without = ringing;
    EXPECT_TRUE(with_shaper ? ringing < 0.02 * without : ringing > 0.0005) << ringing;
  }
}

TEST(InputShaper, APlanSaysHowItIsShapedAndIsDrawnWithTheSpring) {
  NodeUnderTest node;
  prepare(node, true);
  node.start();
  Plan::Request request;
  request.position = 0.05;
  const auto answer = node.call<Plan>("x/plan", request);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_EQ(answer.pieces.size(), 3U);
  EXPECT_NEAR(answer.duration, 0.52 + kHalfPeriod, 1e-6);
  EXPECT_EQ(answer.shaper_parts, (std::vector<double>{0.5, 0.5}));
  ASSERT_EQ(answer.shaper_delays.size(), 2U);
  EXPECT_NEAR(answer.shaper_delays[1], kHalfPeriod, 1e-9);
  EXPECT_EQ(answer.ringing_frequencies, std::vector<double>{kFrequency});
  EXPECT_EQ(answer.ringing_dampings, std::vector<double>{0.0});
  const TemporaryFile picture(".svg");
  const auto end = runProgram("plot_motion", {"plan", "--node", node.name(), "--axis", "x", "--to",
                                              "0.05", "-o", picture.path()});
  EXPECT_EQ(end.code, 0) << end.output;
  for (const char* words : {"x as planned", "x shaped", "x shaped: 22.5 Hz", "deflection [mm]"}) {
    expectSays(picture.text(), words);
  }
  EXPECT_EQ(node.pulses(), 0);
}

TEST(InputShaper, MeasureResonanceOscillatesWithoutAShaper) {
  NodeUnderTest node;
  prepare(node, false);
  node.start();
  EXPECT_TRUE(node.moveTo(0.05, true).success);
  const auto end =
      runProgram("measure_resonance", {"--node", node.name(), "--axis", "x", "--from", "20", "--to",
                                       "22", "--step", "2", "--seconds", "0.3"});
  EXPECT_EQ(end.code, 0) << end.output;
  expectSays(end.output, "20 Hz: 0.253 mm to each side");
  expectSays(end.output, "22 Hz: 0.209 mm to each side");
  expectSays(end.output, "input_shaper: {type: ei, frequency: F}");
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward.at(0) - report.pulses_backward.at(0), 4'000);
  EXPECT_GT(report.pulses_backward.at(0), 100);
  EXPECT_EQ(runProgram("measure_resonance", {"--axis", "x", "--step", "0"}).code, 64);
}

TEST(InputShaper, MeasureResonanceRefusesAShapedAxis) {
  NodeUnderTest node;
  prepare(node, true);
  node.start();
  const auto end = runProgram("measure_resonance", {"--node", node.name(), "--axis", "x"});
  EXPECT_EQ(end.code, 1);
  expectSays(end.output, "x has an input_shaper, which would stop the ringing");
  EXPECT_EQ(node.pulses(), 0);
}

TEST(InputShaper, MeasureResonanceProposesAShaperForWhatAnAccelerometerShows) {
  NodeUnderTest node;
  prepare(node, false);
  node.set("simulation/speed", 1.0);
  node.start();
  EXPECT_TRUE(node.moveTo(0.05, true).success);
  // All oscillations at once; the one at 40 Hz is the largest.
  const auto response = [](double frequency) {
    const double r = frequency / 40.0;
    return 1.0 / std::hypot(1.0 - r * r, 0.2 * r);
  };
  ros::NodeHandle handle;
  const ros::Publisher imu = handle.advertise<sensor_msgs::Imu>(node.beside("imu"), 100);
  std::atomic<bool> ends{false};
  std::thread publishes([&] {
    ros::Rate rate(400.0);
    while (!ends) {
      sensor_msgs::Imu sample;
      sample.header.stamp = ros::Time::now();
      const double t = std::fmod(sample.header.stamp.toSec(), 1.0);
      for (double f = 25.0; f < 60.0; f += 5.0) {
        sample.linear_acceleration.y += response(f) * std::sin(2.0 * kPi * f * t);
      }
      imu.publish(sample);
      rate.sleep();
    }
  });
  const TemporaryFile picture(".svg");
  const auto end =
      runProgram("measure_resonance", {"--node", node.name(), "--axis", "x", "--from", "25", "--to",
                                       "55", "--step", "5", "--seconds", "0.8", "--imu",
                                       node.beside("imu"), "--along", "y", "-o", picture.path()});
  ends = true;
  publishes.join();
  EXPECT_EQ(end.code, 0) << end.output;
  expectSays(end.output, "input_shaper:\n  - {type: ");
  expectSays(picture.text(), "frequency [Hz]");
  // A loaded computer publishes fewer samples, so only the nearest frequency is certain.
  const auto at = end.output.find("frequency: ");
  ASSERT_NE(at, std::string::npos);
  EXPECT_NEAR(std::stod(end.output.substr(at + 11)), 40.0, 3.0);
}

}  // namespace
}  // namespace stepdriver::node_test
