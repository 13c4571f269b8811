#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "search/participants.h"

/// Schedules for which the search has found a broken promise.
namespace stepdriver::search {
namespace {

Item does(int client, std::size_t after, const std::string& act) {
  return {actNamed(act), client, after};
}

Item requests(int client, std::size_t after, const std::string& name,
              const machine::Request& wanted, const std::vector<std::size_t>& axes) {
  Meaning meaning;
  meaning.moves = true;
  for (const std::size_t axis : axes) meaning.axes[axis] = true;
  const Act act{name, [=](Participants& all, int by) { all.post(by, name, wanted, meaning); }};
  return {0, client, after, std::make_shared<const Act>(act)};
}

/// On the port that writes now, and on one that takes steps ahead of time.
void expectGood(const Schedule& schedule) {
  EXPECT_EQ(Participants(schedule).run(), std::vector<std::string>());
  for (const pulse::Nanoseconds horizon : {1'000'000, 50'000'000}) {
    Schedule ahead = schedule;
    ahead.ahead = Ahead{horizon, 0, 200'000};
    EXPECT_EQ(Participants(ahead).run(), std::vector<std::string>()) << "horizon " << horizon;
  }
}

TEST(FoundSchedules, APollThatDoesNotAskForTheMicrostepCounterLeavesItAsItWas) {
  expectGood(
      {kRegisters, {does(1, 0, "resume"), does(0, 0, "microsteps of x")}, {{20, Who::kNews, 40}}});
}

TEST(FoundSchedules, AMoveThatComesWhileAnAxisIsPutToSleepDoesNotStep) {
  expectGood({1, {does(0, 0, "sleep x"), does(1, 1, "move x by a round")}, {{3, Who::kNews, 40}}});
  expectGood({1, {does(0, 0, "sleep x"), does(1, 1, "move x to 8 mm")}, {{3, Who::kWriter, 10}}});
}

TEST(FoundSchedules, AChipFaultIsNotRecoveredFromByPuttingTheChipToSleep) {
  expectGood(
      {1,
       {does(1, 0, "chip fault of x"), does(1, 4, "move x by a round"), does(0, 200, "sleep x")},
       {}});
}

TEST(FoundSchedules, RecoverComesRightAfterAChipFault) {
  expectGood({1,
              {does(1, 8, "chip fault of x"), does(0, 2, "jog x"), does(1, 4, "a pin hangs"),
               does(0, 16, "recover")},
              {}});
}

TEST(FoundSchedules, ATrajectoryWhoseAxisWasStoppedBeforeItBeganHasNotReachedItsEnd) {
  expectGood({1,
              {does(1, 60, "trajectory of x and y"), does(0, 4, "move y to -5 mm"),
               does(1, 16, "move x to 8 mm")},
              {{14, Who::kNews, 40}}});
}

TEST(FoundSchedules, AChipFaultThatComesWhileARecoverWaitsIsRecoveredFrom) {
  expectGood({1,
              {does(1, 200, "jog x"), does(1, 8, "chip fault of x"), does(1, 0, "recover")},
              {{9, Who::kRequest, 200}}});
}

TEST(FoundSchedules, AnAxisThatMovesIsStoppedWhileATrajectoryWakesAnotherOne) {
  for (const char* stop : {"stop x", "stop", "hold", "disable x", "shut down"}) {
    expectGood({0,
                {does(0, 0, "jog x"), does(1, 200, "a pin is slow"),
                 does(0, 1, "trajectory of x and z"), does(1, 8, stop)},
                {}});
  }
}

TEST(FoundSchedules, AMoveEndsWhereItIsSaidToIfATrajectoryWakesAnotherAxis) {
  expectGood({0, {does(0, 0, "move x to 8 mm"), does(1, 200, "trajectory of x and z")}, {}});
}

TEST(FoundSchedules, RelativePositionsCountFromTheJointWhileItsBacklashIsTakenUp) {
  expectGood({0, {does(0, 0, "line of x and y"), does(1, 0, "move y by 7 mm")}, {}});
  expectGood({0, {does(0, 0, "line of x and y"), does(1, 4, "line of y and z by")}, {}});
}

TEST(FoundSchedules, AnAxisThatCouldNotJoinATrajectoryInTimeComesToRest) {
  expectGood({0,
              {does(0, 0, "jog z back"), does(1, 2, "trajectory of x and z")},
              {{6, Who::kEngine, 200}}});
  expectGood({0,
              {does(0, 0, "line of y and z by"), does(1, 4, "trajectory of x and z")},
              {{8, Who::kEngine, 10}}});
  expectGood(
      {0, {does(0, 0, "move z to 6 mm"), does(1, 4, "trajectory of z")}, {{5, Who::kEngine, 10}}});
}

TEST(FoundSchedules, AMoveThatIsAboutToTurnIsStoppedWithoutGoingToItsTarget) {
  for (std::size_t after = 0; after < 35; ++after) {
    expectGood(
        {0,
         {does(1, 0, "jog x"), does(0, after, "stop z, move it at a lower jerk, and stop it")},
         {}});
  }
}

// What is refused for one axis leaves all others held.
TEST(FoundSchedules, AResumeThatIsRefusedForOneAxisResumesNone) {
  for (int variant = 0; variant < 4; ++variant) {
    expectGood({variant,
                {does(0, 0, "move x to 8 mm"), does(0, 0, "move z to 6 mm"), does(1, 60, "hold"),
                 does(1, 200, "press x"), does(1, 8, "resume")},
                {}});
  }
}

// The engine refuses the order to continue, because it comes too late, and then a switch is in the
// way.
TEST(FoundSchedules, AMoveThatCanNoLongerBeResumedEndsAndItsCallerIsTold) {
  for (std::size_t from = 64; from < 72; ++from) {
    expectGood({0,
                {does(0, 0, "move x to 8 mm"), does(1, 30, "hold"), does(1, 40, "resume"),
                 does(0, 0, "press x")},
                {{from, Who::kEngine, 40}}});
  }
}

// The order to continue comes when the axis has just come to rest.
TEST(FoundSchedules, AMoveIsResumedWhileItStillSlowsDown) {
  for (std::size_t from = 58; from < 68; ++from) {
    expectGood({0,
                {does(0, 0, "move x to 8 mm"), does(1, 30, "hold"), does(1, 28, "resume"),
                 does(0, 0, "plan x")},
                {{from, Who::kEngine, 40}}});
  }
}

// The other axis of the trajectory then has two goals, and comes to rest once.
TEST(FoundSchedules, AnAxisHasOneOwnerIfItsTrajectoryIsTakenOverBeforeItBegan) {
  for (std::size_t after = 0; after < 4; ++after) {
    for (const char* ending : {"hold", "stop"}) {
      expectGood({0,
                  {does(0, 0, "move y to -5 mm"), does(0, 4, "trajectory of x and y"),
                   does(1, 0, "move x to 8 mm"), does(0, after, "move y by 7 mm"),
                   does(1, 30, ending), does(0, 100, "stop")},
                  {{9, Who::kEngine, 12}}});
    }
  }
}

TEST(FoundSchedules, AHeldTrajectoryDoesNotReachItsEndIfAMoveTakesOverBeforeItGoesOn) {
  for (int variant = 0; variant < 4; ++variant) {
    expectGood({variant,
                {does(0, 1, "trajectory of x and y"), does(0, 1, "hold"), does(0, 1, "resume"),
                 does(1, 0, "move y to -5 mm")},
                {{11, Who::kEngine, 200}}});
  }
}

TEST(FoundSchedules, ATrajectoryThatTheEngineNeverTookDoesNotSucceedIfAJogTakesOver) {
  expectGood({0,
              {does(0, 0, "stream a jog of x"), does(1, 4, "trajectory of x and z")},
              {{9, Who::kEngine, 4}}});
  expectGood({1,
              {does(0, 0, "stream a jog of x"), does(1, 8, "trajectory of x and y")},
              {{8, Who::kEngine, 10}}});
}

TEST(FoundSchedules, AHeldMoveWhoseResumeComesDuringAnEmergencyStopEndsWithThatReason) {
  expectGood(
      {1,
       {does(1, 1, "move y to -5 mm"), does(1, 1, "move z to 6 mm"),
        does(0, 4, "release the emergency stop"), does(0, 0, "move y by 7 mm"), does(1, 16, "hold"),
        does(1, 16, "emergency stop can't be read"), does(0, 1, "resume")},
       {{27, Who::kNews, 40}}});
}

// The stream seems to be nearly as fast as the axis, which follows it more slowly at first. The
// axis continued at full speed until the timeout, and met its switch.
TEST(FoundSchedules, AStreamThatTheAxisHasNotCaughtUpWithIsNotFollowedBeyondItsEnd) {
  expectGood({0,
              {does(0, 0, "stream setpoints of x and z")},
              {{10, Who::kRequest, 10}, {583, Who::kEngine, 10}}});
}

// The change of position since the setpoint before the line was taken for a stream's velocity, and
// x passed its target by as much.
TEST(FoundSchedules, ASetpointBeforeALineDoesNotBelongToAStreamWithOneAfterIt) {
  const auto goes_to = [](std::size_t after, double position) {
    const machine::FollowSetpoints wanted{
        machine::SetpointMode::kPosition, 0.3, {{0, position, {}}}};
    return requests(0, after, "setpoint of x", wanted, {0});
  };
  for (int variant = 0; variant < static_cast<int>(kVariants); ++variant) {
    expectGood(
        {variant, {goes_to(40, 0.0068), does(0, 8, "line of x and y"), goes_to(120, 0.0)}, {}});
  }
}

// The motor's end lay before the place at which the joint would turn, as its backlash is taken up
// on the way back: the overshoot by the lower limits was neither seen nor announced.
TEST(FoundSchedules, LowerLimitsDoNotTakeAnAxisWithABacklashPastItsTarget) {
  for (const std::size_t after : {385, 392, 399}) {
    for (const int variant : {0, 1, 4}) {
      expectGood({variant,
                  {does(0, 0, "move y to -5 mm"), does(1, 3, "override 0.4"),
                   does(0, after, "gentle limits of y")},
                  {}});
    }
  }
}

// The axis still braked for a move the other way, and went on with lower limits.
TEST(FoundSchedules, LowerLimitsDoNotTakeAnAxisThatTurnsBackFarther) {
  for (int variant = 0; variant < static_cast<int>(kVariants); ++variant) {
    expectGood({variant,
                {does(1, 4, "line of y and z by"), does(1, 16, "move y by 7 mm"),
                 does(0, 0, "move y by 7 mm"), does(1, 4, "gentle limits of y")},
                {{7, Who::kEngine, 40}}});
  }
}

// The accelerations of the parts cancelled each other out but for rounding, and all steps of such a
// stretch came at once.
TEST(FoundSchedules, AnAxisThatIsShapedTwiceMakesNoBursts) {
  for (const char* ending : {"stop x", "gentle limits of x", "emergency stop can't be read"}) {
    expectGood({4, {does(0, 0, "move x by -6 mm"), does(1, 16, ending)}, {}});
  }
}

// Its ramps are so short that their ends were dropped: the second line began with the speed of the
// first one, or, with a jerk limit, the first one with an acceleration.
TEST(FoundSchedules, ASlowPathStaysWhereItIsSentTo) {
  for (int variant = 0; variant < 5; ++variant) {
    for (const auto& [first, second] : {std::pair(40e-6, 1e-6), std::pair(3e-6, 10e-6)}) {
      expectGood({variant, {{0, 0, 0, std::make_shared<const Act>(slowPath(first, second))}}, {}});
    }
  }
}

// The second touch of the probing was refused after it had been taken; its latch ended a later move
// that passed the contact.
TEST(FoundSchedules, ATouchThatIsRefusedStopsNoLaterMove) {
  for (int variant = 0; variant < static_cast<int>(kVariants); ++variant) {
    for (const char* trouble : {"press x, edge lost", "switch of x can't be read"}) {
      expectGood({variant, {does(0, 0, "probe with x"), does(1, 500, trouble)}, {}});
    }
  }
}

// In variants 1 and 2, x has a brake.
TEST(FoundSchedules, AnEnableDoesNotSucceedIfAStopComesWhileTheBrakeIsReleased) {
  for (const int variant : {1, 2}) {
    for (const char* stop : {"emergency stop", "shut down", "the motor power is lost"}) {
      for (std::size_t after = 0; after < 60; ++after) {
        expectGood(
            {variant, {does(0, 0, "disable x"), does(0, 0, "enable x"), does(1, after, stop)}, {}});
      }
    }
  }
}

TEST(FoundSchedules, AHoldBeforeAMotionHasBegunIsNamedAsTheReason) {
  expectGood(
      {0, {does(0, 0, "trajectory of x and y"), does(1, 0, "hold")}, {{3, Who::kEngine, 4}}});
}

// The feedback of a line that could not be written was waited for, and its relay was called welded.
TEST(FoundSchedules, AfterAFailureToSwitchTheMotorPowerOffItIsSwitchedOffAgainAndOn) {
  expectGood(
      {1, {does(0, 0, "emergency stop"), does(1, 16, "a pin fails")}, {{9, Who::kWriter, 40}}});
}

// The stop had begun to speed up, to rest on a whole step, and the lower jerk of the line took that
// back only at the highest speed: x ran through its target into its switch.
TEST(FoundSchedules, ALineThatIsResumedWhileItStopsEndsAtItsTargetWithALowerJerkToo) {
  for (std::size_t after = 10; after < 120; after += 5) {
    expectGood({0,
                {does(1, 16, "gentle limits of x"), does(1, 0, "line of x and y"),
                 does(1, after, "hold"), does(0, 0, "resume")},
                {}});
  }
}

// The engine wasn't served for 8 ms after each step. It may catch up with a quarter of a full step
// without sliding the timeline, and the judge had not added that to the 8 ms.
TEST(FoundSchedules, AnEngineThatIsLateAgainAndAgainIsBehindByNoMoreThanItMayBe) {
  for (const int variant : {1, 4}) {
    for (const std::size_t from : {308, 333, 433, 434, 512}) {
      expectGood({variant,
                  {does(1, 2, "resume"), does(0, 16, "move y by 7 mm"), does(1, 16, "jog x and z")},
                  {{from, Who::kEngine, 200}}});
    }
  }
}

// A fault that is there already kept the position valid, whatever the chip had lost.
TEST(FoundSchedules, AChipThatIsResetDuringAnEmergencyStopLeavesNoPositionValid) {
  for (const std::size_t after : {0, 4, 60}) {
    for (const char* stop : {"emergency stop", "press the emergency stop"}) {
      expectGood({kRegisters,
                  {does(0, 0, "move x by -6 mm"), does(1, 500, stop),
                   does(1, after, "the chip of x is reset"), does(0, after, "recover")},
                  {}});
    }
  }
}

// The registers were written again with the currents of before the change, which was then taken
// for what the chip had.
TEST(FoundSchedules, CurrentsThatAreOnTheirWayAreThoseOfTheRegistersAfterARecover) {
  for (std::size_t after = 0; after < 12; ++after) {
    for (std::size_t later = 0; later < 6; ++later) {
      expectGood({kRegisters,
                  {does(0, 0, "the chip of x is reset"), does(1, after, "currents of x"),
                   does(0, later, "recover")},
                  {}});
    }
  }
}

// The rig's judge took a chip's loss of its power, at the time of a step, for a change of its
// microsteps by the host.
TEST(FoundSchedules, AChipThatLosesItsPowerAtAStepDoesNotChangeItsMicrosteps) {
  for (std::size_t after = 0; after < 100; ++after) {
    expectGood({kRegisters,
                {does(0, 0, "move x by -6 mm"), does(0, 16, "hold"),
                 does(1, after, "the chip of x is silent")},
                {}});
  }
}

// The axis was about to be disabled by its idle timeout, so the homing had not begun when the hold
// came, and then moved nevertheless.
TEST(FoundSchedules, AHomingThatBeginsDuringAHoldMovesAfterTheResume) {
  for (std::size_t after = 0; after < 16; ++after) {
    for (const std::size_t later : {0, 1, 2, 4}) {
      expectGood({2, {does(0, after, "home z"), does(1, later, "hold")}, {}});
      expectGood(
          {2, {does(0, after, "home z"), does(1, later, "hold"), does(1, 60, "resume")}, {}});
    }
  }
}

}  // namespace
}  // namespace stepdriver::search
