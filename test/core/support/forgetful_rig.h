#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <utility>

#include "stepdriver_core/sim/rig.h"

namespace stepdriver::test {

/// A rig of which the kernel doesn't report some edges.
class ForgetfulRig : public sim::Rig {
 public:
  using sim::Rig::Rig;
  /// @param loses whether the edge with this number, from 1, is lost.
  void forget(std::function<bool(int)> loses) { loses_ = std::move(loses); }
  void watchInput(int line, gpio::EdgeListener listener) override {
    if (!listener) return sim::Rig::watchInput(line, nullptr);
    sim::Rig::watchInput(line, [this, line, listener](bool level, std::int64_t time_ns) {
      if (loses_(++edges_)) {
        lost_[line] = {time_ns + late_ns_, !level};
      } else {
        lost_.erase(line);
        listener(level, time_ns);
      }
    });
  }
  /// Lost edges are seen by whoever reads only so much later, as by a busy computer.
  void readLate(std::int64_t time_ns) { late_ns_ = time_ns; }
  bool inputLevel(int line, std::int64_t time_ns) override {
    const auto lost = lost_.find(line);
    if (lost != lost_.end() && time_ns < lost->second.seen_at) return lost->second.level_before;
    return sim::Rig::inputLevel(line, time_ns);
  }

 private:
  struct Lost {
    std::int64_t seen_at;
    bool level_before;
  };
  std::function<bool(int)> loses_ = [](int) { return false; };
  int edges_ = 0;
  std::int64_t late_ns_ = 0;
  std::map<int, Lost> lost_;  // the latest edge of each line, if it is lost
};

}  // namespace stepdriver::test
