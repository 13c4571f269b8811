#include "path.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "give_way.h"
#include "overlapping_blends.h"
#include "profile/errors.h"

namespace stepdriver::motion {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kSmooth = 1e-6;  // [rad] a smaller change of direction is no corner
constexpr double kSharpest = 170.0 / 180.0 * kPi;  // [rad] beyond that, the motion stops
constexpr double kMostBend = 0.0108;               // the largest value of |n(w) - w|w||/(4 d^2)
constexpr double kEven = 1e-6;  // a smaller change relative to the curvature is no jump
constexpr double kGentle = 30.0 / 180.0 * kPi;  // [rad] up to this, roundings may overlap
constexpr double kLeastBlend = 0.01;            // relative to the resolution
constexpr double kLeastRate = 1e-4;             // a Bezier's, relative to the sum of its handles
constexpr double kHandle = 0.2;  // the shortest handle of a Bezier, relative to the resolution
constexpr double kRoundRadius = 1e-12;  // relative to a radius: a smaller difference is rounding
constexpr double kInLine = 1e-9;        // the sine of the angle between points that are in line

double norm(const std::vector<double>& vector) {
  double sum = 0.0;
  for (const double x : vector) sum += x * x;
  return std::sqrt(sum);
}

// The norm of the direction of a line, which has two coefficients for each axis.
double norm(const std::vector<double>& powers, std::size_t axes) {
  double sum = 0.0;
  for (std::size_t i = 0; i < axes; ++i) sum += powers[2 * i + 1] * powers[2 * i + 1];
  return std::sqrt(sum);
}

double distanceOf(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> way(a);
  for (std::size_t i = 0; i < way.size(); ++i) way[i] -= b[i];
  return norm(way);
}

// The control points of a Bezier. If one coincided with its end, the derivative would be 0 there.
// It is therefore moved by `length` towards the next control point that lies elsewhere, which moves
// the curve by 4/9 of the length or less. If both coincide with their ends, the curve is a straight
// line; another parametrization of it has them at the thirds of the line.
std::pair<std::vector<double>, std::vector<double>> awayFromEnds(const std::vector<double>& from,
                                                                 const CurveSegment& given,
                                                                 double length) {
  const auto is_near = [&](const std::vector<double>& a, const std::vector<double>& b) {
    return distanceOf(a, b) < length;
  };
  const auto towards = [&](const std::vector<double>& begin, const std::vector<double>& end,
                           double part) {
    std::vector<double> place(begin);
    for (std::size_t i = 0; i < place.size(); ++i) place[i] += part * (end[i] - begin[i]);
    return place;
  };
  const auto moved = [&](const std::vector<double>& begin, const std::vector<double>& control,
                         const std::vector<double>& end) {
    const std::vector<double>& to = is_near(begin, control) ? end : control;
    return towards(begin, to, std::min(1.0, length / distanceOf(begin, to)));
  };
  const bool first = is_near(from, given.control1);
  const bool second = is_near(given.end, given.control2);
  if (first && second) {
    return {towards(from, given.end, 1.0 / 3.0), towards(from, given.end, 2.0 / 3.0)};
  }
  return {first ? moved(from, given.control2, given.end) : given.control1,
          second ? moved(given.end, given.control1, from) : given.control2};
}

// The least |p'| of a Bezier, whose derivative is a parabola. It is searched at many places first,
// and then more closely around the best one.
double leastRate(const std::vector<double>& powers, std::size_t axes) {
  const auto rate_at = [&](double u) {
    double sum = 0.0;
    for (std::size_t i = 0; i < axes; ++i) {
      const double* c = &powers[4 * i];
      const double d = c[1] + u * (2.0 * c[2] + u * 3.0 * c[3]);
      sum += d * d;
    }
    return std::sqrt(sum);
  };
  constexpr int kPlaces = 32;
  double best = 0.0;
  double width = 1.0 / kPlaces;
  for (int i = 1; i <= kPlaces; ++i) {
    if (rate_at(i * width) < rate_at(best)) best = i * width;
  }
  for (; width > 1e-6; width /= 2.0) {
    for (const double u : {best - width, best + width}) {
      if (u >= 0.0 && u <= 1.0 && rate_at(u) < rate_at(best)) best = u;
    }
  }
  return rate_at(best);
}

// The jump of p'' between two segments, for parameters with |p'| = 1.
std::vector<double> jumpOf(const PathPoint& in, double rate_in, const PathPoint& out,
                           double rate_out) {
  std::vector<double> jump;
  jump.reserve(in.second.size());
  for (std::size_t i = 0; i < in.second.size(); ++i) {
    jump.push_back(out.second[i] / (rate_out * rate_out) - in.second[i] / (rate_in * rate_in));
  }
  return jump;
}

// The size of the part of a jump that changes the curvature: the part at a right angle to the mean
// direction.
double acrossOf(const std::vector<double>& jump, const PathPoint& in, double rate_in,
                const PathPoint& out, double rate_out) {
  double along = 0.0;
  double square = 0.0;
  for (std::size_t i = 0; i < jump.size(); ++i) {
    const double mean = out.first[i] / rate_out + in.first[i] / rate_in;
    along += jump[i] * mean;
    square += mean * mean;
  }
  double across = 0.0;
  for (std::size_t i = 0; i < jump.size(); ++i) {
    const double mean = out.first[i] / rate_out + in.first[i] / rate_in;
    const double x = jump[i] - mean * along / square;
    across += x * x;
  }
  return std::sqrt(across);
}

}  // namespace

