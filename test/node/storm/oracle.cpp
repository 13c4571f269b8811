#include "storm/oracle.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <deque>
#include <limits>
#include <utility>

namespace stepdriver::storm {
namespace {

constexpr std::int64_t kForever = std::numeric_limits<std::int64_t>::max();
constexpr std::int64_t kMillisecond = 1'000'000;
/// Of two requests that are sent so far apart the first one arrives first.
constexpr std::int64_t kArrival = 250 * kMillisecond;
/// How far the rig's clock falls behind at most while the computer doesn't stall.
constexpr std::int64_t kLag = 200 * kMillisecond;
/// For the offset of the clocks, which is measured by calls.
constexpr std::int64_t kOffsetError = 2 * kMillisecond;
constexpr double kStopMargin = 1.1;
/// A trajectory keeps to half of the limits here, so that its path leaves as much for a stop.
constexpr double kTrajectoryStops = 2.0;
constexpr std::int64_t kLongestTrajectory = 20'000 * kMillisecond;
constexpr double kPositionError = 0.05;  // [1/16 steps]
/// Half a step of the coarsest mode in use, and a bit.
constexpr double kArrivalError = 1.05;  // [1/16 steps]

double inSeconds(std::int64_t time) { return static_cast<double>(time) * 1e-9; }

std::string formatted(const char* format, double number) {
  char text[64];
  std::snprintf(text, sizeof text, format, number);
  return text;
}

/// From when on a motion may put out pulses, and until when, in CLOCK_MONOTONIC.
struct Span {
  std::int64_t begin;
  std::int64_t end;
};

class Judge {
 public:
  explicit Judge(const Observation& observation) : seen_(observation) {}

