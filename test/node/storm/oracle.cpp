#include "storm/oracle.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <deque>
#include <limits>
#include <utility>

#include "storm/joints.h"
#include "storm/places.h"
#include "storm/text.h"

namespace stepdriver::storm {
namespace {

constexpr std::int64_t kForever = std::numeric_limits<std::int64_t>::max();
constexpr std::int64_t kMillisecond = 1'000'000;
/// If two requests are sent this far apart, the first one arrives first.
constexpr std::int64_t kArrival = 250 * kMillisecond;
constexpr double kStopMargin = 1.1;
/// A trajectory keeps half of the limits here, so that its path leaves the other half for a stop.
constexpr double kTrajectoryStops = 2.0;
constexpr double kPathStops = 3.0;
constexpr std::int64_t kLongestTrajectory = 20'000 * kMillisecond;
/// Until a line is written whose time has come.
constexpr std::int64_t kLateWrite = 20 * kMillisecond;
constexpr double kPositionError = 0.05;  // [1/16 steps]
/// Half a step of the coarsest mode in use, and a margin.
constexpr double kArrivalError = 1.05;  // [1/16 steps]
/// A microstep of that mode, and half a one between a target and the place nearest to it.
constexpr double kWayError = 3.05;  // [1/16 steps]

double inSeconds(std::int64_t time) { return static_cast<double>(time) * 1e-9; }

/// The time in which a motion may send pulses, on the rig's clock.
struct Span {
  std::int64_t begin;
  std::int64_t end;
};

/// The stalls of the computer, and their total duration up to any time.
class Stalls {
 public:
  explicit Stalls(const std::vector<Stall>& stalls) : stalls_(stalls) {
    before_.reserve(stalls.size());
    std::int64_t sum = 0;
    for (const Stall& stall : stalls) {
      before_.push_back(sum);
      sum += stall.end - stall.begin;
    }
  }

  std::int64_t between(std::int64_t begin, std::int64_t end) const {
    return upTo(end) - upTo(begin);
  }

 private:
  std::int64_t upTo(std::int64_t time) const {
    const auto next =
        std::upper_bound(stalls_.begin(), stalls_.end(), time,
                         [](std::int64_t t, const Stall& stall) { return t < stall.begin; });
    if (next == stalls_.begin()) return 0;
    const auto last = static_cast<std::size_t>(next - stalls_.begin()) - 1;
    return before_[last] + std::min(time, stalls_[last].end) - stalls_[last].begin;
  }

  const std::vector<Stall>& stalls_;
  std::vector<std::int64_t> before_;  // the sum of the stalls before each
};

/// The requests to an axis, as far as a lookup by time needs them.
struct AxisRequests {
  std::vector<std::int64_t> trajectories;  // times at which trajectories were sent
  std::vector<std::int64_t> paths;         // and paths
};

/// Requests are in the order in which they were sent. Each lookup uses only requests near the time
/// in question, so the time for judging is proportional to the length of the storm.
class Judge {
 public:
  explicit Judge(const Observation& observation)
      : seen_(observation),
        stalls_(observation.stalls),
        clock_(observation.clock),
        joints_(observation, clock_),
        of_axis_(observation.axes.size()) {
    for (const Request& request : seen_.requests) {
      for (std::size_t axis = 0; axis < of_axis_.size(); ++axis) {
        if (!isOf(request, axis)) continue;
        if (request.is_trajectory) of_axis_[axis].trajectories.push_back(request.sent);
        if (request.is_path) of_axis_[axis].paths.push_back(request.sent);
      }
    }
  }

  std::vector<std::string> verdict() {
    for (const Request& request : seen_.requests) {
      judgeReason(request);
      if (!request.answered || !request.success) continue;
      judgeArrivals(request);
      if (request.output) judgeOutput(request);
      if (request.kind == Kind::kEmergencyStop) {
        for (const std::vector<Switch>& switches : seen_.switches) judgeSafety(request, switches);
      }
      if (!ends(request.kind)) continue;
      for (std::size_t axis = 0; axis < seen_.axes.size(); ++axis) {
        if (isOf(request, axis)) judgeEnd(request, axis);
      }
    }
    judgePositions();
    for (std::size_t output = 0; output < seen_.outputs.size(); ++output) judgeTimes(output);
    for (std::string& broken : brokenPlaces(seen_, clock_, joints_)) {
      broken_.push_back(std::move(broken));
    }
    for (std::size_t i = 1; i < seen_.rests.size(); ++i) {
      for (std::size_t axis = 0; axis < seen_.axes.size(); ++axis) {
        judgeWay(axis, seen_.rests[i - 1], seen_.rests[i]);
      }
    }
    return std::move(broken_);
  }

