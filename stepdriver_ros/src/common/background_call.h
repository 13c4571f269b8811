#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

namespace stepdriver::client {

/// The answer of a driver's service.
struct Answer {
  bool success = false;
  std::string message;
};

/// Makes one call at a time in a thread of its own, so that the caller needn't wait: a disable
/// answers when the axis is at rest, a homing when it has ended.
///
/// For one thread. The destructor waits for the call in progress, which ends with an answer or with
/// ros::shutdown().
class BackgroundCall {
 public:
  using Ask = std::function<Answer()>;

  BackgroundCall();
  ~BackgroundCall();
  BackgroundCall(const BackgroundCall&) = delete;
  BackgroundCall& operator=(const BackgroundCall&) = delete;

  /// Must not be called before the last call's answer was taken.
  ///
  /// @param ask makes the call; it must not throw.
  void start(Ask ask);
  /// Returns the answer of the last call, once.
  std::optional<Answer> takeAnswer();

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable changed_;
  bool ending_ = false;
  Ask wanted_;
  std::optional<Answer> answer_;
  std::thread thread_;
};

}  // namespace stepdriver::client
