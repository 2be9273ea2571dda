// Models that pages show: their data are the meshes' and the cameras', and stay within their script element.
#include "cli/page_model.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string_view>

#include "cli/page.hpp"
#include "cli/page_script.hpp"
#include "support/messages.hpp"
#include "support/page.hpp"
#include "support/temp_dir.hpp"

namespace page_model_test {

namespace {

using dpr::cli::Model;
using dpr::cli::ModelCamera;
using dpr::test::contains;
using dpr::test::count_of;
using dpr::test::TempDir;
using nlohmann::json;

std::string bytes_of(std::string_view base64) {
  constexpr std::string_view k_digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  REQUIRE(base64.size() % 4 == 0);
  std::string bytes;
  for (std::size_t i = 0; i < base64.size(); i += 4) {
    std::uint32_t bits = 0;
    std::size_t count = 3;
    for (std::size_t k = 0; k < 4; ++k) {
      const bool is_padding = base64[i + k] == '=';
      if (is_padding) --count;
      bits = bits << 6U | (is_padding ? 0 : static_cast<std::uint32_t>(k_digits.find(base64[i + k])));
    }
    for (std::size_t k = 0; k < count; ++k) bytes += static_cast<char>(bits >> (16 - 8 * k) & 0xffU);
  }
  return bytes;
}

template <class Number>
std::vector<Number> numbers_of(const json& base64) {
  const std::string bytes = bytes_of(base64.get<std::string>());
  std::vector<Number> numbers(bytes.size() / sizeof(Number));
  std::memcpy(numbers.data(), bytes.data(), bytes.size());  // the tests' machines are little-endian
  return numbers;
}

Model cube_model() {
  Model model;
  model.heading = "Cube";
  add_mesh(model, dpr::make_cube());
  model.start = overview(model);
  return model;
}

glm::vec3 point(const json& numbers) { return {numbers[0], numbers[1], numbers[2]}; }

void check_is(glm::vec3 found, glm::vec3 expected) {
  for (int k = 0; k < 3; ++k) CHECK(found[k] == doctest::Approx(expected[k]).epsilon(1e-4));
}

std::string page_with(const Model& model) {
  const TempDir folder;
  dpr::cli::Page page({"t", "c", "d"});
  page.add_model(model);
  page.write(folder / "page.html");
  return folder.read("page.html");
}

bool has_three() { return !dpr::cli::three_js().empty(); }

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("model: its data decode to the vertices, colours and faces of the meshes") {
    Model model;
    const dpr::Mesh mesh{.positions = {{0.1F, -2, 3e10F}, {1, 2, 3}, {4, 5, 6}, {7, 8, 9}},
                         .faces = {{0, 1, 2}, {2, 1, 3}},
                         .vertex_colors = {{0, 0.5F, 1}, {2, -1, 0}, {1, 1, 1}, {0.001F, 0, 0}},
                         .face_colors = {},
                         .texcoords = {},
                         .face_texcoords = {},
                         .textures = {},
                         .face_textures = {}};
    add_mesh(model, mesh);
    glm::mat4 shift(1.0F);
    shift[3] = {10, 20, 30, 1};
    add_mesh(model, mesh, shift);
    const json data = json::parse(model_data(model));
    const auto positions = numbers_of<float>(data["positions"]);
    REQUIRE(positions.size() == 24);
    CHECK(positions[0] == 0.1F);
    CHECK(positions[2] == 3e10F);
    CHECK(positions[11] == 9);
    CHECK(positions[15] == 11);
    CHECK(positions[23] == 39);
    const auto colors = numbers_of<std::uint8_t>(data["colors"]);
    const std::vector<std::uint8_t> expected{0, 188, 255, 255, 0, 0, 255, 255, 255, 3, 0, 0};
    REQUIRE(colors.size() == 24);
    CHECK(std::vector(colors.begin(), colors.begin() + 12) == expected);
    CHECK(numbers_of<std::uint32_t>(data["faces"]) ==
          std::vector<std::uint32_t>{0, 1, 2, 2, 1, 3, 4, 5, 6, 6, 5, 7});
    CHECK(data["cameras"].empty());
  }

