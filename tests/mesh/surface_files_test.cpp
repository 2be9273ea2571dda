// Surfaces in mesh files beside colours: materials and normals of OBJ, normals and texture
// coordinates of PLY.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <string>
#include <vector>

#include "dpr/error.hpp"
#include "dpr/mesh.hpp"
#include "dpr/notes.hpp"
#include "support/messages.hpp"
#include "support/temp_dir.hpp"

namespace surface_files_test {

using namespace dpr;
using dpr::test::TempDir;

namespace {

const std::string k_corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

bool has_note(const Notes& notes, const std::string& text) {
  return std::ranges::any_of(notes, [&](const std::string& note) { return note.find(text) != note.npos; });
}

const std::string k_ply_faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";

void append_little(std::string& bytes, const auto& value) {
  const auto parts = std::bit_cast<std::array<char, sizeof(value)>>(value);
  bytes.append(parts.begin(), parts.end());
}

Texture two_texels(const glm::vec3& left, const glm::vec3& right) { return {2, 1, {left, right}}; }

enum class Form { ascii, little, big };
constexpr std::array k_forms{Form::ascii, Form::little, Form::big};

/// A PLY whose numbers are written in any of its formats.
struct PlyBody {
  explicit PlyBody(Form of) : form(of) {
    constexpr std::array<const char*, 3> k_names{"ascii", "binary_little_endian", "binary_big_endian"};
    header = "ply\nformat " + std::string(k_names[static_cast<std::size_t>(of)]) + " 1.0\n";
  }

  void add(const auto& value) {
    if (form == Form::ascii) {
      numbers += std::to_string(value) + " ";
      return;
    }
    std::string bytes;
    append_little(bytes, value);
    if (form == Form::big) std::ranges::reverse(bytes);
    numbers += bytes;
  }

  void end_row() {
    if (form == Form::ascii) numbers += "\n";
  }

  void add_corners(const std::vector<std::int32_t>& corners) {
    add(static_cast<unsigned char>(corners.size()));
    for (const std::int32_t corner : corners) add(corner);
  }

  Form form;
  std::string header, numbers;
};

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("OBJ: Ks and Ns are the faces' materials; illum below 2 has no highlights") {
    const TempDir folder;
    folder.write("m.mtl",
                 "newmtl brass\nKd 0.5 0.4 0\nKs 0.9 0.8 0.7 # warm\nNs 40\nillum 2\nnewmtl chalk\nKs 1 1 1\n"
                 "illum 1\nnewmtl open\nKd 1 1 1\nnewmtl dull\nKs 0\nNs 0\n");
    Notes notes;
    const Mesh mesh = read_mesh(
        folder.write("a.obj",
                     "mtllib m.mtl\n" + k_corners +
                         "f 1 2 3\nusemtl brass\nf 1 2 3 4\nusemtl chalk\nf 1 2 3\nusemtl open\nf 1 2 3\n"
                         "usemtl dull\nf 1 2 3\nusemtl brass\nf 2 3 4\n"),
        notes);
    CHECK(notes.empty());
    CHECK(mesh.materials ==
          std::vector<Material>{
              {}, {{0.9F, 0.8F, 0.7F}, 40.0F}, {glm::vec3(0), std::nullopt}, {glm::vec3(0), 1.0F}});
    CHECK(mesh.face_materials == std::vector<std::uint32_t>{0, 1, 1, 2, 0, 3, 1});
    // One of all faces needs no list, and one that says nothing is none.
    const Mesh one =
        read_mesh(folder.write("b.obj", "mtllib m.mtl\n" + k_corners + "usemtl brass\nf 1 2 3\n"));
    CHECK(one.materials.size() == 1);
    CHECK(one.face_materials.empty());
    CHECK(read_mesh(folder.write("c.obj", "mtllib m.mtl\n" + k_corners + "usemtl open\nf 1 2 3\n"))
              .materials.empty());
  }

