// glTF files: triangles where the scene's nodes place them, with what their vertices and materials say; written files
// read back as the same; what cannot be read is refused with its place in the JSON.
#include <doctest/doctest.h>

#include <nlohmann/json.hpp>

#include "dpr/error.hpp"
#include "dpr/image.hpp"
#include "dpr/mesh.hpp"
#include "dpr/notes.hpp"
#include "mesh/little_endian.hpp"
#include "support/messages.hpp"
#include "support/temp_dir.hpp"

namespace gltf_test {

using namespace dpr;
using dpr::test::contains;
using dpr::test::TempDir;
using Json = nlohmann::json;

namespace {

/// A document whose buffer is the file data.bin beside it.
class Document {
 public:
  /// Appends numbers as one accessor; its number.
  template <typename Number>
  std::size_t add(const std::vector<Number>& numbers, int component, const std::string& type,
                  std::size_t components, bool normalized = false) {
    const std::size_t begin = bytes.size();
    for (const Number number : numbers) bytes.append(reinterpret_cast<const char*>(&number), sizeof number);
    json["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", begin}, {"byteLength", bytes.size() - begin}});
    json["accessors"].push_back({{"bufferView", json["bufferViews"].size() - 1},
                                 {"componentType", component},
                                 {"count", numbers.size() / components},
                                 {"type", type},
                                 {"normalized", normalized}});
    bytes.resize((bytes.size() + 3) / 4 * 4);
    return json["accessors"].size() - 1;
  }
  std::size_t add_vectors(const std::vector<float>& numbers, std::size_t components) {
    return add(numbers, 5126, "VEC" + std::to_string(components), components);
  }
  std::size_t add_indices(const std::vector<std::uint16_t>& numbers) {
    return add(numbers, 5123, "SCALAR", 1);
  }

  Json& primitive() { return json["meshes"][0]["primitives"][0]; }

  std::filesystem::path write(const TempDir& folder) {
    folder.write("data.bin", bytes);
    json["buffers"] = Json::array({{{"byteLength", bytes.size()}, {"uri", "data.bin"}}});
    return folder.write("mesh.gltf", json.dump());
  }

  Json json = Json::parse(R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
                              "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {}}]}]})");
  std::string bytes;
};

