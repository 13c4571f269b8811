#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/constants.h"
#include "support/corexy_bench.h"
#include "support/gantry_bench.h"
#include "support/path_bench.h"
#include "support/refusal.h"

// Outputs that a motion switches, latches and probings on every kind of axis: a plain one, one with
// a backlash, one with an input shaper, one that shares its motors, and one with two motors. The
// judge knows only the pulses and edges of the rig's trace. 80 microsteps/mm.

namespace stepdriver {
namespace {

using test::Bench;
using test::kStep;

enum class AxisOf { kPlain, kBacklash, kShaper, kCoreXy, kGantry };

void PrintTo(AxisOf kind, std::ostream* out) {  // NOLINT: GoogleTest's name
  const std::array<const char*, 5> names{"Plain", "Backlash", "Shaper", "CoreXy", "Gantry"};
  *out << names.at(static_cast<std::size_t>(kind));
}

constexpr double kBacklash = 20 * kStep;
constexpr double kAxisSpeed = 0.1;         // m/s, of all of them
constexpr double kAxisAcceleration = 1.0;  // m/s^2
/// The contacts of two inputs: the carriage presses them from the step to this count on.
constexpr std::int64_t kContact = 1'600;

class EventsOnAxes : public testing::TestWithParam<AxisOf> {
 protected:
  void SetUp() override { build(GetParam()); }

  void build(AxisOf kind) {
    axes_ = {test::linearAxis("x"), test::linearAxis("y")};
    switch (kind) {
      case AxisOf::kPlain:
        break;
      case AxisOf::kBacklash:
        axes_[0].backlash = kBacklash;
        break;
      case AxisOf::kShaper:
        axes_[0].input_shaper = {{config::ShaperType::kMzv, 30.0, 0.1}};
        break;
      case AxisOf::kCoreXy:
        axes_ = test::coreXyAxes();
        break;
      case AxisOf::kGantry:
        axes_[0].motor = "first";
        axes_[0].twins.push_back(test::motorNamed("twin"));
        axes_[0].max_skew = 0.006;
        axes_[0].homing = test::homingAxis().homing;
        break;
    }
    std::vector<sim::RigAxisSpec> specs;
    for (const config::AxisConfig& config : axes_) {
      for (const sim::RigAxisSpec& motor : test::rigMotors(config)) specs.push_back(motor);
    }
    machine::MachineOptions options;
    for (const char* const name : {"left", "right"}) {
      sim::SwitchSpec contact;
      contact.line = std::string("io.") + name;
      contact.active_level = true;
      contact.position = kContact / 80.0;
      contact.end = contact.position + 60.0;
      specs[0].flags.push_back(contact);
      config::InputConfig input;
      input.name = name;
      input.line = {contact.line, true, Bias::kAsIs};
      options.inputs.push_back(input);
    }
    options.outputs.resize(2);
    options.outputs[0].name = "pen";
    options.outputs[0].line = "pen.line";
    options.outputs[1].name = "camera";
    options.outputs[1].line = "camera.line";
    bench_ = std::make_unique<Bench>(axes_, specs, false, 0.0, options);
    for (const auto& axis : bench_->machine->axes()) axis->setPosition(0.0);
  }

  test::UnthreadedMachine& machine() { return *bench_->machine; }
  static double stepTo(std::int64_t count) { return (static_cast<double>(count) - 0.5) * kStep; }
  /// By how much the motor is ahead of the joint on the way to max.
  double ahead() const { return GetParam() == AxisOf::kBacklash ? kBacklash : 0.0; }
  std::int64_t countsAhead() const { return std::llround(ahead() / kStep); }

