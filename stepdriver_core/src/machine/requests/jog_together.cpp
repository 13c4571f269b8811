#include "jog_together.h"

#include "message_text.h"
#include "streamed_start.h"

namespace stepdriver::machine {

std::string JogTogether::text(const AxisWords& axes) const {
  return joinedText(jogs, [&](const Jog& jog) { return jog.text(axes); });
}

void JogTogether::serve(RequestContext& machine, const SharedCall& call) const {
  beginStreamed(machine, jogs, call, [&machine](const Jog& jog, const SharedCall& part) {
    return jog.goalOf(machine, part);
  });
}

}  // namespace stepdriver::machine
