#include "stepdriver_core/gpio/libgpiod_lines.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "support/gpio_sim.h"
#include "support/other_program.h"

// Tests of libgpiod alone; lines_conformance_test.cpp has the tests that all backends share.

namespace stepdriver::gpio {
namespace {

using test::GpioSimChip;
using test::OtherProgram;

std::string textOf(const std::vector<OutputRequest>& outputs,
                   const std::vector<InputRequest>& inputs) {
  try {
    makeLibgpiodBackend()->request(outputs, inputs);
  } catch (const GpioError& error) {
    return error.what();
  }
  return "none";
}

TEST(LibgpiodVersion, IsOneThatIsKnownOrNone) {
  const std::string version = libgpiodVersion();
  if (version.empty()) {
    EXPECT_THROW(makeLibgpiodBackend(), GpioError);
    EXPECT_THROW(gpioChips(), GpioError);
    return;
  }
  EXPECT_TRUE(version[0] == '1' || version[0] == '2') << version;
  EXPECT_NO_THROW(gpioChips());
}

TEST(LibgpiodLines, SayThatThereIsNoSuchChipOnAnyMachine) {
  if (libgpiodVersion().empty()) GTEST_SKIP() << "stepdriver was built without libgpiod";
  const std::string text = textOf({{"no-such-chip:3", false, false}}, {});
  EXPECT_EQ(text.find("Line no-such-chip:3: there is no chip with the name or label no-such-chip."),
            0U)
      << text;
}

class LibgpiodOnGpioSim : public testing::Test {
 protected:
  void SetUp() override {
    const char* const wanted = std::getenv("STEPDRIVER_GPIO_SIM");
    if (wanted == nullptr || std::string(wanted) != "1") {
      GTEST_SKIP() << "runs in the test kernel (test/kernel/run.sh with STEPDRIVER_GPIO_SIM=1)";
    }
    if (libgpiodVersion().empty()) GTEST_SKIP() << "stepdriver was built without libgpiod";
    first = std::make_unique<GpioSimChip>(
        "first", "header", 30,
        GpioSimChip::Names{{17, "X_STEP"}, {20, "COMMON"}, {21, "header:5x"}});
    second = std::make_unique<GpioSimChip>("second", "expander", 4,
                                           GpioSimChip::Names{{2, "COMMON"}, {3, "Y_MIN"}});
  }

