#include "pwm_line.h"

#include <fmt/format.h>

#include <cinttypes>
#include <cmath>
#include <cstdio>

#include "stepdriver_core/gpio/lines.h"

namespace stepdriver {

std::int64_t PwmLine::lengthOf(std::uint16_t part) const {
  const double share = static_cast<double>(part) / gpio::LineWrite::kWhole;
  return off_ns + std::llround(share * static_cast<double>(on_ns - off_ns));
}

std::string PwmLine::name() const { return fmt::format("pwmchip{}:{}", chip, channel); }

std::string PwmLine::text() const {
  return fmt::format("{}/{}/{}/{}", name(), period_ns, off_ns, on_ns);
}

std::optional<PwmLine> pwmLineOf(const std::string& line) {
  PwmLine pwm;
  const int count = std::sscanf(line.c_str(), "pwmchip%d:%d/%" SCNd64 "/%" SCNd64 "/%" SCNd64,
                                &pwm.chip, &pwm.channel, &pwm.period_ns, &pwm.off_ns, &pwm.on_ns);
  // Only what text() makes.
  if (count != 5 || pwm.text() != line) return {};
  return pwm;
}

}  // namespace stepdriver
