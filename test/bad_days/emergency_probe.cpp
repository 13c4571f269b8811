#include "emergency_probe.h"

#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdio>
#include <thread>
#include <utility>

namespace stepdriver::bad_days {
namespace {

using Clock = std::chrono::steady_clock;
using node_test::TcprosClient;

constexpr std::chrono::milliseconds kPause{10};
// The master is slow, and a flood of questions would be one more flood.
constexpr int kCallsPerQuestion = 10;

/// The scheduling of the calling thread, as it was before.
class BeforeOthers {
 public:
  BeforeOthers() {
    pthread_getschedparam(pthread_self(), &policy_, &before_);
    sched_param first{};
    first.sched_priority = sched_get_priority_min(SCHED_FIFO);
    pthread_setschedparam(pthread_self(), SCHED_FIFO, &first);
  }
  ~BeforeOthers() { pthread_setschedparam(pthread_self(), policy_, &before_); }
  BeforeOthers(const BeforeOthers&) = delete;
  BeforeOthers& operator=(const BeforeOthers&) = delete;

 private:
  int policy_ = SCHED_OTHER;
  sched_param before_{};
};

template <typename Act>
double millisecondsOf(const Act& act) {
  const Clock::time_point begin = Clock::now();
  act();
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

}  // namespace

std::string Durations::text() const {
  if (all_.empty()) return "no call";
  std::vector<double> sorted = all_;
  std::sort(sorted.begin(), sorted.end());
  const auto at = [&sorted](std::size_t percent) {
    return sorted[std::min(sorted.size() - 1, sorted.size() * percent / 100)];
  };
  std::array<char, 100> text{};
  std::snprintf(text.data(), text.size(), "%.2f, %.2f, %.2f", at(50), at(99), sorted.back());
  return text.data();
}

EmergencyProbe::EmergencyProbe(std::string service)
    : service_(std::move(service)), port_(node_test::servicePort(service_)), client_(port_) {
  EXPECT_TRUE(client_.introduce(service_, true)) << service_;
}

void EmergencyProbe::callEach() {
  kept_.add(millisecondsOf([this] { ASSERT_TRUE(client_.call()) << "over the kept connection"; }));
  fresh_.add(millisecondsOf([this] {
    const TcprosClient client(port_);
    client.resetAtEnd();
    ASSERT_TRUE(client.introduce(service_, false)) << "over a new connection";
    ASSERT_TRUE(client.call()) << "over a new connection";
  }));
}

void EmergencyProbe::run(std::chrono::duration<double> time) {
  const BeforeOthers before_others;
  const Clock::time_point begin = Clock::now();
  for (int i = 0; Clock::now() - begin < time && !testing::Test::HasFatalFailure(); ++i) {
    callEach();
    if (i % kCallsPerQuestion == 0) {
      lookup_.add(millisecondsOf([this] { EXPECT_EQ(node_test::servicePort(service_), port_); }));
    }
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace stepdriver::bad_days
