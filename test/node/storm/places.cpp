#include "storm/places.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include "storm/text.h"

namespace stepdriver::storm {
namespace {

/// Half a step of the coarsest mode in use, and a margin.
constexpr double kPlaceError = 1.05;  // [1/16 steps]
/// The same, and where a path begins between two steps.
constexpr double kMarkError = 2.05;  // [1/16 steps]
/// All that one pass of the pulse thread does has one time.
constexpr std::int64_t kOnePass = 1000;
constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();
constexpr double kSameNumber = 1e-9;  // [m]

class PlaceJudge {
 public:
  PlaceJudge(const Observation& seen, const RigClock& clock, const Joints& joints)
      : seen_(seen), clock_(clock), joints_(joints) {}

  std::vector<std::string> verdict() {
    const std::vector<Switch>& compared = seen_.switches.at(kCompared);
    for (std::size_t i = 0; i < compared.size(); ++i) {
      if (compared[i].on) judgePulse(i);
    }
    for (const Latched& latched : seen_.latched) judgeLatched(latched);
    for (const Request& request : seen_.requests) {
      if (request.answer.contact) judgeContact(request);
    }
    for (std::size_t i = 1; i < seen_.rests.size(); ++i) {
      if (!seen_.rests[i].alone) continue;
      judgePassages(seen_.rests[i - 1], seen_.rests[i]);
      judgeMarks(seen_.rests[i - 1], seen_.rests[i]);
    }
    return std::move(broken_);
  }

 private:
  static constexpr std::size_t kCompared = 0;  // the output that positions switch

  void report(const std::string& words, std::int64_t rig) {
    constexpr std::int64_t kBefore = 3'000'000'000;
    const std::int64_t time = clock_.whenItShows(rig);
    broken_.push_back(
        words + "; requests before:" + requestsText(seen_.requests, time - kBefore, time, time));
  }

  bool surelyBefore(const Request& request, std::int64_t rig) const {
    return request.answered && request.success && clock_.latestAt(*request.answered) < rig;
  }

  /// What positions may make the output do at a time; empty: that isn't known.
  std::vector<const CompareOrder*> ordersAt(std::int64_t rig) const {
    std::vector<const Request*> possible;
    for (const Request& request : seen_.requests) {
      if (!request.compare || clock_.earliestAt(request.sent) > rig) continue;
      if (request.answered && !request.success) continue;
      const auto ends = [&](const Request* other) {
        return surelyBefore(request, rig) && other->answered && *other->answered < request.sent;
      };
      possible.erase(std::remove_if(possible.begin(), possible.end(), ends), possible.end());
      possible.push_back(&request);
    }
    std::vector<const CompareOrder*> orders;
    const bool is_one_sure =
        std::any_of(possible.begin(), possible.end(),
                    [&](const Request* request) { return surelyBefore(*request, rig); });
    for (const Request* request : possible) {
      if (!is_one_sure || !request->compare->has_pulses) return {};
      orders.push_back(&*request->compare);
    }
    return orders;
  }

  /// The nearest of the places. Steps go to whole microsteps, so the first and the last one reach
  /// a little further.
  static double placeNear(const CompareOrder& order, double position) {
    const double last = std::floor((order.end - order.begin) / order.distance + kSameNumber);
    const double number = std::round((position - order.begin) / order.distance);
    return order.begin + order.distance * std::clamp(number, 0.0, last);
  }

  bool arrives(const CompareOrder& order, double position, std::int64_t rig) const {
    const double scale = seen_.axes[order.axis].steps_per_metre;
    if (std::abs(placeNear(order, position) - position) * scale > kPlaceError) return false;
    const auto& pulses = seen_.pulses[order.axis];
    const auto after =
        std::upper_bound(pulses.begin(), pulses.end(), rig + kOnePass,
                         [](std::int64_t time, const Pulse& pulse) { return time < pulse.time; });
    if (after == pulses.begin() || (after - 1)->time < rig - kOnePass) return false;
    const std::int64_t before = after - pulses.begin() < 2 ? 0 : (after - 2)->count;
    const bool is_up = (after - 1)->count > before;
    return order.direction == 0 || (order.direction > 0) == is_up;
  }

