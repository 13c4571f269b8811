#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "shaped_profile.h"

namespace stepdriver::motion {

/// The most axes that can share motors.
constexpr std::size_t kMostTerms = 4;

/// The motion of a motor, piece by piece: the sum of the motions of the axes that share it, each
/// times a factor, and each the sum of its shaper's parts. A sum of cubic pieces is a cubic piece,
/// so it is exact, except that jerks are rounded to doubles. It takes the same memory however long
/// the profiles are.
///
/// Doesn't allocate or throw. Only one thread may use it at a time.
class ProfileSum {
 public:
  /// Begins a sum without terms. @param start_ns motion time at which its first piece begins.
  void begin(std::int64_t start_ns);

  /// Adds an axis that moves, or rests. @pre fewer than kMostTerms; next() has not been called.
  /// @param motion lives until the sum ends or the axis rests; it may begin and end at any time.
  void add(double factor, const ShapedProfile& motion);
  void add(double factor, DoubleDouble position);

  /// An axis has come to the end of its motion, and rests there: its profile isn't read any more.
  /// @param term in the order of add().
  void rest(std::size_t term);

  /// Goes to the next piece, at first to the first one. @return false at the end: all terms rest.
  bool next();
  const Piece& piece() const { return piece_; }
  DoubleDouble pieceStart() const { return piece_start_; }  ///< [s] after startNs()
  std::int64_t startNs() const { return start_ns_; }

 private:
  // A term, or one part of a term that is shaped.
  struct Part {
    std::size_t term = 0;
    DoubleDouble factor;
    const Profile* profile = nullptr;  // null: it rests
    DoubleDouble position;             // at which it rests
    DoubleDouble since;                // [s] from the part's start to that of the sum
    std::size_t piece = 0;
  };

  void addPart(DoubleDouble factor, const Profile& profile, std::int64_t start_ns);
  /// Adds the motion of a part from a time on. @return when this motion ends; the time itself if it
  /// doesn't.
  DoubleDouble addPiece(Part& part, DoubleDouble from);

  std::array<Part, kMostTerms * InputShaper::kMostImpulses> parts_{};
  std::size_t size_ = 0;   // the number of parts
  std::size_t terms_ = 0;  // the number of terms that were added
  std::int64_t start_ns_ = 0;
  DoubleDouble piece_start_;
  DoubleDouble piece_end_;
  DoubleDouble velocity_;
  DoubleDouble acceleration_;
  Piece piece_;
};

}  // namespace stepdriver::motion
