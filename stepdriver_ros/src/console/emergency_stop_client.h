#pragma once

#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "common/background_call.h"

namespace stepdriver::console {

/// Calls the driver's emergency stop, in a thread of its own and over a connection that is made in
/// advance, so that no other call delays it.
///
/// For one thread. The destructor waits for an answer or for ros::shutdown().
class EmergencyStopClient {
 public:
  /// @param service its full name.
  explicit EmergencyStopClient(std::string service);
  ~EmergencyStopClient();
  EmergencyStopClient(const EmergencyStopClient&) = delete;
  EmergencyStopClient& operator=(const EmergencyStopClient&) = delete;

  /// May be called again before the answer has arrived: this makes one more stop.
  void press();
  /// The answer to the latest stop, once.
  std::optional<client::Answer> takeAnswer();

 private:
  void run();

  const std::string service_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool ending_ = false;
  bool wanted_ = false;
  std::optional<client::Answer> answer_;
  std::thread thread_;
};

}  // namespace stepdriver::console
