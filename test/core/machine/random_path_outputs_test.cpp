#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/constants.h"
#include "support/corexy_bench.h"
#include "support/drawn_course.h"
#include "support/path_bench.h"
#include "support/refusal.h"
#include "support/runs.h"
#include "support/traced_place.h"

// Random paths that switch outputs, with random commands on the way. The judge knows the geometry
// that was drawn, the times of the commands, the answer and the pins' trace, and nothing of how the
// product plans: at the time of an edge, each axis must be where the mark of that edge is.
// STEPDRIVER_MOTIONS is the number of motions of each seed, for long runs by hand.

namespace stepdriver {
namespace {

using machine::CoordinatedResult;
using motion::PathRequest;
using motion::PathSegment;
using test::Bench;
using test::CoordinatedMove;
using test::DrawnSegment;
using test::kMillisecond;
using test::KnownPlace;
using test::kPi;
using test::TracedAxes;
using Point = DrawnSegment::Point;

// [microsteps] Between its knots, an axis is within a tenth of a microstep of a curve, and while
// the rate changes, within a hundredth of that. Both errors count once for the axis and once for
// the mark.
constexpr double kOnCurve = 0.12;
constexpr double kOnLine = 0.02;

struct DrawnMark {
  std::size_t segment = 0;
  double u = 0.0;
  double distance = 0.0;
  bool is_exact = true;                // no rounding is near
  double tolerance = 0.0;              // [m] that the rounding may have
  std::optional<std::size_t> step_of;  // it is where this axis makes a step
};

// What was asked of a machine while it followed the path.
struct Disturbance {
  enum class Kind { kRate, kStop, kTakeOver, kEmergencyStop };
  Kind kind = Kind::kRate;
  std::int64_t time_ns = 0;
};
using Kind = Disturbance::Kind;

class RandomPathOutputs : public test::PathBench, public testing::WithParamInterface<int> {
 protected:
  void SetUp() override {}

  // ---- what is drawn ----

  double unit() { return std::uniform_real_distribution<double>(0.0, 1.0)(random_); }
  double between(double low, double high) { return low + (high - low) * unit(); }
  std::int64_t whole(std::int64_t least, std::int64_t most) {
    return std::uniform_int_distribution<std::int64_t>(least, most)(random_);
  }
  std::size_t number(std::size_t least, std::size_t most) {
    return std::uniform_int_distribution<std::size_t>(least, most)(random_);
  }
  bool chance(double probability) { return unit() < probability; }

  void drawMachine() {
    axes_ = {plotterAxis("x"), plotterAxis("y")};
    const bool shares = chance(0.2);
    if (chance(0.5)) {
      axes_.push_back(plotterAxis("z"));
      axes_[2].steps_per_unit = 400'000.0;
      axes_[2].max_speed = 0.02;
      axes_[2].acceleration = axes_[2].deceleration = 0.5;
    }
    has_jerk_ = chance(0.3);
    for (config::AxisConfig& axis : axes_) {
      if (chance(0.5)) axis.deceleration = axis.acceleration * between(0.5, 2.0);
      if (has_jerk_) axis.jerk = between(5.0, 50.0);
      if (has_jerk_ || chance(0.5)) axis.start_speed = 0.0;
      const auto play = whole(1, 40);
      if (!shares && !has_jerk_ && chance(0.25)) {
        axis.backlash = static_cast<double>(play) / axis.steps_per_unit;
      }
    }
    lags_.assign(axes_.size(), {});
    const bool is_shaped = chance(0.25);
    if (is_shaped) drawShapers();
    if (shares) {
      for (config::AxisConfig& axis : axes_) axis.start_speed = 0.0;
      std::vector<config::AxisConfig> pair(axes_.begin(), axes_.begin() + 2);
      test::share(pair, {{1.0, 1.0}, {1.0, -1.0}});
      std::copy(pair.begin(), pair.end(), axes_.begin());
    }
    machine::MachineOptions options;
    options.outputs = test::penAndLaser();
    outputs_ = options.outputs;
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(axes_);
    for (sim::RigAxisSpec& spec : specs) spec.max_switch->position = 100'000.0;
    bench = std::make_unique<Bench>(axes_, specs, false, 0.0, options);
  }

