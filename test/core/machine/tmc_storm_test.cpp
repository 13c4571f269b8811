#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/runs.h"
#include "support/tmc_axis.h"

// Random commands to an axis whose driver is on a UART, beside one whose driver has pins only, and
// troubles of that driver at any moment: in a ramp, while its mode is changed, while it is set up.

namespace stepdriver {
namespace {

using test::Bench;
using test::tmcAxis;

constexpr double kKnownWithin = 1.5;  // [s]

struct StormTrouble {
  const char* cause;  // in the fault
  void (*begin)(sim::Rig& rig);
  void (*end)(sim::Rig& rig);
};

void setOverTemperature(sim::Rig& rig, bool there) {
  sim::TmcTrouble trouble;
  trouble.over_temperature = there;
  rig.setTrouble("y", trouble);
}

void setNoise(sim::Rig& rig, double flipped) {
  sim::WireFaults faults;
  faults.flipped = flipped;
  rig.setWireFaults("/dev/serial0", faults);
}

const std::array<StormTrouble, 4> kTroubles{
    {{"the TMC2209 was reset", [](sim::Rig& rig) { rig.brownOut("y"); }, [](sim::Rig&) {}},
     {"no chip answers", [](sim::Rig& rig) { rig.powerChip("y", false); },
      [](sim::Rig& rig) { rig.powerChip("y", true); }},
     {"over-temperature", [](sim::Rig& rig) { setOverTemperature(rig, true); },
      [](sim::Rig& rig) { setOverTemperature(rig, false); }},
     {"the bytes that came back are damaged", [](sim::Rig& rig) { setNoise(rig, 1.0); },
      [](sim::Rig& rig) { setNoise(rig, 0.0); }}}};

class TmcStormRun {
 public:
  explicit TmcStormRun(unsigned seed) : random_(seed), bench_({tmcAxis("y"), pinAxis()}) {
    // A chip without its registers makes larger steps, until that is known.
    bench_.may_exceed_limits = true;
    x().setPosition(0.0);
    begin();
  }

  void play() {
    constexpr int kRounds = 4;
    for (int round = 0; round < kRounds; ++round) {
      for (int i = number(12); i > 0; --i) act();
      judgeSound();
      const StormTrouble& trouble = kTroubles.at(static_cast<std::size_t>(number(4)));
      note(std::string("trouble: ") + trouble.cause);
      trouble.begin(bench_.rig);
      const std::int64_t since = bench_.clock.now();
      for (int i = number(4); i > 0; --i) act();
      const double left = kKnownWithin - 1e-9 * static_cast<double>(bench_.clock.now() - since);
      if (left > 0.0) bench_.machine->advance(left);
      judgeFault(trouble);
      trouble.end(bench_.rig);
      attempt("recover", [this] { bench_.machine->recover(); });
      EXPECT_EQ(y().state().fault, "") << log_;
      begin();
    }
    for (const axis::Move& move : moves_) {
      EXPECT_TRUE(move.outcome->get().has_value()) << "a move waits for ever" << log_;
    }
  }

 private:
  static config::AxisConfig pinAxis() { return test::linearAxis("x"); }
  axis::Axis& y() { return bench_.axis("y"); }
  axis::Axis& x() { return bench_.axis("x"); }
  int number(int below) { return static_cast<int>(random_() % static_cast<unsigned>(below)); }
  void note(const std::string& what) {
    log_ += "\n" + std::to_string(bench_.clock.now() / 1000) + " us: " + what;
  }

  // From here on the carriage of y moves as its position does.
  void begin() {
    attempt("stop", [this] { bench_.machine->stop(); });
    bench_.machine->advance(0.5);
    attempt("enable", [this] { y().enable(true); });
    attempt("set position", [this] { y().setPosition(0.0); });
    origin_ = bench_.report("y").carriage;
  }

  void attempt(const char* name, const std::function<void()>& action) {
    try {
      action();
      note(name);
    } catch (const Error& error) {
      note(std::string(name) + ": " + error.what());
      EXPECT_STRNE(error.what(), "") << name;
    }
  }

  void act() {
    constexpr std::array<int, 6> kModes{1, 2, 8, 16, 64, 256};
    const double place = 1e-4 * (number(400) - 200);
    switch (number(10)) {
      case 0:
      case 1:
      case 2:
        attempt("move y", [&] { moves_.push_back(y().moveTo(place)); });
        break;
      case 3:
        attempt("move x", [&] { moves_.push_back(x().moveTo(place)); });
        break;
      case 4:
        attempt("microsteps",
                [&] { y().setMicrosteps(kModes.at(static_cast<std::size_t>(number(6)))); });
        break;
      case 5:
        attempt("current", [&] { y().setCurrent(0.4 + 0.1 * number(5), 0.1 * number(3)); });
        break;
      case 6:
        attempt("stop", [this] { y().stop(); });
        break;
      case 7:
        attempt("disable", [this] { y().enable(false); });
        attempt("enable", [this] { y().enable(true); });
        break;
      case 8:
        attempt("override", [this] { bench_.machine->setSpeedOverride(0.3 + 0.1 * number(12)); });
        break;
      default:
        attempt("reset the override", [this] { bench_.machine->setSpeedOverride(1.0); });
        break;
    }
    bench_.machine->advance(1e-3 * number(120));
  }

  // Without a trouble the carriages are where the axes say, and no time of a chip is violated.
  void judgeSound() {
    attempt("stop", [this] { bench_.machine->stop(); });
    bench_.machine->advance(1.5);
    EXPECT_EQ(y().state().fault, "") << log_;
    EXPECT_FALSE(y().state().moving) << log_;
    EXPECT_NEAR(bench_.report("y").carriage - origin_, 1e3 * y().state().position, 1e-6) << log_;
    judgeOther();
  }

  void judgeFault(const StormTrouble& trouble) {
    EXPECT_NE(y().state().fault.find(trouble.cause), std::string::npos)
        << "the fault after " << trouble.cause << " is " << y().state().fault << log_;
    EXPECT_NE(y().state().remedy, "") << log_;
    EXPECT_FALSE(y().state().moving) << log_;
    EXPECT_FALSE(y().state().position_valid) << log_;
    judgeOther();
  }

  // The other axis knows nothing of it.
  void judgeOther() {
    EXPECT_EQ(x().state().fault, "") << log_;
    if (x().state().moving) return;
    EXPECT_NEAR(bench_.report("x").carriage, 1e3 * x().state().position, 1e-6) << log_;
    EXPECT_EQ(test::violationsOf(bench_.report("x")), "") << log_;
  }

  std::mt19937 random_;
  Bench bench_;
  double origin_ = 0.0;  // [mm]
  std::vector<axis::Move> moves_;
  std::string log_;
};

// STEPDRIVER_STORMS is how many.
TEST(TmcStorm, NamesEachTroubleAndLosesNoStepWithoutOne) {
  const auto storms = static_cast<unsigned>(test::runsOf("STEPDRIVER_STORMS", 20));
  for (unsigned seed = 1; seed <= storms && !testing::Test::HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    TmcStormRun(seed).play();
  }
}

}  // namespace
}  // namespace stepdriver
