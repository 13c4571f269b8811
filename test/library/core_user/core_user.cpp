#include <iostream>

#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/libgpiod_lines.h"
#include "stepdriver_core/machine/machine.h"

// Uses code that needs libgpiod and threads. No line is touched.
int main() {
  try {
    const auto backend = stepdriver::gpio::makeLibgpiodBackend();
    stepdriver::pulse::SteadyClock clock;
    const stepdriver::machine::Machine machine({}, *backend, clock);
    std::cout << "libgpiod " << stepdriver::gpio::libgpiodVersion() << ", " << machine.axes().size()
              << " axes\n";
  } catch (const stepdriver::GpioError& error) {
    std::cout << "no libgpiod: " << error.what() << '\n';
  }
}
