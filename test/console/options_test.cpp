#include "options.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "stepdriver_core/error.h"

namespace stepdriver::console {
namespace {

TEST(Options, SpeedsArePartsOfTheHighest) {
  const Options options = parseOptions({"--slow", "1", "--fast", "100", "--driver", "/robot/legs"});
  EXPECT_EQ(options.speeds.slow, 0.01);
  EXPECT_EQ(options.speeds.fast, 1.0);
  EXPECT_EQ(options.driver, "/robot/legs");
  EXPECT_FALSE(options.wizard);
}

TEST(Options, WhatCannotBeUnderstoodIsRefused) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{"--slow", "0"},
                                                    {"--fast", "101"},
                                                    {"--fast", "nan"},
                                                    {"--slow"},
                                                    {"--slow", "1", "--slow", "2"},
                                                    {"--slow", "1%"},
                                                    {"--wiz"},
                                                    {"--driver=a", "x"},
                                                    {"--axis", "x"},
                                                    {"--overwrite"},
                                                    {"--config", "a.yaml"},
                                                    {"x"}}) {
    EXPECT_THROW(parseOptions(arguments), Error) << arguments[0];
  }
}

std::string complaintOf(const std::vector<std::string>& arguments) {
  try {
    parseOptions(arguments);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST(Options, AComplaintNamesWhatIsWrong) {
  EXPECT_EQ(complaintOf({"--slow=0"}), "--slow 0: it must be a number above 0, and 100 at most");
  EXPECT_EQ(complaintOf({"--driver", "a", "x"}), "x isn't an option; did you mean --driver x?");
  EXPECT_EQ(complaintOf({"--hlep"}), "unrecognised option '--hlep'");
  EXPECT_EQ(complaintOf({"--slow"}), "the required argument for option '--slow' is missing");
}

TEST(Options, OfTheWizard) {
  const Options options = parseOptions({"--wizard", "--axis", "x", "--output", "a.yaml"});
  EXPECT_TRUE(options.wizard);
  EXPECT_EQ(options.wizard_options.axis, "x");
  EXPECT_EQ(options.wizard_options.output, "a.yaml");
  EXPECT_FALSE(options.wizard_options.overwrite);
}

}  // namespace
}  // namespace stepdriver::console
