#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "register_job.h"

namespace stepdriver::bus {

/// Carries out jobs on the registers of driver chips. Each port has a thread of its own: a
/// port that is slow, or whose chips don't answer, delays nothing else. The jobs of a port keep
/// their order. Each ends after a bounded time, whatever the port does.
class BusThreads {
 public:
  /// Opens the port of a job. @throw PortError
  using Open = std::function<std::unique_ptr<RegisterPort>(const std::string& port, int baud)>;

  /// @param threaded false: begin() carries the job out at once.
  /// @param told called from the thread of a port when there is something to collect.
  BusThreads(Open open, bool threaded, std::function<void()> told);
  /// Gives up the jobs that haven't ended.
  ~BusThreads();
  BusThreads(const BusThreads&) = delete;
  BusThreads& operator=(const BusThreads&) = delete;

  void begin(RegisterJob job);

  /// The jobs that have ended since the last call.
  std::vector<RegisterDone> collect();

  /// No job is under way, and all that have ended were collected.
  bool idle() const;

 private:
  struct Port {
    std::deque<RegisterJob> jobs;
    std::condition_variable changed;
    std::thread thread;
    // Of its thread alone; nullptr: it isn't open:
    std::unique_ptr<RegisterPort> registers;
  };

  void run(Port& port);
  RegisterDone carryOutOn(Port& port, const RegisterJob& job);
  bool isEnding() const;

  const Open open_;
  const bool threaded_;
  const std::function<void()> told_;
  mutable std::mutex mutex_;  // protects the next four, and the jobs
  std::map<std::string, std::unique_ptr<Port>> ports_;
  std::vector<RegisterDone> done_;
  std::size_t under_way_ = 0;
  bool ending_ = false;
};

}  // namespace stepdriver::bus
