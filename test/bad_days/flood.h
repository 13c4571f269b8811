#pragma once

#include <atomic>
#include <chrono>
#include <cmath>
#include <functional>
#include <string>
#include <thread>

namespace stepdriver::bad_days {

/// "9980 calls/s"
inline std::string perSecond(double rate, const std::string& what) {
  return std::to_string(std::lround(rate)) + " " + what + "/s";
}

/// Does something again and again in a thread of its own, until its end. If the computer can't do
/// it that often, it is done as often as possible: what was missed isn't done later.
class Flood {
 public:
  using Act = std::function<void()>;

  /// @param rate [1/s]
  Flood(double rate, const Act& act)
      : begin_(Clock::now()), thread_([this, rate, act] { run(Seconds(1.0 / rate), act); }) {}
  ~Flood() { end(); }
  Flood(const Flood&) = delete;
  Flood& operator=(const Flood&) = delete;

  void end() {
    ended_ = true;
    if (thread_.joinable()) thread_.join();
  }

  long count() const { return count_; }
  /// [1/s] since the beginning
  double rate() const {
    return static_cast<double>(count_) / Seconds(Clock::now() - begin_).count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  using Seconds = std::chrono::duration<double>;

  void run(Seconds interval, const Act& act) {
    Clock::time_point due = Clock::now();
    while (!ended_) {
      act();
      ++count_;
      due += std::chrono::duration_cast<Clock::duration>(interval);
      const Clock::time_point now = Clock::now();
      if (due < now) {
        due = now;
      } else {
        std::this_thread::sleep_until(due);
      }
    }
  }

  const Clock::time_point begin_;
  std::atomic<bool> ended_{false};
  std::atomic<long> count_{0};
  std::thread thread_;  // the last: it uses the others
};

}  // namespace stepdriver::bad_days
