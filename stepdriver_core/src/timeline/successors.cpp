#include "timeline/successors.h"

#include <algorithm>

namespace stepdriver::pulse {

void Successors::add(const Entry& entry) {
  while (size_ > 0 && last().profile.startNs() >= entry.profile.startNs()) --size_;
  entries_[size_++] = entry;
}

Successors::Entry Successors::takeFirst() {
  const Entry first = entries_[0];
  std::copy(entries_.begin() + 1, entries_.begin() + static_cast<std::ptrdiff_t>(size_),
            entries_.begin());
  --size_;
  return first;
}

}  // namespace stepdriver::pulse