/// A square of two triangles in z = 0.
Document square() {
  Document document;
  document.primitive()["attributes"]["POSITION"] =
      document.add_vectors({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, 3);
  document.primitive()["indices"] = document.add_indices({0, 1, 2, 0, 2, 3});
  return document;
}

const std::vector<glm::vec3> k_square{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};

Json texture_reference(Document& document, const Json& image) {
  document.json["images"] = Json::array({image});
  document.json["textures"] = Json::array({{{"source", 0}, {"sampler", 0}}});
  document.json["samplers"] = Json::array({{{"wrapS", 33071}, {"wrapT", 33071}, {"minFilter", 9987}}});
  document.json["materials"] =
      Json::array({{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}});
  document.primitive()["material"] = 0;
  document.primitive()["attributes"]["TEXCOORD_0"] = document.add_vectors({0, 1, 1, 1, 1, 0, 0, 0}, 2);
  return document.json["materials"][0]["pbrMetallicRoughness"];
}

void check_refused(const TempDir& folder, Document document, const std::string& place,
                   const std::string& reason) {
  CAPTURE(place);
  try {
    read_mesh(document.write(folder));
    FAIL("was read");
  } catch (const Error& error) {
    CHECK_MESSAGE(contains(error.what(), place), error.what());
    CHECK_MESSAGE(contains(error.what(), reason), error.what());
  }
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("glTF: vertices, triangles, strips and fans") {
    const TempDir folder;
    Document document = square();
    Mesh mesh = read_mesh(document.write(folder));
    CHECK(mesh.positions == k_square);
    CHECK(mesh.faces == std::vector<glm::uvec3>{{0, 1, 2}, {0, 2, 3}});
    CHECK(mesh.vertex_colors.empty());
    CHECK(mesh.face_colors.empty());
    CHECK(mesh.texcoords.empty());
    CHECK(mesh.normals.empty());
    document.primitive()["indices"] = document.add_indices({0, 1, 3, 2});
    document.primitive()["mode"] = 5;
    CHECK(read_mesh(document.write(folder)).faces == std::vector<glm::uvec3>{{0, 1, 2}, {1, 3, 2}});
    document.primitive()["indices"] = document.add_indices({3, 0, 1, 2});
    document.primitive()["mode"] = 6;
    CHECK(read_mesh(document.write(folder)).faces == std::vector<glm::uvec3>{{0, 1, 2}, {0, 2, 3}});
    document.primitive().erase("indices");
    CHECK(read_mesh(document.write(folder)).positions == k_square);
  }

  TEST_CASE("glTF: nodes move their meshes, mirrors turn triangles over, another scene stays out") {
    const TempDir folder;
    Document document = square();
    document.primitive()["attributes"]["NORMAL"] =
        document.add_vectors({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, 3);
    const float half = std::sqrt(0.5F);
    document.json["nodes"] =
        Json::array({{{"children", {1, 2}}, {"translation", {0, 0, 5}}},
                     {{"mesh", 0}, {"rotation", {0, 0, half, half}}, {"scale", {2, 1, 1}}},
                     {{"mesh", 0}, {"matrix", {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 10, 0, 0, 1}}},
                     {{"mesh", 0}}});
    const Mesh mesh = read_mesh(document.write(folder));
    REQUIRE(mesh.positions.size() == 8);
    CHECK(glm::distance(mesh.positions[1], glm::vec3(0, 2, 5)) <
          1e-6F);  // (1, 0, 0), stretched, turned, moved
    CHECK(mesh.positions[5] == glm::vec3(9, 0, 5));
    CHECK(mesh.faces[2] == glm::uvec3(4, 6, 5));
    // Where they lie, triangles and normals look the same way.
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      const glm::uvec3& v = mesh.faces[f];
      const glm::vec3 cross = glm::cross(mesh.positions[v[1]] - mesh.positions[v[0]],
                                         mesh.positions[v[2]] - mesh.positions[v[0]]);
      CHECK(glm::dot(cross, mesh.normals[mesh.face_normals[f][0]]) > 0);
    }
  }

  TEST_CASE("glTF: colours of vertices, as parts of whole numbers too, times the material's") {
    const TempDir folder;
    Document document = square();
    document.primitive()["attributes"]["COLOR_0"] = document.add<std::uint8_t>(
        {255, 0, 0, 255, 0, 255, 0, 255, 51, 102, 255, 0, 0, 0, 0, 255}, 5121, "VEC4", 4, true);
    CHECK(read_mesh(document.write(folder)).vertex_colors ==
          std::vector<glm::vec3>{{1, 0, 0}, {0, 1, 0}, {0.2F, 0.4F, 1}, {0, 0, 0}});
    document.json["materials"] =
        Json::array({{{"pbrMetallicRoughness", {{"baseColorFactor", {0.5, 1, 0.25, 1}}}}}});
    document.primitive()["material"] = 0;
    CHECK(read_mesh(document.write(folder)).vertex_colors[2] == glm::vec3(0.1F, 0.4F, 0.25F));
    document.primitive()["attributes"].erase("COLOR_0");
    const Mesh mesh = read_mesh(document.write(folder));
    CHECK(mesh.vertex_colors.empty());
    CHECK(mesh.face_colors == std::vector<glm::vec3>(2, {0.5F, 1, 0.25F}));
  }

  TEST_CASE(
      "glTF: a texture beside the file, within a URI and within a buffer; samplers; coordinates that move") {
    const TempDir folder;
    Texture texture{2, 1, {{1, 0, 0}, {0, 0, 1}}};
    write_texture(folder / "two texels.png", texture);
    Document document = square();
    texture_reference(document, {{"uri", "two%20texels.png"}});
    const Mesh beside = read_mesh(document.write(folder));
    REQUIRE(beside.textures.size() == 1);
    CHECK(beside.textures[0].texels == texture.texels);
    CHECK(beside.textures[0].wrap == Wrap::clamp);
    CHECK(beside.textures[0].filter == Filter::trilinear);
    CHECK(beside.texcoords == std::vector<glm::vec2>{{0, 0}, {1, 0}, {1, 1}, {0, 1}});  // v up
    CHECK(beside.face_textures.empty());

    const std::string png = folder.read("two texels.png");
    const std::size_t begin = document.bytes.size();
    document.bytes += png;
    document.json["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", begin}, {"byteLength", png.size()}});
    document.json["images"][0] = {{"bufferView", document.json["bufferViews"].size() - 1}};
    CHECK(read_mesh(document.write(folder)).textures[0].texels == texture.texels);

    // A green pixel as another program wrote it.
    document.json["images"][0] = {
        {"uri",
         "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGNg+M8AAAICAQ"
         "B7CYF4AAAAAElFTkSuQmCC"}};
    CHECK(read_mesh(document.write(folder)).textures[0].texels == std::vector<glm::vec3>{{0, 1, 0}});

    Json& reference = document.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
    reference["extensions"]["KHR_texture_transform"] = {
        {"offset", {0.5, 0.25}}, {"scale", {2, 1}}, {"rotation", std::acos(0.0)}};
    // (1, 1) with v down: stretched to (2, 1), turned to (1, -2), moved to (1.5, -1.75).
    const Mesh moved = read_mesh(document.write(folder));
    CHECK(glm::distance(moved.texcoords[1], glm::vec2(1.5F, 2.75F)) < 1e-6F);
  }

  TEST_CASE("glTF: alpha is opacity where it blends or is masked, and nothing else") {
    const TempDir folder;
    Texture texture{4, 1, {{1, 0, 0}, {0, 0, 1}, {1, 1, 1}, {0, 1, 0}}};
    texture.opacities = {0, 0.4F, 0.6F, 1};
    write_texture(folder / "leaf.png", texture);
    Document document = square();
    texture_reference(document, {{"uri", "leaf.png"}});
    Json& material = document.json["materials"][0];
    material["pbrMetallicRoughness"]["baseColorFactor"] = {1, 1, 1, 0.5};
    using List = std::vector<float>;
    const auto check = [&](const List& of_texels, const List& of_faces, const List& of_vertices = {}) {
      const Mesh mesh = read_mesh(document.write(folder));
      if (!mesh.textures.empty()) {
        CHECK(mesh.textures[0].texels == texture.texels);
        REQUIRE(mesh.textures[0].opacities.size() == of_texels.size());
        for (std::size_t i = 0; i < of_texels.size(); ++i)
          CHECK(mesh.textures[0].opacities[i] == doctest::Approx(of_texels[i]).epsilon(0.01));
      }
      CHECK(mesh.face_opacities == of_faces);
      CHECK(mesh.vertex_opacities == of_vertices);
    };
    check({}, {});
    material["alphaMode"] = "OPAQUE";
    check({}, {});
    material["alphaMode"] = "BLEND";
    check(texture.opacities, {0.5F, 0.5F});
    material["alphaMode"] = "MASK";  // 0.5 unless it is given: of the product
    check({0, 0, 0, 1}, {});
    material["alphaCutoff"] = 0.25;
    check({0, 0, 1, 1}, {});
    material["alphaCutoff"] = 0;
    check({}, {});
    material["alphaCutoff"] = 0.6;
    check({0, 0, 0, 0}, {});

    // A texture of two materials is two, where one alone blends.
    document.json["materials"].push_back(Json(material));
    document.json["materials"][0]["alphaMode"] = "BLEND";
    document.json["meshes"][0]["primitives"].push_back(document.primitive());
    document.json["meshes"][0]["primitives"][1]["material"] = 1;
    const Mesh both = read_mesh(document.write(folder));
    REQUIRE(both.textures.size() == 2);
    CHECK(both.textures[0].opacities.size() == 4);
    CHECK(both.textures[1].opacities == List(4, 0));
    CHECK(both.face_opacities == List{0.5F, 0.5F, 1, 1});
    document.json["meshes"][0]["primitives"].erase(1);

    document.json["materials"][0]["pbrMetallicRoughness"].erase("baseColorTexture");
    check({}, {0.5F, 0.5F});
    document.primitive()["attributes"]["COLOR_0"] = document.add<std::uint8_t>(
        {255, 0, 0, 255, 0, 255, 0, 51, 51, 102, 255, 255, 0, 0, 0, 0}, 5121, "VEC4", 4, true);
    check({}, {}, {0.5F, 0.1F, 0.5F, 0});
    document.json["materials"][0]["alphaMode"] = "MASK";
    check({}, {0, 0});
    Notes notes;
    read_mesh(document.write(folder), notes);
    CHECK(notes.size() == 1);
    document.json["materials"][0]["alphaMode"] = "GLASS";
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, read_mesh(document.write(folder)), "OPAQUE, MASK or BLEND");
  }

  TEST_CASE("glTF: what is left out is noted") {
    const TempDir folder;
    Document document = square();
    texture_reference(document, {{"uri", "lost.png"}});
    document.json["materials"][0]["normalTexture"] = {{"index", 0}};
    document.json["animations"] = Json::array({Json::object()});
    document.json["meshes"][0]["primitives"].push_back(document.primitive());
    document.json["meshes"][0]["primitives"][1]["mode"] = 0;
    Notes notes;
    const Mesh mesh = read_mesh(document.write(folder), notes);
    CHECK(mesh.textures.empty());
    CHECK(mesh.faces.size() == 2);
    std::string all;
    for (const std::string& note : notes) all += note + "\n";
    for (const char* const part : {"\"lost.png\" is not there", "not read: normalTexture", "animations (",
                                   "meshes[0].primitives[1] ("})
      CHECK_MESSAGE(contains(all, part), all);
    CHECK(notes.size() == 4);
  }

  TEST_CASE("GLB: written and read back") {
    const TempDir folder;
    const Mesh sphere = make_icosphere(1);
    write_mesh(folder / "sphere.glb", sphere);
    Mesh back = read_mesh(folder / "sphere.glb");
    REQUIRE(back.faces.size() == sphere.faces.size());
    for (std::size_t f = 0; f < sphere.faces.size(); ++f) {
      for (int c = 0; c < 3; ++c) {
        CHECK(back.positions[back.faces[f][c]] == sphere.positions[sphere.faces[f][c]]);
        CHECK(back.vertex_colors[back.faces[f][c]] == sphere.vertex_colors[sphere.faces[f][c]]);
      }
    }

    Mesh cube = make_cube();  // a colour a face
    cube.texcoords = {{0.25F, 0.75F}, {1, 0}, {0, 1}};
    cube.face_texcoords.assign(cube.faces.size(), {0, 1, 2});
    cube.normals = {{0, 0, 2}, {1, 0, 0}};
    cube.face_normals.assign(cube.faces.size(), {0, 0, 1});
    cube.textures = {{1, 1, {{0, 1, 0}}, Wrap::mirror, Filter::nearest}, {2, 1, {{1, 1, 1}, {0, 0, 0}}}};
    cube.face_textures.assign(cube.faces.size(), k_no_texture);
    cube.face_textures[0] = 1;
    cube.face_textures[1] = 0;
    write_mesh(folder / "cube.glb", cube);
    back = read_mesh(folder / "cube.glb");
    REQUIRE(back.faces.size() == cube.faces.size());
    CHECK(std::ranges::count(back.face_textures, k_no_texture) == 10);
    REQUIRE(back.textures.size() == 2);
    CHECK(back.textures[0].wrap == Wrap::mirror);
    CHECK(back.textures[0].filter == Filter::nearest);
    CHECK(back.textures[1].texels == cube.textures[1].texels);
    // Faces are in the order of their textures: that of the first texture is the cube's second.
    CHECK(back.positions[back.faces[0][0]] == cube.positions[cube.faces[1][0]]);
    CHECK(back.vertex_colors[back.faces[0][2]] == cube.face_colors[1]);
    CHECK(back.texcoords[back.face_texcoords[0][0]] == glm::vec2(0.25F, 0.75F));
    CHECK(back.normals[back.face_normals[0][1]] == glm::vec3(0, 0, 1));
    CHECK(folder.entries() == 2);
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("glTF: what cannot be read is refused with its place") {
    const TempDir folder;
    const auto changed = [](const char* pointer, const Json& value) {
      Document document = square();
      document.json[Json::json_pointer(pointer)] = value;
      return document;
    };
    check_refused(folder, changed("/asset/version", "1.0"), "asset.version", "2.0");
    check_refused(folder, changed("/extensionsRequired", {"KHR_draco_mesh_compression"}),
                  "extensionsRequired[0]", "KHR_draco_mesh_compression");
    check_refused(folder, changed("/nodes/0/mesh", 1), "nodes[0].mesh", "from 0 to 0");
    check_refused(folder, changed("/nodes/0/children", {0}), "nodes[0].children[0]", "twice");
    check_refused(folder, changed("/nodes/0/scale", {1, 1}), "nodes[0].scale", "a list of 3");
    check_refused(folder, changed("/accessors/0/count", 5), "accessors[0]", "its view's 48");
    check_refused(folder, changed("/accessors/0/componentType", 5124), "accessors[0].componentType", "5126");
    check_refused(folder, changed("/accessors/0/type", "SCALAR"), "attributes.POSITION", "one of vectors");
    check_refused(folder, changed("/accessors/1/componentType", 5122), "indices", "whole numbers");
    check_refused(folder, changed("/accessors/0/sparse", {{"count", 1}}), "accessors[0]", "sparse");
    check_refused(folder, changed("/bufferViews/0/byteLength", 4000000000U), "bufferViews[0]",
                  "within its buffer's");
    check_refused(folder, changed("/bufferViews/0/byteStride", 4), "accessors[0]", "byteStride");
    check_refused(folder, changed("/meshes/0/primitives/0/mode", 7), "mode", "from 0 to 6");
    Document high = square();
    high.primitive()["indices"] = high.add_indices({0, 1, 4});
    check_refused(folder, high, "indices", "below 4");
    Document uneven = square();
    uneven.primitive()["attributes"]["COLOR_0"] = uneven.add_vectors({1, 1, 1}, 3);
    check_refused(folder, uneven, "COLOR_0", "4, one a vertex");
    Document infinite = square();
    infinite.primitive()["attributes"]["POSITION"] =
        infinite.add_vectors(std::vector<float>(12, INFINITY), 3);
    check_refused(folder, infinite, "mesh.gltf", "finite");
    check_refused(folder, changed("/meshes/0/primitives", Json::array()), "mesh.gltf", "at least one");
  }

  TEST_CASE("glTF: buffers and containers that are not whole") {
    const TempDir folder;
    Document document = square();
    const std::filesystem::path file = document.write(folder);
    const auto check_text = [&](const std::string& uri, const std::string& part) {
      document.json["buffers"][0]["uri"] = uri;
      folder.write("mesh.gltf", document.json.dump());
      DPR_CHECK_MESSAGE_HAS(Error, read_mesh(file), part);
    };
    check_text("none.bin", "none.bin");
    check_text("https://example.org/data.bin", "buffers[0].uri");
    check_text("data:application/octet-stream;base64,?", "base64");
    check_text("data:application/octet-stream;base64,AAAA", "3 bytes");

    write_mesh(folder / "whole.glb", make_icosphere(0));
    const std::string whole = folder.read("whole.glb");
    for (std::size_t size = 4; size < whole.size(); size += 7) {
      CAPTURE(size);
      CHECK_THROWS_AS(read_mesh(folder.write("part.glb", whole.substr(0, size))), Error);
    }
    DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(folder.write("longer.glb", whole + "more")),
                          "the file goes on after");
    for (std::size_t i = 4; i < 24; ++i) {
      std::string other = whole;
      other[i] = static_cast<char>(other[i] ^ 0x40);
      CAPTURE(i);
      CHECK_THROWS_AS(read_mesh(folder.write("other.glb", other)), Error);
    }
  }
}

}  // namespace gltf_test
