#include <gtest/gtest.h>
#include <ros/master.h>
#include <stepdriver/AxisStates.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "support/node_under_test.h"
#include "support/program.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/temporary_file.h"
#include "support/two_axes.h"
#include "support/vcd_reader.h"

namespace stepdriver::node_test {
namespace {

class Draw : public testing::Test {
 protected:
  Draw() : points(".txt"), picture(".svg") { addSecondAxis(node); }

  void write(const std::string& text) const { std::ofstream(points.path()) << text; }

  std::vector<std::string> arguments(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> all = {points.path(), "--node", node.name(), "-o", picture.path()};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  ProgramEnd draw(const std::vector<std::string>& more = {}) const {
    return runProgram("draw", arguments(more));
  }
  /// How far the pulses of an axis were off the lines [mm], as the output says.
  static double offIn(const std::string& axis, const std::string& output) {
    const std::size_t place = output.find(" mm in " + axis);
    EXPECT_NE(place, std::string::npos) << output;
    if (place == std::string::npos) return -1.0;
    return std::stod(output.substr(output.find_last_of(" \n", place - 1)));
  }

  /// Draws a triangle: the corners are rounded, and no axis stops there.
  void expectRounded() {
    ASSERT_TRUE(node.moveTo(0.005, true).success) << "pulses before the drawing aren't of it";
    write("10 10\n30 10\n30 25\n10 10\n");
    const auto end = draw({"--tolerance", "0.5"});
    EXPECT_EQ(end.code, 0) << end.output;
    expectSays(end.output, "71 of 71 mm, 100 %");
    for (const std::string axis : {"x", "y"}) {
      const double off = offIn(axis, end.output);
      EXPECT_LE(off, 0.5 + 0.0125) << axis << " [mm]";
      EXPECT_GT(off, 0.1) << axis << " [mm]: the axes stopped at the corners";
    }
    const auto report = node.rig();
    for (const std::size_t axis : {0U, 1U}) {
      EXPECT_EQ(report.pulses_forward[axis] - report.pulses_backward[axis], 800) << axis;
    }
    EXPECT_EQ(report.violations, (std::vector<std::int64_t>{0, 0}));
  }

  NodeUnderTest node;
  const TemporaryFile points;
  const TemporaryFile picture;
};

TEST_F(Draw, FollowsThePointsAndShowsWhatThePulsesDrew) {
  node.traced();
  node.set("axes/x/chip/step_active", "low");
  node.set("axes/y/invert/dir", true);
  node.start();
  ASSERT_TRUE(node.moveTo(0.005, true).success) << "pulses before the drawing aren't of it";
  write("10 10\n30 10\n30 25\n10 10\n");
  const auto end = draw({"--tolerance", "0"});
  EXPECT_EQ(end.code, 0);
  // From (5, 0): 400 and 800, 1600, 1200, then back.
  expectSays(end.output, "6,800 pulses. Largest deviation: ");
  expectSays(end.output, "71 of 71 mm, 100 %");
  for (const std::string axis : {"x", "y"}) {
    const double off = offIn(axis, end.output);
    EXPECT_LE(off, 0.0125) << axis << " [mm]: no position is a microstep off the lines";
    EXPECT_GT(off, 0.001) << axis << " [mm]: no slope is more exact than its half steps";
  }
  expectSays(picture.text(), "x [mm]");
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward, (std::vector<std::int64_t>{2400, 2000}));
  EXPECT_EQ(report.pulses_backward, (std::vector<std::int64_t>{1600, 1200}));
  EXPECT_EQ(report.violations, (std::vector<std::int64_t>{0, 0}));
}

TEST_F(Draw, RoundsCornersWithinTheTolerance) {
  node.traced();
  node.start();
  expectRounded();
  EXPECT_LT(node.rig().pulses_forward[1], 2000) << "the corner at (30, 25) wasn't rounded";
}

TEST_F(Draw, RoundsCornersIfAnAxisHasAJerkLimit) {
  node.set("axes/x/jerk_mm_s3", 20'000.0);
  node.traced();
  node.start();
  expectRounded();
}

TEST_F(Draw, GoesThroughDots) {
  node.traced();
  node.start();
  write("10 10\n\n20 10\n\n20 30\n");
  const auto end = draw({"--tolerance", "0"});
  EXPECT_EQ(end.code, 0) << end.output;
  expectSays(end.output, "4,000 pulses. Largest deviation: ");
  expectSays(picture.text(), "dots of the drawing");
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward, (std::vector<std::int64_t>{1600, 2400}));
}

// Its last corner, by sine and cosine, is 1e-15 mm off its first: the line that closes it makes no
// step.
TEST_F(Draw, ReachesTheEndOfAClosedShape) {
  node.traced();
  node.start();
  std::ostringstream octagon;
  octagon << std::setprecision(17);
  for (int corner = 0; corner <= 8; ++corner) {
    const double angle = corner * kPi / 4.0;
    octagon << 20.0 + 10.0 * std::cos(angle) << " " << 10.0 * std::sin(angle) << "\n";
  }
  write("0 0\n" + octagon.str() + "30 0\n");
  const auto end = draw({"--tolerance", "0.05"});
  EXPECT_EQ(end.code, 0) << end.output;
  expectSays(end.output, "100 %");
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward[0] - report.pulses_backward[0], 2400) << "x at 30 mm";
  EXPECT_EQ(report.pulses_forward[1] - report.pulses_backward[1], 0) << "y at 0";
  EXPECT_GE(report.pulses_forward[1], 790) << "of 10 mm, less what the corner was rounded by";
}

class DrawWithATool : public Draw {
 protected:
  DrawWithATool() {
    node.set("outputs/tool/pin", "tool");
    trace_ = node.traced();
  }

