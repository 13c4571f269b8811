#include "gpio/libgpiod/held_lines.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <ctime>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

namespace stepdriver::gpio::gpiod {
namespace {

struct Call {
  int chip;
  LineBits lines;
  LineBits levels;

  bool operator==(const Call& other) const {
    return chip == other.chip && lines == other.lines && levels == other.levels;
  }
};

/// The requests that reach the kernel.
struct Kernel {
  std::vector<Call> calls;
  int error = 0;
  std::atomic<int> inside{0};
  std::atomic<int> most_inside{0};
};

class FakeOutputs : public Outputs {
 public:
  FakeOutputs(Kernel& kernel, int chip) : kernel_(kernel), chip_(chip) {}

  int set(LineBits lines, LineBits levels) noexcept override {
    if (++kernel_.inside > kernel_.most_inside) kernel_.most_inside = kernel_.inside.load();
    std::this_thread::yield();
    kernel_.calls.push_back({chip_, lines, levels});
    --kernel_.inside;
    return kernel_.error;
  }

 private:
  Kernel& kernel_;
  const int chip_;
};

class FakeInputs : public Inputs {
 public:
  explicit FakeInputs(int fd) : fds_{fd} {}

  int get(int line) noexcept override { return line; }
  const std::vector<int>& edgeFds() const override { return fds_; }
  int takeEdges(std::size_t /*fd*/, EdgeEvent* edges, std::size_t /*capacity*/) noexcept override {
    char byte = 0;
    if (::read(fds_[0], &byte, 1) != 1) return -errno;
    edges[0] = edge;
    return error == 0 ? 1 : -error;
  }

  EdgeEvent edge{0, true, 0};
  int error = 0;

 private:
  std::vector<int> fds_;
};

class HeldLinesTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(pipe(edges), 0);
    HeldLines::Parts parts;
    for (const int chip : {0, 1}) {
      parts.output_groups.push_back(std::make_unique<OutputGroup>());
      parts.output_groups.back()->request = std::make_unique<FakeOutputs>(kernel, chip);
    }
    parts.output_groups[0]->levels = 0b10;
    parts.outputs = {{{0, 0}, false, false}, {{1, 0}, false, false}, {{0, 1}, true, false}};
    auto fake = std::make_unique<FakeInputs>(edges[0]);
    inputs = fake.get();
    parts.input_groups.push_back(std::make_unique<InputGroup>());
    parts.input_groups[0]->request = std::move(fake);
    parts.input_groups[0]->inputs = {0};
    parts.inputs = {{0, 0}};
    lines = std::make_unique<HeldLines>(std::move(parts));
  }
  void TearDown() override {
    lines.reset();
    close(edges[0]);
    close(edges[1]);
  }

  void makeEdge() { EXPECT_EQ(::write(edges[1], "", 1), 1); }

  int write(const std::vector<LineWrite>& writes) {
    return lines->write(writes.data(), writes.size());
  }

  static std::int64_t monotonic() {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
  }

  int edges[2] = {-1, -1};
  Kernel kernel;
  FakeInputs* inputs = nullptr;
  std::unique_ptr<HeldLines> lines;
};

using Calls = std::vector<Call>;

TEST_F(HeldLinesTest, MakeOneCallForEachChipOfAWrite) {
  EXPECT_EQ(write({{2, false}, {1, true}, {0, true}}), 0);
  EXPECT_EQ(kernel.calls, (Calls{{0, 0b11, 0b01}, {1, 0b1, 0b1}}));
}

TEST_F(HeldLinesTest, KnowTheLevelsOfTheLinesThatAWriteDoesNotName) {
  EXPECT_EQ(write({{0, true}}), 0);
  EXPECT_EQ(write({{2, false}}), 0);
  EXPECT_EQ(kernel.calls, (Calls{{0, 0b01, 0b11}, {0, 0b10, 0b01}}));
}

TEST_F(HeldLinesTest, ForgetTheLevelsOfAWriteThatFailed) {
  kernel.error = EIO;
  EXPECT_EQ(write({{0, true}}), EIO);
  kernel.error = 0;
  kernel.calls.clear();
  EXPECT_EQ(write({{2, true}}), 0);
  EXPECT_EQ(kernel.calls, (Calls{{0, 0b10, 0b10}})) << "or the failed step would go out now";
}

TEST_F(HeldLinesTest, MakeNoCallForAnIndexThatIsWrong) {
  EXPECT_EQ(write({{0, true}, {3, true}}), EINVAL);
  EXPECT_EQ(kernel.calls, Calls{});
}

TEST_F(HeldLinesTest, TryToMakeEachLineSafeEvenWhereThatFails) {
  EXPECT_EQ(write({{0, true}, {1, true}}), 0);
  kernel.calls.clear();
  kernel.error = ENODEV;
  lines.reset();
  EXPECT_EQ(kernel.calls, (Calls{{0, 0b01, 0b10}, {1, 0b1, 0b0}, {0, 0b10, 0b11}}));
}

TEST_F(HeldLinesTest, LetOneThreadAtATimeSetALineOfAChip) {
  constexpr int kWrites = 2000;
  std::vector<std::thread> writers;
  for (const int output : {0, 2}) {
    writers.emplace_back([this, output] {
      for (int i = 0; i < kWrites; ++i) EXPECT_EQ(write({{output, i % 2 == 0}}), 0);
    });
  }
  for (std::thread& writer : writers) writer.join();
  EXPECT_EQ(kernel.most_inside, 1);
  EXPECT_EQ(kernel.calls.size(), std::size_t{2} * kWrites);
}

TEST_F(HeldLinesTest, KeepTheKernelsTimeOfAnEdge) {
  const std::int64_t now = monotonic();
  inputs->edge.time_ns = now - 5;
  makeEdge();
  EdgeEvent event{};
  ASSERT_EQ(lines->waitForEdges(-1, &event, 1), 1);
  EXPECT_EQ(event.time_ns, now - 5);
}

TEST_F(HeldLinesTest, TakeTheTimeNowForAnEdgeOfAnotherClock) {
  inputs->edge.time_ns = 4'000'000'000'000'000'000;  // as CLOCK_REALTIME will read in 2096
  makeEdge();
  EdgeEvent event{};
  const std::int64_t before = monotonic();
  ASSERT_EQ(lines->waitForEdges(-1, &event, 1), 1);
  EXPECT_GE(event.time_ns, before);
  EXPECT_LE(event.time_ns, monotonic());
}

TEST_F(HeldLinesTest, SayThatEdgesCannotBeRead) {
  inputs->error = EIO;
  makeEdge();
  EdgeEvent event{};
  EXPECT_EQ(lines->waitForEdges(-1, &event, 1), -EIO);
}

TEST_F(HeldLinesTest, SayThatTheChipIsGoneWhereItsEdgesHaveHungUp) {
  close(edges[1]);
  edges[1] = -1;
  EdgeEvent event{};
  EXPECT_EQ(lines->waitForEdges(-1, &event, 1), -ENODEV);
  EXPECT_EQ(lines->waitForEdges(1'000'000, &event, 1), 0) << "once: the others are waited for";
}

}  // namespace
}  // namespace stepdriver::gpio::gpiod
