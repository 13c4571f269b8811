#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

namespace stepdriver::ros_node {

/// Ends the process in spite of a master that hangs: at its end a node tells the master so for each
/// topic and service, and roscpp waits for ever for the answers. It lives until roscpp has ended.
class EndDespiteMaster {
 public:
  EndDespiteMaster() = default;
  ~EndDespiteMaster();
  EndDespiteMaster(const EndDespiteMaster&) = delete;
  EndDespiteMaster& operator=(const EndDespiteMaster&) = delete;

  /// From now on it ends the process with this code if the master doesn't answer, a second later or
  /// more. Call it when the machine is shut down: the last answers to clients take less than that.
  void begin(int exit_code);

 private:
  std::mutex mutex_;
  std::condition_variable change_;
  bool ended_ = false;
  std::thread thread_;
};

}  // namespace stepdriver::ros_node
