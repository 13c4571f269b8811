#include "pulse/pulse_thread.h"

#include <gtest/gtest.h>
#include <sched.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "support/recording_lines.h"

namespace stepdriver::pulse {
namespace {

/// The processors that the thread with that name may use, as "0-3". Empty: there is no such thread.
std::string processorsOf(const std::string& thread) {
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    std::ifstream status(task.path() / "status");
    std::string name;
    for (std::string word; status >> word;) {
      if (word == "Name:") status >> name;
      if (word != "Cpus_allowed_list:" || name != thread) continue;
      status >> word;
      return word;
    }
  }
  return "";
}

/// One that this process may use.
int someProcessor() {
  cpu_set_t all;
  EXPECT_EQ(sched_getaffinity(0, sizeof all, &all), 0);
  int last = 0;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &all)) last = cpu;
  }
  return last;
}

class PulseThreadOnAProcessor : public testing::Test {
 protected:
  /// What a thread with this request was granted.
  RealtimeRights rightsOn(int cpu) {
    SteadyClock clock;
    PulseEngine engine(lines_, clock, {ChannelConfig{}}, 1'000'000);
    const PulseThread thread(engine, clock, nullptr, {"", cpu});
    while (thread.passes() == 0) std::this_thread::yield();
    processors_ = processorsOf("pulse");
    return thread.rights();
  }

  VirtualClock nowhere_;
  test::RecordingLines lines_{nowhere_};
  std::string processors_;
};

TEST_F(PulseThreadOnAProcessor, IsAloneInThat) {
  const std::string own = processorsOf("pulse_tests");
  const int cpu = someProcessor();
  EXPECT_EQ(rightsOn(cpu).cpu_error, 0);
  EXPECT_EQ(processors_, std::to_string(cpu));
  EXPECT_EQ(processorsOf("pulse_tests"), own);
}

TEST_F(PulseThreadOnAProcessor, RunsOnAnyIfThatIsRefused) {
  const RealtimeRights rights = rightsOn(CPU_SETSIZE - 1);
  EXPECT_EQ(rights.cpu_error, EINVAL);
  EXPECT_EQ(rights.cpu, CPU_SETSIZE - 1);
  EXPECT_FALSE(processors_.empty());
  EXPECT_NE(processors_, std::to_string(CPU_SETSIZE - 1));
}

}  // namespace
}  // namespace stepdriver::pulse