  // Mostly the same for all axes.
  void drawShapers() {
    const double frequency = between(15.0, 80.0);
    const bool is_same = chance(0.7);
    for (std::size_t k = 0; k < axes_.size(); ++k) {
      config::AxisConfig& axis = axes_[k];
      const double f = is_same ? frequency : between(15.0, 80.0);
      axis.start_speed = 0.0;
      axis.backlash = 0.0;
      axis.input_shaper = {{config::ShaperType::kZv, f, 0.0}};
      // Half of it at once, half of it half a period later.
      lags_[k].mean = 0.25 / f;
      lags_[k].is_same = is_same;
    }
    boundLags();
  }

  // In the direction of the path, the axes are at their place. Across it, the parts of a motion are
  // around it: by their variance, and by their mean if the axes are so slow there that they come to
  // it as soon or as late as a part of them does. Different shapers differ by their means.
  void boundLags() {
    double acceleration = 0.0;
    double speed = 0.0;
    double longest = 0.0;
    double shortest = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < axes_.size(); ++k) {
      const double most = std::max(axes_[k].acceleration, axes_[k].deceleration);
      acceleration = std::hypot(acceleration, most);
      speed = std::hypot(speed, axes_[k].max_speed);
      longest = std::max(longest, lags_[k].mean);
      shortest = std::min(shortest, lags_[k].mean);
    }
    for (Lag& lag : lags_) {
      lag.most = acceleration * longest * longest + speed * (longest - shortest);
    }
  }

  static Point plus(const Point& point, const Point& direction, double way) {
    Point sum = point;
    for (std::size_t k = 0; k < 3; ++k) sum[k] += way * direction[k];
    return sum;
  }
  Point randomDirection() {
    Point direction{between(-1.0, 1.0), between(-1.0, 1.0),
                    axes_.size() > 2 ? between(-0.3, 0.3) : 0.0};
    const double size = DrawnSegment::sizeOf(direction);
    for (double& x : direction) x /= size;
    return direction;
  }

  // A joint without a corner is one between a curve and anything else: roundings of corners between
  // lines may reach over several lines.
  void drawCourse() {
    course_.clear();
    joints_.clear();
    Point at{};
    Point direction = randomDirection();
    const auto count = whole(2, 12);
    for (std::int64_t i = 0; i < count; ++i) {
      const double what = unit();
      const bool after_line = i > 0 && course_.back().shape() == PathSegment::Shape::kLine;
      const bool is_line = what < 0.4;
      const bool is_smooth = i > 0 && !(is_line && after_line) && chance(0.6);
      if (!is_smooth) direction = randomDirection();
      const double size = std::pow(10.0, between(-3.7, -2.0));
      const double flat = std::hypot(direction[0], direction[1]);
      if (is_line) {
        course_.push_back(DrawnSegment::line(at, plus(at, direction, size)));
      } else if (what < 0.7 && flat > 0.2) {
        const double side = chance(0.5) ? 1.0 : -1.0;
        const double angle = chance(0.1) ? 2.0 * kPi : between(0.1, 1.9 * kPi);
        const std::array<double, 2> centre{at[0] - side * size * direction[1] / flat,
                                           at[1] + side * size * direction[0] / flat};
        course_.push_back(
            DrawnSegment::arc(at, centre, side * angle, direction[2] / flat * size * angle));
      } else {
        const Point control1 = plus(at, direction, size * between(0.3, 1.0));
        const Point to = plus(at, randomDirection(), size * between(1.0, 3.0));
        const Point control2 = plus(to, randomDirection(), size * between(0.3, 1.0));
        course_.push_back(DrawnSegment::bezier(at, control1, control2, to));
      }
      at = course_.back().end();
      direction = course_.back().direction(1.0);
      if (i > 0) joints_.push_back({is_smooth, chance(0.3) ? 0.0 : between(2e-5, 5e-4)});
    }
    // A hook at the end that is shorter than a backlash doesn't move the joint.
    joints_.push_back({false, 0.0});
    const std::array<double, 3> last{between(1e-3, 3e-3), between(-3e-3, -1e-3),
                                     axes_.size() > 2 ? 1e-3 : 0.0};
    course_.push_back(DrawnSegment::line(at, plus(at, last, 1.0)));
    joints_.push_back({false, 0.0});
    is_calm_ = chance(0.3);
    if (!is_calm_) return;
    for (Joint& joint : joints_) joint.tolerance = 0.0;
  }

