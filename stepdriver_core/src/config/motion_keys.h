#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::config {

/// The keys of an axis's motion in one of the two units, and that unit.
struct MotionKeys {
  Kind kind;
  std::string unit;               ///< as in messages
  long double units_per_si_unit;  ///< mm per m, degrees per rad
  long double units_per_round;    ///< 360 degrees; 0: given by per_round or wheel_diameter
  std::string steps_per_unit;
  std::string per_round, wheel_diameter;  ///< empty: no such key
  std::string max_speed, start_speed;
  std::string acceleration, deceleration, stop_deceleration, jerk;
  std::string backlash;
  std::string min_position, max_position;
  std::string max_skew;

  std::vector<std::string> all() const {
    std::vector<std::string> keys{steps_per_unit, max_speed,         start_speed, acceleration,
                                  deceleration,   stop_deceleration, jerk,        backlash,
                                  min_position,   max_position,      max_skew};
    for (const std::string& key : {per_round, wheel_diameter}) {
      if (!key.empty()) keys.push_back(key);
    }
    return keys;
  }
};

constexpr long double kPi = 3.14159265358979323846264338327950288L;

inline const MotionKeys& motionKeys(Kind kind) {
  static const MotionKeys linear{Kind::kLinear,
                                 "mm",
                                 1000.0L,
                                 0.0L,
                                 "steps_per_mm",
                                 "mm_per_round",
                                 "wheel_diameter_mm",
                                 "max_speed_mm_s",
                                 "start_speed_mm_s",
                                 "acceleration_mm_s2",
                                 "deceleration_mm_s2",
                                 "stop_deceleration_mm_s2",
                                 "jerk_mm_s3",
                                 "backlash_mm",
                                 "min_position_mm",
                                 "max_position_mm",
                                 "max_skew_mm"};
  static const MotionKeys rotary{Kind::kRotary,
                                 "degree",
                                 180.0L / kPi,
                                 360.0L,
                                 "steps_per_degree",
                                 "",
                                 "",
                                 "max_speed_deg_s",
                                 "start_speed_deg_s",
                                 "acceleration_deg_s2",
                                 "deceleration_deg_s2",
                                 "stop_deceleration_deg_s2",
                                 "jerk_deg_s3",
                                 "backlash_deg",
                                 "min_position_deg",
                                 "max_position_deg",
                                 "max_skew_deg"};
  return kind == Kind::kLinear ? linear : rotary;
}

}  // namespace stepdriver::config
