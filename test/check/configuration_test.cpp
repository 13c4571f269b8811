#include "configuration.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/libgpiod_lines.h"

namespace stepdriver::check {
namespace {

using setup::GpioBackend;

class Configuration : public testing::Test {
 protected:
  void SetUp() override {
    if (gpio::libgpiodVersion().empty()) GTEST_SKIP() << "stepdriver was built without libgpiod";
  }
  void TearDown() override { std::remove(path_.c_str()); }

  static constexpr const char* kAxis =
      "axes: {x: {driver: a4988, pins: {step: S, dir: D}, microsteps: 16, steps_per_mm: 80.0,\n"
      "  max_speed_mm_s: 100.0, acceleration_mm_s2: 500.0}}\n";
  static constexpr const char* kRounds =
      "axes: {x: {driver: a4988, pins: {step: S, dir: D}, microsteps: 16, steps_per_mm: 80.0,\n"
      "  steps_per_round: 3200, max_speed_mm_s: 100.0, acceleration_mm_s2: 500.0}}\n";

  std::string file(const std::string& text) {
    std::ofstream(path_) << text;
    return path_;
  }

  const std::string path_ =
      testing::TempDir() + "stepdriver_check_" + std::to_string(getpid()) + ".yaml";
};

TEST_F(Configuration, ReadsEveryFileThatIsShipped) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(STEPDRIVER_CONFIGS)) {
    if (entry.path().extension() != ".yaml") continue;
    const std::string name = entry.path().filename();
    if (name == "joystick.yaml" || name == "base.yaml") continue;  // for other nodes
    SCOPED_TRACE(entry.path());
    const auto config = readConfiguration(entry.path().string(), BackendChoice::kAsInTheFile);
    EXPECT_FALSE(config.axes.empty());
    EXPECT_EQ(config.backend, GpioBackend::kLibgpiod) << "the file leaves it to the launch file";
    ++files;
  }
  EXPECT_GE(files, 5);
}

TEST_F(Configuration, TakesTheBackendOfTheFileUnlessToldOtherwise) {
  const std::string text =
      std::string("gpio: {backend: simulated}\n") + kAxis + "simulation: {trace: /tmp/x.vcd}\n";
  const auto read = [&](BackendChoice choice) { return readConfiguration(file(text), choice); };
  EXPECT_EQ(read(BackendChoice::kAsInTheFile).backend, GpioBackend::kSimulated);
  EXPECT_EQ(read(BackendChoice::kLibgpiod).backend, GpioBackend::kLibgpiod);
  EXPECT_EQ(readConfiguration(file(kAxis), BackendChoice::kSimulated).backend,
            GpioBackend::kSimulated);
}

TEST_F(Configuration, ListsEverythingThatIsWrongByItsFullName) {
  const std::string text =
      "gpio: {backend: gpio}\n"
      "joint_state_rate: often\n"
      "axes: {x: {driver: a4989}}\n";
  try {
    readConfiguration(file(text), BackendChoice::kAsInTheFile);
    FAIL();
  } catch (const ConfigError& error) {
    std::vector<std::string> keys;
    for (const ConfigIssue& issue : error.issues()) keys.push_back(issue.key);
    for (const char* key : {"gpio/backend", "joint_state_rate", "axes/x/driver"}) {
      EXPECT_NE(std::find(keys.begin(), keys.end(), key), keys.end()) << key << "\n"
                                                                      << error.what();
    }
  }
}

TEST_F(Configuration, RefusesWhatIsNoMapAsTheNodeDoes) {
  for (const char* text : {"just words\n", "[1, 2]\n", "gpio: 5\naxes: 7\n"}) {
    EXPECT_THROW(readConfiguration(file(text), BackendChoice::kAsInTheFile), ConfigError) << text;
  }
}

TEST_F(Configuration, IsShownWithTopSpeedsInStepsPerSecond) {
  const auto config = readConfiguration(file(kAxis), BackendChoice::kAsInTheFile);
  EXPECT_EQ(configurationText(config),
            "  axis  driver  kind    microsteps  top speed  steps/s  rpm  endstops\n"
            "  x     A4988   linear  16          100 mm/s   8000     -    none\n");
  const auto known = readConfiguration(file(kRounds), BackendChoice::kAsInTheFile);
  EXPECT_EQ(configurationText(known),
            "  axis  driver  kind    microsteps  top speed  steps/s  rpm  endstops\n"
            "  x     A4988   linear  16          100 mm/s   8000     150  none\n");
}

TEST_F(Configuration, HasTheFlightRecorder) {
  const auto read = [&](const std::string& recorder) {
    return readConfiguration(file(kAxis + recorder), BackendChoice::kAsInTheFile).recorder;
  };
  EXPECT_EQ(read("").seconds, 10.0);
  EXPECT_EQ(read("").keep, 20);
  const setup::RecorderConfig given =
      read("recorder: {seconds: 60, memory_mb: 100, folder: /var/log/axes, keep: 3}\n");
  EXPECT_EQ(given.seconds, 60.0);
  EXPECT_EQ(given.memory_mb, 100.0);
  EXPECT_EQ(given.folder, "/var/log/axes");
  EXPECT_EQ(given.keep, 3);
  try {
    read("recorder: {seconds: 601, memory_mb: 0.5, folder: here, keep: 0, minutes: 1}\n");
    ADD_FAILURE() << "it was accepted";
  } catch (const ConfigError& error) {
    const std::string message = error.what();
    for (const char* words :
         {"recorder/seconds: is 601, but must be from 0 to 600",
          "recorder/memory_mb: is 0.5, but must be from 1 to 1000",
          "recorder/folder: is \"here\", but must be an absolute path, or empty for the default",
          "recorder/keep: is 0, but must be from 1 to 1000", "recorder/minutes: is not known"}) {
      EXPECT_NE(message.find(words), std::string::npos) << words << "\n" << message;
    }
  }
}

