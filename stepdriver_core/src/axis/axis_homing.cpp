#include "axis_impl.h"
#include "homing.h"

namespace stepdriver::axis {

HomingResult Axis::home(const std::function<bool()>& cancelled) {
  return homeTogether({this}, cancelled).front();
}

std::vector<HomingResult> Axis::homeTogether(const std::vector<Axis*>& axes,
                                             const std::function<bool()>& cancelled) {
  std::vector<std::unique_ptr<Homing>> homings;
  for (Axis* axis : axes) homings.push_back(std::make_unique<Homing>(*axis->impl_));
  return Homing::run(homings, cancelled);
}

void Axis::checkHoming() const {
  const std::lock_guard<std::mutex> lock(impl_->mutex);
  Homing::refuseUnlessReady(*impl_);
}

const HomingConfig& Axis::Impl::homingConfig() const {
  if (!config.homing) refuse("homing isn't configured");
  return *config.homing;
}

void Axis::Impl::interruptHoming(const std::string& why) const {
  if (homing != nullptr) homing->interrupt(why);
}

void Axis::Impl::refuseUnlessHomed() const {
  if (!config.require_homing || homed) return;
  refuse("it isn't homed, and require_homing allows absolute positions only then; home it first");
}

}  // namespace stepdriver::axis