  TEST_CASE("model: colours of faces stay sharp, normals come from all faces around a vertex") {
    Model model;
    dpr::Mesh roof{.positions = {{0, 0, 0}, {0, 0, -1}, {-1, -1, 0}, {1, -1, 0}},
                   .faces = {{0, 1, 2}, {0, 3, 1}},
                   .vertex_colors = {},
                   .face_colors = {{1, 0, 0}, {0, 1, 0}},
                   .texcoords = {},
                   .face_texcoords = {},
                   .textures = {},
                   .face_textures = {}};
    add_mesh(model, roof);
    REQUIRE(model.positions.size() == 6);
    CHECK(model.colors[1] == glm::vec3(1, 0, 0));
    CHECK(model.colors[3] == glm::vec3(0, 1, 0));
    check_is(model.normals[0], {0, 1, 0});  // of the ridge
    check_is(model.normals[2], glm::normalize(glm::vec3(-1, 1, 0)));
    const auto normals = numbers_of<std::int8_t>(json::parse(model_data(model))["normals"]);
    CHECK(normals[1] == 127);
    CHECK(normals[6] == -90);
    roof.face_colors.clear();
    Model plain;
    add_mesh(plain, roof);
    CHECK(plain.positions.size() == 4);
    CHECK(plain.colors[3] == glm::vec3(1));
  }

  TEST_CASE("model: faces are in the order of their textures, which lie in the page") {
    dpr::Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.faces = {{0, 1, 2}, {2, 1, 0}, {1, 2, 0}};
    mesh.texcoords = {{0, 0}, {1, 0}, {0, 1}, {0.5F, 2}};
    mesh.face_texcoords = {{0, 1, 2}, {2, 1, 0}, {3, 2, 0}};
    mesh.textures = {{2, 1, {{1, 0, 0}, {0, 1, 0}}, dpr::Wrap::mirror}, {1, 1, {{1, 1, 1}}}};
    mesh.face_textures = {dpr::k_no_texture, 1, 0};
    Model model;
    add_mesh(model, dpr::make_icosphere(0));
    const auto first = static_cast<std::uint32_t>(model.positions.size());
    add_mesh(model, mesh);
    CHECK(model.positions.size() == first + 4);  // the vertex with two texture coordinates is two
    const json data = json::parse(model_data(model));
    REQUIRE(data["textures"].size() == 2);
    CHECK(data["textures"][0]["wrap"] == "MirroredRepeat");
    CHECK(data["textures"][1]["wrap"] == "Repeat");
    for (const json& texture : data["textures"]) {
      CHECK(texture["faces"] == 1);
      CHECK(texture["picture"].get<std::string>().starts_with("data:image/png;base64,"));
    }
    const auto faces = numbers_of<std::uint32_t>(data["faces"]);
    CHECK(std::vector(faces.begin(), faces.begin() + 6) ==
          std::vector<std::uint32_t>{first + 3, first + 2, first, first + 2, first + 1, first});
    const auto texcoords = numbers_of<float>(data["texcoords"]);
    CHECK(texcoords.size() == 2 * model.positions.size());
    CHECK(texcoords[2 * (first + 3)] == 0.5F);
    CHECK(texcoords[2 * (first + 3) + 1] == 2);
    CHECK_FALSE(json::parse(model_data(cube_model())).contains("texcoords"));
  }

  TEST_CASE("model: a camera is a pyramid from its centre to the corners of its picture") {
    Model model = cube_model();
    dpr::Camera camera;
    camera.view[3] = {-1, -2, -3, 1};  // it stands at (1, 2, 3)
    camera.fov_y_degrees = 90;
    model.cameras = {{.camera = camera, .width = 40, .height = 20, .depth = 2, .label = "0", .name = "a"}};
    dpr::Camera flat = camera;
    flat.orthographic_height = 4.0F;
    model.cameras.push_back(
        {.camera = flat, .width = 40, .height = 20, .depth = 2, .label = "1", .name = "b"});
    model.cameras[1].picture = dpr::Image(4, 2);
    const json cameras = json::parse(model_data(model))["cameras"];
    REQUIRE(cameras.size() == 2);
    check_is(point(cameras[0]["near"][2]), {1, 2, 3});
    check_is(point(cameras[0]["far"][0]), {1 - 4, 2 - 2, 1});
    check_is(point(cameras[0]["far"][2]), {1 + 4, 2 + 2, 1});
    CHECK_FALSE(cameras[0].contains("picture"));
    check_is(point(cameras[1]["near"][1]), {1 + 4, 2 - 2, 3});
    check_is(point(cameras[1]["far"][3]), {1 - 4, 2 + 2, 1});
    const std::string picture = cameras[1]["picture"];
    CHECK(picture.starts_with("data:image/png;base64,"));
    CHECK(bytes_of(std::string_view(picture).substr(22)).starts_with("\x89PNG"));
  }