TEST_F(Configuration, HasTheMotorPower) {
  const auto read = [&](const std::string& more) {
    return readConfiguration(file(kAxis + more), BackendChoice::kAsInTheFile).options().motor_power;
  };
  EXPECT_FALSE(read(""));
  const auto least = read("motor_power: {pin: P, on_ms: 200}\n");
  ASSERT_TRUE(least);
  EXPECT_EQ(least->line, "P");
  EXPECT_TRUE(least->active_level);
  EXPECT_EQ(least->on_ns, 200'000'000);
  EXPECT_EQ(least->off_delay_ns, 0);
  EXPECT_FALSE(least->feedback);
  const auto all = read(
      "motor_power:\n  {pin: P, active_level: low, on_ms: 0, off_delay_ms: 1.5, feedback: {pin: Q, "
      "active_level: low, bias: pull_up}, feedback_timeout_ms: 20}\n");
  ASSERT_TRUE(all && all->feedback);
  EXPECT_FALSE(all->active_level);
  EXPECT_EQ(all->off_delay_ns, 1'500'000);
  EXPECT_EQ(all->feedback->line, "Q");
  EXPECT_FALSE(all->feedback->active_level);
  EXPECT_EQ(all->feedback->bias, Bias::kPullUp);
  EXPECT_EQ(all->feedback_timeout_ns, 20'000'000);
  for (const auto& [text, words] : std::vector<std::pair<std::string, std::string>>{
           {"motor_power: {on_ms: 1}\n", "motor_power/pin: is missing"},
           {"motor_power: {pin: P}\n", "motor_power/on_ms: is missing"},
           {"motor_power: {pin: P, on_ms: -1}\n",
            "motor_power/on_ms: is -1, but must be from 0 to 60000"},
           {"motor_power: {pin: P, on_ms: 1, feedback: {pin: Q}}\n",
            "motor_power/feedback/active_level: is missing"},
           {"motor_power: {pin: P, on_ms: 1, feedback: {pin: P, active_level: low}}\n",
            "which is used twice"},
           {"motor_power: {pin: P, on_ms: 1, feedback_timeout_ms: 5}\n",
            "motor_power/feedback_timeout_ms: is not known"}}) {
    try {
      read(text);
      ADD_FAILURE() << "it was accepted: " << text;
    } catch (const ConfigError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  }
}

TEST_F(Configuration, HasTheHeartbeat) {
  const auto read = [&](const std::string& more) {
    return readConfiguration(file(kAxis + more), BackendChoice::kAsInTheFile).options().heartbeat;
  };
  EXPECT_FALSE(read(""));
  const auto given = read("heartbeat: {pin: H}\n");
  ASSERT_TRUE(given);
  EXPECT_EQ(given->line, "H");
  EXPECT_EQ(given->rate, 100.0);
  EXPECT_EQ(read("heartbeat: {pin: H, rate_hz: 20}\n")->rate, 20.0);
  for (const auto& [text, words] : std::vector<std::pair<std::string, std::string>>{
           {"heartbeat: {}\n", "heartbeat/pin: is missing"},
           {"heartbeat: {pin: H, rate_hz: 0.9}\n",
            "heartbeat/rate_hz: is 0.9, but must be from 1 to 1000"},
           {"heartbeat: {pin: H}\nemergency_stop: {pin: H, active_level: high}\n",
            "which is used twice"},
           {"heartbeat: {pin: H}\ngpio: {backend: simulated}\nsimulation: {speed: 0}\n",
            "simulation/speed is 0: it would make"}}) {
    try {
      read(text);
      ADD_FAILURE() << "it was accepted: " << text;
    } catch (const ConfigError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  }
}

TEST_F(Configuration, HasTheRealtimePolicyByItselfOrInAMap) {
  const auto policy = [&](const std::string& realtime) {
    return readConfiguration(file(kAxis + realtime), BackendChoice::kAsInTheFile);
  };
  EXPECT_FALSE(policy("").enforce_realtime);
  EXPECT_FALSE(policy("realtime: warn\n").enforce_realtime);
  EXPECT_TRUE(policy("realtime: enforce\n").enforce_realtime);
  const auto map = policy("realtime: {policy: enforce, max_lateness_ms: 2}\n");
  EXPECT_TRUE(map.enforce_realtime);
  EXPECT_DOUBLE_EQ(map.max_lateness, 0.002);
  EXPECT_FALSE(policy("realtime: {max_lateness_ms: 2}\n").enforce_realtime);
  EXPECT_EQ(policy("realtime: enforce\n").options().realtime.latency_device,
            "/dev/cpu_dma_latency");
  EXPECT_EQ(map.options().realtime.latency_device, "/dev/cpu_dma_latency");
  EXPECT_EQ(policy("realtime: {keep_cpus_awake: false}\n").options().realtime.latency_device, "");
  EXPECT_EQ(map.options().realtime.cpu, std::nullopt);
  EXPECT_EQ(policy("realtime: {cpu: 3}\n").options().realtime.cpu, 3);
}

}  // namespace
}  // namespace stepdriver::check
