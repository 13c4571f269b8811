#include <fmt/format.h>

#include <cerrno>
#include <stdexcept>

#include "search/participants.h"
#include "support/constants.h"

/// The acts that a script is made of.
namespace stepdriver::search {
namespace {

constexpr std::size_t kX = 0;
constexpr std::size_t kY = 1;
constexpr std::size_t kZ = 2;

Meaning about(const std::vector<std::size_t>& axes) {
  Meaning meaning;
  for (const std::size_t axis : axes) meaning.axes[axis] = true;
  return meaning;
}

Meaning moving(const std::vector<std::size_t>& axes) {
  Meaning meaning = about(axes);
  meaning.moves = true;
  return meaning;
}

Meaning quiet(Meaning::Quiet kind, const std::vector<std::size_t>& axes) {
  Meaning meaning = about(axes);
  meaning.quiet = kind;
  return meaning;
}

Act request(const std::string& name, const machine::Request& wanted, const Meaning& meaning) {
  return {name, [=](Participants& all, int client) { all.post(client, name, wanted, meaning); }};
}

using test::kMillisecond;

/// While z still decelerates at the configured jerk it gets a target within a lower one, and is
/// stopped again. The pauses differ with the steps before.
std::deque<Turn> turns(std::size_t steps) {
  const auto pause = static_cast<pulse::Nanoseconds>(20 + steps % 7 * 5) * kMillisecond;
  const auto short_pause = static_cast<pulse::Nanoseconds>(1 + steps % 5 * 4) * kMillisecond;
  axis::AxisLimits smooth;
  smooth.jerk = 5.0;
  const Meaning slows_down = quiet(Meaning::Quiet::kSlowsDown, {kZ});
  const machine::MoveTo move{kZ, 0.012, false, 0.0};
  return {{0, request("smooth limits of z", machine::SetLimits{kZ, smooth}, {})},
          {0, request("jog z", machine::Jog{kZ, 0.05, {}}, moving({kZ}))},
          {230 * kMillisecond, request("stop z", machine::StopAxis{kZ}, slows_down)},
          {pause, request("move z to 12 mm", move, moving({kZ}))},
          {short_pause, request("stop z", machine::StopAxis{kZ}, slows_down)}};
}

/// The limits of z are lowered while it speeds up, moves or slows down to a target, and it is
/// stopped. The pauses differ with the steps before.
std::deque<Turn> lowers(std::size_t steps) {
  const auto pause = static_cast<pulse::Nanoseconds>(3 + steps % 11 * 15) * kMillisecond;
  const auto short_pause = static_cast<pulse::Nanoseconds>(1 + steps % 5 * 9) * kMillisecond;
  axis::AxisLimits slow;
  slow.acceleration = slow.deceleration = 0.3;
  axis::AxisLimits smooth;
  smooth.jerk = 0.5;
  const machine::MoveTo move{kZ, 0.004, true, 0.0};
  const Meaning slows_down = quiet(Meaning::Quiet::kSlowsDown, {kZ});
  return {{0, request("move z by 4 mm", move, moving({kZ}))},
          {pause, request("low jerk of z", machine::SetLimits{kZ, smooth}, {})},
          {short_pause, request("override 0.7", machine::SetSpeedOverride{0.7}, {})},
          {short_pause, request("low accelerations of z", machine::SetLimits{kZ, slow}, {})},
          {short_pause, request("stop z", machine::StopAxis{kZ}, slows_down)},
          {short_pause, request("all limits of z", machine::SetLimits{kZ, {}}, {})}};
}

Act append(const std::string& name, double size, bool is_last) {
  return {name,
          [=](Participants& all, int client) { all.appendToPath(client, kX, size, is_last); }};
}

Act beginPath() {
  return {"begin a path of x and y", [](Participants& all, int client) {
            all.postPath(client, {kX, kY}, 0.006);
          }};
}

/// The path is ended in motion, or when it waits at its end. It ends with a segment, or with
/// nothing but the end.
std::deque<Turn> feeds(std::size_t steps) {
  const auto pause = static_cast<pulse::Nanoseconds>(1 + steps % 13 * 30) * kMillisecond;
  return {{0, beginPath()}, {pause, append("end the path", steps % 2 == 0 ? 0.0 : 0.002, true)}};
}

/// The path is held in motion, or when it waits at its end. The pauses differ with the steps
/// before.
std::deque<Turn> holdsAndFeeds(std::size_t steps) {
  const auto pause = [steps](std::size_t divisor) {
    return static_cast<pulse::Nanoseconds>(1 + steps / divisor % 3 * 200) * kMillisecond;
  };
  const std::vector<std::size_t> every = {kX, kY, kZ};
  Meaning resumes = about(every);
  resumes.resumes = true;
  return {{0, beginPath()},
          {pause(1), append("append to the path", 0.004, false)},
          {pause(3), request("hold", machine::Hold{}, quiet(Meaning::Quiet::kHeld, every))},
          {pause(9), request("resume", machine::Resume{}, resumes)},
          {pause(27), append("tell the end of the path", 0.0, true)}};
}

/// Its position must be known for that.
std::deque<Turn> comparesTool(std::size_t /*steps*/) {
  const Act compare{"the position of y switches the tool",
                    [](Participants& all, int client) { all.compareTool(client); }};
  return {{0, request("position of y", machine::SetPosition{kY, 0.0}, {})},
          {kMillisecond, compare}};
}

/// An act of several acts, which differ with the steps before.
Act inTurn(const std::string& name, std::deque<Turn> (*turns_after)(std::size_t steps)) {
  return {name,
          [=](Participants& all, int client) { all.postInTurn(client, turns_after(all.steps())); }};
}

machine::FollowSetpoints positions(const std::vector<machine::Setpoint>& setpoints) {
  return {machine::SetpointMode::kPosition, 0.1, setpoints};
}

std::vector<Act> makeActs() {
  using Quiet = Meaning::Quiet;
  const std::vector<std::size_t> every = {kX, kY, kZ};
  Meaning stops = quiet(Quiet::kSlowsDown, every);
  stops.ends_hold = true;
  Meaning resumes = about(every);
  resumes.resumes = true;
  Meaning recovers = about(every);
  recovers.recovers = true;
  axis::AxisLimits slow;
  slow.max_speed = 0.03;
  slow.acceleration = slow.deceleration = 1.0;
  axis::AxisLimits gentle;
  gentle.acceleration = gentle.deceleration = 0.3;
  gentle.jerk = 5.0;
  axis::AxisLimits too_low;
  too_low.acceleration = 1e-9;
  return {
      request("move x to 8 mm", machine::MoveTo{kX, 0.008, false, 0.0}, moving({kX})),
      request("move x by -6 mm", machine::MoveTo{kX, -0.006, true, 0.0}, moving({kX})),
      request("move y by 7 mm", machine::MoveTo{kY, 0.007, true, 0.0}, moving({kY})),
      request("move y to -5 mm", machine::MoveTo{kY, -0.005, false, 0.06}, moving({kY})),
      request("move z to 6 mm", machine::MoveTo{kZ, 0.006, false, 0.0}, moving({kZ})),
      request("move x by a round", machine::MoveRounds{kX, 1.0, 0.0}, moving({kX})),
      request("line of x and y", machine::MoveLine{{kX, kY}, {0.006, 0.005}, false, 0.0, 0.0},
              moving({kX, kY})),
      request("line of y and z by", machine::MoveLine{{kY, kZ}, {-0.005, 0.005}, true, 0.0, 0.0},
              moving({kY, kZ})),
      inTurn("stop z, move it at a lower jerk, and stop it", turns),
      inTurn("lower the limits of z while it moves, and stop it", lowers),
      {"trajectory of x and y",
       [](Participants& all, int client) {
         all.postTrajectory(client, {kX, kY}, 0.008);
       }},
      {"trajectory of x and z",
       [](Participants& all, int client) {
         all.postTrajectory(client, {kX, kZ}, 0.006);
       }},
      {"trajectory of z",
       [](Participants& all, int client) { all.postTrajectory(client, {kZ}, 0.006); }},
      {"trajectory of x and y that begins later",
       [](Participants& all, int client) {
         all.postLaterTrajectory(client, {kX, kY}, 0.008);
       }},
      {"trajectory of z that begins later",
       [](Participants& all, int client) { all.postLaterTrajectory(client, {kZ}, 0.006); }},
      inTurn("path of x and y that is fed", feeds),
      append("append to the path", 0.004, false),
      append("append to the path, and end it", 0.002, true),
      append("tell the end of the path", 0.0, true),
      request("jog x", machine::Jog{kX, 0.05, {}}, moving({kX})),
      request("jog z back", machine::Jog{kZ, -0.05, {}}, moving({kZ})),
      request("end the jog of x", machine::Jog{kX, 0.0, {}}, {}),
      {"stream a jog of x", [](Participants& all, int client) { all.streamJog(client, kX); }},
      request("jog x and z", machine::JogTogether{{{kZ, -0.04, {}}, {kX, 0.05, {}}}},
              moving({kX, kZ})),
      request("end the jog of x, and jog y", machine::JogTogether{{{kX, 0.0, {}}, {kY, 0.05, {}}}},
              moving({kX, kY})),
      request("setpoints of x and y", positions({{kX, 0.006, {}}, {kY, -0.004, {}}}),
              moving({kX, kY})),
      request("velocities of y and z",
              machine::FollowSetpoints{
                  machine::SetpointMode::kVelocity, 0.1, {{kY, -0.05, {}}, {kZ, 0.04, {}}}},
              moving({kY, kZ})),
      {"stream setpoints of x and z",
       [](Participants& all, int client) {
         all.streamSetpoints(client, {kX, kZ});
       }},
      request("home x", machine::Home{{kX}, false}, moving({kX})),
      request("home y", machine::Home{{kY}, false}, moving({kY})),
      request("home z", machine::Home{{kZ}, false}, moving({kZ})),
      {"cancel homing", [](Participants& all, int client) { all.cancelHomings(client); }},
      request("plan x", machine::PlanMove{{kX, 0.004, true, 0.0}}, {}),
      request("microsteps of x", machine::SetMicrosteps{kX, 8}, moving({kX})),
      request("microsteps of y", machine::SetMicrosteps{kY, 1}, moving({kY})),
      request("disable x", machine::Enable{{kX}, false}, quiet(Quiet::kAtRest, {kX})),
      request("enable x", machine::Enable{{kX}, true}, {}),
      request("disable y", machine::Enable{{kY}, false}, quiet(Quiet::kAtRest, {kY})),
      request("disable z", machine::Enable{{kZ}, false}, quiet(Quiet::kAtRest, {kZ})),
      request("enable z", machine::Enable{{kZ}, true}, {}),
      request("sleep x", machine::Sleep{kX, true}, quiet(Quiet::kAtRest, {kX})),
      request("wake x", machine::Sleep{kX, false}, {}),
      request("sleep z", machine::Sleep{kZ, true}, quiet(Quiet::kAtRest, {kZ})),
      request("reset x", machine::Reset{kX}, {}),
      request("stop", machine::StopAll{}, stops),
      request("stop x", machine::StopAxis{kX}, quiet(Quiet::kSlowsDown, {kX})),
      {"stop the last move of x",
       [](Participants& all, int client) { all.stopLastMove(client, kX); }},
      request("hold", machine::Hold{}, quiet(Quiet::kHeld, every)),
      request("resume", machine::Resume{}, resumes),
      request("override 0.4", machine::SetSpeedOverride{0.4}, {}),
      request("override 1.7", machine::SetSpeedOverride{1.7}, {}),
      request("limits of x", machine::SetLimits{kX, slow}, {}),
      request("gentle limits of x", machine::SetLimits{kX, gentle}, {}),
      request("gentle limits of y", machine::SetLimits{kY, gentle}, {}),
      request("too low limits of y", machine::SetLimits{kY, too_low}, {}),
      request("position of x", machine::SetPosition{kX, 0.001}, {}),
      {"emergency stop", [](Participants& all, int client) { all.emergencyStop(client); }},
      request("recover", machine::Recover{}, recovers),
      {"emergency stop, and recover at once",
       [=](Participants& all, int client) {
         all.emergencyStop(client);
         all.post(client, "recover", machine::Recover{}, recovers);
       }},
      {"press the emergency stop", [](Participants& all, int) { all.pressEmergencyStop(true); }},
      {"release the emergency stop", [](Participants& all, int) { all.pressEmergencyStop(false); }},
      {"press x", [](Participants& all, int) { all.pressSwitch(kX, true); }},
      {"release x", [](Participants& all, int) { all.pressSwitch(kX, false); }},
      {"press x, edge lost",
       [](Participants& all, int) {
         all.loseEdges();
         all.pressSwitch(kX, true);
       }},
      {"chip fault of x", [](Participants& all, int) { all.breakChip(kX); }},
      {"the motor power is lost", [](Participants& all, int) { all.loseMotorPower(); }},
      {"z is never in position", [](Participants& all, int) { all.neverInPosition(); }},
      {"steps of x fail", [](Participants& all, int) { all.failSteps(kX); }},
      {"turns of y fail", [](Participants& all, int) { all.failTurns(kY); }},
      {"switch of x can't be read", [](Participants& all, int) { all.failSwitch(kX); }},
      {"emergency stop can't be read", [](Participants& all, int) { all.failEmergencyStop(); }},
      {"lines work again", [](Participants& all, int) { all.mendLines(); }},
      {"a pin fails", [](Participants& all, int) { all.failNextPin(EIO); }},
      {"a pin hangs", [](Participants& all, int) { all.hangNextPin(600'000'000); }},
      {"a pin is slow", [](Participants& all, int) { all.hangNextPin(20'000'000); }},
      {"shut down", [](Participants& all, int client) { all.shutDown(client); }},
      inTurn("path of x and y that is held, resumed and ended", holdsAndFeeds),
      slowPath(40e-6, 1e-6),
      {"switch the tool on", [](Participants& all, int client) { all.switchTool(client, true); }},
      {"switch the tool off", [](Participants& all, int client) { all.switchTool(client, false); }},
      inTurn("the position of y switches the tool", comparesTool),
      {"probe with x",
       [](Participants& all, int client) { all.postProbing(client, {kX}, {0.008}, false); }},
      {"probe with x and y, away",
       [](Participants& all, int client) {
         all.postProbing(client, {kX, kY}, {-0.006, 0.005}, true);
       }},
      {"latch at the probe", [](Participants& all, int client) { all.beginLatch(client); }},
      {"end the latch", [](Participants& all, int client) { all.endLatches(client); }},
      {"path of x and y that switches the tool",
       [](Participants& all, int client) {
         all.postMarkedPath(client, {kX, kY}, 0.006);
       }},
  };
}

std::vector<Act> makeRegisterActs() {
  return {
      request("all microsteps of x", machine::SetMicrosteps{kX, 16}, moving({kX})),
      request("currents of x", machine::SetCurrent{kX, 0.5, 0.2}, {}),
      request("configured currents of x", machine::SetCurrent{kX, 0.0, 0.0}, {}),
      {"the chip of x is reset", [](Participants& all, int) { all.resetChip(); }},
      {"the chip of x is silent", [](Participants& all, int) { all.silenceChip(); }},
      {"the chip of x is hot", [](Participants& all, int) { all.heatChip(); }},
  };
}

}  // namespace

const std::vector<Act>& acts() {
  static const std::vector<Act> all = [] {
    std::vector<Act> made = makeActs();
    for (Act& act : makeRegisterActs()) made.push_back(std::move(act));
    return made;
  }();
  return all;
}

std::size_t actsOfAny() {
  static const std::size_t count = makeActs().size();
  return count;
}

Act slowPath(double first, double second) {
  const Act begin{"begin a slow path of x and y", [=](Participants& all, int client) {
                    all.postSlowPath(client, {kX, kY}, first, second);
                  }};
  const Act watch{"watch", [](Participants& /*all*/, int /*client*/) {}};
  return {fmt::format("slow path of x and y at {} and {} m/s", first, second),
          [=](Participants& all, int client) {
            all.postInTurn(client, {{0, begin}, {20'000 * kMillisecond, watch}});
          }};
}

const Act& actOf(const Item& item) { return item.own ? *item.own : acts().at(item.act); }

std::size_t actNamed(const std::string& name) {
  for (std::size_t i = 0; i < acts().size(); ++i) {
    if (acts()[i].name == name) return i;
  }
  throw std::out_of_range("there is no act " + name);
}

}  // namespace stepdriver::search
