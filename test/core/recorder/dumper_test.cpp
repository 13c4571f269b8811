#include "stepdriver_core/recorder/dumper.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "support/bench.h"
#include "support/contents_of.h"
#include "support/full_disk.h"
#include "support/temporary_folder.h"

namespace stepdriver {
namespace {

using recorder::Dump;
using recorder::Dumper;
using recorder::DumperOptions;
using test::Bench;
using test::contentsOf;
using test::FullDisk;
using test::linearAxis;
using Names = std::vector<std::string>;

// The recordings that the dumper has reported.
class Told {
 public:
  void add(const Dump& dump) {
    const std::lock_guard<std::mutex> lock(mutex_);
    dumps_.push_back(dump);
    changed_.notify_all();
  }
  // Waits until there are this many.
  std::vector<Dump> await(std::size_t count,
                          std::chrono::milliseconds bound = std::chrono::seconds(30)) {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait_for(lock, bound, [&] { return dumps_.size() >= count; });
    return dumps_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Dump> dumps_;
};

// The levels of each line alternate, and the times rise.
std::string whatIsWrongWith(const machine::Recording& recording) {
  std::vector<bool> levels = recording.levels;
  pulse::Nanoseconds last = recording.begin;
  for (const machine::Recording::Edge& edge : recording.edges) {
    const std::string place =
        "output " + std::to_string(edge.output) + " at " + std::to_string(edge.time);
    if (edge.time < last || edge.time > recording.end) return place + ": the time";
    last = edge.time;
    const auto output = static_cast<std::size_t>(edge.output);
    if (levels[output] == edge.level) return place + ": the level";
    levels[output] = edge.level;
  }
  return "";
}

class DumperTest : public testing::Test {
 protected:
  void SetUp() override {
    options_.folder = scratch_.path() + "/a/b";
    options_.request_pause = std::chrono::milliseconds(0);
    makeMachine(false);
  }
  void makeMachine(bool threaded) {
    bench_.reset();
    machine::MachineOptions options;
    options.record_seconds = 10.0;
    options.record_bytes = 1'000'000;
    const std::vector<config::AxisConfig> axes{linearAxis("x"), linearAxis("y", "tb6600")};
    bench_ = std::make_unique<Bench>(axes, Bench::rigAxes(axes), threaded, 0.0, options);
  }

  Dumper& start() {
    dumper_ = std::make_unique<Dumper>(*bench_->machine, options_,
                                       [this](const Dump& dump) { told_.add(dump); });
    return *dumper_;
  }
  Names files() const {
    Names names;
    if (!std::filesystem::exists(options_.folder)) return names;
    for (const auto& entry : std::filesystem::directory_iterator(options_.folder)) {
      names.push_back(entry.path().filename().string());
    }
    std::sort(names.begin(), names.end());
    return names;
  }
  // A fault of x: its STEP line fails.
  void fail() {
    bench_->rig.clearWriteFault("x.step");
    bench_->machine->recover();
    bench_->rig.failWrites("x.step", 20, EIO);
    axis::Axis& x = bench_->axis("x");
    EXPECT_EQ(x.wait(x.moveTo(0.001, true)).end, axis::MoveEnd::kFault);
  }

