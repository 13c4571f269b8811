#include "path_request.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {
namespace {

using Shape = motion::PathSegment::Shape;

template <typename From, typename To>
void takeTwo(const From& from, To& to, std::size_t index, const char* what) {
  if (from.size() != to.size()) {
    throw Refused(fmt::format("segment {} of the path is an arc with {} {}, but must have 2", index,
                              from.size(), what));
  }
  std::copy(from.begin(), from.end(), to.begin());
}

motion::PathSegment segmentOf(const PathSegment& fields, std::size_t index) {
  motion::PathSegment segment;
  switch (fields.shape) {
    case PathSegment::LINE:
      segment.shape = Shape::kLine;
      break;
    case PathSegment::ARC_AROUND:
      segment.shape = Shape::kArcAround;
      break;
    case PathSegment::ARC_THROUGH:
      segment.shape = Shape::kArcThrough;
      break;
    case PathSegment::BEZIER:
      segment.shape = Shape::kBezier;
      break;
    default:
      throw Refused(fmt::format(
          "segment {} of the path has the shape {}, but must be {} (a line), {} or {} (an arc), or "
          "{} (a Bezier)",
          index, fields.shape, +PathSegment::LINE, +PathSegment::ARC_AROUND,
          +PathSegment::ARC_THROUGH, +PathSegment::BEZIER));
  }
  segment.end = fields.end;
  if (segment.shape == Shape::kArcAround || segment.shape == Shape::kArcThrough) {
    takeTwo(fields.plane, segment.plane, index, "names in plane");
    takeTwo(fields.point, segment.point, index, "numbers in point");
  }
  segment.clockwise = fields.clockwise != 0;
  segment.control1 = fields.control1;
  segment.control2 = fields.control2;
  segment.velocity = fields.velocity;
  if (fields.tolerance != 0.0) {
    segment.tolerance = fields.tolerance < 0.0 ? 0.0 : fields.tolerance;
  }
  for (const OutputSwitch& output : fields.outputs) {
    segment.outputs.push_back(
        {output.name, output.on != 0, output.value == 0.0 ? 1.0 : output.value, output.distance});
  }
  return segment;
}

}  // namespace

std::vector<motion::PathSegment> pathSegments(const std::vector<PathSegment>& fields) {
  if (fields.size() > motion::kMostPathSegments) {  // before they are copied
    throw Refused(fmt::format("the path has {} segments, but must have 1 to {}", fields.size(),
                              motion::kMostPathSegments));
  }
  std::vector<motion::PathSegment> segments;
  segments.reserve(fields.size());
  for (std::size_t i = 0; i < fields.size(); ++i) {
    segments.push_back(segmentOf(fields[i], i));
  }
  return segments;
}

std::vector<motion::OutputLead> outputLeads(const std::vector<OutputLead>& fields) {
  std::vector<motion::OutputLead> leads;
  leads.reserve(fields.size());
  for (const OutputLead& lead : fields) leads.push_back({lead.name, lead.on, lead.off});
  return leads;
}

}  // namespace stepdriver::ros_node
