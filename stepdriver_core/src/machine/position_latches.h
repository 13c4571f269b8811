#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "activity/context.h"
#include "activity/input_edges.h"
#include "stepdriver_core/machine/io.h"

namespace stepdriver::machine {

/// The latches of a machine. They only look on: motions, stops and faults neither end them nor
/// depend on them, and an axis at rest has a position too. The latch of a probing belongs to its
/// motion.
class PositionLatches {
 public:
  /// What a latch looks at.
  struct Subject {
    std::uint64_t id = 0;
    std::string input;  ///< its name
    LatchEdge edge = LatchEdge::kActive;
    bool every = false;
    std::vector<axis::AxisModel*> axes;
    axis::AxisModel* window_axis = nullptr;  ///< nullptr: everywhere
    double from = 0.0;
    double to = 0.0;
    std::shared_ptr<LatchRecord> record;
    /// The motion of a probing: its axes come to rest at the edge, or if the input can't be read.
    /// The latch ends with it, and if it is refused: then nobody keeps its outcome. Empty: the
    /// latch only looks on.
    std::optional<std::weak_ptr<const axis::Outcome<axis::MoveResult>>> motion;
  };

  /// Axes that must come to rest now, and why, in words.
  struct Ending {
    std::vector<axis::AxisModel*> axes;
    std::string why;
  };

  /// @throw Refused if there are too many.
  void begin(const activity::Context& context, Subject subject, activity::InputEdges edges);
  /// Does nothing if it has ended. @param why in words
  void end(std::uint64_t id, const std::string& why);
  void endAll(const std::string& why);
  /// Something may have happened.
  std::vector<Ending> poll(const activity::Context& context);
  /// Clock time by which poll() must be called.
  pulse::Nanoseconds due() const;
  /// Clock time until which all reported edges must be known; pulse::kNever: none is waited for.
  pulse::Nanoseconds edgesDue() const;
  /// Whether one of them uses the levels of inputs.
  bool areWatched() const { return !open_.empty(); }

 private:
  struct Open {
    Subject subject;
    activity::InputEdges edges;
    LatchResult result;
    bool over = false;
    std::optional<pulse::Nanoseconds> motion_ended;  ///< clock time by which its motion had ended
  };
  /// @return why the axes must come to rest now; empty: they needn't.
  static std::string look(const activity::Context& context, Open& open);
  static void latch(const activity::Context& context, const activity::InputEdges::Edge& edge,
                    Open& open);
  static void conclude(Open& open, const std::string& message);

  // Each is polled in each turn, and keeps its edges until its caller takes them.
  static constexpr std::size_t kMostOpen = 64;

  std::vector<Open> open_;
};

}  // namespace stepdriver::machine