  /// Where the axes were [mm] when an output was switched on and off, by the rig's trace: "10 10 to
  /// 30 10; ...".
  std::string drawn(const std::string& output = "tool") {
    node.rig();
    const auto waves = readVcd(trace_);
    std::string text;
    bool on = false;
    for (const Waveform::Edge& edge : waves.at("outputs/" + output).edges) {
      if (edge.level == std::exchange(on, edge.level)) continue;
      if (on && !text.empty()) text += "; ";
      if (!on) text += " to ";
      text += placeAt(waves, "x", edge.time_ns) + " " + placeAt(waves, "y", edge.time_ns);
    }
    return text;
  }

  /// An edge of the tool.
  struct Still {
    bool on = false;
    double seconds = 0.0;  // until the next step of an axis
  };
  std::vector<Still> stillAtEdges() {
    node.rig();
    const auto waves = readVcd(trace_);
    std::vector<Still> all;
    bool on = false;
    for (const Waveform::Edge& edge : waves.at("outputs/tool").edges) {
      if (edge.level == std::exchange(on, edge.level)) continue;
      Still& still = all.emplace_back();
      still.on = on;
      still.seconds = std::numeric_limits<double>::infinity();
      for (const std::string axis : {"x", "y"}) {
        for (const Waveform::Edge& step : waves.at(axis + "/step").edges) {
          if (!step.level || step.time_ns < edge.time_ns) continue;
          const auto later = static_cast<double>(step.time_ns - edge.time_ns) / 1e9;
          still.seconds = std::min(still.seconds, later);
        }
      }
    }
    return all;
  }

 private:
  static std::string placeAt(const std::map<std::string, Waveform>& waves, const std::string& axis,
                             std::int64_t time_ns) {
    const auto& turns = waves.at(axis + "/dir").edges;
    std::size_t turn = 0;
    std::int64_t count = 0;
    for (const Waveform::Edge& step : waves.at(axis + "/step").edges) {
      if (step.time_ns > time_ns) break;
      while (turn + 1 < turns.size() && turns[turn + 1].time_ns <= step.time_ns) ++turn;
      if (step.level) count += turns[turn].level ? 1 : -1;
    }
    return std::to_string(std::llround(static_cast<double>(count) / 80.0));
  }

