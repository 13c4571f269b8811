#include "motion_outputs.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "compare_plan.h"
#include "config/least_time.h"
#include "context.h"
#include "message_text.h"
#include "profile/resting_count.h"
#include "stepdriver_core/error.h"

namespace stepdriver::activity {

std::uint64_t MarksOfPath::made() const {
  std::uint64_t sum = 0;
  for (const Part& part : parts) sum += part.made;
  return sum;
}

std::uint64_t MarksOfPath::notMade() const {
  std::uint64_t sum = 0;
  for (const Part& part : parts) sum += part.all - part.made;
  return sum;
}

std::string MarksOfPath::text() const {
  std::string text;
  for (const Part& part : parts) {
    if (part.made == part.all) continue;
    text += fmt::format("; {} wasn't switched at {} of its {} places", part.name,
                        part.all - part.made, part.all);
  }
  return text;
}

MotionOutputs::MotionOutputs(const std::vector<config::OutputConfig>& outputs) {
  for (const config::OutputConfig& config : outputs) {
    Output& output = outputs_.emplace_back();
    output.config = config;
    output.line.why_not = "the machine has not begun";
  }
}

// ---- the engine ----

void MotionOutputs::update(const std::vector<pulse::OutputLineState>& states) {
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    Output& output = outputs_[i];
    const pulse::OutputLineState& state = output.state = states.at(i);
    while (!output.kept.empty() && output.kept.front().serial <= state.taken &&
           (state.reads == 0 || output.kept.front().serial < state.reads)) {
      output.kept.pop_front();
    }
    for (const std::weak_ptr<MarksOfPath>& held : paths_) {
      const std::shared_ptr<MarksOfPath> path = held.lock();
      if (!path) continue;
      for (MarksOfPath::Part& part : path->parts) {
        if (part.output != i) continue;
        if (state.group == path->group) part.made = state.made;
        if (state.ended == path->group) part.made = state.ended_made;
      }
    }
    if (output.taken_by && output.taken_by->ends && state.taken >= *output.taken_by->ends) {
      output.taken_by.reset();
    }
  }
  paths_.erase(
      std::remove_if(paths_.begin(), paths_.end(),
                     [](const std::weak_ptr<MarksOfPath>& path) { return path.expired(); }),
      paths_.end());
}

// ---- the owner of a line ----

std::string MotionOutputs::holder(std::size_t output) const {
  if (const std::string& axis = comparedAxis(output); !axis.empty()) {
    return "the position of " + axis;
  }
  const auto& axes = outputs_[output].taken_by->axes;
  return "a path of " + joinedText(axes, [](const axis::AxisModel* axis) { return axis->name(); });
}

void MotionOutputs::end(Context& context, std::size_t number) {
  Output& output = outputs_[number];
  if (!output.taken_by || output.taken_by->ends) return;
  output.taken_by->ends = ++output.serial;
  if (output.taken_by->compares) output.wanted = false;
  pulse::Command& command = context.out->commands.emplace_back();
  command.kind = pulse::Command::Kind::kEndMarks;
  command.output = number;
  command.serial = output.serial;
}

std::optional<bool> MotionOutputs::takeWanted(std::size_t output) {
  return std::exchange(outputs_[output].wanted, std::nullopt);
}

// ---- the position of an axis ----

const std::string& MotionOutputs::comparedAxis(std::size_t output) const {
  static const std::string none;
  const auto& compared = outputs_[output].compared;
  return compared ? compared->compare.axis : none;
}

void MotionOutputs::compare(std::size_t number, std::optional<config::PositionCompare> compare,
                            std::size_t axis, const SharedCall& call) {
  Output& output = outputs_.at(number);
  if (!compare) {
    output.compared.reset();
    return;
  }
  const std::uint64_t serial = output.compared ? output.compared->serial : 0;
  output.compared = Compared{*std::move(compare), axis, call, true, serial};
}

