#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "call.h"
#include "channel/output_line.h"
#include "profile/marks.h"
#include "profile/profile.h"
#include "profile/shaped_axes.h"
#include "pulse/command.h"
#include "stepdriver_core/config/io_config.h"

namespace stepdriver::axis {
class AxisModel;
}

namespace stepdriver::activity {

class Context;

/// What has become of the marks of a path so far.
struct MarksOfPath {
  struct Part {
    std::size_t output = 0;
    std::string name;
    std::uint64_t all = 0;
    std::uint64_t made = 0;
  };
  std::uint64_t group = 0;  ///< pulse::Follow::group of the path
  std::vector<Part> parts;  ///< by output

  std::uint64_t made() const;
  std::uint64_t notMade() const;
  /// "; pen wasn't switched at 2 of its 5 places"; empty if all were made.
  std::string text() const;
};

/// The outputs with a name, as far as motions switch them: which path or which axis has which, what
/// was ordered of the pulse thread, and what that has made of it.
class MotionOutputs {
 public:
  MotionOutputs() = default;
  explicit MotionOutputs(const std::vector<config::OutputConfig>& outputs);

  /// The engine's news.
  void update(const std::vector<pulse::OutputLineState>& states);

  /// @name For the owner of an output's line
  /// @{
  struct Line {
    std::string why_not;  ///< why no motion can have it now; empty: one can
    pulse::WrittenOutput written;
  };
  void note(std::size_t output, Line line) { outputs_[output].line = std::move(line); }
  const pulse::OutputLineState& state(std::size_t output) const { return outputs_[output].state; }
  /// A motion has it: nothing else switches it, except to its safe state.
  bool isTaken(std::size_t output) const { return outputs_[output].taken_by.has_value(); }
  /// Who has it, in words.
  std::string holder(std::size_t output) const;
  /// Gives up what is left of the marks of an output, or takes it from an axis.
  void end(Context& context, std::size_t output);
  /// What a motion that has ended early has left to be done; only the first call tells.
  std::optional<bool> takeWanted(std::size_t output);
  /// @}

  /// @name For the position of an axis
  /// @{

  /// The position of an axis switches an output from now on, whenever it can be trusted.
  /// @param compare empty: none does any more. @param axis by its number.
  /// @param call is answered when that is so, or when it must wait until the position can be
  /// trusted.
  void compare(std::size_t output, std::optional<config::PositionCompare> compare, std::size_t axis,
               const SharedCall& call);
  /// Whose position switches an output; empty: none does.
  const std::string& comparedAxis(std::size_t output) const;
  /// What the end of a motion leaves out.
  struct LeftOut {
    std::string output;
    std::uint64_t places = 0;  ///< at which the output would have been switched
  };
  /// @param joint, target [microsteps] where an axis stands, and where it was to go.
  std::vector<LeftOut> leftOut(const axis::AxisModel& axis, double joint, double target) const;
  /// Orders what has changed: positions that can be trusted now, or not any more.
  /// @param why_safe why all outputs must be in their safe states; empty: they needn't.
  /// @param may whether the places of an axis mean something now.
  void supervise(Context& context, const std::string& why_safe,
                 const std::function<bool(const axis::AxisModel&)>& may);
  /// @}

  /// @name For a path
  /// @{
  /// @throw Refused if a path of other axes has one of its outputs, or if one can't be switched.
  void refuseUnlessFree(const motion::PathMarks& marks, std::uint64_t group,
                        const std::vector<const axis::AxisModel*>& axes) const;
  /// The path has the outputs from now on. @throw Refused as above
  void take(const motion::PathMarks& marks, const std::shared_ptr<MarksOfPath>& path,
            const std::vector<const axis::AxisModel*>& axes);
  /// Clock time before which a path can't begin: its first marks would come before the least times
  /// of their outputs are over.
  pulse::Nanoseconds mayBegin(const motion::PathMarks& marks) const;
  /// Orders its marks for a motion along it, in the command with those of its axes.
  /// @param axes nullptr: they are where that motion is.
  void order(std::uint64_t group, const std::shared_ptr<const motion::Profile>& along,
             const std::shared_ptr<const motion::PathMarks>& marks,
             const std::shared_ptr<const motion::ShapedAxes>& axes,
             const std::shared_ptr<std::vector<pulse::FollowMarks>>& command);
  /// Whether a mark is still to come in the motion as it is ordered.
  bool isDue(std::uint64_t group) const;
  /// It slows down for good: outputs with `at_stop` have that state from now on.
  void stop(Context& context, std::uint64_t group);
  /// It has ended. @param reached it was made to its end
  void leave(Context& context, std::uint64_t group, bool reached);
  /// @}

 private:
  struct Taken {
    std::uint64_t group = 0;
    std::vector<const axis::AxisModel*> axes;
    std::optional<std::uint64_t> ends;  // serial of the command that ends it
    bool compares = false;              // the position of the axis has it, and no path
  };
  // What the position of an axis makes of it.
  struct Compared {
    config::PositionCompare compare;
    std::size_t axis = 0;
    SharedCall call;
    bool changed = false;  // since the last order
    // What the last order was made for.
    std::uint64_t serial = 0;
    double origin = 0.0;
    double steps_per_unit = 0.0;
  };
  // Data that the engine may still read.
  struct Kept {
    std::uint64_t serial = 0;
    std::shared_ptr<const motion::Profile> along;
    std::shared_ptr<const motion::PathMarks> marks;
    std::shared_ptr<const motion::ShapedAxes> axes;
    std::shared_ptr<const std::vector<pulse::FollowMarks>> command;
    std::shared_ptr<const pulse::CompareTrack> track;
    std::shared_ptr<const pulse::Compare> compare;
  };
  struct Output {
    config::OutputConfig config;
    pulse::OutputLineState state;
    Line line;
    std::uint64_t serial = 0;  // that the last command has
    std::optional<Taken> taken_by;
    std::optional<Compared> compared;
    std::optional<bool> wanted;  // when it is free again
    std::deque<Kept> kept;
  };

  static bool isCurrent(const Output& output, const axis::AxisModel& axis);
  static void orderCompare(Context& context, std::size_t number, Output& output,
                           const axis::AxisModel& axis);

  bool has(const Output& output, std::uint64_t group) const {
    return output.taken_by && output.taken_by->group == group;
  }

  std::vector<Output> outputs_;
  std::vector<std::weak_ptr<MarksOfPath>> paths_;
};

}  // namespace stepdriver::activity
