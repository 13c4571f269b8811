#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "geometry/arc_length.h"
#include "geometry/path.h"
#include "path_axis.h"
#include "path_marks.h"
#include "stepdriver_core/trajectory/requests.h"

namespace stepdriver::motion {

/// What all segments of a path have in common.
struct PathFrame {
  std::vector<std::string> names;  ///< the names of the axes
  std::vector<double> zero;        ///< [unit] positions of the segments count from here
  double velocity = 0.0;           ///< see PathRequest
  double tolerance = 0.0;
  /// All outputs of the machine, by their numbers.
  std::shared_ptr<const std::vector<PathOutput>> outputs;
};

/// Reads the segments of a path, one after the other, and checks them.
class PathReader {
 public:
  /// @param frame, axes outlive this. @param from [unit] where the first segment begins.
  PathReader(const PathFrame& frame, const std::vector<PathAxis>& axes, std::vector<double> from)
      : frame_(frame), axes_(axes), before_(std::move(from)) {}

  /// Where outputs are switched along the segments that were read, without their times. A segment
  /// is counted as it was appended.
  std::vector<PathMark> takeMarks() { return std::move(marks_); }

  /// Appends a segment to those of its path, unless it makes no step because it leads nowhere: then
  /// the corner before it is rounded by no more than its own tolerance.
  ///
  /// @throw Refused naming the segment, by the number of those that were read before it.
  void read(const PathSegment& given, std::vector<CurveSegment>& segments);

 private:
  [[noreturn]] void refuse(const std::string& why) const;
  std::vector<double> positions(const std::vector<double>& given, const char* what) const;
  double place(std::size_t axis, double given, const char* what) const;
  void requirePositive(const char* what, double value) const;
  CurveSegment segmentOf(const PathSegment& given) const;
  void readArc(const PathSegment& given, CurveSegment& segment) const;
  std::size_t axisOf(const std::string& name) const;
  void requireCircle(const PathAxis& axis, const std::array<double, 2>& from,
                     const std::array<double, 2>& centre, const std::array<double, 2>& to) const;
  bool areSame(const std::array<std::size_t, 2>& plane, const std::array<double, 2>& from,
               const std::array<double, 2>& to) const;
  void readOutputs(const PathSegment& given, const CurveSegment& segment, bool leads_nowhere,
                   std::size_t number);
  /// @param way nullptr: the segment leads nowhere.
  double parameterOf(const OutputSwitch& wanted, const ArcLength* way) const;
  OutputSetting settingOf(const OutputSwitch& wanted, bool is_pwm) const;
  bool leadsNowhere(const PathSegment& given, const CurveSegment& segment) const;
  void requireRate(double velocity, double finest, const char* unit) const;
  void readSpeed(const PathSegment& given, CurveSegment& segment) const;
  bool isLinear(std::size_t axis) const { return axes_[axis].kind == config::Kind::kLinear; }
  bool moves(const CurveSegment& segment, std::size_t axis) const;

  const PathFrame& frame_;
  const std::vector<PathAxis>& axes_;
  std::vector<double> before_;  // [unit] the end of the segment before
  std::size_t index_ = 0;
  std::vector<PathMark> marks_;
};

/// "segment 3 of the path"
std::string segmentText(std::size_t index);

}  // namespace stepdriver::motion
