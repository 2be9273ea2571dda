// The scene format: the example of the documentation, every default, and every error with its place.
#include <doctest/doctest.h>

#include <limits>
#include <string>

#include "dpr/scene.hpp"
#include "support/messages.hpp"
#include "support/temp_dir.hpp"

namespace scene_json_test {

using namespace dpr;
using dpr::test::TempDir;

namespace {

const std::string k_triangle = R"("positions": [[0,0,0],[1,0,0],[0,1,0]], "faces": [[0,1,2]])";

// A scene with one triangle and these members beside it.
std::string with(const std::string& members) {
  return R"({"meshes": [{)" + k_triangle + "}]" + (members.empty() ? "" : ", " + members) + "}";
}

std::string with_mesh(const std::string& members) { return R"({"meshes": [{)" + members + "}]}"; }

Scene read(const TempDir& folder, const std::string& text) {
  return read_scene(folder.write("S.json", text));
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("the example of the documentation") {
    const TempDir folder;
    write_mesh(folder / "cube.ply", make_cube());
    const Scene scene = read(folder, R"({
      "width": 64, "height": 128,
      "camera": {"view": [[1,0,0,0],[0,1,0,0],[0,0,1,-6.7],[0,0,0,1]], "fov_y_degrees": 60,
                 "znear": 1, "zfar": 100},
      "background": [0, 0.5, 1],
      "meshes": [{"file": "cube.ply", "transform": [[1,0,0,2],[0,1,0,3],[0,0,1,4],[0,0,0,1]],
                  "face_colors": [[1,0,0]]}],
      "lights": {"ambient": [0.5,0.5,0.5], "point": [{"position": [0,2,-2], "diffuse": [0.3,0.3,0.3],
                 "specular": [0.2,0.2,0.2]}], "shininess": 64},
      "smoothing": {
        "occupancy_prior": "gaussian", "depth_prior": "cauchy", "sigma": 2e-3, "gamma": 3e-2, "alpha": 4,
        "composition": "barrier", "estimator": "exact", "samples": 16,
        "variance_reduction": "none", "draws": "stratified", "seed": 18446744073709551615,
        "occupancy_threshold": 2e-4, "blur_radius": 9.21e-3, "background_depth": 2e-10,
        "distance": "euclidean"
      },
      "perspective_correct": false,
      "gradients": ["positions", "lights"]
    })");
    CHECK(scene.width == 64);
    CHECK(scene.height == 128);
    CHECK(scene.camera.view[3] == glm::vec4(0, 0, -6.7F, 1));
    CHECK(scene.background == glm::vec3(0, 0.5F, 1));
    REQUIRE(scene.meshes.size() == 1);
    CHECK(scene.meshes[0].transform[3] == glm::vec4(2, 3, 4, 1));
    CHECK(scene.meshes[0].mesh.face_colors == std::vector<glm::vec3>(12, {1, 0, 0}));
    REQUIRE(scene.lights);
    CHECK(scene.lights->point[0].position == glm::vec3(0, 2, -2));
    CHECK(scene.lights->shading == Shading::phong);
    CHECK(scene.smoothing.depth_prior == Prior::cauchy);
    CHECK(scene.smoothing.sigma == 2e-3F);
    CHECK(scene.smoothing.gamma == 3e-2F);
    CHECK(scene.smoothing.alpha == 4);
    CHECK(scene.smoothing.samples == 16);
    CHECK(scene.smoothing.variance_reduction == VarianceReduction::none);
    CHECK(scene.smoothing.draws == Draws::stratified);
    CHECK(scene.smoothing.seed == std::numeric_limits<std::uint64_t>::max());
    CHECK(scene.smoothing.occupancy_threshold == 2e-4F);
    CHECK(*scene.smoothing.blur_radius == 9.21e-3F);
    CHECK(scene.smoothing.background_depth == 2e-10F);
    CHECK(scene.smoothing.distance == DistanceMetric::euclidean);
    CHECK_FALSE(scene.perspective_correct);
    CHECK(scene.gradients.positions);
    CHECK(scene.gradients.lights);
    CHECK_FALSE(scene.gradients.colors);
    CHECK_FALSE(scene.gradients.smoothing);
  }

