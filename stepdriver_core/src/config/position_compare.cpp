#include "config/position_compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "config/bounds.h"
#include "config/least_time.h"
#include "message_text.h"

namespace stepdriver::config {
namespace {

// An edge takes 24 bytes, and up to two of them make a place.
constexpr double kMostPlaces = 1e6;
// [ns] A line is written twice in this time on any computer that was tried.
constexpr std::int64_t kShortestPulse = 10'000;
constexpr std::int64_t kLongestTimeNs = 10'000'000'000;
// [steps] Counts beyond it aren't exact in what computes with doubles.
constexpr double kFarthest = 1e12;

std::string secondsText(double seconds) { return roughText(seconds) + " s"; }
std::string secondsOf(std::int64_t ns) { return secondsText(static_cast<double>(ns) / 1e9); }

class CompareCheck {
 public:
  CompareCheck(const PositionCompare& compare, const OutputConfig& output, const AxisConfig& axis)
      : compare_(compare),
        output_(output),
        axis_(axis),
        least_on_(leastTime(output, true)),
        least_off_(leastTime(output, false)) {}

  std::string why() {
    checkKinds();
    if (why_.empty()) checkTimes();
    if (why_.empty()) compare_.cams.empty() ? checkPulses() : checkCams();
    return why_;
  }

 private:
  template <typename... Args>
  void refuse(const char* format, const Args&... args) {
    if (why_.empty()) why_ = fmt::vformat(format, fmt::make_format_args(args...));
  }
  std::string show(double place) const {
    return fmt::format("{} {}", numberText(place), unitOf(axis_.kind));
  }

  static std::string textOf(const LeastTime& least) {
    return fmt::format("{} of it is", least.name);
  }

  void checkKinds() {
    const bool pulses = !compare_.places.empty() || compare_.every || compare_.at_end;
    if (!pulses && compare_.cams.empty()) {
      refuse("has neither cams nor places at which {} switches it", axis_.name);
    } else if (pulses && !compare_.cams.empty()) {
      refuse("has cams and pulses, but can have only one of them");
    } else if (output_.at_stop) {
      refuse("has at_stop: {}, but the position of {} switches it also during a stop",
             *output_.at_stop ? "on" : "off", axis_.name);
    }
  }

  void checkTimes() {
    const auto check = [this](const char* what, std::int64_t value, std::int64_t least) {
      if (value >= least && value <= kLongestTimeNs) return;
      refuse("has a {} of {}, but it must be {} to {}", what, secondsOf(value), secondsOf(least),
             secondsOf(kLongestTimeNs));
    };
    check("lead of on", compare_.lead_on_ns, 0);
    check("lead of off", compare_.lead_off_ns, 0);
    if (!compare_.cams.empty()) return;
    check("pulse", compare_.pulse_ns, kShortestPulse);
    if (compare_.pulse_ns < least_on_.ns) {
      refuse("has a pulse of {}, but {} of it is {}", secondsOf(compare_.pulse_ns), least_on_.name,
             secondsOf(least_on_.ns));
    }
    if (output_.max_on_ns && compare_.pulse_ns > *output_.max_on_ns) {
      refuse("has a pulse of {}, but max_on_s of it is {}", secondsOf(compare_.pulse_ns),
             secondsOf(*output_.max_on_ns));
    }
  }

  void checkPlace(double place) {
    const double farthest = kFarthest / axis_.steps_per_unit;
    const double low = axis_.min_position.value_or(-farthest);
    const double high = axis_.max_position.value_or(farthest);
    if (place >= low && place <= high) return;
    refuse("has a place at {}, but the places of {} are {} to {}", show(place), axis_.name,
           show(low), show(high));
  }

