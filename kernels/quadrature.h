// Where the aggregation integrals are evaluated. Their integrands are smooth and decay at both ends, so an equally
// spaced rule converges exponentially (Trefethen & Weideman 2014); the Cauchy prior's tails need nodes of their own.
// Nodes come in blocks of DPR_WIDTH, a vector each. Ranges, counts and steps are chosen by measurement (README, "How
// exact is exact?").
#ifndef DPR_QUADRATURE_H
#define DPR_QUADRATURE_H

#include "lanes.h"
#include "shared_types.h"

/// With more slots than this near the front the integrand narrows, and the rule is refined.
#define DPR_CROWD 6
/// And with more than this, once more.
#define DPR_THRONG 40

#if DPR_PRIOR == DPR_GAUSSIAN
/// Barrier composition: the range of t relative to the largest beta, for few slots and for a crowd; numbers of nodes;
/// and how far below the largest a slot still counts: F(9.5 - 4.6) differs from 1 by 5e-7.
#define DPR_BARRIER_LOW (-4.6f)
#define DPR_BARRIER_HIGH 5.2f
#define DPR_BARRIER_NODES 16
#define DPR_CROWD_LOW (-5.2f)
#define DPR_CROWD_HIGH 6.2f
#define DPR_CROWD_NODES 32
#define DPR_BARRIER_REACH 9.5f
/// Joint composition: how far a slot's density reaches below and above its beta (mass left out: 8e-7 each), the largest
/// step between nodes, and that for a crowd.
#define DPR_JOINT_BELOW 4.8f
#define DPR_JOINT_ABOVE 4.8f
#define DPR_JOINT_STEP 0.67f
#define DPR_JOINT_CROWD_STEP 0.335f
#elif DPR_PRIOR == DPR_LOGISTIC
#define DPR_BARRIER_LOW (-17.0f)
#define DPR_BARRIER_HIGH 20.0f
#define DPR_BARRIER_NODES 48
#define DPR_CROWD_LOW (-18.0f)
#define DPR_CROWD_HIGH 22.0f
#define DPR_CROWD_NODES 64
#define DPR_BARRIER_REACH 26.0f
#define DPR_JOINT_BELOW 14.0f
#define DPR_JOINT_ABOVE 14.0f
#define DPR_JOINT_STEP 0.95f
#define DPR_JOINT_CROWD_STEP 0.475f
#elif DPR_PRIOR == DPR_GUMBEL
#define DPR_BARRIER_REACH 17.0f /* softmax: exp(-17) = 4e-8 */
#define DPR_JOINT_BELOW 3.0f
#define DPR_JOINT_ABOVE 14.0f
#define DPR_JOINT_STEP 0.53f
#define DPR_JOINT_CROWD_STEP 0.265f
#elif DPR_PRIOR == DPR_CAUCHY
#define DPR_BARRIER_REACH INFINITY
/// Slots within this distance of a cluster's head share its nodes.
#define DPR_CLUSTER 1.0f
/// How far the outermost nodes lie: the mass beyond is 1 / (pi 1e6) a slot.
#define DPR_CAUCHY_REACH 1e6f
#define DPR_CLUSTER_NODES 64

/// Gauss-Legendre on [-1, 1], 32 nodes: for either half of a segment. Splitting at the cluster, where the integrand
/// bends, lets the rule converge twice over: its nodes crowd at the ends of an interval.
constant float k_gauss_nodes[DPR_CLUSTER_NODES / 2] = {
    -0.997263862f, -0.985611512f, -0.964762256f, -0.934906076f, -0.896321156f, -0.849367614f, -0.794483796f,
    -0.732182119f, -0.663044267f, -0.587715757f, -0.506899909f, -0.421351276f, -0.331868602f, -0.239287362f,
    -0.144471962f, -0.0483076657f, 0.0483076657f, 0.144471962f, 0.239287362f, 0.331868602f, 0.421351276f,
    0.506899909f, 0.587715757f, 0.663044267f, 0.732182119f, 0.794483796f, 0.849367614f, 0.896321156f,
    0.934906076f, 0.964762256f, 0.985611512f, 0.997263862f};
constant float k_gauss_weights[DPR_CLUSTER_NODES / 2] = {
    0.00701861001f, 0.0162743947f, 0.0253920653f, 0.0342738629f, 0.042835898f, 0.0509980593f, 0.0586840935f,
    0.0658222228f, 0.0723457941f, 0.0781938958f, 0.0833119242f, 0.087652093f, 0.0911738787f, 0.0938443991f,
    0.0956387201f, 0.0965400885f, 0.0965400885f, 0.0956387201f, 0.0938443991f, 0.0911738787f, 0.087652093f,
    0.0833119242f, 0.0781938958f, 0.0723457941f, 0.0658222228f, 0.0586840935f, 0.0509980593f, 0.042835898f,
    0.0342738629f, 0.0253920653f, 0.0162743947f, 0.00701861001f};
#endif

/// A stretch of the line of integration: t = centre + u for an equally spaced rule, centre + sinh(u) for Cauchy.
typedef struct {
  float centre, low, high;  // low and high bound u
  uint blocks;
} Segment;

/// Nodes and weights of a block of a segment.
static inline void segment_nodes(const Segment s, uint block, realn* t, realn* weight) {
#if DPR_PRIOR == DPR_CAUCHY
  // The first half of the blocks lies below the centre, the second above.
  const uint node = DPR_WIDTH * block % (DPR_CLUSTER_NODES / 2);
  const float end = DPR_WIDTH * block < DPR_CLUSTER_NODES / 2 ? s.low : s.high;
  const float radius = 0.5f * fabs(end);
  const realn u = 0.5f * end + radius * load_n(node, k_gauss_nodes);
  const realn e = exp_n(u), inverse = 1.0f / e;
  *t = s.centre + 0.5f * (e - inverse);
  *weight = radius * load_n(node, k_gauss_weights) * 0.5f * (e + inverse);
#else
  const float step = (s.high - s.low) / (float)(DPR_WIDTH * s.blocks - 1);
  *t = s.centre + s.low + step * (convert_realn(DPR_LANE_INDEX) + (float)(DPR_WIDTH * block));
  *weight = step;
#endif
}

#endif
