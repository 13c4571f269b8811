#include "phases.h"

#include <cmath>

#include "end_state.h"
#include "profile/negligible_time.h"

namespace stepdriver::motion {
namespace {

bool same(DoubleDouble a, DoubleDouble b, DoubleDouble scale) {
  return std::abs((a - b).hi) <= kExact<DoubleDouble> * (std::abs(scale.hi) + std::abs(b.hi));
}

}  // namespace

Piece pieceOf(const Phase& phase, DoubleDouble position) {
  return {phase.duration, position, phase.v.hi, phase.a.hi, phase.j, phase.v.lo, phase.a.lo};
}

void Phases::run(double j, DoubleDouble duration) {
  if (!(duration.hi > 0.0)) return;
  const Advance<DoubleDouble> end = advance(v_, a_, j, duration);
  if (!(duration.hi > kNegligibleTime)) return settle(end.v, end.a);
  Phase* last = size_ > 0 ? &phases_[size_ - 1] : nullptr;
  if (last != nullptr && last->j == j && same(end_v_, v_, last->v) && same(end_a_, a_, last->a)) {
    last->duration = last->duration + duration;
    last->displacement = last->displacement + end.displacement;
  } else {
    phases_[size_++] = {duration, v_, a_, j, end.displacement};
  }
  settle(end.v, end.a);
  end_v_ = v_;
  end_a_ = a_;
}

void Phases::settle(DoubleDouble v, DoubleDouble a) {
  v_ = v;
  a_ = a;
}

void Phases::cut(std::size_t count) {
  settle(phases_[count].v, phases_[count].a);
  size_ = count;
  if (count == 0) return;
  const Phase& last = phases_[count - 1];
  const Advance<DoubleDouble> end = advance(last.v, last.a, last.j, last.duration);
  end_v_ = end.v;
  end_a_ = end.a;
}

}  // namespace stepdriver::motion
