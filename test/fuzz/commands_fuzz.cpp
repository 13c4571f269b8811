#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "fuzz/fuzz_input.h"
#include "search/drawn_machines.h"
#include "search/participants.h"

// The input is a schedule of test/core/search: acts of two clients and of the machine, some of them
// with numbers of the input, and turns that come late. The oracle of the search judges what the rig
// sees.

namespace stepdriver::fuzz {
namespace {

using search::Act;
using search::Meaning;
using search::Participants;

constexpr std::size_t kMostItems = 8;
constexpr std::size_t kMostDeviations = 3;
/// Steps between two items, and the steps that a participant has to wait.
constexpr std::array<std::size_t, 12> kSteps = {0, 1, 2, 3, 4, 8, 16, 40, 60, 120, 200, 500};

/// Takes the input from its beginning; 0 after its end.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : next_(data), left_(size) {}

  bool isOver() const { return left_ == 0; }

  std::uint8_t byte() {
    if (left_ == 0) return 0;
    --left_;
    return *next_++;
  }

  std::size_t any(std::size_t count) { return byte() % count; }

  /// From -size to size, ordinary or in one of twelve decades; a few are any double.
  double number(double size) {
    const int kind = byte();
    if (kind < 160) return size * (kind - 80) / 80.0;
    if (kind < 250) return (kind % 2 == 0 ? 1.0 : -1.0) * inDecades(size);
    std::array<std::uint8_t, sizeof(double)> bytes{};
    for (std::uint8_t& each : bytes) each = byte();
    double number = 0.0;
    std::memcpy(&number, bytes.data(), sizeof number);
    return number;
  }

  /// Down to a millionth of a millionth of the most.
  double inDecades(double most) { return most * std::pow(10.0, -12.0 * byte() / 255.0); }

  /// From least to most.
  double between(double least, double most) { return least + (most - least) * byte() / 255.0; }

