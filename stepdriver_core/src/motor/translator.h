#pragma once

#include <cstdint>

namespace stepdriver::motor {

/// The chip's translator: the microstep mode, and a count at which it is at Home, its state after
/// power-up, RESET and SLEEP.
class Translator {
 public:
  explicit Translator(int microsteps) : microsteps_(microsteps) {}

  int microsteps() const { return microsteps_; }

  /// Whether the translator is at Home at this count.
  bool isAtHome(std::int64_t count) const;
  /// [microsteps] Its place in the electrical cycle at this count, from Home.
  std::int64_t placeAt(std::int64_t count) const;
  /// It has gone Home, with the motor at this count.
  void wentHome(std::int64_t count) { home_count_ = count; }

  /// The position nearest to a count that another mode has too.
  std::int64_t nearestCommon(std::int64_t count, int wanted) const;

  /// The effect of a mode change on counts.
  struct Change {
    int microsteps = 1;
    std::int64_t home_count = 0;
    std::int64_t count = 0;  ///< the motor's count, in the new mode
    bool home_stays = true;  ///< false: the counting restarts from Home
  };
  /// @pre the count is a position of both modes.
  Change changeTo(int wanted, std::int64_t count) const;
  void changed(const Change& change);

 private:
  int microsteps_;
  std::int64_t home_count_ = 0;
};

}  // namespace stepdriver::motor
