#include "gpio/pwm_backend.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gpio/may_wait.h"
#include "pwm_line.h"
#include "stepdriver_core/error.h"
#include "support/pwm_folder.h"

// PWM outputs of the kernel, in a folder that looks like /sys/class/pwm.

namespace stepdriver::gpio {
namespace {

namespace fs = std::filesystem;

constexpr const char* kServo = "pwmchip0:1/20000000/1000000/2000000";

/// Lines that remember what was written at once.
class RecordedLines : public Lines {
 public:
  using Batches = std::vector<std::vector<std::pair<int, bool>>>;
  RecordedLines(std::vector<std::string> names, Batches& batches)
      : names_(std::move(names)), batches_(batches) {}
  int write(const LineWrite* writes, std::size_t count) noexcept override {
    batches_.emplace_back();
    for (std::size_t i = 0; i < count; ++i) {
      batches_.back().emplace_back(writes[i].output, writes[i].level);
    }
    return 0;
  }
  int read(int input) noexcept override { return input; }
  int waitForEdges(std::int64_t /*timeout*/, EdgeEvent* /*events*/,
                   std::size_t /*capacity*/) noexcept override {
    return 0;
  }
  void interrupt() noexcept override {}
  const std::string& outputName(int output) const override {
    return names_.at(static_cast<std::size_t>(output));
  }
  const std::string& inputName(int /*input*/) const override { return names_.at(0); }

 private:
  std::vector<std::string> names_;
  Batches& batches_;
};

class RecordedBackend : public Backend {
 public:
  explicit RecordedBackend(RecordedLines::Batches& batches) : batches_(batches) {}
  std::unique_ptr<Lines> request(const std::vector<OutputRequest>& outputs,
                                 const std::vector<InputRequest>& /*inputs*/) override {
    std::vector<std::string> names;
    for (const OutputRequest& output : outputs) names.push_back(output.line);
    return std::make_unique<RecordedLines>(std::move(names), batches_);
  }

 private:
  RecordedLines::Batches& batches_;
};

class PwmBackendTest : public testing::Test {
 protected:
  void TearDown() override { this_thread_may_wait = true; }

  std::unique_ptr<Lines> request(const std::string& line, bool safe_level = false) {
    return backend_->request({{line, safe_level, false}}, {});
  }
  std::string refusalOf(const std::string& line) {
    try {
      (void)request(line);
    } catch (const GpioError& error) {
      return error.what();
    }
    return "it was requested";
  }
  static int write(Lines& lines, int output, bool level) {
    const LineWrite write{output, level};
    return lines.write(&write, 1);
  }
  /// Returns when all writes of the first output have ended.
  static LateWrites awaitEnd(const Lines& lines) {
    LateWrites writes = lines.lateWrites(0);
    for (; writes.ended < writes.ordered; writes = lines.lateWrites(0)) std::this_thread::yield();
    return writes;
  }
  std::string duty() const { return folder_.read("pwm1/duty_cycle"); }