  TEST_CASE("what is not given takes its default") {
    const TempDir folder;
    const Scene scene = read(folder, with(R"("camera": {"znear": 2}, "smoothing": {})"));
    CHECK(scene.width == 128);
    CHECK(scene.camera.view == glm::mat4(1));
    CHECK(scene.camera.fov_y_degrees == 60);
    CHECK(scene.camera.znear == 2);
    CHECK_FALSE(scene.camera.intrinsics);
    CHECK_FALSE(scene.lights);
    CHECK(scene.meshes[0].mesh.vertex_colors.empty());
    CHECK(scene.smoothing == Smoothing{});
    CHECK_FALSE(scene.smoothing.blur_radius);
    CHECK(scene.perspective_correct);
    CHECK(scene.cull == Cull::none);
    CHECK(scene.gradients.positions);
    CHECK_FALSE(scene.gradients.lights);
    CHECK(read(folder, with(R"("lights": {"shading": "gouraud"})")).lights->shading == Shading::gouraud);
    CHECK(read(folder, with(R"("lights": {"shading": "blinn"})")).lights->shading == Shading::blinn);
    CHECK(read(folder, with(R"("lights": {"shading": "microfacet"})")).lights->shading ==
          Shading::microfacet);
    CHECK_FALSE(read(folder, with(R"("gradients": [])")).gradients.camera);
    CHECK(read(folder, with(R"("cull": "back")")).cull == Cull::back);
    CHECK(read(folder, with(R"("cull": "front")")).cull == Cull::front);
  }

  TEST_CASE("lights of every kind") {
    const TempDir folder;
    const Lights lights = *read(folder, with(R"("lights": {
      "directional": [{"direction": [1, -2, 3], "diffuse": [0.1, 0.2, 0.3], "specular": [0.4, 0.5, 0.6]}, {}],
      "spot": [{"position": [4, 5, 6], "direction": [0, 0, -1], "angle_degrees": 25,
                "inner_angle_degrees": 15, "diffuse": [1, 0, 0]}, {"angle_degrees": 3}],
      "harmonics": [[1,2,3], [4,5,6], [7,8,9], [1,0,0], [2,0,0], [3,0,0], [4,0,0], [5,0,0], [6,0,7]]})"))
                               .lights;
    CHECK(lights.point.empty());
    REQUIRE(lights.directional.size() == 2);
    CHECK(lights.directional[0].direction == glm::vec3(1, -2, 3));
    CHECK(lights.directional[0].specular == glm::vec3(0.4F, 0.5F, 0.6F));
    CHECK(lights.directional[1].direction == DirectionalLight{}.direction);
    REQUIRE(lights.spot.size() == 2);
    CHECK(lights.spot[0].position == glm::vec3(4, 5, 6));
    CHECK(lights.spot[0].direction == glm::vec3(0, 0, -1));
    CHECK(lights.spot[0].angle_degrees == 25);
    CHECK(lights.spot[0].inner_angle_degrees == 15);
    CHECK(lights.spot[0].diffuse == glm::vec3(1, 0, 0));
    CHECK(lights.spot[1].angle_degrees == 3);
    REQUIRE(lights.harmonics.size() == k_harmonics);
    CHECK(lights.harmonics[1] == glm::vec3(4, 5, 6));
    CHECK(lights.harmonics[8] == glm::vec3(6, 0, 7));
  }

  TEST_CASE("matrices are rows; intrinsics instead of the field of view") {
    const TempDir folder;
    const Scene scene = read(folder, with(R"("camera": {"view": [[0,0,1,5],[0,1,0,6],[-1,0,0,7],[0,0,0,1]],
                                             "intrinsics": {"fx": 1, "fy": 2, "cx": 3, "cy": -4}})"));
    CHECK(scene.camera.view * glm::vec4(1, 2, 3, 1) == glm::vec4(8, 8, 6, 1));
    REQUIRE(scene.camera.intrinsics);
    CHECK(scene.camera.intrinsics->fy == 2);
    CHECK(scene.camera.intrinsics->cy == -4);
  }

