#include <gtest/gtest.h>

#include <chrono>
#include <cstddef>
#include <future>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/random_motion.h"
#include "support/within.h"

// Four clients ask for motions at the same time, without waiting for their ends, so that many of
// them take over from each other before they have begun. The schedules of the search are shorter,
// and have two clients.

namespace stepdriver {
namespace {

using namespace std::chrono_literals;
using motion::Random;
using test::Bench;
using test::linearAxis;
using test::within;

constexpr unsigned kClients = 4;
constexpr unsigned kRounds = 150;
constexpr int kRequests = 12;  // requests of each client in a round
constexpr double kCrowdSpeed = 10.0;
const std::vector<std::string> kNames = {"x", "y", "z"};

std::vector<config::AxisConfig> axes() {
  std::vector<config::AxisConfig> axes;
  for (const std::string& name : kNames) axes.push_back(linearAxis(name, 20'000.0, 0.1, 2.0));
  axes[1].backlash = 0.0004;
  axes[2].jerk = 50.0;
  return axes;
}

class Client {
 public:
  Client(machine::Machine& machine, unsigned seed) : machine_(machine), random_(seed) {}

  void run() {
    for (int i = 0; i < kRequests; ++i) {
      try {
        request();
      } catch (const Refused&) {
        ++refused_;
      }
      if (random_.chance(0.3)) std::this_thread::sleep_for(1us * random_.whole(1, 2000));
    }
  }

  struct Begun {
    std::string what;
    axis::Move move;
  };
  const std::vector<Begun>& begun() const { return begun_; }
  int refused() const { return refused_; }

 private:
  void request() {
    const std::string on = name();
    axis::Axis& axis = machine_.axis(on);
    switch (random_.whole(0, 11)) {
      case 0:
      case 1:
      case 2:
      case 3:
        return keep("a move of " + on, axis.moveTo(place()));
      case 4:
        return keep("a relative move of " + on, axis.moveTo(random_.within(-0.004, 0.004), true));
      case 5:
        return axis.jog(random_.chance(0.2) ? 0.0 : random_.within(-0.08, 0.08));
      case 6:
        return keep("a line", machine_.moveLine({{"x", "y"}, {place(), place()}}));
      case 7:
      case 8:
        return keep("a trajectory", machine_.followTrajectory(trajectory()));
      case 9:
        return axis.stop();
      case 10:
        return machine_.hold();
      default:
        return machine_.resume();
    }
  }

  motion::TrajectoryRequest trajectory() {
    motion::TrajectoryRequest request{{"x", name() == "y" ? "y" : "z"}, {}};
    for (const double part : {0.6, 1.0}) {
      motion::TrajectoryPoint& point = request.points.emplace_back();
      point.time = 0.3 * part;
      point.positions = {0.004 * part, -0.003 * part};
      point.velocities = {part < 1.0 ? 0.02 : 0.0, part < 1.0 ? -0.015 : 0.0};
      point.accelerations = {0.0, 0.0};
    }
    return request;
  }

  void keep(const std::string& what, axis::Move move) { begun_.push_back({what, std::move(move)}); }
  void keep(const std::string& what, const machine::CoordinatedMove& motion) {
    for (const auto& member : motion.members) keep(what + ", " + member.axis, member.move);
  }
  const std::string& name() { return kNames[static_cast<std::size_t>(random_.whole(0, 2))]; }
  double place() { return random_.within(-0.01, 0.01); }

  machine::Machine& machine_;
  Random random_;
  std::vector<Begun> begun_;
  int refused_ = 0;
};

class Crowd : public testing::Test {
 protected:
  void SetUp() override {
    for (const std::string& name : kNames) bench.axis(name).setPosition(0.0);
  }

  bool anyMoves() {
    for (const std::string& name : kNames) {
      if (bench.axis(name).state().moving) return true;
    }
    return false;
  }

  /// @return its clients, when all have had their answers.
  std::vector<Client> letAllAsk(unsigned round) {
    std::vector<Client> clients;
    for (unsigned i = 0; i < kClients; ++i) {
      clients.emplace_back(*bench.machine, round * kClients + i);
    }
    std::vector<std::future<void>> ends;
    for (Client& client : clients) {
      ends.push_back(std::async(std::launch::async, [&client] { client.run(); }));
    }
    for (const std::future<void>& end : ends) {
      // A line that waits for its axes is answered when the hold is over.
      while (end.wait_for(20ms) != std::future_status::ready) bench.machine->resume();
    }
    for (std::future<void>& end : ends) end.get();  // it throws what a client didn't expect
    return clients;
  }

  // A loaded computer may have made pulses too late.
  void recover() {
    bench.machine->recover();
    for (const std::string& name : kNames) {
      if (!bench.axis(name).state().position_valid) bench.axis(name).setPosition(0.0);
    }
  }

  void expectAtRest(const std::string& name) {
    const axis::AxisState state = bench.axis(name).state();
    EXPECT_FALSE(state.held) << name;
    EXPECT_EQ(state.target, state.position) << name;
    EXPECT_EQ(test::violationsOf(bench.report(name)), "") << name;
  }

  Bench bench{axes(), true, kCrowdSpeed};
};

TEST_F(Crowd, NothingMovesAfterAnAnsweredStopAndAllAreTold) {
  std::size_t begun = 0;
  int refused = 0;
  for (unsigned round = 0; round < kRounds && !HasFailure(); ++round) {
    SCOPED_TRACE(testing::Message() << "round " << round);
    const std::vector<Client> clients = letAllAsk(round);
    if (round % 2 == 0) bench.machine->hold();
    bench.machine->stop();
    ASSERT_TRUE(within([this] { return !anyMoves(); })) << "an axis moves on after a stop";
    std::vector<std::int64_t> pulses;
    for (const std::string& name : kNames) pulses.push_back(bench.pulses(name));
    for (const Client& client : clients) {
      for (const Client::Begun& goal : client.begun()) {
        ASSERT_TRUE(within([&] { return goal.move.outcome->get().has_value(); }))
            << goal.what << " has no outcome";
      }
      begun += client.begun().size();
      refused += client.refused();
    }
    std::this_thread::sleep_for(5ms);
    for (std::size_t i = 0; i < kNames.size(); ++i) {
      EXPECT_EQ(bench.pulses(kNames[i]), pulses[i]) << kNames[i];
      expectAtRest(kNames[i]);
    }
    recover();
  }
  EXPECT_GT(begun, kRounds);
  EXPECT_GT(refused, 0);
}

}  // namespace
}  // namespace stepdriver
