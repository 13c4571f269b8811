#include <gtest/gtest.h>

#include <cerrno>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/constants.h"

// A load on a vertical axis, which sinks whenever nothing holds it, over the orders of everything
// that brings the motor's current or takes it away.
namespace stepdriver {
namespace {

using machine::EmergencyDisable;
using test::Bench;
using test::kMillisecond;
using test::violationsOf;

constexpr std::int64_t kEngageOfLoad = 30 * kMillisecond;
constexpr double kFalls = 50.0;  // [mm/s]
/// [mm] At an alarm the driver's outputs are off at once, and the brake takes its time; the margin
/// is for the times of the controller.
constexpr double kFallsAtAlarm = kFalls * 1e-9 * (kEngageOfLoad + 2 * kMillisecond);

struct Variant {
  EmergencyDisable disable = EmergencyDisable::kHold;
  bool motor_power = false;
  bool brake = true;
};

class LoadedMachine {
 public:
  explicit LoadedMachine(const Variant& variant) {
    config::AxisConfig config = test::linearAxis("z", "drv8825");
    if (variant.brake) config.brake = config::BrakeConfig{"brake", true, 60'000'000, kEngageOfLoad};
    config.fault = config::FaultPin{"fault"};
    config.idle_timeout = 2.0;
    machine::MachineOptions options;
    options.emergency_disable = variant.disable;
    options.emergency_stop = config::InputSwitch{"button", true};
    if (variant.motor_power) {
      options.motor_power = config::MotorPowerConfig{};
      options.motor_power->line = "power";
      options.motor_power->on_ns = 50 * kMillisecond;
      options.motor_power->feedback = config::InputSwitch{"power.there", false};
    }
    std::vector<sim::RigAxisSpec> rig = Bench::rigAxes({config});
    rig.front().load_falls = kFalls;
    bench = std::make_unique<Bench>(std::vector{config}, rig, false, 0.0, options);
  }

  axis::Axis& z() const { return bench->axis("z"); }
  double fell() const {
    bench->rig.setInput("nothing", false, bench->clock.now());
    return bench->report("z").fell;
  }
  void press(bool pressed) const {
    bench->rig.setInput("button", pressed, bench->clock.now());
    bench->machine->advance(0.001);
  }
  void startMove() const {
    z().moveTo(0.02, true);
    bench->machine->advance(0.2);
  }

  std::unique_ptr<Bench> bench;
  double allowed = 0.0;  // [mm]
};

struct LoadAct {
  const char* name;
  std::function<void(LoadedMachine&)> act;
};

const std::vector<LoadAct>& loadActs() {
  static const std::vector<LoadAct> all = {
      {"enable", [](LoadedMachine& m) { m.z().enable(true); }},
      {"disable", [](LoadedMachine& m) { m.z().enable(false); }},
      {"sleep", [](LoadedMachine& m) { m.z().sleep(true); }},
      {"wake", [](LoadedMachine& m) { m.z().sleep(false); }},
      {"reset", [](LoadedMachine& m) { m.z().reset(); }},
      {"be idle", [](LoadedMachine& m) { m.bench->machine->advance(2.5); }},
      {"move", [](LoadedMachine& m) { m.z().wait(m.z().moveTo(0.0004, true)); }},
      {"emergency stop", [](LoadedMachine& m) { m.bench->machine->emergencyStop(); }},
      {"emergency stop in a move",
       [](LoadedMachine& m) {
         m.startMove();
         m.bench->machine->emergencyStop();
       }},
      {"the button in a move",
       [](LoadedMachine& m) {
         m.startMove();
         m.press(true);
         m.press(false);
       }},
      {"a fault of a line",
       [](LoadedMachine& m) {
         m.bench->rig.failWrites("z.step", 0, EIO);
         try {
           m.startMove();
         } catch (const Error&) {  // NOLINT(bugprone-empty-catch): it can't move now
         }
         m.bench->rig.clearWriteFault("z.step");
       }},
      {"an alarm",
       [](LoadedMachine& m) {
         sim::RigFaults faults;
         faults.chip_fault_after = 0;
         m.fell();  // the rig's time is that of the clock now
         m.allowed += kFallsAtAlarm;
         m.bench->rig.setFaults("z", faults);
         m.bench->machine->advance(0.2);
         m.bench->rig.setFaults("z", {});
       }},
      {"recover", [](LoadedMachine& m) { m.bench->machine->recover(); }},
      {"shut down", [](LoadedMachine& m) { m.bench->machine->shutdown(); }},
  };
  return all;
}

/// Plays the acts, each after the one before it or a moment later. @return how far the load has
/// fallen beyond what is allowed [mm].
double fallIn(const Variant& variant, const std::vector<std::size_t>& order, double pause,
              std::string& violations) {
  LoadedMachine machine(variant);
  for (const std::size_t number : order) {
    try {
      loadActs()[number].act(machine);
    } catch (const Error&) {  // NOLINT(bugprone-empty-catch): not every order is allowed
    }
    machine.bench->machine->advance(pause);
  }
  machine.bench->machine->advance(0.5);
  violations = violationsOf(machine.bench->report("z"));
  // The rest of its life, and the release of its lines.
  machine.bench->machine.reset();
  machine.bench->clock.waitUntil(machine.bench->clock.now() + 1'000 * kMillisecond);
  return machine.fell() - machine.allowed;
}

std::string namesOf(const std::vector<std::size_t>& order) {
  std::string names;
  for (const std::size_t number : order) names += std::string(loadActs()[number].name) + ", ";
  return names;
}

class FallingLoad : public testing::TestWithParam<Variant> {};

TEST_P(FallingLoad, DropsBy0InEveryOrderOfTwoActsAndWithoutABrakeItFalls) {
  const std::size_t acts = loadActs().size();
  Variant without = GetParam();
  without.brake = false;
  int falls = 0;
  for (std::size_t first = 0; first < acts; ++first) {
    for (std::size_t second = 0; second < acts; ++second) {
      std::string violations;
      for (const double pause : {0.0, 0.02, 0.3}) {
        EXPECT_LE(fallIn(GetParam(), {first, second}, pause, violations), 0.0)
            << namesOf({first, second}) << "each followed by " << pause << " s";
        EXPECT_EQ(violations, "") << namesOf({first, second}) << pause;
      }
      if (fallIn(without, {first, second}, 0.0, violations) > 0.0) ++falls;
    }
  }
  EXPECT_GT(falls, static_cast<int>(acts * acts / 2)) << "the same, without a brake";
}

TEST_P(FallingLoad, DropsBy0InEveryOrderOfAStopARecoveryAndTwoOthers) {
  const std::size_t acts = loadActs().size();
  for (std::size_t stop = 7; stop < 12; ++stop) {
    for (std::size_t between = 0; between < acts; ++between) {
      for (std::size_t after = 0; after < acts; ++after) {
        const std::vector<std::size_t> order = {stop, between, 12, after};
        std::string violations;
        EXPECT_LE(fallIn(GetParam(), order, 0.01, violations), 0.0) << namesOf(order);
        EXPECT_EQ(violations, "") << namesOf(order);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    EachDisableWithAndWithoutMotorPower, FallingLoad,
    testing::Values(Variant{EmergencyDisable::kHold, false}, Variant{EmergencyDisable::kHold, true},
                    Variant{EmergencyDisable::kRamp, false}, Variant{EmergencyDisable::kRamp, true},
                    Variant{EmergencyDisable::kOff, false}, Variant{EmergencyDisable::kOff, true}));

}  // namespace
}  // namespace stepdriver
