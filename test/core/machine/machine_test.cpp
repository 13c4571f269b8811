#include "stepdriver_core/machine/machine.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/refusal.h"

namespace stepdriver {
namespace {

using test::Bench;
using test::linearAxis;
using test::violationsOf;

TEST(Machine, TakesAllLinesOrNone) {
  const std::vector<config::AxisConfig> configs = {linearAxis("x"), linearAxis("y")};
  sim::Rig rig(Bench::rigAxes({configs[0]}));
  pulse::VirtualClock clock;
  gpio::SimulatedBackend backend(rig, [&clock] { return clock.now(); });
  const auto held = backend.request({{"y.step", false, false}}, {});
  EXPECT_THROW(test::UnthreadedMachine(configs, backend, clock), GpioError);
  // All lines are released: they can be requested again.
  test::UnthreadedMachine machine({configs[0]}, backend, clock);
  EXPECT_EQ(machine.axes().size(), 1U);
}

TEST(Machine, NamesTheAxesThatThereAre) {
  Bench bench({linearAxis("x"), linearAxis("y")});
  try {
    bench.machine->axis("z");
    FAIL();
  } catch (const Refused& refused) {
    EXPECT_STREQ(refused.what(), "there is no axis z (axes: x, y)");
  }
}

TEST(Machine, StartsWithEveryLineSafeAndMovesNothing) {
  config::AxisConfig config = linearAxis("x");
  config.enable_on_start = false;
  Bench bench({config});
  bench.machine->advance(1.0);
  EXPECT_FALSE(bench.report().energized);
  EXPECT_TRUE(bench.trace->times("x", "enable", false).empty()) << "ENABLE was asserted";
  EXPECT_TRUE(bench.trace->times("x", "step", true).empty());
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Machine, MovesAxesAtOnce) {
  Bench bench({linearAxis("x"), linearAxis("y", "drv8825")});
  const axis::Move x = bench.axis("x").moveTo(0.05);
  const axis::Move y = bench.axis("y").moveTo(-0.03, false, 0.05);
  EXPECT_EQ(bench.axis("y").wait(y).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.axis("x").wait(x).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.pulses("x"), 4000);
  EXPECT_EQ(bench.pulses("y"), -2400);
  EXPECT_EQ(violationsOf(bench.report("x")) + violationsOf(bench.report("y")), "");
}

/// Whether an axis is enabled, for each axis.
std::vector<bool> enabledAxes(const Bench& bench) {
  std::vector<bool> enabled;
  for (const auto& axis : bench.machine->axes()) enabled.push_back(axis->state().enabled);
  return enabled;
}

TEST(Machine, SlowsAnAxisDownWithoutPassingItsTargetIfItsStartSpeedAllowsThat) {
  config::AxisConfig config = linearAxis("x");
  config.start_speed = config.max_speed;
  Bench bench({config});
  const axis::Move move = bench.axis("x").moveTo(0.003);
  bench.machine->advance(0.01);
  bench.machine->setSpeedOverride(0.4);  // by a ramp that would take 4.2 mm
  EXPECT_EQ(bench.axis("x").wait(move).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.report().pulses_forward, 240);
  EXPECT_EQ(bench.report().pulses_backward, 0);
}

TEST(Machine, EnablesAndDisablesAllAxesAtOnce) {
  std::vector<config::AxisConfig> configs = {linearAxis("x"), linearAxis("y", "drv8825"),
                                             linearAxis("always_on")};
  for (config::AxisConfig& config : configs) config.enable_on_start = false;
  configs[2].pins.enable = {};
  Bench bench(configs);
  EXPECT_EQ(enabledAxes(bench), (std::vector<bool>{false, false, true}));
  bench.machine->enable(true);
  EXPECT_EQ(enabledAxes(bench), (std::vector<bool>{true, true, true}));

  const axis::Move x = bench.axis("x").moveTo(0.08);
  const axis::Move y = bench.axis("y").moveTo(-0.08);
  bench.machine->advance(0.3);
  const double before = bench.axis("x").state().velocity;
  bench.machine->enable(false);
  EXPECT_EQ(enabledAxes(bench), (std::vector<bool>{false, false, true}));
  EXPECT_EQ(bench.axis("x").wait(x).end, axis::MoveEnd::kStopped);
  EXPECT_EQ(bench.axis("y").wait(y).end, axis::MoveEnd::kStopped);
  // Both decelerate at the same time.
  const double ramp = before / bench.axis("x").config().deceleration;
  EXPECT_NEAR(bench.axis("x").wait(x).duration, 0.3 + ramp, 0.01);
  EXPECT_NEAR(bench.axis("y").wait(y).duration, 0.3 + ramp, 0.01);
  EXPECT_EQ(violationsOf(bench.report("x")) + violationsOf(bench.report("y")), "");
}

TEST(Machine, EnablesNoAxisIfOneCannotBe) {
  std::vector<config::AxisConfig> configs = {linearAxis("x"), linearAxis("y")};
  for (config::AxisConfig& config : configs) config.enable_on_start = false;
  Bench bench(configs);
  bench.machine->emergencyStop();
  EXPECT_REFUSED(bench.machine->enable(true), "x: at fault: emergency stop");
  EXPECT_EQ(enabledAxes(bench), (std::vector<bool>{false, false}));
  bench.machine->recover();
  bench.machine->enable(true);
  EXPECT_EQ(enabledAxes(bench), (std::vector<bool>{true, true}));

  for (config::AxisConfig& config : configs) config.pins.enable = {};
  Bench unwired(configs);
  EXPECT_REFUSED(unwired.machine->enable(false), "no axis has pins/enable");
}

TEST(Machine, StopsAllAxes) {
  Bench bench({linearAxis("x"), linearAxis("y")});
  const axis::Move x = bench.axis("x").moveTo(0.08);
  const axis::Move y = bench.axis("y").moveTo(-0.08);
  bench.machine->advance(0.3);
  bench.machine->stop();
  EXPECT_EQ(bench.axis("x").wait(x).end, axis::MoveEnd::kStopped);
  EXPECT_EQ(bench.axis("y").wait(y).end, axis::MoveEnd::kStopped);
}

TEST(Machine, EmergencyStopSendsNoOtherPulseAndLatches) {
  Bench bench({linearAxis("x"), linearAxis("y")});
  axis::Axis& x = bench.axis("x");
  x.setPosition(0.0);
  bench.axis("y").setPosition(0.0);
  const axis::Move move = x.moveTo(0.08);
  bench.machine->advance(0.3);
  const std::int64_t pulses = bench.pulses();
  bench.machine->emergencyStop();
  const axis::MoveResult result = x.wait(move);
  EXPECT_EQ(result.end, axis::MoveEnd::kEmergencyStop);
  bench.machine->advance(1.0);
  EXPECT_EQ(bench.pulses(), pulses);
  EXPECT_EQ(x.state().fault, "emergency stop");
  EXPECT_FALSE(x.state().position_valid) << "it stopped from 100 mm/s at once";
  EXPECT_TRUE(bench.axis("y").state().position_valid) << "it stood";
  EXPECT_TRUE(bench.report().energized);
  EXPECT_THROW(x.moveTo(0.0), Refused);
  EXPECT_THROW(bench.axis("y").moveTo(0.01), Refused);
  bench.machine->recover();
  bench.machine->advance(1.0);
  EXPECT_EQ(bench.pulses(), pulses) << "nothing moves until a new command";
  EXPECT_EQ(bench.move(0.0).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 0);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Machine, ShutsDownFromAMoveWithEveryLineSafe) {
  for (const bool disable : {true, false}) {
    config::AxisConfig config = linearAxis("x");
    config.disable_on_shutdown = disable;
    Bench bench({config});
    axis::Axis& x = bench.axis();
    const axis::Move move = x.moveTo(0.08);
    bench.machine->advance(0.3);
    bench.machine->shutdown();
    EXPECT_EQ(x.wait(move).end, axis::MoveEnd::kStopped);
    EXPECT_THROW(x.moveTo(0.0), Refused);
    EXPECT_THROW(x.enable(true), Refused);
    bench.machine.reset();
    EXPECT_EQ(bench.report().energized, !disable);
    EXPECT_LT(bench.pulses(), 6400);
    EXPECT_EQ(violationsOf(bench.report()), "");
  }
}

TEST(Machine, SendsTheSameEdgesEachTime) {
  std::vector<std::vector<sim::MemoryTrace::Edge>> runs;
  for (int run = 0; run < 2; ++run) {
    Bench bench({linearAxis("x")});
    bench.move(0.03);
    bench.axis().setMicrosteps(4);
    bench.move(-0.01);
    runs.push_back(bench.trace->edges());
  }
  ASSERT_EQ(runs[0].size(), runs[1].size());
  for (std::size_t i = 0; i < runs[0].size(); ++i) {
    ASSERT_EQ(runs[0][i].time_ns, runs[1][i].time_ns) << "edge " << i;
    ASSERT_EQ(runs[0][i].pin, runs[1][i].pin) << "edge " << i;
  }
}

TEST(Machine, ServesItsPulsesInAThreadOfItsOwn) {
  Bench bench({linearAxis("x"), linearAxis("y")}, true, 0.0);
  std::atomic<int> reached{0};
  std::vector<std::thread> clients;
  for (const std::string name : {"x", "y"}) {
    clients.emplace_back([&bench, &reached, name] {
      for (int i = 0; i < 20; ++i) {
        if (bench.move(i % 2 == 0 ? 0.01 : 0.0, name).end == axis::MoveEnd::kReached) ++reached;
      }
    });
  }
  for (std::thread& client : clients) client.join();
  EXPECT_EQ(reached, 40);
  EXPECT_EQ(bench.pulses("x"), 0);
  EXPECT_EQ(bench.pulses("y"), 0);
  EXPECT_EQ(violationsOf(bench.report("x")) + violationsOf(bench.report("y")), "");
}

// On the steady clock the machine is never exactly on time, but the chip must not notice.
TEST(Machine, KeepsTheChipsTimesOnTheSteadyClockToo) {
  const config::AxisConfig config = linearAxis("x", "drv8825");
  pulse::SteadyClock clock;
  sim::Rig rig(Bench::rigAxes({config}));
  gpio::SimulatedBackend backend(rig, [&clock] { return clock.now(); });
  machine::MachineOptions options;
  options.max_lateness = 60.0;
  {
    machine::Machine machine({config}, backend, clock, options);
    axis::Axis& x = machine.axis("x");
    for (const double target : {0.002, -0.001, 0.0}) {
      EXPECT_EQ(x.wait(x.moveTo(target)).end, axis::MoveEnd::kReached);
    }
    EXPECT_EQ(machine.figures().pulses, 160U + 240U + 80U);
  }
  const sim::RigAxisReport seen = rig.report("x");
  EXPECT_EQ(seen.pulses_forward, 160 + 80);
  EXPECT_EQ(seen.pulses_backward, 240);
  EXPECT_EQ(violationsOf(seen), "");
}

// Moves, stops, mode changes, disables, sleeps, resets and switches in any order. The position is
// always the count of the edges, the rig sees no violation, and the limits are kept.
class RandomCommands {
 public:
  RandomCommands(std::uint64_t seed, const std::string& model)
      : random_(seed), model_(model), bench_({configOf(model, seed)}, {specOf(model, seed)}) {}