// Its places are counts, so each order is for one origin and one microstep mode.
bool MotionOutputs::isCurrent(const Output& output, const axis::AxisModel& axis) {
  const Compared& compared = *output.compared;
  return !compared.changed && compared.origin == axis.position.origin() &&
         compared.steps_per_unit == axis.stepsPerUnit();
}

void MotionOutputs::supervise(Context& context, const std::string& why_safe,
                              const std::function<bool(const axis::AxisModel&)>& may) {
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    Output& output = outputs_[i];
    const bool has_it = output.taken_by && output.taken_by->compares;
    if (!output.compared) {
      if (has_it) end(context, i);
      continue;
    }
    const axis::AxisModel& axis = *context.axes.at(output.compared->axis);
    const bool wants = why_safe.empty() && axis.position.isValid() && may(axis);
    if (!wants) {
      output.compared->call.reset();
      if (has_it) end(context, i);
      continue;
    }
    const bool rests = axis.motor.state().following == 0;
    if (!has_it) {
      if (!output.taken_by && output.line.why_not.empty() && rests) {
        orderCompare(context, i, output, axis);
      }
      continue;
    }
    if (output.taken_by->ends) continue;
    const bool is_open = output.state.taken < output.compared->serial;
    const bool lost =
        !is_open && (output.state.compare != output.compared->serial || output.state.muted);
    const bool current = isCurrent(output, axis);
    if (current && !lost) {
      if (!is_open) output.compared->call.reset();
    } else if (rests) {
      orderCompare(context, i, output, axis);
    } else if (!current) {
      end(context, i);
    }
  }
}

std::vector<MotionOutputs::LeftOut> MotionOutputs::leftOut(const axis::AxisModel& axis,
                                                           double joint, double target) const {
  std::vector<LeftOut> all;
  const bool up = target > joint;
  const std::int64_t from = motion::restingCount(joint);
  const std::int64_t to = motion::restingCount(target);
  for (const Output& output : outputs_) {
    if (!output.compared || output.compared->compare.axis != axis.name()) continue;
    if (output.kept.empty() || !output.kept.back().track) continue;
    const auto& edges = output.kept.back().track->edges;
    const auto is_left_out = [&](const pulse::CompareEdge& edge) {
      return edge.at > std::min(from, to) && edge.at <= std::max(from, to) &&
             (up ? edge.up : edge.down) != pulse::CompareAction::kNothing;
    };
    const auto places = std::count_if(edges.begin(), edges.end(), is_left_out);
    if (places > 0) all.push_back({output.config.name, static_cast<std::uint64_t>(places)});
  }
  return all;
}

void MotionOutputs::orderCompare(Context& context, std::size_t number, Output& output,
                                 const axis::AxisModel& axis) {
  Compared& compared = *output.compared;
  const auto track = std::make_shared<const pulse::CompareTrack>(trackOf(compared.compare, axis));
  const auto order = std::make_shared<pulse::Compare>();
  order->output = number;
  order->serial = ++output.serial;
  order->channel = static_cast<int>(compared.axis);
  order->track = track.get();
  order->changes = output.state.changes;
  order->written = output.line.written;
  compared.serial = order->serial;
  compared.changed = false;
  compared.origin = axis.position.origin();
  compared.steps_per_unit = axis.stepsPerUnit();
  Taken taken;
  taken.axes = {&axis};
  taken.compares = true;
  output.taken_by = taken;
  output.wanted.reset();
  output.kept.push_back({order->serial, nullptr, nullptr, nullptr, nullptr, track, order});
  pulse::Command& command = context.out->commands.emplace_back();
  command.kind = pulse::Command::Kind::kCompare;
  command.compare = order.get();
  command.output = number;
  command.serial = order->serial;
}

// ---- a path ----

