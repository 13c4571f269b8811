#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace stepdriver::node_test {

/// The changes of one variable in a VCD file.
struct Waveform {
  struct Edge {
    std::int64_t time_ns;
    bool level;
  };
  std::vector<Edge> edges;  ///< the first is the initial level
  bool both_edges = false;  ///< each edge is a step, as the file says

  bool last() const { return edges.back().level; }
  std::int64_t lastEdgeTime() const { return edges.back().time_ns; }
  /// The number of changes to this level.
  std::int64_t changesTo(bool level) const;
};

/// Reads a pin trace as far as these tests need it.
/// @return the waveforms, by `axis/variable`.
std::map<std::string, Waveform> readVcd(const std::string& path);

}  // namespace stepdriver::node_test