  void run(int commands) {
    for (int i = 0; i < commands && !testing::Test::HasFatalFailure(); ++i) {
      SCOPED_TRACE(testing::Message() << "command " << i);
      command();
      check();
    }
    EXPECT_GT(moves_, commands / 4);
    EXPECT_GT(endstops_, 0);
    EXPECT_GT(stops_, 0);
    EXPECT_GT(taken_over_, 0);
    EXPECT_GT(refused_, 0) << "some targets are out of reach";
    EXPECT_LT(refused_, commands / 2) << "most commands must do something";
    checkSpeeds();
  }

 private:
  static config::AxisConfig configOf(const std::string& model, std::uint64_t seed) {
    config::AxisConfig config = linearAxis("x", model);
    config.max_speed = 0.2;
    config.acceleration = 5.0;
    config.deceleration = 3.0;
    config.stop_deceleration = 4.0;
    config.start_speed = seed % 4 == 0 ? 0.0 : 0.005;
    config.jerk = seed % 2 == 0 ? 0.0 : 100.0;
    config.align_on_microstep_change = true;
    config.min_position = -0.02;
    config.max_position = 0.02;
    return config;
  }

  static sim::RigAxisSpec specOf(const std::string& model, std::uint64_t seed) {
    sim::RigAxisSpec spec = test::rigAxis(configOf(model, seed));
    spec.min_switch->position = -12.0;
    spec.max_switch->position = 12.0;
    spec.max_switch->bounces = 2;
    spec.max_switch->bounce_ns = 300'000;
    return spec;
  }