  // The least way between two actions, and the time that the axis takes for it at its top speed.
  void checkWay(const char* between, double way, std::int64_t needed, const std::string& why) {
    const std::string way_text = roughText(way) + " " + unitOf(axis_.kind);
    if (way * axis_.steps_per_unit * kSlack < 1.0) {
      refuse("has {} of {}, but a step of {} is {}", between, way_text, axis_.name,
             show(1.0 / axis_.steps_per_unit));
      return;
    }
    const double seconds = way / axis_.max_speed;
    if (seconds * 1e9 * kSlack >= static_cast<double>(needed)) return;
    refuse("has {} of {}, for which {} takes {} at {}/s, but {} {}", between, way_text, axis_.name,
           secondsText(seconds), show(axis_.max_speed), why, secondsOf(needed));
  }

  void checkLead(const char* between, double way, std::int64_t lead) {
    checkWay(between, way, lead, "the lead is");
  }

  void checkPulses() {
    double least = std::numeric_limits<double>::infinity();
    std::vector<double> places = compare_.places;
    if (static_cast<double>(places.size()) > kMostPlaces) {
      return refuse("has {} places, but can have {} at most", places.size(), kMostPlaces);
    }
    if (const auto& every = compare_.every) {
      checkPlace(every->from);
      checkPlace(every->to);
      const double count = (every->to - every->from) / every->distance;
      if (!(every->distance > 0.0 && count >= 0.0)) {
        refuse("has a distance of {} from {} to {}, but it must be above 0, and lead upwards",
               show(every->distance), show(every->from), show(every->to));
      } else if (!(count < kMostPlaces)) {
        refuse("has {} places, but can have {} at most", roughText(count + 1.0), kMostPlaces);
      } else {
        if (count >= 1.0) least = every->distance;
        if (!places.empty()) refuse("has single places and a distance, but can have only one");
      }
    }
    for (const double place : places) checkPlace(place);
    if (!why_.empty()) return;
    std::sort(places.begin(), places.end());
    for (std::size_t i = 1; i < places.size(); ++i) {
      least = std::min(least, places[i] - places[i - 1]);
    }
    if (!std::isfinite(least)) return;
    const char* const between = "a distance between pulses";
    checkWay(between, least, compare_.pulse_ns + std::max<std::int64_t>(least_off_.ns, 1),
             fmt::format("a pulse and {} of it are", least_off_.name));
    checkLead(between, least, compare_.lead_on_ns);
  }

  void checkCams() {
    std::vector<PositionCompare::Cam> cams = compare_.cams;
    if (static_cast<double>(cams.size()) > kMostPlaces) {
      return refuse("has {} cams, but can have {} at most", cams.size(), kMostPlaces);
    }
    const std::int64_t longest_lead = std::max(compare_.lead_on_ns, compare_.lead_off_ns);
    for (const PositionCompare::Cam& cam : cams) {
      checkPlace(cam.from);
      checkPlace(cam.to);
      if (cam.from > cam.to) refuse("has a cam from {} to {}", show(cam.from), show(cam.to));
      checkWay("a cam", cam.to - cam.from, least_on_.ns, textOf(least_on_));
      checkLead("a cam", cam.to - cam.from, longest_lead);
    }
    if (!why_.empty()) return;
    std::sort(cams.begin(), cams.end(),
              [](const auto& one, const auto& other) { return one.from < other.from; });
    for (std::size_t i = 1; i < cams.size(); ++i) {
      const double gap = cams[i].from - cams[i - 1].to;
      if (gap <= 0.0) {
        refuse("has cams that overlap, to {} and from {}", show(cams[i - 1].to),
               show(cams[i].from));
      }
      // The last place of one and the first place of the next one are a step nearer.
      const double off = gap - 1.0 / axis_.steps_per_unit;
      checkWay("a gap between cams", off, least_off_.ns, textOf(least_off_));
      checkLead("a gap between cams", off, longest_lead);
    }
  }

  const PositionCompare& compare_;
  const OutputConfig& output_;
  const AxisConfig& axis_;
  const LeastTime least_on_;
  const LeastTime least_off_;
  std::string why_;
};

}  // namespace

std::string whyNotCompared(const PositionCompare& compare, const OutputConfig& output,
                           const AxisConfig& axis) {
  return CompareCheck(compare, output, axis).why();
}

}  // namespace stepdriver::config
