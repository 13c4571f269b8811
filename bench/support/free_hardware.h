#pragma once

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <string>

#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::bench {

/// Lines that take no time: they count what is written, and inputs read low.
class FreeLines : public gpio::Lines {
 public:
  int write(const gpio::LineWrite* /*writes*/, std::size_t count) noexcept override {
    ++writes;
    edges += count;
    return 0;
  }
  int read(int /*input*/) noexcept override { return 0; }
  int waitForEdges(std::int64_t /*timeout_ns*/, gpio::EdgeEvent* /*events*/,
                   std::size_t /*capacity*/) noexcept override {
    return -ENOTSUP;
  }
  void interrupt() noexcept override {}
  const std::string& outputName(int /*output*/) const override { return name_; }
  const std::string& inputName(int /*input*/) const override { return name_; }

  std::uint64_t writes = 0;
  std::uint64_t edges = 0;

 private:
  const std::string name_ = "a line that costs nothing";
};

/// A clock that takes no time: each wait ends at once, at its exact time.
class FreeClock : public pulse::Clock {
 public:
  pulse::Nanoseconds now() override { return now_; }
  void waitUntil(pulse::Nanoseconds time) override {
    if (time > now_ && time != pulse::kNever) now_ = time;
  }
  void wake() override {}

 private:
  pulse::Nanoseconds now_ = 0;
};

}  // namespace stepdriver::bench