  void command() {
    axis::Axis& x = bench_.axis();
    const int kind = static_cast<int>(random_() % 24);
    try {
      if (kind < 14) {
        const double target = uniform(-0.022, 0.022);
        const double velocity = random_() % 3 == 0 ? 0.0 : uniform(0.0005, 0.2);
        const axis::Move move = random_() % 4 == 0 ? x.moveTo(target / 10.0, true, velocity)
                                                   : x.moveTo(target, false, velocity);
        ++moves_;
        if (random_() % 3 == 0) {
          bench_.machine->advance(uniform(0.0, move.duration));
          check();
          x.stop();
          ++stops_;
        }
        const axis::MoveResult result = x.wait(move);
        endstops_ +=
            result.end == axis::MoveEnd::kEndstopMin || result.end == axis::MoveEnd::kEndstopMax;
      } else if (kind < 17) {
        x.setMicrosteps(1 << (random_() % 6));
      } else if (kind == 17) {
        x.enable(false);
        x.enable(true);
      } else if (kind >= 20) {
        wander();
      } else if (kind == 18) {
        x.sleep(true);
        x.sleep(false);
      } else {
        bench_.machine->emergencyStop();
        bench_.machine->recover();
      }
    } catch (const Refused&) {
      ++refused_;
    }
  }

