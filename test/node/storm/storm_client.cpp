#include "storm/storm_client.h"

#include <algorithm>
#include <chrono>
#include <functional>
#include <numeric>
#include <optional>
#include <thread>

#include "support/wait.h"

namespace stepdriver::storm {
namespace {

using node_test::sleepFor;

constexpr double kWaits = 0.3;
constexpr double kLongestPause = 0.08;    // [s]
constexpr double kJogPeriod = 0.04;       // [s]
constexpr double kSetpointPeriod = 0.02;  // [s]
// Moves are short, so that there are many of them.
constexpr double kLowest = 0.0;      // [m]
constexpr double kHighest = 0.06;    // [m]
constexpr double kFarthest = 0.012;  // [m] of a relative move

}  // namespace

StormClient::StormClient(const std::string& node, StormMachine machine, int number,
                         std::uint64_t seed, DriverTopics& topics, RequestLog& log,
                         const std::atomic<Weather>& weather)
    : machine_(machine),
      number_(number),
      random_(seed * 1000 + static_cast<std::uint64_t>(number)),
      calls_(node, number, log),
      topics_(topics),
      weather_(weather) {}

void StormClient::run() {
  while (weather_ != Weather::kOver) {
    if (!storms()) {
      sleepFor(0.002);
      continue;
    }
    idle_ = false;
    if (storms()) sendAnything();
    idle_ = true;
    pause(kLongestPause);
  }
}

void StormClient::sendAnything() {
  const double what = between(0.0, 1.0);
  if (what < 0.55) {
    sendMotion();
  } else if (what < 0.72) {
    sendSetting();
  } else if (what < 0.85) {
    sendPower();
  } else {
    sendEnding();
  }
}

void StormClient::sendMotion() {
  const std::size_t axis = anyAxis();
  const bool wait = chance(kWaits);
  const std::vector<std::function<void()>> motions{
      [&] { calls_.moveTo(axis, anyPosition(), false, wait); },
      [&] { calls_.moveTo(axis, between(-kFarthest, kFarthest), true, wait); },
      [&] { calls_.moveRounds(axis, between(-0.08, 0.08), wait); },
      [&] {
        const auto axes = someAxes();
        std::vector<double> positions;
        for (std::size_t i = 0; i < axes.size(); ++i) positions.push_back(anyPosition());
        calls_.moveLine(axes, positions, false, chance(0.3) ? between(0.3, 2.0) : 0.0, wait);
      },
      [&] {
        const auto axes = someAxes();
        std::vector<double> ways;
        for (std::size_t i = 0; i < axes.size(); ++i) {
          ways.push_back(between(-kFarthest, kFarthest));
        }
        calls_.moveLine(axes, ways, true, 0.0, wait);
      },
      [&] { topics_.moveByAction(number_, axis, anyPosition(), false); },
      [&] { topics_.moveByAction(number_, axis, between(-kFarthest, kFarthest), true); },
      [&] {
        const auto axes = someAxes();
        std::vector<double> positions;
        for (std::size_t i = 0; i < axes.size(); ++i) positions.push_back(anyPosition());
        const double duration = between(2.5, 5.0);
        if (chance(0.5)) {
          topics_.command(number_, axes, positions, duration);
        } else {
          const double ahead = chance(0.5) ? between(0.05, 3.0) : 0.0;
          topics_.followTrajectory(number_, axes, positions, duration, ahead);
        }
      },
      [&] {
        const auto axes = someAxes();
        using Marks = DriverCalls::Marks;
        const bool switches = chance(0.6);
        std::uint64_t path = calls_.followPath(
            axes, between(-kFarthest, kFarthest) / 3.0, true, 0.0,
            !switches ? Marks::kNone : (chance(0.5) ? Marks::kAtCorners : Marks::kOnTheWay));
        while (path != 0 && chance(0.7)) {
          const bool more = chance(0.7);
          pause(0.3);
          const double size = between(-kFarthest, kFarthest) / 3.0;
          if (!calls_.appendPath(path, axes, size, more,
                                 switches ? Marks::kAtCorners : Marks::kNone)) {
            path = 0;
          }
          if (!more) path = 0;
        }
      },
      [&] {
        calls_.probe(chance(0.8) ? 0 : axis, anyPosition(), chance(0.5), chance(0.5), chance(0.5));
      },
      [&] { jog(); },
      [&] { streamSetpoints(); },
      [&] {
        // A homing takes a long time.
        if (!chance(0.2)) return;
        chance(0.7) ? calls_.home(axis, wait) : calls_.homeAll(wait);
      },
  };
  motions[std::uniform_int_distribution<std::size_t>(0, motions.size() - 1)(random_)]();
}

void StormClient::sendSetting() {
  const std::size_t axis = anyAxis();
  const double what = between(0.0, 1.0);
  if (what < 0.25) {
    calls_.speedOverride(chance(0.3) ? 1.0 : between(0.2, 2.0));
  } else if (what < 0.45) {
    const auto or_configured = [&](double low, double high) {
      return chance(0.4) ? 0.0 : between(low, high);
    };
    calls_.setLimits(axis, or_configured(0.01, 0.04), or_configured(0.02, 0.2),
                     or_configured(0.05, 3.0));
  } else if (what < 0.5) {
    setCompare(axis);
  } else if (what < 0.6) {
    setOutput();
  } else if (what < 0.73) {
    std::optional<WindowOrder> window;
    if (chance(0.4)) {
      const double from = anyPosition();
      window = WindowOrder{axis, from, from + between(0.0, 0.03)};
    }
    topics_.latch(number_, chance(0.5), window);
  } else if (what < 0.78) {
    calls_.setPosition(axis, anyPosition());
  } else if (what < 0.82) {
    const double run = between(0.2, kHighestCurrent);
    calls_.setCurrent(kWithRegisters, run, between(0.1, run));
  } else if (what < 0.9) {
    if (chance(0.5)) {
      calls_.microstep(0, chance(0.5) ? 16 : 8);
    } else {
      calls_.microstep(2, microstepsOfZ(machine_).at(chance(0.5) ? 0 : 1));
    }
  } else {
    pressSwitch();
  }
}

void StormClient::setCompare(std::size_t axis) {
  const double what = between(0.0, 1.0);
  const double from = anyPosition();
  if (what < 0.1) {
    calls_.clearCompare();
  } else if (what < 0.4) {
    calls_.compareCam(axis, from, from + between(0.001, 0.02), chance(0.5) ? 0.005 : 0.0);
  } else {
    CompareOrder order;
    order.axis = axis;
    order.direction = std::uniform_int_distribution<int>(-1, 1)(random_);
    order.distance = between(0.001, 0.004);
    order.begin = 0.5 * from;
    order.end = order.begin + between(0.0, 0.06);
    order.pulse = between(0.0005, 0.003);
    calls_.comparePulses(order);
  }
}

void StormClient::setOutput() {
  const std::size_t last = kOutputs.size() - 1;
  const auto output = std::uniform_int_distribution<std::size_t>(0, last)(random_);
  const double what = between(0.0, 1.0);
  const bool on = chance(0.6);
  double value = on ? 1.0 : 0.0;
  if (on && output == kPwmOutputIndex) value = between(0.01, 1.0);
  if (what < 0.5) {
    calls_.setOutput(output, on);
  } else if (what < 0.8) {
    calls_.setOutputValue(output, value);
  } else {
    topics_.output(number_, output, value);
  }
}

void StormClient::sendPower() {
  const std::size_t axis = anyAxis();
  const std::string below = kAxisNames.at(axis) + "/";
  const double what = between(0.0, 1.0);
  if (what < 0.45) {
    calls_.set(Kind::kEnable, axis, below + "enable", true);
  } else if (what < 0.6) {
    calls_.set(Kind::kDisable, axis, below + "enable", false);
  } else if (what < 0.7) {
    calls_.set(Kind::kSleep, axis, below + "sleep", true);
  } else if (what < 0.85) {
    calls_.set(Kind::kWake, axis, below + "sleep", false);
  } else {
    calls_.trigger(Kind::kOther, 1U << axis, below + "reset");
  }
}

void StormClient::sendEnding() {
  const std::size_t axis = anyAxis();
  const double what = between(0.0, 1.0);
  if (what < 0.25) {
    calls_.trigger(Kind::kStop, 1U << axis, kAxisNames.at(axis) + "/stop");
  } else if (what < 0.4) {
    calls_.trigger(Kind::kStop, kAllAxes, "stop");
  } else if (what < 0.5) {
    calls_.trigger(Kind::kHold, kAllAxes, "hold");
  } else if (what < 0.7) {
    calls_.trigger(Kind::kResume, kAllAxes, "resume");
  } else if (what < 0.73) {
    calls_.trigger(Kind::kEmergencyStop, kAllAxes, "emergency_stop");
  } else if (what < 0.85) {
    calls_.trigger(Kind::kRecover, kAllAxes, "recover");
  } else if (what < 0.92) {
    topics_.cancelMove(axis);
  } else if (what < 0.95) {
    topics_.cancelLatches();
  } else {
    topics_.cancelTrajectories();
  }
}

// A stream that continues through a calm isn't a new jog.
void StormClient::jog() {
  const std::size_t axis = anyAxis();
  const double velocity = between(-0.04, 0.04);
  const bool stubborn = chance(0.3);
  const int messages = std::uniform_int_distribution<int>(1, 30)(random_);
  for (int i = 0; i < messages && (storms() || stubborn); ++i) {
    topics_.jog(number_, axis, velocity);
    sleepFor(kJogPeriod);
  }
  if (chance(0.5)) topics_.jog(number_, axis, 0.0);
}

// As with jogs, a stream that continues through a calm isn't a new one.
void StormClient::streamSetpoints() {
  const bool all = chance(0.3);
  const std::size_t axis = anyAxis();
  std::vector<double> positions;
  for (std::size_t i = 0; i < kAxisNames.size(); ++i) positions.push_back(anyPosition());
  const bool stubborn = chance(0.3);
  const int messages = std::uniform_int_distribution<int>(1, 60)(random_);
  for (int i = 0; i < messages && (storms() || stubborn); ++i) {
    for (double& position : positions) position += between(-0.0002, 0.0004);
    if (all) {
      topics_.setpoints(number_, positions);
    } else {
      topics_.setpoint(number_, axis, positions[axis]);
    }
    sleepFor(kSetpointPeriod);
  }
}

void StormClient::pressSwitch() {
  const std::vector<std::string> services = switchesOf(machine_);
  const std::string& service = services.at(chance(0.5) ? 0 : services.size() - 1);
  calls_.set(Kind::kOther, 0, service, true);
  pause(kLongestPause);
  calls_.set(Kind::kOther, 0, service, false);
}

bool StormClient::chance(double probability) { return between(0.0, 1.0) < probability; }

double StormClient::between(double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random_);
}

std::size_t StormClient::anyAxis() {
  return std::uniform_int_distribution<std::size_t>(0, kAxisNames.size() - 1)(random_);
}

std::vector<std::size_t> StormClient::someAxes() {
  std::vector<std::size_t> axes(kAxisNames.size());
  std::iota(axes.begin(), axes.end(), 0);
  std::shuffle(axes.begin(), axes.end(), random_);
  axes.resize(chance(0.6) ? 2 : 3);
  return axes;
}

double StormClient::anyPosition() { return between(kLowest, kHighest); }

void StormClient::pause(double longest) { sleepFor(between(0.0, longest)); }

}  // namespace stepdriver::storm
