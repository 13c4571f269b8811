#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace stepdriver::motion {

/// A segment of a path. It begins at the end of the one before it. Numbers are in the units of the
/// axes, one for each axis.
struct CurveSegment {
  enum class Shape {
    kLine,
    /// A circular arc in the plane of two axes; the others move in proportion to its angle.
    kArc,
    kBezier,  ///< a cubic one
  };
  Shape shape = Shape::kLine;
  std::vector<double> end;

  std::array<std::size_t, 2> plane{};  ///< the axes of an arc
  /// The centre of an arc. If its begin and its end aren't equally far from the centre, the radius
  /// changes evenly.
  std::array<double, 2> centre{};
  double angle = 0.0;  ///< [rad] the angle of an arc, from plane[0] towards plane[1]

  std::vector<double> control1;  ///< the control points of a Bezier
  std::vector<double> control2;

  /// [unit/s] The highest speed along the segment: the root of the sum of the squared speeds of its
  /// measured axes.
  double speed = std::numeric_limits<double>::infinity();
  std::vector<bool> measured;  ///< the axes that this speed counts; empty: all of them
  /// [unit] How far the corner at its end may be rounded; 0: the motion stops exactly at the
  /// corner. It is ignored at the end of the path and if there is no corner.
  double tolerance = 0.0;
  /// The rounding of the corner at its end, and of all later corners, begins after this parameter.
  double kept = 0.0;
  std::size_t number = 0;  ///< a refusal names it by this number
  /// [unit] How far the rounding of the corner at its end reaches, as Path::blendAfter() returned
  /// it for the same corner, whatever else would be allowed. Empty: as far as possible.
  std::optional<double> blend;
};

/// A point of a path and its derivatives with respect to the parameter of its segment.
struct PathPoint {
  std::vector<double> position;
  std::vector<double> first;
  std::vector<double> second;
};

/// What is continuous along a path, except at stops.
enum class Continuity {
  kDirection,
  kCurvature,  ///< the direction, too: a motion along the path needs no jump of the acceleration
};

/// A curve of segments whose corners are rounded. Distances are the root of the sum of the squares
/// over all axes, each in its own unit. Immutable.
///
/// A corner is where the direction changes by more than a millionth. Let p(w) be the path as given
/// near a corner at w = 0, t1 and t2 its directions before and after it, and w a multiple of the
/// parameter of each segment with |p'(0)| = 1: on lines and arcs, the distance to the corner. The
/// path is the sum of a curve without a corner and of (t2 - t1) |w|/2. Instead of |w| the path
/// has, for |w| < d,
///
///     m(w) = d (3/8 + 3/4 (w/d)^2 - 1/8 (w/d)^4)
///
/// which continues |w| with the first and second derivative. So the rounded corner has the
/// direction and the curvature of the path at both ends, its curvature jumps in its middle only by
/// as much as the curvatures of the two segments differ, and no point of it is farther from the
/// path point of the same parameter than (m(0) - 0) |t2 - t1|/2 = 3/8 d sin(turn/2), nor is any
/// point of the path farther from it. d is the largest that makes this the tolerance or less, and
/// that is at most
/// - half of either segment (half of its parameter), so that corners never overlap,
/// - what a segment doesn't keep (CurveSegment::kept), and
/// - 1/(2 max|p''|) over that half, so that its derivative is never 0: with y = |w|/d, it is at
///   least sqrt(cos^2(turn/2) + y^2 sin^2(turn/2)) - y/2.
///
/// There is a stop at a corner instead if its tolerance is 0, if it turns by more than 170 degrees,
/// or if d is less than a hundredth of the resolution.
///
/// If the curvature has to be continuous, a place where it jumps is rounded too, even if the
/// direction doesn't change there. Let c be the jump of p''. It makes a jump of the curvature
/// unless it is along t1 + t2. The path is then a curve without a corner and a jump plus (t2 - t1)
/// |w|/2 + c w|w|/4, and instead of w|w| the path has, for |w| < d,
///
///     n(w) = 2 d^2 (3/16 (w/d) + 3/8 (w/d)^3 - 1/16 (w/d)^5)
///
/// which continues w|w| with the first and second derivative. It adds 0.0108 |c| d^2 or less to the
/// distance from the path. d is at most 1/(4 max|p''|) there: n changes the derivative by
/// 3/8 d |c|/4 or less, which is 3/64, and |c| is at most 2 max|p''|. Then |p'| is above 0.04 for
/// turns of up to 170 degrees.
///
/// Roundings of corners between lines may overlap, as curves of many short lines need: a
/// corner that turns by 30 degrees or less has a d beyond its segments if
/// - the sum of all roundings is within the tolerance at each corner; between two corners it is
///   convex, so it is largest at one of them,
/// - it ends before any other kind of segment, corner or stop, and in the middle of the last
///   segment if the path will be continued,
/// - the sum of sin(turn/2) of all corners within 2 d is 1/2 or less: so is that of all roundings
/// at
///   any place, each of which changes the derivative by less than its sin(turn/2), so |p'| is 1/2
///   or more.
class Path {
 public:
  /// If a control point of a Bezier is nearer to its end than a fifth of the resolution, it is
  /// moved away by that distance. The curve deviates by less than a tenth of the resolution.
  ///
  /// @param start one number for each axis
  /// @param segments at least one; the length of each is above 0
  /// @param resolution [unit] what makes no difference: a microstep of the finest axis
  /// @param continues more segments will be appended
  /// @throw motion::Malformed if a Bezier's derivative is (almost) 0 at a point within it, which no
  ///   axis can pass without a stop. It names the segment (the first is 0).
  Path(std::vector<double> start, const std::vector<CurveSegment>& segments, double resolution,
       Continuity continuity = Continuity::kDirection, bool continues = false);

