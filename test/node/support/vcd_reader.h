#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace stepdriver::node_test {

/// What a VCD file says of one variable.
struct Waveform {
  struct Edge {
    std::int64_t time_ns;
    bool level;
  };
  std::vector<Edge> edges;  ///< the first is the level at the begin

  bool last() const { return edges.back().level; }
  std::int64_t lastEdgeTime() const { return edges.back().time_ns; }
  /// How often it went to this level.
  std::int64_t changesTo(bool level) const;
};

/// Reads a pin trace as far as these tests need it. @return `axis/variable` -> its waveform.
std::map<std::string, Waveform> readVcd(const std::string& path);

}  // namespace stepdriver::node_test
