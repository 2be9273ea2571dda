// dpr info: what is in a mesh file or a scene file, and what dpr does with it.
#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "base/input_file.hpp"
#include "cli/commands.hpp"
#include "cli/json.hpp"
#include "cli/mesh_materials.hpp"
#include "cli/text.hpp"
#include "image/texture_words.hpp"
#include "mesh/bounding_box.hpp"
#include "mesh/mesh_facts.hpp"
#include "mesh/opacity.hpp"
#include "scene/gradient_table.hpp"
#include "scene/light_table.hpp"
#include "scene/triangles_in_view.hpp"

namespace dpr::cli {
namespace {

namespace fs = std::filesystem;

Json materials_to_json(const std::vector<MeshMaterial>& materials) {
  Json list = Json::array();
  for (const auto& [name, texture] : materials)
    list.push_back({{"name", name}, {"texture", texture.empty() ? Json() : Json(texture)}});
  return list;
}

Json textures_to_json(const std::vector<Texture>& textures) {
  Json list = Json::array();
  for (const Texture& t : textures) {
    list.push_back({{"width", t.width},
                    {"height", t.height},
                    {"wrap", to_string(t.wrap)},
                    {"filter", to_string(t.filter)}});
  }
  return list;
}

Json vector_to_json(const glm::vec3& v) { return Json::array({number(v.x), number(v.y), number(v.z)}); }

const char* colors_of(const Mesh& mesh) {
  return !mesh.vertex_colors.empty() ? "vertex" : !mesh.face_colors.empty() ? "face" : "none";
}

/// Notes on a mesh's treatment that its user may not expect.
Json mesh_notes(const Mesh& mesh, const MeshFacts& facts) {
  Json notes = Json::array();
  if (facts.faces_without_area > 0)
    notes.push_back(counted(facts.faces_without_area, "triangle") + " without area: dropped when rendered");
  if (facts.unused_vertices > 0)
    notes.push_back("vertices without a face: " + std::to_string(facts.unused_vertices) + ", not seen");
  if (colors_of(mesh) == std::string("none") && mesh.textures.empty()) notes.push_back("no colours: white");
  if (!mesh.face_texcoords.empty() && mesh.textures.empty())
    notes.push_back("texture coordinates without a texture: rendered by --aov uv");
  if (is_see_through(mesh)) notes.push_back("opacities below 1: not for pose, fit and track");
  if (!facts.is_closed()) notes.push_back("not closed: both sides of its triangles are seen");
  if (facts.is_closed() && !facts.is_oriented())
    notes.push_back("triangles wound in opposite senses: no matter to rendering, volumes need one sense");
  return notes;
}

Json mesh_to_json(const Mesh& mesh, const std::vector<MeshMaterial>& materials) {
  const MeshFacts facts = mesh_facts(mesh);
  const Bounds box = bounding_box(mesh.positions);
  return {{"vertices", mesh.positions.size()},
          {"distinct_positions", facts.distinct_positions},
          {"faces", mesh.faces.size()},
          {"components", facts.components},
          {"edges", facts.edges},
          {"boundary_edges", facts.boundary_edges},
          {"closed", facts.is_closed()},
          {"manifold", facts.is_manifold()},
          {"non_manifold_edges", facts.non_manifold_edges},
          {"non_manifold_vertices", facts.non_manifold_vertices},
          {"oriented", facts.is_oriented()},
          {"faces_without_area", facts.faces_without_area},
          {"bounds", {{"low", vector_to_json(box.low)}, {"high", vector_to_json(box.high)}}},
          {"colors", colors_of(mesh)},
          {"texture_coordinates", mesh.texcoords.size()},
          {"normals", mesh.normals.size()},
          {"textures", textures_to_json(mesh.textures)},
          {"materials", materials_to_json(materials)},
          {"notes", mesh_notes(mesh, facts)}};
}

/// Triangles that the camera's clipping planes drop or clip.
void add_clipping_notes(const Scene& scene, std::size_t entry, Json& notes) {
  const TrianglesInView counts = triangles_in_view(scene, entry);
  const auto add = [&](std::size_t count, const char* what) {
    if (count > 0) notes.push_back(counted(count, "triangle") + what);
  };
  add(counts.near, " nearer than znear: dropped when rendered");
  add(counts.clipped, " clipped at znear or zfar");
  add(counts.far, " beyond zfar: dropped when rendered");
  add(counts.outside, " outside the image");
}

Json smoothing_to_json(const Smoothing& s) {
  return {{"noise", to_string(s.noise)},
          {"occupancy_prior", to_string(s.occupancy_prior)},
          {"depth_prior", to_string(s.depth_prior)},
          {"composition", to_string(s.composition)},
          {"occupancy_estimator", to_string(s.occupancy_estimator)},
          {"aggregation_estimator", to_string(s.aggregation_estimator)},
          {"sigma", number(s.sigma)},
          {"gamma", number(s.gamma)},
          {"alpha", number(s.alpha)}};
}

Json gradients_to_json(const GradientRequest& request) {
  Json names = Json::array();
  for (const GradientName& name : gradient_names()) {
    if (request.*name.wanted) names.push_back(name.word);
  }
  return names;
}

Json scene_to_json(const fs::path& file) {
  Notes notes;
  const Scene scene = dpr::read_scene(file, notes);
  const Json document = Json::parse(read_file(file));  // for the names, which the scene does not keep
  Json meshes = Json::array();
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    const std::optional<std::size_t> instance_of = scene.meshes[i].instance_of;
    const Json& entry = document.at("meshes").at(instance_of.value_or(i));
    const std::string name = entry.contains("file") ? entry["file"].get<std::string>() : "";
    const auto materials =
        name.empty() ? std::vector<MeshMaterial>() : mesh_materials(file.parent_path() / name);
    Json mesh{{"file", name.empty() ? Json() : Json(name)}};
    if (instance_of) mesh["instance_of"] = *instance_of;
    mesh.update(mesh_to_json(mesh_of(scene, i), materials));
    add_clipping_notes(scene, i, mesh["notes"]);
    meshes.push_back(mesh);
  }
  Json lights;
  if (scene.lights) {
    for_each_light_kind(
        [&](auto kind) { lights[std::string(kind.key)] = ((*scene.lights).*kind.lights).size(); });
    lights["harmonics"] = scene.lights->harmonics.size();
  }
  return {{"file", file.string()},
          {"kind", "scene"},
          {"width", scene.width},
          {"height", scene.height},
          {"camera", camera_to_json(scene.camera)},
          {"background", vector_to_json(scene.background)},
          {"lights", lights},
          {"smoothing", smoothing_to_json(scene.smoothing)},
          {"gradients", gradients_to_json(scene.gradients)},
          {"meshes", meshes},
          {"notes", notes}};
}

Json file_to_json(const fs::path& file) {
  require_file(file);
  if (lower_case_extension(file) == ".json") return scene_to_json(file);
  Json json{{"file", file.string()}, {"kind", "mesh"}};
  Notes notes;
  const Mesh mesh = read_mesh(file, notes);
  json.update(mesh_to_json(mesh, mesh_materials(file)));
  for (const std::string& note : notes) json["notes"].push_back(note);
  return json;
}

// As text: names and values in two columns.

void print_line(const std::string& name, const std::string& value) {
  std::printf("  %-20s %s\n", name.c_str(), value.c_str());
}

/// Numbers separated by spaces, names by commas.
std::string list_text(const Json& list) {
  std::string text;
  for (const Json& element : list) {
    if (!text.empty()) text += element.is_number() ? " " : ", ";
    text += element.is_string() ? element.get<std::string>() : element.dump();
  }
  return text.empty() ? "none" : text;
}

std::string materials_text(const Json& materials) {
  Json texts = Json::array();
  for (const Json& material : materials) {
    const std::string name = material["name"].get<std::string>();
    texts.push_back(
        material["texture"].is_null() ? name : name + " (" + material["texture"].get<std::string>() + ")");
  }
  return list_text(texts);
}

std::string textures_text(const Json& textures) {
  Json texts = Json::array();
  for (const Json& t : textures) {
    texts.push_back(t["width"].dump() + "x" + t["height"].dump() + " " + t["wrap"].get<std::string>() + " " +
                    t["filter"].get<std::string>());
  }
  return list_text(texts);
}

void print_notes(const Json& notes) {
  for (const Json& note : notes) print_line("note", note.get<std::string>());
}

std::string surface_text(const Json& mesh) {
  const auto is = [&](const char* name) { return mesh[name].get<bool>(); };
  const auto count = [&](const char* name) { return mesh[name].get<std::size_t>(); };
  std::string text = is("closed") ? "closed" : "open, " + counted(count("boundary_edges"), "boundary edge");
  text += is("manifold") ? ", manifold"
                         : ", not manifold at " + counted(count("non_manifold_edges"), "edge") + " and " +
                               std::to_string(count("non_manifold_vertices")) + " vertices";
  return text + (is("oriented") ? ", wound in one sense" : ", wound in different senses");
}

void print_mesh(const Json& mesh) {
  print_line("vertices",
             mesh["vertices"].dump() + ", at " + mesh["distinct_positions"].dump() + " positions");
  print_line("triangles", mesh["faces"].dump());
  print_line("components", mesh["components"].dump());
  print_line("surface", surface_text(mesh));
  print_line("bounds", list_text(mesh["bounds"]["low"]) + " to " + list_text(mesh["bounds"]["high"]));
  print_line("colours", mesh["colors"].get<std::string>());
  print_line("texture coordinates", mesh["texture_coordinates"].dump());
  if (mesh["normals"] != 0) print_line("normals", mesh["normals"].dump());
  print_line("textures", textures_text(mesh["textures"]));
  print_line("materials", materials_text(mesh["materials"]));
  print_notes(mesh["notes"]);
}

std::string camera_text(const Json& camera) {
  std::string lens;
  if (camera.contains("intrinsics")) {
    lens = "fx " + camera["intrinsics"]["fx"].dump() + ", fy " + camera["intrinsics"]["fy"].dump();
  } else if (camera.contains("orthographic_height")) {
    lens = "orthographic, " + camera["orthographic_height"].dump() + " high";
  } else {
    lens = camera["fov_y_degrees"].dump() + " degrees high";
  }
  for (const char* const model : {"distortion", "fisheye"}) {
    if (camera.contains(model)) lens += ", " + std::string(model) + " " + list_text(camera[model]);
  }
  return lens + ", depths from " + camera["znear"].dump() + " to " + camera["zfar"].dump();
}

std::string lights_text(const Json& lights) {
  if (lights.is_null()) return "none: colours as they are";
  std::string text = "ambient";
  for (const auto& [kind, count] : lights.items()) {
    if (kind == "point" || count != 0) text += " and " + count.dump() + " " + kind;
  }
  return text;
}

void print_scene(const Json& scene) {
  print_line("size", scene["width"].dump() + "x" + scene["height"].dump());
  print_line("camera", camera_text(scene["camera"]));
  print_line("background", list_text(scene["background"]));
  print_line("lights", lights_text(scene["lights"]));
  std::string smoothing;
  for (const auto& [name, value] : scene["smoothing"].items())
    smoothing += (smoothing.empty() ? "" : ", ") + name + " " + list_text(Json::array({value}));
  print_line("smoothing", smoothing);
  print_line("gradients", list_text(scene["gradients"]));
  print_notes(scene["notes"]);
  for (const Json& mesh : scene["meshes"]) {
    const std::string instance =
        mesh.contains("instance_of") ? "another place of mesh " + mesh["instance_of"].dump() : "mesh";
    std::printf("%s: %s\n",
                mesh["file"].is_null() ? "(in the scene file)" : mesh["file"].get<std::string>().c_str(),
                instance.c_str());
    print_mesh(mesh);
  }
}

void run(const std::string& file, bool as_json) {
  const Json info = file_to_json(file);
  if (as_json) {
    std::printf("%s", to_text(info).c_str());
    return;
  }
  const bool is_scene = info["kind"] == "scene";
  std::printf("%s: %s\n", file.c_str(), is_scene ? "scene" : "mesh");
  is_scene ? print_scene(info) : print_mesh(info);
}

}  // namespace

