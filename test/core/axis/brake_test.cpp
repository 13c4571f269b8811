#include <gtest/gtest.h>

#include <cerrno>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/constants.h"
#include "support/refusal.h"

namespace stepdriver {
namespace {

using config::IdleAction;
using test::Bench;
using test::kMillisecond;
using test::violationsOf;

constexpr std::int64_t kRelease = 60 * kMillisecond;
constexpr std::int64_t kEngage = 30 * kMillisecond;
constexpr double kFalls = 50.0;  // [mm/s]
constexpr double kMicrostepMm = 0.0125;

config::AxisConfig verticalAxis(IdleAction action = IdleAction::kDisable,
                                const std::string& name = "z") {
  config::AxisConfig config = test::linearAxis(name, "drv8825");
  config.brake = config::BrakeConfig{name + ".brake", true, kRelease, kEngage};
  config.fault = config::FaultPin{name + ".fault"};
  config.idle_timeout = 2.0;
  config.idle_action = action;
  return config;
}

config::AxisConfig withoutBrake(config::AxisConfig config) {
  config.brake.reset();
  return config;
}

/// Each axis carries a load.
std::vector<sim::RigAxisSpec> loadedRig(const std::vector<config::AxisConfig>& configs) {
  std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(configs);
  for (sim::RigAxisSpec& spec : specs) spec.load_falls = kFalls;
  return specs;
}

class LoadBench : public Bench {
 public:
  explicit LoadBench(const std::vector<config::AxisConfig>& configs)
      : Bench(configs, loadedRig(configs)) {}