  void judgePulse(std::size_t index) {
    const std::vector<Switch>& switches = seen_.switches[kCompared];
    const std::int64_t rig = switches[index].time;
    const std::vector<const CompareOrder*> orders = ordersAt(rig);
    if (orders.empty()) return;
    double longest = 0.0;
    std::string places;
    for (const CompareOrder* order : orders) {
      longest = std::max(longest, order->pulse);
      const auto position = joints_.positionShown(order->axis, rig + kOnePass);
      if (!position || arrives(*order, *position, rig)) return judgeLength(index, longest);
      places += " " + seen_.axes[order->axis].name + " at " + formatted("%.5f m", *position);
    }
    report("an output is switched by a position that is none of its places:" + places, rig);
  }

  void judgeLength(std::size_t index, double longest) {
    const std::vector<Switch>& switches = seen_.switches[kCompared];
    if (index + 1 == switches.size()) return;
    const std::int64_t length = switches[index + 1].time - switches[index].time;
    if (length <= std::llround(longest * 1e9) + kOnePass) return;
    report("a pulse of an output lasts " + formatted("%.6f s", static_cast<double>(length) * 1e-9) +
               " instead of " + formatted("%.6f s", longest),
           switches[index].time);
  }

  void judgeLatched(const Latched& latched) {
    const Request& request = seen_.requests.at(latched.request);
    if (request.window) {
      const double place = latched.positions.at(request.window->axis);
      if (place < request.window->from - kSameNumber || place > request.window->to + kSameNumber) {
        report("a latch tells of an edge at " + formatted("%.6f m", place) +
                   ", which isn't in its window",
               clock_.latestAt(latched.received));
      }
    }
    const auto told = [&](std::size_t axis) { return latched.positions.at(axis); };
    if (isAtEdge(latched.active, request.sent, latched.received, seen_.axes.size(), told)) return;
    report("a latch tells of an edge at " + formatted("%.5f m", told(0)) +
               ", where the input has none",
           clock_.latestAt(latched.received));
  }

  void judgeContact(const Request& request) {
    const ProbeOrder& order = *request.probe;
    const auto told = [&](std::size_t axis) -> std::optional<double> {
      if (axis != order.axis) return std::nullopt;
      return request.answer.contact;
    };
    if (isAtEdge(order.active, request.sent, *request.answered, seen_.axes.size(), told)) return;
    report(request.text + " tells of a contact at " + formatted("%.5f m", *request.answer.contact) +
               ", where the input has none",
           clock_.latestAt(*request.answered));
  }

  /// Whether the input may have had an edge between two times, at which the axes were where it is
  /// told.
  /// @param told [m] of each axis; empty: nothing
  template <typename Told>
  bool isAtEdge(bool active, std::int64_t begin, std::int64_t end, std::size_t axes,
                const Told& told) const {
    const std::int64_t last = clock_.latestAt(end);
    auto edge = std::partition_point(
        seen_.input.begin(), seen_.input.end(),
        [first = clock_.earliestAt(begin)](const Switch& each) { return each.time < first; });
    for (; edge != seen_.input.end() && edge->time <= last; ++edge) {
      if (edge->on != active) continue;
      bool fits = true;
      for (std::size_t axis = 0; axis < axes; ++axis) {
        const std::optional<double> place = told(axis);
        const auto position = joints_.positionShown(axis, edge->time);
        if (!place || !position) continue;
        fits =
            fits && std::abs(*place - *position) * seen_.axes[axis].steps_per_metre <= kPlaceError;
      }
      if (fits) return true;
    }
    return false;
  }

  /// What the position of an axis makes the output do in the motion alone between two rests; null:
  /// there is no motion, it does nothing, or that isn't known.
  const CompareOrder* orderInForce(const RestPoint& from, const RestPoint& to) const {
    const Request* last = nullptr;
    bool is_known = false;
    std::int64_t answered = 0;  // the latest answer so far
    for (const Request& request : seen_.requests) {
      if (request.sent > to.time) break;
      if (request.sent > from.time && request.kind == Kind::kMotion) {
        return is_known && last->compare->has_pulses ? &*last->compare : nullptr;
      }
      if (!request.compare || (request.answered && !request.success)) continue;
      // Requests that were under way together may have been handled in either order.
      is_known = request.answered && request.sent > answered;
      answered = std::max(answered, request.answered.value_or(kNever));
      last = &request;
    }
    return nullptr;
  }

