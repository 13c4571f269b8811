#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "support/tcpros_client.h"

namespace stepdriver::bad_days {

/// Durations in milliseconds.
class Durations {
 public:
  void add(double duration) { all_.push_back(duration); }
  std::size_t count() const { return all_.size(); }
  /// p50, p99 and the maximum
  std::string text() const;

 private:
  std::vector<double> all_;
};

/// Measures how long an emergency stop takes, from the request to the answer. Its thread runs
/// before others if that is allowed, because it stands for a client on another computer.
class EmergencyProbe {
 public:
  /// @param service the full name of emergency_stop.
  explicit EmergencyProbe(std::string service);

  /// Calls over the kept connection, and over a new one. A call without an answer is a failure of
  /// the test.
  void callEach();
  /// Does that again and again for this time, and asks the master now and then.
  void run(std::chrono::duration<double> time);

  const Durations& kept() const { return kept_; }
  /// From the connection to the answer, without the question to the master.
  const Durations& fresh() const { return fresh_; }
  /// The question to the master where the service is, which another process answers.
  const Durations& lookup() const { return lookup_; }

 private:
  const std::string service_;
  const std::uint16_t port_;
  node_test::TcprosClient client_;
  Durations kept_;
  Durations fresh_;
  Durations lookup_;
};

}  // namespace stepdriver::bad_days