  /// The time of the first pulse with which a motor comes to a count.
  std::int64_t timeOf(std::int64_t count, const std::string& motor = "x") const {
    std::int64_t now = 0;
    const sim::MemoryTrace& trace = *bench_->trace;
    bool forward = trace.levels()[static_cast<std::size_t>(trace.pin(motor, "dir"))];
    for (const sim::MemoryTrace::Edge& edge : trace.edges()) {
      if (edge.pin == trace.pin(motor, "dir")) forward = edge.level;
      if (edge.pin != trace.pin(motor, "step") || !edge.level) continue;
      if ((now += forward ? 1 : -1) == count) return edge.time_ns;
    }
    return -1;
  }
  std::vector<std::int64_t> timesOf(const std::vector<std::int64_t>& counts) const {
    std::vector<std::int64_t> times;
    times.reserve(counts.size());
    for (const std::int64_t count : counts) times.push_back(timeOf(count + countsAhead()));
    return times;
  }
  std::vector<std::int64_t> switches(const std::string& output) const {
    std::vector<std::int64_t> all = bench_->trace->times("outputs", output, true);
    const std::vector<std::int64_t> off = bench_->trace->times("outputs", output, false);
    all.insert(all.end(), off.begin(), off.end());
    std::sort(all.begin(), all.end());
    return all;
  }
  static void expectWithin(const std::vector<std::int64_t>& times,
                           const std::vector<std::int64_t>& wanted, std::int64_t error_ns) {
    ASSERT_EQ(times.size(), wanted.size());
    for (std::size_t i = 0; i < times.size(); ++i) {
      EXPECT_LE(std::abs(times[i] - wanted[i]), error_ns) << i << " at " << times[i];
    }
  }

  machine::ProbeRequest probing() const {
    machine::ProbeRequest request;
    request.input = "left";
    request.names = {"x"};
    request.positions = {0.04};
    request.velocity = 0.02;
    return request;
  }

