// Moves the axis x to 50 mm, without ROS: docs/library.md.
#include <cstdio>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/setup/hardware.h"
#include "stepdriver_core/yaml.h"

int main(int argc, char** argv) {
  try {
    const auto config = stepdriver::yaml::readFile(argc > 1 ? argv[1] : "axis.yaml");
    stepdriver::setup::Hardware hardware(config);
    stepdriver::machine::Machine machine(config.axes, hardware.backend(), hardware.clock(),
                                         config.options());
    auto& x = machine.axis("x");
    x.enable(true);
    const auto result = x.wait(x.moveTo(0.05));
    std::printf("x is at %.4f m: %s\n", result.position, result.message.c_str());
  } catch (const stepdriver::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