  // Whether the path passes the end of a segment as it was drawn.
  bool isRounded(std::size_t joint) const {
    return joints_[joint].tolerance > 0.0 && (has_jerk_ || !joints_[joint].is_smooth);
  }
  double roundedBy(std::size_t segment, double u) const {
    const bool is_line = course_[segment].shape() == PathSegment::Shape::kLine;
    double most = 0.0;
    if (segment > 0 && (u < 0.51 || is_line) && isRounded(segment - 1)) {
      most = joints_[segment - 1].tolerance;
    }
    if ((u > 0.49 || is_line) && isRounded(segment)) {
      most = std::max(most, joints_[segment].tolerance);
    }
    return most;
  }

  // Where an axis makes a step, near a parameter.
  std::optional<double> atStep(std::size_t segment, std::size_t axis, double u) const {
    const double scale = axes_[axis].steps_per_unit;
    const auto place = [&](double at) { return course_[segment].at(at)[axis] * scale; };
    const double half = std::floor(place(u)) + 0.5;
    double low = std::max(0.0, u - 0.02);
    double high = std::min(1.0, u + 0.02);
    if (!((place(low) < half) != (place(high) < half))) return std::nullopt;
    const bool rises = place(low) < half;
    for (int i = 0; i < 100; ++i) {
      const double middle = low + (high - low) / 2.0;
      ((place(middle) < half) == rises ? low : high) = middle;
    }
    // Where it turns, rounding would decide whether there is a step.
    const Point slope = course_[segment].direction(high);
    return std::abs(slope[axis]) > 0.05 ? std::optional<double>(high) : std::nullopt;
  }

  void drawMarks() {
    for (std::size_t output = 0; output < 2; ++output) {
      std::vector<DrawnMark>& marks = marks_[output];
      marks.clear();
      for (std::size_t i = 0; i < course_.size(); ++i) {
        std::vector<DrawnMark> own;
        if (chance(0.3)) own.push_back({i, 0.0, 0.0, true, 0.0, std::nullopt});
        for (auto left = whole(0, 4); left > 0; --left) {
          DrawnMark mark;
          mark.segment = i;
          mark.u = between(0.01, 0.99);
          const auto axis = number(0, axes_.size() - 1);
          if (chance(0.7)) {
            if (const auto step = atStep(i, axis, mark.u)) {
              mark.u = *step;
              mark.step_of = axis;
            }
          }
          mark.distance = course_[i].distance(mark.u);
          own.push_back(mark);
        }
        std::sort(own.begin(), own.end(),
                  [](const DrawnMark& a, const DrawnMark& b) { return a.distance < b.distance; });
        for (DrawnMark& mark : own) {
          // Two of them at one place are refused.
          if (!marks.empty() && marks.back().segment == i &&
              mark.distance - marks.back().distance < 1e-6) {
            continue;
          }
          mark.tolerance = roundedBy(i, mark.u);
          mark.is_exact = mark.tolerance == 0.0;
          if (mark.distance == 0.0 && i > 0 && isRounded(i - 1)) mark.is_exact = false;
          marks.push_back(mark);
        }
      }
    }
  }