  TEST_CASE("OBJ: transparent materials and maps that are not read are noted once, by name") {
    const TempDir folder;
    folder.write("m.mtl",
                 "newmtl glass\nd -halo 0.3\nmap_Ks shine.png\nmap_bump -bm 2 bumps.png\nnewmtl fog\nTr 0.5\n"
                 "newmtl solid\nd 1\nTr 0\n");
    Notes notes;
    const Mesh mesh = read_mesh(folder.write("a.obj", "mtllib m.mtl\n" + k_corners +
                                                          "usemtl glass\nf 1 2 3\nusemtl fog\nf 1 2 3\n"
                                                          "usemtl glass\nf 1 3 4\nusemtl solid\nf 1 2 3\n"),
                                notes);
    CHECK(mesh.faces.size() == 4);
    CHECK(notes.size() == 3);
    CHECK(has_note(notes, "the material \"glass\" is transparent (d or Tr): it is rendered opaque"));
    CHECK(has_note(notes, "the material \"fog\" is transparent"));
    CHECK(has_note(notes, "the material \"glass\": not read: map_Ks, map_bump"));
  }

  TEST_CASE("OBJ: materials that cannot be read name the line") {
    const TempDir folder;
    const auto check = [&](const std::string& line, const std::string& expected) {
      folder.write("m.mtl", "newmtl a\n" + line + "\n");
      const auto file = folder.write("a.obj", "mtllib m.mtl\n" + k_corners + "usemtl a\nf 1 2 3\n");
      DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(file), expected);
    };
    check("Ks 1 2", "m.mtl:2: expected Ks with one or three finite numbers");
    check("Ks 1 -1 0", "m.mtl:2: expected Ks with one or three finite numbers, at least 0");
    check("Ns -3", "m.mtl:2: expected Ns with a number, at least 0");
    check("Ns shiny", "m.mtl:2: expected Ns with a finite number");
    check("Ns", "m.mtl:2: expected Ns with a finite number");
    check("d nan", "m.mtl:2: expected d with a finite number");
    check("illum two", "m.mtl:2: expected illum with a finite number");
  }

