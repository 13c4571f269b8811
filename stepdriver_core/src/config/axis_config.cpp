#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::config {

const char* sourceText(LimitSource source) {
  switch (source) {
    case LimitSource::kRobotDescription:
      return "robot_description";
    case LimitSource::kSetLimits:
      return "set_limits";
    case LimitSource::kChip:
      return "the chip's highest step rate";
    case LimitSource::kConfiguration:
      break;
  }
  return "the configuration";
}

}  // namespace stepdriver::config
