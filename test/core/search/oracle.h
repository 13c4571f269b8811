#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "machine/requests/request.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::search {

constexpr std::size_t kAxes = 3;

/// What a call means for the pulses of the axes.
struct Meaning {
  enum class Quiet { kNone, kAtRest, kSlowsDown, kHeld, kEmergency };
  Quiet quiet = Quiet::kNone;  ///< promised by its answer
  bool moves = false;          ///< it may begin a motion
  bool resumes = false;        ///< it may resume a held motion
  bool recovers = false;
  bool ends_hold = false;   ///< whatever its answer, motions may begin in spite of an earlier hold
  std::uint64_t as_of = 0;  ///< nothing must have stopped it since this Oracle::moment(); 0: any
  std::array<bool, kAxes> axes{};  ///< the axes of the call
  /// [m] Between which positions the request itself leads an axis, if its answer doesn't say that.
  struct Reach {
    double low = 0.0;
    double high = 0.0;
    bool from_path = false;  ///< they count from where a path has begun
  };
  std::array<std::optional<Reach>, kAxes> reaches{};
  /// How many times as long as alone its axes may take to stop on its curve.
  int longer_stop = 1;
};

/// How long an axis may take to come to rest.
struct Slowing {
  pulse::Nanoseconds deceleration = 0;  ///< the longest one, with a margin
  pulse::Nanoseconds shaper = 0;        ///< by how much longer its shaper makes it
};

/// Judges pulses by the answers that clients got. After the answer of a stop, only pulses of later
/// motions are allowed.
class Oracle {
 public:
  /// @param slowing of each axis alone.
  /// @param slipped motion time is clock time minus this.
  Oracle(const std::array<Slowing, kAxes>& slowing, std::function<pulse::Nanoseconds()> slipped)
      : slowing_(slowing), slipped_(std::move(slipped)) {}

  std::vector<std::string> complaints;

  /// These axes share motors: a pulse is allowed if the motion of any of them allows it.
  void share(std::vector<std::size_t> axes) { sharing_ = std::move(axes); }

  /// How long steps may still go out when an emergency stop takes them back, until its answer.
  void takesBack(pulse::Nanoseconds longest) { takes_back_ = longest; }

  /// A call was handed to the controller.
  void served(std::uint64_t call, const std::string& name, const Meaning& meaning) {
    calls_[call] = {meaning.as_of != 0 ? meaning.as_of : moment(), name, meaning};
    if (meaning.moves || meaning.resumes || meaning.recovers) open_.push_back(call);
    if (meaning.moves) moveTogether(meaning);
    if (meaning.ends_hold) endHolds();
  }