  test::PwmFolder folder_;
  RecordedLines::Batches batches_;
  std::unique_ptr<Backend> backend_ =
      withPwm(std::make_unique<RecordedBackend>(batches_), folder_.root());
};

TEST_F(PwmBackendTest, EachLevelIsALengthOfItsPulses) {
  {
    const auto lines = request(kServo);
    EXPECT_EQ(folder_.read("pwm1/period"), "20000000");
    EXPECT_EQ(folder_.read("pwm1/enable"), "1");
    EXPECT_EQ(duty(), "1000000");
    EXPECT_EQ(lines->outputName(0), "pwmchip0:1");
    for (int i = 0; i < 100; ++i) {
      ASSERT_EQ(write(*lines, 0, i % 2 == 0), 0);
      ASSERT_EQ(duty(), i % 2 == 0 ? "2000000" : "1000000") << i;
    }
    EXPECT_EQ(write(*lines, 0, true), 0);
  }
  EXPECT_EQ(duty(), "1000000") << "its safe level before it is released";
  EXPECT_EQ(folder_.read("pwm1/enable"), "1");
}

TEST_F(PwmBackendTest, APartIsALengthBetweenThoseOfItsLevels) {
  const auto lines = request(kServo);
  const auto length = [&](bool level, std::uint16_t part) {
    const LineWrite write{0, level, part};
    EXPECT_EQ(lines->write(&write, 1), 0);
    return std::stol(duty());
  };
  EXPECT_NEAR(length(true, LineWrite::kWhole / 4), 1'250'000, 16);
  EXPECT_NEAR(length(true, 1), 1'000'015, 1);
  EXPECT_EQ(length(false, LineWrite::kWhole / 4), 1'000'000);
  EXPECT_EQ(length(true, LineWrite::kWhole), 2'000'000);
  // With on shorter than off.
  const auto turned = pwmLineOf("pwmchip0:1/20000000/2000000/1000000");
  ASSERT_TRUE(turned);
  EXPECT_NEAR(static_cast<double>(turned->lengthOf(LineWrite::kWhole / 4)), 1'750'000, 16);
}

TEST_F(PwmBackendTest, BeginsAndEndsWithItsSafeLevel) {
  {
    const auto lines = request(kServo, true);
    EXPECT_EQ(duty(), "2000000");
    EXPECT_EQ(write(*lines, 0, false), 0);
  }
  EXPECT_EQ(duty(), "2000000");
}

TEST_F(PwmBackendTest, ExportsAChannelThatIsNot) {
  fs::remove(folder_.path("export"));
  ASSERT_EQ(mkfifo(folder_.path("export").c_str(), 0600), 0);
  auto kernel = std::async(std::launch::async, [this] {
    std::string number = folder_.read("export");
    folder_.addChannel(std::stoi(number));
    return number;
  });
  const auto lines = request("pwmchip0:0/1000000/0/300000");
  EXPECT_EQ(kernel.get(), "0");
  EXPECT_EQ(write(*lines, 0, true), 0);
  EXPECT_EQ(folder_.read("pwm0/duty_cycle"), "300000");
}

// The file is a pipe that nobody reads: whoever opens it waits.
TEST_F(PwmBackendTest, AWriteOfThePulseThreadDoesNotWaitForTheFile) {
  const auto lines = request(kServo);
  fs::remove(folder_.path("pwm1/duty_cycle"));
  ASSERT_EQ(mkfifo(folder_.path("pwm1/duty_cycle").c_str(), 0600), 0);
  this_thread_may_wait = false;
  EXPECT_EQ(write(*lines, 0, true), 0);
  EXPECT_EQ(lines->lateWrites(0).ordered, 1U);
  EXPECT_EQ(lines->lateWrites(0).ended, 0U);
  EXPECT_EQ(duty(), "2000000");
  awaitEnd(*lines);
  EXPECT_EQ(lines->lateWrites(0).failed, 0U);
  folder_.repair("pwm1/duty_cycle");
}

TEST_F(PwmBackendTest, AWriteThatFailsReturnsItsError) {
  const auto lines = request(kServo);
  folder_.fill("pwm1/duty_cycle");
  EXPECT_EQ(write(*lines, 0, true), ENOSPC);
  EXPECT_EQ(lines->lateWrites(0).ordered, 0U) << "it was waited for";
  folder_.repair("pwm1/duty_cycle");
  EXPECT_EQ(write(*lines, 0, true), 0);
  EXPECT_EQ(duty(), "2000000");
}

TEST_F(PwmBackendTest, AWriteOfThePulseThreadThatFailsIsKnownWhenItHasEnded) {
  const auto lines = request(kServo);
  folder_.fill("pwm1/duty_cycle");
  this_thread_may_wait = false;
  EXPECT_EQ(write(*lines, 0, true), 0);
  const LateWrites first = awaitEnd(*lines);
  EXPECT_EQ(first.failed, first.ordered);
  EXPECT_EQ(first.error, ENOSPC);
  // What another thread writes is told to that one.
  this_thread_may_wait = true;
  EXPECT_EQ(write(*lines, 0, false), ENOSPC);
  EXPECT_EQ(lines->lateWrites(0).failed, first.ordered);
  folder_.repair("pwm1/duty_cycle");
  this_thread_may_wait = false;
  EXPECT_EQ(write(*lines, 0, true), 0);
  const LateWrites second = awaitEnd(*lines);
  EXPECT_GT(second.ordered, first.ordered);
  EXPECT_EQ(second.failed, first.ordered) << "the one before";
  EXPECT_EQ(duty(), "2000000");
}

TEST_F(PwmBackendTest, SaysWhichFileIsWrongAndWhatToDo) {
  const std::string root = folder_.root();
  EXPECT_EQ(refusalOf("pwmchip3:0/1000/0/500"),
            "Line pwmchip3:0: there is no " + root +
                "/pwmchip3 (there are pwmchip0): enable the PWM of the computer, and use the "
                "number of its chip");
  EXPECT_EQ(
      refusalOf("pwmchip0:2/1000/0/500"),
      "Line pwmchip0:2: " + root + "/pwmchip0/npwm reads 2, so the channel must be below that");
  folder_.block("pwm1/period");
  EXPECT_EQ(refusalOf(kServo).rfind(
                "Line pwmchip0:1: can't write 20000000 to " + root +
                    "/pwmchip0/pwm1/period, which reads nothing: errno 21, Is a directory",
                0),
            0U)
      << refusalOf(kServo);
  folder_.block("export");
  EXPECT_EQ(refusalOf("pwmchip0:0/1000/0/500")
                .rfind("Line pwmchip0:0: can't write 0 to " + root +
                           "/pwmchip0/export: errno 21, Is a directory",
                       0),
            0U);
}

TEST_F(PwmBackendTest, OtherLinesAreThoseOfTheBaseAndAreWrittenInOneCall) {
  const auto lines = backend_->request(
      {{"a", false, false}, {kServo, false, false}, {"b", false, false}}, {{"in"}});
  const std::vector<LineWrite> writes{{0, true}, {1, true}, {2, true}};
  EXPECT_EQ(lines->write(writes.data(), writes.size()), 0);
  EXPECT_EQ(batches_, (RecordedLines::Batches{{{0, true}, {1, true}}}));
  EXPECT_EQ(duty(), "2000000");
  EXPECT_EQ(lines->outputName(2), "b");
  EXPECT_EQ(lines->read(0), 0);
  EXPECT_NE(lines->outputChip(0), lines->outputChip(1));
  EXPECT_EQ(write(*lines, 3, true), EINVAL);
}

TEST(PwmLine, IsReadAsItIsWritten) {
  const auto line = pwmLineOf(kServo);
  ASSERT_TRUE(line);
  EXPECT_EQ(line->name(), "pwmchip0:1");
  EXPECT_EQ(line->text(), kServo);
  for (const char* const other :
       {"", "pwmchip0:1", "gpiochip0:1", "pwmchip0:1/1/2", "pwmchip0:1/1/2/3 ", "pwmchip0:01/1/2/3",
        "pwmchip0:1/1/2/99999999999999999999"}) {
    EXPECT_FALSE(pwmLineOf(other)) << other;
  }
}

}  // namespace
}  // namespace stepdriver::gpio
