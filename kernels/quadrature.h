// Nodes of the aggregation integrals: stretches of the line of integration, each with its nodes. A
// prior names the rule (priors.h):
//
//   smooth     Smooth integrands that decay at both ends: an equally spaced rule converges exponentially
//              (Trefethen & Weideman 2014). One stretch.
//   tails      Heavy tails make every cluster of slots matter: each has stretches of its own, half way to its
//              neighbours, on which t = head + sinh(u) thins the nodes out. They end at the head, where the
//              integrand bends: Gauss-Legendre nodes crowd at the ends.
//   piecewise  Polynomials between kinks: a stretch from kink to kink. With up to DPR_PIECE_SLOTS slots the
//              rule is exact, with 300 coincident ones 32 nodes are right to 1e-5 of the integral.
//
// Nodes come in blocks of DPR_WIDTH, a vector each. Ranges, counts and steps are chosen by measurement
// (README, "How exact is exact?").
#ifndef DPR_QUADRATURE_H
#define DPR_QUADRATURE_H

#include "lanes.h"
#include "pixel.h"
#include "priors.h"

/// Barrier composition: with more slots than this there are twice as many nodes.
#define DPR_THRONG 40
/// Joint composition: from this sum of occupancies on a cluster is crowded.
#define DPR_JOINT_CROWD 3.0f
/// And how much further its slots then reach, so that many do not leave out too much.
#define DPR_JOINT_CROWD_REACH 1.1f

/// t = centre + u, or centre + sinh(u) for heavy tails, with u between low and high.
typedef struct {
  float centre, low, high;
  uint blocks;
  float head;    // tails: the cluster's largest beta
  float next;    // tails: the next cluster's, or -INFINITY
  int is_upper;  // tails: this is the cluster's upper half
  uint passed;   // tails: slots before the last head that was found; joint
} Stretch;

/// Inputs of the lower end of the barrier's integral, where its rule needs one: how many slots lie no
/// further below the largest than a narrow window reaches, and a wide one, the sums of their betas, and of
/// the squares.
typedef struct {
  float2 count, sum, squares;
} Nearby;

static inline Nearby no_slots(void) {
  const Nearby none = {0.0f, 0.0f, 0.0f};
  return none;
}

#ifdef DPR_BARRIER_WINDOWS

static inline void add_nearby(float beta, Nearby* n) {
  const int2 is_near = beta >= -DPR_BARRIER_WINDOWS;
  const float2 counted = select((float2)(0.0f), (float2)(beta), is_near);
  n->count += select((float2)(0.0f), (float2)(1.0f), is_near);
  n->sum += counted;
  n->squares += counted * counted;
}

/// Point where the product of all slots' F falls below exp(-DPR_BARRIER_LOG_FLOOR), or a little lower: of the
/// bounds by either window the tighter one.
static inline float lower_end(const Nearby n) {
  const float2 ends = prior_lower_ends(DPR_BARRIER_WINDOWS, n.count, n.sum, n.squares);
  return max(ends.x, ends.y);
}

#else

static inline void add_nearby(float beta, Nearby* n) {
  (void)beta;
  (void)n;
}

static inline float lower_end(const Nearby n) {
  (void)n;
  return 0.0f;
}

#endif

#if DPR_RULE == DPR_RULE_SMOOTH

/// Nodes and weights of a block of a stretch.
static inline void stretch_nodes(const Stretch s, uint block, realn* t, realn* weight) {
  const float step = (s.high - s.low) / (float)(DPR_WIDTH * s.blocks);
  const float first = s.centre + s.low + step * ((float)(DPR_WIDTH * block) + 0.5f);
  *t = first + step * convert_realn(DPR_LANE_INDEX);
  *weight = step;
}

#ifdef DPR_JOINT

/// The whole span of a cluster, with as many blocks as the largest step allows. Where many slots cover, the
/// integrand narrows, and every one leaves out a little of its mass.
static inline Stretch first_stretch(const Slots run) {
  const int crowded = run.covering > DPR_JOINT_CROWD;
  Stretch s;
  s.centre = 0.0f;
  const float reach = crowded ? DPR_JOINT_CROWD_REACH : 1.0f;
  s.low = run.slot[run.count - 1].beta - reach * DPR_JOINT_BELOW;
  s.high = reach * DPR_JOINT_ABOVE;
  // No neighbours in a cluster are further apart than their noise reaches, which bounds its span.
  const float span = fmin(s.high - s.low, (float)run.count * reach * (DPR_JOINT_BELOW + DPR_JOINT_ABOVE));
  s.blocks = (uint)ceil(span / ((crowded ? DPR_JOINT_CROWD_STEP : DPR_JOINT_STEP) * DPR_WIDTH));
  return s;
}

