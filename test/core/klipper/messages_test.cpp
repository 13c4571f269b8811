#include "port/klipper/messages.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "port/klipper/vlq.h"

namespace stepdriver::klipper {
namespace {

std::vector<std::uint8_t> compressed(const std::string& text) {
  uLongf size = compressBound(static_cast<uLong>(text.size()));
  std::vector<std::uint8_t> bytes(size);
  compress(bytes.data(), &size, reinterpret_cast<const Bytef*>(text.data()),
           static_cast<uLong>(text.size()));
  bytes.resize(size);
  return bytes;
}

/// A firmware with all commands but those whose format is changed to something else.
std::string jsonOf(const std::string& replaced = "", const std::string& by = "") {
  const auto named = [&](const char* format, int id) {
    const std::string text = format == replaced ? by : format;
    return '"' + text + "\": " + std::to_string(id) + ", ";
  };
  std::string json = R"({"version": "v0.12.0-85", "commands": {)";
  for (std::size_t i = 0; i < kCommands; ++i) {
    json += named(formatOf(static_cast<Command>(i)), static_cast<int>(i) * 7 - 20);
  }
  json += R"("identify offset=%u count=%c": 1}, "responses": {)";
  for (std::size_t i = 0; i < kAnswers; ++i) {
    json += named(formatOf(static_cast<Answer>(i)), static_cast<int>(i) * 9 + 90);
  }
  return json +
         R"("identify_response offset=%u data=%.*s": 0, "stats count=%u sum=%u sumsq=%u": 85},
    "config": {"CLOCK_FREQ": 12000000, "MCU": "rp2040"},
    "enumerations": {"pin": {"gpio0": [0, 30], "PA5": 70},
                     "static_string_id": {"Timer too close": 4}}})";
}

std::string refusalOf(const std::string& json) {
  try {
    Messages(Dictionary::parsed(json), "mcu");
  } catch (const BoardError& error) {
    return error.what();
  }
  return "";
}

TEST(Dictionary, KnowsPinsConstantsAndTexts) {
  const Dictionary dictionary = Dictionary::unpacked(compressed(jsonOf()));
  EXPECT_EQ(dictionary.version(), "v0.12.0-85");
  EXPECT_EQ(dictionary.number("CLOCK_FREQ"), 12'000'000u);
  EXPECT_EQ(dictionary.text("MCU"), "rp2040");
  EXPECT_EQ(dictionary.pin("gpio29"), 29u);
  EXPECT_FALSE(dictionary.pin("gpio30"));
  EXPECT_EQ(dictionary.pin("PA5"), 70u);
  EXPECT_EQ(dictionary.staticText(4), "Timer too close");
  EXPECT_EQ(dictionary.staticText(5), "reason 5");
}

TEST(Messages, RefusesAFirmwareThatLacksACommandOrHasItWithAnotherFormat) {
  EXPECT_EQ(refusalOf(jsonOf()), "");
  const std::string queue_step = formatOf(Command::kQueueStep);
  std::string text = refusalOf(jsonOf(queue_step, "something_else oid=%c"));
  EXPECT_NE(text.find('"' + queue_step + '"'), std::string::npos) << text;
  EXPECT_NE(text.find("v0.12.0-85"), std::string::npos) << text;
  EXPECT_NE(text.find("board mcu"), std::string::npos) << text;
  text = refusalOf(jsonOf(queue_step, queue_step + " add2=%hi"));
  EXPECT_NE(text.find(queue_step + " add2=%hi"), std::string::npos) << text;
  text = refusalOf(jsonOf(formatOf(Answer::kTrsyncState), "trsync_state oid=%c"));
  EXPECT_NE(text.find(formatOf(Answer::kTrsyncState)), std::string::npos) << text;
}

