#include "motion/profile_sum.h"

#include "no_time.h"

namespace stepdriver::motion {

void ProfileSum::begin(std::int64_t start_ns) {
  size_ = 0;
  start_ns_ = start_ns;
  piece_start_ = piece_end_ = {};
}

void ProfileSum::add(double factor, const Profile& profile) {
  Term& term = terms_[size_++];
  term = {factor, &profile, profile.endPosition(), secondsOf(start_ns_ - profile.startNs()), 0};
  if (profile.pieceCount() == 0) {
    term.profile = nullptr;
  } else if (term.since.hi > 0.0) {
    term.piece = profile.pieceAt(term.since);
  }
}

void ProfileSum::add(double factor, DoubleDouble position) {
  terms_[size_++] = {factor, nullptr, position, {}, 0};
}

void ProfileSum::rest(std::size_t term) { terms_[term].profile = nullptr; }

DoubleDouble ProfileSum::addPiece(Term& term, DoubleDouble from) {
  const DoubleDouble factor = term.factor;
  const auto rests = [&](DoubleDouble position) { piece_.p0 = piece_.p0 + factor * position; };
  if (term.profile == nullptr) {
    rests(term.position);
    return from;
  }
  const Profile& profile = *term.profile;
  const DoubleDouble at = from + term.since;
  if (at.hi < -kNoTime) {
    rests(profile.startPosition());
    return -term.since;
  }
  const std::size_t count = profile.pieceCount();
  while (term.piece < count && !((profile.pieceStart(term.piece + 1) - at).hi > kNoTime)) {
    ++term.piece;
  }
  if (term.piece == count) {
    rests(term.position);
    return from;
  }
  const Piece piece = profile.piece(term.piece);
  DoubleDouble t = at - profile.pieceStart(term.piece);
  if (t.hi < 0.0) t = {};
  piece_.p0 = piece_.p0 + factor * piece.positionAt(t);
  velocity_ = velocity_ + factor * piece.velocityAt(t);
  acceleration_ = acceleration_ + factor * piece.accelerationAt(t);
  piece_.j += term.factor * piece.j;
  return profile.pieceStart(term.piece + 1) - term.since;
}

bool ProfileSum::next() {
  piece_start_ = piece_end_;
  piece_ = {};
  velocity_ = acceleration_ = {};
  bool moves = false;
  for (std::size_t i = 0; i < size_; ++i) {
    const DoubleDouble end = addPiece(terms_[i], piece_start_);
    if (!(piece_start_ < end)) continue;
    if (!moves || end < piece_end_) piece_end_ = end;
    moves = true;
  }
  if (!moves) return false;
  piece_.duration = piece_end_ - piece_start_;
  piece_.v0 = velocity_.hi;
  piece_.v0_rest = velocity_.lo;
  piece_.a = acceleration_.hi;
  piece_.a_rest = acceleration_.lo;
  return true;
}

}  // namespace stepdriver::motion