Path::Path(std::vector<double> start, const std::vector<CurveSegment>& segments, double resolution,
           Continuity continuity, bool continues)
    : start_(std::move(start)), resolution_(resolution), continues_(continues) {
  segments_.reserve(segments.size());
  for (std::size_t i = 0; i < segments.size(); ++i) {
    segments_.push_back(placed(i == 0 ? start_ : segments[i - 1].end, segments[i]));
  }
  for (std::size_t i = 0; i + 1 < segments.size(); ++i) {
    round(i, segments[i], continuity);
  }
  open_.segment = size();
  widen(segments, continues);
}

Path::Segment Path::placed(const std::vector<double>& from, const CurveSegment& given) const {
  Segment segment;
  segment.shape = given.shape;
  segment.speed = given.speed;
  segment.measured = given.measured;
  segment.to = given.end;
  if (given.shape == CurveSegment::Shape::kBezier) {
    segment.powers.resize(4 * axes());
    const auto [control1, control2] = awayFromEnds(from, given, kHandle * resolution_);
    double handles = 0.0;
    for (std::size_t i = 0; i < axes(); ++i) {
      const double p0 = from[i];
      const double p1 = control1[i];
      const double p2 = control2[i];
      const double p3 = given.end[i];
      double* c = &segment.powers[4 * i];
      c[0] = p0;
      c[1] = 3.0 * (p1 - p0);
      c[2] = 3.0 * (p2 - 2.0 * p1 + p0);
      c[3] = p3 - p0 + 3.0 * (p1 - p2);
      handles += std::abs(p1 - p0) + std::abs(p2 - p1) + std::abs(p3 - p2);
    }
    const double least = std::min(kLeastRate * handles, kHandle * resolution_);
    if (leastRate(segment.powers, axes()) < least) {
      throw Malformed(fmt::format(
          "segment {} is a Bezier with a cusp: its derivative is 0 there, and must not be",
          given.number));
    }
  } else {
    segment.powers.resize(2 * axes());
    for (std::size_t i = 0; i < axes(); ++i) {
      segment.powers[2 * i] = from[i];
      segment.powers[2 * i + 1] = given.end[i] - from[i];
    }
  }
  if (given.shape == CurveSegment::Shape::kArc) {
    segment.plane = given.plane;
    segment.centre = given.centre;
    segment.angle = given.angle;
    const double x = from[given.plane[0]] - given.centre[0];
    const double y = from[given.plane[1]] - given.centre[1];
    segment.radius = std::hypot(x, y);
    segment.from = std::atan2(y, x);
    const double end = std::hypot(given.end[given.plane[0]] - given.centre[0],
                                  given.end[given.plane[1]] - given.centre[1]);
    const double growth = end - segment.radius;
    if (std::abs(growth) > kRoundRadius * segment.radius) segment.growth = growth;
    const double turned = segment.from + segment.angle;
    const double last = segment.radius + segment.growth;
    segment.spoke = {segment.radius * std::cos(segment.from),
                     segment.radius * std::sin(segment.from)};
    const std::array<double, 2> way{last * std::cos(turned) - segment.spoke[0],
                                    last * std::sin(turned) - segment.spoke[1]};
    for (std::size_t k = 0; k < 2; ++k) {
      segment.gap[k] = segment.powers[2 * given.plane[k] + 1] - way[k];
    }
  }
  return segment;
}