  std::unique_ptr<GpioSimChip> first;
  std::unique_ptr<GpioSimChip> second;
};

TEST_F(LibgpiodOnGpioSim, DriveTheLineThatIsNamedByChipLabelOrName) {
  for (const std::string& name :
       {first->name() + ":17", std::string("header:17"), std::string("X_STEP")}) {
    const auto lines = makeLibgpiodBackend()->request({{name, true, false}}, {});
    EXPECT_TRUE(first->level(17)) << name;
    const LineWrite low{0, false};
    EXPECT_EQ(lines->write(&low, 1), 0);
    EXPECT_FALSE(first->level(17)) << name;
  }
}

TEST_F(LibgpiodOnGpioSim, ListTheChipsAndWhoHoldsTheirLines) {
  const auto lines = makeLibgpiodBackend()->request({{"header:1", false, false}}, {{"header:2"}});
  const OtherProgram other(second->name(), 3, "a program");
  const std::vector<ChipInfo> chips = gpioChips();
  const auto chip = [&](const std::string& label) {
    const auto found = std::find_if(chips.begin(), chips.end(),
                                    [&](const ChipInfo& each) { return each.label == label; });
    return found == chips.end() ? ChipInfo{} : *found;
  };
  const ChipInfo header = chip("header");
  EXPECT_EQ(header.name, first->name());
  ASSERT_EQ(header.lines.size(), 30U);
  EXPECT_EQ(header.lines[17].name, "X_STEP");
  EXPECT_FALSE(header.lines[17].used);
  EXPECT_TRUE(header.lines[1].used);
  EXPECT_EQ(header.lines[1].consumer, "stepdriver");
  EXPECT_EQ(header.lines[2].consumer, "stepdriver");
  ASSERT_EQ(chip("expander").lines.size(), 4U);
  EXPECT_EQ(chip("expander").lines[3].consumer, "a program");
}

TEST_F(LibgpiodOnGpioSim, SayWhatIsWrongWithAName) {
  EXPECT_EQ(textOf({{"header:30", false, false}}, {}),
            "Line header:30: " + first->name() +
                " (\"header\") has 30 lines, counted from 0: there is no line 30.");
  EXPECT_EQ(textOf({}, {{"COMMON"}}),
            "Line COMMON: several lines have that name: " + first->name() + ":20, " +
                second->name() + ":2. Name the one that is meant as chip:offset.");
  EXPECT_EQ(textOf({{"X_STEP", false, false}}, {{"header:17"}}),
            "Line header:17 (" + first->name() +
                ":17, chip \"header\", line \"X_STEP\") is named twice in one request, here and as "
                "X_STEP. Each pin needs a line of its own.");
  const std::string text = textOf({{"Z_STEP", false, false}}, {});
  EXPECT_NE(text.find(first->name() + " (\"header\", 30 lines)"), std::string::npos) << text;
}

TEST_F(LibgpiodOnGpioSim, SayWhoHoldsALine) {
  const OtherProgram other(second->name(), 3, "a program");
  EXPECT_EQ(textOf({}, {{"Y_MIN"}}),
            "Line Y_MIN (" + second->name() +
                ":3, chip \"expander\") is busy (EBUSY, device or resource busy): it is held by "
                "\"a program\". Stop that program or driver, or name another line.");
}

TEST_F(LibgpiodOnGpioSim, SayHowToGetTheRightToAChip) {
  namespace fs = std::filesystem;
  fs::permissions("/dev/" + first->name(), fs::perms::none);
  ASSERT_EQ(seteuid(65534), 0);
  const std::string text = textOf({{first->name() + ":3", false, false}}, {});
  ASSERT_EQ(seteuid(0), 0);
  EXPECT_EQ(text.find("Line " + first->name() + ":3: " + first->name() +
                      " can't be opened: EACCES, permission denied. Install "
                      "config/udev/60-stepdriver-gpio.rules"),
            0U)
      << text;
}

bool libraryHasBias() { return libgpiodVersion().rfind("1.4", 0) != 0; }

TEST_F(LibgpiodOnGpioSim, RefuseABiasThatTheLibraryCannotSet) {
  if (libraryHasBias()) GTEST_SKIP() << "libgpiod " << libgpiodVersion() << " can set it";
  const std::string text = textOf({}, {{"header:1", Bias::kPullUp, false}});
  EXPECT_NE(text.find("header:1"), std::string::npos) << text;
  EXPECT_NE(text.find("can't set a bias"), std::string::npos) << text;
}

TEST_F(LibgpiodOnGpioSim, PullInputsAsTheBiasSays) {
  if (!libraryHasBias()) GTEST_SKIP() << "libgpiod " << libgpiodVersion() << " can't set it";
  for (const bool edges : {false, true}) {
    const auto lines = makeLibgpiodBackend()->request({}, {{"header:1", Bias::kPullUp, edges},
                                                           {"header:2", Bias::kPullDown, edges},
                                                           {"header:3", Bias::kPullUp, !edges}});
    EXPECT_EQ(lines->read(0), 1);
    EXPECT_EQ(lines->read(1), 0);
    EXPECT_EQ(lines->read(2), 1);
    const auto swapped = makeLibgpiodBackend()->request({}, {{"header:4", Bias::kPullDown, edges}});
    EXPECT_EQ(swapped->read(0), 0);
  }
}

TEST_F(LibgpiodOnGpioSim, TakeAllLinesOfAChipInOneRequest) {
  std::vector<OutputRequest> outputs;
  std::vector<LineWrite> writes;
  for (int i = 0; i < 30; ++i) {
    outputs.push_back({"header:" + std::to_string(29 - i), i % 2 == 0, false});
    writes.push_back({i, i % 3 == 0});
  }
  const auto lines = makeLibgpiodBackend()->request(outputs, {});
  EXPECT_EQ(lines->write(writes.data(), writes.size()), 0);
  for (int i = 0; i < 30; ++i) {
    EXPECT_EQ(first->level(static_cast<unsigned>(29 - i)), i % 3 == 0) << "output " << i;
  }
}

TEST_F(LibgpiodOnGpioSim, RefuseMoreLinesThanTheKernelGives) {
  const GpioSimChip large("large", "large", 70);
  std::vector<OutputRequest> outputs;
  outputs.reserve(65);
  for (int i = 0; i < 65; ++i) outputs.push_back({"large:" + std::to_string(i), false, false});
  EXPECT_EQ(
      textOf(outputs, {}),
      large.name() +
          ": 65 outputs are requested, but the kernel allows at most 64 of a chip in one request.");
  outputs.pop_back();
  EXPECT_EQ(textOf(outputs, {}), "none");
}

TEST_F(LibgpiodOnGpioSim, FailWhenTheirChipIsUnpluggedAndLeaveTheOthersAlone) {
  auto lines = makeLibgpiodBackend()->request(
      {{"expander:0", false, false}, {"header:0", false, false}},
      {{"expander:1"}, {"expander:2", Bias::kAsIs, true}, {"header:1"}});
  second->unplug();
  const LineWrite gone{0, true};
  const LineWrite there{1, true};
  EXPECT_EQ(lines->write(&gone, 1), ENODEV);
  EXPECT_EQ(lines->write(&there, 1), 0);
  EXPECT_TRUE(first->level(0));
  EXPECT_EQ(lines->read(0), -ENODEV);
  EXPECT_EQ(lines->read(1), -ENODEV);
  EXPECT_EQ(lines->read(2), 0);
  // Kernels before 6.5 don't wake a thread that polls the lines of a chip when the chip disappears.
  EdgeEvent event{};
  const int waited = lines->waitForEdges(50'000'000, &event, 1);
  EXPECT_TRUE(waited == 0 || waited == -ENODEV) << waited;
  lines.reset();
}

}  // namespace
}  // namespace stepdriver::gpio
