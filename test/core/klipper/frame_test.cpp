#include "port/klipper/frame.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include "port/klipper/vlq.h"
#include "sim/board_wire.h"

namespace stepdriver::klipper {
namespace {

std::vector<std::uint8_t> vlqOf(std::uint32_t value) {
  std::array<std::uint8_t, kMostVlq> bytes{};
  return {bytes.data(), putVlq(bytes.data(), value)};
}

TEST(Vlq, HasTheLengthsOfTheProtocol) {
  struct Case {
    std::int64_t least;
    std::int64_t most;
    std::size_t bytes;
  };
  for (const Case& known : {Case{-32, 95, 1}, Case{-4096, 12'287, 2}, Case{-524'288, 1'572'863, 3},
                            Case{-67'108'864, 201'326'591, 4}}) {
    for (const std::int64_t edge : {known.least, known.most}) {
      EXPECT_EQ(vlqOf(static_cast<std::uint32_t>(edge)).size(), known.bytes) << edge;
    }
    EXPECT_EQ(vlqOf(static_cast<std::uint32_t>(known.least - 1)).size(), known.bytes + 1);
    EXPECT_EQ(vlqOf(static_cast<std::uint32_t>(known.most + 1)).size(), known.bytes + 1);
  }
  EXPECT_EQ(vlqOf(0xFFFFFFFFU), (std::vector<std::uint8_t>{0x7F})) << "-1";
}

// Both ends of the line were written separately.
TEST(Vlq, IsTheSameOnBothEndsOfTheLine) {
  std::mt19937 random(1);
  for (int i = 0; i < 200'000; ++i) {
    const std::uint32_t magnitude = static_cast<std::uint32_t>(random()) >> (random() % 32);
    const std::uint32_t value = random() % 2 == 0 ? magnitude : 0U - magnitude;
    const std::vector<std::uint8_t> bytes = vlqOf(value);
    std::vector<std::uint8_t> other;
    sim::addInteger(other, value);
    ASSERT_EQ(bytes, other) << value;
    const std::uint8_t* begin = bytes.data();
    ASSERT_EQ(takeVlq(begin, bytes.data() + bytes.size()), value);
    ASSERT_EQ(begin, bytes.data() + bytes.size());
    begin = bytes.data();
    ASSERT_FALSE(takeVlq(begin, bytes.data() + bytes.size() - 1)) << "it ends within " << value;
  }
  const std::array<std::uint8_t, 6> endless{0x81, 0x81, 0x81, 0x81, 0x81, 0x01};
  const std::uint8_t* begin = endless.data();
  EXPECT_FALSE(takeVlq(begin, endless.data() + endless.size()));
}

TEST(Frame, IsTheSameOnBothEndsOfTheLine) {
  std::mt19937 random(2);
  FrameReader reader;
  sim::BoardWire wire;
  for (unsigned i = 0; i < 20'000; ++i) {
    std::array<std::uint8_t, kMostContent> content{};
    const std::size_t size = random() % (kMostContent + 1);
    for (std::size_t k = 0; k < size; ++k) content.at(k) = static_cast<std::uint8_t>(random());
    const std::vector<std::uint8_t> sent(content.begin(), content.begin() + size);
    std::array<std::uint8_t, kMostFrame> frame{};
    const std::size_t length =
        makeFrame(static_cast<std::uint8_t>(i), content.data(), size, frame.data());
    const auto blocks = wire.receive(frame.data(), length);
    ASSERT_EQ(blocks, (std::vector<std::vector<std::uint8_t>>{sent})) << i;

    wire.send(sent);
    const auto answer = wire.take();
    ASSERT_EQ(reader.add(answer.data(), answer.size()), answer.size());
    const auto heard = reader.next();
    ASSERT_TRUE(heard) << i;
    EXPECT_EQ(heard->sequence, (i + 1) % 16);
    ASSERT_EQ((std::vector<std::uint8_t>(heard->content, heard->content + heard->size)), sent);
  }
  EXPECT_EQ(reader.dropped(), 0u);
}

// A checksum of 16 bits finds each change within 16 bits, and so any byte.
TEST(FrameReader, TakesNoFrameWithAChangedByteAndFindsTheNextOne) {
  std::mt19937 random(3);
  for (int i = 0; i < 100'000; ++i) {
    std::array<std::uint8_t, kMostFrame> frame{};
    const std::array<std::uint8_t, 4> content{1, 2, 3, static_cast<std::uint8_t>(i)};
    const std::size_t length = makeFrame(5, content.data(), content.size(), frame.data());
    std::vector<std::uint8_t> line(frame.begin(), frame.begin() + length);
    const std::size_t wrong = random() % length;
    const auto change = static_cast<std::uint8_t>(1 + random() % 255);
    line[wrong] = static_cast<std::uint8_t>(line[wrong] ^ change);
    // A wrong length waits for that many bytes: enough follow.
    for (int k = 0; k < 8; ++k) line.insert(line.end(), frame.begin(), frame.begin() + length);
    FrameReader reader;
    ASSERT_EQ(reader.add(line.data(), line.size()), line.size());
    int right = 0;
    while (const auto heard = reader.next()) {
      ASSERT_EQ(heard->size, content.size());
      ASSERT_EQ(heard->content[3], content[3]) << "byte " << wrong << " changed by " << +change;
      ++right;
    }
    ASSERT_GE(right, 1) << "byte " << wrong << " changed by " << +change;
    ASSERT_LE(right, 8);
  }
}

TEST(FrameReader, SurvivesAnyBytes) {
  std::mt19937 random(4);
  FrameReader reader;
  std::uint64_t frames = 0;
  for (int i = 0; i < 200'000; ++i) {
    std::array<std::uint8_t, 24> noise{};
    for (std::uint8_t& byte : noise) {
      byte = random() % 4 == 0 ? 0x7E : static_cast<std::uint8_t>(random() % 70);
    }
    ASSERT_EQ(reader.add(noise.data(), noise.size()), noise.size());
    while (reader.next()) ++frames;
  }
  EXPECT_LT(frames, 10u) << "noise looks like frames";
  EXPECT_GT(reader.dropped(), 1'000'000u);
}

}  // namespace
}  // namespace stepdriver::klipper
