#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "stepdriver_core/gpio/libgpiod_lines.h"
#include "stepdriver_core/pulse/clock.h"
#include "support/gpio_sim.h"

// Measures the duration of a write of lines on the test kernel, compared with a system call that
// does nothing.

namespace {

using namespace stepdriver;

/// @return the fastest of several batches [us]: other work on the machine only ever adds to the
///   time.
double costOf(const std::function<void()>& action) {
  constexpr int kBatches = 100;
  constexpr int kBatch = 100;
  pulse::SteadyClock clock;
  double best = 1e9;
  for (int i = 0; i < kBatches; ++i) {
    const pulse::Nanoseconds begin = clock.now();
    for (int k = 0; k < kBatch; ++k) action();
    best = std::min(best, static_cast<double>(clock.now() - begin) * 1e-3 / kBatch);
  }
  return best;
}

double costOfWriting(gpio::Backend& backend, int count) {
  std::vector<gpio::OutputRequest> outputs;
  std::vector<gpio::LineWrite> writes;
  for (int i = 0; i < count; ++i) {
    outputs.push_back({"cost-board:" + std::to_string(i), false, false});
    writes.push_back({i, false});
  }
  const auto lines = backend.request(outputs, {});
  int error = 0;
  const double cost = costOf([&] { error |= lines->write(writes.data(), writes.size()); });
  if (error != 0) throw std::runtime_error("a write failed");
  return cost;
}

}  // namespace

int main() {
  try {
    const test::GpioSimChip chip("cost", "cost-board", 8);
    const auto backend = gpio::makeLibgpiodBackend();
    const double bare = costOf([] { syscall(SYS_getppid); });
    std::printf("libgpiod %s: a bare system call takes %.1f us, ", gpio::libgpiodVersion().c_str(),
                bare);
    std::printf("a write of 1 line %.1f us, ", costOfWriting(*backend, 1));
    std::printf("a write of 4 lines %.1f us\n", costOfWriting(*backend, 4));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "write_cost: %s\n", error.what());
    return 1;
  }
  return 0;
}
