#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/least_time.h"
#include "geometry/path.h"
#include "output_setting.h"
#include "path_timing/acceleration_limited.h"
#include "profile/marks.h"
#include "stepdriver_core/config/io_config.h"
#include "stepdriver_core/trajectory/requests.h"

namespace stepdriver::motion {

/// What a path must know of an output that it may switch.
struct PathOutput {
  std::string name;
  bool is_pwm = false;
  config::LeastTime least_on;
  config::LeastTime least_off;
  std::optional<std::int64_t> max_on_ns;
  std::int64_t lead_on_ns = 0;
  std::int64_t lead_off_ns = 0;
};

/// All outputs of the machine, with the leads of a path.
///
/// @throw Refused if a lead is out of its range, or of an output that there isn't.
std::vector<PathOutput> pathOutputs(const std::vector<config::OutputConfig>& outputs,
                                    const std::vector<OutputLead>& leads);

/// "there are pen, laser"
std::string outputsText(const std::vector<PathOutput>& outputs);

/// A place at which a path switches an output.
struct PathMark {
  std::size_t segment = 0;  ///< it is on this one; the number of segments: the end of the path
  double parameter = 0.0;   ///< of the segment, 0 to 1
  std::size_t output = 0;   ///< by its number
  OutputSetting setting{};
  std::size_t number = 0;     ///< of the segment that asks for it, in a refusal
  bool appended_to = false;   ///< that segment is one of a path to which others are appended
  std::int64_t place_ns = 0;  ///< see Mark
};

/// Sets the places of marks: when a motion along a path passes them, as its knots say.
///
/// @param marks by segment and parameter.
/// @param first the number of the path's first segment among those of the marks.
/// @param time_ns of the first knot's time 0.
void setPlaces(std::vector<PathMark>& marks, std::size_t first, const Path& path,
               const std::vector<TimingKnot>& knots, std::int64_t time_ns);

/// @throw Refused if an output would be switched again before its least times are over, or stay on
///   for longer than it may. At a lower rate of the path all marks only come farther apart.
void requireRates(const std::vector<PathMark>& marks, const std::vector<PathOutput>& outputs);

/// By output; nullptr: there are none.
///
/// @param passed by output, how many marks were left out at the beginning.
std::shared_ptr<const PathMarks> marksByOutput(const std::vector<PathMark>& marks,
                                               const std::vector<PathOutput>& outputs,
                                               const std::vector<std::uint64_t>& passed);

}  // namespace stepdriver::motion
