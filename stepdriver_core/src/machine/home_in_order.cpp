#include "home_in_order.h"

#include <algorithm>
#include <map>
#include <string>

#include "stepdriver_core/error.h"

namespace stepdriver::machine {
namespace {

using Group = std::vector<axis::Axis*>;

/// The axes by their order. @throw Refused where one can't be homed.
std::map<int, Group> groupsOf(const std::vector<axis::Axis*>& axes) {
  std::map<int, Group> groups;
  for (axis::Axis* axis : axes) {
    axis->checkHoming();
    groups[axis->config().homing->order].push_back(axis);
  }
  return groups;
}

std::vector<axis::HomingResult> notHomed(const Group& group, axis::HomingEnd end,
                                         const std::string& why) {
  std::vector<axis::HomingResult> results;
  for (const axis::Axis* axis : group) {
    const std::string& name = axis->config().name;
    results.push_back({name, end, name + " isn't homed: " + why, axis->state().position});
  }
  return results;
}

}  // namespace

std::vector<axis::HomingResult> homeInOrder(const std::vector<axis::Axis*>& axes,
                                            const std::function<bool()>& cancelled) {
  std::vector<axis::HomingResult> all;
  for (const auto& [order, group] : groupsOf(axes)) {
    const auto failed = std::find_if(all.begin(), all.end(), [](const axis::HomingResult& result) {
      return result.end != axis::HomingEnd::kHomed;
    });
    std::vector<axis::HomingResult> results;
    if (failed != all.end()) {
      results = notHomed(group, failed->end, failed->axis + " comes before it, and isn't homed");
    } else if (all.empty()) {
      results = axis::Axis::homeTogether(group, cancelled);
    } else {
      // Others have moved by now: what has come in between is how this one ended.
      try {
        results = axis::Axis::homeTogether(group, cancelled);
      } catch (const Refused& refused) {
        results = notHomed(group, axis::HomingEnd::kFailed, refused.what());
      }
    }
    all.insert(all.end(), results.begin(), results.end());
  }
  return all;
}

}  // namespace stepdriver::machine
