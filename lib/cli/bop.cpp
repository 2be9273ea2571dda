#include "cli/bop.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include "base/checks.hpp"
#include "base/from_chars.hpp"
#include "base/json_node.hpp"
#include "base/output_file.hpp"
#include "cli/text.hpp"
#include "dpr/error.hpp"
#include "dpr/mesh.hpp"
#include "solve/polar.hpp"

namespace dpr::cli {
namespace {

namespace fs = std::filesystem;

/// Of images and objects in the names of files.
std::string six_digits(std::uint64_t number) { return padded(number, 6); }

std::vector<float> numbers(const JsonNode& node, std::size_t count) {
  std::vector<float> values;
  for (const JsonNode& element : node.elements(count)) values.push_back(element.number());
  return values;
}

/// Row by row.
glm::dmat3 matrix(const JsonNode& node) {
  const std::vector<float> k = numbers(node, 9);
  glm::dmat3 result;
  for (int i = 0; i < 9; ++i) result[i % 3][i / 3] = static_cast<double>(k[static_cast<std::size_t>(i)]);
  return result;
}

Intrinsics intrinsics_of(const JsonNode& node) {
  const std::vector<float> k = numbers(node, 9);
  const bool is_pinhole =
      k[0] > 0 && k[4] > 0 && k[1] == 0 && k[3] == 0 && k[6] == 0 && k[7] == 0 && k[8] == 1;
  if (!is_pinhole) node.fail("another matrix", "[fx, 0, cx, 0, fy, cy, 0, 0, 1], without skew");
  return from_opencv_intrinsics({k[0], k[4], k[2], k[5]});
}

Pose pose_of(const JsonNode& object) {
  const glm::dmat3 rotation = matrix(object.at("cam_R_m2c"));
  if (!(glm::determinant(rotation) > 0)) object.at("cam_R_m2c").fail("no rotation", "a rotation matrix");
  const std::vector<float> t = numbers(object.at("cam_t_m2c"), 3);
  return {polar_decomposition(rotation).rotation, glm::dvec3(t[0], t[1], t[2])};
}

std::vector<BopInstance> instances_of(const JsonNode& objects, std::uint64_t wanted) {
  std::vector<BopInstance> instances;
  std::string others;
  const std::vector<JsonNode> elements = objects.elements();
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const std::uint64_t number =
        elements[i].at("obj_id").whole_number(std::numeric_limits<std::uint32_t>::max());
    if (number == wanted) {
      instances.push_back({i, pose_of(elements[i])});
    } else {
      others += (others.empty() ? "" : ", ") + std::to_string(number);
    }
  }
  if (!instances.empty()) return instances;
  objects.fail("no object " + std::to_string(wanted), others.empty() ? "an image of it" : "one of " + others);
}

double distance(const BopInstance& instance, const Pose& found) {
  return glm::length(instance.pose.translation - found.translation);
}

/// The model, about whose origin all vertices are within the radius.
Mesh read_model(const BopOptions& options, Notes& notes, double& radius) {
  const fs::path data = bop_scene_folder(options.folder).parent_path().parent_path();
  const fs::path models = options.models.empty() ? data / "models" : fs::path(options.models);
  const fs::path file = models / ("obj_" + six_digits(options.object) + ".ply");
  Mesh mesh = read_mesh(file, notes);
  radius = 0;
  for (const glm::vec3& p : mesh.positions) radius = std::max(radius, glm::length(glm::dvec3(p)));
  if (!(radius > 0)) throw InvalidArgument(checks::in("size of the model", file.string()), "0", "a size > 0");
  return mesh;
}

}  // namespace

fs::path bop_scene_folder(const std::string& folder) {
  return fs::absolute(fs::path(folder) / "").lexically_normal().parent_path();
}

std::string bop_picture(const BopOptions& options) {
  constexpr std::array<const char*, 2> k_folders{"rgb", "gray"};
  constexpr std::array<const char*, 4> k_extensions{".png", ".jpg", ".tif", ".jpeg"};
  for (const char* const folder : k_folders) {
    for (const char* const extension : k_extensions) {
      const fs::path file = fs::path(options.folder) / folder / (six_digits(options.image) + extension);
      std::error_code error;
      if (fs::exists(file, error)) return file.string();
    }
  }
  throw IoError(fs::path(options.folder) / "rgb" / (six_digits(options.image) + ".png"),
                "the file does not exist, and none in gray or with another extension (.jpg, .tif)");
}

