#include "begin_latch.h"

#include <fmt/format.h>

#include <utility>

#include "printable.h"

namespace stepdriver::machine {

std::string BeginLatch::text(const AxisWords& words) const {
  return fmt::format("latch {} at {}", words.names(axes), printable(wanted.input));
}

void BeginLatch::begin(RequestContext& machine,
                       std::optional<std::weak_ptr<const Outcome>> motion) const {
  PositionLatches::Subject subject;
  subject.id = id;
  subject.input = printable(wanted.input);
  subject.edge = wanted.edge;
  subject.every = wanted.every;
  for (const AxisId axis : axes) subject.axes.push_back(&machine.axis(axis));
  if (window_axis) {
    subject.window_axis = &machine.axis(*window_axis);
    subject.from = wanted.window->from;
    subject.to = wanted.window->to;
  }
  subject.record = record;
  subject.motion = std::move(motion);
  subject.axes.front()->refuseUnlessOpen();
  machine.latches.begin(machine.context, std::move(subject), machine.named.inputs.edgesOf(input));
}

}  // namespace stepdriver::machine
