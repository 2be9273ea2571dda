// Mesh files: what they hold arrives, in order and in full, or the error says where it is wrong.
#include <doctest/doctest.h>
#include <sys/stat.h>

#include <array>
#include <bit>
#include <chrono>
#include <cstring>
#include <iostream>
#include <locale>
#include <sstream>
#include <thread>

#include "dpr/mesh.hpp"
#include "dpr/notes.hpp"
#include "support/messages.hpp"
#include "support/temp_dir.hpp"

namespace mesh_io_test {

using namespace dpr;
using dpr::test::TempDir;

namespace {

const std::string k_obj_square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
const std::string k_ply_start =
    "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 3\n"
    "property float x\nproperty float y\nproperty float z\n";
const std::string k_ply_corners = "property list uchar int vertex_indices\n";
const std::string k_ply_vertices = "0 0 0\n1 0 0\n0 1 0\n";

std::vector<glm::uvec3> faces_of(const TempDir& folder, const std::string& obj_faces) {
  return read_mesh(folder.write("mesh.obj", k_obj_square + obj_faces)).faces;
}

void append_float(std::string& bytes, float value, bool big_endian = false) {
  auto bits = std::bit_cast<std::uint32_t>(value);
  for (unsigned i = 0; i < 4; ++i) bytes += static_cast<char>(bits >> (big_endian ? 24 - 8 * i : 8 * i));
}

std::string binary_stl(const std::vector<std::array<glm::vec3, 3>>& facets) {
  std::string bytes = "solid, and yet binary";
  bytes.resize(80, ' ');
  append_float(bytes, std::bit_cast<float>(static_cast<std::uint32_t>(facets.size())));
  for (const auto& facet : facets) {
    for (int i = 0; i < 3; ++i) append_float(bytes, 0);
    for (const glm::vec3& corner : facet) {
      for (int i = 0; i < 3; ++i) append_float(bytes, corner[i]);
    }
    bytes += std::string(2, '\0');
  }
  return bytes;
}

std::string text_facet(const std::string& a, const std::string& b, const std::string& c) {
  return "facet normal 0 0 1\n  outer loop\n    vertex " + a + "\n    vertex " + b + "\n    vertex " + c +
         "\n  endloop\nendfacet\n";
}

std::string one_facet() { return binary_stl({{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}}); }

// A triangle in every format, its first coordinate to be given; all of them of text.
std::vector<std::pair<std::string, std::string>> text_triangles(const std::string& x) {
  return {{"a.obj", "v " + x + " 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"},
          {"a.ply", k_ply_start + "element face 1\n" + k_ply_corners + "end_header\n" + x +
                        " 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"},
          {"a.off", "OFF\n3 1 0\n" + x + " 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"},
          {"a.stl", "solid a\n" + text_facet(x + " 0 0", "1 0 0", "0 1 0") + "endsolid a\n"}};
}

// Numbers as in much of Europe: 1.234,5.
class CommaPunctuation : public std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

// Everything written to the standard streams while it lives.
class Captured {
 public:
  Captured() : errors_(std::cerr.rdbuf(text_.rdbuf())), log_(std::clog.rdbuf(text_.rdbuf())) {}
  ~Captured() {
    std::cerr.rdbuf(errors_);
    std::clog.rdbuf(log_);
  }
  Captured(const Captured&) = delete;
  Captured& operator=(const Captured&) = delete;
  std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
  std::streambuf *errors_, *log_;
};

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("OBJ: vertices in order, polygons as fans, corners of every form") {
    const TempDir folder;
    const Mesh mesh = read_mesh(
        folder.write("mesh.obj", "# a comment\r\n\r\no thing\r\n" + k_obj_square +
                                     "vt 0 0\nvn 0 0 1\ns off\n"
                                     "f 1/1/1 2/1/1 3/1/1 4/1/1\nf 1//1 3//1 4//1\nf -4 -3 -2\nl 1 2\n"
                                     "v +5e-1 .5 -1.25 1\nf 1 2 5"));  // no newline at the end
    CHECK(mesh.positions ==
          std::vector<glm::vec3>{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5F, 0.5F, -1.25F}});
    CHECK(mesh.faces == std::vector<glm::uvec3>{{0, 1, 2}, {0, 2, 3}, {0, 2, 3}, {0, 1, 2}, {0, 1, 4}});
    CHECK(mesh.vertex_colors.empty());
    CHECK(mesh.face_colors.empty());
  }

  TEST_CASE("OBJ: no face is lost, whatever its edges are") {
    const TempDir folder;
    CHECK(faces_of(folder, "f 1 2 3\nf 1 2 3\nf 2 1 3\nf 1 2 4\nf 1 2 4\n") ==
          std::vector<glm::uvec3>{{0, 1, 2}, {0, 1, 2}, {1, 0, 2}, {0, 1, 3}, {0, 1, 3}});
    // With equal corners: OpenMesh drops the first, shortens the third.
    CHECK(faces_of(folder, "f 1 1 2\nf 1 2 3\nf 1 2 3 1\nf 2 3 4\nf 4 4 4\n") ==
          std::vector<glm::uvec3>{{0, 0, 1}, {0, 1, 2}, {0, 1, 2}, {0, 2, 0}, {1, 2, 3}, {3, 3, 3}});
  }

  TEST_CASE("OBJ: texture coordinates, where every corner has some") {
    const TempDir folder;
    const std::string corners = "vt 0 0\nvt 1 0.25 0.5\nf 1/1 2/2/1 3/-1 4/3\nvt .5 2\nf 1/3/ 2/1 3/2\n";
    const Mesh mesh = read_mesh(folder.write("mesh.obj", k_obj_square + "vn 0 0 1\n" + corners));
    CHECK(mesh.texcoords == std::vector<glm::vec2>{{0, 0}, {1, 0.25F}, {0.5F, 2}});
    CHECK(mesh.face_texcoords == std::vector<glm::uvec3>{{0, 1, 1}, {0, 1, 2}, {2, 0, 1}});
    write_mesh(folder / "again.obj", mesh);
    const Mesh again = read_mesh(folder / "again.obj");
    CHECK(again.texcoords == mesh.texcoords);
    CHECK(again.face_texcoords == mesh.face_texcoords);
    CHECK(again.faces == mesh.faces);
    const Mesh without =
        read_mesh(folder.write("mesh.obj", k_obj_square + "vn 0 0 1\n" + corners + "f 1//1 2/1 3/1\n"));
    CHECK(without.texcoords.empty());
    CHECK(without.face_texcoords.empty());
    CHECK(without.faces.size() == 4);
  }

