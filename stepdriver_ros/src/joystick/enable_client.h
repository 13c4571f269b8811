#pragma once

#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

namespace stepdriver::joystick {

/// Calls the service `enable` of one axis in a thread of its own, so that nobody waits for it: a
/// disable answers when the axis rests, an enable when the chip has woken.
///
/// To be used by one thread. It ends with an answer, or with ros::shutdown().
class EnableClient {
 public:
  struct Answer {
    bool success = false;
    std::string message;
  };

  /// @param service its full name.
  explicit EnableClient(std::string service);
  ~EnableClient();
  EnableClient(const EnableClient&) = delete;
  EnableClient& operator=(const EnableClient&) = delete;

  /// Not to be called before the last call's answer was taken.
  void call(bool on);
  /// The answer of the last call, once.
  std::optional<Answer> takeAnswer();

 private:
  void run();
  Answer ask(bool on) const;

  const std::string service_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool ending_ = false;
  std::optional<bool> wanted_;
  std::optional<Answer> answer_;
  std::thread thread_;
};

}  // namespace stepdriver::joystick