  // Commands that interrupt others in mid-motion.
  void wander() {
    axis::Axis& x = bench_.axis();
    for (int i = 0; i < 5; ++i) {
      switch (random_() % 4) {
        case 0:
          x.jog(uniform(-0.2, 0.2));
          break;
        case 1:
          bench_.machine->setSpeedOverride(uniform(0.05, 2.0));
          break;
        case 2:
          x.stop();
          break;
        default:
          x.moveTo(uniform(-0.02, 0.02), false, uniform(0.001, 0.2));
      }
      ++taken_over_;
      bench_.machine->advance(uniform(0.0, 0.05));
      check();
    }
    bench_.machine->setSpeedOverride(1.0);
    x.stop();
    while (x.state().moving) bench_.machine->advance(0.01);
  }

  void check() {
    const axis::AxisState state = bench_.axis().state();
    const sim::RigAxisReport seen = bench_.report();
    ASSERT_EQ(violationsOf(seen), "");
    // All pulses since the last check were sent in this mode.
    const std::int64_t pulses = bench_.pulses() - pulses_;
    const int mode = pulses == 0 ? state.microsteps : seen.microsteps;
    position_ += static_cast<double>(pulses) / (80'000.0 * mode / 16.0);
    pulses_ = bench_.pulses();
    ASSERT_NEAR(state.position, position_, 1e-9);
    ASSERT_LE(std::abs(state.velocity), 0.2 + 1e-9);
    ASSERT_LE(std::abs(state.position), 0.02 + 0.5 / 5000.0);
  }

  // Two steps in one direction are never closer than at top speed. A step and the step back may be,
  // as the motion turns between them.
  void checkSpeeds() {
    const auto rises = bench_.trace->times("x", "step", true);
    ASSERT_GT(rises.size(), 1000U);
    const double steps_per_unit = 80'000.0 * (model_ == "drv8825" ? 2.0 : 1.0);
    std::vector<std::int64_t> turns = bench_.trace->times("x", "dir", true);
    const auto back = bench_.trace->times("x", "dir", false);
    turns.insert(turns.end(), back.begin(), back.end());
    std::sort(turns.begin(), turns.end());
    for (std::size_t i = 1; i < rises.size(); ++i) {
      const auto turn = std::lower_bound(turns.begin(), turns.end(), rises[i - 1]);
      if (turn != turns.end() && *turn < rises[i]) continue;
      ASSERT_GE(static_cast<double>(rises[i] - rises[i - 1]), 1e9 / (0.2 * steps_per_unit) - 1.0)
          << "pulse " << i;
    }
  }

  double uniform(double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random_);
  }

  std::mt19937_64 random_;
  std::string model_;
  Bench bench_;
  std::int64_t pulses_ = 0;
  double position_ = 0.0;
  int moves_ = 0;
  int stops_ = 0;
  int endstops_ = 0;
  int refused_ = 0;
  int taken_over_ = 0;
};

TEST(Machine, KeepsItsPromisesThroughTenThousandRandomCommands) {
  const std::vector<std::string> models = {"a4988", "drv8825", "tb6600"};
  for (std::uint64_t seed = 1; seed <= 80; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    RandomCommands(seed, models[seed % models.size()]).run(250);
    if (testing::Test::HasFailure()) return;
  }
}

}  // namespace
}  // namespace stepdriver
