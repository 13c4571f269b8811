#include "await_rest.h"

namespace stepdriver::machine {

std::string AwaitRest::text(const AxisWords& /*axes*/) const { return "wait for standstill"; }

void AwaitRest::serve(RequestContext& machine, const SharedCall& call) const {
  machine.awaiting_rest.push_back(call);
}

}  // namespace stepdriver::machine
