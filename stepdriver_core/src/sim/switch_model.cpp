#include "switch_model.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::sim {
namespace {

// Positions are decimal and are reached in steps that binary fractions can't represent. A picometre
// of tolerance keeps a carriage exactly on the switch from being a rounding error short of it.
constexpr double kRounding = 1e-9;

}  // namespace

SwitchModel::SwitchModel(const SwitchSpec& spec, Side side, double carriage)
    : spec_(spec),
      outward_(side == Side::kMax ? 1.0 : -1.0),
      bounce_edges_(spec.bounce_ns > 0 ? 2 * std::int64_t{std::max(spec.bounces, 0)} : 0) {
  pressed_ = isPressedAt(carriage);
}

void SwitchModel::follow(double carriage, std::int64_t time_ns) {
  const bool pressed = isPressedAt(carriage);
  if (pressed == pressed_) return;
  pressed_ = pressed;
  changed_ns_ = time_ns;
}

bool SwitchModel::active(std::int64_t time_ns) const {
  if (isStuck(time_ns)) return *stuck_;
  if (bounce_edges_ == 0) return pressed_;
  const std::int64_t edges = std::min((time_ns - changed_ns_) / spec_.bounce_ns, bounce_edges_);
  return edges % 2 == 0 ? pressed_ : !pressed_;
}

std::int64_t SwitchModel::nextBounce(std::int64_t time_ns) const {
  if (isStuck(time_ns)) return stuck_until_ns_;
  if (bounce_edges_ == 0) return kNever;
  const std::int64_t edge = (time_ns - changed_ns_) / spec_.bounce_ns + 1;
  return edge <= bounce_edges_ ? changed_ns_ + edge * spec_.bounce_ns : kNever;
}

bool SwitchModel::isPressedAt(double carriage) const {
  double outside = outward_ * (spec_.position - carriage);
  if (std::isfinite(spec_.end)) {
    const double middle = (spec_.position + spec_.end) / 2.0;
    double at = carriage - middle;
    if (spec_.every > 0.0) at -= spec_.every * std::round(at / spec_.every);
    outside = std::abs(at) - (spec_.end - spec_.position) / 2.0;
  }
  return outside <= (pressed_ ? spec_.hysteresis : 0.0) + kRounding;
}

}  // namespace stepdriver::sim
