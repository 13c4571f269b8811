#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "search/drawn_machines.h"
#include "search/participants.h"

namespace stepdriver::search {
namespace {

/// Steps between the two requests: from none to a long way into a motion.
constexpr std::array<std::size_t, 9> kAfter = {0, 1, 2, 4, 8, 16, 60, 200, 500};
constexpr std::size_t kShards = 16;

std::string textOf(const Schedule& schedule) {
  std::string text = "variant " + std::to_string(schedule.variant) + "\n";
  for (const config::AxisConfig& axis : schedule.machine) text += "  " + describe(axis) + "\n";
  if (const auto& ahead = schedule.ahead) {
    text += fmt::format("  a port with a horizon of {} ns, late by {} ns, takes back in {} ns\n",
                        ahead->horizon, ahead->late, ahead->take_back);
  }
  for (const Item& item : schedule.items) {
    text += "  client " + std::string(item.client == 0 ? "A" : "B") + ", after " +
            std::to_string(item.after) + " steps: " + actOf(item).name + "\n";
  }
  for (const Deviation& deviation : schedule.deviations) {
    text += "  from step " + std::to_string(deviation.from) + " on " + nameOf(deviation.who) +
            " waits for " + std::to_string(deviation.steps) + " steps\n";
  }
  return text;
}

std::vector<std::string> play(const Schedule& schedule) { return Participants(schedule).run(); }

/// The subject of a message, without its numbers.
std::string kindOf(const std::vector<std::string>& wrong) {
  std::string kind = wrong.empty() ? "" : wrong.front();
  kind.erase(std::remove_if(kind.begin(), kind.end(),
                            [](char letter) { return letter >= '0' && letter <= '9'; }),
             kind.end());
  return kind;
}

/// Leaves out everything that isn't needed for the same failure.
Schedule shrink(Schedule failing, const std::string& kind) {
  for (bool smaller = true; smaller;) {
    smaller = false;
    const auto take = [&](const Schedule& candidate) {
      if (smaller || kindOf(play(candidate)) != kind) return;
      failing = candidate;
      smaller = true;
    };
    for (std::size_t i = 0; i < failing.deviations.size() && !smaller; ++i) {
      Schedule candidate = failing;
      candidate.deviations.erase(candidate.deviations.begin() + static_cast<std::ptrdiff_t>(i));
      take(candidate);
    }
    for (std::size_t i = 0; i < failing.items.size() && !smaller; ++i) {
      Schedule candidate = failing;
      candidate.items.erase(candidate.items.begin() + static_cast<std::ptrdiff_t>(i));
      take(candidate);
    }
  }
  return failing;
}

std::size_t any(std::mt19937_64& random, std::size_t count) {
  return static_cast<std::size_t>(random() % count);
}

void deviate(Schedule& schedule, std::mt19937_64& random) {
  const std::size_t count = 1 + any(random, 3);
  std::vector<Who> participants;
  for (std::size_t i = 0; i < kParticipants; ++i) {
    const auto who = static_cast<Who>(i);
    const bool is_of_bus = who == Who::kBus || who == Who::kBusDone;
    // Only a port with a horizon has a board.
    if (who == Who::kBoard ? schedule.ahead.has_value()
                           : !is_of_bus || schedule.variant == kRegisters) {
      participants.push_back(who);
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    static constexpr std::array<std::size_t, 6> steps = {1, 2, 4, 10, 40, 200};
    static constexpr std::array<std::size_t, 4> reach = {10, 30, 120, 600};
    schedule.deviations.push_back({any(random, reach[any(random, reach.size())]),
                                   participants[any(random, participants.size())],
                                   steps[any(random, steps.size())]});
  }
}

/// Those of a machine of any variant.
std::size_t actsOf(int variant) { return variant == kRegisters ? acts().size() : actsOfAny(); }

/// With a chip with registers, the first or the second act is about it.
std::vector<std::size_t> actsOfRegisters() {
  std::vector<std::size_t> about{actNamed("home x"), actNamed("microsteps of x"),
                                 actNamed("recover"), actNamed("disable x")};
  for (std::size_t act = actsOfAny(); act < acts().size(); ++act) about.push_back(act);
  return about;
}

std::size_t pairsOfAny() { return actsOfAny() * actsOfAny() * kAfter.size() * (kVariants - 1); }

std::size_t pairs() {
  return pairsOfAny() + 2 * actsOfRegisters().size() * acts().size() * kAfter.size();
}

/// Maps a number to a pair of acts, a time between them, and a variant.
Schedule pairOf(std::size_t number) {
  const auto take = [&number](std::size_t count) {
    const std::size_t digit = number % count;
    number /= count;
    return digit;
  };
  Schedule schedule;
  if (number >= pairsOfAny()) {
    number -= pairsOfAny();
    schedule.variant = kRegisters;
    const std::size_t after = kAfter[take(kAfter.size())];
    const std::size_t other = take(acts().size());
    const bool is_first = take(2) == 0;
    const std::size_t about = actsOfRegisters()[number];
    schedule.items = {{is_first ? about : other, 0, 0}, {is_first ? other : about, 1, after}};
    return schedule;
  }
  schedule.variant = static_cast<int>(take(kVariants - 1));
  const std::size_t after = kAfter[take(kAfter.size())];
  const std::size_t second = take(actsOfAny());
  schedule.items = {{take(actsOfAny()), 0, 0}, {second, 1, after}};
  return schedule;
}

double anyPart(std::mt19937_64& random) {
  return std::uniform_real_distribution<double>(0.0, 1.0)(random);
}

/// One of acts(), or a slow path at speeds from 1e-6 to 1e-3 m/s.
Item anyItem(std::mt19937_64& random, int variant) {
  constexpr std::size_t kSlowPaths = 30;  // one in so many
  Item item{any(random, actsOf(variant)), static_cast<int>(any(random, 2)),
            kAfter[any(random, kAfter.size())]};
  if (any(random, kSlowPaths) != 0) return item;
  const auto speed = [&] { return 1e-6 * std::pow(1e3, anyPart(random)); };
  const double first = speed();
  item.own = std::make_shared<const Act>(slowPath(first, speed()));
  return item;
}

Schedule tripleOf(std::mt19937_64& random) {
  Schedule schedule;
  schedule.variant = static_cast<int>(any(random, kVariants));
  for (std::size_t i = 0; i < 3 + any(random, 2); ++i) {
    schedule.items.push_back(anyItem(random, schedule.variant));
  }
  return schedule;
}

/// Many requests in close succession: motions that take over from each other before they have
/// begun, and what ends them.
Schedule crowdOf(std::mt19937_64& random) {
  static const std::array<std::size_t, 17> motions = {actNamed("move x to 8 mm"),
                                                      actNamed("move x by -6 mm"),
                                                      actNamed("move y by 7 mm"),
                                                      actNamed("move y to -5 mm"),
                                                      actNamed("move z to 6 mm"),
                                                      actNamed("line of x and y"),
                                                      actNamed("line of y and z by"),
                                                      actNamed("trajectory of x and y"),
                                                      actNamed("trajectory of x and z"),
                                                      actNamed("jog x"),
                                                      actNamed("jog z back"),
                                                      actNamed("jog x and z"),
                                                      actNamed("setpoints of x and y"),
                                                      actNamed("velocities of y and z"),
                                                      actNamed("hold"),
                                                      actNamed("resume"),
                                                      actNamed("stop x")};
  static constexpr std::array<std::size_t, 8> after = {0, 0, 0, 1, 2, 4, 16, 60};
  Schedule schedule;
  schedule.variant = static_cast<int>(any(random, kVariants));
  for (std::size_t i = 0; i < 5 + any(random, 5); ++i) {
    const std::size_t act = any(random, 5) != 0 ? motions[any(random, motions.size())]
                                                : any(random, actsOf(schedule.variant));
    schedule.items.push_back(
        {act, static_cast<int>(any(random, 2)), after[any(random, after.size())]});
  }
  return schedule;
}

Ahead drawAhead(std::mt19937_64& random) {
  constexpr pulse::Nanoseconds kMicrosecond = 1'000;
  static constexpr std::array<pulse::Nanoseconds, 4> horizons = {
      50 * kMicrosecond, 1'000 * kMicrosecond, 10'000 * kMicrosecond, 50'000 * kMicrosecond};
  static constexpr std::array<pulse::Nanoseconds, 4> late = {0, 0, -30 * kMicrosecond,
                                                             300 * kMicrosecond};
  static constexpr std::array<pulse::Nanoseconds, 4> take_back = {0, 0, 200 * kMicrosecond,
                                                                  5'000 * kMicrosecond};
  Ahead ahead;
  ahead.horizon = horizons.at(any(random, horizons.size()));
  ahead.late = late.at(any(random, late.size()));
  ahead.take_back = take_back.at(any(random, take_back.size()));
  return ahead;
}

/// About 110,000 schedules altogether. For long runs by hand: STEPDRIVER_SCHEDULES is the number of
/// schedules of each sampled kind, STEPDRIVER_FIRST_SEED the first seed, STEPDRIVER_ALL_PAIRS that
/// each pair is played with each time between its acts, and STEPDRIVER_FAILURES the number of
/// failures after which a test ends. A seed means the same schedule, whatever these values are.
class Interleavings : public testing::TestWithParam<std::size_t> {
 protected:
  /// @return whether to continue.
  bool expectGood(const Schedule& schedule, const std::string& seed) {
    ++played_;
    Participants participants(schedule);
    participants.hashTo(hash_);
    const std::vector<std::string> wrong = participants.run();
    if (wrong.empty()) return true;
    const Schedule smaller = shrink(schedule, kindOf(wrong));
    Participants again(smaller);
    again.keepLog();
    std::string text;
    for (const std::string& line : again.run()) text += line + "\n";
    text += textOf(smaller);
    for (const std::string& line : again.log()) text += "    " + line + "\n";
    ADD_FAILURE() << seed << "\n" << text;
    return ++failed_ < mostFailures();
  }
  static std::size_t wanted(const char* variable, std::size_t usual) {
    const char* text = std::getenv(variable);
    return text != nullptr ? std::strtoull(text, nullptr, 10) : usual;
  }
  static std::size_t mostFailures() { return wanted("STEPDRIVER_FAILURES", 3); }
  /// Calls with each seed of this shard, until the callee says that it is enough.
  void forEachSeed(const std::function<bool(std::uint64_t seed)>& play_seed) {
    const std::size_t first = wanted("STEPDRIVER_FIRST_SEED", 0);
    const std::size_t end = first + wanted("STEPDRIVER_SCHEDULES", 5'000);
    for (std::uint64_t seed = first; seed < end; ++seed) {
      if (seed % kShards == GetParam() && !play_seed(seed)) return;
    }
  }
  void TearDown() override { std::cout << played_ << " schedules, " << hash_.text() << "\n"; }

  EdgeHash hash_;

  std::size_t played_ = 0;
  std::size_t failed_ = 0;
};

// Usually each pair of acts comes on each machine with one or two of the nine times between them.
TEST_P(Interleavings, KeepThePromisesForEachPairOfRequests) {
  const std::size_t step = wanted("STEPDRIVER_ALL_PAIRS", 0) != 0 ? 1 : 5;
  for (std::size_t number = step * GetParam(); number < pairs(); number += step * kShards) {
    if (!expectGood(pairOf(number), "pair " + std::to_string(number))) return;
  }
}

TEST_P(Interleavings, KeepThePromisesForPairsOutOfTurn) {
  forEachSeed([this](std::uint64_t seed) {
    std::mt19937_64 random(seed);
    Schedule schedule = pairOf(any(random, pairs()));
    deviate(schedule, random);
    return expectGood(schedule, "pair, seed " + std::to_string(seed));
  });
}

TEST_P(Interleavings, KeepThePromisesForSeveralRequests) {
  forEachSeed([this](std::uint64_t seed) {
    std::mt19937_64 random(seed);
    Schedule schedule = tripleOf(random);
    if (any(random, 2) == 0) deviate(schedule, random);
    return expectGood(schedule, "several, seed " + std::to_string(seed));
  });
}

TEST_P(Interleavings, KeepThePromisesForManyRequests) {
  forEachSeed([this](std::uint64_t seed) {
    std::mt19937_64 random(seed);
    Schedule schedule = crowdOf(random);
    if (any(random, 4) != 0) deviate(schedule, random);
    return expectGood(schedule, "many, seed " + std::to_string(seed));
  });
}

/// The same kinds on a port that takes steps ahead of time.
TEST_P(Interleavings, KeepThePromisesWithAHorizon) {
  forEachSeed([this](std::uint64_t seed) {
    std::mt19937_64 random(seed);
    Ahead ahead = drawAhead(random);
    Schedule schedule;
    switch (any(random, 5)) {
      case 0:
        schedule = pairOf(any(random, pairs()));
        break;
      case 1:
        schedule = crowdOf(random);
        break;
      case 2:
        schedule = tripleOf(random);
        schedule.may_last = true;
        schedule.machine = drawMachine(schedule.variant, [&] { return anyPart(random); });
        // An early step after one that the engine has put late would be closer than it may be.
        ahead.late = std::max<pulse::Nanoseconds>(ahead.late, 0);
        break;
      default:
        schedule = tripleOf(random);
    }
    schedule.ahead = ahead;
    if (any(random, 2) == 0) deviate(schedule, random);
    return expectGood(schedule, "ahead, seed " + std::to_string(seed));
  });
}

/// A fifth as many as of the other kinds. Low limits may make a motion longer than a run.
TEST_P(Interleavings, KeepThePromisesOnDrawnMachines) {
  forEachSeed([this](std::uint64_t seed) {
    if (seed / kShards % 5 != 0) return true;
    std::mt19937_64 random(seed);
    Schedule schedule = tripleOf(random);
    schedule.may_last = true;
    schedule.machine = drawMachine(schedule.variant, [&] { return anyPart(random); });
    return expectGood(schedule, "drawn, seed " + std::to_string(seed));
  });
}

/// The port that writes now, and one that takes steps ahead of time.
const std::vector<std::optional<Ahead>> kPorts = {std::nullopt, Ahead{1'000'000, 0, 200'000}};

// Otherwise the search would only play homings that fail.
TEST(Homings, OfEachMachineFindTheirPlaces) {
  for (const auto& ahead : kPorts) {
    for (int variant = 0; variant < static_cast<int>(kVariants); ++variant) {
      for (const char* const act : {"home x", "home y", "home z"}) {
        SCOPED_TRACE(std::string(act) + ", variant " + std::to_string(variant) +
                     (ahead ? ", ahead" : ""));
        Schedule schedule{variant, {{actNamed(act), 0, 0}}, {}};
        schedule.ahead = ahead;
        Participants participants(schedule);
        EXPECT_EQ(participants.run(), std::vector<std::string>());
        ASSERT_EQ(participants.homings().size(), 1U);
        for (const auto& outcome : participants.homings().front().outcomes) {
          const auto result = outcome->get();
          ASSERT_TRUE(result);
          EXPECT_EQ(result->end, axis::HomingEnd::kHomed) << result->message;
        }
      }
    }
  }
}

// The same of places that are all refused, as they are of the first machine: its tool has an
// at_stop.
TEST(Compares, OfEachOtherMachineSwitchTheTool) {
  for (const auto& ahead : kPorts) {
    for (int variant = 1; variant < static_cast<int>(kVariants); ++variant) {
      for (const int client : {0, 1}) {
        SCOPED_TRACE("variant " + std::to_string(variant) + (ahead ? ", ahead" : ""));
        Schedule schedule{variant,
                          {{actNamed("the position of y switches the tool"), client, 0},
                           {actNamed("move y by 7 mm"), 1 - client, 400}},
                          {}};
        schedule.ahead = ahead;
        Participants participants(schedule);
        EXPECT_EQ(participants.run(), std::vector<std::string>());
        EXPECT_GE(participants.compared(), client == 0 ? 1U : 7U);
      }
    }
  }
}

TEST(DrawnMachines, HaveNumbersThatTheReaderAccepts) {
  std::mt19937_64 random(33);
  std::size_t differ = 0;
  constexpr std::size_t kMachines = 200;
  for (std::size_t i = 0; i < kMachines; ++i) {
    const int variant = static_cast<int>(i % kVariants);
    const auto machine = drawMachine(variant, [&] { return anyPart(random); });
    differ += machine[0].acceleration != configsOf(variant)[0].acceleration ? 1 : 0;
  }
  EXPECT_EQ(differ, kMachines) << "otherwise no machine was drawn that the reader accepts";
}

INSTANTIATE_TEST_SUITE_P(Shards, Interleavings, testing::Range<std::size_t>(0, kShards));

}  // namespace
}  // namespace stepdriver::search