BopImage read_bop_image(const BopOptions& options) {
  const std::string key = std::to_string(options.image);
  const fs::path folder(options.folder), camera_file = folder / "scene_camera.json";
  const nlohmann::json cameras = read_json(camera_file);
  const JsonNode camera = JsonNode(cameras, camera_file).at(key);
  BopImage image{1, intrinsics_of(camera.at("cam_K")), {}};
  if (const auto scale = camera.find("depth_scale")) {
    image.depth_scale = scale->number();
    checks::require_positive(image.depth_scale, scale->name());
  }
  const fs::path truth_file = folder / "scene_gt.json";
  std::error_code error;
  if (!fs::exists(truth_file, error)) return image;
  const nlohmann::json truths = read_json(truth_file);
  image.instances = instances_of(JsonNode(truths, truth_file).at(key), options.object);
  return image;
}

Scene bop_scene(const BopOptions& options, const BopImage& image, glm::ivec2 size, bool starts_true,
                Notes& notes) {
  constexpr double k_part = 0.5;  // of the image's short side, which an object in front of the camera fills
  constexpr double k_nearest = 0.1, k_furthest = 100;  // radii
  Scene scene;
  scene.width = size.x;
  scene.height = size.y;
  scene.camera.view = from_opencv_view(glm::mat4(1.0F));
  scene.camera.intrinsics = image.intrinsics;
  double radius = 0;
  Mesh mesh = read_model(options, notes, radius);
  const double short_side = std::min(size.x, size.y), focal = static_cast<double>(image.intrinsics.fy);
  Pose start{glm::dmat3(1.0), {0, 0, 2 * radius * focal / (k_part * short_side)}};
  if (starts_true && !image.instances.empty()) start = image.instances.front().pose;
  scene.camera.znear = static_cast<float>(k_nearest * radius);
  scene.camera.zfar = static_cast<float>(std::max(k_furthest * radius, 4 * start.translation.z));
  scene.meshes.push_back({std::move(mesh), affine(start.rotation, start.translation)});
  return scene;
}

const BopInstance* nearest_instance(const BopImage& image, const Pose& found) {
  const auto nearest = std::ranges::min_element(
      image.instances, {}, [&](const BopInstance& instance) { return distance(instance, found); });
  return nearest == image.instances.end() ? nullptr : &*nearest;
}

void print_reference(const BopImage& image, const BopInstance& nearest, const Pose& found) {
  const std::size_t count = image.instances.size();
  const std::string which =
      count == 1 ? "" : format(", the nearest of %zu instances (gt_id %zu)", count, nearest.gt_id);
  std::printf("scene_gt.json%s: %.3f degrees, %.3f mm away\n", which.c_str(),
              angle_degrees(found.rotation, nearest.pose.rotation), distance(nearest, found));
}

std::uint64_t bop_scene_number(const std::string& folder) {
  const std::string name = bop_scene_folder(folder).filename().string();
  std::uint64_t number = 0;
  const char *const begin = name.data(), *const end = begin + name.size();
  if (from_chars(begin, end, number).ptr == end && !name.empty()) return number;
  throw InvalidArgument("--bop (command line)", "the folder name \"" + name + "\"",
                        "the number of a scene, such as 000001, for a result in CSV");
}

void write_bop_result(const fs::path& file, const BopOptions& options, const PoseResult& result) {
  std::string rotation, translation;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      rotation += (rotation.empty() ? "" : " ") + checks::text(result.pose.rotation[column][row]);
    translation += (translation.empty() ? "" : " ") + checks::text(result.pose.translation[row]);
  }
  write_whole_file(file, "scene_id,im_id,obj_id,score,R,t,time\n" +
                             std::to_string(bop_scene_number(options.folder)) + "," +
                             std::to_string(options.image) + "," + std::to_string(options.object) + "," +
                             (result.explained ? "1" : "0") + "," + rotation + "," + translation + "," +
                             checks::text(result.seconds) + "\n");
}

void add_bop_options(CLI::App& command, BopOptions& options) {
  constexpr const char* k_group = "BOP (https://bop.felk.cvut.cz)";
  const auto add = [&](const char* name, std::string& value, const char* description, const char* type) {
    command.add_option(name, value, description)->group(k_group)->type_name(type);
  };
  add("--bop", options.folder,
      "Folder of a scene of a BOP data set, in place of --scene: camera, picture, model (millimetres) and, "
      "without --search, the start (that of the object's first instance) are its files'; the translation is "
      "looked for, and P.json or a row of results in P.csv is written. The error is that from the nearest "
      "instance",
      "DATASET/test/000001");
  const auto add_number = [&](const char* name, std::uint64_t& value, const char* description,
                              const char* type) {
    const auto read = [&value, name](const std::string& text) {
      value = parse_whole_number(text, std::string(name) + " (command line)");
    };
    command.add_option_function<std::string>(name, read, description)->group(k_group)->type_name(type);
  };
  add_number("--image", options.image, "Number of the image", "N");
  add_number("--object", options.object, "Number of the object", "ID");
  add("--models", options.models, "Folder of the models; DATASET/models by default", "DIR");
}

}  // namespace dpr::cli
