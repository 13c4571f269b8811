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
                                                    {"--axis", "x"},
                                                    {"--overwrite"},
                                                    {"x"}}) {
    EXPECT_THROW(parseOptions(arguments), Error) << arguments[0];
  }
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