TEST(Messages, ReadsItsAnswersAndSkipsThoseOfOthers) {
  const Messages messages(Dictionary::parsed(jsonOf()), "mcu");
  std::vector<std::uint8_t> content;
  const auto add = [&](std::uint32_t value) {
    std::array<std::uint8_t, kMostVlq> bytes{};
    content.insert(content.end(), bytes.data(), putVlq(bytes.data(), value));
  };
  add(85);  // stats
  for (int i = 0; i < 3; ++i) add(1'000'000);
  add(90 + 9 * static_cast<int>(Answer::kStepperPosition));
  add(3);
  add(static_cast<std::uint32_t>(-70'000));
  add(90 + 9 * static_cast<int>(Answer::kStarting));
  const std::uint8_t* begin = content.data();
  const std::uint8_t* end = content.data() + content.size();
  const auto position = messages.decode(begin, end);
  ASSERT_TRUE(position);
  EXPECT_EQ(position->answer, Answer::kStepperPosition);
  EXPECT_EQ(position->arguments[0], 3u);
  EXPECT_EQ(static_cast<std::int32_t>(position->arguments[1]), -70'000);
  const auto starting = messages.decode(begin, end);
  ASSERT_TRUE(starting);
  EXPECT_EQ(starting->answer, Answer::kStarting);
  EXPECT_FALSE(messages.decode(begin, end));
}

TEST(Messages, SurvivesAnyContent) {
  const Messages messages(Dictionary::parsed(jsonOf()), "mcu");
  std::mt19937 random(8);
  for (int i = 0; i < 200'000; ++i) {
    std::array<std::uint8_t, kMostContent> content{};
    const std::size_t size = random() % (content.size() + 1);
    for (std::size_t k = 0; k < size; ++k) content.at(k) = static_cast<std::uint8_t>(random());
    const std::uint8_t* begin = content.data();
    int heard = 0;
    while (messages.decode(begin, content.data() + size)) ++heard;
    ASSERT_EQ(begin, content.data() + size);
    ASSERT_LE(heard, static_cast<int>(kMostContent));
    identified(content.data(), content.data() + size);
  }
}

// A damaged description is refused, or it says the same.
TEST(Dictionary, SurvivesAnyDamage) {
  const std::string json = jsonOf();
  const std::vector<std::uint8_t> right = compressed(json);
  std::mt19937 random(9);
  for (int i = 0; i < 3'000; ++i) {
    std::vector<std::uint8_t> packed = right;
    packed[random() % packed.size()] ^= static_cast<std::uint8_t>(1 + random() % 255);
    if (random() % 4 == 0) packed.resize(random() % packed.size());
    try {
      EXPECT_EQ(Dictionary::unpacked(packed).version(), "v0.12.0-85");
    } catch (const BoardError&) {  // NOLINT(bugprone-empty-catch): as it should be
    }
    std::string text = json;
    text[random() % text.size()] = "\"{}[],:0 \\-e"[random() % 12];
    try {
      Messages(Dictionary::parsed(text), "mcu");
    } catch (const BoardError&) {  // NOLINT(bugprone-empty-catch): as it should be
    }
  }
}

TEST(Dictionary, RefusesWhatIsNoDescription) {
  for (const char* json : {"", "7", "[]", "{\"commands\": 3}", R"({"commands": {"a": "b"}})",
                           R"({"commands": {"a": 99999999}})", R"({"responses": {"a b=%x": 3}})",
                           R"({"enumerations": {"pin": {"gpio0": [0]}}})", R"({"version": 3})",
                           R"({"enumerations": {"pin": {"gpio0": [0, 2000000]}}})",
                           R"({"enumerations": {"pin": {"gpio": [0, 2]}}})",
                           R"({"enumerations": {"pin": {"gpio99999999999999999999": [0, 2]}}})"}) {
    EXPECT_THROW(Dictionary::parsed(json), BoardError) << json;
  }
  EXPECT_THROW(Dictionary::unpacked({}), BoardError);
}

}  // namespace
}  // namespace stepdriver::klipper