  std::string trace_;
};

TEST_F(DrawWithATool, LiftsThePenBetweenStrokes) {
  node.start();
  write("10 10\n30 10\n30 25\n\n20 20\n\n0 0\n0 10\n");
  const auto end = draw({"--pen", "tool", "--down-s", "0", "--up-s", "0.01"});
  EXPECT_EQ(end.code, 0) << end.output;
  EXPECT_EQ(drawn(), "10 10 to 30 25; 20 20 to 20 20; 0 0 to 0 10");
  EXPECT_EQ(draw({"--pen", "tool", "--tolerance", "0"}).code, 0);
}

// With the pen down and with the pen up again it waits as long as said, and no axis moves
// meanwhile.
TEST_F(DrawWithATool, WaitsForThePen) {
  node.set("simulation/speed", 1.0);
  node.start();
  write("10 10\n30 10\n\n40 20\n40 30\n");
  const auto end = draw({"--pen", "tool", "--down-s", "0.3", "--up-s", "0.15"});
  EXPECT_EQ(end.code, 0) << end.output;
  EXPECT_EQ(drawn(), "10 10 to 30 10; 40 20 to 40 30");
  const std::vector<Still> all = stillAtEdges();
  ASSERT_EQ(all.size(), 4U);
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(all[i].on, i % 2 == 0);
    // After the last stroke, nothing follows.
    if (i + 1 == all.size()) continue;
    EXPECT_GE(all[i].seconds, all[i].on ? 0.3 : 0.15) << i;
  }
}

TEST_F(DrawWithATool, SwitchesALaserWithoutAStop) {
  node.start();
  write("10 10\n30 10\n50 10\n\n70 10\n90 10\n");
  const auto end = draw({"--laser", "tool"});
  EXPECT_EQ(end.code, 0) << end.output;
  EXPECT_EQ(drawn(), "10 10 to 50 10; 70 10 to 90 10");
}

class DrawInColours : public DrawWithATool {
 protected:
  DrawInColours() : svg(".svg") {
    node.set("outputs/engraver/pin", "engraver");
    // In mm of the axes, which begin at the lower left corner, y is 40 less that of the file.
    std::ofstream(svg.path()) << R"(<svg xmlns="http://www.w3.org/2000/svg" width="60" height="40"
  viewBox="0 0 60 40" fill="none" stroke-width="0.1">
  <path d="M 10 30 h 20" stroke="red"/>
  <path d="M 40 30 v -20" stroke="#0000ff"/>
  <path d="M 30 10 h -10" stroke="#f00"/>
</svg>)";
  }

  // One of the packages that read SVG files is optional: Ubuntu 20.04 lacks it.
  void SetUp() override {
    if (std::system("/usr/bin/python3 -c 'import svgelements' 2> /dev/null && "
                    "command -v rsvg-convert > /dev/null") != 0) {
      GTEST_SKIP() << "python3-svgelements or librsvg2-bin is missing";
    }
  }

  ProgramEnd drawSvg(const std::vector<std::string>& tools) const {
    std::vector<std::string> all = {svg.path(), "--node", node.name(), "-o", picture.path(),
                                    "--scale",  "1",      "--corner",  "10", "10"};
    all.insert(all.end(), tools.begin(), tools.end());
    return runProgram("draw", all);
  }

  const TemporaryFile svg;
};

TEST_F(DrawInColours, ChooseTheLaserOfEachStroke) {
  node.start();
  const auto end = drawSvg({"--laser", "red=tool", "--laser", "blue=engraver"});
  EXPECT_EQ(end.code, 0) << end.output;
  EXPECT_EQ(drawn("tool"), "10 10 to 30 10; 30 30 to 20 30");
  EXPECT_EQ(drawn("engraver"), "40 10 to 40 30");
}

TEST_F(DrawInColours, ChooseThePenOfEachStroke) {
  node.start();
  const auto end =
      drawSvg({"--pen", "blue=engraver", "--pen", "tool", "--down-s", "0", "--up-s", "0"});
  EXPECT_EQ(end.code, 0) << end.output;
  EXPECT_EQ(drawn("tool"), "10 10 to 30 10; 30 30 to 20 30") << "of all other colours";
  EXPECT_EQ(drawn("engraver"), "40 10 to 40 30");
}