  TEST_CASE("OBJ: colours of vertices") {
    const TempDir folder;
    const Mesh mesh =
        read_mesh(folder.write("mesh.obj", "v 0 0 0\nv 1 0 0 0.1 0.2 0.3\nv 0 1 0 1 0.5 2\nf 1 2 3\n"));
    CHECK(mesh.vertex_colors == std::vector<glm::vec3>{{1, 1, 1}, {0.1F, 0.2F, 0.3F}, {1, 0.5F, 2}});
  }

  TEST_CASE("OBJ: materials are face colours, and stay in their file") {
    const TempDir folder;
    folder.write("m.mtl", "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n");
    const std::string faces = "usemtl red\nf 1 2 3 4\nusemtl none\nf 2 2 3\nusemtl blue\nf 1 2 3\n";
    const Mesh mesh = read_mesh(folder.write("a.obj", "mtllib m.mtl\n" + k_obj_square + faces));
    CHECK(mesh.face_colors == std::vector<glm::vec3>{{1, 0, 0}, {1, 0, 0}, {1, 1, 1}, {0, 0, 1}});
    CHECK(read_mesh(folder.write("b.obj", k_obj_square + faces)).face_colors.empty());
    CHECK(read_mesh(folder.write("c.obj", "mtllib no.mtl\n" + k_obj_square + faces)).face_colors.empty());
  }