 private:
  static bool ends(Kind kind) {
    return kind == Kind::kStop || kind == Kind::kHold || kind == Kind::kDisable ||
           kind == Kind::kSleep || kind == Kind::kEmergencyStop;
  }

  static bool moves(Kind kind) {
    return kind == Kind::kMotion || kind == Kind::kHoming || kind == Kind::kJog;
  }

  static bool wasRefused(const Request& request) { return request.answered && !request.success; }

  static bool isOf(const Request& request, std::size_t axis) {
    return (request.axes >> axis & 1U) != 0;
  }

  /// Whether the node may have handled this request after the other one.
  bool mayFollow(const Request& request, const Request& other) const {
    if (&request == &other) return false;
    if (request.answered && *request.answered < other.sent) return false;
    return mayArriveAfter(request, other);
  }

  bool mayArriveAfter(const Request& request, const Request& other) const {
    if (request.sent >= other.sent) return true;
    return other.sent - request.sent - stalls_.between(request.sent, other.sent) < kArrival;
  }

  /// The first request that may arrive after this one; all requests that were sent later may, too.
  std::vector<Request>::const_iterator firstAfter(const Request& other) const {
    return std::partition_point(
        seen_.requests.begin(), seen_.requests.end(),
        [&](const Request& request) { return !mayArriveAfter(request, other); });
  }

  /// Whether this request allows motions again after the ending forbade them.
  bool allowsAgain(const Request& request, const Request& ending, std::size_t axis) const {
    if (!isOf(request, axis) || wasRefused(request) || !mayFollow(request, ending)) return false;
    switch (ending.kind) {
      case Kind::kHold:
        // A stop of a single axis doesn't end the hold of the machine.
        return request.kind == Kind::kResume ||
               (request.kind == Kind::kStop && request.axes == ending.axes);
      case Kind::kDisable:
        return request.kind == Kind::kEnable;
      case Kind::kSleep:
        return request.kind == Kind::kWake;
      case Kind::kEmergencyStop:
        return request.kind == Kind::kRecover;
      default:
        return false;
    }
  }

  /// The time in which this motion may send pulses; it can't have begun before `earliest`.
  Span spanOf(const Request& motion, std::int64_t earliest, std::size_t axis) const {
    const std::int64_t begin = clock_.earliestAt(std::max(motion.sent, earliest));
    // A line that didn't begin may have moved its axes to take up their backlash.
    if (motion.answered && (motion.waits || !motion.success)) {
      return {begin,
              clock_.latestAt(*motion.answered) + longestStop(motion, axis, *motion.answered)};
    }
    return {begin, kForever};
  }

  /// The explained pulses after an ending: all pulses after `end`, and those in `passing`.
  struct Explained {
    std::int64_t end = kForever;
    std::vector<Span> passing;

    void add(const Span& span) {
      if (span.end == kForever) {
        end = std::min(end, span.begin);
      } else {
        passing.push_back(span);
      }
    }
  };

  /// Whether no request from this one on can explain a pulse before `explained.end`.
  bool isBeyond(const Request& request, const Explained& explained) const {
    return explained.end != kForever && clock_.earliestAt(request.sent) > explained.end;
  }

  void explainByMotions(const Request& after, std::size_t axis, Explained& explained) const {
    for (auto motion = firstAfter(after); motion != seen_.requests.end(); ++motion) {
      if (isBeyond(*motion, explained)) return;
      if (moves(motion->kind) && isOf(*motion, axis) && mayFollow(*motion, after)) {
        explained.add(spanOf(*motion, after.sent, axis));
      }
    }
  }

  Explained explainedAfter(const Request& ending, std::size_t axis) const {
    Explained explained;
    if (ending.kind == Kind::kStop) {
      explainByMotions(ending, axis, explained);
      return explained;
    }
    for (auto request = firstAfter(ending); request != seen_.requests.end(); ++request) {
      if (isBeyond(*request, explained)) break;
      if (!allowsAgain(*request, ending, axis)) continue;
      if (request->kind == Kind::kResume) {
        explained.add({clock_.earliestAt(request->sent), kForever});
      }
      explainByMotions(*request, axis, explained);
    }
    return explained;
  }

