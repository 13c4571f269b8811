#include "port/klipper/transport.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <deque>
#include <optional>
#include <random>
#include <vector>

#include "port/klipper/vlq.h"
#include "sim/board_wire.h"

namespace stepdriver::klipper {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// A line with a delay that loses, changes and doubles bytes, and stands still now and then.
class Line {
 public:
  Line(std::uint64_t seed, double share) : random_(seed), faults_(share) {}

  void send(const Bytes& bytes, Nanoseconds now) {
    for (const std::uint8_t byte : bytes) {
      const double draw = std::uniform_real_distribution<double>()(random_);
      if (draw >= faults_) {
        add(byte, now);
        continue;
      }
      ++faults;
      const int kind = static_cast<int>(random_() % 4);
      if (kind == 0) continue;  // lost
      if (kind == 1) add(byte, now);
      if (kind == 3)
        delay_ = std::max(delay_, now + static_cast<Nanoseconds>(random_() % 200) * kMillisecond);
      add(kind == 2 ? static_cast<std::uint8_t>(byte ^ (1U << (random_() % 8))) : byte, now);
    }
  }
  Bytes receive(Nanoseconds now) {
    Bytes arrived;
    while (!bytes_.empty() && bytes_.front().first <= now) {
      arrived.push_back(bytes_.front().second);
      bytes_.pop_front();
    }
    return arrived;
  }

  std::uint64_t faults = 0;

 private:
  void add(std::uint8_t byte, Nanoseconds now) {
    bytes_.emplace_back(std::max(now + kMillisecond / 2, delay_), byte);
  }

  std::mt19937_64 random_;
  const double faults_;
  std::deque<std::pair<Nanoseconds, std::uint8_t>> bytes_;
  Nanoseconds delay_ = 0;
};

/// Both ends, and what the board has taken.
struct Ends {
  Ends(std::uint64_t seed, double share) : to(seed, share), from(seed + 1, share) {}

  void run(Nanoseconds step) {
    now += step;
    transport.serve(now);
    to.send(transport.out(), now);
    transport.written(transport.out().size());
    const Bytes arrived = to.receive(now);
    for (const Bytes& block : wire.receive(arrived.data(), arrived.size())) {
      sim::BoardReader reader(block);
      while (!reader.isAtEnd()) taken.push_back(reader.next());
      wire.acknowledge();
    }
    from.send(wire.take(), now);
    Bytes answers = from.receive(now);
    while (!answers.empty()) {
      const std::size_t heard = transport.receive(answers.data(), answers.size());
      answers.erase(answers.begin(), answers.begin() + static_cast<std::ptrdiff_t>(heard));
      while (transport.next(now)) {
      }
    }
  }

  void connect() {
    transport.connect(now);
    for (int i = 0; i < 100'000 && !(transport.isConnected() && transport.isIdle()); ++i) {
      run(kMillisecond / 4);
    }
    ASSERT_TRUE(transport.isConnected());
  }

  Transport transport;
  sim::BoardWire wire;
  Line to;
  Line from;
  std::vector<std::uint32_t> taken;
  Nanoseconds now = 0;
};

void put(Transport& transport, std::uint32_t value) {
  std::array<std::uint8_t, kMostVlq> bytes{};
  const std::uint8_t* end = putVlq(bytes.data(), value);
  transport.send(bytes.data(), static_cast<std::size_t>(end - bytes.data()));
}

TEST(Transport, TakesUpTheNumbersOfAnotherHost) {
  for (std::uint8_t number = 0; number < 16; ++number) {
    Ends ends(1, 0.0);
    ends.wire.expect(number);
    ends.connect();
    for (std::uint32_t i = 0; i < 100; ++i) put(ends.transport, i);
    for (int i = 0; i < 1'000 && !ends.transport.isIdle(); ++i) ends.run(kMillisecond);
    ASSERT_EQ(ends.taken.size(), 100u) << "from number " << +number;
    EXPECT_EQ(ends.transport.figures().timeouts, 0u);
  }
}

TEST(Transport, KeepsAtMostTwelveBlocksUnderWay) {
  Ends ends(1, 0.0);
  ends.connect();
  for (std::uint32_t i = 0; i < 10'000; ++i) put(ends.transport, 1'000'000'000);
  const std::uint64_t before = ends.transport.figures().blocks;
  ends.transport.serve(ends.now);
  EXPECT_EQ(ends.transport.figures().blocks - before, Transport::kMostBlocks);
  EXPECT_LE(ends.transport.out().size(), Transport::kMostBlocks * kMostFrame);
  for (int i = 0; i < 10'000 && !ends.transport.isIdle(); ++i) ends.run(kMillisecond);
  EXPECT_EQ(ends.taken.size(), 10'000u);
}

// 100,000 faults: each command arrives once, and in its place.
TEST(Transport, CarriesEachCommandOnceAndInOrderWhateverTheLineDoes) {
  std::uint64_t faults = 0;
  for (std::uint64_t seed = 0; faults < 100'000; ++seed) {
    const double share = seed % 3 == 0 ? 0.02 : 0.005;
    Ends ends(seed, share);
    ends.connect();
    std::mt19937_64 random(seed);
    std::uint32_t sent = 0;
    constexpr std::uint32_t kCommands = 20'000;
    for (int turn = 0; turn < 4'000'000; ++turn) {
      if (sent == kCommands && ends.transport.isIdle()) break;
      for (std::uint64_t i = random() % 8; i > 0 && sent < kCommands; --i) {
        put(ends.transport, 77 * sent++);
      }
      ends.run(kMillisecond / 4 + static_cast<Nanoseconds>(random() % 1'000'000));
    }
    ASSERT_EQ(ends.taken.size(), kCommands) << "seed " << seed;
    for (std::uint32_t i = 0; i < kCommands; ++i) {
      ASSERT_EQ(ends.taken[i], 77 * i) << "command " << i << " of seed " << seed;
    }
    faults += ends.to.faults + ends.from.faults;
    ASSERT_LT(seed, 1'000u);
  }
}

TEST(Transport, SaysSinceWhenTheBoardIsSilent) {
  Ends ends(1, 0.0);
  ends.connect();
  EXPECT_EQ(ends.transport.waitsSince(), kNever);
  put(ends.transport, 1);
  const Nanoseconds sent = ends.now + kMillisecond;
  for (int i = 0; i < 3'000; ++i) {  // nobody receives
    ends.now += kMillisecond;
    ends.transport.serve(ends.now);
    ends.transport.written(ends.transport.out().size());
  }
  EXPECT_EQ(ends.transport.waitsSince(), sent);
  const auto timeouts = ends.transport.figures().timeouts;
  EXPECT_GE(timeouts, 8u) << "at most 400 ms apart";
  EXPECT_LE(timeouts, 16u) << "10, 20, 40 ... ms apart";
}

}  // namespace
}  // namespace stepdriver::klipper
