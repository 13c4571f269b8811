#include "storm/oracle.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

// Each promise of the oracle, kept and broken. Times are in milliseconds; the rig's clock began at
// 1000, and is read every 10 ms until 6000.

namespace stepdriver::storm {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kOffset = 1000;
constexpr double kStepsPerMetre = 20'000.0;

Request requestOf(Kind kind, std::int64_t sent, std::int64_t answered) {
  Request request;
  request.kind = kind;
  request.axes = 1;
  request.text = "request";
  request.sent = sent * kMs;
  request.answered = answered * kMs;
  request.success = true;
  return request;
}

/// One axis that needs 200 ms to stop, and a pulse each millisecond of the rig's clock in [begin,
/// end).
class OneAxis {
 public:
  OneAxis() {
    AxisFacts facts;
    facts.name = "x";
    facts.longest_stop = 0.2;
    facts.steps_per_metre = kStepsPerMetre;
    facts.min_position = -0.05;
    facts.max_position = 0.15;
    seen_.axes = {facts};
    seen_.pulses.resize(1);
    seen_.switches.resize(1);
    for (std::int64_t time = kOffset; time <= 6000; time += 10) {
      const std::int64_t at = time * kMs;
      seen_.clock.push_back({at, at - kOffset * kMs, at});
    }
  }

  void move(std::int64_t begin, std::int64_t end) {
    for (std::int64_t time = begin; time < end; ++time) {
      seen_.pulses[0].push_back({time * kMs, count() + 1});
    }
  }
  /// A pulse each millisecond, that many forward, or if it is negative backward, and as many back.
  void moveAndReturn(std::int64_t begin, std::int64_t steps) {
    const std::int64_t before = count();
    const std::int64_t way = steps < 0 ? -1 : 1;
    for (std::int64_t i = 1; i <= 2 * way * steps; ++i) {
      seen_.pulses[0].push_back(
          {(begin + i) * kMs, before + way * (i <= way * steps ? i : 2 * way * steps - i)});
    }
  }
  void ask(const Request& request) { seen_.requests.push_back(request); }
  void rest(std::int64_t time, double position, bool alone = false) {
    seen_.rests.push_back({time * kMs, {position}, {true}, alone});
  }
  void stall(std::int64_t begin, std::int64_t end) {
    seen_.stalls.push_back({begin * kMs, end * kMs});
  }
  /// The rig's clock stands still in between, and catches up at once.
  void fallBehind(std::int64_t begin, std::int64_t end) {
    for (ClockReading& reading : seen_.clock) {
      if (reading.before < begin * kMs || reading.after >= end * kMs) continue;
      reading.rig = (begin - kOffset) * kMs;
    }
  }
  void switchOutput(std::int64_t time, bool on) { seen_.switches[0].push_back({time * kMs, on}); }
  /// The input changes, and a latch tells it 20 ms later.
  void latch(std::int64_t time, bool active, double told) {
    seen_.input.push_back({time * kMs, active});
    const std::size_t request = seen_.requests.size() - 1;
    seen_.latched.push_back({(time + kOffset + 20) * kMs, request, active, {told}});
  }
  void input(std::int64_t time, bool active) { seen_.input.push_back({time * kMs, active}); }
  void timeOutput(std::int64_t max_on, std::int64_t min_on, std::int64_t min_off) {
    seen_.outputs = {{"pump", true, max_on * kMs, min_on * kMs, min_off * kMs}};
  }
  void takePlay(double backlash) { seen_.axes[0].backlash = backlash; }
  std::size_t broken() const { return brokenPromises(seen_).size(); }

 private:
  std::int64_t count() const { return seen_.pulses[0].empty() ? 0 : seen_.pulses[0].back().count; }