  std::vector<std::string> verdict() {
    for (const Request& request : seen_.requests) {
      if (!request.answered || !request.success) continue;
      judgeArrivals(request);
      if (!ends(request.kind)) continue;
      for (std::size_t axis = 0; axis < seen_.axes.size(); ++axis) {
        if ((request.axes >> axis & 1U) != 0) judgeEnd(request, axis);
      }
    }
    judgePositions();
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

  std::int64_t stalled(std::int64_t begin, std::int64_t end) const {
    std::int64_t sum = 0;
    for (const Stall& stall : seen_.stalls) {
      sum += std::max<std::int64_t>(0, std::min(end, stall.end) - std::max(begin, stall.begin));
    }
    return sum;
  }

  /// Whether the node may have handled it after the other one.
  bool mayFollow(const Request& request, const Request& other) const {
    if (&request == &other) return false;
    if (request.answered && *request.answered < other.sent) return false;
    const std::int64_t apart = other.sent - request.sent;
    return apart - (apart > 0 ? stalled(request.sent, other.sent) : 0) < kArrival;
  }

  /// Whether this allows motions again that the ending forbids.
  bool allowsAgain(const Request& request, const Request& ending, std::size_t axis) const {
    if (!isOf(request, axis) || wasRefused(request) || !mayFollow(request, ending)) return false;
    switch (ending.kind) {
      case Kind::kHold:
        // The stop of a single axis doesn't end the hold of the machine.
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

  /// When this motion may put out pulses; it can't have begun before `earliest`.
  Span spanOf(const Request& motion, std::int64_t earliest, std::size_t axis) const {
    std::int64_t end = kForever;
    // A line that didn't begin may have moved its axes to take up backlash.
    if (motion.answered && (motion.waits || !motion.success)) {
      end = *motion.answered + longestStop(motion, axis);
    }
    return {std::max(motion.sent, earliest), end};
  }

  /// The motions that explain pulses after the ending.
  std::vector<Span> newerMotions(const Request& ending, std::size_t axis) const {
    std::vector<Span> spans;
    const auto add = [&](const Request& after, std::int64_t earliest) {
      for (const Request& motion : seen_.requests) {
        if (moves(motion.kind) && isOf(motion, axis) && mayFollow(motion, after)) {
          spans.push_back(spanOf(motion, earliest, axis));
        }
      }
    };
    if (ending.kind == Kind::kStop) {
      add(ending, ending.sent);
      return spans;
    }
    for (const Request& request : seen_.requests) {
      if (!allowsAgain(request, ending, axis)) continue;
      if (request.kind == Kind::kResume) spans.push_back({request.sent, kForever});
      add(request, request.sent);
    }
    return spans;
  }

  std::int64_t longestStop(const Request& ending, std::size_t axis) const {
    double seconds = 0.0;
    // Axes that move as one stop as the slowest of them does.
    for (const AxisFacts& facts : seen_.axes) seconds = std::max(seconds, facts.longest_stop);
    for (const Request& request : seen_.requests) {
      if (!request.is_trajectory || !isOf(request, axis) || request.sent > *ending.answered ||
          request.sent < ending.sent - kLongestTrajectory) {
        continue;
      }
      return std::llround(seconds * kTrajectoryStops * kStopMargin * 1e9);
    }
    return std::llround(seconds * kStopMargin * 1e9);
  }

  void judgeEnd(const Request& ending, std::size_t axis) {
    const bool decelerates = ending.kind == Kind::kStop || ending.kind == Kind::kHold;
    const std::int64_t allowed = decelerates ? longestStop(ending, axis) : 0;
    const std::int64_t begin = *ending.answered - seen_.clock_offset + kOffsetError + allowed;
    std::int64_t end = kForever;
    std::vector<Span> passing;
    for (const Span& span : newerMotions(ending, axis)) {
      // The rig's clock may be behind when the motion begins.
      const std::int64_t from = span.begin - seen_.clock_offset - kLag -
                                stalled(span.begin - 10 * kLag, span.begin + 10 * kLag);
      if (span.end == kForever) {
        end = std::min(end, from);
      } else {
        passing.push_back({from, span.end - seen_.clock_offset + kOffsetError});
      }
    }
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
    const std::int64_t answered = *ending.answered - seen_.clock_offset;
    broken_.push_back(
        seen_.axes[axis].name + ": " + std::to_string(count) + " pulses after the answer of " +
        ending.text + ", from " + formatted("%.3f s", inSeconds(first - answered)) + " to " +
        formatted("%.3f s", inSeconds(last - answered)) + " after it (" +
        formatted("%.3f s", inSeconds(allowed)) + " are allowed); requests before and after it:" +
        requestsAround(ending.sent, first + seen_.clock_offset));
  }

  std::string requestsAround(std::int64_t begin, std::int64_t end) const {
    constexpr std::int64_t kBefore = 1500 * kMillisecond;
    return requestsText(seen_.requests, begin - kBefore, end, begin);
  }

  void judgeArrivals(const Request& request) {
    for (const Arrival& arrival : request.arrivals) {
      const AxisFacts& facts = seen_.axes.at(arrival.axis);
      const double error = (arrival.told - arrival.wanted) * facts.steps_per_metre;
      if (std::abs(error) <= kArrivalError) continue;
      broken_.push_back(facts.name + ": " + request.text + " answered success, " +
                        formatted("%.1f", error) + " steps off its target: " + request.message);
    }
  }

  /// Whether what the position is counted from may have changed between two times.
  bool mayBeRenamed(std::size_t axis, std::int64_t begin, std::int64_t end) const {
    return std::any_of(seen_.requests.begin(), seen_.requests.end(), [&](const Request& request) {
      return (request.kind == Kind::kSetPosition || request.kind == Kind::kHoming) &&
             isOf(request, axis) && request.sent < end &&
             (!request.answered || *request.answered > begin);
    });
  }

  std::int64_t countAt(std::size_t axis, std::int64_t time) const {
    const auto& pulses = seen_.pulses[axis];
    const auto after =
        std::upper_bound(pulses.begin(), pulses.end(), time - seen_.clock_offset,
                         [](std::int64_t t, const Pulse& pulse) { return t < pulse.time; });
    return after == pulses.begin() ? 0 : std::prev(after)->count;
  }

  void judgePositions() {
    for (std::size_t axis = 0; axis < seen_.axes.size(); ++axis) {
      const AxisFacts& facts = seen_.axes[axis];
      const RestPoint* anchor = nullptr;
      const RestPoint* last = nullptr;
      for (const RestPoint& rest : seen_.rests) {
        if (anchor == nullptr || mayBeRenamed(axis, last->time, rest.time)) {
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

  const Observation& seen_;
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
