#include "bus/serial_port.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "bus/bus_threads.h"
#include "bus/register_uart.h"
#include "support/serial_terminals.h"

namespace stepdriver::bus {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

std::string whyNot(const std::function<void()>& action) {
  try {
    action();
  } catch (const PortError& error) {
    return error.what();
  }
  return "";
}

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// A terminal that answers each byte with the next one.
class Counter {
 public:
  std::string path() const { return terminals_.pathOf("port"); }

 private:
  test::SerialTerminals terminals_{
      {"port"}, [](const std::string&, const std::uint8_t* bytes, std::size_t count, bool) {
        std::vector<std::uint8_t> next(bytes, bytes + count);
        for (std::uint8_t& byte : next) ++byte;
        return next;
      }};
};

TEST(SerialPort, CarriesAllBytesUntouched) {
  const Counter counter;
  SerialPort port(counter.path(), 115'200);
  for (int value = 0; value < 256; ++value) {
    const auto sent = static_cast<std::uint8_t>(value);
    port.send(&sent, 1);
    std::array<std::uint8_t, 4> heard{};
    ASSERT_EQ(port.receive(heard.data(), heard.size(), 10 * kSecond), 1U) << value;
    ASSERT_EQ(heard[0], static_cast<std::uint8_t>(value + 1));
  }
}

TEST(SerialPort, WaitsNoLongerThanItMay) {
  const Counter counter;
  SerialPort port(counter.path(), 9600);
  std::uint8_t byte = 0;
  EXPECT_EQ(port.receive(&byte, 1, 0), 0U);
  EXPECT_EQ(port.receive(&byte, 1, 1'000'000), 0U);
}

TEST(SerialPort, SaysWhyItCannotBeOpened) {
  EXPECT_PRED2(has, whyNot([] { SerialPort("/dev/there/is/none", 9600); }),
               "/dev/there/is/none can't be opened: there is no such device");
  EXPECT_PRED2(has, whyNot([] { SerialPort("/dev/null", 9600); }), "it isn't a serial port");
}

TEST(SerialPort, IsLeftToAProgramThatHasIt) {
  const Counter counter;
  auto first = std::make_unique<SerialPort>(counter.path(), 9600);
  EXPECT_PRED2(has, whyNot([&] { SerialPort(counter.path(), 9600); }), "another program uses it");
  first.reset();
  EXPECT_EQ(whyNot([&] { SerialPort(counter.path(), 9600); }), "");
  const int other = ::open(counter.path().c_str(), O_RDWR | O_NOCTTY);
  ASSERT_EQ(flock(other, LOCK_EX | LOCK_NB), 0);
  EXPECT_PRED2(has, whyNot([&] { SerialPort(counter.path(), 9600); }), "another program uses it");
  ::close(other);
}

TEST(SerialPort, SaysThatItsAdapterIsGone) {
  auto counter = std::make_unique<Counter>();
  SerialPort port(counter->path(), 9600);
  counter.reset();
  std::uint8_t byte = 0;
  EXPECT_PRED2(has, whyNot([&] { port.receive(&byte, 1, kSecond); }), "is gone");
}

/// A port whose chips never answer.
class Silent : public ByteStream {
 public:
  void send(const std::uint8_t* /*bytes*/, std::size_t /*count*/) override {}
  std::size_t receive(std::uint8_t* /*bytes*/, std::size_t /*most*/,
                      std::int64_t /*timeout_ns*/) override {
    return 0;
  }
};

TEST(BusThreads, OpenAPortAgainThatHasFailed) {
  int opened = 0;
  std::vector<RegisterDone> all;
  BusThreads threads(
      [&opened](const std::string&, int baud) -> std::unique_ptr<RegisterPort> {
        if (++opened == 1) throw PortError("not yet");
        return std::make_unique<RegisterUart>(std::make_unique<Silent>(), baud);
      },
      false, [] {});
  RegisterJob job;
  job.port = "port";
  job.accesses.resize(1);
  for (const Failure expected : {Failure::kPort, Failure::kNothing, Failure::kNothing}) {
    threads.begin(job);
    const auto done = threads.collect();
    ASSERT_EQ(done.size(), 1U);
    EXPECT_EQ(done[0].failure, expected);
  }
  EXPECT_EQ(opened, 2);
  EXPECT_TRUE(threads.idle());
}

TEST(BusThreads, EndWhileJobsAreWaiting) {
  BusThreads threads(
      [](const std::string&, int baud) {
        return std::make_unique<RegisterUart>(std::make_unique<Silent>(), baud);
      },
      true, [] {});
  RegisterJob job;
  job.accesses.resize(1'000);
  for (int i = 0; i < 100; ++i) {
    job.port = "port" + std::to_string(i % 3);
    threads.begin(job);
  }
}

}  // namespace
}  // namespace stepdriver::bus