  TEST_CASE("lenses and orthographic cameras") {
    const TempDir folder;
    Scene scene = read(folder, with(R"("camera": {"distortion": [1, 2, 3, 4, 5], "projection": "perspective"},
                                       "gradients": ["distortion"])"));
    REQUIRE(scene.camera.distortion);
    CHECK(scene.camera.distortion->k2 == 2);
    CHECK(scene.camera.distortion->p1 == 3);
    CHECK(scene.camera.distortion->k3 == 5);
    CHECK(scene.gradients.distortion);
    CHECK_FALSE(scene.gradients.camera);
    scene = read(folder, with(R"("camera": {"fisheye": [1, 2, 3, 4]})"));
    CHECK(scene.camera.distortion == fisheye(1, 2, 3, 4));
    scene = read(folder, with(R"("camera": {"projection": "orthographic", "orthographic_height": 3})"));
    CHECK(scene.camera.orthographic_height == 3);
    CHECK_FALSE(scene.camera.distortion);
  }

  TEST_CASE("colours: one for all, one for each, in place of the file's") {
    const TempDir folder;
    Scene scene = read(folder, with_mesh(k_triangle + R"(, "vertex_colors": [[0,1,0]])"));
    CHECK(scene.meshes[0].mesh.vertex_colors == std::vector<glm::vec3>(3, {0, 1, 0}));
    scene = read(folder, with_mesh(k_triangle + R"(, "vertex_colors": [[0,1,0],[1,0,0],[0,0,1]])"));
    CHECK(scene.meshes[0].mesh.vertex_colors[2] == glm::vec3(0, 0, 1));
    folder.write("mesh.obj", "v 0 0 0 1 1 0\nv 1 0 0 1 1 0\nv 0 1 0 1 1 0\nf 1 2 3\n");
    scene = read(folder, with_mesh(R"("file": "mesh.obj")"));
    CHECK(scene.meshes[0].mesh.vertex_colors[0] == glm::vec3(1, 1, 0));
    scene = read(folder, with_mesh(R"("file": "mesh.obj", "face_colors": [[0,0,1]])"));
    CHECK(scene.meshes[0].mesh.vertex_colors.empty());
    CHECK(scene.meshes[0].mesh.face_colors[0] == glm::vec3(0, 0, 1));
  }

  TEST_CASE("textures") {
    const TempDir folder;
    write_texture(folder / "t.exr", {2, 1, {glm::vec3(0.5F), glm::vec3(1)}});
    const std::string coordinates = R"(, "texcoords": [[0,0],[1,0.5]], "face_texcoords": [[0,1,1]])";
    const Mesh plain = read(folder, with_mesh(k_triangle + coordinates + R"(, "texture": {"file": "t.exr"})"))
                           .meshes[0]
                           .mesh;
    CHECK(plain.texcoords == std::vector<glm::vec2>{{0, 0}, {1, 0.5F}});
    CHECK(plain.face_texcoords == std::vector<glm::uvec3>{{0, 1, 1}});
    REQUIRE(plain.textures.size() == 1);
    CHECK(plain.textures[0].texels[0] == glm::vec3(0.5F));
    CHECK(plain.textures[0].wrap == Wrap::repeat);
    CHECK(plain.textures[0].filter == Filter::bilinear);
    const std::string words = R"(, "texture": {"file": "t.exr", "wrap": "mirror", "filter": "trilinear"})";
    const Mesh mesh = read(folder, with_mesh(k_triangle + coordinates + words)).meshes[0].mesh;
    CHECK(mesh.textures[0].wrap == Wrap::mirror);
    CHECK(mesh.textures[0].filter == Filter::trilinear);
    const auto fails = [&](const std::string& members, const std::string& message) {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, read(folder, with_mesh(k_triangle + members)), message);
    };
    fails(R"(, "texture": {"file": "t.exr"})", "a texture on a mesh without texture coordinates");
    fails(R"(, "texcoords": [[0,0]])", "one of texcoords and face_texcoords");
    fails(R"(, "texcoords": [[0,0]], "face_texcoords": [[0,0,1]])", "face_texcoords[0]");
    fails(coordinates + R"(, "texture": {"file": "t.exr", "wrap": "round"})",
          "expected repeat, mirror or clamp");
    fails(coordinates + R"(, "texture": {"file": "t.exr", "filter": "cubic"})",
          "expected nearest, bilinear or trilinear");
  }

