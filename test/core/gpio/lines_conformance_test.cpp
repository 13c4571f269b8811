#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/lines.h"
#include "support/constants.h"
#include "support/test_board.h"

// Tests for every backend. The simulated backend is always tested, libgpiod only if the kernel has
// simulated chips.

namespace stepdriver::gpio {
namespace {

using test::Driven;
using test::kMillisecond;
using test::TestBoardKind;

constexpr std::int64_t kLong = 20'000 * kMillisecond;

constexpr const char* kNoTrace = "this kernel doesn't trace its lines";

bool before(const Driven& one, const Driven& other) { return one.line < other.line; }

class LinesConformance : public testing::TestWithParam<TestBoardKind> {
 protected:
  void SetUp() override {
    const std::string missing = GetParam().missing();
    if (!missing.empty()) GTEST_SKIP() << missing;
    board = GetParam().make();
    for (const int chip : {0, 1}) {
      for (unsigned offset = 0; offset < 8; ++offset) {
        line.push_back(board->line(chip, offset));
      }
    }
    board->takeDriven();
  }

  std::unique_ptr<Lines> request(const std::vector<OutputRequest>& outputs,
                                 const std::vector<InputRequest>& inputs = {}) {
    return board->backend().request(outputs, inputs);
  }

  std::string refusal(const std::vector<OutputRequest>& outputs,
                      const std::vector<InputRequest>& inputs) {
    try {
      request(outputs, inputs);
    } catch (const GpioError& error) {
      return error.what();
    }
    return "none";
  }

  static int write(Lines& lines, const std::vector<LineWrite>& writes) {
    return lines.write(writes.data(), writes.size());
  }

  std::string levels(const std::vector<std::string>& of) {
    std::string text;
    for (const std::string& each : of) text += board->level(each) ? '1' : '0';
    return text;
  }

  // @return false if the board can't tell.
  bool takeDriven(std::vector<Driven>& driven) {
    auto taken = board->takeDriven();
    if (!taken) return false;
    driven = std::move(*taken);
    return true;
  }

  void pause() const { std::this_thread::sleep_for(std::chrono::nanoseconds(board->pace())); }

  // Takes edges until no more come for a while.
  std::vector<EdgeEvent> drain(Lines& lines) const {
    std::vector<EdgeEvent> all;
    EdgeEvent events[4];
    for (int count = lines.waitForEdges(kLong, events, 4); count > 0;
         count = lines.waitForEdges(2 * board->pace(), events, 4)) {
      all.insert(all.end(), events, events + count);
    }
    return all;
  }

