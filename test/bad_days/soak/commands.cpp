#include "commands.h"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <utility>

#include "stepdriver_core/error.h"

namespace stepdriver::soak {

axis::Axis& RandomCommands::anyAxis() {
  const auto last = static_cast<std::int64_t>(names_.size()) - 1;
  return machine_.axis(names_[static_cast<std::size_t>(random_.whole(0, last))]);
}

double RandomCommands::velocity(const axis::Axis& axis) {
  return random_.chance(0.5) ? 0.0 : random_.within(0.1, 1.0) * axis.config().max_speed;
}

// There and back, from wherever the axes are: many are refused because of that.
void RandomCommands::trajectory(double begin_in) {
  motion::TrajectoryRequest request;
  request.names = names_;
  request.begin_in = begin_in;
  for (int i = 1; i <= 2; ++i) {
    motion::TrajectoryPoint point;
    point.time = 0.8 * i;
    for (const std::string& name : names_) {
      const double speed = machine_.axis(name).config().max_speed;
      const double from = machine_.axis(name).state().position;
      point.positions.push_back(from + random_.within(-0.2, 0.2) * speed);
      point.velocities.push_back(0.0);
      point.accelerations.push_back(0.0);
    }
    request.points.push_back(std::move(point));
  }
  machine_.followTrajectory(request);
}

// Small squares around wherever the axes are.
void RandomCommands::beginPath() {
  motion::PathRequest request;
  request.names = names_;
  request.relative = true;
  request.tolerance = random_.within(0.0, 0.001);
  request.more_follows = random_.chance(0.8);
  for (const double way : {0.004, 0.0, -0.004}) {
    motion::PathSegment& segment = request.segments.emplace_back();
    for (std::size_t i = 0; i < names_.size(); ++i) {
      segment.end.push_back(i % 2 == 0 ? way : way * way * 500.0);
    }
  }
  path_ = machine_.followPath(request).id();
}

void RandomCommands::appendToPath() {
  motion::PathAppend append{path_, {}, random_.chance(0.7)};
  for (int i = 0; i < 3; ++i) {
    motion::PathSegment& segment = append.segments.emplace_back();
    for (std::size_t k = 0; k < names_.size(); ++k) {
      segment.end.push_back(random_.within(-0.005, 0.005));
    }
  }
  machine_.appendPath(append);
}

bool RandomCommands::isAtRest() const {
  return std::none_of(names_.begin(), names_.end(), [this](const std::string& name) {
    return machine_.axis(name).state().moving;
  });
}

// A path begins at rest, which chance alone rarely finds.
std::string RandomCommands::choose() {
  if (path_is_due_ && isAtRest()) {
    path_is_due_ = false;
    return "path";
  }
  const std::string kind = chooseKind();
  if (kind != "path" || isAtRest()) return kind;
  path_is_due_ = true;
  return "stop all";
}

std::string RandomCommands::chooseKind() {
  struct Weighted {
    const char* name;
    std::int64_t weight;
  };
  static constexpr Weighted kKinds[] = {{"move", 30},
                                        {"relative move", 8},
                                        {"jog", 6},
                                        {"line", 16},
                                        {"trajectory", 8},
                                        {"plan", 2},
                                        {"stop", 4},
                                        {"stop all", 1},
                                        {"hold", 2},
                                        {"resume", 10},
                                        {"speed", 4},
                                        {"limits", 2},
                                        {"disable", 1},
                                        {"enable", 8},
                                        {"emergency stop", 1},
                                        {"recover", 8},
                                        {"later trajectory", 6},
                                        {"path", 6},
                                        {"append", 8}};
  std::int64_t sum = 0;
  for (const Weighted& kind : kKinds) sum += kind.weight;
  std::int64_t left = random_.whole(0, sum - 1);
  for (const Weighted& kind : kKinds) {
    if (left < kind.weight) return kind.name;
    left -= kind.weight;
  }
  return kKinds[0].name;
}

void RandomCommands::send() {
  const std::string kind = choose();
  if (!send(kind) || kind != "path") return;
  for (std::int64_t left = random_.whole(0, 4); left > 0; --left) send("append");
}

bool RandomCommands::send(const std::string& kind) {
  axis::Axis& axis = anyAxis();
  const std::map<std::string, std::function<void()>> commands{
      {"move", [&] { axis.moveTo(place(), false, velocity(axis)); }},
      {"relative move", [&] { axis.moveTo(random_.within(-0.01, 0.01), true, velocity(axis)); }},
      {"jog", [&] { axis.jog(random_.within(-1.0, 1.0) * axis.config().max_speed); }},
      {"line",
       [&] {
         std::vector<double> places;
         for (std::size_t i = 0; i < names_.size(); ++i) places.push_back(place());
         machine_.moveLine({names_, std::move(places)});
       }},
      {"trajectory", [&] { trajectory(0.0); }},
      {"later trajectory", [&] { trajectory(random_.within(0.001, 1.0)); }},
      {"path", [&] { beginPath(); }},
      {"append", [&] { appendToPath(); }},
      {"plan", [&] { axis.plan(place(), false, 0.0); }},
      {"stop", [&] { axis.stop(); }},
      {"stop all", [&] { machine_.stop(); }},
      {"hold", [&] { machine_.hold(); }},
      {"resume", [&] { machine_.resume(); }},
      {"speed", [&] { machine_.setSpeedOverride(random_.within(0.5, 1.5)); }},
      {"limits",
       [&] {
         axis::AxisLimits limits = axis.limits();
         limits.max_speed = random_.within(0.5, 1.0) * axis.config().max_speed;
         axis.setLimits(limits);
       }},
      {"disable", [&] { axis.enable(false); }},
      {"enable", [&] { axis.enable(true); }},
      {"emergency stop", [&] { machine_.emergencyStop(); }},
      {"recover", [&] { machine_.recover(); }},
  };
  try {
    commands.at(kind)();
    ++counts_[kind].accepted;
    return true;
  } catch (const Refused&) {
    ++counts_[kind].refused;
    return false;
  }
}

}  // namespace stepdriver::soak