  std::vector<config::AxisConfig> axes_;
  std::unique_ptr<Bench> bench_;
};

// At constant speed: while a shaped axis speeds up, its marks come as much later as at that speed.
TEST_P(EventsOnAxes, APathSwitchesAnOutputWithTheStepOfTheJoint) {
  const std::vector<std::int64_t> counts{1'000, 1'001, 1'500, 2'000};
  test::PathRequest path{{"x", "y"}, {}, false, 0.05, 0.0005};
  bool on = false;
  path.segments.push_back(test::lineTo({stepTo(counts[0]), 0.0}));
  for (std::size_t i = 1; i <= counts.size(); ++i) {
    path.segments.push_back(
        test::lineTo({stepTo(i < counts.size() ? counts[i] : std::int64_t{4'000}), 0.0}));
    path.segments.back().outputs = {{"pen", on = !on}, {"camera", on}};
  }
  const test::CoordinatedResult result = machine().wait(machine().followPath(path));
  EXPECT_EQ(result.end, axis::MoveEnd::kReached) << result.message;
  EXPECT_EQ(result.marks_made, 2 * counts.size());
  expectWithin(switches("pen"), timesOf(counts), 1);
  EXPECT_EQ(switches("camera"), switches("pen")) << "two at one instant";
  // All motors of the axis make the step.
  std::string other = "x";
  if (GetParam() == AxisOf::kCoreXy) other = "y";
  if (GetParam() == AxisOf::kGantry) other = "x.twin";
  EXPECT_EQ(timeOf(1'500, other), timeOf(1'500));
}

TEST_P(EventsOnAxes, ThePositionSwitchesAnOutputWithTheStepOfTheJoint) {
  config::PositionCompare compare;
  compare.axis = "x";
  compare.places = {0.01, 0.02, 0.025};
  compare.pulse_ns = test::kMillisecond;
  machine().setPositionCompare("camera", compare);
  EXPECT_EQ(bench_->move(0.04).end, axis::MoveEnd::kReached);
  expectWithin(bench_->trace->times("outputs", "camera", true), timesOf({800, 1'600, 2'000}), 1);
}

// The judge's own times: how long the ramps take, and how long an axis is on its way to its first
// step and from its last one.
TEST_P(EventsOnAxes, TheEndOfAMotionSwitchesAnOutputAtItsBeginPlusItsDuration) {
  config::PositionCompare end;
  end.axis = "x";
  end.at_end = true;
  end.pulse_ns = test::kMillisecond;
  const auto half_step = [](double part) { return std::sqrt(kStep / (part * kAxisAcceleration)); };
  const auto trapezoid = [](double way) {
    return way / kAxisSpeed + kAxisSpeed / kAxisAcceleration;
  };
  // As the MZV of 30 Hz and a damping of 0.1: its first part, its last one and its duration.
  double first_part = 1.0;
  double last_part = 1.0;
  double delay = 0.0;
  if (GetParam() == AxisOf::kShaper) {
    const double ringing = std::sqrt(1.0 - 0.1 * 0.1);
    const double decay = std::exp(-0.75 * test::kPi * 0.1 / ringing);
    const double outer = 1.0 - std::sqrt(0.5);
    const double sum = outer + (std::sqrt(2.0) - 1.0) * decay + outer * decay * decay;
    first_part = outer / sum;
    last_part = outer * decay * decay / sum;
    delay = 0.75 / (30.0 * ringing);
  }
  enum class Motion { kMove, kLine, kPath };
  for (const Motion motion : {Motion::kMove, Motion::kLine, Motion::kPath}) {
    SCOPED_TRACE(static_cast<int>(motion));
    build(GetParam());
    machine().setPositionCompare("camera", end);
    double way = 0.04;
    if (motion == Motion::kMove) {
      way += ahead();
      EXPECT_EQ(bench_->move(0.04).end, axis::MoveEnd::kReached);
    } else if (motion == Motion::kLine) {
      // The motors of a CoreXY go as far as x only if y rests.
      const double y = GetParam() == AxisOf::kCoreXy ? 0.0 : 0.02;
      const auto line = machine().moveLine({{"x", "y"}, {0.04, y}, false, 0.0});
      EXPECT_EQ(machine().wait(line).end, axis::MoveEnd::kReached);
    } else {
      test::PathRequest path{{"x", "y"}, {test::lineTo({0.01, 0.0})}, false, 0.0, 0.0};
      path.segments.push_back(test::lineTo({0.04, 0.0}));
      const auto result = machine().wait(machine().followPath(path));
      EXPECT_EQ(result.end, axis::MoveEnd::kReached) << result.message;
    }
    machine().advance(0.01);
    const std::vector<std::int64_t> fired = bench_->trace->times("outputs", "camera", true);
    ASSERT_EQ(fired.size(), 1U) << "taking up the backlash is no motion of its own";
    const auto from = [&](std::int64_t step, double seconds) {
      return std::abs(fired[0] - step - std::llround(seconds * 1e9));
    };
    // A path leaves a fifth of the limits for taking up the backlash, which it does on its way.
    const bool takes_up = motion == Motion::kPath && countsAhead() > 0;
    EXPECT_LE(from(timeOf(3'200 + countsAhead()), half_step(takes_up ? 0.8 : last_part)), 1);
    if (takes_up) continue;
    // Before a line, the backlash has been taken up.
    const std::int64_t first = timeOf(motion == Motion::kMove ? 1 : 1 + countsAhead());
    EXPECT_LE(from(first, trapezoid(way) + delay - half_step(first_part)), 1);
  }
}

// Two inputs have an edge at one instant.
TEST_P(EventsOnAxes, ALatchKnowsThePlaceOfTheJoint) {
  std::vector<machine::Latch> latches;
  for (const char* const input : {"left", "right"}) {
    machine::LatchRequest request;
    request.input = input;
    request.axes = {"x"};
    latches.push_back(machine().latch(request));
  }
  EXPECT_EQ(bench_->move(0.04).end, axis::MoveEnd::kReached);
  for (const machine::Latch& latch : latches) {
    const machine::LatchResult result = machine().wait(latch);
    ASSERT_TRUE(result.latched) << result.message;
    EXPECT_EQ(result.edge->time, timeOf(kContact));
    // The curve of the motor crosses the half step before the count.
    EXPECT_NEAR(result.edge->axes.at(0).position, stepTo(kContact) - ahead(), 1e-8);
  }
}

TEST_P(EventsOnAxes, AProbingAnswersThePlaceOfTheJoint) {
  for (const bool twice : {false, true}) {
    build(GetParam());
    machine::ProbeRequest request = probing();
    if (twice) {
      request.second_velocity = 0.002;
      request.back_off = 0.003;
    }
    request.returns = true;
    const machine::ProbeResult result = machine().probe(request);
    EXPECT_EQ(result.end, machine::ProbeEnd::kContact) << result.message;
    EXPECT_NEAR(result.contact.at(0), stepTo(kContact) - ahead(), 1e-8) << twice;
    EXPECT_NEAR(bench_->axis().state().position, result.contact.at(0), 0.51 * kStep);
    EXPECT_LT(result.positions.at(0), 0.04);
  }
}

TEST_P(EventsOnAxes, ALatchAtRestHasThePlaceAtWhichTheAxisStands) {
  EXPECT_EQ(bench_->move(0.01).end, axis::MoveEnd::kReached);
  machine::LatchRequest request;
  request.input = "right";
  request.axes = {"x"};
  const machine::Latch latch = machine().latch(request);
  machine().advance(0.1);
  bench_->rig.stickInput("right", true, bench_->clock.now());
  const machine::LatchResult result = machine().wait(latch);
  ASSERT_TRUE(result.latched) << result.message;
  EXPECT_NEAR(result.edge->axes.at(0).position, 0.01, 1e-9);
}

INSTANTIATE_TEST_SUITE_P(On, EventsOnAxes,
                         testing::Values(AxisOf::kPlain, AxisOf::kBacklash, AxisOf::kShaper,
                                         AxisOf::kCoreXy, AxisOf::kGantry),
                         testing::PrintToStringParamName());

// ---- what the kernel keeps ----

/// A rig whose kernel keeps the first edges of each burst, as libgpiod 1 does: the others are lost.
class RigWithAShortBuffer : public sim::Rig {
 public:
  using sim::Rig::Rig;
  static constexpr int kKept = 16;
  static constexpr std::int64_t kBurst = 2 * test::kMillisecond;
  void watchInput(int line, gpio::EdgeListener listener) override {
    if (!listener) return sim::Rig::watchInput(line, nullptr);
    sim::Rig::watchInput(line, [this, listener](bool level, std::int64_t time_ns) {
      if (time_ns - last_ > kBurst) in_burst_ = 0;
      last_ = time_ns;
      if (++in_burst_ <= kKept) listener(level, time_ns);
    });
  }

 private:
  std::int64_t last_ = 0;
  int in_burst_ = 0;
};

// Slits of 0.1 mm every 0.2 mm; at 100 mm/s their edges come each millisecond, in bursts of 40.
TEST(EventsOfABurst, AreLatchedAsFarAsTheKernelKeepsThem) {
  const std::vector<config::AxisConfig> axes{test::linearAxis("x")};
  std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(axes);
  for (const double first : {20.0, 40.0}) {
    for (int i = 0; i < 20; ++i) {
      sim::SwitchSpec slit;
      slit.line = "io.slits";
      slit.active_level = true;
      slit.position = first + 0.2 * i;
      slit.end = slit.position + 0.1;
      specs[0].flags.push_back(slit);
    }
  }
  machine::MachineOptions options;
  config::InputConfig input;
  input.name = "slits";
  input.line = {"io.slits", true, Bias::kAsIs};
  options.inputs.push_back(input);
  RigWithAShortBuffer rig(specs, nullptr, {}, {}, Bench::ioOf(options));
  pulse::VirtualClock clock;
  gpio::SimulatedBackend backend(rig, [&clock] { return clock.now(); });
  test::UnthreadedMachine machine(axes, backend, clock, options);
  machine.axis("x").setPosition(0.0);
  machine::LatchRequest request;
  request.input = "slits";
  request.edge = machine::LatchEdge::kEither;
  request.every = true;
  const machine::Latch latch = machine.latch(request);
  axis::Axis& x = machine.axis("x");
  EXPECT_EQ(x.wait(x.moveTo(0.06)).end, axis::MoveEnd::kReached);
  const std::vector<machine::LatchedEdge> edges = latch.record->take();
  ASSERT_EQ(edges.size(), 2U * RigWithAShortBuffer::kKept);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const std::size_t in_burst = i % RigWithAShortBuffer::kKept;
    const double burst = i < RigWithAShortBuffer::kKept ? 0.02 : 0.04;
    const double place = burst + 0.0001 * static_cast<double>(in_burst);
    // A slit ends at the first step beyond it.
    EXPECT_NEAR(edges[i].axes.at(0).position, place, 1.01 * kStep) << i;
    EXPECT_EQ(edges[i].active, in_burst % 2 == 0) << i;
  }
}

}  // namespace
}  // namespace stepdriver
