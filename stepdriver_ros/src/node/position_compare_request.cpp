#include "position_compare_request.h"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {
namespace {

std::int64_t nanosecondsOf(const char* name, double seconds) {
  constexpr double kMost = 10.0;
  if (seconds >= 0.0 && seconds <= kMost) return std::llround(seconds * 1e9);
  throw Refused(fmt::format("{} is {} s, but must be 0 to {} s", name, seconds, kMost));
}

}  // namespace

config::PositionCompare positionCompare(const SetPositionCompare::Request& fields) {
  using Direction = config::PositionCompare::Direction;
  config::PositionCompare compare;
  compare.axis = fields.axis;
  if (fields.direction < -1 || fields.direction > 1) {
    throw Refused(fmt::format("direction is {}, but must be 1, -1 or 0 (both)", fields.direction));
  }
  if (fields.direction != 0) {
    compare.direction = fields.direction > 0 ? Direction::kUp : Direction::kDown;
  }
  if (fields.cam_begin.size() != fields.cam_end.size()) {
    throw Refused(fmt::format("there are {} cam_begin, but {} cam_end", fields.cam_begin.size(),
                              fields.cam_end.size()));
  }
  for (std::size_t i = 0; i < fields.cam_begin.size(); ++i) {
    compare.cams.push_back({fields.cam_begin[i], fields.cam_end[i]});
  }
  compare.places = fields.place;
  if (fields.distance != 0.0) {
    compare.every = config::PositionCompare::Every{fields.distance, fields.begin, fields.end};
  }
  compare.at_end = fields.at_end != 0;
  compare.pulse_ns = nanosecondsOf("pulse", fields.pulse);
  compare.lead_on_ns = nanosecondsOf("lead_on", fields.lead_on);
  compare.lead_off_ns = nanosecondsOf("lead_off", fields.lead_off);
  return compare;
}

}  // namespace stepdriver::ros_node