void MotionOutputs::refuseUnlessFree(const motion::PathMarks& marks, std::uint64_t group,
                                     const std::vector<const axis::AxisModel*>& axes) const {
  for (const motion::OutputMarks& own : marks) {
    const Output& output = outputs_.at(own.output);
    if (output.compared) {
      throw Refused(
          fmt::format("the output {}: {} switches it", output.config.name, holder(own.output)));
    }
    if (has(output, group) && !output.taken_by->ends) continue;
    if (output.taken_by) {
      const auto& others = output.taken_by->axes;
      const bool is_replaced = std::any_of(axes.begin(), axes.end(), [&](const auto* axis) {
        return std::find(others.begin(), others.end(), axis) != others.end();
      });
      if (is_replaced || output.taken_by->ends) continue;
      throw Refused(
          fmt::format("the output {}: {} switches it", output.config.name, holder(own.output)));
    }
    if (!output.line.why_not.empty()) {
      throw Refused(fmt::format("the output {}: {}", output.config.name, output.line.why_not));
    }
  }
}

void MotionOutputs::take(const motion::PathMarks& marks, const std::shared_ptr<MarksOfPath>& path,
                         const std::vector<const axis::AxisModel*>& axes) {
  refuseUnlessFree(marks, path->group, axes);
  if (path->parts.empty()) paths_.emplace_back(path);
  for (const motion::OutputMarks& own : marks) {
    Output& output = outputs_.at(own.output);
    if (!has(output, path->group)) {
      output.taken_by = Taken{path->group, axes, {}};
      output.wanted.reset();
    }
    const auto part = std::find_if(path->parts.begin(), path->parts.end(),
                                   [&](const auto& each) { return each.output == own.output; });
    if (part != path->parts.end()) {
      part->all = own.end();
    } else {
      path->parts.push_back({own.output, output.config.name, own.end(), 0});
    }
  }
}

pulse::Nanoseconds MotionOutputs::mayBegin(const motion::PathMarks& marks) const {
  pulse::Nanoseconds earliest = 0;
  for (const motion::OutputMarks& own : marks) {
    const Output& output = outputs_.at(own.output);
    const pulse::WrittenOutput& last = output.line.written;
    if (own.marks.empty() || own.marks.front().setting.on == last.setting.on) continue;
    const motion::Mark& first = own.marks.front();
    const pulse::Nanoseconds free =
        last.switched + config::leastTime(output.config, last.setting.on).ns;
    const pulse::Nanoseconds after = std::max<std::int64_t>(0, first.place_ns - own.lead(first));
    earliest = std::max(earliest, free - after);
  }
  return earliest;
}

void MotionOutputs::order(std::uint64_t group, const std::shared_ptr<const motion::Profile>& along,
                          const std::shared_ptr<const motion::PathMarks>& marks,
                          const std::shared_ptr<const motion::ShapedAxes>& axes,
                          const std::shared_ptr<std::vector<pulse::FollowMarks>>& command) {
  for (const motion::OutputMarks& own : *marks) {
    Output& output = outputs_.at(own.output);
    if (!has(output, group) || output.taken_by->ends) continue;
    pulse::FollowMarks& follow = command->emplace_back();
    follow.output = own.output;
    follow.serial = ++output.serial;
    follow.group = group;
    follow.along = along.get();
    follow.marks = &own;
    follow.axes = axes.get();
    follow.begins = output.state.group != group && output.state.ended != group;
    follow.changes = output.state.changes;
    follow.written = output.line.written;
    output.kept.push_back({follow.serial, along, marks, axes, command, nullptr, nullptr});
  }
}

bool MotionOutputs::isDue(std::uint64_t group) const {
  return std::any_of(outputs_.begin(), outputs_.end(), [&](const Output& output) {
    return has(output, group) && !output.taken_by->ends && output.state.group == group &&
           output.state.due;
  });
}

void MotionOutputs::stop(Context& context, std::uint64_t group) {
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    Output& output = outputs_[i];
    if (!has(output, group) || output.taken_by->ends || !output.config.at_stop) continue;
    end(context, i);
    output.wanted = output.config.at_stop;
  }
}

void MotionOutputs::leave(Context& context, std::uint64_t group, bool reached) {
  if (!reached) stop(context, group);
  for (std::size_t i = 0; i < outputs_.size(); ++i) {
    if (has(outputs_[i], group)) end(context, i);
  }
}

}  // namespace stepdriver::activity
