// The checks of a mesh, and the forms of the library's error messages.
#include "dpr/mesh.hpp"

#include <doctest/doctest.h>

#include <limits>

#include "dpr/light.hpp"
#include "support/messages.hpp"

namespace mesh_test {

using namespace dpr;

namespace {

constexpr float k_nan = std::numeric_limits<float>::quiet_NaN();
constexpr float k_infinity = std::numeric_limits<float>::infinity();

Mesh triangle() {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.faces = {{0, 1, 2}};
  return mesh;
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("soup is a valid mesh") {
    Mesh mesh = triangle();
    CHECK_NOTHROW(validate(mesh));
    mesh.faces = {{0, 1, 2}, {0, 1, 2}, {2, 1, 0}, {1, 1, 1}};
    CHECK_NOTHROW(validate(mesh));
    mesh.vertex_colors = {{1, 0, 0}, {0, 2, 0}, {0, 0, -1}};
    CHECK_NOTHROW(validate(mesh));
  }

  TEST_CASE("messages have one form") {
    const InvalidArgument argument("sigma (smoothing)", "-1", "a finite number > 0");
    CHECK(std::string(argument.what()) == "sigma (smoothing): got -1, expected a finite number > 0");
    CHECK(argument.argument() == "sigma (smoothing)");
    CHECK(argument.got() == "-1");
    CHECK(argument.expected() == "a finite number > 0");
    CHECK(std::string(IoError("a.obj", "is empty").what()) == "a.obj: is empty");
    const IoError with_line("a.obj", "is empty", 7);
    CHECK(std::string(with_line.what()) == "a.obj:7: is empty");
    CHECK(with_line.line() == 7);
    CHECK(std::string(DeviceError(-5, "clFinish").what()) ==
          "clFinish: got CL_OUT_OF_RESOURCES (-5), expected CL_SUCCESS");
    const BuildError build("shade", "a device", "-DLANES=8", "note: x\nshade.cl:3: error: y\nmore");
    CHECK(std::string(build.what()) ==
          "program shade (a device, options \"-DLANES=8\"): does not build: shade.cl:3: error: y");
    CHECK(build.log() == "note: x\nshade.cl:3: error: y\nmore");
  }

  TEST_CASE("every error code of OpenCL 1.2 has its name") {
    CHECK(std::string(cl_error_name(0)) == "CL_SUCCESS");
    CHECK(std::string(cl_error_name(-68)) == "CL_INVALID_DEVICE_PARTITION_COUNT");
    CHECK(std::string(cl_error_name(-1001)) == "CL_PLATFORM_NOT_FOUND_KHR");
    for (int code = -68; code <= 0; ++code) {
      const bool is_named = std::string(cl_error_name(code)).starts_with("CL_");
      CHECK_MESSAGE(is_named == (code <= -30 || code >= -19), code);
    }
    CHECK_FALSE(std::string(cl_error_name(-9999)).starts_with("CL_"));
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("what cannot be rendered is named") {
    Mesh mesh = triangle();
    mesh.faces.clear();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(mesh, "meshes[2]"), "faces (meshes[2]): got none");
    mesh.faces = {{0, 1, 2}, {0, 3, 1}};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(mesh),
                          "faces[1] (mesh): got vertex 3, expected an index below");
    mesh = triangle();
    mesh.positions[1].y = k_nan;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(mesh), "positions[1] (mesh): got (1, nan, 0)");
    mesh.positions[1].y = k_infinity;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(mesh), "positions[1] (mesh): got (1, inf, 0)");
    mesh.positions.clear();
    CHECK_THROWS_AS(validate(mesh), InvalidArgument);
  }

  TEST_CASE("colours match what they colour") {
    Mesh mesh = triangle();
    mesh.vertex_colors = {glm::vec3(1)};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(mesh), "vertex_colors (mesh): got 1 colours, expected 3");
    mesh.vertex_colors = {glm::vec3(1), glm::vec3(1), glm::vec3(k_nan)};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(mesh), "vertex_colors[2] (mesh)");
    mesh.vertex_colors.clear();
    mesh.face_colors = {glm::vec3(1), glm::vec3(1)};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(mesh), "face_colors (mesh): got 2 colours, expected 1");
    mesh.face_colors.pop_back();
    mesh.vertex_colors.assign(3, glm::vec3(1));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(mesh), "at most one of the two");
  }

  TEST_CASE("texture coordinates are there for those who refer to them") {
    Mesh mesh = triangle();
    mesh.texcoords = {{0, 0}, {1, 0}};
    mesh.face_texcoords = {{0, 1, 1}};
    CHECK_NOTHROW(validate(mesh));
    mesh.face_texcoords[0].z = 2;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(mesh),
                          "face_texcoords[0] (mesh): got texture coordinate 2");
    mesh.face_texcoords = {{0, 1, 1}, {0, 1, 1}};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(mesh), "face_texcoords (mesh): got 2, expected 1");
    mesh.face_texcoords = {{0, 1, 1}};
    mesh.textures = {{1, 1, {glm::vec3(1)}}};
    CHECK_NOTHROW(validate(mesh));
    mesh.face_textures = {k_no_texture};
    CHECK_NOTHROW(validate(mesh));
    mesh.face_textures = {1};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(mesh), "face_textures[0] (mesh): got texture 1");
    mesh.face_textures = {0, 0};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(mesh), "face_textures (mesh): got 2, expected 1");
    mesh.face_textures.clear();
    mesh.textures[0].height = 2;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(mesh), "texels (textures[0] (mesh)): got 1, expected 2");
    mesh.textures[0].height = 1;
    mesh.face_texcoords.clear();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(mesh), "face_texcoords (mesh): got none beside textures");
    mesh.textures.clear();
    mesh.texcoords[1].y = std::numeric_limits<float>::infinity();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(mesh), "texcoords[1] (mesh)");
  }

  TEST_CASE("lights") {
    Lights lights;
    lights.point.resize(2);
    CHECK_NOTHROW(validate(lights));
    lights.point[1].diffuse.g = k_infinity;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(lights), "diffuse (lights.point[1])");
    lights.point.clear();
    lights.ambient.r = k_nan;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(lights), "ambient (lights)");
    lights.ambient.r = 0;
    lights.shininess = 0.5F;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(lights), "shininess (lights): got 0.5");
    lights.shininess = 2;
    lights.directional.resize(1);
    lights.spot.resize(2);
    lights.harmonics.resize(k_harmonics);
    CHECK_NOTHROW(validate(lights));
    lights.harmonics[8].b = k_nan;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(lights), "lights.harmonics[8]");
    lights.harmonics.resize(4);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(lights), "harmonics (lights): got 4 colours, expected 9");
    lights.harmonics.clear();
    lights.directional[0].direction = glm::vec3(0);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(lights), "direction (lights.directional[0])");
    lights.directional.clear();
    lights.spot[1].direction = glm::vec3(1e20F);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(lights), "direction (lights.spot[1])");
    lights.spot[1].direction = glm::vec3(1);
    lights.spot[1].angle_degrees = 181;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(lights), "angle_degrees (lights.spot[1]): got 181");
    lights.spot[1].angle_degrees = 20;
    lights.spot[1].inner_angle_degrees = 20;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(lights), "inner_angle_degrees (lights.spot[1]): got 20");
    lights.spot[1].inner_angle_degrees = k_nan;
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(lights), "inner_angle_degrees (lights.spot[1])");
    lights.spot[1].inner_angle_degrees = 0;
    CHECK_NOTHROW(validate(lights));
    lights.shading = static_cast<Shading>(7);
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(lights), "flat, phong, gouraud, blinn or microfacet");
  }

  TEST_CASE("metal and roughness: glTF's reflectances, and every roughness has a valid exponent") {
    const glm::vec3 base(0.9F, 0.5F, 0.1F);
    const ColoredMaterial matt = metallic_roughness(base, 0, 1), metal = metallic_roughness(base, 1, 0.5F),
                          mirror = metallic_roughness(base, 0.5F, 0);
    CHECK(matt.color == base);
    CHECK(matt.material == Material{glm::vec3(0.04F), 1.0F});
    CHECK(metal.color == glm::vec3(0));
    CHECK(glm::distance(metal.material.specular, base) < 1e-6F);
    CHECK(*metal.material.shininess == doctest::Approx(31));  // alpha^2 = 1 / 16
    CHECK(mirror.color == 0.5F * base);
    CHECK(glm::distance(mirror.material.specular, glm::vec3(0.47F, 0.27F, 0.07F)) < 1e-6F);
    CHECK(*mirror.material.shininess == doctest::Approx(2e6 - 1));
    for (int step = 0; step <= 1000; ++step)
      CHECK_NOTHROW(validate(metallic_roughness(base, 0, static_cast<float>(step) / 1000).material));
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, metallic_roughness(base, -0.1F, 0), "metallic: got -0.1");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, metallic_roughness(base, 0, k_nan), "roughness: got nan");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, metallic_roughness(glm::vec3(k_nan), 0, 0), "base_color");
  }
}

}  // namespace mesh_test