// [1/unit] The largest |p''| in the half of a segment next to a corner, for a parameter that makes
// |p'| equal to 1 at the corner.
double Path::sharpest(const Segment& segment, double rate) const {
  switch (segment.shape) {
    case CurveSegment::Shape::kLine:
      return 0.0;
    case CurveSegment::Shape::kArc:
      return ((segment.radius + std::max(0.0, segment.growth)) * std::abs(segment.angle) +
              2.0 * std::abs(segment.growth)) *
             std::abs(segment.angle) / (rate * rate);
    case CurveSegment::Shape::kBezier: {
      // The second derivative is linear, so it is largest at an end.
      double begin = 0.0;
      double end = 0.0;
      for (std::size_t i = 0; i < axes(); ++i) {
        const double* c = &segment.powers[4 * i];
        begin += 4.0 * c[2] * c[2];
        end += (2.0 * c[2] + 6.0 * c[3]) * (2.0 * c[2] + 6.0 * c[3]);
      }
      return std::sqrt(std::max(begin, end)) / (rate * rate);
    }
  }
  return 0.0;
}

void Path::round(std::size_t corner, const CurveSegment& given, Continuity continuity) {
  Segment& before = segments_[corner];
  Segment& after = segments_[corner + 1];
  PathPoint in;
  PathPoint out;
  evaluateGiven(corner, 1.0, in);
  evaluateGiven(corner + 1, 0.0, out);
  before.end.rate = norm(in.first);
  after.begin.rate = norm(out.first);
  std::vector<double> shift(axes());
  for (std::size_t i = 0; i < axes(); ++i) {
    shift[i] = (out.first[i] / after.begin.rate - in.first[i] / before.end.rate) / 2.0;
  }
  const double half_chord = norm(shift);  // sin(turn/2)
  before.stops = false;
  const double sharpness =
      std::max(sharpest(before, before.end.rate), sharpest(after, after.begin.rate));
  const bool turns_back = half_chord > std::sin(kSharpest / 2.0);
  std::vector<double> jump;
  if (continuity == Continuity::kCurvature && !turns_back) {
    jump = jumpOf(in, before.end.rate, out, after.begin.rate);
    const double across = acrossOf(jump, in, before.end.rate, out, after.begin.rate);
    if (!(across > kEven * sharpness)) jump.clear();
  }
  if (2.0 * half_chord < kSmooth && jump.empty()) return;
  double distance = given.blend.value_or(0.0);
  if (!turns_back && !given.blend) {
    const double turning = kMidRounding * half_chord;
    // Solves turning d + bending d^2 = tolerance.
    const double bending = kMostBend * norm(jump);
    const double root = std::sqrt(turning * turning + 4.0 * bending * given.tolerance);
    distance = jump.empty() ? given.tolerance / turning : 2.0 * given.tolerance / (turning + root);
    distance = std::min(
        {distance, before.end.rate * std::min(0.5, 1.0 - given.kept), after.begin.rate / 2.0});
    if (sharpness > 0.0)
      distance = std::min(distance, 1.0 / ((jump.empty() ? 2.0 : 4.0) * sharpness));
  }
  if (distance < kLeastBlend * resolution_) {
    before.stops = true;
    return;
  }
  before.end.blend = after.begin.blend = distance;
  before.end.shift = after.begin.shift = std::move(shift);
  before.end.jump = after.begin.jump = std::move(jump);
}

Path Path::part(std::size_t first, std::size_t last) const {
  PathPoint begin;
  evaluateGiven(first, 0.0, begin);
  Path made(std::move(begin.position), {}, resolution_);
  made.segments_.assign(segments_.begin() + static_cast<std::ptrdiff_t>(first),
                        segments_.begin() + static_cast<std::ptrdiff_t>(last) + 1);
  made.open_ = {open_.segment - std::min(open_.segment, first), open_.parameter};
  made.continues_ = continues_;
  return made;
}

Path Path::withStops(const std::vector<std::size_t>& corners) const {
  Path made(*this);
  for (const std::size_t corner : corners) {
    made.segments_[corner].stops = true;
    made.segments_[corner].end.blend = made.segments_[corner + 1].begin.blend = 0.0;
  }
  return made;
}

