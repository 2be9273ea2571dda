#include "fuzz/targets.hpp"

#include <array>
#include <stdexcept>

#include "dpr/error.hpp"
#include "dpr/image.hpp"
#include "learn/npz.hpp"
#include "mesh/mesh_reader.hpp"
#include "scene/opencv_camera.hpp"
#include "scene/scene_json.hpp"
#include "solve/shape_state.hpp"
#include "solve/shape_views.hpp"
#include "support/temp_dir.hpp"

namespace dpr::fuzz {
namespace {

/// Folder with the files that scenes and views may name, and of content that is read by the name of a file.
const test::TempDir& folder() {
  static const struct Folder {
    test::TempDir temporary;
    Folder() {
      temporary.write("triangle.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
      write_image(temporary / "grey.ppm", Image(2, 2, glm::vec4(0.5F)));
      write_image(temporary / "clear.exr", Image(2, 2, glm::vec4(0.25F)));
      temporary.write(
          "textured.mtl",
          "newmtl one\nmap_Kd grey.ppm\nnewmtl same\nmap_Kd grey.ppm\nnewmtl lost\nmap_Kd no.ppm\n"
          "newmtl moved\nmap_Kd -s 2 2 -o 0.5 0 -bm 1 grey.ppm\n");
    }
  } made;
  return made.temporary;
}

template <const char* name>
void read_mesh_bytes(std::string_view content) {
  Notes notes;
  parse_mesh(folder() / name, std::string(content), notes);
}
constexpr char k_obj[] = "mesh.obj", k_ply[] = "mesh.ply", k_off[] = "mesh.off", k_stl[] = "mesh.stl",
               k_glb[] = "mesh.glb";

void read_materials(std::string_view content) {
  ObjMaterials materials;
  read_mtl(folder() / "mesh.mtl", content, materials);
}

/// Under the extension of the format that the content begins as.
void read_image_bytes(std::string_view content) {
  constexpr std::array<std::pair<std::string_view, const char*>, 7> k_formats{{{"\x89PNG", "a.png"},
                                                                               {"\x76\x2f\x31\x01", "a.exr"},
                                                                               {"\xff\xd8", "a.jpg"},
                                                                               {"II*", "a.tif"},
                                                                               {"MM", "a.tif"},
                                                                               {"BM", "a.bmp"},
                                                                               {"P", "a.ppm"}}};
  const char* name = "a.tga";
  for (const auto& [beginning, its_name] : k_formats) {
    if (content.starts_with(beginning)) name = its_name;
  }
  read_image(folder().write(name, content));
}

void read_scene_text(std::string_view content) {
  Notes notes;
  parse_scene(folder() / "scene.json", content, notes);
}

void read_camera_text(std::string_view content) { parse_opencv_camera(folder() / "camera.yml", content); }

void read_views_text(std::string_view content) {
  Notes notes;
  parse_views(folder() / "views.json", content, notes);
}

/// A whole file, or the content of one with the right checksum.
void read_shape_checkpoint(std::string_view content) {
  constexpr std::uint64_t k_fingerprint = 7;
  const bool is_whole = content.starts_with("dpr shape checkpoint");
  const std::string bytes = is_whole ? std::string(content) : checkpoint_bytes(content, k_fingerprint);
  const ShapeState read = read_checkpoint(folder().write("checkpoint", bytes), k_fingerprint, {});
  write_checkpoint(folder() / "again", read, k_fingerprint);
  const ShapeState again = read_checkpoint(folder() / "again", k_fingerprint, {});
  if (again.positions != read.positions || again.faces != read.faces) throw std::logic_error("another mesh");
}

/// Reads an array; what is written of the array must read as the same.
void read_npz_bytes(std::string_view content) {
  const learn::ByteArray read = learn::read_npz(folder().write("a.npz", content));
  learn::write_npz(folder() / "again.npz", read.shape, read.values);
  const learn::ByteArray again = learn::read_npz(folder() / "again.npz");
  if (again.shape != read.shape || again.values != read.values) throw std::logic_error("other values");
}

constexpr std::array<Target, 12> k_targets{{{"mesh_obj", read_mesh_bytes<k_obj>},
                                            {"mesh_ply", read_mesh_bytes<k_ply>},
                                            {"mesh_off", read_mesh_bytes<k_off>},
                                            {"mesh_stl", read_mesh_bytes<k_stl>},
                                            {"mesh_glb", read_mesh_bytes<k_glb>},
                                            {"materials", read_materials},
                                            {"image", read_image_bytes},
                                            {"scene", read_scene_text},
                                            {"opencv_camera", read_camera_text},
                                            {"views", read_views_text},
                                            {"npz", read_npz_bytes},
                                            {"shape_checkpoint", read_shape_checkpoint}}};

}  // namespace

std::span<const Target> targets() { return k_targets; }

bool accepts(const Target& target, std::string_view content) {
  try {
    target.read(content);
    return true;
  } catch (const Error& error) {
    const std::string_view message = error.what();
    if (message.empty() || message.find('\n') != std::string_view::npos)
      throw std::logic_error("not one line");
    return false;
  }
}

}  // namespace dpr::fuzz
