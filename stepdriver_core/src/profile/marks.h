#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "output_setting.h"
#include "profile.h"

namespace stepdriver::motion {

/// A place along a path at which an output is switched.
struct Mark {
  std::int64_t place_ns = 0;  ///< position on the path, in nanoseconds of its time
  OutputSetting setting{};
};

/// The places at which a path switches an output. The marks of a path are numbered from 0; those
/// that it has passed may be left out.
struct OutputMarks {
  std::size_t output = 0;  ///< its number in the configuration
  /// How much earlier than at its place a mark switches it.
  std::int64_t lead_on_ns = 0;
  std::int64_t lead_off_ns = 0;
  std::uint64_t first = 0;  ///< the number of the first mark here
  std::vector<Mark> marks;  ///< by place

  std::uint64_t end() const { return first + marks.size(); }
  std::int64_t lead(const Mark& mark) const { return mark.setting.on ? lead_on_ns : lead_off_ns; }
};

/// One for each output that a path switches.
using PathMarks = std::vector<OutputMarks>;

/// The motion time at which a motion along a path is at a place for the first time, to the nearest
/// nanosecond; empty if it doesn't reach it. Doesn't allocate or throw.
///
/// @param along position on the path [s] over motion time; it never turns back.
/// @param place_ns the same, in nanoseconds.
/// @param piece where the search begins, 0 at first: the place isn't before that piece. Set to the
///   piece that contains the place.
std::optional<std::int64_t> timeAtPlace(const Profile& along, std::int64_t place_ns,
                                        std::size_t& piece);

}  // namespace stepdriver::motion
