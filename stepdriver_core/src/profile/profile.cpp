#include "profile.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "double_piece.h"
#include "errors.h"
#include "negligible_time.h"

namespace stepdriver::motion {

DoubleDouble Piece::positionAt(DoubleDouble t) const {
  // Horner's method without zero terms: most pieces have no jerk, and many have no acceleration.
  DoubleDouble bend(0.5 * a, 0.5 * a_rest);
  if (j != 0.0) bend = bend + t * (0.5 * j) * third<DoubleDouble>();
  DoubleDouble slope(v0, v0_rest);
  if (bend.hi != 0.0) slope = slope + t * bend;
  return p0 + t * slope;
}

DoubleDouble Piece::velocityAt(DoubleDouble t) const {
  return DoubleDouble(v0, v0_rest) + t * (DoubleDouble(a, a_rest) + t * (0.5 * j));
}

DoubleDouble Piece::accelerationAt(DoubleDouble t) const { return DoubleDouble(a, a_rest) + t * j; }

double Piece::firstTurn(double after) const {
  const double end = duration.value();
  double first = end;
  const auto consider = [&](double root) {
    if (root > after && root < end) first = std::min(first, root);
  };
  if (j == 0.0) {
    if (a != 0.0) consider(-v0 / a);
    return first;
  }
  const double discriminant = a * a - 2.0 * j * v0;
  if (discriminant <= 0.0) return first;  // it never turns, or it only touches a velocity of 0
  const double q = -(a + std::copysign(std::sqrt(discriminant), a));
  consider(q / j);
  if (q != 0.0) consider(2.0 * v0 / q);
  return first;
}

void Sections::add(const std::vector<Piece>& pieces) {
  if (pieces.empty()) return;
  if (sections_.empty() || !std::holds_alternative<std::vector<Piece>>(sections_.back())) {
    sections_.emplace_back(pieces);
    return;
  }
  auto& last = std::get<std::vector<Piece>>(sections_.back());
  last.insert(last.end(), pieces.begin(), pieces.end());
}

void Sections::add(Excerpt excerpt) { sections_.emplace_back(std::move(excerpt)); }

Profile::Profile(std::int64_t start_ns, DoubleDouble position)
    : start_ns_(start_ns), end_ns_(start_ns), start_position_(position), end_position_(position) {}

Profile::Profile(std::int64_t start_ns, std::vector<Piece> pieces) : start_ns_(start_ns) {
  add(std::move(pieces));
  finish();
}

Profile::Profile(std::int64_t start_ns, Sections sections) : start_ns_(start_ns) {
  for (auto& section : sections.sections_) {
    Section next;
    next.first = piece_count_;
    next.start = duration_;
    next.own = pieces_.size();
    sections_.push_back(std::move(next));
    if (const auto* excerpt = std::get_if<Excerpt>(&section)) {
      add(*excerpt);
    } else {
      add(std::move(std::get<std::vector<Piece>>(section)));
    }
  }
  finish();
}

void Profile::add(std::vector<Piece> pieces) {
  starts_.reserve(starts_.size() + pieces.size());
  for (const Piece& piece : pieces) {
    starts_.push_back(duration_);
    duration_ = duration_ + piece.duration;
    const DoublePiece rough(piece);
    peak_speed_ = std::max(peak_speed_, rough.highestSpeed(0.0, rough.duration));
  }
  piece_count_ += pieces.size();
  if (pieces_.empty()) {
    pieces_ = std::move(pieces);
  } else {
    pieces_.insert(pieces_.end(), pieces.begin(), pieces.end());
  }
}

void Profile::add(const Excerpt& excerpt) {
  const Profile& of = *excerpt.of;
  Section& section = sections_.back();
  section.of = excerpt.of;
  section.from = excerpt.from;
  section.to = excerpt.to;
  section.rate = excerpt.rate;
  section.shift = excerpt.shift;
  // A piece that is only a rounding error is ignored.
  std::size_t first = of.pieceAt(excerpt.from);
  if (first + 1 < of.pieceCount() &&
      !((of.pieceStart(first + 1) - excerpt.from).hi > kNegligibleTime)) {
    ++first;
  }
  std::size_t last = of.pieceAt(excerpt.to);
  if (last > first && !((excerpt.to - of.pieceStart(last)).hi > kNegligibleTime)) --last;
  section.of_first = first;
  section.of_last = last;
  piece_count_ += last - first + 1;
  duration_ = duration_ + (excerpt.to - excerpt.from) / excerpt.rate;
  peak_speed_ = std::max(peak_speed_, excerpt.rate.value() * of.peak_speed_);
}

void Profile::finish() {
  if (!(duration_.hi < kLongest)) {
    throw TooLong("the motion takes longer than a hundred years");
  }
  end_ns_ = start_ns_ + splitNanoseconds(duration_).whole;
  start_position_ = piece(0).p0;
  const Piece last = piece(piece_count_ - 1);
  end_position_ = last.positionAt(last.duration);
}

// nullptr if all pieces are its own.
const Profile::Section* Profile::sectionOf(std::size_t piece) const {
  const Section* section = nullptr;
  for (const Section& next : sections_) {
    if (next.first > piece) break;
    section = &next;
  }
  return section;
}

Piece Profile::excerptPiece(const Section& section, std::size_t index) {
  const Profile& of = *section.of;
  const Piece whole = of.piece(index);
  const bool first = index == section.of_first;
  const bool last = index == section.of_last;
  const DoubleDouble rate = section.rate;
  const bool as_it_is = rate.hi == 1.0 && rate.lo == 0.0 && section.shift.hi == 0.0;
  if (as_it_is && !first && !last) return whole;
  const DoubleDouble start = of.pieceStart(index);
  const DoubleDouble from = first ? section.from - start : DoubleDouble();
  const DoubleDouble to = last ? section.to - start : whole.duration;
  const DoubleDouble velocity = rate * whole.velocityAt(from);
  const DoubleDouble acceleration = rate * rate * whole.accelerationAt(from);
  const double jerk = (rate * rate * rate * DoubleDouble(whole.j)).value();
  return {(to - from) / rate,
          whole.positionAt(from) + section.shift,
          velocity.hi,
          acceleration.hi,
          jerk,
          velocity.lo,
          acceleration.lo};
}

Piece Profile::piece(std::size_t index) const {
  const Section* section = sectionOf(index);
  if (section == nullptr) return pieces_[index];
  const std::size_t within = index - section->first;
  if (section->of == nullptr) return pieces_[section->own + within];
  return excerptPiece(*section, section->of_first + within);
}

DoubleDouble Profile::pieceStart(std::size_t index) const {
  if (index >= piece_count_) return duration_;
  const Section* section = sectionOf(index);
  if (section == nullptr) return starts_[index];
  const std::size_t within = index - section->first;
  if (section->of == nullptr) return starts_[section->own + within];
  if (within == 0) return section->start;
  const DoubleDouble place = section->of->pieceStart(section->of_first + within);
  return section->start + (place - section->from) / section->rate;
}

std::size_t Profile::pieceAt(DoubleDouble time) const {
  const Section* section = nullptr;
  std::size_t end = piece_count_;  // the end of the pieces that the section covers
  for (const Section& next : sections_) {
    if (section != nullptr && time < next.start) {
      end = next.first;
      break;
    }
    section = &next;
  }
  if (section != nullptr && section->of != nullptr) {
    const DoubleDouble place = section->from + (time - section->start) * section->rate;
    const std::size_t index = section->of->pieceAt(place);
    return section->first + std::clamp(index, section->of_first, section->of_last) -
           section->of_first;
  }
  const std::size_t first = section != nullptr ? section->first : 0;
  const std::size_t own = section != nullptr ? section->own : 0;
  const auto begin = starts_.begin() + static_cast<std::ptrdiff_t>(own);
  const auto later =
      std::upper_bound(begin + 1, begin + static_cast<std::ptrdiff_t>(end - first), time);
  return first + static_cast<std::size_t>(later - begin) - 1;
}

MotionState Profile::stateAt(std::int64_t time_ns) const {
  if (time_ns < start_ns_ || piece_count_ == 0) return {start_position_, 0.0, 0.0};
  if (time_ns == start_ns_) {
    const Piece first = piece(0);
    return {start_position_, first.v0, first.a};
  }
  if (time_ns >= end_ns_) return {end_position_, 0.0, 0.0};
  const DoubleDouble since = secondsOf(time_ns - start_ns_);
  const std::size_t index = pieceAt(since);
  const Piece now = piece(index);
  const DoubleDouble t = since - pieceStart(index);
  return {now.positionAt(t), now.velocityAt(t).value(), now.accelerationAt(t).value()};
}

}  // namespace stepdriver::motion
