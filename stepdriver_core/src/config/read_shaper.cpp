#include "read_shaper.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "bounds.h"
#include "message_text.h"
#include "motion_keys.h"

namespace stepdriver::config {
namespace {

constexpr const char* kKey = "input_shaper";
constexpr Range kFrequencies{kLowestShaperFrequency, kHighestShaperFrequency};
constexpr Range kDampings{0.0, kMostShaperDamping};
constexpr int kMostParts = 16;

struct ShaperName {
  const char* name;
  ShaperType type;
  int parts;  // into which it divides a motion
};
constexpr std::array<ShaperName, 4> kShapers{{{"zv", ShaperType::kZv, 2},
                                              {"mzv", ShaperType::kMzv, 3},
                                              {"ei", ShaperType::kEi, 3},
                                              {"2hump_ei", ShaperType::kTwoHumpEi, 4}}};

std::vector<std::string> typeNames() {
  std::vector<std::string> all;
  all.reserve(kShapers.size());
  for (const ShaperName& shaper : kShapers) all.emplace_back(shaper.name);
  return all;
}

class ShaperReader {
 public:
  ShaperReader(ConfigReader& axis, AxisConfig& config) : axis_(axis), config_(config) {}

  void read() {
    const ConfigValue& value = axis_.value(kKey);
    const auto* list = value.as<ConfigValue::List>();
    if (list == nullptr && value.as<ConfigValue::Map>() == nullptr) {
      return axis_.issue(kKey, fmt::format("is {}, but must be a map with type and frequency, or a "
                                           "list of such maps",
                                           value.shown()));
    }
    if (list == nullptr) {
      readOne(ConfigReader(value, axis_.fullName(kKey), axis_.issues()));
    } else if (list->empty()) {
      axis_.issue(kKey, "is empty, but must have a map with type and frequency");
    } else {
      for (std::size_t i = 0; i < list->size(); ++i) {
        const std::string name = fmt::format("{}[{}]", axis_.fullName(kKey), i);
        readOne(ConfigReader((*list)[i], name, axis_.issues()));
      }
    }
    checkParts();
  }

 private:
  void readOne(ConfigReader reader) {
    if (!reader.isMap()) return;
    const auto type = reader.findOneOf("type", typeNames(), Presence::kRequired);
    const std::vector<double> frequencies = readFrequencies(reader);
    const double damping = reader.number("damping", kDampings, ShaperConfig{}.damping);
    reader.rejectUnknown();
    if (!type) return;
    for (const ShaperName& shaper : kShapers) {
      if (*type != shaper.name) continue;
      for (const double frequency : frequencies) {
        config_.input_shaper.push_back({shaper.type, frequency, damping});
        parts_ *= shaper.parts;
      }
    }
  }

  std::vector<double> readFrequencies(ConfigReader& reader) {
    const auto* list = reader.value("frequency").as<ConfigValue::List>();
    if (list == nullptr || list->empty()) {
      const auto one = reader.findNumber("frequency", kFrequencies, Presence::kRequired);
      return one ? std::vector<double>{*one} : std::vector<double>{};
    }
    reader.allow("frequency");
    std::vector<double> frequencies;
    for (const ConfigValue& value : *list) {
      const int* integer = value.as<int>();
      const double* real = value.as<double>();
      const double number = integer != nullptr ? *integer : real != nullptr ? *real : std::nan("");
      if (!kFrequencies.holds(number)) {
        reader.issue("frequency",
                     fmt::format("has {}, but must have numbers from {} to {} only", value.shown(),
                                 numberText(kFrequencies.min), numberText(kFrequencies.max)));
        return {};
      }
      frequencies.push_back(number);
    }
    return frequencies;
  }

  void checkParts() {
    if (parts_ <= kMostParts) return;
    axis_.issue(kKey, fmt::format("divides each motion into {:.0f} parts, but may divide it into "
                                  "{} at most: zv has 2 for each frequency, mzv and ei have 3, and "
                                  "2hump_ei has 4, and several multiply",
                                  parts_, kMostParts));
  }

  ConfigReader& axis_;
  AxisConfig& config_;
  double parts_ = 1.0;
};

}  // namespace

std::string shaperText(ShaperType type) {
  const auto* const shaper =
      std::find_if(kShapers.begin(), kShapers.end(),
                   [type](const ShaperName& known) { return known.type == type; });
  return shaper != kShapers.end() ? shaper->name : "";
}

void readShaper(ConfigReader& axis, std::optional<Kind> kind, AxisConfig& config) {
  axis.allow(kKey);
  if (!axis.has(kKey)) return;
  ShaperReader(axis, config).read();
  if (!kind) return;
  const MotionKeys& keys = motionKeys(*kind);
  if (config.start_speed > 0.0) {
    axis.contradiction(
        keys.start_speed,
        fmt::format("is {}, but must be 0 with {}: divided into parts, the jump to this speed "
                    "would come when the motor already moves",
                    axis.shown(keys.start_speed), axis.fullName(kKey)));
  }
  if (config.backlash > 0.0) {
    axis.contradiction(
        keys.backlash,
        fmt::format("is {}, but must be 0 with {}: divided into parts, a reversal might not take "
                    "up all of it",
                    axis.shown(keys.backlash), axis.fullName(kKey)));
  }
}

}  // namespace stepdriver::config