 private:
  const std::uint8_t* next_;
  std::size_t left_;
};

Meaning moving(const std::vector<std::size_t>& axes) {
  Meaning meaning;
  meaning.moves = true;
  for (const std::size_t axis : axes) meaning.axes[axis] = true;
  return meaning;
}

Act request(const std::string& name, const machine::Request& wanted, const Meaning& meaning) {
  return {name, [=](Participants& all, int client) { all.post(client, name, wanted, meaning); }};
}

/// An act with numbers of the input, as machine::Machine hands them over: it refuses some itself.
Act readAct(Input& input, const std::vector<config::AxisConfig>& configs) {
  constexpr std::size_t kKinds = 15;
  const std::size_t kind = input.any(kKinds);
  const std::size_t axis = input.any(search::kAxes);
  const config::AxisConfig& config = configs.at(axis);
  switch (kind) {
    case 0: {
      const machine::MoveTo move{axis, input.number(0.02), input.any(2) == 1,
                                 input.number(config.max_speed)};
      return request(fmt::format("move {} {} {} at {}", axis, move.relative ? "by" : "to",
                                 move.position, move.velocity),
                     move, moving({axis}));
    }
    case 1: {
      const machine::MoveRounds move{axis, input.number(3.0), input.number(config.max_speed)};
      return request(fmt::format("move {} by {} rounds at {}", axis, move.rounds, move.velocity),
                     move, moving({axis}));
    }
    case 2: {
      const std::size_t other = (axis + 1 + input.any(2)) % search::kAxes;
      const machine::MoveLine line{{axis, other},
                                   {input.number(0.02), input.number(0.02)},
                                   input.any(2) == 1,
                                   input.any(4) == 0 ? input.number(config.max_speed) : 0.0,
                                   input.any(4) == 0 ? input.number(3.0) : 0.0};
      const std::string name = fmt::format("line of {} and {} {} {} and {} at {} or in {} s", axis,
                                           other, line.relative ? "by" : "to", line.positions[0],
                                           line.positions[1], line.velocity, line.duration);
      return request(name, line, moving({axis, other}));
    }
    case 3: {
      const double velocity = input.number(config.max_speed);
      return request(fmt::format("jog {} at {}", axis, velocity), machine::Jog{axis, velocity, {}},
                     moving({axis}));
    }
    case 8: {
      const std::size_t other = (axis + 1) % search::kAxes;
      const bool positions = input.any(2) == 1;
      const double most = positions ? 0.02 : config.max_speed;
      machine::FollowSetpoints wanted{
          positions ? machine::SetpointMode::kPosition : machine::SetpointMode::kVelocity,
          input.between(0.01, 0.3),
          {}};
      for (const std::size_t moved : {axis, other}) {
        wanted.setpoints.push_back({moved, input.number(most), {}});
      }
      const std::string name = fmt::format(
          "{} of {} and {}: {} and {} within {} s", positions ? "setpoints" : "velocities", axis,
          other, wanted.setpoints[0].value, wanted.setpoints[1].value, wanted.timeout);
      return request(name, wanted, moving({axis, other}));
    }
    case 9: {
      const std::size_t other = (axis + 1) % search::kAxes;
      const machine::JogTogether jogs{{{axis, input.number(config.max_speed), {}},
                                       {other, input.number(configs.at(other).max_speed), {}}}};
      const std::string name = fmt::format("jog {} and {} at {} and {}", axis, other,
                                           jogs.jogs[0].velocity, jogs.jogs[1].velocity);
      return request(name, jogs, moving({axis, other}));
    }
    case 4: {
      axis::AxisLimits limits;
      limits.max_speed = input.inDecades(1.1 * config.max_speed);
      limits.acceleration = input.inDecades(1.1 * config.acceleration);
      limits.deceleration = input.inDecades(1.1 * config.deceleration);
      if (input.any(2) == 1)
        limits.jerk = input.inDecades(config.jerk > 0.0 ? 1.1 * config.jerk : 60.0);
      const std::string name = fmt::format("limits of {}: {} {} {} {}", axis, limits.max_speed,
                                           limits.acceleration, limits.deceleration, limits.jerk);
      return request(name, machine::SetLimits{axis, limits}, {});
    }
    case 5: {
      const double position = input.number(0.02);
      return request(fmt::format("position of {} is {}", axis, position),
                     machine::SetPosition{axis, position}, {});
    }
    case 6: {
      const double factor = std::max(0.01, input.inDecades(2.0));  // as setSpeedOverride() allows
      return request(fmt::format("override {}", factor), machine::SetSpeedOverride{factor}, {});
    }
    case 7: {
      const double size = input.number(0.012);
      const std::size_t other = (axis + 1) % search::kAxes;
      return {fmt::format("trajectory of {} and {}, {}", axis, other, size),
              [=](Participants& all, int client) {
                all.postTrajectory(client, {axis, other}, size);
              }};
    }
    case 10: {
      const double size = input.number(0.012);
      const std::size_t other = (axis + 1) % search::kAxes;
      return {fmt::format("trajectory of {} and {} that begins later, {}", axis, other, size),
              [=](Participants& all, int client) {
                all.postLaterTrajectory(client, {axis, other}, size);
              }};
    }
    case 11: {
      const double size = input.number(0.012);
      const std::size_t other = (axis + 1) % search::kAxes;
      return {fmt::format("path of {} and {} that is fed, {}", axis, other, size),
              [=](Participants& all, int client) {
                all.postPath(client, {axis, other}, size);
              }};
    }
    case 12: {
      const double size = input.number(0.012);
      const bool is_last = input.any(2) == 1;
      return {
          fmt::format("append to the path of {}, {}{}", axis, size, is_last ? ", the last" : ""),
          [=](Participants& all, int client) { all.appendToPath(client, axis, size, is_last); }};
    }
    case 13: {
      const double first = std::max(1e-6, input.inDecades(1e-3));
      return search::slowPath(first, std::max(1e-6, input.inDecades(1e-3)));
    }
    default: {
      const int microsteps = static_cast<int>(input.any(34)) - 1;
      return request(fmt::format("{} microsteps of {}", microsteps, axis),
                     machine::SetMicrosteps{axis, microsteps}, moving({axis}));
    }
  }
}

search::Schedule readSchedule(Input input) {
  search::Schedule schedule;
  const std::uint8_t kind = input.byte();
  schedule.variant = static_cast<int>(kind % search::kVariants);
  schedule.may_last = true;
  const bool is_drawn = kind >= 128;
  if (is_drawn) {
    schedule.machine =
        search::drawMachine(schedule.variant, [&input] { return input.byte() / 255.0; });
  }
  const std::vector<config::AxisConfig> configs =
      is_drawn ? schedule.machine : search::configsOf(schedule.variant);
  while (!input.isOver() && schedule.items.size() < kMostItems) {
    const std::uint8_t what = input.byte();
    if (what >= 240 && schedule.deviations.size() < kMostDeviations) {
      search::Deviation deviation;
      deviation.from = 4 * static_cast<std::size_t>(input.byte());
      deviation.who = static_cast<search::Who>(input.any(search::kParticipants));
      deviation.steps = 1 + kSteps.at(input.any(kSteps.size()));
      schedule.deviations.push_back(deviation);
      continue;
    }
    search::Item item;
    item.client = static_cast<int>(input.any(2));
    item.after = kSteps.at(input.any(kSteps.size()));
    if (what < 2 * search::acts().size()) {
      item.act = what / 2;
    } else {
      item.own = std::make_shared<const Act>(readAct(input, configs));
    }
    schedule.items.push_back(item);
  }
  return schedule;
}

/// What happened, step by step.
std::string storyOf(const search::Schedule& schedule, const std::vector<std::string>& complaints) {
  std::string story;
  for (const std::string& complaint : complaints) story += complaint + "\n";
  story += fmt::format("variant {}\n", schedule.variant);
  for (const config::AxisConfig& axis : schedule.machine)
    story += "  " + search::describe(axis) + "\n";
  for (const search::Item& item : schedule.items) {
    story += fmt::format("  client {}, after {} steps: {}\n", item.client == 0 ? "A" : "B",
                         item.after, search::actOf(item).name);
  }
  for (const search::Deviation& deviation : schedule.deviations) {
    story += fmt::format("  from step {} on {} waits for {} steps\n", deviation.from,
                         search::nameOf(deviation.who), deviation.steps);
  }
  Participants again(schedule);
  again.keepLog();
  again.run();
  for (const std::string& line : again.log()) story += "    " + line + "\n";
  return story;
}

}  // namespace
}  // namespace stepdriver::fuzz

// NOLINTNEXTLINE(readability-identifier-naming): the name that libFuzzer calls
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stepdriver;
  const search::Schedule schedule = fuzz::readSchedule(fuzz::Input(data, size));
  const auto complaints = search::Participants(schedule).run();
  if (!complaints.empty()) fuzz::require(false, fuzz::storyOf(schedule, complaints));
  return 0;
}