  /// @param at_fault each axis, at the answer.
  void answered(std::uint64_t call, bool success, pulse::Nanoseconds now,
                const std::array<bool, kAxes>& at_fault) {
    const auto found = calls_.find(call);
    if (found == calls_.end()) return;
    const Call& ended = found->second;
    open_.erase(std::remove(open_.begin(), open_.end(), call), open_.end());
    if (!success) {
      if (ended.meaning.recovers) recoveredInPart(ended.order, at_fault);
      if (ended.meaning.moves) isSlowingDown(ended, now);
      return;
    }
    const Meaning& meaning = ended.meaning;
    if (meaning.resumes) resumed_ = std::max(resumed_, ended.order);
    // A resume that came after this hold was answered before it.
    if (meaning.quiet == Meaning::Quiet::kHeld && ended.order < resumed_) return;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      if (!meaning.axes[axis]) continue;
      // A recover may have ended the fault of this axis while it still waits for another axis.
      for (Quiet& quiet : quiets_[axis]) {
        const bool recovered = (meaning.recovers && quiet.order < ended.order) ||
                               (meaning.moves && isRecoveredFrom(quiet.order, ended.order));
        if (recovered && quiet.kind == Meaning::Quiet::kEmergency) {
          quiet.kind = Meaning::Quiet::kAtRest;
        }
      }
      if (ends(meaning)) endQuiet(axis, ended.order, meaning);
      if (meaning.quiet == Meaning::Quiet::kNone) continue;
      Quiet quiet;
      quiet.order = ended.order;
      quiet.kind = meaning.quiet;
      if (quiet.kind == Meaning::Quiet::kHeld && ended.order < hold_ended_) {
        quiet.kind = Meaning::Quiet::kSlowsDown;
      }
      quiet.name = ended.name;
      quiet.slows =
          meaning.quiet == Meaning::Quiet::kSlowsDown || meaning.quiet == Meaning::Quiet::kHeld;
      quiet.since = now + (quiet.slows ? slowingOf(axis) - slipped_() : 0);
      // A motion that was handed over after the stop, and accepted before its answer.
      if (last_motion_[axis] > ended.order) continue;
      quiets_[axis].push_back(quiet);
    }
  }

  /// A call will be answered as a success, but not for this axis.
  void refused(std::uint64_t call, std::size_t axis, pulse::Nanoseconds now) {
    const auto found = calls_.find(call);
    if (found == calls_.end()) return;
    isSlowingDown(found->second, axis, now);
    found->second.meaning.axes[axis] = false;
  }

  /// After the answer of this call, no later motion may move the axis.
  bool isLatest(std::uint64_t call, std::size_t axis) const {
    const std::uint64_t order = calls_.at(call).order;
    return last_motion_[axis] <= order &&
           std::none_of(open_.begin(), open_.end(), [&](std::uint64_t id) {
             const Call& open = calls_.at(id);
             return open.order > order && open.meaning.axes[axis] && ends(open.meaning);
           });
  }

  /// An emergency stop was requested: from now on no pulse may begin, or none beyond its ramp.
  /// @param ramp_begins how long it may take until the axes decelerate; empty: there is no ramp
  void emergencyStopped(pulse::Nanoseconds now, std::optional<pulse::Nanoseconds> ramp_begins) {
    const bool ramps = ramp_begins.has_value();
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const pulse::Nanoseconds since =
          ramps ? now + *ramp_begins + slowingOf(axis) - slipped_() : now + takes_back_;
      quiets_[axis].push_back(
          {moment(), Meaning::Quiet::kEmergency, "emergency stop", since, ramps});
    }
  }

  /// Every emergency stop so far was answered: their ramps are over too.
  void emergencyStopAnswered(pulse::Nanoseconds now) {
    for (auto& quiets : quiets_) {
      for (Quiet& quiet : quiets) {
        if (quiet.kind != Meaning::Quiet::kEmergency) continue;
        quiet.since = std::min(quiet.since + (quiet.slows ? slipped_() : 0), now);
        quiet.slows = false;
      }
    }
  }

  /// Later than everything that was served until now.
  std::uint64_t moment() { return ++order_; }

  void rose(std::size_t axis, pulse::Nanoseconds time) {
    const bool shares = std::find(sharing_.begin(), sharing_.end(), axis) != sharing_.end();
    const bool is_of_another =
        shares && std::any_of(sharing_.begin(), sharing_.end(),
                              [&](std::size_t sharer) { return brokenBy(sharer, time).empty(); });
    if (is_of_another) return;
    for (const std::string& broken : brokenBy(axis, time)) complain(broken);
  }

  void complain(const std::string& what) {
    if (complaints.size() < 8) complaints.push_back(what);
  }

 private:
  struct Call {
    std::uint64_t order = 0;
    std::string name;
    Meaning meaning;
  };
  struct Quiet {
    std::uint64_t order = 0;
    Meaning::Quiet kind = Meaning::Quiet::kNone;
    std::string name;
    pulse::Nanoseconds since = 0;  // motion time if it decelerates, otherwise clock time
    bool slows = false;
  };

  static bool ends(const Meaning& meaning) { return meaning.moves || meaning.resumes; }
  static bool ends(const Meaning& meaning, const Quiet& quiet) {
    if (quiet.kind == Meaning::Quiet::kEmergency) return false;
    return quiet.kind == Meaning::Quiet::kHeld ? meaning.resumes : meaning.moves;
  }

  // From now on motions may begin again.
  void endHolds() {
    hold_ended_ = order_;
    for (auto& quiets : quiets_) {
      for (Quiet& quiet : quiets) {
        if (quiet.kind == Meaning::Quiet::kHeld) quiet.kind = Meaning::Quiet::kSlowsDown;
      }
    }
  }

  pulse::Nanoseconds slowingOf(std::size_t axis) const {
    const Slowing& slowing = slowing_[axis];
    return std::max(1, longer_stops_[axis]) * (slowing.deceleration + slowing.shaper);
  }

  // Axes that share a path decelerate as slowly as the slowest of them, and each shaper adds its
  // time to that.
  void moveTogether(const Meaning& meaning) {
    Slowing longest;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      if (!meaning.axes[axis]) continue;
      longest.deceleration = std::max(longest.deceleration, slowing_[axis].deceleration);
      longest.shaper = std::max(longest.shaper, slowing_[axis].shaper);
    }
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      if (!meaning.axes[axis]) continue;
      slowing_[axis] = longest;
      longer_stops_[axis] = std::max(longer_stops_[axis], meaning.longer_stop);
    }
  }

  /// A recover that came after the first stop and before the second is under way.
  bool isRecoveredFrom(std::uint64_t stop, std::uint64_t motion) const {
    return std::any_of(open_.begin(), open_.end(), [&](std::uint64_t call) {
      const Call& open = calls_.at(call);
      return open.meaning.recovers && open.order > stop && open.order < motion;
    });
  }

  /// A recover that fails for one axis ends the faults of the others.
  void recoveredInPart(std::uint64_t order, const std::array<bool, kAxes>& at_fault) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      for (Quiet& quiet : quiets_[axis]) {
        const bool recovered = !at_fault[axis] && quiet.order < order;
        if (recovered && quiet.kind == Meaning::Quiet::kEmergency) {
          quiet.kind = Meaning::Quiet::kAtRest;
        }
      }
    }
  }

  /// A motion of several axes that fails may already have begun to take up their backlash.
  void isSlowingDown(const Call& failed, pulse::Nanoseconds now) {
    for (std::size_t axis = 0; axis < kAxes; ++axis) isSlowingDown(failed, axis, now);
  }
  void isSlowingDown(const Call& failed, std::size_t axis, pulse::Nanoseconds now) {
    if (!failed.meaning.axes[axis]) return;
    for (Quiet& quiet : quiets_[axis]) {
      if (quiet.order > failed.order || quiet.kind == Meaning::Quiet::kEmergency) continue;
      quiet.since = std::max(quiet.since, now + slowingOf(axis) - slipped_());
      quiet.slows = true;
    }
  }

  void endQuiet(std::size_t axis, std::uint64_t order, const Meaning& meaning) {
    if (meaning.moves) last_motion_[axis] = std::max(last_motion_[axis], order);
    auto& quiets = quiets_[axis];
    quiets.erase(std::remove_if(quiets.begin(), quiets.end(),
                                [&](const Quiet& quiet) {
                                  return quiet.order < order && ends(meaning, quiet);
                                }),
                 quiets.end());
  }

  /// The promises of an axis that a pulse breaks, in words.
  std::vector<std::string> brokenBy(std::size_t axis, pulse::Nanoseconds time) const {
    std::vector<std::string> broken;
    for (const Quiet& quiet : quiets_[axis]) {
      // A late pulse slides the rest of a motion, and its deceleration too.
      if (time - (quiet.slows ? slipped_() : 0) < quiet.since || mayHaveBegun(axis, quiet))
        continue;
      broken.push_back("axis " + std::to_string(axis) + " steps at " + std::to_string(time) +
                       " ns, but must not from " + std::to_string(quiet.since) +
                       " ns on: " + quiet.name);
    }
    return broken;
  }

  // A later motion may already be under way before its answer.
  bool mayHaveBegun(std::size_t axis, const Quiet& quiet) const {
    return std::any_of(open_.begin(), open_.end(), [&](std::uint64_t id) {
      const Call& call = calls_.at(id);
      if (call.order < quiet.order || !call.meaning.axes[axis]) return false;
      if (quiet.kind != Meaning::Quiet::kEmergency) return ends(call.meaning, quiet);
      return call.meaning.moves && isRecoveredFrom(quiet.order, call.order);
    });
  }

  std::array<Slowing, kAxes> slowing_;
  std::array<int, kAxes> longer_stops_{};
  pulse::Nanoseconds takes_back_ = 0;
  std::vector<std::size_t> sharing_;
  const std::function<pulse::Nanoseconds()> slipped_;
  std::uint64_t order_ = 0;
  std::uint64_t hold_ended_ = 0;
  std::uint64_t resumed_ = 0;  // by the last resume that was answered
  std::map<std::uint64_t, Call> calls_;
  std::vector<std::uint64_t> open_;
  std::array<std::vector<Quiet>, kAxes> quiets_;
  std::array<std::uint64_t, kAxes> last_motion_{};
};

}  // namespace stepdriver::search
