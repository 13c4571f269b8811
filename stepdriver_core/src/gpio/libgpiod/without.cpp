#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/libgpiod_lines.h"

namespace stepdriver::gpio {
namespace {

[[noreturn]] void refuse() {
  throw GpioError(
      "stepdriver was built without libgpiod, so only simulated lines are available. Install "
      "libgpiod-dev and build again; with -DSTEPDRIVER_GPIOD=1 or =2 CMake says what is missing.");
}

}  // namespace

std::string libgpiodVersion() { return ""; }

std::unique_ptr<Backend> makeLibgpiodBackend() { refuse(); }

std::vector<ChipInfo> gpioChips() { refuse(); }

}  // namespace stepdriver::gpio
