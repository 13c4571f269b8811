#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace stepdriver::motion {

/// What a trajectory wants of its axes at one time; one number for each axis, in their units.
struct TrajectoryPoint {
  double time = 0.0;  ///< [s] after the start
  std::vector<double> positions;
  std::vector<double> velocities;     ///< may be empty
  std::vector<double> accelerations;  ///< may be empty
};

/// Relative. A curve between points that keep to a limit may go beyond it by so much.
constexpr double kTrajectoryTolerance = 0.01;

}  // namespace stepdriver::motion

namespace stepdriver::motion {

/// A straight line of several axes. A unit is m on a linear axis, rad on a rotary one.
struct LineRequest {
  std::vector<std::string> names;  ///< the axes' names, each once
  std::vector<double> positions;   ///< [unit] one for each name
  bool relative = false;           ///< positions are relative, see Machine::moveLine()
  /// Highest speed along the path; 0: as fast as the limits of all axes allow, and it must not be
  /// above that. If a linear axis moves, it is the root of the sum of the squared speeds of the
  /// linear axes [m/s], and rotary axes follow. If only rotary axes move, it is the same of their
  /// speeds [rad/s].
  double velocity = 0.0;
  /// [s] Time that the line takes; 0: as fast as the limits of all axes allow. Not together with a
  /// velocity.
  double duration = 0.0;
};

/// A trajectory of several axes, as Machine::followTrajectory() takes it.
struct TrajectoryRequest {
  std::vector<std::string> names;  ///< the axes' names, each once; need not be all
  std::vector<TrajectoryPoint> points;
  /// If a limit of velocity, acceleration or jerk doesn't allow the times of the points, all times
  /// are multiplied by the smallest factor that the limits allow; velocities are divided by it,
  /// accelerations by its square. CoordinatedMove::duration is that of the slower trajectory.
  /// (Default) such a trajectory is refused.
  bool allow_slower = false;
  /// [s] When it begins, from now on; 0: at once. Until then its axes continue whatever they do; at
  /// that nanosecond of motion time it takes over from their motions. See
  /// Machine::followTrajectory().
  double begin_in = 0.0;
};

/// Switches an output with a name.
struct OutputSwitch {
  std::string output;
  bool on = false;
  double value = 1.0;  ///< of a PWM output that is on: see Machine::setOutput()
  /// [unit] Along its segment, from its begin, as PathRequest::velocity counts the way.
  double distance = 0.0;
};

/// How much earlier than at their places a path switches an output: what a valve or a pump needs.
/// Nothing is switched before the path begins.
struct OutputLead {
  std::string output;
  double on = 0.0;   ///< [s] 0 to kMostLead
  double off = 0.0;  ///< [s]
};
constexpr double kMostLead = 10.0;  ///< [s]

/// A segment of a path, from the end of the one before it; the first begins where the axes stand.
/// Positions have one number for each name of the path [unit].
struct PathSegment {
  /// The curve of a segment.
  enum class Shape {
    kLine,  ///< straight
    /// A circular arc around a centre, or a full turn if both ends are the same in its plane, to
    /// within 0.002 microsteps; axes outside of the plane move in proportion to its angle. The
    /// distances from the centre to its begin and to its end may differ by kArcMismatch, or by
    /// kArcMismatchShare of the radius up to kLargestArcMismatch if that is more: the radius then
    /// changes evenly along the arc, which ends at its end.
    kArcAround,
    kArcThrough,  ///< the same through a point between its begin and its end
    kBezier,      ///< cubic
  };
  Shape shape = Shape::kLine;
  std::vector<double> end;  ///< the position at its end

  /// @name Arcs only
  /// @{
  std::array<std::string, 2> plane;  ///< the names of two axes of the same kind
  std::array<double, 2> point{};     ///< the centre, or the point on the way, of these two [unit]
  /// Around a centre: from the second axis of the plane to the first, instead of the other way.
  bool clockwise = false;
  /// @}

