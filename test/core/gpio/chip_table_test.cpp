#include "gpio/chip_table.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"

namespace stepdriver::gpio {
namespace {

ChipInfo chip(const std::string& name, const std::string& label, std::size_t lines) {
  ChipInfo info;
  info.name = name;
  info.label = label;
  info.lines.resize(lines);
  return info;
}

class ChipTableTest : public testing::Test {
 protected:
  ChipTableTest() {
    chips[0].lines[3].name = "X_STEP";
    chips[0].lines[4].name = "COMMON";
    chips[1].lines[5].name = "COMMON";
    chips[1].lines[6].name = "expander:7";
    chips[1].lines[7].name = "bank:b:1";
  }

  std::string refusal(const std::string& line) { return refusal({{line, false, false}}, {}); }

  std::string refusal(const std::vector<OutputRequest>& outputs,
                      const std::vector<InputRequest>& inputs) {
    try {
      findLines(chips, outputs, inputs);
    } catch (const GpioError& error) {
      return error.what();
    }
    return "none";
  }

  std::vector<ChipInfo> chips = {chip("gpiochip0", "pinctrl-bcm2711", 58),
                                 chip("gpiochip1", "expander", 8), chip("gpiochip10", "", 1),
                                 chip("gpiochip11", "bank:a", 2)};
};

TEST_F(ChipTableTest, FindsLinesByChipByLabelAndByName) {
  EXPECT_EQ(findLine(chips, "gpiochip0:3"), (LineAddress{0, 3}));
  EXPECT_EQ(findLine(chips, "pinctrl-bcm2711:3"), (LineAddress{0, 3}));
  EXPECT_EQ(findLine(chips, "X_STEP"), (LineAddress{0, 3}));
  EXPECT_EQ(findLine(chips, "gpiochip1:007"), (LineAddress{1, 7}));
  EXPECT_EQ(findLine(chips, "gpiochip10:0"), (LineAddress{2, 0}));
}

TEST_F(ChipTableTest, TakesTheLastColonOfALabelThatHasSome) {
  EXPECT_EQ(findLine(chips, "bank:a:1"), (LineAddress{3, 1}));
}

TEST_F(ChipTableTest, TakesTheNameOfALineThatLooksLikeAPlaceWhereThereIsNoSuchChip) {
  EXPECT_EQ(findLine(chips, "bank:b:1"), (LineAddress{1, 7}));
  EXPECT_EQ(findLine(chips, "expander:7"), (LineAddress{1, 7})) << "not offset 6, which has it";
}

TEST_F(ChipTableTest, TakesTheNameOfAChipBeforeALabel) {
  chips[1].label = "gpiochip0";
  EXPECT_EQ(findLine(chips, "gpiochip0:3"), (LineAddress{0, 3}));
}

TEST_F(ChipTableTest, SaysWhichChipsThereAre) {
  EXPECT_EQ(refusal("gpiochip4:17"),
            "Line gpiochip4:17: there is no chip with the name or label gpiochip4. There are: "
            "gpiochip0 (\"pinctrl-bcm2711\", 58 lines), gpiochip1 (\"expander\", 8 lines), "
            "gpiochip10 (no label, 1 lines), gpiochip11 (\"bank:a\", 2 lines).");
  chips.clear();
  EXPECT_EQ(refusal("gpiochip4:17"),
            "Line gpiochip4:17: there is no chip with the name or label gpiochip4. This machine "
            "has no GPIO chip (no /dev/gpiochip*).");
}

TEST_F(ChipTableTest, SaysThatNoLineHasTheName) {
  chips.resize(1);
  for (const std::string line : {"Y_STEP", "gpiochip0:", ":3", "gpiochip0:3x", "gpiochip0:-1"}) {
    EXPECT_EQ(
        refusal(line),
        "Line " + line +
            ": no chip has a line of that name. There are: gpiochip0 (\"pinctrl-bcm2711\", 58 "
            "lines). The command gpioinfo lists the names of lines; chip:offset always works.");
  }
}

TEST_F(ChipTableTest, SaysHowManyLinesTheChipHas) {
  EXPECT_EQ(refusal("expander:8"),
            "Line expander:8: gpiochip1 (\"expander\") has 8 lines, counted from 0: there is no "
            "line 8.");
  EXPECT_EQ(refusal("gpiochip1:99999999999999999999"),
            "Line gpiochip1:99999999999999999999: gpiochip1 (\"expander\") has 8 lines, counted "
            "from 0: there is no line 99999999999999999999.");
}

TEST_F(ChipTableTest, SaysWhichLinesOrChipsShareAName) {
  EXPECT_EQ(refusal("COMMON"),
            "Line COMMON: several lines have that name: gpiochip0:4, gpiochip1:5. Name the one "
            "that is meant as chip:offset.");
  chips[3].label = "expander";
  EXPECT_EQ(refusal("expander:1"),
            "Line expander:1: several chips have the label expander: gpiochip1, gpiochip11. Name "
            "the chip instead.");
}

TEST_F(ChipTableTest, SaysThatTwoNamesAreOneLine) {
  EXPECT_EQ(refusal({{"gpiochip0:3", false, false}, {"expander:1", false, false}}, {{"X_STEP"}}),
            "Line X_STEP (gpiochip0:3, chip \"pinctrl-bcm2711\") is named twice in one request, "
            "here and as gpiochip0:3. Each pin needs a line of its own.");
}

TEST_F(ChipTableTest, SaysWhoHoldsALine) {
  chips[0].lines[3].used = true;
  chips[0].lines[3].consumer = "gpioset";
  EXPECT_EQ(
      refusal({}, {{"gpiochip0:3"}}),
      "Line gpiochip0:3 (chip \"pinctrl-bcm2711\", line \"X_STEP\") is busy (EBUSY, device or "
      "resource busy): it is held by \"gpioset\". Stop that program or driver, or name "
      "another line.");
  chips[0].lines[3].consumer = "";
  EXPECT_EQ(
      refusal("X_STEP"),
      "Line X_STEP (gpiochip0:3, chip \"pinctrl-bcm2711\") is busy (EBUSY, device or resource "
      "busy): it is held by the kernel, perhaps as a pin with another function. Name another "
      "line, or free it in the device tree (config.txt on a Raspberry Pi).");
}

TEST_F(ChipTableTest, SaysHowToGetTheRightToAChip) {
  chips.resize(1);
  chips[0].label = "";
  chips[0].lines.clear();
  chips[0].error = EACCES;
  const std::string remedy =
      " Install config/udev/60-stepdriver-gpio.rules (it says how) and become a member of the "
      "group "
      "gpio: sudo usermod -aG gpio $USER, then log in again.";
  EXPECT_EQ(refusal("gpiochip0:3"),
            "Line gpiochip0:3: gpiochip0 can't be opened: EACCES, permission denied." + remedy);
  EXPECT_EQ(refusal("expander:3"),
            "Line expander:3: there is no chip with the name or label expander. gpiochip0 couldn't "
            "be opened: EACCES, permission denied." +
                remedy);
}

TEST_F(ChipTableTest, SaysErrorsInWords) {
  EXPECT_EQ(errorText(ENODEV), "ENODEV, no such device: the chip was removed");
  EXPECT_EQ(errorText(EDOM), "errno 33, Numerical argument out of domain");
}

}  // namespace
}  // namespace stepdriver::gpio
