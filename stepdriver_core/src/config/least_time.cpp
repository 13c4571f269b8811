#include "config/least_time.h"

#include "pwm_line.h"

namespace stepdriver::config {

LeastTime leastTime(const OutputConfig& output, bool on) {
  const LeastTime wanted{on ? output.min_on_ns : output.min_off_ns,
                         on ? "min_on_ms" : "min_off_ms"};
  const auto pwm = pwmLineOf(output.line);
  return pwm && pwm->period_ns > wanted.ns ? LeastTime{pwm->period_ns, "the PWM period"} : wanted;
}

}  // namespace stepdriver::config