  TEST_CASE("OBJ: textures become PNG files beside it, and come back") {
    const TempDir folder;
    dpr::Mesh mesh = dpr::make_icosphere(0);
    mesh.vertex_colors.clear();
    mesh.texcoords = {{0.1F, 0.2F}, {0.9F, 0.3F}, {0.4F, 0.8F}};
    mesh.face_texcoords.assign(mesh.faces.size(), glm::uvec3(0, 1, 2));
    mesh.textures = {{2, 1, {glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)}, dpr::Wrap::clamp}};
    SUBCASE("one") {}
    SUBCASE("several, and faces without") {
      mesh.textures.push_back({1, 1, {glm::vec3(0, 0, 1)}});
      for (std::uint32_t f = 0; f < mesh.faces.size(); ++f)
        mesh.face_textures.push_back(f % 3 == 2 ? dpr::k_no_texture : f % 3);
    }
    dpr::write_mesh(folder / "ball.obj", mesh);
    const dpr::Mesh read = dpr::read_mesh(folder / "ball.obj");
    CHECK(read.positions == mesh.positions);
    CHECK(read.faces == mesh.faces);
    CHECK(read.face_texcoords == mesh.face_texcoords);
    CHECK(read.face_textures == mesh.face_textures);
    REQUIRE(read.textures.size() == mesh.textures.size());
    for (std::size_t i = 0; i < mesh.textures.size(); ++i) {
      CHECK(read.textures[i].texels == mesh.textures[i].texels);
      CHECK(read.textures[i].wrap == mesh.textures[i].wrap);
    }
    const bool is_one = mesh.textures.size() == 1;
    CHECK(std::filesystem::exists(folder / (is_one ? "ball.png" : "ball.1.png")));
    CHECK(std::filesystem::exists(folder / "ball.mtl"));
  }

  TEST_CASE("OBJ: normals of corners, written and read back") {
    const TempDir folder;
    const std::string normals = "vn 0 0 1\nvn 0.6 0 0.8\nvn 0 0 2.5\n", texcoords = "vt 0 0\nvt 1 1\n";
    const Mesh mesh = read_mesh(folder.write(
        "a.obj", k_corners + normals + texcoords + "f 1/1/1 2/2/2 3/1/-1\nf 1/1/1 3/2/3 4/2/2 2/1/2\n"));
    CHECK(mesh.normals == std::vector<glm::vec3>{{0, 0, 1}, {0.6F, 0, 0.8F}, {0, 0, 2.5F}});
    CHECK(mesh.face_normals == std::vector<glm::uvec3>{{0, 1, 2}, {0, 2, 1}, {0, 1, 1}});
    CHECK(mesh.face_texcoords == std::vector<glm::uvec3>{{0, 1, 0}, {0, 1, 1}, {0, 1, 0}});
    write_mesh(folder / "again.obj", mesh);
    const Mesh again = read_mesh(folder / "again.obj");
    CHECK(again.normals == mesh.normals);
    CHECK(again.face_normals == mesh.face_normals);
    CHECK(again.face_texcoords == mesh.face_texcoords);
    const Mesh bare = read_mesh(folder.write("b.obj", k_corners + normals + "f 1//3 2//2 3//1\n"));
    CHECK(bare.face_normals == std::vector<glm::uvec3>{{2, 1, 0}});
    write_mesh(folder / "again.obj", bare);
    CHECK(read_mesh(folder / "again.obj").face_normals == bare.face_normals);
  }

  TEST_CASE("OBJ: where some faces have no normals all are computed, with a note; wrong ones name the line") {
    const TempDir folder;
    Notes notes;
    const Mesh mesh = read_mesh(
        folder.write("a.obj", k_corners + "vn 0 0 1\nf 1//1 2//1 3//1\nf 1 3 4\nf 1//1 2 3\n"), notes);
    CHECK(mesh.normals.empty());
    CHECK(mesh.face_normals.empty());
    CHECK(has_note(notes, "faces without normals beside others that have some, 2: all normals are computed"));
    CHECK(read_mesh(folder.write("b.obj", k_corners + "vn 0 0 1\nf 1 2 3\n")).normals.empty());
    DPR_CHECK_MESSAGE_HAS(IoError,
                          read_mesh(folder.write("c.obj", k_corners + "vn 0 0 1\nf 1//1 2//2 3//1\n")),
                          "c.obj:6: a face with the normal 2");
    DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(folder.write("d.obj", k_corners + "vn 0 0\nf 1 2 3\n")),
                          "d.obj:5");
  }

  TEST_CASE("PLY: texture coordinates by any of their names, and normals, as text and in bytes") {
    const TempDir folder;
    const std::array<std::array<std::string, 2>, 4> names{
        {{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}}};
    for (const auto& [u, v] : names) {
      const std::string vertex =
          " 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
          "property float nx\nproperty float ny\nproperty float nz\nproperty double " +
          u + "\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty " + "double " + v +
          "\n";
      const std::array<std::array<float, 3>, 3> positions{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}},
          normals{{{0, 0, 1}, {0.5F, 0, 1}, {0, 0.25F, 2}}};
      const std::array<std::array<double, 2>, 3> texcoords{{{0, 0.125}, {1.5, 0}, {-0.25, 1}}};
      std::string text = "ply\nformat ascii" + vertex + k_ply_faces,
                  bytes = "ply\nformat binary_little_endian" + vertex + k_ply_faces;
      for (std::size_t i = 0; i < 3; ++i) {
        for (const auto& list : {positions[i], normals[i]}) {
          for (const float value : list) {
            text += std::to_string(value) + " ";
            append_little(bytes, value);
          }
        }
        text += std::to_string(texcoords[i][0]) + " 255 0 51 " + std::to_string(texcoords[i][1]) + "\n";
        append_little(bytes, texcoords[i][0]);
        bytes += std::string("\xff\0\x33", 3);
        append_little(bytes, texcoords[i][1]);
      }
      text += "3 0 1 2\n";
      bytes += '\3';
      for (const std::int32_t corner : {0, 1, 2}) append_little(bytes, corner);
      for (const std::string& content : {text, bytes}) {
        const Mesh mesh = read_mesh(folder.write("mesh.ply", content));
        CHECK(mesh.positions == std::vector<glm::vec3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
        CHECK(mesh.texcoords == std::vector<glm::vec2>{{0, 0.125F}, {1.5F, 0}, {-0.25F, 1}});
        CHECK(mesh.face_texcoords == mesh.faces);
        CHECK(mesh.normals == std::vector<glm::vec3>{{0, 0, 1}, {0.5F, 0, 1}, {0, 0.25F, 2}});
        CHECK(mesh.face_normals == mesh.faces);
        CHECK(mesh.vertex_colors[1] == glm::vec3(1, 0, 0.2F));
      }
    }
  }

  TEST_CASE("PLY: a texture by the coordinates of vertices, in every format") {
    const TempDir folder;
    write_texture(folder / "two words.png", two_texels({1, 0, 0}, {0, 0, 1}));
    for (const Form form : k_forms) {
      PlyBody body(form);
      body.header +=
          "comment TextureFile two words.png\nelement vertex 3\nproperty float x\nproperty float y\n"
          "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
          "property float texture_u\nproperty float texture_v\n" +
          k_ply_faces;
      for (const auto& [x, y] : {std::pair{0.0F, 0.0F}, {1.0F, 0.0F}, {0.0F, 1.0F}}) {
        for (const float number : {x, y, 0.0F}) body.add(number);
        for (const int byte : {10, 20, 30}) body.add(static_cast<unsigned char>(byte));
        for (const float number : {x, y}) body.add(number);
        body.end_row();
      }
      body.add_corners({0, 1, 2});
      Notes notes;
      const Mesh mesh = read_mesh(folder.write("mesh.ply", body.header + body.numbers), notes);
      REQUIRE(mesh.textures.size() == 1);
      CHECK(mesh.textures[0].texels[1] == glm::vec3(0, 0, 1));
      CHECK(mesh.texcoords == std::vector<glm::vec2>{{0, 0}, {1, 0}, {0, 1}});
      CHECK(mesh.face_texcoords == mesh.faces);
      CHECK(mesh.face_textures.empty());
      CHECK(mesh.vertex_colors.empty());
      CHECK(has_note(notes, "colours are left out"));
    }
  }

  TEST_CASE("PLY: textures by the coordinates of corners, numbered, in every format") {
    const TempDir folder;
    write_texture(folder / "a.png", two_texels({1, 0, 0}, {0, 0, 1}));
    write_texture(folder / "b.png", two_texels({0, 1, 0}, {1, 1, 1}));
    for (const Form form : k_forms) {
      PlyBody body(form);
      body.header +=
          "comment TextureFile a.png\ncomment TextureFile gone.png\ncomment TextureFile b.png\n"
          "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
          "element face 4\nproperty list uchar int vertex_indices\n"
          "property list uchar float texcoord\nproperty int texnumber\nend_header\n";
      for (const auto& [x, y] : {std::pair{0.0F, 0.0F}, {1.0F, 0.0F}, {1.0F, 1.0F}, {0.0F, 1.0F}}) {
        for (const float number : {x, y, 0.0F}) body.add(number);
        body.end_row();
      }
      const auto add_face = [&](const std::vector<std::int32_t>& corners, const std::vector<float>& list,
                                std::int32_t number) {
        body.add_corners(corners);
        body.add(static_cast<unsigned char>(list.size()));
        for (const float value : list) body.add(value);
        body.add(number);
        body.end_row();
      };
      add_face({0, 1, 2, 3}, {0, 0, 1, 0, 1, 1, 0, 1}, 2);  // two triangles
      add_face({0, 1, 2}, {}, 0);
      add_face({1, 2, 3}, {0.5F, 0.25F, 1, 0, 1, 1}, 0);
      add_face({1, 2, 3}, {0, 0, 1, 0, 1, 1}, 1);
      Notes notes;
      const Mesh mesh = read_mesh(folder.write("mesh.ply", body.header + body.numbers), notes);
      REQUIRE(mesh.textures.size() == 2);
      CHECK(mesh.textures[1].texels[0] == glm::vec3(0, 1, 0));
      CHECK(mesh.face_textures == std::vector<std::uint32_t>{1, 1, k_no_texture, 0, k_no_texture});
      REQUIRE(mesh.face_texcoords.size() == 5);
      CHECK(mesh.texcoords[mesh.face_texcoords[1][1]] == glm::vec2(1, 1));
      CHECK(mesh.texcoords[mesh.face_texcoords[2][0]] == glm::vec2(0));
      CHECK(mesh.texcoords[mesh.face_texcoords[3][0]] == glm::vec2(0.5F, 0.25F));
      CHECK(has_note(notes, "\"gone.png\" (TextureFile) is not there"));
    }
  }

  TEST_CASE("PLY: numbers of textures in every type of whole numbers, and one of no texture") {
    const TempDir folder;
    write_texture(folder / "a.png", two_texels({1, 0, 0}, {0, 0, 1}));
    const auto check = [&](const std::string& type, auto zero) {
      using Number = decltype(zero);
      for (const Form form : k_forms) {
        CAPTURE(type);
        PlyBody body(form);
        body.header +=
            "comment TextureFile a.png\ncomment TextureFile a.png\nelement vertex 3\nproperty float x\n"
            "property float y\nproperty float z\nproperty float s\nproperty float t\nelement face 3\n"
            "property list uchar int vertex_indices\nproperty " +
            type + " texnumber\nend_header\n";
        for (const auto& [x, y] : {std::pair{0.0F, 0.0F}, {1.0F, 0.0F}, {0.0F, 1.0F}}) {
          for (const float number : {x, y, 0.0F, x, y}) body.add(number);
          body.end_row();
        }
        for (const int number : {1, 0, 7}) {
          body.add_corners({0, 1, 2});
          body.add(static_cast<Number>(number));
          body.end_row();
        }
        Notes notes;
        const Mesh mesh = read_mesh(folder.write("mesh.ply", body.header + body.numbers), notes);
        CHECK(mesh.face_textures == std::vector<std::uint32_t>{1, 0, k_no_texture});
        CHECK(has_note(notes, "mesh.ply: the texture number 7 (texnumber) is not from 0 to 1"));
      }
    };
    check("char", std::int8_t{});
    check("uchar", std::uint8_t{});
    check("short", std::int16_t{});
    check("ushort", std::uint16_t{});
    check("int", std::int32_t{});
    check("uint", std::uint32_t{});
  }

  TEST_CASE("PLY: a texture without coordinates is told, and the colours stay") {
    const TempDir folder;
    write_texture(folder / "a.png", two_texels({1, 0, 0}, {0, 0, 1}));
    Notes notes;
    const Mesh mesh = read_mesh(
        folder.write("mesh.ply",
                     "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 3\nproperty "
                     "float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar "
                     "green\nproperty uchar blue\n" +
                         k_ply_faces + "0 0 0 255 0 0\n1 0 0 255 0 0\n0 1 0 255 0 0\n3 0 1 2\n"),
        notes);
    CHECK(mesh.textures.empty());
    CHECK(mesh.vertex_colors.size() == 3);
    CHECK(has_note(notes, "no coordinates in it"));
  }

  TEST_CASE("PLY: half of a pair of coordinates, or coordinates in whole numbers, are none") {
    const TempDir folder;
    for (const std::string& properties : {std::string("property float s\nproperty float v\n"),
                                          std::string("property int u\nproperty int v\n"),
                                          std::string("property float nx\nproperty float ny\n")}) {
      const Mesh mesh = read_mesh(
          folder.write("mesh.ply",
                       "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                       "property float z\n" +
                           properties + k_ply_faces + "0 0 0 1 1\n1 0 0 1 1\n0 1 0 1 1\n3 0 1 2\n"));
      CHECK(mesh.texcoords.empty());
      CHECK(mesh.face_texcoords.empty());
      CHECK(mesh.normals.empty());
      CHECK(mesh.positions[1] == glm::vec3(1, 0, 0));
    }
  }
}

}  // namespace surface_files_test
