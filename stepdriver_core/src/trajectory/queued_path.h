#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "geometry/path.h"
#include "path_axis.h"
#include "path_reader.h"
#include "path_timing/acceleration_limited.h"
#include "shared_path.h"
#include "stepdriver_core/trajectory/requests.h"
#include "trajectory_path.h"

namespace stepdriver::motion {

/// The segments that axes follow, except those that they have passed, and what is known about the
/// motion along them. Positions are in the units of the axes, times in seconds or nanoseconds from
/// the begin of the path.
struct PathWindow {
  /// A place at which the motion is known.
  struct Knot {
    std::int64_t time_ns = 0;
    std::size_t segment = 0;
    double parameter = 0.0;
    double speed = 0.0;  ///< [unit/s] along the path
    /// See motion::TimingKnot.
    double acceleration = 0.0;
    double average = 0.0;
    bool may_begin = false;
    bool straight = false;
  };

  PathFrame frame;
  std::vector<PathAxis> axes;
  std::vector<double> start;  ///< where the first segment begins
  /// With a jerk limit, the list begins with earlier segments whose corners are rounded as far as
  /// the first one ahead, and the `blend` of each segment is that of the plan.
  std::vector<CurveSegment> segments;
  std::vector<Knot> knots;      ///< the last one is the end of the path
  std::int64_t settled_ns = 0;  ///< see motion::PathTiming
  /// Where outputs are switched, by place; of those that are passed, only the last ones.
  std::vector<PathMark> marks;
  std::vector<std::uint64_t> marks_passed;  ///< by output: marks that were left out

  /// The end of the last segment; the start if no segment has made a step yet.
  const std::vector<double>& end() const { return segments.empty() ? start : segments.back().end; }
};

/// A path to which segments can be appended while axes follow it. It is immutable: the longer path
/// is another object. The motion up to some time ahead stays as it is. From there on, the rest of
/// the old segments and the new ones are planned again, from the speed that the axes have there to
/// rest at the new end. The corner at the former end is rounded if the axes can still slow down
/// before it.
///
/// The plan uses a thousandth less than the limits of the axes, because planning from a speed may
/// exceed them by that much.
class QueuedPath : public SharedPath {
 public:
  static constexpr double kShareOfLimits = 0.999;

  /// @param motion the motion along the window, from time 0 on.
  /// @param more_follows the path isn't complete: the axes wait at its end.
  QueuedPath(const std::shared_ptr<const SharedPath>& motion,
             std::shared_ptr<const PathWindow> window, bool more_follows);

  /// A path that continues this one, and the positions between which both are the same.
  struct Longer {
    std::shared_ptr<const QueuedPath> path;
    double same_from = 0.0;   ///< [s]
    double same_until = 0.0;  ///< [s]
    bool moves_on = false;    ///< whether the new path leads beyond the end of this one
  };
  /// Appends segments. It takes time in proportion to the segments that are planned again: those
  /// between the point from which the axes slow down to rest at the present end, and the new end.
  /// With a jerk limit, the motion changes at a knot before that point at which the speed is
  /// highest or lowest, or rises.
  ///
  /// @param segments may be empty, which means that this is the end.
  /// @param passed [s] a position that the axes have passed: what is before it is dropped.
  /// @param changeable [s] the first position from which the motion may change.
  /// @throw Refused if the path is complete, if too many segments would lie ahead, or if one of
  ///   them isn't possible. It is named by its number among the new ones.
  Longer extended(const std::vector<PathSegment>& segments, bool more_follows, double passed,
                  double changeable) const;

  /// The segments ahead of a position [s].
  PathAhead aheadOf(double position) const;
  std::vector<double> targets() const;  ///< [microsteps] the end of each joint's motion

  MotionState begin() const override { return motion_->begin(); }
  MotionState restart(DoubleDouble position) const override { return motion_->restart(position); }
  Profile plan(std::int64_t at, const MotionState& from, double speed_override) const override {
    return motion_->plan(at, from, speed_override);
  }
  Profile planStop(std::int64_t at, const MotionState& from) const override {
    return motion_->planStop(at, from);
  }
  Profile profileOf(std::size_t member, const Profile& path) const override {
    return motion_->profileOf(member, path);
  }
  bool waitsAtEnd() const override { return more_follows_; }
  std::shared_ptr<const PathMarks> marks() const override { return motion_->marks(); }

 private:
  struct Start;
  struct Continuation;
  // The state of all axes [unit, unit/s].
  struct JointPlace {
    std::vector<double> position;
    std::vector<double> velocity;
  };

  // Segments that are appended, and the marks on them.
  struct Added {
    std::vector<CurveSegment> segments;
    std::vector<PathMark> marks;

    bool empty() const { return segments.empty() && marks.empty(); }
  };

  Added read(const std::vector<PathSegment>& given) const;
  std::size_t segmentAt(std::int64_t time_ns) const;
  std::size_t firstRoundedInto(std::size_t segment) const;
  std::vector<CurveSegment> aroundStart(const Start& start, std::size_t first) const;
  std::vector<Start> startsFrom(std::int64_t from_ns) const;
  static Start atKnot(const PathWindow::Knot& knot);
  Start onStraight(std::size_t knot, std::int64_t time_ns) const;
  Start atRest() const;
  std::optional<Continuation> continueFrom(Start start, const Added& added, bool more_follows,
                                           int most_halvings) const;
  Longer continued(const Start& start, Continuation continuation, const Added& added,
                   bool more_follows, std::int64_t passed_ns) const;
  void keepMarks(PathWindow& window, const Start& start, std::size_t dropped,
                 std::vector<PathMark> later, std::int64_t passed_ns) const;
  Longer withMarksAtEnd(std::vector<PathMark> added, bool more_follows, double passed) const;
  static bool isBeyond(const PathMark& mark, const Start& start);
  std::vector<PathMark> marksAfter(const Start& start, const Added& added) const;
  JointPlace jointAt(const Start& start, const PathPoint& place) const;
  void adjust(Start& start, const PathPoint& planned, const std::vector<PathStart>& states) const;
  std::optional<std::vector<PathStart>> statesAt(const Start& start, const JointPlace& joint) const;
  std::shared_ptr<const TrajectoryPath> joined(const Start& start, const Continuation& continuation,
                                               const std::vector<TrajectoryPoint>& points,
                                               std::int64_t passed_ns,
                                               std::shared_ptr<const PathMarks> marks) const;

  std::shared_ptr<const TrajectoryPath> motion_;
  std::shared_ptr<const PathWindow> window_;
  bool more_follows_;
};

}  // namespace stepdriver::motion