  /// [mm] Until now.
  double fell(const std::string& name = "z") {
    rig.setInput("nothing", false, clock.now());
    return report(name).fell;
  }
  std::string violations() { return violationsOf(report("z")); }
  axis::Axis& z() { return axis("z"); }
  std::int64_t lastEdge(const std::string& pin, bool level) {
    const std::vector<std::int64_t> edges = trace->times("z", pin, level);
    return edges.empty() ? -1 : edges.back();
  }
};

TEST(Brake, IsReleasedAfterTheCurrentHasComeAndBeforeTheFirstStep) {
  config::AxisConfig config = verticalAxis();
  config.enable_on_start = false;
  config.driver.timing.enable_ns = 5 * kMillisecond;
  LoadBench bench({config});
  EXPECT_EQ(bench.lastEdge("brake", true), -1) << "no current, no release";
  bench.z().enable(true);
  bench.move(0.001, "z");
  const std::int64_t enabled = bench.lastEdge("enable", false);
  const std::int64_t released = bench.lastEdge("brake", true);
  ASSERT_GT(enabled, 0);
  EXPECT_GE(released, enabled + 5 * kMillisecond);
  EXPECT_LT(released, enabled + 6 * kMillisecond);
  ASSERT_FALSE(bench.trace->times("z", "step", true).empty());
  EXPECT_GE(bench.trace->times("z", "step", true).front(), released + kRelease);
  EXPECT_EQ(bench.violations(), "");
}

TEST(Brake, IsEngagedBeforeTheCurrentGoes) {
  LoadBench bench({verticalAxis()});
  bench.move(0.002, "z");
  bench.z().enable(false);
  const std::int64_t engaged = bench.lastEdge("brake", false);
  EXPECT_EQ(bench.lastEdge("enable", true), engaged + kEngage);
  bench.z().enable(true);
  bench.z().sleep(true);
  EXPECT_EQ(bench.lastEdge("sleep", false), bench.lastEdge("brake", false) + kEngage);
  bench.z().sleep(false);
  EXPECT_GE(bench.lastEdge("brake", true),
            bench.lastEdge("sleep", true) + bench.z().config().driver.timing.wake_ns);
  bench.z().reset();
  EXPECT_EQ(bench.lastEdge("reset", false), bench.lastEdge("brake", false) + kEngage);
  EXPECT_GE(bench.lastEdge("brake", true), bench.lastEdge("reset", true));
  EXPECT_EQ(bench.fell(), 0.0);
}

// The other levels, as on a relay board that is switched by a low level.
TEST(Brake, CanBeReleasedByALowLevel) {
  config::AxisConfig config = verticalAxis();
  config.brake->release_level = false;
  LoadBench bench({config});
  bench.move(0.002, "z");
  EXPECT_EQ(bench.trace->times("z", "brake", false).size(), 1U);
  bench.z().enable(false);
  bench.machine->advance(1.0);
  EXPECT_EQ(bench.fell(), 0.0);
  EXPECT_EQ(bench.violations(), "");
}

struct Act {
  const char* name;
  std::function<void(LoadBench&)> act;
};

const std::vector<Act>& acts() {
  static const std::vector<Act> all = {
      {"enable", [](LoadBench& bench) { bench.z().enable(true); }},
      {"disable", [](LoadBench& bench) { bench.z().enable(false); }},
      {"sleep", [](LoadBench& bench) { bench.z().sleep(true); }},
      {"wake", [](LoadBench& bench) { bench.z().sleep(false); }},
      {"reset", [](LoadBench& bench) { bench.z().reset(); }},
      {"be idle", [](LoadBench& bench) { bench.machine->advance(2.5); }},
      {"emergency stop", [](LoadBench& bench) { bench.machine->emergencyStop(); }},
      {"recover", [](LoadBench& bench) { bench.machine->recover(); }},
      {"move", [](LoadBench& bench) { bench.z().wait(bench.z().moveTo(0.0004, true)); }},
      {"stop a move at once",
       [](LoadBench& bench) {
         bench.z().moveTo(0.02, true);
         bench.machine->advance(0.1);
         bench.machine->emergencyStop();
       }},
      {"microsteps", [](LoadBench& bench) { bench.z().setMicrosteps(8); }},
      {"shut down", [](LoadBench& bench) { bench.machine->shutdown(); }},
  };
  return all;
}

/// Does three acts, with a pause after each, and one more command of each kind that can follow.
/// @return [mm] how far the load fell.
double fallDuring(const config::AxisConfig& config, const std::vector<const Act*>& order,
                  double pause, std::string* violations = nullptr) {
  LoadBench bench({config});
  for (const Act* act : order) {
    try {
      act->act(bench);
    } catch (const Refused&) {  // NOLINT(bugprone-empty-catch): most orders have a refusal
    }
    bench.machine->advance(pause);
  }
  bench.machine->shutdown();
  bench.machine->advance(1.0);
  if (violations != nullptr) *violations = bench.violations();
  return bench.fell();
}

TEST(Brake, LetsTheLoadDropBy0MicrostepsInEveryOrderOfThreeCommands) {
  int fallen_without = 0;
  for (const IdleAction action : {IdleAction::kDisable, IdleAction::kSleep}) {
    const config::AxisConfig config = verticalAxis(action);
    for (const Act& first : acts()) {
      for (const Act& second : acts()) {
        for (const Act& third : acts()) {
          const std::vector<const Act*> order = {&first, &second, &third};
          const double pause = order.front() == order.back() ? 0.0 : 0.04;
          std::string violations;
          EXPECT_EQ(fallDuring(config, order, pause, &violations), 0.0)
              << first.name << ", " << second.name << ", " << third.name;
          EXPECT_EQ(violations, "") << first.name << ", " << second.name << ", " << third.name;
        }
      }
      fallen_without += fallDuring(withoutBrake(config), {&first}, 0.04) > kMicrostepMm ? 1 : 0;
    }
  }
  EXPECT_EQ(fallen_without, static_cast<int>(2 * acts().size()))
      << "without the brake, at least the shutdown lets the load fall";
}

// While the brake takes hold nothing can hold the load of a chip at fault, but nothing more is
// lost.
TEST(Brake, CatchesTheLoadAtAFaultOfTheChip) {
  for (const bool moves : {true, false}) {
    LoadBench bench({verticalAxis()});
    sim::RigFaults faults;
    faults.chip_fault_after = moves ? 100 : 0;
    if (moves) bench.z().moveTo(0.01);
    bench.rig.setInput("nothing", false, bench.clock.now());
    bench.rig.setFaults("z", faults);
    for (int i = 0; i < 1'000; ++i) bench.machine->advance(0.001);  // it reads its inputs each time
    EXPECT_NE(bench.z().state().fault, "");
    const double engaging = kFalls * static_cast<double>(kEngage) / 1e9;
    EXPECT_LE(bench.fell(), engaging + kFalls * 0.0011);
    EXPECT_GE(bench.fell(), engaging - 1e-9);
    const double fell = bench.fell();
    bench.machine->recover();
    bench.machine->advance(1.0);
    EXPECT_EQ(bench.z().state().fault, "");
    EXPECT_EQ(bench.z().wait(bench.z().moveTo(0.001, true)).end, axis::MoveEnd::kReached);
    EXPECT_EQ(bench.fell(), fell);
    EXPECT_EQ(bench.violations(), "");
  }
}

TEST(Brake, IsEngagedWhileAnEmergencyStopLasts) {
  LoadBench bench({verticalAxis()});
  bench.move(0.002, "z");
  EXPECT_EQ(bench.lastEdge("brake", false), -1);
  bench.machine->emergencyStop();
  bench.machine->advance(1.0);
  EXPECT_GT(bench.lastEdge("brake", false), bench.lastEdge("brake", true));
  EXPECT_TRUE(bench.report("z").energized) << "the motor holds, too";
  bench.machine->recover();
  EXPECT_GT(bench.lastEdge("brake", true), bench.lastEdge("brake", false));
  EXPECT_EQ(bench.move(0.003, "z").end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.violations(), "");
}

TEST(Brake, IsEngagedByADisableThoughAnotherAxisHoldsEnable) {
  for (const bool z_first : {true, false}) {
    config::AxisConfig z = verticalAxis();
    config::AxisConfig x = test::linearAxis("x");
    z.pins.enable.line = x.pins.enable.line = "both.enable";
    LoadBench bench({x, z});
    bench.axis(z_first ? "z" : "x").enable(false);
    EXPECT_TRUE(bench.report("z").energized);
    EXPECT_EQ(bench.lastEdge("brake", false) > 0, z_first);
    bench.axis(z_first ? "x" : "z").enable(false);
    EXPECT_FALSE(bench.report("z").energized);
    EXPECT_GE(bench.lastEdge("enable", true), bench.lastEdge("brake", false) + kEngage);
    bench.machine->advance(1.0);
    EXPECT_EQ(bench.fell(), 0.0);
  }
}

TEST(Brake, ThatCantBeEngagedKeepsTheCurrent) {
  LoadBench bench({verticalAxis()});
  bench.rig.failWrites("z.brake", 0, EIO);
  EXPECT_THROW(bench.z().enable(false), GpioError);
  bench.machine->advance(5.0);
  EXPECT_TRUE(bench.report("z").energized);
  EXPECT_NE(bench.z().state().fault.find("the brake line z.brake can't be written"),
            std::string::npos)
      << bench.z().state().fault;
  bench.rig.clearWriteFault("z.brake");
  bench.machine->recover();
  EXPECT_EQ(bench.move(0.001, "z").end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.fell(), 0.0);
  EXPECT_EQ(bench.violations(), "");
}

TEST(Brake, ThatCantBeReleasedIsAFault) {
  config::AxisConfig config = verticalAxis();
  config.enable_on_start = false;
  LoadBench bench({config});
  bench.rig.failWrites("z.brake", 0, EIO);
  EXPECT_THROW(bench.z().enable(true), GpioError);
  EXPECT_REFUSED(bench.z().moveTo(0.001), "at fault");
  bench.rig.clearWriteFault("z.brake");
  bench.machine->recover();
  EXPECT_EQ(bench.move(0.001, "z").end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.fell(), 0.0);
  EXPECT_EQ(bench.violations(), "");
}

TEST(Brake, HoldsTheLoadWhileAnotherPinFails) {
  for (const std::string line : {"z.enable", "z.sleep", "z.reset"}) {
    LoadBench bench({verticalAxis()});
    bench.rig.failWrites(line, 0, EIO);
    if (line == "z.enable") {
      EXPECT_THROW(bench.z().enable(false), GpioError);
    } else if (line == "z.sleep") {
      EXPECT_THROW(bench.z().sleep(true), GpioError);
    } else {
      EXPECT_THROW(bench.z().reset(), GpioError);
    }
    bench.machine->advance(1.0);
    bench.rig.clearWriteFault(line);
    bench.machine->recover();
    EXPECT_EQ(bench.move(0.001, "z").end, axis::MoveEnd::kReached) << line;
    EXPECT_EQ(bench.fell(), 0.0) << line;
    EXPECT_EQ(bench.violations(), "") << line;
  }
}

TEST(Brake, IsEngagedAtTheShutdownOfAnAxisThatStaysEnabled) {
  config::AxisConfig config = verticalAxis();
  config.disable_on_shutdown = false;
  LoadBench bench({config});
  bench.machine->shutdown();
  EXPECT_TRUE(bench.report("z").energized);
  EXPECT_GT(bench.lastEdge("brake", false), bench.lastEdge("brake", true));
}

TEST(Brake, FollowsSleepIfEnableIsNotWired) {
  config::AxisConfig config = verticalAxis(IdleAction::kSleep);
  config.pins.enable.line.clear();
  config.pins.reset.line.clear();
  LoadBench bench({config});
  EXPECT_GE(bench.lastEdge("brake", true),
            bench.lastEdge("sleep", true) + config.driver.timing.wake_ns);
  bench.move(0.001, "z");
  bench.machine->advance(3.0);
  EXPECT_EQ(bench.lastEdge("sleep", false), bench.lastEdge("brake", false) + kEngage);
  bench.move(0.002, "z");
  bench.machine->shutdown();
  EXPECT_GT(bench.lastEdge("brake", false), bench.lastEdge("brake", true));
  EXPECT_EQ(bench.fell(), 0.0);
  EXPECT_EQ(bench.violations(), "");
}

// All lines are released at once, and the brake of the first axis takes time.
TEST(Brake, HoldsTheLoadIfTheMachineCantBegin) {
  const std::vector<config::AxisConfig> axes = {test::linearAxis("y"), verticalAxis()};
  sim::Rig rig(loadedRig(axes));
  pulse::VirtualClock clock;
  gpio::SimulatedBackend backend(rig, [&clock] { return clock.now(); });
  rig.failWrites("y.enable", 0, EIO);
  EXPECT_THROW(test::UnthreadedMachine(axes, backend, clock), GpioError);
  rig.setInput("nothing", false, clock.now() + 1'000 * kMillisecond);
  EXPECT_FALSE(rig.report("z").energized);
  EXPECT_EQ(rig.report("z").fell, 0.0);
}

// The second move finds the motor awake, and its brake engaged.
TEST(Brake, OfAMoveThatWasStoppedWhileItWokeIsReleasedByTheNextOne) {
  for (const IdleAction action : {IdleAction::kDisable, IdleAction::kSleep}) {
    config::AxisConfig config = verticalAxis(action);
    config.homing = config::HomingConfig{};
    config.homing->seek_speed = config.homing->latch_speed = 0.01;
    config.homing->max_travel = 0.5;
    LoadBench bench({config});
    bench.machine->advance(3.0);
    ASSERT_TRUE(bench.z().state().idle);
    int looks = 0;
    bench.z().home([&looks] { return ++looks > 1; });
    EXPECT_EQ(bench.move(0.001, "z").end, axis::MoveEnd::kReached);
    EXPECT_EQ(bench.fell(), 0.0);
    EXPECT_EQ(bench.violations(), "");
  }
}

TEST(Brake, AHomingWhoseWakeUpFailsEnds) {
  config::AxisConfig config = verticalAxis();
  config.homing = config::HomingConfig{};
  config.homing->seek_speed = config.homing->latch_speed = 0.01;
  config.homing->max_travel = 0.5;
  for (const std::string line : {"z.enable", "z.brake"}) {
    LoadBench bench({config});
    bench.machine->advance(3.0);
    bench.rig.failWrites(line, 0, EIO);
    EXPECT_EQ(bench.z().home({}).end, axis::HomingEnd::kFailed);
    bench.rig.clearWriteFault(line);
    bench.machine->recover();
    EXPECT_EQ(bench.move(0.001, "z").end, axis::MoveEnd::kReached);
    EXPECT_EQ(bench.fell(), 0.0);
    EXPECT_EQ(bench.violations(), "");
  }
}

}  // namespace
}  // namespace stepdriver
