#include "path.h"

#include <cmath>

namespace stepdriver::motion {
namespace {

constexpr double kNoTime = 1e-15;  // s

bool same(DoubleDouble a, DoubleDouble b, DoubleDouble scale) {
  return std::abs((a - b).hi) <= kExact * (std::abs(scale.hi) + std::abs(b.hi));
}

}  // namespace

DoubleDouble wayOf(const Phase& phase, DoubleDouble t) {
  DoubleDouble slope = phase.v + t * phase.a * DoubleDouble(0.5);
  if (phase.j != 0.0) slope = slope + t * t * DoubleDouble(phase.j) / DoubleDouble(6.0);
  return t * slope;
}

Piece pieceOf(const Phase& phase, DoubleDouble position) {
  return {phase.duration, position, phase.v.hi, phase.a.hi, phase.j, phase.v.lo, phase.a.lo};
}

void Path::run(double j, DoubleDouble duration) {
  if (!(duration.hi > kNoTime)) return;
  const Phase phase{duration, v_, a_, j};
  Phase* last = size_ > 0 ? &phases_[size_ - 1] : nullptr;
  if (last != nullptr && last->j == j && same(end_v_, v_, last->v) && same(end_a_, a_, last->a)) {
    last->duration = last->duration + duration;
  } else {
    phases_[size_++] = phase;
  }
  length_ = length_ + wayOf(phase, duration);
  v_ = v_ + duration * (a_ + duration * DoubleDouble(j * 0.5));
  a_ = a_ + duration * DoubleDouble(j);
  end_v_ = v_;
  end_a_ = a_;
}

void Path::settle(DoubleDouble v, DoubleDouble a) {
  v_ = v;
  a_ = a;
}

void Path::append(const Path& other, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    settle(other[i].v, other[i].a);
    run(other[i].j, other[i].duration);
  }
}

}  // namespace stepdriver::motion
