#include "pulse/cpu_latency.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "pulse/pulse_thread.h"
#include "stepdriver_core/pulse/capability.h"
#include "support/fake_hardware.h"
#include "support/recording_lines.h"

namespace stepdriver::pulse {
namespace {

/// A file instead of the kernel's device.
class CpuLatency : public testing::Test {
 protected:
  void SetUp() override { std::ofstream(device).flush(); }
  void TearDown() override { std::filesystem::remove(device); }

  bool isOpen() const {
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
      std::error_code gone;  // set for the listing's own descriptor
      if (std::filesystem::read_symlink(entry.path(), gone) == device) return true;
    }
    return false;
  }

  std::vector<char> written() const {
    std::ifstream file(device, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  const std::string device = testing::TempDir() + "cpu_dma_latency." + std::to_string(::getpid());
};

TEST_F(CpuLatency, IsHeldAtZeroForAsLongAsTheHoldLives) {
  {
    const CpuLatencyHold hold(device);
    EXPECT_EQ(hold.error(), 0);
    EXPECT_TRUE(isOpen());
    EXPECT_EQ(written(), std::vector<char>(sizeof(std::int32_t), 0));
  }
  EXPECT_FALSE(isOpen());
}

TEST_F(CpuLatency, SaysWhyItIsNotHeld) {
  EXPECT_EQ(CpuLatencyHold(device + "/none").error(), ENOTDIR);
  EXPECT_EQ(CpuLatencyHold(device + ".none").error(), ENOENT);
  EXPECT_EQ(CpuLatencyHold("/dev/full").error(), ENOSPC);
}

TEST_F(CpuLatency, IsHeldWhileTheEngineRunsOnARealClock) {
  VirtualClock nowhere;
  test::RecordingLines lines(nowhere);
  SteadyClock clock;
  PulseEngine engine(lines, clock, {ChannelConfig{}}, 1'000'000);
  PulseThread driver(engine, clock, nullptr, {device});
  EXPECT_TRUE(isOpen());
  EXPECT_EQ(driver.rights().latency_error, 0);
  driver.stop();
  EXPECT_FALSE(isOpen());
}

TEST_F(CpuLatency, IsLeftAloneOnAVirtualClockAndWhereItIsNotWanted) {
  VirtualClock virtual_clock;
  test::RecordingLines lines(virtual_clock);
  PulseEngine engine(lines, virtual_clock, {ChannelConfig{}}, 1'000'000);
  const PulseThread driver(engine, virtual_clock, nullptr, {device});
  EXPECT_FALSE(isOpen());
  EXPECT_EQ(driver.rights().latency_error, -1);

  SteadyClock clock;
  PulseEngine on_steady(lines, clock, {ChannelConfig{}}, 1'000'000);
  const PulseThread unwanted(on_steady, clock, nullptr, {""});
  EXPECT_EQ(unwanted.rights().latency_error, -1);
}

TEST_F(CpuLatency, IsHeldWhileWakeUpsAreMeasured) {
  test::LateClock clock;
  bool held = true;
  clock.spun = clock.slept = [&] {
    held = held && isOpen();
    return 0;
  };
  EXPECT_EQ(measureWakeUps(clock, {device}).rights.latency_error, 0);
  EXPECT_TRUE(held);
  EXPECT_FALSE(isOpen());
  EXPECT_EQ(measureWakeUps(clock, {""}).rights.latency_error, -1);
}

TEST(RealtimeRights, TellWhereEachIsGranted) {
  EXPECT_EQ(
      RealtimeRights({0, EPERM, 0})
          .text()
          .find("SCHED_FIFO 50; memory not locked (Operation not permitted): `@realtime - memlock "
                "unlimited` in /etc/security/limits.d allows it to the group realtime"),
      0U)
      << RealtimeRights({0, EPERM, 0}).text();
}

TEST(RealtimeRights, TellHowTheProcessorsAreKeptAwakeOrWhatToDo) {
  const auto text = [](int error) { return RealtimeRights{0, 0, error}.text(); };
  EXPECT_EQ(text(-1), "SCHED_FIFO 50; memory locked");
  EXPECT_EQ(text(0), "SCHED_FIFO 50; memory locked; processors kept awake");
  EXPECT_NE(text(EACCES).find("60-stepdriver-gpio.rules"), std::string::npos) << text(EACCES);
  EXPECT_NE(text(ENOENT).find("/dev/cpu_dma_latency doesn't exist"), std::string::npos);
  EXPECT_NE(text(EIO).find("can't be held (Input/output error)"), std::string::npos) << text(EIO);
}

TEST(RealtimeRights, AreGrantedWithoutAwakeProcessorsAndThatRefusalCounts) {
  EXPECT_TRUE((RealtimeRights{0, 0, ENOENT}.granted()));
  EXPECT_TRUE((RealtimeRights{0, 0, ENOENT}.anyRefused()));
  EXPECT_TRUE((RealtimeRights{0, EPERM, 0}.anyRefused()));
  EXPECT_TRUE((RealtimeRights{EPERM, 0, 0}.anyRefused()));
  EXPECT_FALSE((RealtimeRights{0, 0, 0}.anyRefused()));
  EXPECT_FALSE((RealtimeRights{0, 0, -1}.anyRefused()));
}

TEST(RealtimeRights, AreNotGrantedOnAnotherProcessorThanTheWantedOne) {
  const RealtimeRights granted{0, 0, -1, 0, 3};
  EXPECT_TRUE(granted.granted());
  EXPECT_FALSE(granted.anyRefused());
  EXPECT_EQ(granted.text(), "SCHED_FIFO 50; memory locked; only on processor 3");
  const RealtimeRights refused{0, 0, -1, EINVAL, 3};
  EXPECT_FALSE(refused.granted());
  EXPECT_TRUE(refused.anyRefused());
  EXPECT_NE(refused.text().find("not on processor 3 (Invalid argument): realtime/cpu must be"),
            std::string::npos)
      << refused.text();
}

}  // namespace
}  // namespace stepdriver::pulse