#elif !defined(DPR_SOFTMAX)

/// ln(count), or less than 0.06 below it: the logarithm of a float between powers of two is nearly its
/// mantissa.
static inline float log_of_count(uint count) {
  return M_LN2_F * (0x1p-23f * (float)as_int((float)count) - 127.0f);
}

/// The stretch that holds all but 1e-7 of the largest slot's and its neighbours' mass. With many slots it is
/// short and lies higher, as the integrand does, so that the same number of nodes serves.
static inline Stretch first_stretch(const Slots run) {
  Stretch s;
  s.centre = 0.0f;
  s.low = run.slot[0].occupancy;
  s.high = DPR_BARRIER_HIGH + DPR_BARRIER_HIGH_PER_LOG * log_of_count(run.count);
  s.blocks = DPR_BARRIER_NODES / DPR_WIDTH;
  if (run.count > DPR_THRONG) s.blocks *= 2;
  return s;
}

#endif

static inline int next_stretch(const Slots run, Stretch* s) {
  (void)run;
  (void)s;
  return 0;
}

#else

/// Gauss-Legendre on [-1, 1].
constant float k_gauss_nodes_16[16] = {-0.989400935f, -0.944575023f, -0.865631202f, -0.755404408f,
                                       -0.617876244f, -0.458016778f, -0.281603551f, -0.0950125098f,
                                       0.0950125098f, 0.281603551f,  0.458016778f,  0.617876244f,
                                       0.755404408f,  0.865631202f,  0.944575023f,  0.989400935f};
constant float k_gauss_weights_16[16] = {0.0271524594f, 0.0622535239f, 0.0951585117f, 0.124628971f,
                                         0.149595989f,  0.169156519f,  0.182603415f,  0.18945061f,
                                         0.18945061f,   0.182603415f,  0.169156519f,  0.149595989f,
                                         0.124628971f,  0.0951585117f, 0.0622535239f, 0.0271524594f};
constant float k_gauss_nodes_32[32] = {
    -0.997263862f, -0.985611512f,  -0.964762256f, -0.934906076f, -0.896321156f, -0.849367614f, -0.794483796f,
    -0.732182119f, -0.663044267f,  -0.587715757f, -0.506899909f, -0.421351276f, -0.331868602f, -0.239287362f,
    -0.144471962f, -0.0483076657f, 0.0483076657f, 0.144471962f,  0.239287362f,  0.331868602f,  0.421351276f,
    0.506899909f,  0.587715757f,   0.663044267f,  0.732182119f,  0.794483796f,  0.849367614f,  0.896321156f,
    0.934906076f,  0.964762256f,   0.985611512f,  0.997263862f};
constant float k_gauss_weights_32[32] = {
    0.00701861001f, 0.0162743947f, 0.0253920653f, 0.0342738629f, 0.042835898f, 0.0509980593f, 0.0586840935f,
    0.0658222228f, 0.0723457941f, 0.0781938958f, 0.0833119242f, 0.087652093f, 0.0911738787f, 0.0938443991f,
    0.0956387201f, 0.0965400885f, 0.0965400885f, 0.0956387201f, 0.0938443991f, 0.0911738787f, 0.087652093f,
    0.0833119242f, 0.0781938958f, 0.0723457941f, 0.0658222228f, 0.0586840935f, 0.0509980593f, 0.042835898f,
    0.0342738629f, 0.0253920653f, 0.0162743947f, 0.00701861001f};
static inline void gauss_nodes(uint block, uint blocks, realn* u, realn* weight) {
  const uint node = DPR_WIDTH * block;
  const int fine = blocks > 16 / DPR_WIDTH;
  *u = fine ? load_n(node, k_gauss_nodes_32) : load_n(node, k_gauss_nodes_16);
  *weight = fine ? load_n(node, k_gauss_weights_32) : load_n(node, k_gauss_weights_16);
}

