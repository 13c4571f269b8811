#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// The times at which channels are due, as a binary tree in which each node is the earlier of the
/// two below it. A change costs at most log2 of the number of channels, and the due channels are
/// found without examining the others.
class DueTree {
 public:
  /// @param count of the channels; initially no channel is ever due.
  explicit DueTree(std::size_t count) {
    while (leaves_ < count) leaves_ *= 2;
    nodes_.assign(2 * leaves_, kNever);
  }

  /// The earliest time of all channels; kNever if none is due.
  Nanoseconds earliest() const { return nodes_[1]; }
  Nanoseconds operator[](std::size_t channel) const { return nodes_[leaves_ + channel]; }

  /// Changes the time of a channel.
  void set(std::size_t channel, Nanoseconds due) {
    std::size_t node = leaves_ + channel;
    nodes_[node] = due;
    for (; node > 1; node /= 2) {
      const Nanoseconds earlier = std::min(nodes_[node], nodes_[node ^ 1]);
      if (nodes_[node / 2] == earlier) return;
      nodes_[node / 2] = earlier;
    }
  }

  /// Adds the channels that are due at `now` to `channels`, in their order.
  void collect(Nanoseconds now, std::vector<std::size_t>& channels) const {
    if (nodes_[1] > now) return;
    // The descent to the first of them has no branch on the times: no processor can predict which
    // channel comes next, and one wrong prediction costs more than the whole descent.
    std::size_t node = 1;
    std::size_t several = 0;
    while (node < leaves_) {
      node *= 2;
      const std::size_t left = nodes_[node] <= now ? 1 : 0;
      const std::size_t right = nodes_[node + 1] <= now ? 1 : 0;
      several |= left & right;
      node += 1 - left;
    }
    if (several != 0) {
      collectBelow(1, now, channels);
    } else {
      channels.push_back(node - leaves_);
    }
  }

 private:
  void collectBelow(std::size_t node, Nanoseconds now, std::vector<std::size_t>& channels) const {
    if (nodes_[node] > now) return;
    if (node >= leaves_) {
      channels.push_back(node - leaves_);
      return;
    }
    collectBelow(2 * node, now, channels);
    collectBelow(2 * node + 1, now, channels);
  }

  std::size_t leaves_ = 1;
  std::vector<Nanoseconds> nodes_;  // the root is the first one, and below n are 2 n and 2 n + 1
};

}  // namespace stepdriver::pulse