  std::vector<PathSegment> segments(std::size_t from, std::size_t until) const {
    std::vector<PathSegment> made;
    for (std::size_t i = from; i < until; ++i) {
      made.push_back(course_[i].segment(axes_.size()));
      made.back().tolerance = joints_[i].tolerance;
      for (std::size_t output = 0; output < 2; ++output) {
        bool on = false;
        for (const DrawnMark& mark : marks_[output]) {
          on = !on;
          if (mark.segment == i) {
            made.back().outputs.push_back({outputs_[output].name, on, 1.0, mark.distance});
          }
        }
      }
    }
    return made;
  }

  // ---- a motion ----

  void disturb() {
    const double what = unit();
    const std::int64_t now = bench->clock.now();
    const auto note = [&](Kind kind) { disturbances_.push_back({kind, now}); };
    if (what < 0.5) {
      note(Kind::kRate);
      machine().setSpeedOverride(between(0.05, 1.0));
    } else if (what < 0.88) {
      note(Kind::kRate);
      machine().hold();
      if (chance(0.7)) advance(0.3 * unit());
      disturbances_.push_back({Kind::kRate, bench->clock.now()});
      machine().resume();
    } else if (what < 0.91) {
      note(Kind::kStop);
      machine().stop();
    } else if (what < 0.93) {
      note(Kind::kStop);
      bench->axis(axes_.back().name).stop();
    } else if (what < 0.95) {
      note(Kind::kStop);
      bench->axis("x").enable(false);
    } else if (what < 0.97) {
      note(Kind::kTakeOver);
      bench->axis("y").moveTo(between(-0.02, 0.02));
    } else {
      note(Kind::kEmergencyStop);
      machine().emergencyStop();
    }
  }

  void run() {
    PathRequest request;
    for (const config::AxisConfig& axis : axes_) request.names.push_back(axis.name);
    velocity_ = chance(0.3) ? between(0.005, 0.08) : 0.0;
    request.velocity = velocity_;
    std::size_t given = course_.size();
    if (!is_calm_ && chance(0.4)) given = number(1, course_.size());
    request.segments = segments(0, given);
    request.more_follows = given < course_.size();
    leads_ = {};
    if (chance(0.4)) {
      for (std::size_t output = 0; output < 2; ++output) {
        const double lead = between(0.0, 0.05);
        leads_[output] = {lead, std::max(0.0, lead + between(-5e-4, 5e-4))};
        request.leads.push_back({outputs_[output].name, leads_[output][0], leads_[output][1]});
      }
    }
    disturbances_.clear();
    refused_ = test::refusal([&] { move_ = machine().followPath(request); });
    if (!refused_.empty()) return;
    began_ = bench->clock.now();
    const auto append = [&] {
      if (given == course_.size()) return;
      const auto until = number(given + 1, course_.size());
      disturbances_.push_back({Kind::kRate, bench->clock.now()});
      const bool more = until < course_.size();
      refused_ = test::refusal([&] {
        machine().appendPath({move_.id(), segments(given, until), more});
      });
      if (refused_.empty()) given = until;
    };
    for (int i = 0; i < 8 && !is_calm_ && !machine().result(move_); ++i) {
      advance(0.1 * unit() * unit());
      if (chance(0.5)) {
        append();
      } else if (chance(0.8)) {
        test::refusal([&] { disturb(); });
      }
    }
    while (given < course_.size() && !machine().result(move_)) {
      append();
      if (refused_.empty()) continue;
      // Marks that would come too soon, or a path that ends: it has no more segments.
      test::refusal([&] { machine().appendPath({move_.id(), {}, false}); });
      break;
    }
    given_ = given;
    result_ = machine().wait(move_);
    ended_ = bench->clock.now();
    advance(0.2);
  }

  // ---- the judge ----

  struct Edge {
    std::int64_t time_ns = 0;
    bool on = false;
  };
  std::vector<Edge> edges(std::size_t output) const {
    const int pin = bench->trace->pin("outputs", outputs_[output].name);
    std::vector<Edge> all;
    for (const sim::MemoryTrace::Edge& edge : bench->trace->edges()) {
      if (edge.pin != pin) continue;
      all.push_back({edge.time_ns, edge.level == outputs_[output].active_level});
    }
    return all;
  }

