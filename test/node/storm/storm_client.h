#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "storm/driver_calls.h"
#include "storm/request_log.h"
#include "storm/storm_machine.h"

namespace stepdriver::storm {

/// The phases of a storm, as its clients see them.
enum class Weather {
  kStorm,  ///< they send random requests
  kCalm,   ///< they send nothing that could begin a motion, and wait for their answers
  kOver,   ///< they end
};

/// A client that sends random requests of every kind, one after another. The same seed makes the
/// same requests, but their effects depend on the other clients and on the computer.
class StormClient {
 public:
  StormClient(const std::string& node, StormMachine machine, int number, std::uint64_t seed,
              DriverTopics& topics, RequestLog& log, const std::atomic<Weather>& weather);

  /// Sends requests until the storm is over.
  void run();

  /// Whether this client has no request under way.
  bool isIdle() const { return idle_; }

 private:
  void sendAnything();
  void sendMotion();
  void sendSetting();
  void setCompare(std::size_t axis);
  void setOutput();
  void sendPower();
  void sendEnding();
  void jog();
  void streamSetpoints();
  void pressSwitch();

  bool storms() const { return weather_ == Weather::kStorm; }
  bool chance(double probability);
  double between(double low, double high);
  std::size_t anyAxis();
  std::vector<std::size_t> someAxes();
  double anyPosition();
  void pause(double longest);

  const StormMachine machine_;
  const int number_;
  std::mt19937_64 random_;
  DriverCalls calls_;
  DriverTopics& topics_;
  const std::atomic<Weather>& weather_;
  std::atomic<bool> idle_{true};
};

}  // namespace stepdriver::storm
