#pragma once

#include <ros/node_handle.h>
#include <ros/service_client.h>
#include <stepdriver/RigReport.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <string>
#include <thread>
#include <vector>

#include "storm/request_log.h"
#include "storm/rig_clock.h"

namespace stepdriver::storm {

/// Reads the rig's clock all the time in a thread of its own.
class RigClockWatch {
 public:
  /// @param service the node's rig/report.
  explicit RigClockWatch(const std::string& service)
      : client_(ros::NodeHandle().serviceClient<RigReport>(service, true)), thread_([this] {
          while (!ended_) {
            read();
            std::this_thread::sleep_for(kPause);
          }
        }) {}
  ~RigClockWatch() { end(); }
  RigClockWatch(const RigClockWatch&) = delete;
  RigClockWatch& operator=(const RigClockWatch&) = delete;

  /// Ends the thread. @return what it read.
  const std::vector<ClockReading>& end() {
    ended_ = true;
    if (thread_.joinable()) thread_.join();
    return readings_;
  }

 private:
  static constexpr std::chrono::milliseconds kPause{10};

  void read() {
    RigReport report;
    const std::int64_t before = steadyNow();
    // A node that was killed doesn't answer, and there is nothing more to read then.
    if (!client_.call(report)) return;
    const std::int64_t rig = std::llround(report.response.time * 1e9);
    readings_.push_back({before, rig, steadyNow()});
  }

  std::atomic<bool> ended_{false};
  std::vector<ClockReading> readings_;  // belongs to the thread until it has ended
  ros::ServiceClient client_;
  std::thread thread_;
};

}  // namespace stepdriver::storm