  std::vector<double> control1;  ///< the control point next to the begin of a Bezier
  std::vector<double> control2;  ///< the one next to its end

  double velocity = 0.0;  ///< as PathRequest::velocity; 0: that one
  /// [unit] PathRequest::tolerance for the corner at its end; empty: that one.
  std::optional<double> tolerance;

  /// Outputs that are switched where it begins or on its way, each at most once at a place, and
  /// without a stop. The begin is the middle of a corner that is rounded. A segment that leads
  /// nowhere switches them where it is, for example at the end of a path.
  ///
  /// With an input shaper, it is the shaped motion that counts. If the axes aren't on the path,
  /// because the shaper makes a curve flatter or they have different ones, an output is switched
  /// when they are as far as its place in the direction that the path has there.
  std::vector<OutputSwitch> outputs{};
};

/// @name See PathSegment::Shape::kArcAround
/// @{
constexpr double kArcMismatch = 5e-6;         ///< [unit]
constexpr double kArcMismatchShare = 1e-3;    ///< in parts of the radius
constexpr double kLargestArcMismatch = 5e-4;  ///< [unit]
/// @}

/// Segments that several axes follow without stopping, as Machine::followPath() takes them. A unit
/// is m on a linear axis, rad on a rotary one.
///
/// @code{.cpp}
/// motion::PathSegment right;
/// right.end = {0.05, 0.0};  // [m]
/// motion::PathSegment up;
/// up.end = {0.05, 0.05};
/// motion::PathRequest corner{{"x", "y"}, {right, up}};
/// corner.tolerance = 1e-4;  // [m] it is rounded by a tenth of a millimetre
/// const machine::CoordinatedMove move = machine.followPath(corner);
/// @endcode
struct PathRequest {
  std::vector<std::string> names;  ///< the axes' names, each once; need not be all
  /// 1 to kMostPathSegments. A line or a Bezier all of whose points are within a thousandth of a
  /// microstep of its begin makes no step and is left out, as doubled points are.
  std::vector<PathSegment> segments;
  bool relative = false;  ///< all positions count from the commanded positions at the begin
  /// Highest speed along the path; 0: as fast as the limits of all axes allow. In segments in which
  /// a linear axis moves, it is the root of the sum of the squared speeds of the linear axes [m/s],
  /// in others it is the same of the rotary axes [rad/s].
  double velocity = 0.0;
  /// [unit] How far corners may be rounded: the root of the sum of the squared distances of all
  /// axes. 0: the axes stop at each corner.
  double tolerance = 0.0;
  /// More segments will be appended, see Machine::appendPath(): the axes wait at its end.
  bool more_follows = false;
  /// For outputs of its segments, also of those that are appended; the others have none.
  std::vector<OutputLead> leads{};
};

/// A path of more segments is refused, and so many may lie ahead of the axes: give it in parts.
constexpr std::size_t kMostPathSegments = 20'000;

/// Segments for a path that axes follow, as Machine::appendPath() takes them. Positions, velocity
/// and tolerance are as in the PathRequest with which it began.
struct PathAppend {
  std::uint64_t path = 0;  ///< CoordinatedMove::id()
  std::vector<PathSegment> segments;
  /// (Default) they are the last ones: the path ends with them.
  bool more_follows = false;
};

/// What lies ahead of axes on a path to which segments can be appended.
struct PathAhead {
  std::size_t segments = 0;     ///< segments that they have not passed
  std::size_t room = 0;         ///< this many more segments fit
  double time = 0.0;            ///< [s] the time that they take at the speed override of 1
  double passed = 0.0;          ///< [s] the time that the path took until now, at that override
  bool more_follows = false;    ///< false: the end of these is the end of the path
  std::vector<double> targets;  ///< [unit] the commanded positions at their end
};

}  // namespace stepdriver::motion
