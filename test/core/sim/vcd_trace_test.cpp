#include "sim/vcd_trace.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdio>
#include <fstream>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/sim/rig.h"
#include "support/contents_of.h"
#include "support/full_disk.h"
#include "support/hand_rig.h"

namespace stepdriver::sim {
namespace {

class VcdTraceTest : public testing::Test {
 public:
  VcdTraceTest()
      : path_(testing::TempDir() + "stepdriver_" +
              testing::UnitTest::GetInstance()->current_test_info()->name() + ".vcd") {
    std::remove(path_.c_str());
  }
  ~VcdTraceTest() override { std::remove(path_.c_str()); }

 protected:
  std::string text() const { return test::contentsOf(path_); }

  static std::string whyNot(const std::string& path,
                            VcdTrace::Replaces replaces = VcdTrace::Replaces::kTraces) {
    try {
      const VcdTrace trace(path, replaces);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  static std::string whyIncomplete(VcdTrace& trace) {
    try {
      trace.flush();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  const std::string path_;
};

TEST_F(VcdTraceTest, WritesWhatViewersRead) {
  {
    VcdTrace trace(path_);
    trace.begin({{"x", "step"}, {"x", "dir"}, {"y", "step"}}, {false, true, false}, 5'000);
    trace.edge(0, true, 5'000);
    trace.edge(0, false, 6'500);
    trace.edge(2, true, 6'500);
    trace.edge(1, false, 1'000'000'005'001);
  }
  EXPECT_EQ(text(),
            "$version stepdriver $end\n"
            "$timescale 1 ns $end\n"
            "$scope module x $end\n"
            "$var wire 1 a step $end\n"
            "$var wire 1 b dir $end\n"
            "$upscope $end\n"
            "$scope module y $end\n"
            "$var wire 1 c step $end\n"
            "$upscope $end\n"
            "$enddefinitions $end\n"
            "#0\n"
            "$dumpvars\n"
            "0a\n"
            "1b\n"
            "0c\n"
            "$end\n"
            "1a\n"
            "#1500\n"
            "0a\n"
            "1c\n"
            "#1000000000001\n"
            "0b\n"
            "#1000000001001\n");
}

TEST_F(VcdTraceTest, EndsWithASummaryOfTheMotors) {
  {
    RigAxisSpec spec = test::plainAxis("a4988");
    spec.motor = MotorSpec{};
    const RigAxisSpec without_motor = test::plainAxis("a4988", "y");
    Rig rig({spec, without_motor}, std::make_shared<VcdTrace>(path_));
    rig.onRequest(rig.lineIndex("x.enable"), false, 1'000'000);
    rig.onRequest(rig.lineIndex("x.sleep"), true, 1'000'000);
    rig.onRequest(rig.lineIndex("x.reset"), true, 1'000'000);
    rig.onEdge(rig.lineIndex("x.step"), true, 2'000'000);
    rig.onEdge(rig.lineIndex("x.step"), false, 3'000'000);
  }
  const std::string end =
      "#2000000\n0a\n"
      "$comment x: largest lag 90.0 electrical degrees, 0 full steps lost $end\n"
      "#2001000\n";
  const std::string all = text();
  ASSERT_GT(all.size(), end.size());
  EXPECT_EQ(all.substr(all.size() - end.size()), end) << all;
}

TEST_F(VcdTraceTest, IsReadableWhileItGrowsAfterAFlush) {
  VcdTrace trace(path_);
  trace.begin({{"x", "step"}}, {false}, 0);
  trace.edge(0, true, 70);
  trace.flush();
  const std::string so_far = text();
  EXPECT_NE(so_far.find("#70\n1a\n"), std::string::npos) << so_far;
}

TEST_F(VcdTraceTest, KeepsEveryEdgeOfALongTrace) {
  constexpr int kEdges = 100'000;
  {
    VcdTrace trace(path_);
    trace.begin({{"x", "step"}}, {false}, 0);
    for (int i = 1; i <= kEdges; ++i) trace.edge(0, i % 2 == 1, std::int64_t{10} * i);
  }
  std::istringstream lines(text());
  int edges = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line == "0a" || line == "1a") ++edges;
  }
  EXPECT_EQ(edges, kEdges + 1) << "with the level at the beginning";
}

TEST_F(VcdTraceTest, HasAnIdentifierOfItsOwnForEachOfManyPins) {
  constexpr std::size_t kPins = 200;
  {
    VcdTrace trace(path_);
    trace.begin(std::vector<TracePin>(kPins, {"x", "step"}), std::vector<bool>(kPins, false), 0);
  }
  std::set<std::string> identifiers;
  std::istringstream words(text());
  for (std::string word; words >> word;) {
    if (word != "$var") continue;
    std::string identifier;
    words >> word >> word >> identifier;
    identifiers.insert(identifier);
  }
  EXPECT_EQ(identifiers.size(), kPins);
}

TEST_F(VcdTraceTest, HasNoBlanksOrSeparatorsInNames) {
  { VcdTrace(path_).begin({{"my axis:1", "step"}}, {false}, 0); }
  EXPECT_NE(text().find("$scope module my_axis_1 $end"), std::string::npos) << text();
  EXPECT_NE(text().find(" step $end"), std::string::npos) << text();
}

TEST_F(VcdTraceTest, IsTheSameForTheSameEdges) {
  const auto run = [&] {
    const auto trace = std::make_shared<VcdTrace>(path_);
    Rig rig({test::plainAxis("a4988")}, trace);
    const int step = rig.lineIndex("x.step");
    rig.onRequest(step, false, 42);
    for (int i = 0; i < 10; ++i) rig.onEdge(step, i % 2 == 0, 42 + 1'000 * i);
    rig.flushTrace();
    return text();
  };
  const std::string first = run();
  EXPECT_EQ(run(), first);
  EXPECT_NE(first.find("#9000\n0a\n"), std::string::npos) << first;
}

TEST_F(VcdTraceTest, RefusesAFileThatItCannotWrite) {
  EXPECT_EQ(whyNot("/nowhere/at/all.vcd"),
            "the trace file /nowhere/at/all.vcd can't be written: No such file or directory");
}

TEST_F(VcdTraceTest, ReplacesATraceAndAnEmptyFile) {
  { VcdTrace(path_).begin({{"x", "step"}}, {false}, 0); }
  { VcdTrace(path_).begin({{"y", "step"}}, {false}, 0); }
  EXPECT_EQ(text().find("module x"), std::string::npos) << text();
  EXPECT_NE(text().find("module y"), std::string::npos) << text();
  { std::ofstream(path_, std::ios::trunc); }
  EXPECT_EQ(whyNot(path_), "");
}

TEST_F(VcdTraceTest, ReplacesNoOtherFileUnlessItMay) {
  for (const std::string& content :
       {std::string("my letter\n"), std::string("$"), std::string("$version other $end\n$scope"),
        std::string("$version stepdrive"), std::string(100'000, 'a')}) {
    std::ofstream(path_, std::ios::trunc) << content;
    EXPECT_EQ(whyNot(path_), "the trace file " + path_ +
                                 " exists and isn't a trace of the simulated rig: give another "
                                 "name, or set simulation/trace_overwrites_any_file to overwrite "
                                 "it");
    EXPECT_EQ(text(), content);
  }
  { VcdTrace(path_, VcdTrace::Replaces::kAnyFile).begin({{"x", "step"}}, {false}, 0); }
  EXPECT_EQ(text().rfind("$version stepdriver $end\n", 0), 0U) << text();
}

TEST_F(VcdTraceTest, DoesNotWaitForTheReaderOfAPipe) {
  ASSERT_EQ(mkfifo(path_.c_str(), 0600), 0);
  EXPECT_NE(whyNot(path_).find("isn't a trace"), std::string::npos) << whyNot(path_);
  EXPECT_EQ(whyNot(path_, VcdTrace::Replaces::kAnyFile),
            "the trace file " + path_ + " can't be written: No such device or address");
}

TEST_F(VcdTraceTest, SaysAtEachFlushThatTheFileIsIncomplete) {
  std::ifstream full("/dev/full");
  if (!full) GTEST_SKIP() << "no /dev/full here";
  VcdTrace trace("/dev/full", VcdTrace::Replaces::kAnyFile);
  trace.begin({{"x", "step"}}, {false}, 0);
  for (int i = 1; i <= 2; ++i) {
    trace.edge(0, i % 2 == 1, i);
    EXPECT_EQ(whyIncomplete(trace),
              "the trace file /dev/full is incomplete, because it couldn't be written: No space "
              "left on device");
  }
}

TEST_F(VcdTraceTest, EndsWithTheLastWriteThatSucceededIfTheDiskIsFull) {
  std::string so_far;
  std::string why;
  {
    VcdTrace trace(path_);
    trace.begin({{"x", "step"}}, {false}, 0);
    trace.flush();
    so_far = text();
    {
      const test::FullDisk full(so_far.size() + 3);  // in the middle of a time stamp
      trace.edge(0, true, 123'456'789);
      why = whyIncomplete(trace);
    }
    trace.edge(0, false, 123'456'790);  // not without the one before
  }
  EXPECT_EQ(why, "the trace file " + path_ +
                     " is incomplete, because it couldn't be written: File too large");
  EXPECT_EQ(text(), so_far);
}

}  // namespace
}  // namespace stepdriver::sim
