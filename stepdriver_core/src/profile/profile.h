#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <memory>
#include <variant>
#include <vector>

#include "math/double_double.h"

namespace stepdriver::motion {

/// A cubic piece of position over time: p0 + v0 t + a t^2/2 + j t^3/6 for t from 0 to duration.
struct Piece {
  DoubleDouble duration;  ///< [s]
  DoubleDouble p0;        ///< [microsteps]
  double v0 = 0.0;        ///< [microsteps/s]
  double a = 0.0;         ///< [microsteps/s^2]
  double j = 0.0;         ///< [microsteps/s^3]
  double v0_rest = 0.0;   ///< the exact speed minus v0
  double a_rest = 0.0;    ///< the exact acceleration minus a

  /// At t [s] from the beginning of the piece, in the units of p0, v0 and a.
  DoubleDouble positionAt(DoubleDouble t) const;
  DoubleDouble velocityAt(DoubleDouble t) const;
  DoubleDouble accelerationAt(DoubleDouble t) const;

  /// The first time after `after` [s] and before the end at which the velocity changes its sign;
  /// the end if there is none. To go from turn to turn, begin with 0 and continue with each result.
  double firstTurn(double after) const;
};

/// The state of a motion at one time.
struct MotionState {
  DoubleDouble position;      ///< [microsteps]
  double velocity = 0.0;      ///< [microsteps/s]
  double acceleration = 0.0;  ///< [microsteps/s^2]
};

class Profile;

/// A part of a shared profile, at a constant rate: the pieces from `from` to `to`, each `rate`
/// times as fast. It takes the same memory however long it is; its pieces are computed on demand.
struct Excerpt {
  std::shared_ptr<const Profile> of;  ///< the profile, which moves
  DoubleDouble from;                  ///< [s] after its start, before its end
  DoubleDouble to;                    ///< [s] later; at most its end, apart from rounding
  DoubleDouble rate = 1.0;            ///< above 0
  DoubleDouble shift = {};            ///< [microsteps] added to its positions
};

/// The parts of a motion, in the order of time: pieces and excerpts.
class Sections {
 public:
  void add(const Piece& piece) { add(std::vector<Piece>{piece}); }
  void add(const std::vector<Piece>& pieces);
  void add(Excerpt excerpt);
  bool empty() const { return sections_.empty(); }

 private:
  friend class Profile;
  std::vector<std::variant<std::vector<Piece>, Excerpt>> sections_;
};

/// A motion: a sequence of pieces from a start time on, at rest before and after. Times are motion
/// time, in nanoseconds. It is immutable, so any thread may read it; reading allocates nothing.
///
/// For an excerpt, a profile stores only the position and the rate. Finding a piece by its number
/// or its time still takes O(log n).
class Profile {
 public:
  /// A motion that rests at `position`.
  Profile(std::int64_t start_ns, DoubleDouble position);

  /// @param pieces each begins where the one before it ends; at least one.
  /// @throw motion::TooLong if the motion takes longer than kLongest.
  Profile(std::int64_t start_ns, std::vector<Piece> pieces);

  /// @param sections not empty; each begins where the one before it ends.
  /// @throw motion::TooLong if the motion takes longer than kLongest.
  Profile(std::int64_t start_ns, Sections sections);

  static constexpr double kLongest = 4.0e9;  ///< [s] more than 126 years; nanoseconds fit in int64

  /// Motion time at which the first piece begins.
  std::int64_t startNs() const { return start_ns_; }
  /// The end of the motion, to the nearest nanosecond. No step is later.
  std::int64_t endNs() const { return end_ns_; }
  DoubleDouble duration() const { return duration_; }  ///< [s]
  /// The final position [microsteps].
  DoubleDouble startPosition() const { return pieceCount() == 0 ? end_position_ : piece(0).p0; }
  DoubleDouble endPosition() const { return end_position_; }
  /// The highest speed [microsteps/s]. For an excerpt, the highest speed of its whole profile
  /// counts.
  double peakSpeed() const { return peak_speed_; }

  /// The state at a time. Before the start and after the end, the motion is at rest.
  MotionState stateAt(std::int64_t time_ns) const;

  std::size_t pieceCount() const { return piece_count_; }
  Piece piece(std::size_t index) const;
  /// The time at which a piece begins, counted from the start [s]. With the index after the last
  /// piece it is the end.
  DoubleDouble pieceStart(std::size_t index) const;
  /// The piece at a time after the start [s]. Before the start it is the first one, after the end
  /// the last one. @pre there are pieces.
  std::size_t pieceAt(DoubleDouble time) const;

  class Pieces;
  /// The pieces in the order of time; empty if nothing moves. The profile must outlive them.
  Pieces pieces() const;

 private:
  // Where the pieces from `first` on are: in `of`, or if that is null, in pieces_ from `own` on.
  struct Section {
    std::size_t first = 0;
    DoubleDouble start;  // s
    std::size_t own = 0;
    std::shared_ptr<const Profile> of;
    DoubleDouble from;
    DoubleDouble to;
    DoubleDouble rate;
    DoubleDouble shift;
    std::size_t of_first = 0;  // the piece of `of` at which this begins
    std::size_t of_last = 0;
  };

  void add(std::vector<Piece> pieces);
  void add(const Excerpt& excerpt);
  void finish();
  const Section* sectionOf(std::size_t piece) const;
  static Piece excerptPiece(const Section& section, std::size_t index);

  std::int64_t start_ns_;
  std::int64_t end_ns_;
  DoubleDouble start_position_;
  DoubleDouble end_position_;
  DoubleDouble duration_;
  double peak_speed_ = 0.0;
  std::size_t piece_count_ = 0;
  std::vector<Piece> pieces_;
  std::vector<DoubleDouble> starts_;  // the starts of pieces_
  std::vector<Section> sections_;     // empty: all pieces are in pieces_
};

/// The pieces of a profile as a container that makes its elements on demand.
class Profile::Pieces {
 public:
  /// Goes from piece to piece.
  class Iterator {
   public:
    using iterator_category = std::input_iterator_tag;
    using value_type = Piece;
    using difference_type = std::ptrdiff_t;
    using pointer = const Piece*;
    using reference = Piece;

    Iterator(const Profile& profile, std::size_t index) : profile_(&profile), index_(index) {}
    Piece operator*() const { return profile_->piece(index_); }
    Iterator& operator++() {
      ++index_;
      return *this;
    }
    bool operator==(const Iterator& other) const { return index_ == other.index_; }
    bool operator!=(const Iterator& other) const { return index_ != other.index_; }

   private:
    const Profile* profile_;
    std::size_t index_;
  };

  explicit Pieces(const Profile& profile) : profile_(profile) {}
  std::size_t size() const { return profile_.pieceCount(); }
  bool empty() const { return size() == 0; }
  Piece operator[](std::size_t index) const { return profile_.piece(index); }
  Piece front() const { return profile_.piece(0); }
  Piece back() const { return profile_.piece(size() - 1); }
  Iterator begin() const { return {profile_, 0}; }
  Iterator end() const { return {profile_, size()}; }

 private:
  const Profile& profile_;
};

inline Profile::Pieces Profile::pieces() const { return Pieces(*this); }

}  // namespace stepdriver::motion
