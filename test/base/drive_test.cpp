#include "drive.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "support/vehicles.h"

namespace stepdriver::base {
namespace {

constexpr double kPeriod = 0.04;  // [s]
/// A drive on a clock of its own, with a driver that does what it is told.
class DriveTest : public testing::Test {
 protected:
  /// Begins again, with axes that are ready.
  void use(const Kinematics& used, const std::vector<std::string>& wheels) {
    kinematics = used;
    drive.emplace(used, wheels, "steer", "/driver", Drive::Timeouts());
    reports.assign(wheels.size(), AxisReport());
    cycle();
  }

  void SetUp() override { use(twoWheels(0.3), {"left", "right"}); }

  /// One period, after which the wheels do what they were told.
  DriveOrders cycle() {
    now += kPeriod;
    if (driver_reports) drive->report(reports, steering, now);
    drive->steeringIsAt(angle);
    if (wanted) drive->command(*wanted, now);
    DriveOrders orders = drive->orders(now);
    for (std::size_t i = 0; i < orders.wheels.size(); ++i) {
      reports[i].moving = orders.wheels[i] != 0.0 && !stuck;
    }
    if (!orders.wheels.empty()) told = orders.wheels;
    if (orders.steering && !steering_stuck) angle = *orders.steering;
    return orders;
  }

  void runFor(double seconds) {
    for (double left = seconds; left > 0.0; left -= kPeriod) cycle();
  }

  bool rests() const {
    return std::all_of(told.begin(), told.end(), [](double wheel) { return wheel == 0.0; });
  }

