#include "path_marks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "message_text.h"
#include "nanoseconds.h"
#include "path_reader.h"
#include "printable.h"
#include "pwm_line.h"
#include "stepdriver_core/error.h"

namespace stepdriver::motion {
namespace {

// How far an axis is on the way between two knots: on a cubic, or on a quintic if accelerations
// don't jump, as planSpline() makes it.
double positionBetween(const TimingKnot& from, const TimingKnot& to, std::size_t axis,
                       double part) {
  const double duration = static_cast<double>(to.time_ns - from.time_ns) * 1e-9;
  const double way = to.positions[axis] - from.positions[axis];
  const double v0 = from.velocities[axis] * duration;
  const double v1 = to.velocities[axis] * duration;
  const double u = part;
  if (from.accelerations.empty()) {
    const double c2 = 3.0 * way - 2.0 * v0 - v1;
    const double c3 = v0 + v1 - 2.0 * way;
    return from.positions[axis] + u * (v0 + u * (c2 + u * c3));
  }
  const double a0 = from.accelerations[axis] * duration * duration;
  const double a1 = to.accelerations[axis] * duration * duration;
  const double c3 = 10.0 * way - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1;
  const double c4 = -15.0 * way + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1;
  const double c5 = 6.0 * way - 3.0 * (v0 + v1) + 0.5 * (a1 - a0);
  return from.positions[axis] + u * (v0 + u * (0.5 * a0 + u * (c3 + u * (c4 + u * c5))));
}

// When the motion between two knots passes a point of the path, seen along the path's direction
// there. It is before the point at the first knot, and beyond it at the second one.
std::int64_t timeBetween(const TimingKnot& from, const TimingKnot& to, const PathPoint& point) {
  const auto beyond = [&](double part) {
    double sum = 0.0;
    for (std::size_t k = 0; k < point.position.size(); ++k) {
      sum += (positionBetween(from, to, k, part) - point.position[k]) * point.first[k];
    }
    return sum > 0.0;
  };
  double low = 0.0;
  double high = 1.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = low + (high - low) / 2.0;
    (beyond(middle) ? high : low) = middle;
  }
  const auto duration = static_cast<double>(to.time_ns - from.time_ns);
  return from.time_ns + std::llrint(high * duration);
}

std::string textOf(const PathMark& mark) {
  return mark.appended_to ? "a segment of the path that is continued" : segmentText(mark.number);
}

std::string secondsText(std::int64_t ns) {
  return numberText(static_cast<double>(ns) / 1e9) + " s";
}

}  // namespace

std::vector<PathOutput> pathOutputs(const std::vector<config::OutputConfig>& outputs,
                                    const std::vector<OutputLead>& leads) {
  std::vector<PathOutput> known;
  known.reserve(outputs.size());
  for (const config::OutputConfig& output : outputs) {
    known.push_back({output.name, pwmLineOf(output.line).has_value(),
                     config::leastTime(output, true), config::leastTime(output, false),
                     output.max_on_ns});
  }
  for (const OutputLead& lead : leads) {
    const auto found = std::find_if(known.begin(), known.end(), [&](const PathOutput& output) {
      return output.name == lead.output;
    });
    if (found == known.end()) {
      throw Refused(fmt::format("a lead of the path is for the output {}, but {}",
                                printable(lead.output), outputsText(known)));
    }
    for (const double seconds : {lead.on, lead.off}) {
      if (std::isfinite(seconds) && seconds >= 0.0 && seconds <= kMostLead) continue;
      throw Refused(fmt::format("a lead of the output {} is {} s, but must be 0 to {} s",
                                lead.output, numberText(seconds), numberText(kMostLead)));
    }
    found->lead_on_ns = nanoseconds(lead.on);
    found->lead_off_ns = nanoseconds(lead.off);
  }
  return known;
}

std::string outputsText(const std::vector<PathOutput>& outputs) {
  if (outputs.empty()) return "no output is configured";
  return "there are " + joinedText(outputs, [](const PathOutput& output) { return output.name; });
}

void setPlaces(std::vector<PathMark>& marks, std::size_t first, const Path& path,
               const std::vector<TimingKnot>& knots, std::int64_t time_ns) {
  auto knot = knots.begin();
  PathPoint point;
  for (PathMark& mark : marks) {
    const std::size_t segment = mark.segment - first;
    mark.place_ns = time_ns;
    const auto is_passed = [&](const TimingKnot& passed) {
      return passed.segment < segment ||
             (passed.segment == segment && passed.parameter < mark.parameter);
    };
    while (knot != knots.end() && is_passed(*knot)) ++knot;
    if (knot == knots.begin()) {
      mark.place_ns += knot->time_ns;
      continue;
    }
    const TimingKnot& before = *(knot - 1);
    // The end of the segment before it is a knot unless that was left out.
    const bool at_begin = mark.parameter == 0.0;
    const bool is_knot = at_begin && before.segment + 1 == segment && before.parameter == 1.0;
    if (is_knot || knot == knots.end()) {
      mark.place_ns += before.time_ns;
      continue;
    }
    path.evaluate(at_begin ? segment - 1 : segment, at_begin ? 1.0 : mark.parameter, point);
    mark.place_ns += timeBetween(before, *knot, point);
  }
}

void requireRates(const std::vector<PathMark>& marks, const std::vector<PathOutput>& outputs) {
  struct Last {
    const PathMark* mark = nullptr;
    std::int64_t time_ns = 0;
  };
  std::vector<Last> last(outputs.size());
  for (const PathMark& mark : marks) {
    const PathOutput& output = outputs[mark.output];
    const std::int64_t lead = mark.setting.on ? output.lead_on_ns : output.lead_off_ns;
    const std::int64_t time_ns = std::max<std::int64_t>(0, mark.place_ns - lead);
    Last& before = last[mark.output];
    if (before.mark != nullptr && before.mark->setting.on == mark.setting.on) continue;
    if (before.mark != nullptr) {
      const std::int64_t since = time_ns - before.time_ns;
      const config::LeastTime& least = mark.setting.on ? output.least_off : output.least_on;
      const std::int64_t least_ns = std::max<std::int64_t>(1, least.ns);
      if (since < least_ns) {
        throw Refused(fmt::format(
            "{} switches the output {} {} {} after it was switched {}, but {} of it is {}",
            textOf(mark), output.name, mark.setting.on ? "on" : "off", secondsText(since),
            mark.setting.on ? "off" : "on", least.name, secondsText(least_ns)));
      }
      if (!mark.setting.on && output.max_on_ns && since > *output.max_on_ns) {
        throw Refused(fmt::format(
            "{} switches the output {} off {} after it was switched on, but max_on_s of it is {}",
            textOf(mark), output.name, secondsText(since), secondsText(*output.max_on_ns)));
      }
    }
    before = {&mark, time_ns};
  }
}

std::shared_ptr<const PathMarks> marksByOutput(const std::vector<PathMark>& marks,
                                               const std::vector<PathOutput>& outputs,
                                               const std::vector<std::uint64_t>& passed) {
  auto all = std::make_shared<PathMarks>();
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    OutputMarks own;
    own.output = i;
    own.lead_on_ns = outputs[i].lead_on_ns;
    own.lead_off_ns = outputs[i].lead_off_ns;
    own.first = i < passed.size() ? passed[i] : 0;
    for (const PathMark& mark : marks) {
      if (mark.output == i) own.marks.push_back({mark.place_ns, mark.setting});
    }
    if (own.end() > 0) all->push_back(std::move(own));
  }
  return all->empty() ? nullptr : all;
}

}  // namespace stepdriver::motion