  /// From this time on.
  std::int64_t longestStop(const Request& ending, std::size_t axis, std::int64_t begin) const {
    double seconds = 0.0;
    // Axes that move together stop as slowly as the slowest of them.
    for (const AxisFacts& facts : seen_.axes) seconds = std::max(seconds, facts.longest_stop);
    const auto any = [&ending](const std::vector<std::int64_t>& sent) {
      const auto recent =
          std::lower_bound(sent.begin(), sent.end(), ending.sent - kLongestTrajectory);
      return recent != sent.end() && *recent <= *ending.answered;
    };
    if (any(of_axis_[axis].paths)) {
      seconds *= kPathStops;
    } else if (any(of_axis_[axis].trajectories)) {
      seconds *= kTrajectoryStops;
    }
    const std::int64_t longest = std::llround(seconds * kStopMargin * 1e9);
    // The rig's clock doesn't excuse a long stall: what is late in it, and all that comes after it,
    // is late by as much.
    std::int64_t late = 0;
    for (;;) {
      const std::int64_t more = stalls_.between(begin - kArrival, begin + longest + late);
      if (more == late) return longest + late;
      late = more;
    }
  }

  /// How many pulses came in each tenth of a second around an ending, and the stalls there; with
  /// times of the rig's clock.
  std::string courseAround(std::int64_t answered, std::size_t axis, std::int64_t last) const {
    constexpr std::int64_t kTenth = 100 * kMillisecond;
    std::string text = "pulses in each 0.1 s from 0.5 s before the answer on:";
    const auto& pulses = seen_.pulses[axis];
    for (std::int64_t from = answered - 5 * kTenth; from <= last; from += kTenth) {
      const auto count = std::count_if(pulses.begin(), pulses.end(), [from](const Pulse& pulse) {
        return pulse.time >= from && pulse.time < from + kTenth;
      });
      text += ' ' + std::to_string(count);
    }
    const std::int64_t stalled =
        stalls_.between(clock_.whenItShows(answered - 5 * kTenth), clock_.whenItShows(last));
    return text + "; stalled for " + formatted("%.3f s", inSeconds(stalled));
  }

  void judgeEnd(const Request& ending, std::size_t axis) {
    const bool decelerates = ending.kind == Kind::kStop || ending.kind == Kind::kHold;
    const std::int64_t allowed = decelerates ? longestStop(ending, axis, *ending.answered) : 0;
    const std::int64_t answered = clock_.latestAt(*ending.answered);
    const std::int64_t begin = answered + allowed;
    const auto [end, passing] = explainedAfter(ending, axis);
    std::size_t count = 0;
    std::int64_t first = 0;
    std::int64_t last = 0;
    const auto& pulses = seen_.pulses[axis];
    auto pulse = std::upper_bound(pulses.begin(), pulses.end(), begin,
                                  [](std::int64_t time, const Pulse& p) { return time < p.time; });
    for (; pulse != pulses.end() && pulse->time < end; ++pulse) {
      const auto explains = [&](const Span& span) {
        return pulse->time >= span.begin && pulse->time <= span.end;
      };
      if (std::any_of(passing.begin(), passing.end(), explains)) continue;
      if (count == 0) first = pulse->time;
      last = pulse->time;
      ++count;
    }
    if (count == 0) return;
    broken_.push_back(
        seen_.axes[axis].name + ": " + std::to_string(count) + " pulses after the answer of " +
        ending.text + ", from " + formatted("%.3f s", inSeconds(first - answered)) + " to " +
        formatted("%.3f s", inSeconds(last - answered)) + " after it (" +
        formatted("%.3f s", inSeconds(allowed)) + " are allowed); " +
        courseAround(answered, axis, last) +
        "; requests before and after it:" + requestsAround(ending.sent, clock_.whenItShows(first)));
  }

  void judgeOutput(const Request& request) {
    const bool wanted = request.output->on;
    const std::int64_t begin = clock_.earliestAt(request.sent);
    const std::int64_t end = clock_.latestAt(*request.answered);
    bool was_so = !wanted;  // it begins off
    for (const Switch& each : seen_.switches.at(request.output->output)) {
      if (each.time > end) break;
      if (each.time <= begin) {
        was_so = each.on == wanted;
      } else {
        was_so = was_so || each.on == wanted;
      }
    }
    if (was_so) return;
    broken_.push_back("after the answer of " + request.text +
                      " the output has never had that state; requests before and after it:" +
                      requestsAround(request.sent, *request.answered));
  }