bool Path::isSeparate(std::size_t corner) const {
  const Segment& before = segments_[corner];
  const Segment& after = segments_[corner + 1];
  const auto reaches = [](const Segment& segment, double place) {
    return std::any_of(segment.overlaps.begin(), segment.overlaps.end(),
                       [&](const Segment::Overlap& overlap) {
                         return std::abs(place - overlap.place) < overlap.end.blend;
                       });
  };
  return before.end.blend <= std::min(before.end.rate, after.begin.rate) &&
         !reaches(before, before.end.rate) && !reaches(after, 0.0);
}

bool Path::isGentle(std::size_t corner) const {
  const Segment& before = segments_[corner];
  return isLine(corner) && isLine(corner + 1) && !before.stops &&
         norm(before.end.shift) <= std::sin(kGentle / 2.0);
}

// Lets the roundings of neighbouring gentle corners overlap.
void Path::widen(const std::vector<CurveSegment>& given, bool continues) {
  for (std::size_t first = 0; first + 1 < size(); ++first) {
    giveWay(first);
    if (!isGentle(first)) continue;
    std::size_t last = first;
    while (last + 2 < size() && isGentle(last + 1)) ++last;
    // A collinear end needs nothing: there is no rounding and no stop.
    const bool open = continues && last + 2 == size();
    const double length = segments_[last + 1].begin.rate;
    OverlappingBlends corners(segments_[first].begin.blend,
                              open ? length / 2.0 : length - segments_[last + 1].end.blend);
    for (std::size_t i = first; i <= last; ++i) {
      const End& end = segments_[i].end;
      corners.append(end.rate, norm(end.shift), end.blend, given[i].tolerance,
                     given[i].blend.has_value(), given[i].kept * end.rate);
    }
    const std::vector<double> distances = corners.widened();
    for (std::size_t i = first; i <= last; ++i) {
      const double distance = distances[i - first];
      if (distance < kLeastBlend * resolution_ && norm(segments_[i].end.shift) > 0.0) {
        segments_[i].end.blend = segments_[i + 1].begin.blend = 0.0;
        segments_[i].stops = true;
      } else if (distance != segments_[i].end.blend || given[i].blend) {
        overlap(i, distance);
      }
    }
    if (open) findOpen(first, last);
    first = last;
  }
}

// Makes the rounding of a corner reach this far.
void Path::overlap(std::size_t corner, double distance) {
  segments_[corner].end.blend = segments_[corner + 1].begin.blend = distance;
  const std::vector<double>& shift = segments_[corner].end.shift;
  // The distance from the corner to the end of the line.
  double place = segments_[corner + 1].begin.rate;
  for (std::size_t i = corner + 2; i < size() && place < distance; ++i) {
    const double rate = norm(segments_[i].powers, axes());
    segments_[i].overlaps.push_back({-place, {rate, distance, shift, {}}});
    place += rate;
  }
  place = segments_[corner].end.rate;
  for (std::size_t i = corner; i-- > 0 && place < distance;) {
    const double rate = norm(segments_[i].powers, axes());
    place += rate;
    segments_[i].overlaps.push_back({place, {rate, distance, shift, {}}});
  }
}

// @param first, last the first and the last of the corners between lines at the end of the path
void Path::findOpen(std::size_t first, std::size_t last) {
  constexpr double kReaches = 1.0 - 1e-6;
  // From the corner to the middle of the last line.
  double to_middle = segments_[last + 1].begin.rate / 2.0;
  for (std::size_t i = last + 1; i-- > first;) {
    const double blend = segments_[i].end.blend;
    if (blend >= to_middle * kReaches) {
      std::size_t segment = i;
      double before = segments_[i].end.rate - blend;
      while (before < 0.0 && segment > 0) before += norm(segments_[--segment].powers, axes());
      open_ = {segment, std::max(0.0, before / norm(segments_[segment].powers, axes()))};
    }
    to_middle += segments_[i].end.rate;
  }
}

// A segment is rounded before the first of these parameters and after the second.
std::pair<double, double> Path::rounded(std::size_t index) const {
  const Segment& segment = segments_[index];
  double until = segment.begin.blend > 0.0 ? segment.begin.blend / segment.begin.rate : 0.0;
  double from = segment.end.blend > 0.0 ? 1.0 - segment.end.blend / segment.end.rate : 1.0;
  for (const Segment::Overlap& overlap : segment.overlaps) {
    const double place = overlap.place / overlap.end.rate;
    const double reach = overlap.end.blend / overlap.end.rate;
    if (place < 0.5) until = std::max(until, place + reach);
    if (place > 0.5) from = std::min(from, place - reach);
  }
  if (until <= from) return {until, from};
  const double middle = (std::clamp(until, 0.0, 1.0) + std::clamp(from, 0.0, 1.0)) / 2.0;
  return {middle, middle};
}