  // What the answer says that wasn't made of an output.
  std::uint64_t notMade(std::size_t output) const {
    const std::string words = "; " + outputs_[output].name + " wasn't switched at ";
    const std::size_t found = result_.message.find(words);
    return found == std::string::npos ? 0
                                      : std::stoull(result_.message.substr(found + words.size()));
  }

  /// The first of these that ended the path, or never.
  std::int64_t firstOf(const std::vector<Kind>& kinds) const {
    for (const Disturbance& disturbance : disturbances_) {
      if (std::find(kinds.begin(), kinds.end(), disturbance.kind) != kinds.end()) {
        return disturbance.time_ns;
      }
    }
    return std::numeric_limits<std::int64_t>::max();
  }
  bool isDisturbed(std::int64_t from, std::int64_t until) const {
    return std::any_of(disturbances_.begin(), disturbances_.end(), [&](const Disturbance& each) {
      return each.time_ns >= from && each.time_ns <= until;
    });
  }

  // Whether the axes are at a mark at a time, to within what the trace shows.
  std::string farFrom(const TracedAxes& traced, const DrawnMark& mark, std::int64_t time_ns) {
    const Point place = course_[mark.segment].at(mark.u);
    const bool is_line = course_[mark.segment].shape() == PathSegment::Shape::kLine;
    std::string text;
    for (std::size_t k = 0; k < axes_.size(); ++k) {
      const double scale = axes_[k].steps_per_unit;
      const KnownPlace at = traced.at(k, static_cast<double>(time_ns));
      const double exact = is_line ? kOnLine : kOnCurve;
      const double may = at.error + exact + (2.0 * mark.tolerance + lags_[k].most) * scale;
      const double off = std::abs(at.place - place[k] * scale);
      if (off > may) {
        text += axes_[k].name + " is " + std::to_string(off) + " microsteps off and may be " +
                std::to_string(may) + "; ";
      }
    }
    return text;
  }

  // Whether the shaper doesn't bend the path there: all parts of the motion are on one line.
  bool isUnbent(std::size_t axis, const DrawnMark& mark) const {
    if (lags_[axis].mean == 0.0) return true;
    double speed = 0.0;
    for (const config::AxisConfig& each : axes_) speed = std::hypot(speed, each.max_speed);
    if (velocity_ > 0.0) speed = velocity_;
    const double way = 2.0 * lags_[axis].mean * speed;
    const DrawnSegment& line = course_[mark.segment];
    return lags_[axis].is_same && mark.distance > way && line.distance(1.0) - mark.distance > way;
  }

  // On a line at an even rate, the path is what the axis makes until a time.
  bool isToTheNanosecond(std::size_t axis, const DrawnMark& mark, std::int64_t until) const {
    return course_[mark.segment].shape() == PathSegment::Shape::kLine && !has_jerk_ &&
           axes_[axis].backlash == 0.0 && isUnbent(axis, mark) &&
           (disturbances_.empty() || disturbances_.front().time_ns > until);
  }

  void judgeMade(const TracedAxes& traced, std::size_t output, std::size_t made,
                 const std::vector<Edge>& all) {
    std::int64_t before = began_;
    for (std::size_t i = 0; i < made; ++i) {
      const DrawnMark& mark = marks_[output][i];
      const std::int64_t time = all[i].time_ns;
      ASSERT_EQ(all[i].on, i % 2 == 0);
      ASSERT_GE(time, before) << i;
      before = time;
      const auto lead = std::llround(1e9 * leads_[output][all[i].on ? 0 : 1]);
      ++switched_;
      // A lead that is longer than the way until there, or among commands.
      if (lead > 0 &&
          (!traced.hasMovedBy(time) || isDisturbed(time - 2 * kMillisecond, time + lead)))
        continue;
      const std::string far = farFrom(traced, mark, time + lead);
      ASSERT_EQ(far, "") << "mark " << i << " of " << outputs_[output].name << ", segment "
                         << mark.segment << " at " << mark.u << ", " << time + lead << " ns";
      if (!mark.is_exact || !mark.step_of || traced.sharesMotors(*mark.step_of)) continue;
      ++at_steps_;
      if (!isToTheNanosecond(*mark.step_of, mark, time + lead)) continue;
      const std::int64_t step = traced.motor(*mark.step_of).stepNear(time + lead);
      ASSERT_LE(std::abs(step - time - lead), 1) << "mark " << i;
      ++exact_;
      if (lags_[*mark.step_of].mean > 0.0) ++exact_shaped_;
    }
  }