  Kinematics kinematics;
  std::optional<Drive> drive;
  double now = 100.0;
  double angle = 0.0;
  bool driver_reports = true;
  bool stuck = false;
  bool steering_stuck = false;
  std::optional<Twist> wanted;  // sent in each cycle
  std::vector<AxisReport> reports;
  AxisReport steering;
  std::vector<double> told;
};

TEST_F(DriveTest, WaitsForTheDriver) {
  driver_reports = false;
  use(twoWheels(0.3), {"left", "right"});
  wanted = Twist{0.2, 0.0};
  runFor(1.0);
  EXPECT_EQ(drive->state(), Drive::State::kStopped);
  EXPECT_EQ(drive->cause(), "there is no state of /driver yet");
  EXPECT_TRUE(told.empty()) << "nothing was sent";
  wanted.reset();
  runFor(0.6);
  driver_reports = true;
  cycle();
  EXPECT_EQ(drive->state(), Drive::State::kReady);
}

TEST_F(DriveTest, SendsNothingUntilItIsCommandedAndAfterItHasStopped) {
  runFor(1.0);
  EXPECT_TRUE(told.empty());
  wanted = Twist{0.2, 0.0};
  runFor(1.0);
  EXPECT_EQ(told, (std::vector<double>{0.2, 0.2}));
  EXPECT_FALSE(cycle().wheels.empty()) << "it repeats the velocities";
  wanted = Twist{};
  runFor(1.0);
  EXPECT_TRUE(rests());
  EXPECT_TRUE(cycle().wheels.empty()) << "others can move the wheels";
}

TEST_F(DriveTest, KeepsTheCurvatureWhileItRampsAndSaturates) {
  std::mt19937 engine(7);
  std::uniform_real_distribution<double> linear(-2.0, 2.0);
  std::uniform_real_distribution<double> angular(-6.0, 6.0);
  for (int i = 0; i < 200; ++i) {
    const Twist command{linear(engine), angular(engine)};
    wanted = command;
    std::vector<double> before(2, 0.0);
    for (int n = 0; n < 100; ++n) {
      const auto wheels = cycle().wheels;
      ASSERT_EQ(wheels.size(), 2U);
      const Twist twist = twistFrom(kinematics, wheels, 0.0);
      ASSERT_NEAR(twist.linear * command.angular, twist.angular * command.linear, 1e-8) << n;
      for (std::size_t wheel = 0; wheel < 2; ++wheel) {
        ASSERT_LE(std::abs(wheels[wheel]), 1.0) << "m/s";
        ASSERT_LE(std::abs(wheels[wheel] - before[wheel]), 0.5 * kPeriod + 1e-12) << "0.5 m/s^2";
      }
      before = wheels;
    }
    const Twist full{command};
    const double factor = speedFactor(kinematics, wheelVelocities(kinematics, full, 0.0));
    ASSERT_NEAR(twistFrom(kinematics, told, 0.0).linear, command.linear * factor, 1e-8);
    wanted = Twist{};
    runFor(2.0);
    ASSERT_TRUE(rests()) << i;
  }
}

TEST_F(DriveTest, KeepsTheCurvatureWithASpeedOverride) {
  drive->speedOverrideIs(2.0);
  wanted = Twist{0.4, 1.0};  // the wheels turn at 0.25 and 0.55 m/s, which would become 1.1 m/s
  runFor(3.0);
  EXPECT_NEAR(told.at(1), 0.5, 1e-12) << "half of the maximum";
  EXPECT_NEAR(told.at(0), 0.5 * 0.25 / 0.55, 1e-12);
  drive->speedOverrideIs(0.5);
  runFor(3.0);
  EXPECT_NEAR(told.at(1), 0.55, 1e-12) << "the driver makes it slower";
}

TEST_F(DriveTest, ComesToRestIfTheCommandsEnd) {
  wanted = Twist{0.4, 1.0};
  runFor(2.0);
  EXPECT_FALSE(rests());
  EXPECT_FALSE(drive->takeTimedOut());
  wanted.reset();
  runFor(0.4);
  EXPECT_NEAR(told.at(1), 0.55, 1e-9) << "the timeout of 0.5 s isn't over";
  runFor(0.2 + 0.55 / 1.5);
  EXPECT_TRUE(rests());
  EXPECT_TRUE(drive->takeTimedOut());
  EXPECT_FALSE(drive->takeTimedOut()) << "it is told once";
  wanted = Twist{0.4, 0.0};
  runFor(0.2);
  EXPECT_FALSE(rests()) << "a timeout needs no pause";
}

TEST_F(DriveTest, StopsAllWheelsAtOnceIfOneCannotDrive) {
  wanted = Twist{0.4, 0.0};
  runFor(2.0);
  reports[1].trouble = "the driver reports a fault";
  cycle();
  EXPECT_EQ(told, (std::vector<double>{0.0, 0.0}));
  EXPECT_EQ(drive->state(), Drive::State::kStopped);
  EXPECT_EQ(drive->cause(), "right: the driver reports a fault");
  told.clear();
  runFor(2.0);
  EXPECT_TRUE(told.empty()) << "nothing more is sent: " << told.size();
}

TEST_F(DriveTest, RepeatsTheStopWhileAWheelStillTurns) {
  wanted = Twist{0.4, 0.0};
  runFor(2.0);
  reports[1].trouble = "on hold";
  cycle();
  reports[0].moving = true;
  EXPECT_EQ(cycle().wheels, (std::vector<double>{0.0, 0.0}));
  reports[0].moving = false;
  EXPECT_TRUE(cycle().wheels.empty());
}

TEST_F(DriveTest, NeedsAPauseOrZeroAfterAStop) {
  for (const bool by_zero : {true, false}) {
    wanted = Twist{0.4, 0.0};
    runFor(2.0);
    ASSERT_FALSE(rests());
    reports[0].trouble = "disabled";
    runFor(0.5);
    reports[0].trouble.clear();
    runFor(2.0);
    EXPECT_EQ(drive->state(), Drive::State::kWaiting) << "the commands didn't pause";
    EXPECT_EQ(drive->cause(), "left: disabled");
    EXPECT_TRUE(rests());
    if (by_zero) {
      wanted = Twist{};
      cycle();
    } else {
      wanted.reset();
      runFor(0.4);
      EXPECT_EQ(drive->state(), Drive::State::kWaiting) << "the pause is too short";
      runFor(0.2);
    }
    EXPECT_EQ(drive->state(), Drive::State::kReady);
    EXPECT_TRUE(rests()) << "the old command is forgotten";
    wanted = Twist{0.4, 0.0};
    runFor(0.2);
    EXPECT_FALSE(rests());
  }
}

TEST_F(DriveTest, ZeroWhileTheCauseLastsIsNotEnough) {
  reports[0].trouble = "disabled";
  wanted = Twist{};
  runFor(1.0);
  wanted = Twist{0.4, 0.0};
  reports[0].trouble.clear();
  runFor(1.0);
  EXPECT_EQ(drive->state(), Drive::State::kWaiting);
  EXPECT_TRUE(rests());
}

TEST_F(DriveTest, StopsIfTheDriverIsSilent) {
  wanted = Twist{0.4, 0.0};
  runFor(2.0);
  driver_reports = false;
  runFor(0.4);
  EXPECT_FALSE(rests());
  runFor(0.2);
  EXPECT_TRUE(rests());
  EXPECT_EQ(drive->cause(), "there was no state of /driver for 0.5 s");
}

TEST_F(DriveTest, StopsIfAWheelStandsThatShouldTurn) {
  wanted = Twist{0.4, 0.0};
  runFor(2.0);
  stuck = true;
  runFor(0.4);
  EXPECT_FALSE(rests()) << "it has some time to follow";
  runFor(0.2);
  EXPECT_TRUE(rests());
  EXPECT_EQ(drive->cause(),
            "right: it stands although it should turn; the log of /driver says why");
}

TEST_F(DriveTest, LetsAWheelStandAroundWhichTheBaseTurns) {
  wanted = Twist{0.15, 1.0};  // around the left wheel
  runFor(3.0);
  EXPECT_EQ(drive->state(), Drive::State::kReady) << drive->cause();
  EXPECT_EQ(told.at(0), 0.0);
  EXPECT_NEAR(told.at(1), 0.3, 1e-12);
}

TEST_F(DriveTest, RestsAtTheEndOfTheProgramOnlyIfItDrives) {
  cycle();
  EXPECT_TRUE(drive->rest().wheels.empty());
  wanted = Twist{0.4, 0.0};
  runFor(1.0);
  EXPECT_EQ(drive->rest().wheels, (std::vector<double>{0.0, 0.0}));
}

TEST_F(DriveTest, SteersBeforeItTurnsOnTheSpot) {
  use(tricycle({steeredWheel()}), {"front"});
  steering_stuck = true;  // it is on its way
  steering.moving = true;
  cycle();
  wanted = Twist{0.0, 1.0};
  EXPECT_NEAR(cycle().steering.value_or(0.0), kRightAngle, 1e-12);
  runFor(1.0);
  EXPECT_TRUE(told.empty() || rests()) << "the wheel stands square to its way";
  angle = kRightAngle / 2.0;
  runFor(2.0);
  EXPECT_NEAR(told.at(0), 0.4 * std::sqrt(0.5), 1e-9) << "slower until it is there";
  angle = kRightAngle;
  runFor(2.0);
  EXPECT_NEAR(told.at(0), 0.4, 1e-12);
  EXPECT_EQ(drive->state(), Drive::State::kReady) << drive->cause();
}

TEST_F(DriveTest, KeepsTheSteeringAtStandstill) {
  use(tricycle({steeredWheel()}), {"front"});
  wanted = Twist{0.4, 1.0};
  runFor(2.0);
  EXPECT_NEAR(angle, kRightAngle / 2.0, 1e-12);
  EXPECT_FALSE(cycle().steering) << "the target is sent once";
  wanted = Twist{};
  runFor(2.0);
  EXPECT_TRUE(rests());
  EXPECT_NEAR(angle, kRightAngle / 2.0, 1e-12);
  angle = 0.0;  // someone else moves it
  runFor(2.0);
  EXPECT_EQ(drive->state(), Drive::State::kReady) << drive->cause();
  wanted = Twist{0.4, 1.0};
  EXPECT_TRUE(cycle().steering) << "it is sent again";
}

TEST_F(DriveTest, StopsIfTheSteeringStandsElsewhereOrIsRefused) {
  use(tricycle({steeredWheel()}), {"front"});
  steering_stuck = true;
  wanted = Twist{0.4, 1.0};
  runFor(1.0);
  EXPECT_EQ(drive->cause(), "steer: it stands at 0.0 degrees instead of 45.0");
  EXPECT_TRUE(rests());
  steering_stuck = false;
  wanted = Twist{};
  cycle();
  wanted = Twist{0.4, 1.0};
  runFor(1.0);
  EXPECT_FALSE(rests()) << drive->cause();
  drive->steeringRefused("steer isn't homed");
  cycle();
  EXPECT_TRUE(rests());
  EXPECT_EQ(drive->cause(), "steer: steer isn't homed");
}

TEST_F(DriveTest, SaysThatATurnIsTooTight) {
  Kinematics limited = tricycle({middleWheel()});
  limited.steering->max_angle = 0.5;
  use(limited, {"rear"});
  wanted = Twist{0.2, 0.1};
  runFor(1.0);
  EXPECT_FALSE(drive->takeTooTight());
  wanted = Twist{0.2, 1.0};
  runFor(1.0);
  EXPECT_TRUE(drive->takeTooTight());
  EXPECT_NEAR(angle, 0.5, 1e-12);
  EXPECT_NEAR(told.at(0), 0.2, 1e-12) << "m/s, as commanded";
}

}  // namespace
}  // namespace stepdriver::base
