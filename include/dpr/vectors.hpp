// The vectors and matrices of the interface: GLM's, of one type and layout whatever GLM_FORCE_ settings a
// program has. Without such settings they are glm::vec3 and so on themselves; with others GLM converts
// between the two.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <type_traits>

namespace dpr {

static_assert(std::is_same_v<glm::length_t, int>,
              "dpr's headers need GLM without GLM_FORCE_SIZE_T_LENGTH, which makes its types other ones");

using vec2 = glm::vec<2, float, glm::packed_highp>;
using vec3 = glm::vec<3, float, glm::packed_highp>;
using vec4 = glm::vec<4, float, glm::packed_highp>;
using dvec2 = glm::vec<2, double, glm::packed_highp>;
using dvec3 = glm::vec<3, double, glm::packed_highp>;
using uvec3 = glm::vec<3, std::uint32_t, glm::packed_highp>;
using mat3 = glm::mat<3, 3, float, glm::packed_highp>;
using mat4 = glm::mat<4, 4, float, glm::packed_highp>;
using dmat3 = glm::mat<3, 3, double, glm::packed_highp>;

static_assert(std::is_trivially_copyable_v<vec3> && std::is_trivially_copyable_v<mat4>,
              "dpr's headers need GLM without GLM_FORCE_CTOR_INIT, which changes how vectors are passed");
static_assert(sizeof(vec2) == 8 && sizeof(vec3) == 12 && sizeof(vec4) == 16 && sizeof(uvec3) == 12);
static_assert(sizeof(dvec3) == 24 && sizeof(mat3) == 36 && sizeof(mat4) == 64 && sizeof(dmat3) == 72);
static_assert(alignof(vec4) == alignof(float) && alignof(mat4) == alignof(float));
static_assert(alignof(dvec3) == alignof(double) && alignof(dmat3) == alignof(double));

}  // namespace dpr