  void judgeTimes(std::size_t output) {
    const OutputFacts& facts = seen_.outputs[output];
    const std::vector<Switch>& switches = seen_.switches.at(output);
    if (!facts.is_timed) return;
    for (std::size_t i = 1; i < switches.size(); ++i) {
      const std::int64_t time = switches[i].time;
      const std::int64_t length = time - switches[i - 1].time;
      // The end of the node switches it off.
      if (time > seen_.clock.back().rig) return;
      const bool is_too_long = !switches[i].on && length > facts.max_on + kLateWrite;
      const std::int64_t least = switches[i].on ? facts.min_off : facts.min_on;
      const bool is_too_short = length < least && (switches[i].on || !maybeSafeAt(time));
      if (!is_too_long && !is_too_short) continue;
      const std::int64_t shown = clock_.whenItShows(time);
      broken_.push_back("the output " + facts.name + " was " + (switches[i].on ? "off" : "on") +
                        " for " + formatted("%.4f s", inSeconds(length)) +
                        "; requests:" + requestsAround(shown, shown));
    }
  }

  /// Whether an emergency stop may have switched the outputs at this time of the rig's clock.
  bool maybeSafeAt(std::int64_t rig) const {
    return std::any_of(seen_.requests.begin(), seen_.requests.end(), [&](const Request& request) {
      return request.kind == Kind::kEmergencyStop && clock_.earliestAt(request.sent) <= rig &&
             (!request.answered || clock_.latestAt(*request.answered) >= rig);
    });
  }

  void judgeSafety(const Request& stop, const std::vector<Switch>& switches) {
    const std::int64_t begin = clock_.latestAt(*stop.answered);
    std::int64_t end = kForever;
    for (auto request = firstAfter(stop); request != seen_.requests.end(); ++request) {
      if (request->kind != Kind::kRecover || wasRefused(*request)) continue;
      if (mayFollow(*request, stop)) end = std::min(end, clock_.earliestAt(request->sent));
    }
    const auto later =
        std::upper_bound(switches.begin(), switches.end(), begin,
                         [](std::int64_t time, const Switch& each) { return time < each.time; });
    const bool was_on = later != switches.begin() && (later - 1)->on;
    const std::int64_t next = later != switches.end() ? later->time : kForever;
    const std::int64_t on_since = was_on ? begin : next;
    if (on_since >= end) return;
    broken_.push_back("the output was on after the answer of " + stop.text + ", since " +
                      formatted("%.3f s", inSeconds(on_since - begin)) + " after it");
  }

  std::string requestsAround(std::int64_t begin, std::int64_t end) const {
    constexpr std::int64_t kBefore = 1500 * kMillisecond;
    return requestsText(seen_.requests, begin - kBefore, end, begin);
  }

  void judgeReason(const Request& request) {
    if (!request.has_answer || !request.answered || request.success) return;
    if (request.message.empty()) broken_.push_back(request.text + " failed without a reason");
  }

  void judgeArrivals(const Request& request) {
    for (const Arrival& arrival : request.answer.arrivals) {
      const AxisFacts& facts = seen_.axes.at(arrival.axis);
      const double error = (arrival.told - arrival.wanted) * facts.steps_per_metre;
      if (std::abs(error) <= kArrivalError) continue;
      broken_.push_back(facts.name + ": " + request.text + " answered success, " +
                        formatted("%.1f", error) + " steps off its target: " + request.message);
    }
  }

  std::int64_t countAt(std::size_t axis, std::int64_t time) const {
    return joints_.countShown(axis, clock_.latestAt(time));
  }

  void judgePositions() {
    for (std::size_t axis = 0; axis < seen_.axes.size(); ++axis) {
      const AxisFacts& facts = seen_.axes[axis];
      const RestPoint* anchor = nullptr;
      const RestPoint* last = nullptr;
      for (const RestPoint& rest : seen_.rests) {
        if (anchor == nullptr || joints_.mayBeRenamed(axis, last->time, rest.time)) {
          anchor = last = &rest;
          continue;
        }
        last = &rest;
        const double told =
            (rest.positions[axis] - anchor->positions[axis]) * facts.steps_per_metre;
        const auto counted =
            static_cast<double>(countAt(axis, rest.time) - countAt(axis, anchor->time));
        const double slack = kPositionError + facts.backlash * facts.steps_per_metre;
        if (std::abs(told - counted) <= slack) continue;
        broken_.push_back(facts.name + ": its position changed by " + formatted("%.2f", told) +
                          " steps, and the rig has counted " + formatted("%.0f", counted) +
                          "; requests before:" + requestsAround(rest.time, rest.time));
        anchor = &rest;
      }
    }
  }