  Observation seen_;
};

/// A move that is under way, and an ending at 3000 that is answered at 3010.
OneAxis endedBy(Kind kind, std::int64_t last_pulse) {
  OneAxis axis;
  axis.ask(requestOf(Kind::kMotion, 2000, 2005));
  axis.move(1005, last_pulse);
  axis.ask(requestOf(kind, 3000, 3010));
  return axis;
}

TEST(Oracle, LetsAStopDecelerate) {
  EXPECT_EQ(endedBy(Kind::kStop, 2220).broken(), 0U);
  EXPECT_EQ(endedBy(Kind::kStop, 2240).broken(), 1U);
  EXPECT_EQ(endedBy(Kind::kHold, 2220).broken(), 0U);
  EXPECT_EQ(endedBy(Kind::kHold, 2240).broken(), 1U);
}

TEST(Oracle, LetsNoPulseFollowADisableOrAnEmergencyStop) {
  for (const Kind kind : {Kind::kDisable, Kind::kSleep, Kind::kEmergencyStop}) {
    EXPECT_EQ(endedBy(kind, 2010).broken(), 0U);
    EXPECT_EQ(endedBy(kind, 2015).broken(), 1U);
  }
}

TEST(Oracle, FindsLatchedPositionsAtEdgesOfTheInput) {
  for (const std::int64_t beside : {0, 10}) {
    OneAxis axis;
    axis.rest(1500, 0.0);
    axis.ask(requestOf(Kind::kMotion, 2000, 2005));
    axis.move(1005, 3005);
    axis.latch(2004, true, static_cast<double>(1000 + beside) / kStepsPerMetre);
    EXPECT_EQ(axis.broken(), beside == 0 ? 0U : 1U);
  }
}

TEST(Oracle, WantsTheEdgesOfALatchInItsWindow) {
  for (const double from : {0.04, 0.06}) {
    OneAxis axis;
    axis.rest(1500, 0.0);
    Request latch = requestOf(Kind::kOther, 2000, 2005);
    latch.window = WindowOrder{0, from, 0.07};
    axis.ask(latch);
    axis.move(1005, 3005);
    axis.latch(2004, true, 1000 / kStepsPerMetre);
    EXPECT_EQ(axis.broken(), from == 0.04 ? 0U : 1U);
  }
}

TEST(Oracle, FindsContactsAtEdgesOfTheInput) {
  struct Case {
    std::int64_t told;  // [steps]
    bool active;
    std::int64_t play;  // [steps]
    bool is_right;
  };
  for (const Case& each : std::vector<Case>{{1000, true, 0, true},
                                            {1002, true, 0, false},
                                            {1000, false, 0, false},
                                            {990, true, 10, true},
                                            {1000, true, 10, false}}) {
    OneAxis axis;
    axis.takePlay(static_cast<double>(each.play) / kStepsPerMetre);
    // Up and down again: nothing of it is taken up, and the way up begins with it.
    if (each.play > 0) axis.moveAndReturn(200, 20);
    axis.rest(1500, 0.0);
    Request probe = requestOf(Kind::kMotion, 2000, 3500);
    probe.probe = ProbeOrder{0, each.active};
    probe.answer.contact = static_cast<double>(each.told) / kStepsPerMetre;
    axis.ask(probe);
    axis.move(1005, 3005);
    axis.input(2004, true);
    EXPECT_EQ(axis.broken(), each.is_right ? 0U : 1U) << each.told << ' ' << each.play;
  }
}

/// Pulses of 5 ms each 200 steps from step 100 to step 900, and a motion alone of 1000 steps to
/// there, a step each millisecond from 1005 on.
OneAxis passing(const std::vector<std::int64_t>& on, int direction = 0, std::int64_t length = 5) {
  OneAxis axis;
  CompareOrder order;
  order.has_pulses = true;
  order.direction = direction;
  order.distance = 200.0 / kStepsPerMetre;
  order.begin = 100.0 / kStepsPerMetre;
  order.end = 900.0 / kStepsPerMetre;
  order.pulse = 5e-3;
  Request compare = requestOf(Kind::kOther, 1100, 1110);
  compare.compare = order;
  axis.ask(compare);
  axis.rest(1500, 0.0);
  axis.ask(requestOf(Kind::kMotion, 2000, 2005));
  axis.move(1005, 2005);
  for (const std::int64_t count : on) {
    axis.switchOutput(1004 + count, true);
    axis.switchOutput(1004 + count + length, false);
  }
  axis.rest(3500, 1000.0 / kStepsPerMetre, true);
  return axis;
}

TEST(Oracle, WantsAPulseAtEachPassageOfAPlace) {
  EXPECT_EQ(passing({100, 300, 500, 700, 900}).broken(), 0U);
  EXPECT_EQ(passing({100, 300, 700, 900}).broken(), 1U);
  EXPECT_EQ(passing({100, 303, 500, 700, 900}).broken(), 2U) << "there, and not at the place";
  EXPECT_EQ(passing({100, 300, 400, 500, 700, 900}).broken(), 1U);
}

TEST(Oracle, WantsPulsesInTheirDirection) {
  EXPECT_EQ(passing({}, -1).broken(), 0U);
  EXPECT_EQ(passing({300}, -1).broken(), 1U);
  EXPECT_EQ(passing({100, 300, 500, 700, 900}, 1).broken(), 0U);
}

TEST(Oracle, LetsNoPulseLastTooLong) {
  EXPECT_EQ(passing({100, 300, 500, 700, 900}, 1, 6).broken(), 5U);
  EXPECT_EQ(passing({100, 300, 500, 700, 900}, 1, 4).broken(), 0U) << "the safe state ends one";
}

/// A path alone with marks at steps 200 and 600, the first one 10 ms before its place.
OneAxis marked(const std::vector<std::int64_t>& changes) {
  OneAxis axis;
  axis.rest(1500, 0.0);
  Request path = requestOf(Kind::kMotion, 2000, 2005);
  path.path_axes = {0};
  path.marks = {{0, true, 0.01, {200.0 / kStepsPerMetre}},
                {0, false, 0.0, {600.0 / kStepsPerMetre}}};
  axis.ask(path);
  axis.move(1005, 2005);
  bool on = false;
  for (const std::int64_t count : changes) axis.switchOutput(1004 + count, on = !on);
  axis.rest(3500, 1000.0 / kStepsPerMetre, true);
  return axis;
}

TEST(Oracle, WantsEachMarkOfAPathOnceAtItsPlace) {
  EXPECT_EQ(marked({190, 600}).broken(), 0U);
  EXPECT_EQ(marked({200, 600}).broken(), 1U) << "without its lead";
  EXPECT_EQ(marked({190, 604}).broken(), 1U);
  EXPECT_EQ(marked({190}).broken(), 1U);
  EXPECT_EQ(marked({190, 600, 800}).broken(), 1U);
}

TEST(Oracle, WantsTheTimesOfAnOutput) {
  const auto switched = [](const std::vector<std::int64_t>& times) {
    OneAxis axis;
    axis.timeOutput(500, 30, 40);
    axis.ask(requestOf(Kind::kEmergencyStop, 5000, 5010));
    bool on = false;
    for (const std::int64_t time : times) axis.switchOutput(time, on = !on);
    return axis.broken();
  };
  EXPECT_EQ(switched({1000, 1500, 1540, 1570}), 0U);
  EXPECT_EQ(switched({1000, 1530}), 1U);
  EXPECT_EQ(switched({1000, 1500, 1539, 1580}), 1U);
  EXPECT_EQ(switched({1000, 1029}), 1U);
  EXPECT_EQ(switched({3990, 4005}), 0U) << "by the emergency stop";
}

TEST(Oracle, LetsNoOutputBeOnFromAnEmergencyStopToTheNextRecover) {
  for (const std::int64_t off : {2005, 2015}) {
    OneAxis axis = endedBy(Kind::kEmergencyStop, 2000);
    axis.switchOutput(1500, true);
    axis.switchOutput(off, false);
    EXPECT_EQ(axis.broken(), off < 2010 ? 0U : 1U) << off;
  }
  for (const std::int64_t on : {2500, 3200}) {
    OneAxis axis = endedBy(Kind::kEmergencyStop, 2000);
    axis.ask(requestOf(Kind::kRecover, 4000, 4010));
    axis.switchOutput(on, true);
    EXPECT_EQ(axis.broken(), on > 3000 ? 0U : 1U) << on;
  }
}

TEST(Oracle, HoldsAnAnsweredSwitchAgainstTheOutput) {
  for (const bool on : {true, false}) {
    // It begins off, and is switched on at 2050 and off at 2150.
    for (const std::int64_t sent : {2900, 3000, 3100}) {
      OneAxis axis;
      Request request = requestOf(Kind::kOther, sent, sent + 60);
      request.output = OutputOrder{0, on};
      axis.ask(request);
      axis.switchOutput(2050, true);
      axis.switchOutput(2150, false);
      const bool was_so = on ? sent != 2900 : true;
      EXPECT_EQ(axis.broken(), was_so ? 0U : 1U) << on << " at " << sent;
    }
    OneAxis axis;
    Request request = requestOf(Kind::kOther, 3070, 3100);
    request.output = OutputOrder{0, on};
    axis.ask(request);
    axis.switchOutput(2050, true);
    axis.switchOutput(2150, false);
    EXPECT_EQ(axis.broken(), on ? 0U : 1U);
  }
}

TEST(Oracle, LetsANewerMotionFollowAStop) {
  OneAxis axis = endedBy(Kind::kStop, 2200);
  axis.ask(requestOf(Kind::kMotion, 4000, 4005));
  axis.move(3005, 3500);
  EXPECT_EQ(axis.broken(), 0U);
}

TEST(Oracle, HoldsBothOrdersOfRequestsAtOneTimeForPossible) {
  OneAxis axis = endedBy(Kind::kStop, 2200);
  axis.ask(requestOf(Kind::kMotion, 2990, 3005));
  axis.move(2500, 2600);
  EXPECT_EQ(axis.broken(), 0U);
}

TEST(Oracle, KnowsThatALineThatCameLongBeforeAStopIsOlder) {
  OneAxis axis = endedBy(Kind::kStop, 2200);
  axis.ask(requestOf(Kind::kMotion, 2600, 3100));  // it waited until its axes were at rest
  axis.move(2500, 2600);
  EXPECT_EQ(axis.broken(), 1U);
}

TEST(Oracle, DoesNotTrustTheOrderWhileTheComputerStalls) {
  OneAxis axis = endedBy(Kind::kStop, 2200);
  axis.ask(requestOf(Kind::kMotion, 2600, 3100));
  axis.stall(2650, 2950);
  axis.move(2500, 2600);
  EXPECT_EQ(axis.broken(), 0U);
}

TEST(Oracle, KnowsHowFarTheRigsClockIsBehind) {
  for (const bool behind : {true, false}) {
    OneAxis axis = endedBy(Kind::kStop, 2200);
    if (behind) axis.fallBehind(3300, 4300);
    axis.ask(requestOf(Kind::kMotion, 4200, 4205));
    axis.move(2301, 2600);
    EXPECT_EQ(axis.broken(), behind ? 0U : 1U);
  }
}

TEST(Oracle, FindsPulsesAfterAnEndingThoughTheRigsClockIsBehind) {
  for (const bool behind : {true, false}) {
    OneAxis axis = endedBy(Kind::kDisable, 2005);
    if (behind) axis.fallBehind(2950, 3100);
    EXPECT_EQ(axis.broken(), behind ? 1U : 0U);
  }
}

TEST(Oracle, LetsNoMotionFollowUntilItIsAllowedAgain) {
  for (const auto& [end, again] :
       std::vector<std::pair<Kind, Kind>>{{Kind::kDisable, Kind::kEnable},
                                          {Kind::kSleep, Kind::kWake},
                                          {Kind::kHold, Kind::kResume},
                                          {Kind::kEmergencyStop, Kind::kRecover}}) {
    OneAxis forbidden = endedBy(end, 2000);
    forbidden.ask(requestOf(Kind::kMotion, 4000, 4005));
    forbidden.move(3005, 3500);
    EXPECT_EQ(forbidden.broken(), 1U);

    OneAxis allowed = endedBy(end, 2000);
    allowed.ask(requestOf(again, 3800, 3810));
    allowed.ask(requestOf(Kind::kMotion, 4000, 4005));
    allowed.move(3005, 3500);
    EXPECT_EQ(allowed.broken(), 0U);
  }
}

TEST(Oracle, TakesAJogForOneRequestFromItsBeginOn) {
  OneAxis axis = endedBy(Kind::kStop, 2200);
  Request jog = requestOf(Kind::kJog, 2000, 0);
  jog.answered.reset();
  jog.has_answer = false;
  axis.ask(jog);
  axis.move(2800, 3000);
  EXPECT_EQ(axis.broken(), 1U);
}

TEST(Oracle, LetsALineThatFailsTakeUpBacklashBeforeItsAnswerAndNoMore) {
  for (const std::int64_t last : {3220, 3300}) {
    OneAxis axis = endedBy(Kind::kStop, 2200);
    Request failed = requestOf(Kind::kMotion, 4000, 4005);
    failed.success = false;
    failed.message = "the line doesn't begin: a stop has come";
    axis.ask(failed);
    axis.move(3002, last);
    EXPECT_EQ(axis.broken(), last == 3220 ? 0U : 1U);
  }
}

TEST(Oracle, HoldsASuccessAgainstTheTarget) {
  for (const double told : {0.05, 0.044}) {
    OneAxis axis;
    Request line = requestOf(Kind::kMotion, 2000, 2600);
    line.waits = true;
    line.answer.arrivals = {{0, 0.05, told}};
    axis.ask(line);
    EXPECT_EQ(axis.broken(), told == 0.05 ? 0U : 1U);
  }
}

TEST(Oracle, WantsAReasonFromEachFailure) {
  for (const char* const message : {"x: the axis is asleep", ""}) {
    OneAxis axis;
    Request refused = requestOf(Kind::kMotion, 2000, 2010);
    refused.success = false;
    refused.message = message;
    axis.ask(refused);
    EXPECT_EQ(axis.broken(), *message != '\0' ? 0U : 1U);
  }
}

TEST(Oracle, HoldsPositionsAgainstTheCountOfThePulses) {
  for (const double position : {0.015, 0.01505}) {
    OneAxis axis;
    axis.ask(requestOf(Kind::kMotion, 2000, 2005));
    axis.rest(1500, 0.01);
    axis.move(1005, 1105);
    axis.rest(2500, position);
    EXPECT_EQ(axis.broken(), position == 0.015 ? 0U : 1U);
  }
}

// The position at the end is right both times.
TEST(Oracle, HoldsTheWayAgainstTheOnlyRequest) {
  for (const bool relative : {false, true}) {
    for (const std::int64_t steps : {200, 204}) {
      OneAxis axis;
      axis.rest(1500, 0.01);
      Request path = requestOf(Kind::kMotion, 2000, 2005);
      path.reaches = {{0, relative ? -0.001 : 0.009, relative ? 0.01 : 0.02, relative}};
      axis.ask(path);
      axis.moveAndReturn(1005, steps);
      axis.rest(2900, 0.01);
      EXPECT_EQ(axis.broken(), steps == 200 ? 0U : 1U);
    }
  }
}

TEST(Oracle, HoldsTheWayOfSeveralRequestsAgainstTheSoftLimits) {
  for (const std::int64_t steps : {200, 204}) {
    OneAxis axis;
    axis.rest(1500, 0.14);
    for (const std::int64_t sent : {2000, 2010}) {
      Request path = requestOf(Kind::kMotion, sent, sent + 5);
      path.reaches = {{0, 0.0, 0.001, true}};
      axis.ask(path);
    }
    axis.moveAndReturn(1015, steps);
    axis.rest(2900, 0.14);
    EXPECT_EQ(axis.broken(), steps == 200 ? 0U : 1U);
  }
}

TEST(Oracle, LetsAPositionBeSet) {
  OneAxis axis;
  axis.rest(1500, 0.01);
  axis.ask(requestOf(Kind::kSetPosition, 1600, 1605));
  axis.rest(2500, 0.05);
  EXPECT_EQ(axis.broken(), 0U);
}

}  // namespace
}  // namespace stepdriver::storm
