#include "stepdriver_core/gpio/simulated_lines.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "stepdriver_core/error.h"
#include "support/line_names.h"

namespace stepdriver::gpio {
namespace {

/// Writes down each call, as in `edge a 1 @5`.
class Notebook : public Board {
 public:
  int lineIndex(const std::string& line) override { return names.indexOf(line); }
  void onRequest(int line, bool level, std::int64_t time_ns) override {
    note("request", line, level ? " 1" : " 0", time_ns);
  }
  void onEdge(int line, bool level, std::int64_t time_ns) override {
    note("edge", line, level ? " 1" : " 0", time_ns);
  }
  void onRelease(int line, std::int64_t time_ns) override { note("release", line, "", time_ns); }
  bool inputLevel(int line, std::int64_t /*time_ns*/) override { return levels[names[line]]; }
  int writeFault(int line, std::int64_t /*time_ns*/) override { return faults[names[line]]; }

  std::vector<std::string> take() { return std::exchange(notes, {}); }

  test::LineNames names;
  std::map<std::string, bool> levels;
  std::map<std::string, int> faults;
  std::vector<std::string> notes;

 private:
  void note(const std::string& event, int line, const std::string& level, std::int64_t time_ns) {
    notes.push_back(event + " " + names[line] + level + " @" + std::to_string(time_ns));
  }
};

using Notes = std::vector<std::string>;

class SimulatedLinesTest : public testing::Test {
 protected:
  int write(Lines& lines, const std::vector<LineWrite>& writes) {
    return lines.write(writes.data(), writes.size());
  }

  std::string refusal(const std::vector<OutputRequest>& outputs,
                      const std::vector<InputRequest>& inputs) {
    try {
      backend.request(outputs, inputs);
    } catch (const GpioError& error) {
      return error.what();
    }
    return "none";
  }

  std::int64_t now = 0;
  Notebook board;
  SimulatedBackend backend{board, [this] { return now; }};
};

TEST_F(SimulatedLinesTest, TellTheBoardTheLevelsOfTheRequest) {
  now = 3;
  const auto lines = backend.request({{"a", true, false}, {"b", false, false}}, {{"c"}});
  EXPECT_EQ(board.take(), (Notes{"request a 1 @3", "request b 0 @3"}));
}

TEST_F(SimulatedLinesTest, TellTheBoardOnlyWhatChanges) {
  const auto lines = backend.request({{"a", true, false}, {"b", false, false}}, {});
  board.take();
  now = 7;
  EXPECT_EQ(write(*lines, {{1, true}, {0, true}}), 0);
  EXPECT_EQ(board.take(), (Notes{"edge b 1 @7"}));
  EXPECT_EQ(write(*lines, {{0, false}, {1, false}}), 0);
  EXPECT_EQ(board.take(), (Notes{"edge a 0 @7", "edge b 0 @7"}));
}

TEST_F(SimulatedLinesTest, ReadWhatTheBoardDecides) {
  const auto lines = backend.request({}, {{"c"}, {"d"}});
  board.levels["d"] = true;
  EXPECT_EQ(lines->read(0), 0);
  EXPECT_EQ(lines->read(1), 1);
}

TEST_F(SimulatedLinesTest, ApplyNothingOfAWriteThatFails) {
  const auto lines = backend.request({{"a", false, false}, {"b", false, false}}, {});
  board.take();
  board.faults["b"] = EIO;
  EXPECT_EQ(write(*lines, {{0, true}, {1, true}}), EIO);
  EXPECT_EQ(board.take(), Notes{});
  EXPECT_EQ(write(*lines, {{0, true}}), 0) << "a line that isn't faulty still works";
  board.faults["b"] = 0;
  EXPECT_EQ(write(*lines, {{1, true}}), 0);
  EXPECT_EQ(board.take(), (Notes{"edge a 1 @0", "edge b 1 @0"}));
}

TEST_F(SimulatedLinesTest, RefuseIndexesThatTheRequestDoesNotHave) {
  const auto lines = backend.request({{"a", false, false}}, {{"c"}});
  board.take();
  EXPECT_EQ(write(*lines, {{0, true}, {1, true}}), EINVAL);
  EXPECT_EQ(write(*lines, {{-1, true}}), EINVAL);
  EXPECT_EQ(lines->read(1), -EINVAL);
  EXPECT_EQ(lines->read(-1), -EINVAL);
  EXPECT_EQ(board.take(), Notes{});
}

TEST_F(SimulatedLinesTest, DriveTheSafeLevelsBeforeTheyAreReleased) {
  auto lines = backend.request({{"a", false, false}, {"b", true, false}, {"c", false, true}}, {});
  EXPECT_EQ(write(*lines, {{0, true}, {2, true}}), 0);
  board.take();
  now = 9;
  lines.reset();
  EXPECT_EQ(board.take(), (Notes{"edge a 0 @9", "release a @9", "release b @9", "release c @9"}))
      << "a goes back, b stands safe already, c keeps its level";
}

TEST_F(SimulatedLinesTest, AreHeldByOneRequestAtATime) {
  auto lines = backend.request({{"a", false, false}}, {{"c"}});
  EXPECT_EQ(refusal({{"a", false, false}}, {}),
            "Line a is busy (EBUSY): an earlier request still holds it as an output. Release that "
            "request first, or name another line.");
  EXPECT_EQ(refusal({}, {{"c"}}),
            "Line c is busy (EBUSY): an earlier request still holds it as an input. Release that "
            "request first, or name another line.");
  lines.reset();
  EXPECT_EQ(refusal({{"a", false, false}}, {{"c"}}), "none");
}

TEST_F(SimulatedLinesTest, AreTakenAllOrNone) {
  const auto lines = backend.request({{"a", false, false}}, {});
  board.take();
  EXPECT_NE(refusal({{"b", false, false}, {"a", false, false}}, {}), "none");
  EXPECT_EQ(board.take(), Notes{});
  EXPECT_EQ(refusal({{"b", false, false}}, {}), "none") << "b is still free";
}

TEST_F(SimulatedLinesTest, AreNamedOnceInARequest) {
  EXPECT_EQ(refusal({{"a", false, false}}, {{"a"}}),
            "Line a is named twice in one request (EBUSY), as an output and as an input. Name each "
            "line once.");
  EXPECT_EQ(refusal({{"a", false, false}}, {}), "none");
}

TEST_F(SimulatedLinesTest, OutliveTheirBackend) {
  auto short_lived = std::make_unique<SimulatedBackend>(board, [] { return std::int64_t{1}; });
  const auto lines = short_lived->request({{"a", false, false}}, {});
  short_lived.reset();
  EXPECT_EQ(write(*lines, {{0, true}}), 0);
}

TEST_F(SimulatedLinesTest, ReachTheBoardOneAtATimeFromManyThreads) {
  constexpr int kWrites = 2000;
  auto lines = backend.request({{"a", false, false}, {"b", false, false}}, {{"c"}});
  board.take();
  std::vector<std::thread> writers;
  for (const int output : {0, 1}) {
    writers.emplace_back([&, output] {
      for (int i = 0; i < kWrites; ++i) {
        const LineWrite write{output, i % 2 == 0};
        EXPECT_EQ(lines->write(&write, 1), 0);
        EXPECT_EQ(lines->read(0), 0);
      }
    });
  }
  for (std::thread& writer : writers) writer.join();
  EXPECT_EQ(board.notes.size(), std::size_t{2} * kWrites);
}

}  // namespace
}  // namespace stepdriver::gpio