void add_info_command(CLI::App& application, CommonOptions& common) {
  CLI::App* command =
      application.add_subcommand("info", "Says what is in a mesh or a scene, and what dpr does with it");
  const auto file = std::make_shared<std::string>();
  const auto as_json = std::make_shared<bool>(false);
  command->add_option("FILE", *file, "Mesh (OBJ, PLY, OFF, STL, glTF) or scene (JSON)")
      ->required()
      ->type_name("");
  command->add_flag("--json", *as_json, "Print JSON");
  add_output_options(*command, common);
  command->footer(
      "The surface is looked at with vertices at equal positions taken for one.\n"
      "JSON of a mesh: file, kind, vertices, distinct_positions, faces, components, edges, boundary_edges, "
      "closed,\n"
      "manifold, non_manifold_edges, non_manifold_vertices, oriented, faces_without_area, bounds {low, "
      "high}, colors\n"
      "(vertex, face, none), texture_coordinates, normals, textures [{width, height, wrap, filter}], "
      "materials "
      "[{name, texture}],\n"
      "notes (sentences). Of a scene: file,\n"
      "kind, width, height, camera, background, lights, smoothing, gradients, meshes, notes.\n"
      "Example: dpr info bunny.obj");
  command->callback([file, as_json] { run(*file, *as_json); });
}

}  // namespace dpr::cli
