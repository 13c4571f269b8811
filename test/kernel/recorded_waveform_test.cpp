#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "machine_waveform.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/recorder/dumper.h"
#include "support/vcd_reader.h"

// Compares the files of the flight recorder with the kernel's own trace.

namespace stepdriver::kernel {
namespace {

struct Recorded {
  std::map<std::string, node_test::Waveform> waveforms;  ///< by `axis/pin`
  std::int64_t begin_ns = 0;                             ///< time 0 of the waveforms
  std::int64_t end_ns = 0;
};

Recorded readDump(const recorder::Dump& dump, const machine::Recording& recording) {
  Recorded recorded;
  recorded.waveforms = node_test::readVcd(dump.trace);
  // The text says the time of the zero.
  std::ifstream file(dump.events);
  for (std::string line; std::getline(file, line);) {
    const std::string title = "time 0:  ";
    if (line.rfind(title, 0) != 0) continue;
    const std::string number = line.substr(title.size());
    const std::size_t point = number.find('.');
    recorded.begin_ns = std::stoll(number.substr(0, point)) * 1'000'000'000 +
                        std::stoll(number.substr(point + 1, 9));
  }
  recorded.end_ns = recording.end;
  return recorded;
}

class RecordedWaveform : public MachineWaveform {
 protected:
  /// The kernel stamps an edge just before it makes it, the recorder right after: each recorded
  /// edge is between that of the kernel and the next one of the same line.
  void expectSame(const Recorded& recorded, const std::string& name, const config::Pin& pin) {
    const unsigned line = trace->line(pin.line);
    std::vector<LineEdge> expected;
    for (const LineEdge& edge : trace->edges(line)) {
      if (edge.time_ns <= recorded.end_ns) expected.push_back(edge);
    }
    const auto& all = recorded.waveforms.at(name).edges;
    ASSERT_FALSE(all.empty()) << name;
    EXPECT_EQ(all.front().level, trace->firstLevel(line)) << name;
    ASSERT_EQ(all.size() - 1, expected.size()) << name;
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const std::int64_t time_ns = recorded.begin_ns + all[i + 1].time_ns;
      ASSERT_EQ(all[i + 1].level, expected[i].level) << name << ", edge " << i;
      ASSERT_GE(time_ns, expected[i].time_ns) << name << ", edge " << i;
      if (i + 1 < expected.size()) {
        ASSERT_LE(time_ns, expected[i + 1].time_ns) << name << ", edge " << i;
      }
    }
    edges_ += expected.size();
  }

  std::size_t edges_ = 0;
};

TEST_F(RecordedWaveform, IsTheKernelsEdgeForEdge) {
  const std::vector<config::AxisConfig> axes = {
      axisAt("x", "a4988", placeAt("board-0", 0)),
      axisAt("y", "tb6600", {{"board-0:4", true}, {"board-1:0", true}, {"board-1:1", true}})};
  const std::string folder = "/run/stepdriver-recordings";
  KernelBench bench(axes);
  const axis::Move first = bench.start("x", 800);
  EXPECT_EQ(bench.axis("y").wait(bench.start("y", -500)).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.axis("x").wait(first).end, axis::MoveEnd::kReached);
  bench.axis("y").enable(false);
  bench.axis("y").enable(true);
  bench.start("x", -2'000);
  bench.awaitCount("x", 700);
  bench.emergencyStop();
  bench.recover();
  EXPECT_EQ(bench.axis("x").wait(bench.start("x", 100)).end, axis::MoveEnd::kReached);

  recorder::DumperOptions options;
  options.folder = folder;
  Recorded recorded;
  {
    recorder::Dumper dumper(bench.machine(), options);
    const recorder::Dump dump = dumper.dump("a test");
    ASSERT_EQ(dump.error, "");
    recorded = readDump(dump, bench.machine().recording());
  }
  std::filesystem::remove_all(folder);
  read(bench, axes);
  for (const config::AxisConfig& axis : axes) {
    expectSame(recorded, axis.name + "/step", axis.pins.step);
    expectSame(recorded, axis.name + "/dir", axis.pins.dir);
    expectSame(recorded, axis.name + "/enable", axis.pins.enable);
  }
  EXPECT_GT(edges_, 2U * (800 + 500 + 100));
}

}  // namespace
}  // namespace stepdriver::kernel