  std::size_t axes() const { return start_.size(); }
  std::size_t size() const { return segments_.size(); }
  const std::vector<double>& start() const { return start_; }
  double resolution() const { return resolution_; }

  /// The point at a parameter from 0 to 1. Two segments have exactly the same place at their
  /// corner: an axis that rests on one of them isn't moved by rounding, however low its limits are.
  void evaluate(std::size_t segment, double parameter, PathPoint& point) const;
  /// The point of the path as given, with all its corners.
  void evaluateGiven(std::size_t segment, double parameter, PathPoint& point) const;

  /// The segments from `first` to `last`, rounded as they are here.
  Path part(std::size_t first, std::size_t last) const;
  /// The same path with stops at some corners, which are not rounded.
  ///
  /// @param corners the segments that end at these corners; each corner is separate.
  Path withStops(const std::vector<std::size_t>& corners) const;
  /// Whether no rounding of another corner reaches the end of this segment, and the rounding there
  /// doesn't reach beyond this segment and the next one.
  bool isSeparate(std::size_t corner) const;

  /// The lowest and the highest position of an axis on a segment as given.
  std::pair<double, double> range(std::size_t segment, std::size_t axis) const;

  /// A segment is rounded from 0 to roundedUntil(), and from roundedFrom() to 1. They are 0 and 1
  /// if it isn't rounded there.
  double roundedUntil(std::size_t segment) const;
  double roundedFrom(std::size_t segment) const;
  /// [unit] How far from the end of a segment the rounding of that corner reaches (d); 0: it isn't
  /// rounded.
  double blendAfter(std::size_t segment) const { return segments_[segment].end.blend; }
  bool isLine(std::size_t segment) const;
  /// If the path is continued, the roundings of corners will change from here on, because they must
  /// not reach beyond the middle of its last segment.
  struct Place {
    std::size_t segment = 0;
    double parameter = 0.0;
  };
  Place openFrom() const { return open_; }
  /// Whether more segments will be appended to the path of which it is all or a part.
  bool continues() const { return continues_; }
  /// Whether the motion has to stop at the end of a segment.
  bool stopsAfter(std::size_t segment) const { return segments_[segment].stops; }
  /// [unit/s] See CurveSegment::speed.
  double speed(std::size_t segment) const { return segments_[segment].speed; }
  const std::vector<bool>& measured(std::size_t segment) const {
    return segments_[segment].measured;
  }

 private:
  // One end of a segment, and how its corner is rounded.
  struct End {
    double rate = 0.0;          // |p'| there
    double blend = 0.0;         // d; 0: the corner isn't rounded
    std::vector<double> shift;  // (t2 - t1)/2
    std::vector<double> jump;   // c; empty if there is no jump
  };
  struct Segment {
    CurveSegment::Shape shape;
    // Coefficients of the powers of the parameter, one after the other: 2 for each axis, or 4 for a
    // Bezier. For an arc, those of its two axes are only its begin and the way to its end.
    std::vector<double> powers;
    std::vector<double> to;  // the end, which the powers may miss by their rounding
    std::array<std::size_t, 2> plane{};
    std::array<double, 2> centre{};
    double radius = 0.0;  // at its begin
    double growth = 0.0;  // by which the radius rises up to its end
    double from = 0.0;    // [rad] the angle of its begin
    double angle = 0.0;
    // For the two axes: the way from the centre to the begin, and by what the angles and radii,
    // which are rounded, miss the end.
    std::array<double, 2> spoke{};
    std::array<double, 2> gap{};
    End begin;
    End end;
    // The corners of other segments whose roundings reach this line.
    struct Overlap {
      double place = 0.0;  // the distance from the begin of this line to the corner
      End end;
    };
    std::vector<Overlap> overlaps;
    bool stops = true;
    double speed;
    std::vector<bool> measured;
  };

  Segment placed(const std::vector<double>& from, const CurveSegment& given) const;
  void round(std::size_t corner, const CurveSegment& given, Continuity continuity);
  bool isGentle(std::size_t corner) const;
  void widen(const std::vector<CurveSegment>& given, bool continues);
  void overlap(std::size_t corner, double distance);
  void findOpen(std::size_t first, std::size_t last);
  std::pair<double, double> rounded(std::size_t segment) const;
  double sharpest(const Segment& segment, double rate) const;
  static void evaluateArc(const Segment& segment, double u, PathPoint& point);
  void blend(const End& end, double distance, double sign, PathPoint& point) const;

  std::vector<double> start_;
  double resolution_;
  bool continues_;
  std::vector<Segment> segments_;
  Place open_;
};

/// The centre and the angle of a CurveSegment.
struct Arc {
  std::array<double, 2> centre{};
  double angle = 0.0;  ///< [rad]
};

/// An arc around a centre from one point to another. It is a full turn if they are in the same
/// direction from the centre.
Arc arcAround(const std::array<double, 2>& from, const std::array<double, 2>& centre,
              const std::array<double, 2>& to, bool clockwise);

/// An arc from one point through a second one to a third.
///
/// @return an angle of 0 if they are in line or if two of them are the same.
Arc arcThrough(const std::array<double, 2>& from, const std::array<double, 2>& through,
               const std::array<double, 2>& to);

}  // namespace stepdriver::motion