#endif

#if DPR_RULE == DPR_RULE_TAILS

static inline void stretch_nodes(const Stretch s, uint block, realn* t, realn* weight) {
  const float radius = 0.5f * (s.high - s.low);
  realn u;
  gauss_nodes(block, s.blocks, &u, weight);
  u = mad(u, radius, 0.5f * (s.high + s.low));
  const realn e = exp_n(u), inverse = 1.0f / e;
  *t = s.centre + 0.5f * (e - inverse);
  *weight *= radius * 0.5f * (e + inverse);
}

/// The largest beta below `limit`, or -INFINITY. Limits fall from call to call.
static inline float next_head(const Slots run, float limit, uint* passed) {
#ifdef DPR_JOINT
  // Betas fall from slot to slot: the search goes on behind those that it has passed.
  for (; *passed < run.count; ++*passed) {
    const float beta = run.slot[*passed].beta;
    if (beta < limit) return beta;
  }
  return -INFINITY;
#else
  (void)passed;
  float head = -INFINITY;
  for (uint i = 0; i < run.count; ++i) {
    const float beta = run.slot[i].beta;
    if (beta < limit && beta > head) head = beta;
  }
  return head;
#endif
}

static inline Stretch first_stretch(const Slots run) {
  Stretch s;
  s.blocks = 32 / DPR_WIDTH;
  s.passed = 0;
  s.centre = s.head = next_head(run, INFINITY, &s.passed);
  s.next = next_head(run, s.head - DPR_HEAD_WIDTH, &s.passed);
  s.low = 0.0f;
  s.high = asinh(DPR_TAIL_REACH);
  s.is_upper = 1;
  return s;
}

/// The lower half of a cluster's stretch, then the upper half of the next; false after the last. Each
/// cluster's head lies below the last one's, so there are no more than two stretches a slot.
static inline int next_stretch(const Slots run, Stretch* s) {
  const float half_way = fmin(0.5f * (s->head - s->next), DPR_TAIL_REACH);
  if (s->is_upper) {
    s->low = -asinh(half_way);
    s->high = 0.0f;
    s->is_upper = 0;
    return 1;
  }
  if (!(s->next > -INFINITY)) return 0;
  s->low = 0.0f;
  s->high = asinh(half_way);
  s->centre = s->head = s->next;
  s->next = next_head(run, s->head - DPR_HEAD_WIDTH, &s->passed);
  s->is_upper = 1;
  return 1;
}

#elif DPR_RULE == DPR_RULE_PIECEWISE

static inline void stretch_nodes(const Stretch s, uint block, realn* t, realn* weight) {
  const float radius = 0.5f * (s.high - s.low);
  gauss_nodes(block, s.blocks, t, weight);
  *t = mad(*t, radius, 0.5f * (s.high + s.low));
  *weight *= radius;
}

/// Begin of the integrand. In the barrier composition the product vanishes below the largest slot's
/// density.
static inline float lowest_kink(const Slots run) {
#ifdef DPR_JOINT
  return run.slot[run.count - 1].beta - DPR_HALF_WIDTH;
#else
  (void)run;
  return -DPR_HALF_WIDTH;
#endif
}

/// The piece below the last one; false where the integrand begins. Every piece ends at a lower kink, so there
/// are no more than two a slot.
static inline int next_stretch(const Slots run, Stretch* s) {
  s->high = s->low;
  s->low = lowest_kink(run);
  if (!(s->high > s->low)) return 0;
  for (uint i = 0; i < run.count; ++i) {
    const float upper = run.slot[i].beta + DPR_HALF_WIDTH, lower = run.slot[i].beta - DPR_HALF_WIDTH;
    if (upper < s->high && upper > s->low) s->low = upper;
    if (lower < s->high && lower > s->low) s->low = lower;
  }
  return 1;
}

static inline Stretch first_stretch(const Slots run) {
  Stretch s;
  s.centre = 0.0f;
  s.low = DPR_HALF_WIDTH;  // of the largest slot, whose beta is 0
  s.blocks = (run.count > DPR_PIECE_SLOTS ? 32 : 16) / DPR_WIDTH;
  next_stretch(run, &s);
  return s;
}

#endif

#endif