  TEST_CASE("normals and materials, in place of the file's") {
    const TempDir folder;
    folder.write("m.mtl", "newmtl a\nKs 0.5 0.5 0.5\n");
    folder.write("mesh.obj",
                 "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nusemtl a\nf 1//1 2//1 3//1\n");
    const auto mesh_with = [&](const std::string& members) {
      return read(folder, with_mesh(R"("file": "mesh.obj")" + members)).meshes[0].mesh;
    };
    CHECK(mesh_with("").materials == std::vector<Material>{{glm::vec3(0.5F), std::nullopt}});
    CHECK(mesh_with("").face_normals == std::vector<glm::uvec3>{{0, 0, 0}});
    CHECK(mesh_with(R"(, "normals": [], "face_normals": [])").face_normals.empty());
    const Mesh mesh = mesh_with(R"(, "normals": [[0,0,2],[0,1,1]], "face_normals": [[0,1,1]],
                                   "material": {"specular": [1,0.5,0.25], "shininess": 8})");
    CHECK(mesh.normals == std::vector<glm::vec3>{{0, 0, 2}, {0, 1, 1}});
    CHECK(mesh.face_normals == std::vector<glm::uvec3>{{0, 1, 1}});
    CHECK(mesh.materials == std::vector<Material>{{{1, 0.5F, 0.25F}, 8.0F}});
    CHECK(mesh_with(R"(, "material": {})").materials == std::vector<Material>(1));
    const auto fails = [&](const std::string& members, const std::string& message) {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, mesh_with(members), message);
    };
    fails(R"(, "normals": [[0,0,1]])", "one of normals and face_normals");
    fails(R"(, "normals": [[0,0,1]], "face_normals": [[0,0,1]])", "normal 1");
    fails(R"(, "material": {"shininess": 0.5})", "shininess of materials[0]");
    fails(R"(, "material": {"diffuse": [1,1,1]})", "diffuse");
  }

