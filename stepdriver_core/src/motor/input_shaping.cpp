#include "motor/input_shaping.h"

#include <optional>

namespace stepdriver::motor {
namespace {

motion::InputShaper shaperOf(const config::ShaperConfig& shaper) {
  switch (shaper.type) {
    case config::ShaperType::kZv:
      return motion::InputShaper::zv(shaper.frequency, shaper.damping);
    case config::ShaperType::kMzv:
      return motion::InputShaper::mzv(shaper.frequency, shaper.damping);
    case config::ShaperType::kEi:
      return motion::InputShaper::ei(shaper.frequency, shaper.damping);
    case config::ShaperType::kTwoHumpEi:
      break;
  }
  return motion::InputShaper::twoHumpEi(shaper.frequency, shaper.damping);
}

}  // namespace

std::shared_ptr<const motion::InputShaper> inputShaperOf(const config::AxisConfig& axis) {
  std::optional<motion::InputShaper> all;
  for (const config::ShaperConfig& each : axis.input_shaper) {
    const motion::InputShaper shaper = shaperOf(each);
    all = all ? all->with(shaper) : shaper;
  }
  return all ? std::make_shared<const motion::InputShaper>(*all) : nullptr;
}

double shapingTimeOf(const config::AxisConfig& axis) {
  const auto shaper = inputShaperOf(axis);
  return shaper ? static_cast<double>(shaper->durationNs()) * 1e-9 : 0.0;
}

}  // namespace stepdriver::motor