  // Where the axes were when a mark could be made for the last time: still before it, on the way
  // from the last one that was made.
  void judgeNotMade(const TracedAxes& traced, std::size_t output, std::size_t made,
                    std::int64_t until) {
    const std::vector<DrawnMark>& marks = marks_[output];
    const DrawnMark& next = marks[made];
    std::vector<KnownPlace> at;
    for (std::size_t k = 0; k < axes_.size(); ++k) {
      at.push_back(traced.at(k, static_cast<double>(until)));
    }
    // A lead has switched it before its place.
    const bool is_led = std::max(leads_[output][0], leads_[output][1]) > 0.0;
    const DrawnMark start;
    double nearest = std::numeric_limits<double>::infinity();
    const DrawnMark& last = made > 0 && !is_led ? marks[made - 1] : start;
    for (std::size_t i = last.segment; i <= next.segment; ++i) {
      const double from = i == last.segment ? last.u : 0.0;
      const double to = i == next.segment ? next.u : 1.0;
      const auto parts = 1 + static_cast<int>(course_[i].longest() * (to - from) / 2e-6);
      for (int part = 0; part <= parts; ++part) {
        const Point place = course_[i].at(from + (to - from) * part / parts);
        nearest = std::min(nearest, beyond(at, place, roundedAround(i)));
      }
    }
    ASSERT_LE(nearest, 4e-6) << "[m] from the way to mark " << made << " of "
                             << outputs_[output].name << ", which wasn't made";
  }

  // [m] By how much places are farther from a point than they may be, in the axis that is farthest.
  double beyond(const std::vector<KnownPlace>& at, const Point& point, double rounded) const {
    double most = 0.0;
    for (std::size_t k = 0; k < axes_.size(); ++k) {
      const double scale = axes_[k].steps_per_unit;
      const double off = std::abs(at[k].place / scale - point[k]);
      most = std::max(most, off - (at[k].error + kOnCurve) / scale - rounded - lags_[k].most);
    }
    return most;
  }
  double roundedAround(std::size_t segment) const {
    const double before =
        segment > 0 && isRounded(segment - 1) ? joints_[segment - 1].tolerance : 0.0;
    return std::max(before, isRounded(segment) ? joints_[segment].tolerance : 0.0);
  }

