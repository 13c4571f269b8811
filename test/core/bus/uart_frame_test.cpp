#include "bus/uart_frame.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <vector>

namespace stepdriver::bus {
namespace {

using Bytes = std::vector<std::uint8_t>;

TEST(UartFrame, HasTheCrcOfTheDatasheet) {
  const auto crc = [](const Bytes& bytes) { return crcOf(bytes.data(), bytes.size()); };
  EXPECT_EQ(crc({0x55, 0x00, 0x06}), 0xE8);
  EXPECT_EQ(crc({0x05, 0xFF, 0x06, 0x21, 0x00, 0x02, 0x41}), 0x9D);
  EXPECT_EQ(crc({0x05, 0xFF, 0x06, 0x21, 0x00, 0x00, 0x41}), 0xC6);
}

TEST(UartFrame, TakesAnAnswerWhoseCrcIsZero) {
  int zeros = 0;
  for (std::uint32_t value = 0; value < 1'024; ++value) {
    const Answer answer = answerOf(0x6F, value);
    zeros += answer.back() == 0 ? 1 : 0;
    ASSERT_EQ(valueOf(answer.data(), 0x6F), value);
  }
  EXPECT_EQ(zeros, 4);
}

// A CRC of 8 bits finds each burst of up to 8 bits, and so each damaged byte.
TEST(UartFrame, RefusesAnAnswerWithAnyDamagedByte) {
  for (std::size_t damaged = 0; damaged < 8; ++damaged) {
    for (unsigned pattern = 1; pattern < 256; ++pattern) {
      Answer answer = answerOf(0x6C, 0x10000053);
      answer.at(damaged) ^= static_cast<std::uint8_t>(pattern);
      ASSERT_FALSE(valueOf(answer.data(), 0x6C)) << "byte " << damaged << ", bits " << pattern;
    }
  }
}

TEST(UartFrame, RefusesTheAnswerOfAnotherRegister) {
  EXPECT_FALSE(valueOf(answerOf(0x6C, 1).data(), 0x6F));
}

TEST(UartFrame, WritesTheHighByteFirst) {
  const WriteFrame frame = writeFrame(3, 0x10, 0x01020304);
  EXPECT_EQ(Bytes(frame.begin(), frame.end() - 1), (Bytes{0x05, 3, 0x90, 0x01, 0x02, 0x03, 0x04}));
}

}  // namespace
}  // namespace stepdriver::bus
