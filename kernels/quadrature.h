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

#if DPR_PRIOR == DPR_GAUSSIAN
/// Barrier composition: the range of t relative to the largest beta, for few slots and for a crowd; numbers of nodes;
/// and how far below the largest a slot still counts: F(9.5 - 4.6) differs from 1 by 5e-7.
#define DPR_BARRIER_LOW (-4.2f)
#define DPR_BARRIER_HIGH 5.4f
#define DPR_BARRIER_NODES 16
#define DPR_CROWD_LOW (-4.6f)
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
#define DPR_BARRIER_LOW (-11.0f)
#define DPR_BARRIER_HIGH 20.0f
#define DPR_BARRIER_NODES 48
#define DPR_CROWD_LOW (-12.0f)
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
/// How far the outermost nodes lie: the mass beyond is 1 / (pi 1e5) a slot.
#define DPR_CAUCHY_REACH 1e5f
#define DPR_CLUSTER_NODES 48

/// Gauss-Legendre on [-1, 1], 48 nodes.
constant float k_gauss_nodes[DPR_CLUSTER_NODES] = {
    -0.998771007f,  -0.993530172f,  -0.984124584f, -0.970591593f, -0.952987703f, -0.931386691f, -0.905879137f,
    -0.87657202f,   -0.843588262f,  -0.807066204f, -0.767159033f, -0.724034131f, -0.67787238f,  -0.628867397f,
    -0.577224726f,  -0.523160975f,  -0.466902905f, -0.408686482f, -0.348755886f, -0.287362487f, -0.22476379f,
    -0.161222356f,  -0.0970046992f, -0.032380171f, 0.032380171f,  0.0970046992f, 0.161222356f,  0.22476379f,
    0.287362487f,   0.348755886f,   0.408686482f,  0.466902905f,  0.523160975f,  0.577224726f,  0.628867397f,
    0.67787238f,    0.724034131f,   0.767159033f,  0.807066204f,  0.843588262f,  0.87657202f,   0.905879137f,
    0.931386691f,   0.952987703f,   0.970591593f,  0.984124584f,  0.993530172f,  0.998771007f};
constant float k_gauss_weights[DPR_CLUSTER_NODES] = {
    0.00315334605f, 0.0073275539f, 0.0114772346f, 0.0155793157f, 0.0196161605f, 0.0235707608f, 0.0274265097f,
    0.0311672278f,  0.0347772226f, 0.0382413511f, 0.0415450829f, 0.0446745609f, 0.0476166585f, 0.0503590356f,
    0.0528901895f,  0.0551995037f, 0.0572772921f, 0.0591148397f, 0.0607044392f, 0.0620394232f, 0.0631141923f,
    0.0639242386f,  0.0644661644f, 0.0647376968f, 0.0647376968f, 0.0644661644f, 0.0639242386f, 0.0631141923f,
    0.0620394232f,  0.0607044392f, 0.0591148397f, 0.0572772921f, 0.0551995037f, 0.0528901895f, 0.0503590356f,
    0.0476166585f,  0.0446745609f, 0.0415450829f, 0.0382413511f, 0.0347772226f, 0.0311672278f, 0.0274265097f,
    0.0235707608f,  0.0196161605f, 0.0155793157f, 0.0114772346f, 0.0073275539f, 0.00315334605f};
#endif

/// A stretch of the line of integration: t = centre + u for an equally spaced rule, centre + sinh(u) for Cauchy.
typedef struct {
  float centre, low, high;  // low and high bound u
  uint blocks;
} Segment;

/// Nodes and weights of a block of a segment.
static inline void segment_nodes(const Segment s, uint block, realn* t, realn* weight) {
#if DPR_PRIOR == DPR_CAUCHY
  const float radius = 0.5f * (s.high - s.low);
  const realn u = 0.5f * (s.high + s.low) + radius * load_n(DPR_WIDTH * block, k_gauss_nodes);
  const realn e = exp_n(u), inverse = 1.0f / e;
  *t = s.centre + 0.5f * (e - inverse);
  *weight = radius * load_n(DPR_WIDTH * block, k_gauss_weights) * 0.5f * (e + inverse);
#else
  const float step = (s.high - s.low) / (float)(DPR_WIDTH * s.blocks - 1);
  *t = s.centre + s.low + step * (convert_realn(DPR_LANE_INDEX) + (float)(DPR_WIDTH * block));
  *weight = step;
#endif
}

#endif