  void judge() {
    const TracedAxes traced(*bench->trace, axes_);
    std::uint64_t made_in_all = 0;
    std::uint64_t all_in_all = 0;
    const std::int64_t stopped = firstOf({Kind::kStop, Kind::kTakeOver});
    const std::int64_t emergency = firstOf({Kind::kEmergencyStop});
    const bool reached = result_.end == axis::MoveEnd::kReached;
    for (std::size_t output = 0; output < 2; ++output) {
      std::vector<DrawnMark>& marks = marks_[output];
      while (!marks.empty() && marks.back().segment >= given_) marks.pop_back();
      all_in_all += marks.size();
      const std::uint64_t not_made = notMade(output);
      ASSERT_LE(not_made, marks.size());
      const std::size_t made = marks.size() - not_made;
      made_in_all += made;
      const std::vector<Edge> all = edges(output);
      std::int64_t safe = emergency;
      if (outputs_[output].at_stop && !reached) safe = std::min(safe, stopped);
      const bool is_safe = safe != std::numeric_limits<std::int64_t>::max();
      ASSERT_EQ(all.size(), made + (is_safe && made % 2 == 1 ? 1 : 0)) << outputs_[output].name;
      if (all.size() > made) {
        ASSERT_GE(all.back().time_ns, safe);
        ASSERT_LE(all.back().time_ns, safe + kMillisecond);
      }
      ASSERT_NO_FATAL_FAILURE(judgeMade(traced, output, made, all));
      if (not_made == 0) continue;
      const bool is_cut = outputs_[output].at_stop.has_value();
      std::int64_t until = std::min(ended_, emergency);
      until = std::min(until, is_cut ? stopped : firstOf({Kind::kTakeOver}));
      ASSERT_NO_FATAL_FAILURE(judgeNotMade(traced, output, made, until));
      not_made_ += static_cast<int>(not_made);
    }
    ASSERT_EQ(result_.marks_made, made_in_all) << result_.message;
    ASSERT_EQ(result_.marks_made + result_.marks_not_made, all_in_all);
    if (reached) {
      ASSERT_EQ(result_.marks_not_made, 0U);
    }
  }

  std::mt19937 random_;
  std::vector<config::AxisConfig> axes_;
  std::vector<config::OutputConfig> outputs_;
  bool has_jerk_ = false;
  bool is_calm_ = false;   // no corner is rounded, and no command comes on the way
  double velocity_ = 0.0;  // [m/s] along the path; 0: what the axes can
  // What an input shaper does to an axis.
  struct Lag {
    double mean = 0.0;  // [s]
    double most = 0.0;  // [m] by which the axis can be off at a mark
    bool is_same = true;
  };
  std::vector<Lag> lags_;
  std::vector<DrawnSegment> course_;
  struct Joint {
    bool is_smooth = false;
    double tolerance = 0.0;
  };
  std::vector<Joint> joints_;  // at the end of each segment
  std::array<std::vector<DrawnMark>, 2> marks_;
  std::array<std::array<double, 2>, 2> leads_{};  // [s] of on and off
  std::vector<Disturbance> disturbances_;
  CoordinatedMove move_;
  CoordinatedResult result_;
  std::string refused_;
  std::size_t given_ = 0;
  std::int64_t began_ = 0;
  std::int64_t ended_ = 0;
  int motions_ = 0;
  int refusals_ = 0;
  int switched_ = 0;
  int at_steps_ = 0;
  int exact_ = 0;
  int exact_shaped_ = 0;
  int not_made_ = 0;
};

TEST_P(RandomPathOutputs, EachMarkComesOnceAtItsPlaceOrIsReported) {
  const int runs = test::runsOf("STEPDRIVER_MOTIONS", 300);
  for (int run_number = 0; run_number < runs; ++run_number) {
    const auto number = static_cast<unsigned>(GetParam() * 10'000 + run_number);
    SCOPED_TRACE(number);
    random_.seed(number);
    drawMachine();
    drawCourse();
    drawMarks();
    run();
    if (!refused_.empty() && given_ == 0) {
      ++refusals_;
      continue;
    }
    ++motions_;
    ASSERT_NO_FATAL_FAILURE(judge());
    given_ = 0;
  }
  RecordProperty("motions", motions_);
  RecordProperty("refused", refusals_);
  RecordProperty("switched", switched_);
  RecordProperty("at_steps", at_steps_);
  RecordProperty("exact", exact_);
  RecordProperty("exact_shaped", exact_shaped_);
  RecordProperty("not_made", not_made_);
  EXPECT_GT(motions_, 0.8 * runs);
  EXPECT_GT(switched_, 10 * motions_);
  EXPECT_GT(not_made_, motions_);
  EXPECT_GT(at_steps_, 5 * motions_);
  EXPECT_GT(exact_, motions_ / 4);
  EXPECT_GT(exact_shaped_, 0);
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomPathOutputs, testing::Range(0, 8));

}  // namespace
}  // namespace stepdriver
