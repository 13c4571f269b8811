#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "motion/profile.h"

namespace stepdriver::motion {

/// The most axes that can share motors.
constexpr std::size_t kMostTerms = 4;

/// The motion of a motor that several axes share: the sum of their profiles, each times a factor,
/// piece by piece. A sum of cubic pieces is a cubic piece, so it is exact, except that jerks are
/// rounded to doubles. It takes the same memory however long the profiles are.
///
/// Doesn't allocate or throw. Only one thread may use it at a time.
class ProfileSum {
 public:
  /// Begins a sum without terms. @param start_ns motion time at which its first piece begins.
  void begin(std::int64_t start_ns);

  /// Adds an axis that follows a profile, or rests. @pre fewer than kMostTerms; next() has not been
  /// called.
  /// @param profile lives until the sum ends or the axis rests; it may begin and end at any time.
  void add(double factor, const Profile& profile);
  void add(double factor, DoubleDouble position);

  /// An axis has come to the end of its profile, and rests there: the profile isn't read any more.
  /// @param term in the order of add().
  void rest(std::size_t term);

  /// Goes to the next piece, at first to the first one. @return false at the end: all terms rest.
  bool next();
  const Piece& piece() const { return piece_; }
  DoubleDouble pieceStart() const { return piece_start_; }  ///< [s] after startNs()
  std::int64_t startNs() const { return start_ns_; }

 private:
  struct Term {
    double factor = 0.0;
    const Profile* profile = nullptr;  // null: it rests
    DoubleDouble position;             // at rest
    DoubleDouble since;                // s from the profile's start to that of the sum
    std::size_t piece = 0;
  };

  /// Adds what a term does from a time on. @return when that ends; the time itself: never.
  DoubleDouble addPiece(Term& term, DoubleDouble from);

  std::array<Term, kMostTerms> terms_{};
  std::size_t size_ = 0;
  std::int64_t start_ns_ = 0;
  DoubleDouble piece_start_;
  DoubleDouble piece_end_;
  DoubleDouble velocity_;
  DoubleDouble acceleration_;
  Piece piece_;
};

}  // namespace stepdriver::motion
