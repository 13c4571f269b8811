#include "machine/state_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/contents_of.h"
#include "support/full_disk.h"
#include "support/temporary_folder.h"

// Positions that survive a restart. 80 microsteps/mm, 1/16, so the translator is at Home every 0.8
// mm.

namespace stepdriver {
namespace {

using test::Bench;
using test::FullDisk;
using test::linearAxis;

bool exists(const std::string& path) {
  struct stat facts {};
  return lstat(path.c_str(), &facts) == 0;
}

unsigned permissionsOf(const std::string& path) {
  struct stat facts {};
  return lstat(path.c_str(), &facts) == 0 ? facts.st_mode & 0777U : 0;
}

class StateFileTest : public testing::Test {
 protected:
  StateFileTest() { config_.holds_position_unpowered = true; }

  void start(bool threaded = false) {
    bench_.reset();
    machine::MachineOptions options;
    options.state_file = file_;
    bench_ = makeBench(options, threaded);
  }
  std::unique_ptr<Bench> makeBench(const machine::MachineOptions& options, bool threaded) const {
    const std::vector<config::AxisConfig> axes{config_};
    return std::make_unique<Bench>(axes, Bench::rigAxes(axes), threaded, 0.0, options);
  }
  // The state that a loss of power leaves.
  void crash() {
    const std::string kept = text();
    bench_.reset();
    std::ofstream(file_) << kept;
  }
  axis::Axis& x() { return bench_->axis(); }
  axis::AxisState state() { return x().state(); }
  void standAt(double position) {
    x().setPosition(0.0);
    ASSERT_EQ(bench_->move(position).end, axis::MoveEnd::kReached);
    bench_->machine->advance(0.001);
  }
  std::string text() const { return test::contentsOf(file_); }
  std::string whyNot() {
    try {
      start();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  config::AxisConfig config_ = linearAxis("x");
  const test::TemporaryFolder folder_;
  std::string file_ = folder_.path() + "/state";
  std::unique_ptr<Bench> bench_;
};

TEST_F(StateFileTest, BringsAPositionBackAfterACleanEnd) {
  start();
  EXPECT_EQ(state().position_note, "the state file " + file_ + " didn't exist yet");
  EXPECT_FALSE(state().position_valid);
  standAt(0.008);
  EXPECT_EQ(state().position_note, "");
  start();
  EXPECT_DOUBLE_EQ(state().position, 0.008);
  EXPECT_TRUE(state().position_valid);
  EXPECT_EQ(state().position_note, "");
  EXPECT_EQ(bench_->move(0.0).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench_->pulses(), -640);
}

TEST_F(StateFileTest, DoesNotTrustThePositionOfANodeThatWasNotShutDown) {
  start();
  standAt(0.008);
  crash();
  start();
  EXPECT_DOUBLE_EQ(state().position, 0.008);
  EXPECT_FALSE(state().position_valid);
  EXPECT_EQ(state().position_note, "the node that kept this position wasn't shut down");
  // Nor after a clean end, until somebody sets the position.
  start();
  EXPECT_EQ(state().position_note, "the position couldn't be trusted when it was kept");
  x().setPosition(0.0);
  start();
  EXPECT_TRUE(state().position_valid);
}

TEST_F(StateFileTest, IsOneOfARunningMachineWhileItMoves) {
  start();
  standAt(0.008);
  x().moveTo(0.050);
  bench_->machine->advance(0.2);
  ASSERT_TRUE(state().moving);
  crash();
  start();
  EXPECT_DOUBLE_EQ(state().position, 0.008);  // the last position of rest
  EXPECT_FALSE(state().position_valid);
  EXPECT_EQ(state().position_note,
            "the node that kept this position wasn't shut down: the axis was moving, from 0.008 m, "
            "and it is not known where it stopped");
}

TEST_F(StateFileTest, SaysFromWhereTheMotionBeganThatALossOfPowerEnded) {
  start();
  standAt(0.008);
  bench_->move(0.010);  // starts a second move before anything is written
  x().moveTo(0.050);
  bench_->machine->advance(0.2);
  ASSERT_TRUE(state().moving);
  crash();
  start();
  EXPECT_DOUBLE_EQ(state().position, 0.010);
  EXPECT_NE(state().position_note.find("was moving, from 0.01 m"), std::string::npos)
      << state().position_note;
}

TEST_F(StateFileTest, DoesNotSayThatAnAxisMovedThatHadComeToRest) {
  start();
  standAt(0.008);
  x().moveTo(0.050);
  bench_->machine->advance(0.2);
  bench_->machine->advance(10.0);
  ASSERT_FALSE(state().moving);
  crash();
  start();
  EXPECT_DOUBLE_EQ(state().position, 0.050);
  EXPECT_EQ(state().position_note, "the node that kept this position wasn't shut down");
}

TEST_F(StateFileTest, ReadsTheFilesOfEarlierVersions) {
  std::ofstream(file_) << "stepdriver state 1\nclean\nx linear 80000 0.008 0 1 0 1\n";
  start();
  EXPECT_DOUBLE_EQ(state().position, 0.008);
  EXPECT_TRUE(state().position_valid);
}

TEST_F(StateFileTest, DoesNotTrustAMotorThatNothingHeld) {
  config_.holds_position_unpowered = false;
  start();
  standAt(0.008);
  start();
  EXPECT_FALSE(state().position_valid);
  EXPECT_EQ(state().position_note,
            "the motor had no current in between, and holds_position_unpowered isn't set");
}

TEST_F(StateFileTest, DoesNotTrustAChipThatBeganElsewhere) {
  start();
  standAt(0.0081);
  start();
  EXPECT_NEAR(state().position, 0.0081, 1e-12);
  EXPECT_FALSE(state().position_valid);
  EXPECT_NE(state().position_note.find("turned the motor by up to two full steps"),
            std::string::npos);
}

TEST_F(StateFileTest, IsNotForAnotherAxis) {
  start();
  standAt(0.008);
  config_.steps_per_unit = 40'000.0;
  start();
  EXPECT_EQ(state().position, 0.0);
  EXPECT_EQ(
      state().position_note,
      "the position was kept for another axis, of 80000 steps per m; this one has 40000 steps "
      "per m");
  bench_.reset();
  config_.name = "z";
  start();
  EXPECT_EQ(bench_->axis("z").state().position_note,
            "the state file " + file_ + " doesn't contain this axis");
}

TEST_F(StateFileTest, KeepsWhatIsTakenUpOfABacklash) {
  config_.backlash = 30 / config_.steps_per_unit;
  start();
  x().setPosition(0.0);
  bench_->move(0.008 - config_.backlash);
  bench_->machine->advance(0.001);
  ASSERT_EQ(bench_->pulses(), 640);
  start();
  EXPECT_NEAR(state().position, 0.008 - config_.backlash, 1e-12);
  EXPECT_TRUE(state().position_valid);
  // Continues in the same direction: there is no backlash to take up.
  bench_->move(0.016 - config_.backlash);
  EXPECT_EQ(bench_->pulses(), 640);
}

TEST_F(StateFileTest, OpensWithABrokenFileAndSaysWhereItIsBroken) {
  const std::string head = "stepdriver state 1\nclean\n";
  const std::string line = "x linear 80000 0.008 0 1 0 1\n";
  const std::string twice = head + line + line;
  for (const auto& [content, where] : std::vector<std::pair<std::string, std::string>>{
           {"", "line 1"},
           {"stepdriver state 2\nclean\n", "line 1"},
           {"stepdriver state 1\nfine\n", "line 2"},
           {head + "x linear 80000 nan 0 1 0 1\n", "line 3"},
           {head + "x linear 80000 1e999 0 1 0 1\n", "line 3"},
           {head + "x linear 80000 0,008 0 1 0 1\n", "line 3"},
           {head + "x linear 80000 0.008 -inf 1 0 1\n", "line 3"},
           {head + "x linear 80000 0.008 0 2 0 1\n", "line 3"},
           {head + "x linear 80000 0.008 0 1\n", "line 3"},
           {head + "x linear 80000 0.008 0 1 0 1 7\n", "line 3"},
           {head + "x linear 80000 0.008 0 1 0 1 0 1\n", "line 3"},
           {head + "x linear -1 0.008 0 1 0 1\n", "line 3"},
           {head + "x linear 80000 0.008 0 1 0 1 0 @1024\n", "line 3"},
           {head + "x linear 80000 0.008 0 1 0 1 0 @-2\n", "line 3"},
           {head + "x linear 80000 0.008 0 1 0 1 0 @\n", "line 3"},
           {head + "x crooked 80000 0.008 0 1 0 1\n", "line 3"},
           {twice, "line 4"}}) {
    SCOPED_TRACE(content);
    bench_.reset();
    std::ofstream(file_) << content;
    start();
    const std::string place = "is broken in " + where;
    EXPECT_NE(state().position_note.find(place), std::string::npos) << state().position_note;
    EXPECT_FALSE(state().position_valid);
    EXPECT_EQ(state().position, 0.0);
  }
  bench_.reset();
  std::ofstream(file_) << head + line;
  start();
  EXPECT_TRUE(state().position_valid);
}

TEST_F(StateFileTest, DoesNotBelieveAPositionThatSetPositionRefuses) {
  config_.min_position = 0.0;
  config_.max_position = 0.2;
  for (const auto& [position, why] : std::vector<std::pair<std::string, std::string>>{
           {"5", "5 m is above the soft limit max_position 0.2 m, from the configuration"},
           {"1e308", "1e+308 m is above the soft limit max_position 0.2 m, from the configuration"},
           {"-0.1", "-0.1 m is below the soft limit min_position 0 m, from the configuration"}}) {
    SCOPED_TRACE(position);
    bench_.reset();
    std::ofstream(file_) << "stepdriver state 1\nclean\nx linear 80000 " << position
                         << " 0 1 1 1 0\n";
    start();
    EXPECT_EQ(state().position_note, "in the state file " + file_ + ", the position " + why);
    EXPECT_FALSE(state().position_valid);
    EXPECT_FALSE(state().homed);
    EXPECT_EQ(state().position, 0.0);
    try {
      x().setPosition(std::stod(position));
      FAIL() << "set_position accepts it";
    } catch (const Refused& refused) {
      EXPECT_EQ(std::string(refused.what()), "x: the position " + why);
    }
  }
  config_.min_position.reset();
  config_.max_position.reset();
  bench_.reset();
  std::ofstream(file_) << "stepdriver state 1\nclean\nx linear 80000 1e308 0 1 1 1 0\n";
  start();
  EXPECT_EQ(state().position_note,
            "in the state file " + file_ + ", the position 1e+308 m is more than 2^40 steps away");
  EXPECT_EQ(state().position, 0.0);
}

TEST_F(StateFileTest, DoesNotTrustAPositionWithAnImpossibleBacklash) {
  config_.backlash = 30 / config_.steps_per_unit;
  for (const char* slack : {"9223372036854775808", "1e308", "-1e308", "-0.0001", "0.001"}) {
    SCOPED_TRACE(slack);
    bench_.reset();
    std::ofstream(file_) << "stepdriver state 1\nclean\nx linear 80000 0.008 " << slack
                         << " 1 1 1 0\n";
    start();
    EXPECT_DOUBLE_EQ(state().position, 0.008);
    EXPECT_FALSE(state().position_valid);
    EXPECT_NE(state().position_note.find("of the backlash is taken up, but it must be from 0 to "
                                         "0.000375 m"),
              std::string::npos)
        << state().position_note;
    EXPECT_EQ(bench_->move(0.0).end, axis::MoveEnd::kReached);
    EXPECT_NEAR(state().position, 0.0, 1e-12);
  }
}

TEST_F(StateFileTest, IsForOneProgramAtATime) {
  start();
  machine::MachineOptions options;
  options.state_file = file_;
  try {
    makeBench(options, false);
    FAIL() << "two have it";
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()),
              "the state file " + file_ + " is used by another program: each node needs its own");
  }
}

TEST_F(StateFileTest, RefusesToStartWhereItCannotBeWritten) {
  file_ = folder_.path() + "/nowhere/state";
  EXPECT_EQ(whyNot(), "the state file " + file_ + " can't be written: No such file or directory");
}

TEST_F(StateFileTest, RefusesToStartIfItIsNoRegularFile) {
  const auto expect_no_file = [this](const std::string& path, const std::string& kind) {
    EXPECT_EQ(whyNot(), "the state file " + path + " is " + kind + ", but must be a regular file");
    EXPECT_EQ(std::remove(path.c_str()), 0);
  };
  for (const char* end : {"", ".lock"}) {
    const std::string path = file_ + end;
    ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);  // nobody writes into it
    expect_no_file(path, "a named pipe");
    ASSERT_EQ(mkdir(path.c_str(), 0700), 0);
    expect_no_file(path, "a folder");
    ASSERT_EQ(symlink("/dev/zero", path.c_str()), 0);
    expect_no_file(path, "a symbolic link");
    ASSERT_EQ(symlink((folder_.path() + "/nothing").c_str(), path.c_str()), 0);
    expect_no_file(path, "a symbolic link");
    EXPECT_FALSE(exists(folder_.path() + "/nothing"));
  }
}

TEST_F(StateFileTest, DoesNotWriteThroughALinkThatIsInItsWay) {
  const std::string other = file_ + ".other";
  std::ofstream(other) << "of somebody else";
  ASSERT_EQ(symlink(other.c_str(), (file_ + ".new").c_str()), 0);
  start();
  standAt(0.008);
  EXPECT_EQ(test::contentsOf(other), "of somebody else");
  EXPECT_NE(text().find("x linear 80000 0.008"), std::string::npos) << text();
}

TEST_F(StateFileTest, OnlyItsOwnerReadsAndWritesIt) {
  std::ofstream(file_) << "stepdriver state 1\nclean\n";
  chmod(file_.c_str(), 0644);
  const mode_t before = umask(0);
  start();
  umask(before);
  EXPECT_EQ(permissionsOf(file_), 0600U);
  EXPECT_EQ(permissionsOf(file_ + ".lock"), 0600U);
}

TEST_F(StateFileTest, IsNotReadBeyondWhatAStateFileCanHave) {
  std::ofstream(file_) << "stepdriver state 1\nclean\n" << std::string(1U << 21U, '#') << "\n";
  start();
  EXPECT_EQ(state().position_note,
            "the state file " + file_ + " is larger than 1048576 bytes: it is no state file");
  EXPECT_FALSE(state().position_valid);
}

TEST_F(StateFileTest, OnAFullDiskKeepsTheLastContentsAndSaysSoUntilThereIsRoom) {
  start();
  standAt(0.008);
  const std::string before = text();
  {
    const FullDisk full(0);
    bench_->move(0.016);
    bench_->machine->advance(0.001);
  }
  EXPECT_EQ(bench_->machine->stateFileError(),
            "the state file " + file_ + ".new can't be written: File too large");
  EXPECT_EQ(text(), before);
  EXPECT_FALSE(exists(file_ + ".new")) << "a rest of it takes up room";
  bench_->machine->advance(0.001);
  EXPECT_EQ(bench_->machine->stateFileError(), "");
  EXPECT_NE(text().find("x linear 80000 0.016"), std::string::npos) << text();
}

TEST_F(StateFileTest, OnAFullDiskAtTheEndIsAnErrorOfItsOwnAndAllIsDisabled) {
  start();
  x().setPosition(0.0);
  ASSERT_TRUE(bench_->report().energized);
  std::string why;
  {
    const FullDisk full(0);
    try {
      bench_->machine->shutdown();
    } catch (const StateFileError& error) {
      why = error.what();
    }
  }
  EXPECT_EQ(why, "the state file " + file_ + ".new can't be written: File too large");
  EXPECT_FALSE(bench_->report().energized);
  start();
  EXPECT_EQ(state().position_note, "the node that kept this position wasn't shut down");
}

TEST_F(StateFileTest, SaysWhereItCannotBeWrittenLater) {
  start();
  x().setPosition(0.0);
  mkdir((file_ + ".new").c_str(), 0755);  // an obstacle, even for root
  bench_->move(0.008);
  bench_->machine->advance(0.001);
  EXPECT_EQ(bench_->machine->stateFileError(),
            "the state file " + file_ + ".new can't be written: Is a directory");
  EXPECT_THROW(bench_->machine->shutdown(), StateFileError);
  rmdir((file_ + ".new").c_str());
}

TEST_F(StateFileTest, IsKeptByAThreadOfItsOwn) {
  start(true);
  x().setPosition(0.0);
  bench_->move(0.008);
  start();
  EXPECT_DOUBLE_EQ(state().position, 0.008);
  EXPECT_TRUE(state().position_valid);
}

}  // namespace
}  // namespace stepdriver