  /// Each passage of a place in a motion alone has its pulse.
  void judgePassages(const RestPoint& from, const RestPoint& to) {
    const CompareOrder* const in_force = orderInForce(from, to);
    if (in_force == nullptr) return;
    const CompareOrder& order = *in_force;
    const std::int64_t begin = clock_.latestAt(from.time);
    const std::int64_t end = clock_.earliestAt(to.time);
    // It may not be trusted, and then its position switches nothing.
    if (!to.valid[order.axis] || !from.valid[order.axis]) return;
    if (joints_.mayBeRenamed(order.axis, from.time, to.time)) return;
    const double scale = seen_.axes[order.axis].steps_per_metre;
    const auto& pulses = seen_.pulses[order.axis];
    const auto first =
        std::upper_bound(pulses.begin(), pulses.end(), begin,
                         [](std::int64_t time, const Pulse& pulse) { return time < pulse.time; });
    const double last = std::floor((order.end - order.begin) / order.distance + kSameNumber);
    for (double number = 0.0; number <= last; ++number) {
      const double place = order.begin + order.distance * number;
      int side = 0;  // of the place at which the axis was last, clear of it
      std::int64_t left = begin;
      for (auto pulse = first; pulse != pulses.end() && pulse->time <= end; ++pulse) {
        const auto position = joints_.positionShown(order.axis, pulse->time);
        if (!position) return;
        const double beyond = (*position - place) * scale;
        const int now = beyond > kPlaceError ? 1 : (beyond < -kPlaceError ? -1 : 0);
        if (now == 0) continue;
        if (side != 0 && now != side && (order.direction == 0 || order.direction == now)) {
          judgePassage(place, left, pulse->time);
        }
        side = now;
        left = pulse->time;
      }
    }
  }

  void judgePassage(double place, std::int64_t begin, std::int64_t end) {
    const std::vector<Switch>& switches = seen_.switches[kCompared];
    const auto count = std::count_if(switches.begin(), switches.end(), [&](const Switch& each) {
      return each.on && each.time > begin - kOnePass && each.time <= end + kOnePass;
    });
    if (count == 1) return;
    report("the passage of " + formatted("%.5f m", place) + " makes " + std::to_string(count) +
               " pulses instead of one",
           end);
  }

  void judgeMarks(const RestPoint& from, const RestPoint& to) {
    for (const Request& request : seen_.requests) {
      if (request.marks.empty() || !request.answered || !request.success) continue;
      if (request.sent < from.time || request.sent > to.time) continue;
      judgeMarksOf(request, from, to);
    }
  }

  void judgeMarksOf(const Request& request, const RestPoint& from, const RestPoint& to) {
    const std::vector<Switch>& switches = seen_.switches.at(request.marks.front().output);
    auto next = std::partition_point(switches.begin(), switches.end(),
                                     [begin = clock_.earliestAt(request.sent)](const Switch& each) {
                                       return each.time < begin;
                                     });
    // A path that finds its output on has fewer edges.
    if (next != switches.begin() && (next - 1)->on) return;
    const std::int64_t end = clock_.earliestAt(to.time);
    for (const MarkOrder& mark : request.marks) {
      if (next == switches.end() || next->time > end || next->on != mark.on) {
        report(request.text + " doesn't switch its output at each of its marks", end);
        return;
      }
      judgeMark(mark, request, from, next->time);
      ++next;
    }
    if (next != switches.end() && next->time <= end) {
      report(request.text + " switches its output where it has no mark", next->time);
    }
  }

  void judgeMark(const MarkOrder& mark, const Request& request, const RestPoint& from,
                 std::int64_t rig) {
    const std::int64_t reached = rig + std::llround(mark.lead * 1e9);
    for (std::size_t i = 0; i < request.path_axes.size(); ++i) {
      const std::size_t axis = request.path_axes[i];
      // A path takes up a backlash on its way, and the joint lags meanwhile.
      if (seen_.axes[axis].backlash > 0.0) continue;
      const auto position = joints_.positionShown(axis, reached);
      if (!position) continue;
      const double error =
          (*position - from.positions[axis] - mark.position[i]) * seen_.axes[axis].steps_per_metre;
      if (std::abs(error) <= kMarkError) continue;
      report(request.text + " switches its output " + formatted("%.1f steps", error) + " of " +
                 seen_.axes[axis].name + " away from its mark",
             rig);
    }
  }

  const Observation& seen_;
  const RigClock& clock_;
  const Joints& joints_;
  std::vector<std::string> broken_;
};

}  // namespace

std::vector<std::string> brokenPlaces(const Observation& seen, const RigClock& clock,
                                      const Joints& joints) {
  return PlaceJudge(seen, clock, joints).verdict();
}

}  // namespace stepdriver::storm