TEST_F(DrawInColours, WithoutAnOutputAreRefusedBeforeAnythingMoves) {
  node.start();
  const auto end = drawSvg({"--laser", "red=tool"});
  EXPECT_EQ(end.code, 1);
  expectSays(end.output, "#0000ff");
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(DrawWithATool, RefusesAToolThatThereIsNot) {
  node.start();
  write("10 10\n30 10\n\n40 40\n");
  const auto unknown = draw({"--pen", "pencil"});
  EXPECT_EQ(unknown.code, 1);
  expectSays(unknown.output, "has no output pencil (tool)");
  const auto dots = draw({"--laser", "tool"});
  EXPECT_EQ(dots.code, 1);
  expectSays(dots.output, "has 1 dots, but a laser needs lines");
  EXPECT_EQ(draw({"--laser", "tool", "--pen", "tool"}).code, 64);
  EXPECT_EQ(draw({"--pen", "tool", "--down-s", "-1"}).code, 64);
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(Draw, ShowsJointStatesWhereThereIsNoTrace) {
  node.start();
  write("10 10\n30 10\n");
  const auto end = draw();
  EXPECT_EQ(end.code, 0);
  expectSays(end.output, "joint_states; the path between them is unknown");
  EXPECT_TRUE(picture.exists());
}

TEST_F(Draw, RefusesBeforeAnythingMoves) {
  node.start();
  const auto expect_fails = [&](const std::string& text, const std::string& words) {
    write(text);
    const auto end = draw();
    EXPECT_EQ(end.code, 1);
    expectSays(end.output, words);
  };
  expect_fails("10 10\n10 300\n", "(10, 300) mm is above the soft limit of y, ");
  expect_fails("10 10\nten 30\n", "line 2: ten 30");
  expect_fails("", "contains no line");
  EXPECT_EQ(runProgram("draw", {points.path(), "--speed", "-1"}).code, 64);
  EXPECT_EQ(runProgram("draw", {points.path(), "--tolerance", "-0.1"}).code, 64);
  write("10 10\n30 10\n");
  const auto refused = draw({"--speed", "5000"});
  EXPECT_EQ(refused.code, 1);
  expectSays(refused.output, "the speed 5000 mm/s is above the ");
  const auto unwritable = runProgram(
      "draw", {points.path(), "--node", node.name(), "-o", points.path() + "/none/drawn.svg"});
  EXPECT_EQ(unwritable.code, 1);
  expectSays(unwritable.output, "/none/drawn.svg: can't be written: ");
  EXPECT_EQ(runProgram("draw", {"--help"}).code, 0);
  EXPECT_EQ(node.pulses(), 0);
  EXPECT_FALSE(picture.exists());
}

TEST_F(Draw, StopsTheAxesWhereItIsInterrupted) {
  node.set("simulation/speed", 1.0);
  node.start();
  write("199 0\n199 10\n");
  const Recorder<AxisStates> states(node.full("axis_states"));
  NodeProcess process(arguments({"--speed", "5"}), std::string(STEPDRIVER_PROGRAMS) + "/draw");
  ASSERT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.position.at(0) > 0.001; }));
  EXPECT_TRUE(waitUntil([this] {
    ros::master::V_TopicInfo topics;
    ros::master::getTopics(topics);
    return std::any_of(topics.begin(), topics.end(), [this](const ros::master::TopicInfo& topic) {
      return topic.name == node.beside("drawing") && topic.datatype == "visualization_msgs/Marker";
    });
  })) << "the trail for rviz";
  process.signal(SIGINT);
  EXPECT_EQ(process.waitForExit(kBound), 130);
  expectSays(process.output(), "stopped");
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.moving.at(0) == 0; }));
  EXPECT_LT(states.messages().back().position.at(0), 0.19);
}

}  // namespace
}  // namespace stepdriver::node_test