  const test::TemporaryFolder scratch_;
  DumperOptions options_;
  std::unique_ptr<Bench> bench_;
  Told told_;
  std::unique_ptr<Dumper> dumper_;
};

TEST_F(DumperTest, WritesATraceAndItsEventsThatOnlyTheirOwnerCanRead) {
  bench_->move(0.001);
  bench_->move(0.000'5, "y");
  const Dump dump = start().dump("a test");
  EXPECT_EQ(dump.error, "");
  EXPECT_EQ(dump.reason, "a test");
  ASSERT_EQ(files().size(), 2U);
  for (const std::string& path : {dump.trace, dump.events}) {
    struct stat facts {};
    ASSERT_EQ(stat(path.c_str(), &facts), 0) << path;
    EXPECT_EQ(facts.st_mode & 0777U, 0600U) << path;
  }
  const std::string trace = contentsOf(dump.trace);
  for (const char* words :
       {"$version stepdriver $end\n", "$scope module x $end\n", "$var wire 1 a step $end\n",
        "$comment x.step active high $end\n", "$comment x.enable active low $end\n",
        "$scope module y $end\n", "$comment y.step active high $end\n"}) {
    EXPECT_NE(trace.find(words), std::string::npos) << words << trace.substr(0, 900);
  }
  std::size_t pulses = 0;
  for (auto at = trace.find("\n1a\n"); at != std::string::npos; at = trace.find("\n1a\n", at + 1)) {
    ++pulses;
  }
  EXPECT_EQ(pulses, 80U);
  const machine::Recording recording = bench_->machine->recording();
  const std::string end = "#" + std::to_string(recording.end - recording.begin) + "\n";
  ASSERT_GE(trace.size(), end.size());
  EXPECT_EQ(trace.substr(trace.size() - end.size()), end);

  const std::string events = contentsOf(dump.events);
  for (const std::string& words :
       {std::string("reason:  a test\n"), std::string("move x to 0.001 m"),
        std::filesystem::path(dump.trace).filename().string(),
        std::string("reached its end at count 80")}) {
    EXPECT_NE(events.find(words), std::string::npos) << words << "\n" << events;
  }
  EXPECT_EQ(dumper_->last().trace, dump.trace);
  EXPECT_EQ(dumper_->error(), "");
}

TEST_F(DumperTest, WritesAtAFaultAndOnceForAFaultThatChatters) {
  options_.fault_pause = std::chrono::hours(1);
  start();
  fail();
  ASSERT_EQ(told_.await(1).size(), 1U);
  EXPECT_EQ(told_.await(1)[0].reason, "fault");
  EXPECT_NE(contentsOf(told_.await(1)[0].events).find("x: fault: "), std::string::npos);
  for (int i = 0; i < 20; ++i) fail();
  EXPECT_EQ(told_.await(2, std::chrono::milliseconds(300)).size(), 1U);
  EXPECT_EQ(files().size(), 2U);
  // The faults since then aren't lost.
  dumper_.reset();
  EXPECT_EQ(told_.await(2).size(), 2U);
  EXPECT_EQ(files().size(), 4U);
}

TEST_F(DumperTest, KeepsTheLatestRecordingsAndNoFileOfOthersIsRemoved) {
  options_.keep = 3;
  std::filesystem::create_directories(options_.folder);
  const Names others{"stepdriver.vcd", "stepdriver_notes.txt", "other_20260101-000000_1.vcd",
                     "stepdriver_20260101-000000_x.txt", "stepdriver_20260101-000000_.vcd"};
  for (const std::string& name : others) std::ofstream(options_.folder + "/" + name) << "mine";
  // From a time at which the clock was wrong: it is the oldest one all the same.
  for (const char* name :
       {"stepdriver_20990101-000000_3.vcd", "stepdriver_20990101-000000_3.txt"}) {
    std::ofstream(options_.folder + "/" + name) << "old";
  }
  start();
  Names written;
  for (int i = 0; i < 6; ++i) {
    const Dump dump = dumper_->dump("a test");
    ASSERT_EQ(dump.error, "");
    written.push_back(std::filesystem::path(dump.trace).filename().string());
    written.push_back(std::filesystem::path(dump.events).filename().string());
  }
  Names expected = others;
  expected.insert(expected.end(), written.end() - 6, written.end());
  std::sort(expected.begin(), expected.end());
  EXPECT_EQ(files(), expected);
}

TEST_F(DumperTest, OnAFullDiskLeavesNoFileAndMovesOnAndTriesAgain) {
  bench_->move(0.01);
  start();
  for (const rlim_t size : {rlim_t{0}, rlim_t{5'000}}) {
    const FullDisk full(size);
    const Dump dump = dumper_->dump("a test");
    EXPECT_NE(dump.error.find("File too large"), std::string::npos) << dump.error;
    EXPECT_NE(dump.error.find(options_.folder), std::string::npos) << dump.error;
    EXPECT_EQ(dumper_->error(), dump.error);
    EXPECT_EQ(files(), Names{});
    EXPECT_EQ(bench_->move(bench_->axis().state().position + 0.001).end, axis::MoveEnd::kReached);
  }
  EXPECT_EQ(dumper_->last().reason, "");
  EXPECT_EQ(dumper_->dump("a test").error, "");
  EXPECT_EQ(dumper_->error(), "");
  EXPECT_EQ(files().size(), 2U);
}

TEST_F(DumperTest, FollowsNoLinkAndSaysThatItsFolderIsNone) {
  std::ofstream(scratch_.path() + "/a") << "a file";
  const Dump dump = start().dump("a test");
  EXPECT_NE(dump.error.find("the folder " + options_.folder + ": "), std::string::npos)
      << dump.error;
}

// No edge is torn, missing or twice.
TEST_F(DumperTest, WritesWholeRecordingsWhileTheMachineMoves) {
  makeMachine(true);
  start();
  std::atomic<bool> ending{false};
  std::thread mover([&] {
    for (int i = 0; !ending; ++i) {
      bench_->move(i % 2 == 0 ? 0.05 : 0.0);
      bench_->axis("y").enable(i % 2 == 0);
    }
  });
  bool shortened = false;
  const auto latest = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  for (int i = 0; i < 30 || (!shortened && std::chrono::steady_clock::now() < latest); ++i) {
    const machine::Recording recording = bench_->machine->recording();
    shortened = shortened || recording.shortened;
    EXPECT_EQ(whatIsWrongWith(recording), "");
    EXPECT_EQ(dumper_->dump("a test").error, "");
  }
  ending = true;
  mover.join();
  EXPECT_TRUE(shortened) << "nothing was overwritten";
  EXPECT_EQ(bench_->pulses(), std::llround(bench_->axis().state().position * 80'000.0));
}

// A client that calls ~dump all the time, or kill -USR1 in a loop.
TEST_F(DumperTest, GivesRequestsThatComeTogetherOneRecording) {
  options_.request_pause = std::chrono::milliseconds(300);
  start();
  EXPECT_EQ(dumper_->dump("first").error, "");
  for (int i = 0; i < 1'000; ++i) dumper_->request("flood");
  const Dump dump = dumper_->dump("last");
  EXPECT_EQ(dump.reason, "flood");
  EXPECT_LE(told_.await(2).size(), 3U);
}

}  // namespace
}  // namespace stepdriver