double Path::roundedUntil(std::size_t segment) const { return rounded(segment).first; }

double Path::roundedFrom(std::size_t segment) const { return rounded(segment).second; }

bool Path::isLine(std::size_t segment) const {
  return segments_[segment].shape == CurveSegment::Shape::kLine;
}

void Path::evaluateGiven(std::size_t index, double u, PathPoint& point) const {
  const Segment& segment = segments_[index];
  point.position.resize(axes());
  point.first.resize(axes());
  point.second.resize(axes());
  if (segment.shape == CurveSegment::Shape::kBezier) {
    for (std::size_t i = 0; i < axes(); ++i) {
      const double* c = &segment.powers[4 * i];
      point.position[i] = c[0] + u * (c[1] + u * (c[2] + u * c[3]));
      point.first[i] = c[1] + u * (2.0 * c[2] + u * 3.0 * c[3]);
      point.second[i] = 2.0 * c[2] + u * 6.0 * c[3];
    }
  } else {
    for (std::size_t i = 0; i < axes(); ++i) {
      const double* c = &segment.powers[2 * i];
      point.position[i] = c[0] + u * c[1];
      point.first[i] = c[1];
      point.second[i] = 0.0;
    }
  }
  if (segment.shape == CurveSegment::Shape::kArc) evaluateArc(segment, u, point);
  if (u == 1.0) point.position = segment.to;
}

// The two axes of its plane.
void Path::evaluateArc(const Segment& segment, double u, PathPoint& point) {
  const double angle = segment.from + u * segment.angle;
  const double radius = segment.radius + u * segment.growth;
  const double x = radius * std::cos(angle);
  const double y = radius * std::sin(angle);
  const auto [a, b] = segment.plane;
  point.position[a] = segment.powers[2 * a] + (x - segment.spoke[0]) + u * segment.gap[0];
  point.position[b] = segment.powers[2 * b] + (y - segment.spoke[1]) + u * segment.gap[1];
  point.first[a] = -y * segment.angle + segment.gap[0];
  point.first[b] = x * segment.angle + segment.gap[1];
  point.second[a] = -x * segment.angle * segment.angle;
  point.second[b] = -y * segment.angle * segment.angle;
  if (segment.growth == 0.0) return;
  const double rate = segment.growth / radius;  // the change of the radius relative to it
  point.first[a] += x * rate;
  point.first[b] += y * rate;
  point.second[a] -= 2.0 * y * rate * segment.angle;
  point.second[b] += 2.0 * x * rate * segment.angle;
}

void Path::evaluate(std::size_t index, double u, PathPoint& point) const {
  evaluateGiven(index, u, point);
  const Segment& segment = segments_[index];
  blend(segment.begin, u * segment.begin.rate, 1.0, point);
  blend(segment.end, (1.0 - u) * segment.end.rate, -1.0, point);
  for (const Segment::Overlap& overlap : segment.overlaps) {
    const double w = u * overlap.end.rate - overlap.place;
    blend(overlap.end, std::abs(w), w < 0.0 ? -1.0 : 1.0, point);
  }
}

// Adds shift (m(w) - |w|) + jump/4 (n(w) - w|w|) at a distance |w| from the corner, on the side
// that the sign of w tells.
void Path::blend(const End& end, double distance, double sign, PathPoint& point) const {
  if (!(end.blend > 0.0 && distance < end.blend)) return;
  const double y = distance / end.blend;
  const double position = end.blend * (kMidRounding + y * y * (0.75 - 0.125 * y * y)) - distance;
  const double first = sign * end.rate * (y * (1.5 - 0.5 * y * y) - 1.0);
  const double second = end.rate * end.rate * 1.5 * (1.0 - y * y) / end.blend;
  for (std::size_t i = 0; i < axes(); ++i) {
    point.position[i] += end.shift[i] * position;
    point.first[i] += end.shift[i] * first;
    point.second[i] += end.shift[i] * second;
  }
  if (end.jump.empty()) return;
  const double d = end.blend;
  const double square = end.rate * end.rate;
  const double bent = sign * d * d * y * (0.375 - y + y * y * (0.75 - 0.125 * y * y));
  const double bent_first = end.rate * d * (0.375 - 2.0 * y + y * y * (2.25 - 0.625 * y * y));
  const double bent_second = sign * square * (y * (4.5 - 2.5 * y * y) - 2.0);
  for (std::size_t i = 0; i < axes(); ++i) {
    point.position[i] += end.jump[i] / 4.0 * bent;
    point.first[i] += end.jump[i] / 4.0 * bent_first;
    point.second[i] += end.jump[i] / 4.0 * bent_second;
  }
}

