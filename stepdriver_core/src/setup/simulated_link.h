#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "port/klipper/link.h"
#include "sim/fake_board.h"

namespace stepdriver::setup {

/// The line to a fake board, which plays in the thread that serves it: on a virtual clock at
/// exactly its times.
class SimulatedLink : public klipper::Link {
 public:
  /// @param board, clock outlive this.
  SimulatedLink(sim::FakeBoard& board, pulse::Clock& clock) : board_(board), clock_(clock) {}

  std::ptrdiff_t write(const std::uint8_t* bytes, std::size_t count) noexcept override {
    board_.play(clock_.now());
    board_.receive(bytes, count);
    return static_cast<std::ptrdiff_t>(count);
  }
  std::ptrdiff_t read(std::uint8_t* bytes, std::size_t most) noexcept override {
    board_.play(clock_.now());
    const std::vector<std::uint8_t> said = board_.take();
    waiting_.insert(waiting_.end(), said.begin(), said.end());
    const std::size_t count = std::min(most, waiting_.size());
    std::copy_n(waiting_.begin(), count, bytes);
    waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(count));
    return static_cast<std::ptrdiff_t>(count);
  }
  void await(pulse::Nanoseconds /*timeout*/) override {}
  pulse::Nanoseconds due() const override { return board_.due(); }

 private:
  sim::FakeBoard& board_;
  pulse::Clock& clock_;
  std::vector<std::uint8_t> waiting_;
};

}  // namespace stepdriver::setup
