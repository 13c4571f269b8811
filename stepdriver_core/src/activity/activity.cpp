#include "activity.h"

namespace stepdriver::activity {

void Activity::begin(std::vector<Predecessor> predecessors) {
  begun_ = true;
  onBegin(std::move(predecessors));
}

void Activity::poll() {
  if (begun_ && !finished_) onLook();
}

void Activity::extend(const Extension& /*extension*/, const SharedCall& call) {
  call->fail({Failure::Kind::kRefused, axes_.front()->name() + ": it follows no path"});
}

void Activity::end(const EarlyEnd& why, const SharedCall& call) {
  if (finished_) return;
  if (begun_) return onEnd(why, call);
  if (!endsBeforeItBegins()) return;
  onAbandon(why);
  finish();
}

}  // namespace stepdriver::activity
