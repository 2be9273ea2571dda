// What mesh files say of surfaces beside colours: materials and normals of OBJ, normals and texture
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