  TEST_CASE("presets and estimators") {
    const TempDir folder;
    Smoothing smoothing = read(folder, with(R"("smoothing": {"preset": "softras"})")).smoothing;
    CHECK(smoothing.depth_prior == Prior::gumbel);
    smoothing =
        read(folder, with(R"("smoothing": {"preset": "softras", "depth_prior": "gaussian", "sigma": 0.1})"))
            .smoothing;
    CHECK(smoothing.occupancy_prior == Prior::logistic);
    CHECK(smoothing.depth_prior == Prior::gaussian);
    CHECK(blur_radius(smoothing) == doctest::Approx(0.921).epsilon(1e-4));  // the preset's follows sigma
    smoothing =
        read(folder, with(R"("smoothing": {"preset": "softras", "sigma": 0.1, "blur_radius": 2})")).smoothing;
    CHECK(blur_radius(smoothing) == 2);
    smoothing = read(folder, with(R"("smoothing": {"estimator": "monte_carlo"})")).smoothing;
    CHECK(smoothing.occupancy_estimator == Estimator::monte_carlo);
    CHECK(smoothing.aggregation_estimator == Estimator::monte_carlo);
    smoothing =
        read(folder, with(R"("smoothing": {"occupancy_estimator": "exact", "estimator": "monte_carlo"})"))
            .smoothing;
    CHECK(smoothing.occupancy_estimator == Estimator::exact);
    CHECK(smoothing.aggregation_estimator == Estimator::monte_carlo);
    smoothing =
        read(folder, with(R"("smoothing": {"preset": "paper_cauchy", "aggregation_estimator": "exact"})"))
            .smoothing;
    CHECK(smoothing.occupancy_estimator == Estimator::monte_carlo);
    CHECK(smoothing.aggregation_estimator == Estimator::exact);
    // One pixel of this scene.
    smoothing =
        read(folder, with(R"("width": 80, "height": 50, "smoothing": {"preset": "opendr"})")).smoothing;
    CHECK(smoothing.sigma == 0.04F);
    smoothing = read(folder, with(R"("smoothing": {"preset": "nmr", "sigma": 1e-2})")).smoothing;
    CHECK(smoothing.occupancy_width == OccupancyWidth::variable);
    CHECK(blur_radius(smoothing) == 0.5F);  // sigma is no width here
    smoothing = read(folder, with(R"("smoothing": {"occupancy_width": "fixed"})")).smoothing;
    CHECK(smoothing.occupancy_width == OccupancyWidth::fixed);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("files that are not scenes") {
    const TempDir folder;
    DPR_CHECK_MESSAGE_HAS(IoError, read_scene(folder / "no.json"), "does not exist");
    DPR_CHECK_MESSAGE_HAS(IoError, read_scene(folder.path()), "folder");
    DPR_CHECK_MESSAGE_HAS(IoError, read(folder, ""), "S.json:1: not JSON");
    DPR_CHECK_MESSAGE_HAS(IoError, read(folder, "{\n\"width\": 3,\n}"), "S.json:3: not JSON");
    DPR_CHECK_MESSAGE_HAS(IoError, read(folder, "{\n\"width\": NaN}"), "S.json:2: not JSON");
    DPR_CHECK_MESSAGE_HAS(IoError, read(folder, "{\"width\": 1e999}"), "S.json");
    DPR_CHECK_MESSAGE_HAS(IoError, read(folder, "{} x"), "S.json:1: not JSON");
    DPR_CHECK_MESSAGE_HAS(IoError, read(folder, "{\"a\": \"\xff\"}"), "not JSON");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, read(folder, "[1, 2]"), "got a list of 2, expected an object");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, read(folder, "{}"), "got no key \"meshes\"");
    DPR_CHECK_MESSAGE_HAS(IoError, read(folder, with_mesh(R"("file": "no.obj")")),
                          "no.obj: the file does not exist, which meshes[0].file (");
  }

  TEST_CASE("unknown keys are named, with their object") {
    const TempDir folder;
    const auto check = [&](const std::string& text, const std::string& part) {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, read(folder, text), part);
    };
    check(with(R"("widht": 3)"), "got the unknown key \"widht\", expected keys out of width, height");
    check(with(R"("camera": {"fov": 60})"), "camera (");
    check(with(R"("camera": {"fov": 60})"), "got the unknown key \"fov\"");
    check(with(R"("camera": {"intrinsics": {"f": 1}})"), "camera.intrinsics (");
    check(with(R"("lights": {"point": [{}, {"colour": 1}]})"), "lights.point[1] (");
    check(with(R"("lights": {"spot": [{"angle": 1}]})"), "lights.spot[0] (");
    check(with(R"("lights": {"area": []})"), "\"area\", expected keys out of ambient, harmonics");
    check(with(R"("lights": {"harmonics": [[1, 1, 1]]})"), "lights.harmonics (");
    check(with(R"("lights": {"directional": [{"direction": [0, 0, 0]}]})"),
          "lights.directional[0].direction (");
    check(with(R"("lights": {"shading": "matt"})"), "flat, phong, gouraud, blinn or microfacet");
    check(with(R"("smoothing": {"Sigma": 1})"), "smoothing (");
    check(with_mesh(R"("file": "a", "colour": 1)"), "meshes[0] (");
    check(R"({"camera": {"view": 1, "znear": 1, "view": 2}})", "camera.view (");
    check(R"({"camera": {"view": 1, "znear": 1, "view": 2}})", "got the key twice");
  }

  TEST_CASE("values of the wrong type say where they are") {
    const TempDir folder;
    const auto check = [&](const std::string& text, const std::string& part) {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, read(folder, text), part);
    };
    check(with(R"("width": "3")"), "width (");
    check(with(R"("width": 3.5)"), "got 3.5, expected a whole number");
    check(with(R"("width": -1)"), "got -1, expected a whole number from 1 to 16384");
    check(with(R"("width": 99999)"), "got 99999, expected a whole number from 1 to 16384");
    check(with(R"("background": [0, 0])"), "got a list of 2, expected a list of 3");
    check(with(R"("background": [0, 0, null])"), "background[2] (");
    check(with(R"("lights": null)"), "lights (");
    check(with(R"("perspective_correct": 1)"), "got 1, expected true or false");
    check(with(R"("gradients": ["colour"])"), "gradients[0] (");
    check(with(R"("gradients": ["colors", "colors"])"), "got \"colors\" twice");
    check(with(R"("smoothing": {"sigma": "small"})"), "got \"small\", expected a number");
    check(with(R"("smoothing": {"sigma": 1e300})"), "32-bit floats");
    check(with(R"("smoothing": {"depth_prior": "normal"})"), "smoothing.depth_prior (");
    check(with(R"("smoothing": {"samples": 1e3})"), "smoothing.samples (");
    check(with(R"("smoothing": {"preset": "soft"})"), "got \"soft\", expected softras");
    check(with(R"("smoothing": {"occupancy_width": "wide"})"),
          "got \"wide\", expected fixed, variable or zero");
    check(with(R"("smoothing": {"occupancy_width": "variable"})"), "smoothing.occupancy_width (");
    check(with(R"("lights": {"shading": "smooth"})"), "expected flat, phong, gouraud, blinn or microfacet");
    check(with(R"("camera": {"intrinsics": {"fx": 1, "fy": 1, "cx": 0}})"), "got no key \"cy\"");
    const std::string rows = R"([[1,0,0,0],[0,1,0,0],[0,0,1],[0,0,0,1]])";
    check(with_mesh(k_triangle + R"(, "transform": )" + rows), "meshes[0].transform[2] (");
    check(with_mesh(R"("positions": [[0,0,0]], "faces": [[0,0,0,0]])"), "meshes[0].faces[0] (");
    check(with_mesh(R"("positions": [[0,0,0]], "faces": [[0,-1,0]])"), "meshes[0].faces[0][1] (");
  }

  TEST_CASE("instances are places of a mesh that comes before them") {
    const TempDir folder;
    const auto text = [](const std::string& second) {
      return R"({"meshes": [{)" + k_triangle + "}, {" + second + "}]}";
    };
    const Scene scene =
        read(folder, text(R"("instance_of": 0, "transform": [[1,0,0,2],[0,1,0,3],[0,0,1,4],[0,0,0,1]])"));
    REQUIRE(scene.meshes.size() == 2);
    CHECK_FALSE(scene.meshes[0].instance_of.has_value());
    CHECK(scene.meshes[1].instance_of == 0U);
    CHECK(scene.meshes[1].mesh.positions.empty());
    CHECK(scene.meshes[1].transform[3] == glm::vec4(2, 3, 4, 1));
    CHECK(&mesh_of(scene, 1) == &scene.meshes[0].mesh);
    const auto check = [&](const std::string& second, const std::string& part) {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, read(folder, text(second)), part);
    };
    check(R"("instance_of": 1)",
          "S.json): got 1, which is the instance itself, expected the number of an earlier");
    check(R"("instance_of": -1)", "meshes[1].instance_of");
    check(R"("instance_of": 0, "face_colors": [[1, 0, 0]])", "face_colors");
  }

  TEST_CASE("contradictions") {
    const TempDir folder;
    const auto check = [&](const std::string& text, const std::string& part) {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, read(folder, text), part);
    };
    check(with_mesh(R"("file": "a.obj", )" + k_triangle), "got file beside positions or faces");
    check(with_mesh(R"("transform": [])"), "got no mesh");
    check(with_mesh(R"("positions": [[0,0,0]])"), "got no key \"faces\"");
    check(with_mesh(k_triangle + R"(, "vertex_colors": [[1,1,1]], "face_colors": [[1,1,1]])"),
          "one of the two");
    check(with_mesh(k_triangle + R"(, "vertex_colors": [[1,1,1],[1,1,1]])"),
          "got 2 colours, expected one, or 3");
    check(with_mesh(k_triangle + R"(, "vertex_colors": [])"), "got 0 colours");
    check(with(R"("camera": {"fov_y_degrees": 60, "intrinsics": {"fx": 1, "fy": 1, "cx": 0, "cy": 0}})"),
          "got fov_y_degrees and intrinsics");
    check(with(R"("camera": {"projection": "fisheye"})"), "got \"fisheye\", expected perspective or");
    check(with(R"("camera": {"projection": "orthographic"})"), "got no key \"orthographic_height\"");
    check(with(R"("camera": {"projection": "orthographic", "fov_y_degrees": 9})"),
          "got no key \"orthographic_height\"");
    check(with(R"("camera": {"orthographic_height": 1})"), "got orthographic_height without");
    check(with(R"("camera": {"projection": "orthographic", "orthographic_height": 1, "fov_y_degrees": 9})"),
          "got fov_y_degrees and an orthographic projection");
    check(with(R"("camera": {"distortion": [0, 0]})"), "camera.distortion (");
    check(with(R"("camera": {"fisheye": [0, 0, 0, 0, 0]})"), "camera.fisheye (");
    check(with(R"("camera": {"fisheye": [0, 0, 0, 0], "distortion": [0, 0, 0, 0, 0]})"),
          "got distortion and fisheye, expected one of the two");
    check(with(R"("camera": {"projection": "orthographic", "orthographic_height": 1,
                             "fisheye": [0, 0, 0, 0]})"),
          "got fisheye and an orthographic projection");
  }

  TEST_CASE("scenes that cannot be rendered") {
    const TempDir folder;
    const auto check = [&](const std::string& text, const std::string& part) {
      DPR_CHECK_MESSAGE_HAS(InvalidArgument, read(folder, text), part);
    };
    check(R"({"meshes": []})", "S.json): got none");
    check(with(R"("width": 0)"), "S.json): got 0, expected a whole number from 1 to 16384");
    check(with(R"("height": 16385)"), "S.json): got 16385, expected a whole number from 1 to 16384");
    check(with(R"("camera": {"znear": -1})"), "camera.znear (");
    check(with(R"("cull": "both")"), "got \"both\", expected none, back or front");
    check(with(R"("lights": {"shininess": 0})"), "lights.shininess (");
    check(with(R"("smoothing": {"alpha": 0})"), "smoothing.alpha (");
    check(with(R"("smoothing": {"estimator": "monte_carlo", "depth_prior": "uniform"})"), "uniform");
    check(with_mesh(R"("positions": [[0,0,0]], "faces": [[0,0,1]])"), "meshes[0].faces[0] (");
    check(with_mesh(R"("positions": [[0,0,0]], "faces": [])"), "meshes[0].faces (");
    const std::string flat = R"([[1,0,0,0],[0,1,0,0],[0,0,0,0],[0,0,0,1]])";
    check(with_mesh(k_triangle + R"(, "transform": )" + flat), "S.json): got a singular matrix");
    Scene scene = read(folder, with(""));
    scene.background.r = std::numeric_limits<float>::quiet_NaN();
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, validate(scene), "background (scene)");
  }
}

}  // namespace scene_json_test