  std::unique_ptr<test::TestBoard> board;
  std::vector<std::string> line;  // 0 to 7 are on one chip, 8 to 15 on the other
};

TEST_P(LinesConformance, HaveTheirSafeLevelsFromTheRequestOnWithoutAGlitch) {
  const auto lines = request({{line[2], true, false},
                              {line[0], false, false},
                              {line[9], true, false},
                              {line[5], true, false}});
  EXPECT_EQ(levels({line[2], line[0], line[9], line[5]}), "1011");
  std::vector<Driven> driven;
  if (!takeDriven(driven)) GTEST_SKIP() << kNoTrace;
  std::sort(driven.begin(), driven.end(), before);
  EXPECT_EQ(driven, (std::vector<Driven>{
                        {line[0], false}, {line[2], true}, {line[5], true}, {line[9], true}}));
}

TEST_P(LinesConformance, ChangeWhatAWriteNamesAndNothingElse) {
  const auto lines =
      request({{line[0], true, false}, {line[1], false, false}, {line[2], true, false}});
  board->takeDriven();
  EXPECT_EQ(write(*lines, {{1, true}}), 0);
  EXPECT_EQ(levels({line[0], line[1], line[2]}), "111");
  EXPECT_EQ(write(*lines, {{0, false}, {2, true}}), 0);
  EXPECT_EQ(levels({line[0], line[1], line[2]}), "011");
  EXPECT_EQ(write(*lines, {{2, false}, {1, false}}), 0);
  EXPECT_EQ(levels({line[0], line[1], line[2]}), "000");
  EXPECT_EQ(write(*lines, {}), 0) << "nothing to write";
  std::vector<Driven> driven;
  if (!takeDriven(driven)) GTEST_SKIP() << kNoTrace;
  ASSERT_EQ(driven.size(), 4U);
  std::sort(driven.begin() + 2, driven.end(), before);
  EXPECT_EQ(driven, (std::vector<Driven>{
                        {line[1], true}, {line[0], false}, {line[1], false}, {line[2], false}}));
}

TEST_P(LinesConformance, ChangeOnSeveralChipsInOneWrite) {
  const auto lines = request({{line[0], false, false},
                              {line[8], false, false},
                              {line[1], false, false},
                              {line[9], false, false}});
  EXPECT_EQ(write(*lines, {{1, true}, {0, true}, {3, true}, {2, true}}), 0);
  EXPECT_EQ(levels({line[0], line[8], line[1], line[9]}), "1111");
  EXPECT_EQ(write(*lines, {{3, false}, {2, false}}), 0);
  EXPECT_EQ(levels({line[0], line[8], line[1], line[9]}), "1100");
}

TEST_P(LinesConformance, TakeTheLastOfTwoLevelsInOneWrite) {
  const auto lines = request({{line[0], false, false}});
  EXPECT_EQ(write(*lines, {{0, false}, {0, true}}), 0);
  EXPECT_EQ(levels({line[0]}), "1");
  EXPECT_EQ(write(*lines, {{0, true}, {0, false}}), 0);
  EXPECT_EQ(levels({line[0]}), "0");
}

TEST_P(LinesConformance, ReadEachInputAsItIsNow) {
  const auto lines =
      request({{line[3], true, false}},
              {{line[0]}, {line[1]}, {line[2], Bias::kAsIs, true}, {line[8]}, {line[4]}});
  const std::vector<int> all = {0, 1, 2, 3, 4};
  const std::vector<std::string> names = {line[0], line[1], line[2], line[8], line[4]};
  for (const std::string& name : names) board->drive(name, false);
  for (std::size_t high = 0; high < names.size(); ++high) {
    board->drive(names[high], true);
    for (const int input : all) {
      EXPECT_EQ(lines->read(input), static_cast<std::size_t>(input) == high ? 1 : 0)
          << "input " << input << " while " << high << " is high";
    }
    board->drive(names[high], false);
  }
}

TEST_P(LinesConformance, RefuseIndexesThatTheRequestDoesNotHave) {
  const auto lines = request({{line[0], false, false}}, {{line[1]}});
  EXPECT_EQ(write(*lines, {{0, true}, {1, true}}), EINVAL);
  EXPECT_EQ(write(*lines, {{-1, true}}), EINVAL);
  EXPECT_EQ(lines->read(1), -EINVAL);
  EXPECT_EQ(lines->read(-1), -EINVAL);
  EdgeEvent event{};
  EXPECT_EQ(lines->waitForEdges(kLong, &event, 0), -EINVAL);
  EXPECT_EQ(levels({line[0]}), "0");
}

TEST_P(LinesConformance, AreHeldByOneRequestAtATime) {
  auto lines = request({{line[0], false, false}}, {{line[1]}});
  for (const int each : {0, 1}) {
    const std::string& wanted = line[static_cast<std::size_t>(each)];
    for (const std::string& text :
         {refusal({{wanted, false, false}}, {}), refusal({}, {{wanted}})}) {
      EXPECT_NE(text.find(wanted), std::string::npos) << text;
      EXPECT_NE(text.find("EBUSY"), std::string::npos) << text;
    }
  }
  lines.reset();
  EXPECT_EQ(refusal({{line[0], false, false}}, {{line[1]}}), "none");
}

TEST_P(LinesConformance, AreTakenAllOrNone) {
  const auto lines = request({{line[8], false, false}});
  board->takeDriven();
  EXPECT_NE(refusal({{line[0], true, false}, {line[8], true, false}}, {{line[1]}}), "none");
  EXPECT_NE(refusal({{line[0], true, false}}, {{line[1]}, {line[8]}}), "none");
  EXPECT_EQ(refusal({{line[0], false, false}}, {{line[1]}}), "none") << "they are still free";
  std::vector<Driven> driven;
  if (!takeDriven(driven)) GTEST_SKIP() << kNoTrace;
  EXPECT_EQ(driven, (std::vector<Driven>{{line[0], false}})) << "driven by a request that failed";
}

TEST_P(LinesConformance, AreNamedOnceInARequest) {
  for (const std::string& text :
       {refusal({{line[0], false, false}, {line[0], true, false}}, {}),
        refusal({{line[0], false, false}}, {{line[0]}}), refusal({}, {{line[0]}, {line[0]}})}) {
    EXPECT_NE(text.find(line[0]), std::string::npos) << text;
    EXPECT_NE(text.find("named twice"), std::string::npos) << text;
  }
  EXPECT_EQ(refusal({{line[0], false, false}}, {}), "none");
}

TEST_P(LinesConformance, DriveTheSafeLevelsInOrderBeforeTheyAreReleased) {
  auto lines = request({{line[2], true, false},
                        {line[8], false, false},
                        {line[0], false, false},
                        {line[1], false, true},
                        {line[3], true, false}});
  EXPECT_EQ(write(*lines, {{0, false}, {1, true}, {2, true}, {3, true}}), 0);
  board->takeDriven();
  lines.reset();
  std::vector<Driven> driven;
  if (!takeDriven(driven)) GTEST_SKIP() << kNoTrace;
  EXPECT_EQ(driven, (std::vector<Driven>{{line[2], true}, {line[8], false}, {line[0], false}}))
      << "one keeps its level, and the last stands safe already";
}

TEST_P(LinesConformance, CanBeRequestedForNothing) {
  const auto lines = request({});
  EXPECT_EQ(write(*lines, {}), 0);
  EXPECT_EQ(lines->read(0), -EINVAL);
}

TEST_P(LinesConformance, DoNotUndoWhatAnotherThreadWrites) {
  constexpr int kWrites = 300;
  const auto lines = request({{line[0], false, false}, {line[1], false, false}}, {{line[2]}});
  std::vector<std::thread> writers;
  for (const int output : {0, 1}) {
    writers.emplace_back([&, output] {
      for (int i = 0; i < kWrites; ++i) {
        const bool level = i % 2 == 0;
        const LineWrite one{output, level};
        ASSERT_EQ(lines->write(&one, 1), 0);
        ASSERT_EQ(board->level(line[static_cast<std::size_t>(output)]), level)
            << "output " << output << ", write " << i;
        ASSERT_EQ(lines->read(0), 0);
      }
    });
  }
  for (std::thread& writer : writers) writer.join();
}

TEST_P(LinesConformance, WakeWhoWaitsForTheirEdges) {
  const auto lines =
      request({}, {{line[0]}, {line[1], Bias::kAsIs, true}, {line[8], Bias::kAsIs, true}});
  for (const auto& [input, name] : {std::make_pair(1, line[1]), std::make_pair(2, line[8])}) {
    for (const bool level : {true, false}) {
      EdgeEvent events[4];
      int count = 0;
      std::int64_t woken = 0;
      std::thread waiter([&] {
        count = lines->waitForEdges(kLong, events, 4);
        woken = board->now();
      });
      pause();
      const std::int64_t driven = board->now();
      board->drive(name, level);
      waiter.join();
      ASSERT_EQ(count, 1);
      EXPECT_EQ(events[0].input, input);
      EXPECT_EQ(events[0].level, level);
      EXPECT_GE(events[0].time_ns, driven);
      EXPECT_LE(events[0].time_ns, woken);
      EXPECT_EQ(lines->read(input), level ? 1 : 0);
      pause();
    }
  }
}

TEST_P(LinesConformance, WakeNobodyForInputsWithoutEdges) {
  const auto lines = request({{line[2], false, false}}, {{line[0]}, {line[1], Bias::kAsIs, true}});
  board->drive(line[0], true);
  EXPECT_EQ(write(*lines, {{0, true}}), 0);
  EdgeEvent event{};
  EXPECT_EQ(lines->waitForEdges(2 * board->pace(), &event, 1), 0);
  EXPECT_EQ(lines->read(0), 1);
}

TEST_P(LinesConformance, KeepEdgesForWhoWaitsLater) {
  const auto lines = request({}, {{line[0], Bias::kAsIs, true}, {line[1], Bias::kAsIs, true}});
  board->drive(line[1], true);
  pause();
  board->drive(line[0], true);
  pause();
  EdgeEvent event{};
  std::vector<int> inputs;
  for (int i = 0; i < 2; ++i) {
    ASSERT_EQ(lines->waitForEdges(kLong, &event, 1), 1);
    EXPECT_TRUE(event.level);
    inputs.push_back(event.input);
  }
  std::sort(inputs.begin(), inputs.end());
  EXPECT_EQ(inputs, (std::vector<int>{0, 1}));
  EXPECT_EQ(lines->waitForEdges(0, &event, 1), 0) << "each is told once";
}

TEST_P(LinesConformance, ReadRightAfterMoreEdgesThanAnyoneKeeps) {
  const auto lines = request({}, {{line[0], Bias::kAsIs, true}});
  for (int i = 0; i < 81; ++i) {
    board->drive(line[0], i % 2 == 0);
    pause();
  }
  const std::vector<EdgeEvent> edges = drain(*lines);
  EXPECT_GE(edges.size(), 1U);
  EXPECT_LE(edges.size(), 81U);
  EXPECT_EQ(lines->read(0), 1);
  board->drive(line[0], false);
  EXPECT_EQ(drain(*lines).size(), 1U) << "and the next one is told again";
}

TEST_P(LinesConformance, EndAWaitInTime) {
  const auto lines = request({}, {{line[0], Bias::kAsIs, true}});
  EdgeEvent event{};
  const std::int64_t begin = board->now();
  EXPECT_EQ(lines->waitForEdges(30 * kMillisecond, &event, 1), 0);
  EXPECT_GE(board->now() - begin, 29 * kMillisecond);
}

TEST_P(LinesConformance, EndAWaitWhenInterrupted) {
  for (const auto& lines :
       {request({{line[2], false, false}}), request({}, {{line[0], Bias::kAsIs, true}})}) {
    EdgeEvent event{};
    lines->interrupt();
    EXPECT_EQ(lines->waitForEdges(-1, &event, 1), 0) << "the one after it";
    int count = -1;
    std::thread waiter([&] { count = lines->waitForEdges(-1, &event, 1); });
    pause();
    lines->interrupt();
    waiter.join();
    EXPECT_EQ(count, 0) << "the one under way";
    const std::int64_t begin = board->now();
    EXPECT_EQ(lines->waitForEdges(30 * kMillisecond, &event, 1), 0);
    EXPECT_GE(board->now() - begin, 29 * kMillisecond) << "and none after it";
  }
}

INSTANTIATE_TEST_SUITE_P(On, LinesConformance,
                         testing::Values(test::simulatedBoard(), test::gpioSimBoard()),
                         [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace stepdriver::gpio