std::pair<double, double> Path::range(std::size_t index, std::size_t axis) const {
  const Segment& segment = segments_[index];
  if (isLine(index)) {
    return std::minmax({segment.powers[2 * axis], segment.to[axis]});
  }
  PathPoint point;
  evaluateGiven(index, 0.0, point);
  double low = point.position[axis];
  double high = low;
  const auto include = [&](double u) {
    if (!(u > 0.0 && u <= 1.0)) return;
    evaluateGiven(index, u, point);
    low = std::min(low, point.position[axis]);
    high = std::max(high, point.position[axis]);
  };
  include(1.0);
  if (segment.shape == CurveSegment::Shape::kBezier) {
    // Solves c1 + 2 c2 u + 3 c3 u^2 = 0.
    const double* c = &segment.powers[4 * axis];
    const double root = std::sqrt(std::max(0.0, c[2] * c[2] - 3.0 * c[1] * c[3]));
    const double sum = -(c[2] + std::copysign(root, c[2]));
    if (sum != 0.0) include(c[1] / sum);
    if (c[3] != 0.0) include(sum / (3.0 * c[3]));
  }
  if (segment.shape == CurveSegment::Shape::kArc) {
    for (std::size_t k = 0; k < 2; ++k) {
      if (segment.plane[k] != axis) continue;
      // The angle at which this axis has an extreme.
      const double quarter = k == 0 ? 0.0 : kPi / 2.0;
      const auto [least, most] = std::minmax({segment.from, segment.from + segment.angle});
      // If the radius changes by g while the angle changes by b, the extremes lie beyond that angle
      // by atan(g/(r b)).
      for (double turn = std::floor((least - quarter) / kPi); turn * kPi + quarter < most + kPi;
           ++turn) {
        double u = (turn * kPi + quarter - segment.from) / segment.angle;
        constexpr int kCorrections = 4;
        for (int i = 0; i < kCorrections; ++i) {
          const double radius = segment.radius + std::clamp(u, 0.0, 1.0) * segment.growth;
          const double ahead = std::atan(segment.growth / (radius * segment.angle));
          u = (turn * kPi + quarter + ahead - segment.from) / segment.angle;
        }
        include(u);
      }
    }
  }
  return {low, high};
}

Arc arcAround(const std::array<double, 2>& from, const std::array<double, 2>& centre,
              const std::array<double, 2>& to, bool clockwise) {
  const double begin = std::atan2(from[1] - centre[1], from[0] - centre[0]);
  const double end = std::atan2(to[1] - centre[1], to[0] - centre[0]);
  Arc arc{centre, end - begin};
  if (clockwise && arc.angle >= 0.0) arc.angle -= 2.0 * kPi;
  if (!clockwise && arc.angle <= 0.0) arc.angle += 2.0 * kPi;
  return arc;
}

Arc arcThrough(const std::array<double, 2>& from, const std::array<double, 2>& through,
               const std::array<double, 2>& to) {
  const double ax = through[0] - from[0];
  const double ay = through[1] - from[1];
  const double bx = to[0] - from[0];
  const double by = to[1] - from[1];
  const double cross = ax * by - ay * bx;
  const double aa = ax * ax + ay * ay;
  const double bb = bx * bx + by * by;
  const double gap = std::hypot(bx - ax, by - ay);
  if (!(std::abs(cross) > kInLine * std::sqrt(aa) * std::sqrt(bb)) || gap == 0.0) return {};
  std::array<double, 2> centre{from[0] + (by * aa - ay * bb) / (2.0 * cross),
                               from[1] + (ax * bb - bx * aa) / (2.0 * cross)};
  // Rounding errors have moved the centre along the chord.
  const double along =
      ((centre[0] - (from[0] + to[0]) / 2.0) * bx + (centre[1] - (from[1] + to[1]) / 2.0) * by) /
      bb;
  centre[0] -= along * bx;
  centre[1] -= along * by;
  return arcAround(from, centre, to, cross < 0.0);
}

}  // namespace stepdriver::motion
