#include "path.h"

#include <cmath>

#include "no_time.h"
#include "reach.h"

namespace stepdriver::motion {
namespace {

bool same(DoubleDouble a, DoubleDouble b, DoubleDouble scale) {
  return std::abs((a - b).hi) <= kExact<DoubleDouble> * (std::abs(scale.hi) + std::abs(b.hi));
}

}  // namespace

DoubleDouble wayOf(const Phase& phase, DoubleDouble t) {
  DoubleDouble slope = phase.v + t * phase.a * DoubleDouble(0.5);
  if (phase.j != 0.0) slope = slope + t * t * DoubleDouble(phase.j * 0.5) * third<DoubleDouble>();
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
  v_ = v_ + duration * (a_ + duration * DoubleDouble(j * 0.5));
  a_ = a_ + duration * DoubleDouble(j);
  end_v_ = v_;
  end_a_ = a_;
}

void Path::settle(DoubleDouble v, DoubleDouble a) {
  v_ = v;
  a_ = a;
}

void Path::cut(std::size_t count) {
  settle(phases_[count].v, phases_[count].a);
  size_ = count;
  if (count == 0) return;
  const Phase& last = phases_[count - 1];
  end_v_ = last.v + last.duration * (last.a + last.duration * DoubleDouble(last.j * 0.5));
  end_a_ = last.a + last.duration * DoubleDouble(last.j);
}

}  // namespace stepdriver::motion
