#include "bus/register_uart.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <iostream>
#include <random>

#include "bus/register_job.h"
#include "support/wired_stream.h"

namespace stepdriver::bus {
namespace {

constexpr int kBaud = 115'200;
constexpr std::uint8_t kIholdIrun = 0x10;
constexpr std::uint8_t kChopconf = 0x6C;
constexpr std::uint8_t kIoin = 0x06;

TEST(RegisterUart, ReadsAndWritesTheChipAtAnAddress) {
  test::WiredStream stream;
  sim::TmcModel& first = stream.add(0);
  sim::TmcModel& third = stream.add(2);
  RegisterUart uart(stream, kBaud);
  ASSERT_EQ(uart.write(2, kIholdIrun, 0x00011F08), Failure::kNone);
  EXPECT_EQ(third.written(kIholdIrun), 0x00011F08U);
  EXPECT_NE(first.written(kIholdIrun), 0x00011F08U);
  std::uint32_t value = 0;
  ASSERT_EQ(uart.read(0, kIoin, 0, value), Failure::kNone);
  EXPECT_EQ(value >> 24U, 0x21U);
  EXPECT_EQ(uart.retries(), 0U);
}

TEST(RegisterUart, CountsWritesBeyond255) {
  test::WiredStream stream;
  stream.add(0);
  RegisterUart uart(stream, kBaud);
  for (std::uint32_t i = 0; i < 600; ++i) {
    ASSERT_EQ(uart.write(0, kIholdIrun, i), Failure::kNone) << i;
  }
}

// What comes back names the fault.
TEST(RegisterUart, TellsCausesApart) {
  const auto failure_of = [](test::WiredStream& stream) {
    RegisterUart uart(stream, kBaud);
    std::uint32_t value = 0;
    const Failure failure = uart.read(0, kIoin, 0, value);
    EXPECT_EQ(uart.retries(), 3U);
    return failure;
  };
  test::WiredStream cut;
  cut.add(0);
  cut.is_cut = true;
  EXPECT_EQ(failure_of(cut), Failure::kNothing);

  test::WiredStream other_address;
  other_address.add(1);
  EXPECT_EQ(failure_of(other_address), Failure::kOnlyEcho);

  test::WiredStream no_power;
  no_power.add(0).setPower(false);
  EXPECT_EQ(failure_of(no_power), Failure::kOnlyEcho);

  test::WiredStream no_echo;
  no_echo.add(0);
  no_echo.wire.setFaults({0.0, 0.0, 0.0, true});
  EXPECT_EQ(failure_of(no_echo), Failure::kNoEcho);

  test::WiredStream noise;
  noise.add(0);
  noise.wire.setFaults({0.0, 0.0, 1.0, false});
  EXPECT_EQ(failure_of(noise), Failure::kGarbled);

  test::WiredStream twins;
  twins.add(0);
  twins.add(0, 0x20);
  EXPECT_EQ(failure_of(twins), Failure::kGarbled);
}

TEST(RegisterUart, IgnoresBytesThatWereThereBefore) {
  test::WiredStream stream;
  stream.add(0);
  RegisterUart uart(stream, kBaud);
  stream.hear(0x05);
  stream.hear(0xFF);
  std::uint32_t value = 0;
  EXPECT_EQ(uart.read(0, kIoin, 0, value), Failure::kNone);
}

TEST(RegisterUart, DoesNotBelieveAWriteOfWhichTheChipHasHeardNothing) {
  test::WiredStream stream;
  stream.add(0);
  // Another master, whose write comes between two looks at the count.
  class Meddler : public ByteStream {
   public:
    explicit Meddler(test::WiredStream& stream) : stream_(stream) {}
    void send(const std::uint8_t* bytes, std::size_t count) override {
      if (count == 8) stream_.send(bytes, count - 1);  // the last byte is lost
      if (count != 8) stream_.send(bytes, count);
    }
    std::size_t receive(std::uint8_t* bytes, std::size_t most, std::int64_t timeout) override {
      return stream_.receive(bytes, most, timeout);
    }

   private:
    test::WiredStream& stream_;
  } meddler(stream);
  RegisterUart uart(meddler, kBaud);
  EXPECT_EQ(uart.write(0, kIholdIrun, 0), Failure::kNotCounted);
}

struct Noise {
  const char* name;
  sim::WireFaults faults;
};
class RegisterUartInNoise : public ::testing::TestWithParam<Noise> {};

// A million transactions. Bytes are lost, doubled, damaged and late: a value that is believed is
// the chip's, and a write that is believed has changed that register and no other.
TEST_P(RegisterUartInNoise, BelievesNoWrongRegister) {
  constexpr int kTransactions = 200'000;
  constexpr std::array<std::uint8_t, 6> kWritten{0x00, 0x10, 0x11, 0x22, 0x6C, 0x70};
  test::WiredStream stream;
  sim::TmcModel& chip = stream.add(0);
  stream.add(1);
  RegisterUart uart(stream, kBaud);
  stream.wire.setFaults(GetParam().faults);
  std::mt19937 random(7);
  std::array<std::uint32_t, 128> known{};
  for (std::size_t i = 0; i < known.size(); ++i) known.at(i) = chip.written(static_cast<int>(i));
  int believed = 0;
  int refused = 0;
  for (int i = 0; i < kTransactions; ++i) {
    const std::uint8_t number = kWritten.at(random() % kWritten.size());
    if (random() % 2 == 0) {
      std::uint32_t value = 0;
      const Failure failure = uart.read(0, number, 0, value);
      ++(failure == Failure::kNone ? believed : refused);
      if (failure == Failure::kNone) {
        ASSERT_EQ(value, chip.read(number, {})) << "read " << i;
      }
      continue;
    }
    const auto value = static_cast<std::uint32_t>(random());
    const Failure failure = uart.write(0, number, value);
    ++(failure == Failure::kNone ? believed : refused);
    for (std::size_t k = 0; k < known.size(); ++k) {
      const std::uint32_t is = chip.written(static_cast<int>(k));
      if (failure == Failure::kNone && k == number) {
        ASSERT_EQ(is, value) << "write " << i;
      } else if (failure == Failure::kNone) {
        ASSERT_EQ(is, known.at(k)) << "write " << i << " changed register " << k;
      }
      known.at(k) = is;
    }
  }
  EXPECT_GT(believed, kTransactions / 10) << refused << " were refused";
  EXPECT_GT(uart.retries(), 0U);
  std::cout << kTransactions << " transactions: " << believed << " believed, " << refused
            << " refused, " << uart.retries() << " tries more\n";
}

INSTANTIATE_TEST_SUITE_P(, RegisterUartInNoise,
                         ::testing::Values(Noise{"LostBytes", {0.01, 0.0, 0.0, false}},
                                           Noise{"DoubledBytes", {0.0, 0.01, 0.0, false}},
                                           Noise{"FlippedBits", {0.0, 0.0, 0.01, false}},
                                           Noise{"LateBytes", {0.0, 0.0, 0.0, false, false, 0.01}},
                                           Noise{"All", {0.01, 0.01, 0.02, false, false, 0.01}}),
                         [](const auto& noise) { return noise.param.name; });

TEST(RegisterJob, ReadsBackWhatItWrites) {
  test::WiredStream stream;
  stream.add(0);
  RegisterUart uart(stream, kBaud);
  RegisterJob job;
  using Kind = RegisterAccess::Kind;
  job.accesses = {{Kind::kExpect, 0, kIoin, 0x21000000, 0xFF000000},
                  {Kind::kWriteBack, 0, kChopconf, 0x14010053, 0},
                  {Kind::kRead, 0, kChopconf, 0, 0}};
  const RegisterDone done = carryOut(job, uart, {});
  EXPECT_EQ(done.failure, Failure::kNone);
  ASSERT_EQ(done.values.size(), 3U);
  EXPECT_EQ(done.values.back(), 0x14010053U);
  // A register that can only be written reads as 0.
  job.accesses = {{Kind::kWriteBack, 0, kIholdIrun, 0x14, 0}};
  const RegisterDone unread = carryOut(job, uart, {});
  EXPECT_EQ(unread.failure, Failure::kMismatch);
  EXPECT_EQ(unread.failed_number, kIholdIrun);
}

TEST(RegisterJob, NamesTheVersionOfAnotherChip) {
  test::WiredStream stream;
  stream.add(0, 0x20);
  RegisterUart uart(stream, kBaud);
  RegisterJob job;
  job.accesses = {{RegisterAccess::Kind::kExpect, 0, kIoin, 0x21000000, 0xFF000000}};
  const RegisterDone done = carryOut(job, uart, {});
  EXPECT_EQ(done.failure, Failure::kMismatch);
  EXPECT_EQ(done.found >> 24U, 0x20U);
}

}  // namespace
}  // namespace stepdriver::bus
