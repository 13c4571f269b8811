#include "note_position.h"

#include <fmt/format.h>

namespace stepdriver::machine {

std::string NotePosition::text(const AxisWords& axes) const {
  return fmt::format("note on the position of {}: {}", axes.name(axis), why);
}

void NotePosition::serve(RequestContext& machine, const SharedCall& /*call*/) const {
  machine.axis(axis).position.setNote(why);
}

}  // namespace stepdriver::machine