  struct Way {
    double low;
    double high;
  };

  /// [m] The places to which the requests between two moments of rest may lead an axis.
  Way allowedWay(std::size_t axis, const RestPoint& from, const RestPoint& to) const {
    const AxisFacts& facts = seen_.axes[axis];
    const double begin = from.positions[axis];
    // An axis that is outside may move back inside.
    Way way{std::min(facts.min_position, begin), std::max(facts.max_position, begin)};
    const Request* only = nullptr;
    auto next = std::partition_point(
        seen_.requests.begin(), seen_.requests.end(),
        [&](const Request& request) { return request.sent < from.time - kArrival; });
    for (; next != seen_.requests.end() && next->sent <= to.time; ++next) {
      const Request& request = *next;
      if (!isOf(request, axis) || (request.answered && *request.answered < from.time)) continue;
      if (!moves(request.kind) && request.kind != Kind::kResume) continue;
      if (only != nullptr || request.reaches.empty()) return way;
      only = &request;
    }
    if (only == nullptr) return way;
    way = {begin, begin};
    for (const Reach& reach : only->reaches) {
      if (reach.axis != axis) continue;
      const double origin = reach.relative ? begin : 0.0;
      way = {std::min(way.low, origin + reach.low), std::max(way.high, origin + reach.high)};
    }
    return way;
  }

  void judgeWay(std::size_t axis, const RestPoint& from, const RestPoint& to) {
    if (joints_.mayBeRenamed(axis, from.time, to.time)) return;
    const AxisFacts& facts = seen_.axes[axis];
    const std::int64_t before = countAt(axis, from.time);
    std::int64_t lowest = before;
    std::int64_t highest = before;
    const auto& pulses = seen_.pulses[axis];
    const auto first =
        std::upper_bound(pulses.begin(), pulses.end(), clock_.latestAt(from.time),
                         [](std::int64_t time, const Pulse& pulse) { return time < pulse.time; });
    const std::int64_t end = clock_.earliestAt(to.time);
    for (auto pulse = first; pulse != pulses.end() && pulse->time <= end; ++pulse) {
      lowest = std::min(lowest, pulse->count);
      highest = std::max(highest, pulse->count);
    }
    const Way allowed = allowedWay(axis, from, to);
    const double begin = from.positions[axis];
    const double error = kWayError + facts.backlash * facts.steps_per_metre;
    const double below = (begin - allowed.low) * facts.steps_per_metre -
                         static_cast<double>(before - lowest) + error;
    const double above = (allowed.high - begin) * facts.steps_per_metre -
                         static_cast<double>(highest - before) + error;
    if (below >= 0.0 && above >= 0.0) return;
    broken_.push_back(facts.name + ": from " + formatted("%.5f m", begin) +
                      " its pulses led it from " + std::to_string(lowest - before) + " to " +
                      std::to_string(highest - before) + " steps, but its requests only from " +
                      formatted("%.5f m", allowed.low) + " to " +
                      formatted("%.5f m", allowed.high) +
                      "; requests:" + requestsText(seen_.requests, from.time, to.time, from.time));
  }

  const Observation& seen_;
  const Stalls stalls_;
  const RigClock clock_;
  const Joints joints_;
  std::vector<AxisRequests> of_axis_;
  std::vector<std::string> broken_;
};

}  // namespace

std::string requestsText(const std::vector<Request>& requests, std::int64_t begin, std::int64_t end,
                         std::int64_t origin) {
  constexpr std::size_t kMost = 30;
  std::deque<std::string> lines;
  for (const Request& request : requests) {
    if (request.sent < begin || request.sent > end) continue;
    std::string line = formatted("%9.3f s ", inSeconds(request.sent - origin)) + "client " +
                       std::to_string(request.client) + ": " + request.text;
    if (request.answered) {
      line += formatted(" -> %.3f s ", inSeconds(*request.answered - origin)) +
              (request.success ? "done: " : "not done: ") + request.message;
    } else if (request.has_answer) {
      line += " -> no answer";
    }
    lines.push_back(line);
    if (lines.size() > kMost) lines.pop_front();
  }
  std::string text;
  for (const std::string& line : lines) text += "\n    " + line;
  return text;
}

std::vector<std::string> brokenPromises(const Observation& observation) {
  return Judge(observation).verdict();
}

}  // namespace stepdriver::storm
