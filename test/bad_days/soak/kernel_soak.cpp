// Random commands to three axes on the GPIO lines of the test kernel, for a time.

#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "commands.h"
#include "kernel_bench.h"
#include "stepdriver_core/error.h"
#include "watch.h"
#include "waveform.h"

namespace stepdriver::soak {
namespace {

constexpr const char* kUsage = R"(usage: kernel_soak --minutes M [--seed S]

Sends random commands of every kind to three axes on two GPIO chips of the test kernel, in rounds. After
each round it compares the positions with the kernel's own trace of the lines, and the trace with the
chips' times. Prints a line each minute, and a summary. Exit code 0: no violation, no mismatch, no error,
and memory and descriptors are flat.
)";

// The kernel keeps a million events.
constexpr std::chrono::seconds kRound{20};

const std::vector<std::string> kNames{"x", "y", "z"};

std::vector<config::AxisConfig> threeAxes() {
  const auto at = [](const std::string& chip, unsigned first) {
    const auto pin = [&](unsigned offset) {
      return config::Pin{chip + ":" + std::to_string(first + offset), false};
    };
    return kernel::Place{pin(0), pin(1), pin(2)};
  };
  return {kernel::axisAt("x", "a4988", at("board-0", 0)),
          kernel::axisAt("y", "tb6600", at("board-0", 4)),
          kernel::axisAt("z", "drv8825", at("board-1", 0))};
}

class KernelSoak {
 public:
  KernelSoak(double minutes, unsigned seed) : minutes_(minutes), seed_(seed) {}

  int run() {
    for (unsigned i = 0; watch_.seconds() < 60.0 * minutes_; ++i) {
      round(i);
      malloc_trim(0);
      watch_.look(findings_);
    }
    return watch_.conclude(findings_, counts_);
  }

 private:
  void round(unsigned number) {
    const std::vector<config::AxisConfig> axes = threeAxes();
    kernel::KernelBench bench(axes);
    RandomCommands client(bench.machine(), kNames, seed_ * 100'000 + number);
    const auto end = std::chrono::steady_clock::now() + kRound;
    while (std::chrono::steady_clock::now() < end) {
      client.send();
      std::this_thread::sleep_for(std::chrono::milliseconds(client.random().whole(0, 400)));
    }
    bench.machine().stop();
    for (const std::string& name : kNames) {
      for (int i = 0; i < 10'000 && bench.axis(name).state().moving; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
      if (bench.axis(name).state().moving) complain(name + " moves although all were stopped");
    }
    std::map<std::string, std::int64_t> counts;
    for (const std::string& name : kNames) counts[name] = bench.count(name);
    const machine::EngineFigures figures = bench.figures();
    check(bench.finish("soak"), axes, counts, figures.pulses);
    for (const auto& [kind, count] : client.counts()) {
      counts_[kind].accepted += count.accepted;
      counts_[kind].refused += count.refused;
    }
  }

  void check(const kernel::KernelTrace& trace, const std::vector<config::AxisConfig>& axes,
             const std::map<std::string, std::int64_t>& counts, std::uint64_t sent) {
    std::uint64_t pulses = 0;
    for (const config::AxisConfig& config : axes) {
      const kernel::Waveform seen = kernel::waveformOf(trace, kernel::wiredAxis(config, trace));
      pulses += seen.pulses.size();
      findings_.violations += static_cast<std::int64_t>(seen.violations.size());
      if (!seen.violations.empty()) {
        std::fprintf(stderr, "%s:\n%s", config.name.c_str(), kernel::reportOf(seen).c_str());
      }
      if (seen.position() == counts.at(config.name)) continue;
      ++findings_.mismatches;
      std::fprintf(stderr, "%s: its position is %lld microsteps, but the kernel has seen %lld\n",
                   config.name.c_str(), static_cast<long long>(counts.at(config.name)),
                   static_cast<long long>(seen.position()));
    }
    if (pulses != sent) complain("the kernel has not seen as many pulses as were sent");
    findings_.edges += 2 * pulses;
  }

  void complain(const std::string& text) {
    ++findings_.errors;
    std::fprintf(stderr, "%s\n", text.c_str());
  }

  const double minutes_;
  const unsigned seed_;
  Findings findings_;
  Counts counts_;
  Watch watch_{90.0};
};

}  // namespace
}  // namespace stepdriver::soak

int main(int argc, char** argv) {
  double minutes = 0.0;
  unsigned seed = 1;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i];
    if (name == "--minutes") minutes = std::strtod(argv[i + 1], nullptr);
    if (name == "--seed") seed = static_cast<unsigned>(std::strtoul(argv[i + 1], nullptr, 10));
  }
  if (!(minutes > 0.0) || argc % 2 == 0) {
    std::fputs(stepdriver::soak::kUsage, stderr);
    return 64;
  }
  try {
    return stepdriver::soak::KernelSoak(minutes, seed).run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "FAILED: %s\n", error.what());
    return 1;
  }
}
