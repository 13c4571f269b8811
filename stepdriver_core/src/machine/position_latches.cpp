#include "position_latches.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "gpio/chip_table.h"
#include "past_position.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {
namespace {

/// The axes of which a latch must know where they were.
template <typename Action>
void forEachWatched(const PositionLatches::Subject& subject, const Action& action) {
  for (axis::AxisModel* axis : subject.axes) action(*axis);
  if (subject.window_axis != nullptr) action(*subject.window_axis);
}

}  // namespace

void PositionLatches::begin(const activity::Context& context, Subject subject,
                            activity::InputEdges edges) {
  if (open_.size() >= kMostOpen) {
    throw Refused(fmt::format("{} latches wait for edges already, the most at once", kMostOpen));
  }
  forEachWatched(subject, [](axis::AxisModel& axis) { axis.motor.watchMotions(); });
  open_.push_back({std::move(subject), edges, {}, false, {}});
  open_.back().edges.begin(context);
}

void PositionLatches::end(std::uint64_t id, const std::string& why) {
  const auto found = std::find_if(open_.begin(), open_.end(),
                                  [id](const Open& open) { return open.subject.id == id; });
  if (found == open_.end()) return;
  conclude(*found, fmt::format("the latch has ended after {} edges: {}", found->result.edges, why));
  open_.erase(found);
}

void PositionLatches::endAll(const std::string& why) {
  while (!open_.empty()) end(open_.back().subject.id, why);
}

std::vector<PositionLatches::Ending> PositionLatches::poll(const activity::Context& context) {
  std::vector<Ending> endings;
  for (Open& open : open_) {
    std::string why = look(context, open);
    if (!why.empty()) endings.push_back({open.subject.axes, std::move(why)});
  }
  open_.erase(
      std::remove_if(open_.begin(), open_.end(), [](const Open& open) { return open.over; }),
      open_.end());
  return endings;
}

std::string PositionLatches::look(const activity::Context& context, Open& open) {
  for (const activity::InputEdges::Edge& edge : open.edges.poll(context)) {
    if (!open.over) latch(context, edge, open);
  }
  const auto& motion = open.subject.motion;
  const auto outcome = motion ? motion->lock() : nullptr;
  const bool moves = outcome != nullptr && !outcome->get();
  if (open.over) {
    conclude(open, open.result.edge->was_read
                       ? "the positions were latched when the input was read: the kernel has "
                         "reported no edge"
                       : "the positions were latched");
    return moves ? "the contact that it probed for has come" : "";
  }
  if (moves && open.edges.error() != 0) {
    open.over = true;
    std::string why = fmt::format("the input {} can't be read: {}", open.subject.input,
                                  gpio::errorText(open.edges.error()));
    conclude(open, why);
    return why;
  }
  // A contact at the end of the motion may still have to be told of.
  if (motion && !moves && !open.motion_ended) open.motion_ended = context.now;
  if (open.motion_ended && !open.edges.changingSince() &&
      context.levels.edgesAddedUntil() >= *open.motion_ended) {
    open.over = true;
    conclude(open, "the motion has ended before a contact");
  }
  return "";
}

void PositionLatches::latch(const activity::Context& context,
                            const activity::InputEdges::Edge& edge, Open& open) {
  const Subject& subject = open.subject;
  const LatchEdge direction = edge.active ? LatchEdge::kActive : LatchEdge::kInactive;
  if (subject.edge != LatchEdge::kEither && subject.edge != direction) return;
  if (subject.window_axis != nullptr) {
    const double place = positionAt(context, *subject.window_axis, edge.time);
    if (!(place >= subject.from && place <= subject.to)) return;
  }
  LatchedEdge latched;
  latched.number = ++open.result.edges;
  latched.active = edge.active;
  latched.time = edge.time;
  latched.was_read = edge.was_read;
  for (const axis::AxisModel* axis : subject.axes) {
    latched.axes.push_back(
        {axis->name(), positionAt(context, *axis, edge.time), axis->position.isValid()});
  }
  open.result.latched = true;
  open.over = !subject.every;
  open.result.edge = latched;
  subject.record->add(std::move(latched));
}

void PositionLatches::conclude(Open& open, const std::string& message) {
  forEachWatched(open.subject, [](axis::AxisModel& axis) { axis.motor.unwatchMotions(); });
  open.result.message = message;
  open.subject.record->end(open.result);
}

pulse::Nanoseconds PositionLatches::edgesDue() const {
  pulse::Nanoseconds due = pulse::kNever;
  for (const Open& open : open_) {
    due = std::min({due, open.edges.edgesDue(), open.motion_ended.value_or(pulse::kNever)});
  }
  return due;
}

pulse::Nanoseconds PositionLatches::due() const {
  pulse::Nanoseconds due = pulse::kNever;
  for (const Open& open : open_) due = std::min(due, open.edges.due());
  return due;
}

}  // namespace stepdriver::machine
