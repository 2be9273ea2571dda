// A face's normal from the positions of its vertices.
#ifndef DPR_FACE_NORMAL_H
#define DPR_FACE_NORMAL_H

/// Not normalised: twice the area long, on the side from which the face winds counter-clockwise.
static inline float3 face_normal(global const float4* world, uint4 face) {
  const float3 a = world[face.x].xyz;
  return cross(world[face.y].xyz - a, world[face.z].xyz - a);
}

/// Its tangent, by those of the positions.
static inline float3 face_normal_tangent(global const float4* world, global const float4* moved, uint4 face) {
  const float3 a = world[face.x].xyz, by = moved[face.x].xyz;
  return cross(moved[face.y].xyz - by, world[face.z].xyz - a) +
         cross(world[face.y].xyz - a, moved[face.z].xyz - by);
}

#endif