  TEST_CASE("model: the first view is a camera's own, or has everything in sight") {
    Model model = cube_model();
    model.start.camera = {};
    model.start.camera.view[3] = {0, 0, -5, 1};
    model.start.camera.intrinsics = dpr::Intrinsics{10, 10, 5, 10};
    model.start.width = model.start.height = 20;
    json start = json::parse(model_data(model))["start"];
    CHECK(start["matrix"][14] == 5.0);
    CHECK(start["tangents"][0].get<double>() == doctest::Approx(1.5));  // 15 pixels to the right
    CHECK(start["tangents"][1].get<double>() == doctest::Approx(1));
    model.start.camera.intrinsics.reset();
    model.start.camera.orthographic_height = 2.0F;
    start = json::parse(model_data(model))["start"];
    CHECK(start["matrix"][14].get<double>() == doctest::Approx(5 + 200));
    CHECK(start["tangents"][1].get<double>() == doctest::Approx(1.0 / 200));

    for (int i = 0; i < 6; ++i)
      model.cameras.push_back({.camera = dpr::orbit_camera(5, 20, 60.0F * static_cast<float>(i))});
    model.up = common_up(model.cameras);
    check_is(model.up, {0, 1, 0});
    const dpr::cli::Viewpoint all = overview(model);
    const float tangent = std::tan(glm::radians(all.camera.fov_y_degrees / 2));
    std::vector<glm::vec3> points = model.positions;
    for (const ModelCamera& camera : model.cameras) points.emplace_back(glm::inverse(camera.camera.view)[3]);
    for (const glm::vec3& p : points) {
      const glm::vec4 seen = all.camera.view * glm::vec4(p, 1);
      CHECK(seen.z < 0);
      CHECK(std::max(std::abs(seen.x), std::abs(seen.y)) < -seen.z * tangent);
    }
    model.cameras.resize(1);
    model.up = glm::normalize(glm::vec3(glm::inverse(model.cameras[0].camera.view)[3]));  // above it
    CHECK(std::isfinite(overview(model).camera.view[3][2]));
  }

  TEST_CASE("page: a model needs nothing but the page, and its texts are text") {
    Model model = cube_model();
    model.heading = "<b>Cube</b>";
    model.caption = "<i>";
    model.cameras = {{.width = 4, .height = 3, .label = "</script><b>", .name = "a\"<!--\xff"}};
    const std::string data = model_data(model);
    CHECK_FALSE(contains(data, "<"));
    CHECK(json::parse(data)["cameras"][0]["label"] == "</script><b>");
    const std::string page = page_with(model);
    CHECK(contains(page, "class=\"model\" hidden") == has_three());
    CHECK(contains(page, "has no WebGL") == has_three());
    CHECK(contains(page, "&lt;b&gt;Cube&lt;/b&gt;") == has_three());
    const std::string own = dpr::test::own_text(page);
    for (const char* part : {"<b>", "<i>", "<link", "src=\"", "url(", "import ", "http"})
      CHECK_FALSE(contains(own, part));
    CHECK(count_of(page, "<script") == count_of(page, "</script"));
    CHECK(count_of(page, "<script") == (has_three() ? 4 : 1));
  }

  TEST_CASE("page: three.js is in it once for several models, and not without one") {
    const TempDir folder;
    dpr::cli::Page page({"t", "c", "d"});
    page.write(folder / "page.html");
    CHECK_FALSE(contains(folder.read("page.html"), "THREE"));
    page.add_model(cube_model());
    page.add_model(cube_model());
    page.write(folder / "page.html");
    CHECK(count_of(folder.read("page.html"), "// three.js, Copyright") == (has_three() ? 1 : 0));
  }

  TEST_CASE("page: a model of too many triangles is left out, which the page says") {
    Model model = cube_model();
    model.faces.resize(dpr::cli::k_most_model_faces + 1);
    model.face_textures.resize(model.faces.size(), dpr::k_no_texture);
    const std::string page = page_with(model);
    CHECK_FALSE(contains(page, "class=\"model\""));
    CHECK(contains(page, "it has 300001 triangles, and a page at most 300000") == has_three());
    model.faces.pop_back();
    model.face_textures.pop_back();
    CHECK(contains(page_with(model), "class=\"model\"") == has_three());
  }
}

}  // namespace page_model_test
