#include "profile_peaks.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "double_piece.h"
#include "give_way.h"

namespace stepdriver::motion {
namespace {

void includeFurthest(Peak& peak, double value, double time_s) {
  if (std::abs(value) > std::abs(peak.value)) peak = {value, time_s};
}

void includePosition(ProfilePeaks& peaks, double position, double time_s) {
  if (position < peaks.lowest.value) peaks.lowest = {position, time_s};
  if (position > peaks.highest.value) peaks.highest = {position, time_s};
}

// At a velocity of 0 inside the piece, the position has an extremum.
void includeTurns(ProfilePeaks& peaks, const DoublePiece& piece, double start) {
  const auto consider = [&](double t) {
    if (t > 0.0 && t < piece.duration)
      includePosition(peaks, piece.p0 + piece.displacement(t), start + t);
  };
  if (piece.j == 0.0) {
    if (piece.a != 0.0) consider(-piece.v0 / piece.a);
    return;
  }
  const double discriminant = piece.a * piece.a - 2.0 * piece.j * piece.v0;
  if (discriminant < 0.0) return;
  // Avoids the textbook formula's difference of two close numbers.
  const double q = -(piece.a + std::copysign(std::sqrt(discriminant), piece.a));
  consider(q / piece.j);
  if (q != 0.0) consider(2.0 * piece.v0 / q);
}

void includePiece(ProfilePeaks& peaks, const DoublePiece& piece, double start) {
  const double end = piece.duration;
  includePosition(peaks, piece.p0, start);
  includePosition(peaks, piece.p0 + piece.displacement(end), start + end);

  const double last = piece.velocity(end);
  double lowest = std::min(piece.v0, last);
  double highest = std::max(piece.v0, last);
  includeFurthest(peaks.velocity, piece.v0, start);
  const double middle = piece.j != 0.0 ? -piece.a / piece.j : 0.0;
  if (middle > 0.0 && middle < end) {
    const double velocity = piece.velocity(middle);
    lowest = std::min(lowest, velocity);
    highest = std::max(highest, velocity);
    includeFurthest(peaks.velocity, velocity, start + middle);
  }
  includeFurthest(peaks.velocity, last, start + end);
  if (lowest <= 0.0 && highest >= 0.0) includeTurns(peaks, piece, start);

  includeFurthest(peaks.acceleration, piece.a, start);
  includeFurthest(peaks.acceleration, piece.acceleration(end), start + end);
}

}  // namespace

ProfilePeaks profilePeaks(const Profile& profile, double velocity_before, double velocity_after) {
  const double first = profile.pieces().empty() ? profile.endPosition().value()
                                                : profile.pieces().front().p0.value();
  ProfilePeaks peaks;
  peaks.lowest.value = first;
  peaks.highest.value = first;
  double velocity = velocity_before;
  for (std::size_t index = 0; index < profile.pieces().size(); ++index) {
    giveWayAt(index);
    const DoublePiece piece(profile.piece(index));
    const double start = profile.pieceStart(index).value();
    includeFurthest(peaks.velocity_jump, piece.v0 - velocity, start);
    includePiece(peaks, piece, start);
    velocity = piece.velocity(piece.duration);
  }
  includeFurthest(peaks.velocity_jump, velocity_after - velocity, profile.duration().value());
  return peaks;
}

ProfilePeaks joinPeaks(const ProfilePeaks& before, const ProfilePeaks& part, double time_s) {
  ProfilePeaks peaks = before;
  for (const Peak& peak : {part.lowest, part.highest}) {
    includePosition(peaks, peak.value, time_s + peak.time_s);
  }
  includeFurthest(peaks.velocity, part.velocity.value, time_s + part.velocity.time_s);
  includeFurthest(peaks.acceleration, part.acceleration.value, time_s + part.acceleration.time_s);
  includeFurthest(peaks.velocity_jump, part.velocity_jump.value,
                  time_s + part.velocity_jump.time_s);
  return peaks;
}

}  // namespace stepdriver::motion