  TEST_CASE("OBJ: material libraries: several on a line, names with spaces and #, comments, one number") {
    const TempDir folder;
    folder.write("a.mtl", "\xEF\xBB\xBFnewmtl dark #1\r\n Kd 0.25 # all three\r\nKs 1 1 1\r\n");
    folder.write("b.mtl", "Kd 9 9 9\nnewmtl plain\nnewmtl red\nKd 1 0 0.1\n");
    folder.write("c d.mtl", "newmtl green\nKd 0 1e-400 1\n");
    const Mesh mesh = read_mesh(folder.write(
        "a.obj",
        "mtllib a.mtl b.mtl\nmtllib c d.mtl\n" + k_obj_square +
            "usemtl dark #1\nf 1 2 3\nusemtl red\nf 1 2 3\nusemtl green\nf 1 2 3\nusemtl plain\nf 1 2 3\n"));
    CHECK(mesh.face_colors ==
          std::vector<glm::vec3>{glm::vec3(0.25F), {1, 0, 0.1F}, {0, 0, 1}, glm::vec3(1)});
    folder.write("a.mtl", "newmtl a\nKd 1 2\n");
    DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(folder / "a.obj"), "a.mtl:2: expected Kd with one or three");
  }

  TEST_CASE("OBJ: materials' textures, their options, and faces without any") {
    const TempDir folder;
    std::filesystem::create_directory(folder / "maps");
    write_texture(folder / "maps/oak bark.exr", {2, 1, {glm::vec3(0.5F), glm::vec3(1)}});
    write_texture(folder / "ash.exr", {1, 1, {glm::vec3(0.25F)}});
    folder.write("m.mtl",
                 "newmtl oak\nmap_Kd -clamp on -s 2 3 -o 0.5 maps\\oak bark.exr\nnewmtl ash\nKd 1 0 0\n"
                 "map_Kd -mm 0 1 -blendu off ash.exr\nnewmtl none\nKd 0 0 1\n");
    const std::string corners = "vt 0 0\nvt 1 0.25\nvt 0.5 2\n";
    Notes notes;
    const Mesh mesh = read_mesh(
        folder.write("a.obj",
                     "mtllib m.mtl\n" + k_obj_square + corners +
                         "usemtl oak\nf 1/1 2/2 3/3\nusemtl ash\nf 1/1 2/2 3/3\nusemtl none\nf 1 2 3\n"
                         "usemtl oak\nf 2/2 3/3 1/1\nf 1 2 3 4\n"),
        notes);
    REQUIRE(mesh.textures.size() == 2);
    CHECK(mesh.textures[0].wrap == Wrap::clamp);
    CHECK(mesh.textures[0].texels[0] == glm::vec3(0.5F));
    CHECK(mesh.textures[1].wrap == Wrap::repeat);
    CHECK(mesh.face_textures ==
          std::vector<std::uint32_t>{0, 1, k_no_texture, 0, k_no_texture, k_no_texture});
    CHECK(mesh.face_colors[0] == glm::vec3(1));
    CHECK(mesh.face_colors[1] == glm::vec3(1, 0, 0));
    const auto corner = [&](std::size_t face, int k) { return mesh.texcoords[mesh.face_texcoords[face][k]]; };
    CHECK(corner(0, 1) == glm::vec2(2.5F, 0.75F));
    CHECK(corner(1, 1) == glm::vec2(1, 0.25F));
    CHECK(corner(3, 0) == corner(0, 1));
    REQUIRE(notes.size() == 2);
    CHECK(notes[0].find("\"ash\" (map_Kd) these options are not read: -mm, -blendu") != std::string::npos);
    CHECK(notes[1].find("polygons with a texture but without coordinates in it, 1") != std::string::npos);
    // One texture on all faces needs no list.
    const Mesh plain = read_mesh(
        folder.write("b.obj", "mtllib m.mtl\n" + k_obj_square + corners + "usemtl ash\nf 1/1 2/2 3/3\n"));
    CHECK(plain.textures.size() == 1);
    CHECK(plain.face_textures.empty());
  }

  TEST_CASE("OBJ: textures that are missing are noted, those that cannot be read are errors") {
    const TempDir folder;
    const std::string face = "vt 0 0\nvt 1 0\nvt 0 1\nusemtl oak\nf 1/1 2/2 3/3\n";
    folder.write("m.mtl", "newmtl oak\nmap_Kd oak.png\n");
    const std::filesystem::path obj = folder.write("a.obj", "mtllib m.mtl\n" + k_obj_square + face);
    Notes notes;
    const Mesh mesh = read_mesh(obj, notes);
    CHECK(mesh.textures.empty());
    CHECK(mesh.face_textures.empty());
    CHECK(mesh.texcoords.size() == 3);
    REQUIRE(notes.size() == 1);
    CHECK(notes[0].find("the texture \"oak.png\"") != std::string::npos);
    folder.write("oak.png", "not a picture");
    DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(obj), "oak.png");
    folder.write("m.mtl", "newmtl oak\nmap_Kd -s oak.png\n");
    DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(obj), "m.mtl:2: expected -s with 1 finite numbers or more");
    folder.write("m.mtl", "newmtl oak\nmap_Kd -clamp maybe oak.png\n");
    DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(obj), "m.mtl:2: got -clamp maybe, expected on or off");
  }

  TEST_CASE("OBJ: what is left out is noted") {
    const TempDir folder;
    folder.write("m.mtl",
                 "newmtl oak\nKd 0.5 0.5 0.5\nmap_Kd -s 2 2 2 oak bark.png\nnewmtl ash\nmap_Kd ash.png\n");
    Notes notes;
    const std::string faces =
        k_obj_square + "usemtl oak\nf 1 2 3\nusemtl elm\nf 1 2 3\nusemtl oak\nf 1 2 3\n";
    CHECK(read_mesh(folder.write("a.obj", "mtllib m.mtl\n" + faces), notes).face_colors.size() == 3);
    REQUIRE(notes.size() == 2);  // of what the faces use, once
    CHECK(notes[0].find("the texture \"oak bark.png\" of the material \"oak\" (map_Kd) is not there") !=
          std::string::npos);
    CHECK(notes[1].find("the material \"elm\" is in no material library") != std::string::npos);
    notes.clear();
    CHECK(read_mesh(folder.write("b.obj", "mtllib no.mtl\n" + faces), notes).faces.size() == 3);
    REQUIRE(notes.size() == 1);
    CHECK(notes[0].find("b.obj: the material library \"no.mtl\" is not there") != std::string::npos);
    notes.clear();
    std::filesystem::create_directory(folder / "folder.mtl");
    CHECK(read_mesh(folder.write("d.obj", "mtllib folder.mtl\n" + faces), notes).faces.size() == 3);
    CHECK(notes[0].find("\"folder.mtl\" is no regular file") != std::string::npos);
    notes.clear();
    const std::string surface = "cstype bezier\ndeg 1 1\nsurf 0 1 0 1 1 2 3 4\nparm u 0 1\nparm v 0 1\nend\n";
    const std::string line = "l 1 2\n";
    CHECK(read_mesh(folder.write("c.obj", faces + line + surface + line), notes).faces.size() == 3);
    REQUIRE(notes.size() == 4);  // two of them about the materials
    CHECK(notes[2].find("c.obj: the statement \"l\" is not read (2 lines)") != std::string::npos);
    CHECK(notes[3].find("c.obj: the statement \"surf\" is not read (1 line)") != std::string::npos);
  }

  TEST_CASE("STL: attributes, which may be colours, are noted") {
    const TempDir folder;
    Notes notes;
    std::string bytes = one_facet();
    CHECK(read_mesh(folder.write("plain.stl", bytes), notes).faces.size() == 1);
    CHECK(notes.empty());
    bytes.back() = '\x80';  // VisCAM's bit of a valid colour
    CHECK(read_mesh(folder.write("coloured.stl", bytes), notes).faces.size() == 1);
    REQUIRE(notes.size() == 1);
    CHECK(notes[0].find("coloured.stl: the attributes of 1 facets") != std::string::npos);
  }

  TEST_CASE("a byte-order mark before a text") {
    const TempDir folder;
    for (const auto& [name, text] : text_triangles("0.5")) {
      const Mesh mesh = read_mesh(folder.write(name, "\xEF\xBB\xBF" + text));
      CHECK_MESSAGE((mesh.positions == std::vector<glm::vec3>{{0.5F, 0, 0}, {1, 0, 0}, {0, 1, 0}}), name);
      CHECK_MESSAGE(mesh.faces[0] == glm::uvec3(0, 1, 2), name);
    }
  }

  TEST_CASE("numbers too small for a float are zero or denormal, those too large are refused") {
    const TempDir folder;
    const std::string zeros = "0." + std::string(400, '0') + "1", digits = "2" + std::string(400, '0');
    for (const char* tiny : {"1e-400", "-1e-400", "+1E-46", "1e-99999999999999999999"}) {
      for (const auto& [name, text] : text_triangles(tiny))
        CHECK_MESSAGE(read_mesh(folder.write(name, text)).positions[0].x == 0, name << " " << tiny);
    }
    for (const auto& [name, text] : text_triangles("1e-40"))
      CHECK_MESSAGE(read_mesh(folder.write(name, text)).positions[0].x == 1e-40F, name);
    for (const auto& [name, text] : text_triangles(zeros))
      CHECK_MESSAGE(read_mesh(folder.write(name, text)).positions[0].x == 0, name);
    for (const auto& [name, text] : text_triangles(digits + "e-400"))
      CHECK_MESSAGE(read_mesh(folder.write(name, text)).positions[0].x == 2, name);
    for (const std::string& bad : {std::string("1e400"), digits, std::string("1e99999999999999999999"),
                                   std::string("-1e39"), std::string("nan"), std::string("inf")}) {
      for (const auto& [name, text] : text_triangles(bad))
        CHECK_THROWS_AS_MESSAGE(read_mesh(folder.write(name, text)), Error, name << " " << bad);
    }
  }

  TEST_CASE("lines that end as on Windows") {
    const TempDir folder;
    for (auto [name, text] : text_triangles("0.5")) {
      for (std::size_t i = 0; (i = text.find('\n', i)) != std::string::npos; i += 2)
        text.replace(i, 1, "\r\n");
      const Mesh mesh = read_mesh(folder.write(name, text));
      CHECK_MESSAGE(mesh.positions[0] == glm::vec3(0.5F, 0, 0), name);
      CHECK_MESSAGE(mesh.faces[0] == glm::uvec3(0, 1, 2), name);
    }
  }

  TEST_CASE("OBJ: comments behind numbers") {
    const TempDir folder;
    const Mesh mesh = read_mesh(folder.write("a.obj",
                                             "v 0 0 0 # first\nv 1 0 0#second\nv 0 1 0 1 0 0 # red\nvt 0 0 # "
                                             "a\nf 1/1 2/1 3/1 # f\nf 3 2 1# \\\n"));
    CHECK(mesh.faces == std::vector<glm::uvec3>{{0, 1, 2}, {2, 1, 0}});
    CHECK(mesh.vertex_colors == std::vector<glm::vec3>{{1, 1, 1}, {1, 1, 1}, {1, 0, 0}});
  }

  TEST_CASE("a file of any format comes through a pipe") {
    const TempDir folder;
    auto files = text_triangles("0.5");
    files.emplace_back("b.stl", one_facet());
    for (const auto& [name, text] : files) {
      const std::filesystem::path pipe = folder / ("pipe-" + name);
      REQUIRE(mkfifo(pipe.c_str(), 0600) == 0);
      std::thread writer([&folder, &text = text, &name = name] { folder.write("pipe-" + name, text); });
      CHECK_MESSAGE(read_mesh(pipe).faces.size() == 1, name);
      writer.join();
    }
  }

  TEST_CASE("a polygon of 300,000 corners, and as many equal vertices, take no time") {
    constexpr int k_corners = 300000;
    const TempDir folder;
    std::string vertices, obj_vertices, obj = "f", off;
    for (int i = 0; i < k_corners; ++i) {
      const std::string vertex = std::to_string(i) + " 0 1\n";
      vertices += vertex;
      obj_vertices += "v " + vertex;
      obj += " " + std::to_string(i + 1);
      off += " " + std::to_string(i);
    }
    const std::string count = std::to_string(k_corners);
    std::string ply = "ply\nformat ascii 1.0\nelement vertex " + count +
                      "\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
                      "property list int int vertex_indices\nend_header\n" +
                      vertices + count + off;
    const std::vector<std::pair<std::string, std::string>> files{
        {"a.obj", obj_vertices + obj},
        {"a.off", "OFF\n" + count + " 1\n" + vertices + count + off},
        {"a.ply", ply}};
    for (const auto& [name, text] : files) {
      const auto start = std::chrono::steady_clock::now();
      CHECK_MESSAGE(read_mesh(folder.write(name, text)).faces.size() == k_corners - 2, name);
      // A loop over all pairs takes 20 s and more.
      CHECK_MESSAGE(std::chrono::steady_clock::now() - start < std::chrono::seconds(10), name);
    }
    const std::vector<std::array<glm::vec3, 3>> facets(k_corners / 3, {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}});
    CHECK(read_mesh(folder.write("a.stl", binary_stl(facets))).positions.size() == 3);
  }

  TEST_CASE("OBJ: written and read back, bit for bit") {
    const TempDir folder;
    Mesh mesh = make_icosphere(2, 1.0F / 3.0F);
    write_mesh(folder / "sphere.obj", mesh);
    const Mesh back = read_mesh(folder / "sphere.obj");
    CHECK(back.positions == mesh.positions);
    CHECK(back.faces == mesh.faces);
    CHECK(back.vertex_colors == mesh.vertex_colors);
    CHECK(folder.entries() == 1);
  }

  TEST_CASE("OBJ: materials are written and read back") {
    const TempDir folder;
    Mesh mesh = make_icosphere(0);
    mesh.materials = {{{0.25F, 0, 3}, 40}};
    write_mesh(folder / "one.obj", mesh);
    Mesh back = read_mesh(folder / "one.obj");
    CHECK(back.materials == mesh.materials);
    CHECK(back.face_materials.empty());
    CHECK(back.vertex_colors == mesh.vertex_colors);

    mesh.materials = {{{0.1F, 0.2F, 0.3F}, {}}, {{0, 0, 0}, 1.5F}};
    mesh.face_materials.assign(mesh.faces.size(), 0);
    mesh.face_materials[1] = mesh.face_materials[3] = 1;
    mesh.texcoords = {{0, 0}, {1, 0}, {0, 1}};
    mesh.face_texcoords.assign(mesh.faces.size(), {0, 1, 2});
    mesh.textures = {{1, 1, {{0, 1, 0}}, Wrap::clamp}};
    mesh.face_textures.assign(mesh.faces.size(), 0);
    mesh.face_textures[3] = k_no_texture;
    write_mesh(folder / "two.obj", mesh);
    back = read_mesh(folder / "two.obj");
    CHECK(back.materials == mesh.materials);
    CHECK(back.face_materials == mesh.face_materials);
    CHECK(back.face_textures == mesh.face_textures);
    REQUIRE(back.textures.size() == 1);
    CHECK(back.textures[0].wrap == Wrap::clamp);

    mesh.materials[0].specular.x = -1;
    DPR_CHECK_MESSAGE_HAS(IoError, write_mesh(folder / "three.obj", mesh), "no highlights below 0");
    CHECK(folder.entries() == 5);
  }

  TEST_CASE("PLY: written and read back; colours in bytes") {
    const TempDir folder;
    Mesh mesh = make_cube();
    mesh.face_colors[3] = {51.0F / 255.0F, 2, -1};
    write_mesh(folder / "cube.ply", mesh);
    const Mesh back = read_mesh(folder / "cube.ply");
    CHECK(back.positions == mesh.positions);
    CHECK(back.faces == mesh.faces);
    REQUIRE(back.face_colors.size() == 12);
    CHECK(back.face_colors[3] == glm::vec3(51.0F / 255.0F, 1, 0));
    CHECK(glm::length(back.face_colors[0] - mesh.face_colors[0]) < 0.5F * std::sqrt(3.0F) / 255.0F + 1e-6F);
    CHECK(back.vertex_colors.empty());
    const Mesh sphere = make_icosphere(1);
    write_mesh(folder / "sphere.ply", sphere);
    const Mesh colored = read_mesh(folder / "sphere.ply");
    REQUIRE(colored.vertex_colors.size() == sphere.positions.size());
    CHECK(glm::length(colored.vertex_colors[5] - sphere.vertex_colors[5]) < 0.005F);
  }

  TEST_CASE("PLY: colours in floats arrive uncut, other properties do not disturb") {
    const TempDir folder;
    const std::string vertex_colors = "property float red\nproperty float green\nproperty float blue\n";
    const Mesh mesh = read_mesh(
        folder.write("mesh.ply", k_ply_start + "property uchar quality\n" + vertex_colors +
                                     "element face 2\n" + k_ply_corners +
                                     "property list uchar float texcoord\nproperty int group\nend_header\n"
                                     "0 0 0 200 0.999 2 -1\n1 0 0 7 0.25 0.5 0.125\n0 1 0 12 0 0 0\n"
                                     "3 0 1 2 6 0 0 1 0 0 1 4\n3 2 1 0 0 5\n"));
    CHECK(mesh.faces == std::vector<glm::uvec3>{{0, 1, 2}, {2, 1, 0}});
    CHECK(mesh.vertex_colors == std::vector<glm::vec3>{{0.999F, 2, -1}, {0.25F, 0.5F, 0.125F}, {0, 0, 0}});
  }

  TEST_CASE("PLY: face colours in doubles and in bytes, CRLF, elements before and after the faces") {
    const TempDir folder;
    std::string text = k_ply_start +
                       "element camera 1\nproperty float view_x\nproperty int id\nelement face 2\n" +
                       k_ply_corners + "property double red\nproperty double green\nproperty double blue\n" +
                       "element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n" +
                       k_ply_vertices + "0.5 3\n3 0 1 2 1 0.25 0\n4 0 1 2 1 0 0 1\n0 1\n";
    for (std::size_t i = 0; (i = text.find('\n', i)) != std::string::npos; i += 2) text.replace(i, 1, "\r\n");
    const Mesh mesh = read_mesh(folder.write("mesh.ply", text));
    CHECK(mesh.faces == std::vector<glm::uvec3>{{0, 1, 2}, {0, 1, 2}, {0, 2, 1}});
    CHECK(mesh.face_colors == std::vector<glm::vec3>{{1, 0.25F, 0}, {0, 0, 1}, {0, 0, 1}});
    const Mesh bytes =
        read_mesh(folder.write("bytes.ply", k_ply_start + "element face 1\n" + k_ply_corners +
                                                "property uchar red\nproperty uchar green\n" +
                                                "property uchar blue\nproperty uchar alpha\nend_header\n" +
                                                k_ply_vertices + "3 0 1 2 255 51 0 128\n"));
    CHECK(bytes.face_colors == std::vector<glm::vec3>{{1, 51.0F / 255.0F, 0}});
  }

  TEST_CASE("PLY: binary of both byte orders, with types that OpenMesh does not take") {
    const TempDir folder;
    for (const bool big_endian : {false, true}) {
      std::string bytes = std::string("ply\nformat binary_") + (big_endian ? "big" : "little") +
                          "_endian 1.0\nelement vertex 3\nproperty float32 x\nproperty float32 y\n"
                          "property float32 z\nproperty int32 nx\nproperty uint8 red\nproperty uint8 green\n"
                          "property uint8 blue\nelement face 1\nproperty list uint32 uint32 vertex_index\n"
                          "property float32 red\nproperty float32 green\nproperty float32 blue\nend_header\n";
      const auto append_word = [&](std::uint32_t word) {
        append_float(bytes, std::bit_cast<float>(word), big_endian);
      };
      for (unsigned i = 0; i < 3; ++i) {
        for (unsigned axis = 0; axis < 3; ++axis) append_float(bytes, axis == i ? 1.5F : 0.0F, big_endian);
        append_word(77);
        bytes += {static_cast<char>(255), static_cast<char>(51 * i), '\0'};
      }
      for (const std::uint32_t word : {3U, 2U, 1U, 0U}) append_word(word);
      for (const float channel : {0.3F, 0.6F, 0.9F}) append_float(bytes, channel, big_endian);
      const Mesh mesh = read_mesh(folder.write("mesh.ply", bytes));
      CHECK(mesh.positions == std::vector<glm::vec3>{{1.5F, 0, 0}, {0, 1.5F, 0}, {0, 0, 1.5F}});
      CHECK(mesh.faces == std::vector<glm::uvec3>{{2, 1, 0}});
      CHECK(mesh.vertex_colors == std::vector<glm::vec3>{{1, 0, 0}, {1, 0.2F, 0}, {1, 0.4F, 0}});
      CHECK(mesh.face_colors.empty());  // those of the vertices are finer
      DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(folder.write("mesh.ply", bytes.substr(0, bytes.size() - 1))),
                            "truncated");
      DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(folder.write("mesh.ply", bytes + "x")), "goes on after");
    }
  }

  TEST_CASE("OFF: comments, colours of every form, counts on the header's line") {
    const TempDir folder;
    const Mesh mesh =
        read_mesh(folder.write("mesh.off",
                               "OFF\n# a comment\n\n4 3 0\n0 0 0\n1 0 0  # another\n1 1 0\n0 1 0\n"
                               "4 0 1 2 3  255  51 0\n3 0 1 2 0.5 1 0 1\n3 2 1 0\n"));
    CHECK(mesh.faces == std::vector<glm::uvec3>{{0, 1, 2}, {0, 2, 3}, {0, 1, 2}, {2, 1, 0}});
    CHECK(mesh.face_colors ==
          std::vector<glm::vec3>{{1, 51.0F / 255.0F, 0}, {1, 51.0F / 255.0F, 0}, {0.5F, 1, 0}, {1, 1, 1}});
    const Mesh colored = read_mesh(folder.write(
        "mesh.off", "COFF 3 1 0\n0 0 0 255 0 0 255\n1 0 0 0 255 0 255\n0 1 0 0 0 255 255\n3 0 1 2\n"));
    CHECK(colored.vertex_colors == std::vector<glm::vec3>{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
    CHECK(colored.faces.size() == 1);
    const Mesh all =
        read_mesh(folder.write("mesh.off",
                               "STCNOFF\n3 1\n0 0 0 0 0 1 255 0 0 255 .5 1\n1 0 0 0 0 1 0 255 0 255 .5 1\n"
                               "0 1 0 0 0 1 0 0 255 255 .5 1\n3 0 1 2 7\n"));
    CHECK(all.vertex_colors == colored.vertex_colors);
    CHECK(all.positions == colored.positions);
    const Mesh normals =
        read_mesh(folder.write("mesh.off", "NOFF\n3 1 3\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2\n"));
    CHECK(normals.positions == colored.positions);
    CHECK(normals.vertex_colors.empty());
  }

  TEST_CASE("STL: text and binary; equal positions become one vertex") {
    const TempDir folder;
    const std::string text = "solid the outer one\n" + text_facet("0 0 0", "1 0 0", "0 1 0") +
                             text_facet("0 0 0", "0 0 0", "1 1 1") + text_facet("1 0 0", "1 1 0", "0 1 0") +
                             "endsolid the outer one\n";
    const Mesh from_text = read_mesh(folder.write("text.stl", text));
    CHECK(from_text.positions == std::vector<glm::vec3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}});
    CHECK(from_text.faces == std::vector<glm::uvec3>{{0, 1, 2}, {1, 3, 2}});
    const std::array<glm::vec3, 3> low{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}},
        high{{{1, 0, 0}, {1, 1, 0}, {0, 1, 0}}};
    const std::array<glm::vec3, 3> degenerate{{{0, 0, 0}, {0, 0, 0}, {0, 1, 0}}};
    const Mesh from_bytes = read_mesh(folder.write("bytes.STL", binary_stl({low, degenerate, high})));
    CHECK(from_bytes.positions.size() == 4);
    CHECK(from_bytes.faces == std::vector<glm::uvec3>{{0, 1, 2}, {1, 3, 2}});
  }

  TEST_CASE("the program's locale has no say") {
    const TempDir folder;
    const std::string v = "0.125 0.250 1.500";
    const std::vector<std::filesystem::path> files{
        folder.write("a.obj", "v " + v + "\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        folder.write("a.ply", k_ply_start + "element face 1\n" + k_ply_corners + "end_header\n" + v +
                                  "\n1 0 0\n0 1 0\n3 0 1 2\n"),
        folder.write("a.off", "OFF\n3 1 0\n" + v + "\n1 0 0\n0 1 0\n3 0 1 2\n"),
        folder.write("a.stl", "solid a\n" + text_facet(v, "1 0 0", "0 1 0") + "endsolid a\n")};
    const std::locale before = std::locale::global(std::locale(std::locale(), new CommaPunctuation));
    for (const std::filesystem::path& file : files) {
      CHECK_MESSAGE(read_mesh(file).positions[0] == glm::vec3(0.125F, 0.25F, 1.5F), file.string());
    }
    write_mesh(folder / "b.ply", read_mesh(files[1]));
    CHECK(read_mesh(folder / "b.ply").positions[0] == glm::vec3(0.125F, 0.25F, 1.5F));
    CHECK(std::use_facet<std::numpunct<char>>(std::locale()).decimal_point() == ',');
    std::locale::global(before);
  }

  TEST_CASE("the same files give the same meshes whatever was read before") {
    const TempDir folder;
    const auto off = folder.write("mesh.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    const auto coff =
        folder.write("color.off", "COFF\n3 1 0\n0 0 0 1 1 1\n1 0 0 1 1 1\n0 1 0 1 1 1\n3 0 1 2\n");
    for (int i = 0; i < 2; ++i) {
      CHECK(read_mesh(off).vertex_colors.empty());
      CHECK(read_mesh(coff).vertex_colors.size() == 3);
    }
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("files that are not there, or no mesh files") {
    const TempDir folder;
    DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(folder / "no.obj"), "does not exist");
    DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(folder.write("mesh.fbx", "x")),
                          "expected .obj, .ply, .off, .stl, .gltf or .glb");
    std::filesystem::create_directory(folder / "folder.obj");
    DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(folder / "folder.obj"), "folder");
    for (const char* extension : {".ply", ".off", ".stl"}) {
      CHECK_THROWS_AS(read_mesh(folder.write(std::string("empty") + extension, "")), IoError);
      CHECK_THROWS_AS(read_mesh(folder.write(std::string("noise") + extension, "\x01\xff\n\n8 9\n")),
                      IoError);
    }
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, read_mesh(folder.write("empty.obj", "")), "got none");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, read_mesh(folder.write("points.obj", k_obj_square)), "got none");
  }

  TEST_CASE("OBJ: the line at fault") {
    const TempDir folder;
    const auto check = [&](const std::string& faces, const std::string& part) {
      DPR_CHECK_MESSAGE_HAS(IoError, faces_of(folder, faces), part);
    };
    check("f 1 2 5\n", "mesh.obj:5: a face with the vertex 5: expected 1 to 4");
    check("f 1 2 3\nf 0 1 2\n", "mesh.obj:6: a face with the vertex 0");
    check("f -5 1 2\n", "mesh.obj:5: a face with the vertex -5");
    check("f 1 2 99999999999\n", "mesh.obj:5:");
    check("f 1 2\n", "mesh.obj:5: a face with 2 corners");
    check("f\n", "mesh.obj:5: a face with 0 corners");
    check("f 1 2 x\n", "mesh.obj:5: got the corner \"x\"");
    check("f 1 2 3/1/y\n", "mesh.obj:5: got the corner \"3/1/y\"");
    check("f 1 2 3/1/1/1\n", "mesh.obj:5: got the corner");
    check("v 0 0 0 w\nf 1 2 3\n", "mesh.obj:5: got \"w\"");
    check("\xEF\xBB\xBFv 0 0 0\nf 1 2 3\n", "mesh.obj:5: the line begins with bytes that are no text");
    check("f 1 2 /3\n", "mesh.obj:5: got the corner \"/3\"");
    check("f 1 2 \\\n3\n", "mesh.obj:5: a line continued by a backslash");
    check("v 1 2\nf 1 2 3\n", "mesh.obj:5: too few numbers");
    check("v nan 0 0\nf 1 2 3\n", "mesh.obj:5: got \"nan\"");
    check("v 0 inf 0\nf 1 2 3\n", "mesh.obj:5: got \"inf\"");
    check("v 1e39 0 0\nf 1 2 3\n", "mesh.obj:5: got \"1e39\"");
    check("v 1,5 0 0\nf 1 2 3\n", "mesh.obj:5: got \"1,5\"");
    check("v 0 0 0 1 0 x\nf 1 2 3\n", "mesh.obj:5: got \"x\"");
    check("vt 0.5\nf 1 2 3\n", "mesh.obj:5: too few numbers");
    check("vt 0 0\nf 1/1 2/2 3/1\n", "a face with the texture coordinate 2: expected 1 to 1");
    check("vt 0 0\nf 1/1 2/1 3/0\n", "mesh.obj:6: a face with the texture coordinate 0");
    check("vt 0 0\nf 1/1 2/1 3/x\n", "mesh.obj:6: got the corner \"3/x\"");
  }

  TEST_CASE("PLY: headers") {
    const TempDir folder;
    const auto check = [&](const std::string& text, const std::string& part) {
      DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(folder.write("mesh.ply", text)), part);
    };
    const std::string face = "element face 1\n" + k_ply_corners,
                      rest = "end_header\n" + k_ply_vertices + "3 0 1 2\n";
    CHECK_NOTHROW(read_mesh(folder.write("mesh.ply", k_ply_start + face + rest)));
    check("plyx\n", "mesh.ply:1: not a PLY file");
    check("ply\nformat ascii 1.0\n", "the header has no end");
    check("ply\nformat text 1.0\n", "mesh.ply:2: expected the format");
    check("ply\nelement vertex 1\nend_header\n", "no format");
    check("ply\nformat ascii 1.0\nproperty float x\n", "mesh.ply:3: expected \"property");
    check(k_ply_start + "end_header\n", "no element face");
    check(k_ply_start + "property float x\n", "mesh.ply:8: the property x twice");
    check(k_ply_start + "property half w\n", "mesh.ply:8: a property of unknown type");
    check("ply\nformat binary_little_endian 1.0\nelement face 1\nproperty list int float s\n",
          "mesh.ply:4: the list s counted in int");
    check(k_ply_start + "element face -1\n", "mesh.ply:8: expected \"element");
    check(k_ply_start + "element face 5000000000\n", "mesh.ply:8: expected \"element");
    check(k_ply_start + "element face 1\nend_header\n", "expected the list vertex_indices");
    check(k_ply_start + "element face 1\nproperty int id\n" + k_ply_corners + rest,
          "expected the list vertex_indices");
    check(k_ply_start + "property list uchar int near\n" + face + rest,
          "the list near of the element vertex");
    check(k_ply_start + "property ushort red\nproperty ushort green\nproperty ushort blue\n" + face + rest,
          "in ushort: expected uchar, float or double");
    check("ply\nformat ascii 1.0\nelement vertex 4000000000\n" + face + "end_header\n", "x, y and z");
    check("ply\nformat ascii 1.0\n" + face + "element vertex 1\nproperty float x\nend_header\n", "before");
  }

  TEST_CASE("PLY: bodies") {
    const TempDir folder;
    const std::string head = k_ply_start + "element face 2\n" + k_ply_corners + "end_header\n";
    const auto check = [&](const std::string& body, const std::string& part) {
      DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(folder.write("mesh.ply", head + body)), part);
    };
    check(k_ply_vertices + "3 0 1 2\n3 0 1", "mesh.ply:15: too few numbers for a face");
    check(k_ply_vertices + "3 0 1 2\n", "truncated");
    check("0 0 0\n1 0", "truncated");
    check("", "truncated");
    check("0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n3 0 1 2\n", "mesh.ply:12: got no number where one must be");
    check(k_ply_vertices + "3 0 1 2\n3 0 x 2\n", "mesh.ply:15:");
    check(k_ply_vertices + "3 0 1 2\n2 0 1\n", "face 1 has fewer than three corners");
    // Numbers enough in all, but not line by line.
    check("0 0 0\n1 0\n0 0 1 0\n3 0 1 2\n3 0 1 2\n", "mesh.ply:12: expected 3 numbers, of one vertex");
    check(k_ply_vertices + "4 0 1 2\n0 1 2 0\n", "mesh.ply:14: too few numbers for a face");
    check(k_ply_vertices + "3 0 1 2 9\n3 0 1 2\n", "mesh.ply:14: too many numbers for a face");
    const std::string lists =
        "element face 1\n" + k_ply_corners + "property list uchar float s\nend_header\n";
    DPR_CHECK_MESSAGE_HAS(
        IoError,
        read_mesh(folder.write("mesh.ply", k_ply_start + lists + k_ply_vertices + "3 0 1 2 4000000000 1\n")),
        "mesh.ply:15: too few numbers for a face");
    const std::string colors = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    DPR_CHECK_MESSAGE_HAS(
        IoError,
        read_mesh(folder.write("mesh.ply", k_ply_start + colors + "element face 1\n" + k_ply_corners +
                                               "end_header\n0 0 0 0 0 300\n1 0 0 0 0 0\n"
                                               "0 1 0 0 0 0\n3 0 1 2\n")),
        "a colour in bytes that is not from 0 to 255");
    DPR_CHECK_MESSAGE_HAS(
        IoError,
        read_mesh(folder.write(
            "mesh.ply",
            "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty double x\n"
            "property double y\nproperty double z\nelement face 1\n" +
                k_ply_corners + "end_header\n")),
        "its header promises 96000000001 bytes or more");
    check(k_ply_vertices + "4000000000 0 1 2\n3 0 1 2\n", "mesh.ply:14: too few numbers for a face");
    check(k_ply_vertices + "3 0 1 2\n3 0 1 2\n3 0 1 2\n", "goes on after the last face");
    DPR_CHECK_MESSAGE_HAS(InvalidArgument,
                          read_mesh(folder.write("mesh.ply", head + k_ply_vertices + "3 0 1 2\n3 0 1 3\n")),
                          "faces[1]");
    CHECK_THROWS_AS(read_mesh(folder.write("mesh.ply", head + k_ply_vertices + "3 0 1 2\n3 0 1 -1\n")),
                    Error);
  }

  TEST_CASE("OFF") {
    const TempDir folder;
    const auto check = [&](const std::string& text, const std::string& part) {
      DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(folder.write("mesh.off", text)), part);
    };
    const std::string vertices = "0 0 0\n1 0 0\n0 1 0\n";
    check("4OFF\n3 1 0\n", "mesh.off:1: got the header \"4OFF\"");
    check("NOFF\n3 1 0\n0 0 0\n", "mesh.off:3: too few numbers");
    check("STOFF\n3 1 0\n0 0 0 1\n", "mesh.off:3: too few numbers");
    check("OFF\n3 1 0\n" + vertices + "3 0 1 2\n\n# and\n3 0 1 2\n", "mesh.off:9: the file goes on after");
    check("OFF\n3 1 0\n" + vertices + "3 0 1 2 x\n", "mesh.off:6: got \"x\"");
    check("OFF BINARY\n", "mesh.off:1: a binary OFF file");
    check("OFF\n3 x 0\n", "mesh.off:2: got \"x\", expected the number of faces");
    check("OFF\n3 5 0\n" + vertices + "3 0 1 2\n",
          "mesh.off:6: the file ends here: expected 3 vertices and 5 faces");
    check("OFF\n4000000000 1 0\n0 0 0\n", "the file ends here");
    check("OFF\n3 1 0\n0 0\n", "mesh.off:3: too few numbers");
    check("OFF\n3 1 0\n0 0 nan\n", "mesh.off:3: got \"nan\"");
    check("OFF\n3 1 0\n" + vertices + "3 0 1 3\n", "mesh.off:6: a face with the vertex \"3\"");
    check("OFF\n3 1 0\n" + vertices + "2 0 1\n", "mesh.off:6: a face with 2 corners");
    check("OFF\n3 1 0\n" + vertices + "3 0 1 2 255 0\n", "mesh.off:6: 2 numbers for a colour");
  }

  TEST_CASE("STL") {
    const TempDir folder;
    const auto check = [&](const std::string& text, const std::string& part) {
      DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(folder.write("mesh.stl", text)), part);
    };
    const std::string facet = text_facet("0 0 0", "1 0 0", "0 1 0");
    check("solid a\n" + facet, "expected \"endsolid\"");
    check("solid a\n" + facet.substr(0, 60), "mesh.stl:");
    check("solid a\n" + text_facet("0 0 0", "nan 0 0", "0 1 0") + "endsolid\n", "mesh.stl:5: got \"nan\"");
    check("solid a\n" + text_facet("0 0 0", "1 0", "0 1 0") + "endsolid\n",
          "mesh.stl:5: expected three numbers");
    check("solid a\nouter loop\nvertex 0 0 0\nendloop\nendsolid\n",
          "mesh.stl:4: a loop without three vertices");
    check("solid a\n" + facet + "endsolid a\nmore\n", "expected \"endsolid\"");
    check("solid a\n" + text_facet("0 0 0", "1 0 0 0", "0 1 0") + "endsolid\n",
          "mesh.stl:5: expected three numbers");
    const std::string bytes = one_facet();
    std::string shortened = bytes.substr(0, bytes.size() - 7);
    shortened[0] = 'S';
    check(shortened, "truncated: expected 1 facets, got 0");
    std::string extended = bytes + "x";
    extended[0] = 'S';
    check(extended, "goes on after the last of the 1 facets");
    check("short", "too short");
    std::string not_finite = bytes;
    not_finite.replace(84 + 12, 4, std::string("\0\0\xc0\x7f", 4));
    check(not_finite, "facet 0 has a coordinate that is not finite");
  }

  TEST_CASE("what has no end is refused, and is not even opened as a material library") {
    const TempDir folder;
    for (const char* name : {"endless.obj", "endless.ply", "endless.off", "endless.stl"}) {
      std::filesystem::create_symlink("/dev/zero", folder / name);
      DPR_CHECK_MESSAGE_HAS(IoError, read_mesh(folder / name), "does not end");
    }
    REQUIRE(mkfifo((folder / "pipe.mtl").c_str(), 0600) == 0);  // nobody writes to it
    for (const char* library : {"pipe.mtl", "/dev/zero"}) {
      Notes notes;
      const auto file =
          folder.write("a.obj", std::string("mtllib ") + library + "\n" + k_obj_square + "f 1 2 3\n");
      CHECK(read_mesh(file, notes).faces.size() == 1);
      REQUIRE(notes.size() == 1);
      CHECK(notes[0].find(library) != std::string::npos);
    }
  }

  TEST_CASE("OpenMesh is silent") {
    const TempDir folder;
    const auto file =
        folder.write("mesh.ply", k_ply_start + "element face 1\n" + k_ply_corners +
                                     "property ushort a\nend_header\n" + k_ply_vertices + "3 0 1");
    const Captured captured;
    CHECK_THROWS_AS(read_mesh(file), IoError);
    CHECK(captured.text().empty());
  }

  TEST_CASE("writing") {
    const TempDir folder;
    const Mesh cube = make_cube();
    DPR_CHECK_MESSAGE_HAS(IoError, write_mesh(folder / "cube.obj", cube), "OBJ has no face colours");
    DPR_CHECK_MESSAGE_HAS(IoError, write_mesh(folder / "cube.stl", cube), "expected .obj, .ply or .glb");
    DPR_CHECK_MESSAGE_HAS(IoError, write_mesh(folder / "no" / "cube.ply", cube), "does not exist");
    CHECK_THROWS_AS(write_mesh(folder / "none.ply", Mesh{}), InvalidArgument);
    std::filesystem::create_directory(folder / "cube.ply");
    CHECK_THROWS_AS(write_mesh(folder / "cube.ply", cube), IoError);
    CHECK(folder.entries() == 1);  // the folder made above, and no temporary file
  }
}

}  // namespace mesh_io_test
