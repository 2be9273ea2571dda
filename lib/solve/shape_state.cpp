// Checkpoints: a head with a checksum, and the content as CBOR by nlohmann's library, which keeps every bit
// of a double.
#include "solve/shape_state.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>

#include "base/hash.hpp"
#include "base/input_file.hpp"
#include "base/output_file.hpp"
#include "dpr/error.hpp"

namespace dpr {
namespace {

using nlohmann::json;

constexpr std::size_t k_camera_parameters = 6;

/// First bytes of a file. The fingerprint and the checksum follow, and then the content.
constexpr std::string_view k_magic = "dpr shape checkpoint 4\n";
constexpr std::size_t k_number_size = 8, k_head_size = k_magic.size() + 2 * k_number_size;

json to_json(const OptimizerState& state) {
  return {state.first_moment, state.second_moment, state.iteration};
}

OptimizerState optimizer_state(const json& node) {
  return {node.at(0).get<std::vector<double>>(), node.at(1).get<std::vector<double>>(),
          node.at(2).get<unsigned>()};
}

json to_json(const glm::dmat4& matrix) {
  json numbers = json::array();
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) numbers.push_back(matrix[column][row]);
  }
  return numbers;
}

glm::dmat4 matrix(const json& node) {
  glm::dmat4 result;
  std::size_t i = 0;
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) result[column][row] = node.at(i++);
  }
  return result;
}

json to_json(const ShapeIteration& i) {
  const Smoothing& s = i.smoothing;
  return {i.iteration, i.level, i.loss,  i.image_loss, i.mesh_loss, s.sigma, s.gamma,
          s.samples,   s.seed,  i.width, i.height,     i.vertices,  i.faces};
}

ShapeIteration iteration(const json& node, const Smoothing& finest) {
  ShapeIteration i;
  i.iteration = node.at(0);
  i.level = node.at(1);
  i.loss = node.at(2);
  i.image_loss = node.at(3);
  i.mesh_loss = node.at(4);
  i.smoothing = finest;
  set_sigma(i.smoothing, node.at(5));
  i.smoothing.gamma = node.at(6);
  i.smoothing.samples = node.at(7);
  i.smoothing.seed = node.at(8);
  i.width = node.at(9);
  i.height = node.at(10);
  i.vertices = node.at(11);
  i.faces = node.at(12);
  return i;
}

json to_json(const ShapeState& state) {
  json faces = json::array(), history = json::array(), cameras = json::array();
  for (const glm::uvec3& f : state.faces) faces.push_back({f.x, f.y, f.z});
  for (const ShapeIteration& step : state.history) history.push_back(to_json(step));
  for (const ShapeState::MovedCamera& camera : state.cameras)
    cameras.push_back({to_json(camera.view), to_json(camera.steps)});
  json content{{"iteration", state.iteration},
               {"faces", faces},
               {"positions", state.positions},
               {"colors", state.colors},
               {"position_steps", to_json(state.position_steps)},
               {"color_steps", to_json(state.color_steps)},
               {"adaptive",
                {state.adaptive.sigma, state.adaptive.gamma, state.adaptive.samples, state.adaptive.average}},
               {"history", history}};
  if (!cameras.empty()) content["cameras"] = cameras;
  return content;
}

/// A rotation and a translation, up to rounding.
bool is_rigid(const glm::dmat4& view) {
  constexpr double k_rounding = 1e-3;  // of single precision in a views file, and of many steps
  const glm::dmat3 linear(view);
  const glm::dmat3 excess = glm::transpose(linear) * linear - glm::dmat3(1.0);
  for (int column = 0; column < 3; ++column) {
    if (!(glm::length(excess[column]) < k_rounding)) return false;
  }
  return std::isfinite(glm::dot(view[3], view[3]));
}

/// Checks the sizes and values that the solver relies on: a checksum detects damage, but not a forged file.
bool is_consistent(const ShapeState& state) {
  const std::size_t vertices = state.positions.size() / 3;
  const auto is_finite = [](const std::vector<double>& values) {
    return std::ranges::all_of(values, [](double value) { return std::isfinite(value); });
  };
  const auto fits = [&](const OptimizerState& steps, std::size_t parameters) {
    const std::size_t size = steps.first_moment.size();
    return (size == 0 || size == parameters) && steps.second_moment.size() == size &&
           is_finite(steps.first_moment) && is_finite(steps.second_moment);
  };
  return vertices > 0 && state.positions.size() == 3 * vertices && state.colors.size() == 3 * vertices &&
         is_finite(state.positions) && is_finite(state.colors) && !state.faces.empty() &&
         std::ranges::all_of(state.faces,
                             [&](const glm::uvec3& f) {
                               return std::max({f.x, f.y, f.z}) < vertices;
                             }) &&
         fits(state.position_steps, state.positions.size()) &&
         fits(state.color_steps, state.positions.size()) &&
         std::ranges::all_of(state.cameras,
                             [&](const ShapeState::MovedCamera& camera) {
                               return is_rigid(camera.view) && fits(camera.steps, k_camera_parameters);
                             }) &&
         state.history.size() == state.iteration;
}

/// Throws json's exceptions where the content is another.
ShapeState state_of(const json& node, const Smoothing& finest) {
  ShapeState state;
  state.iteration = node.at("iteration");
  for (const json& f : node.at("faces")) state.faces.emplace_back(f.at(0), f.at(1), f.at(2));
  state.positions = node.at("positions").get<std::vector<double>>();
  state.colors = node.at("colors").get<std::vector<double>>();
  state.position_steps = optimizer_state(node.at("position_steps"));
  state.color_steps = optimizer_state(node.at("color_steps"));
  const json& adaptive = node.at("adaptive");
  state.adaptive = {adaptive.at(0), adaptive.at(1), adaptive.at(2), adaptive.at(3)};
  for (const json& camera : node.value("cameras", json::array()))
    state.cameras.push_back({matrix(camera.at(0)), optimizer_state(camera.at(1))});
  for (const json& step : node.at("history")) state.history.push_back(iteration(step, finest));
  return state;
}

/// Lists and objects within each other, counted while CBOR is read: nlohmann's reader calls itself for each,
/// and would use up the stack.
class Depth : public nlohmann::json_sax<json> {
 public:
  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(number_integer_t) override { return true; }
  bool number_unsigned(number_unsigned_t) override { return true; }
  bool number_float(number_float_t, const string_t&) override { return true; }
  bool string(string_t&) override { return true; }
  bool binary(binary_t&) override { return true; }
  bool start_object(std::size_t) override { return ++depth_ <= k_most; }
  bool key(string_t&) override { return true; }
  bool end_object() override { return --depth_ >= 0; }
  bool start_array(std::size_t) override { return ++depth_ <= k_most; }
  bool end_array() override { return --depth_ >= 0; }
  bool parse_error(std::size_t, const std::string&, const nlohmann::detail::exception&) override {
    return false;
  }

 private:
  static constexpr int k_most =
      5;  // a list of moments in a camera's state in the list of cameras in the content
  int depth_ = 0;
};

std::uint64_t hash_of(std::string_view content, std::uint64_t fingerprint) {
  Hash hash;
  hash.add_bytes(std::as_bytes(std::span(content)));
  hash.add(fingerprint);
  return hash.value();
}

/// The lowest byte first.
std::string to_bytes(std::uint64_t number) {
  std::string bytes;
  for (std::size_t i = 0; i < k_number_size; ++i) bytes += static_cast<char>(number >> (8 * i) & 0xffU);
  return bytes;
}

std::uint64_t number_of(std::string_view bytes) {
  std::uint64_t number = 0;
  for (std::size_t i = 0; i < k_number_size; ++i) {
    number |= std::uint64_t{static_cast<unsigned char>(bytes[i])} << (8 * i);
  }
  return number;
}

}  // namespace

Mesh ShapeState::mesh() const {
  Mesh mesh;
  mesh.faces = faces;
  for (std::size_t i = 0; i < positions.size(); i += 3) {
    mesh.positions.emplace_back(positions[i], positions[i + 1], positions[i + 2]);
    mesh.vertex_colors.emplace_back(colors[i], colors[i + 1], colors[i + 2]);
  }
  return mesh;
}

std::string checkpoint_bytes(std::string_view content, std::uint64_t fingerprint) {
  std::string bytes(k_magic);
  bytes.append(to_bytes(fingerprint)).append(to_bytes(hash_of(content, fingerprint))).append(content);
  return bytes;
}

void write_checkpoint(const std::filesystem::path& file, const ShapeState& state, std::uint64_t fingerprint) {
  std::string content;
  json::to_cbor(to_json(state), content);
  write_whole_file(file, checkpoint_bytes(content, fingerprint));
}

ShapeState read_checkpoint(const std::filesystem::path& file, std::uint64_t fingerprint,
                           const Smoothing& finest, std::size_t cameras) {
  const std::string bytes = read_file(file);
  release_input(file);
  if (!bytes.starts_with(k_magic)) throw IoError(file, "is no checkpoint of a shape, or of another version");
  const auto fail = [&] { throw IoError(file, "the checkpoint is damaged"); };
  if (bytes.size() < k_head_size) fail();
  const std::string_view numbers = std::string_view(bytes).substr(k_magic.size());
  const std::string_view content = std::string_view(bytes).substr(k_head_size);
  const std::uint64_t mark = number_of(numbers);
  if (number_of(numbers.substr(k_number_size)) != hash_of(content, mark)) fail();
  if (mark != fingerprint) {
    throw InvalidArgument("checkpoint (" + file.string() + ")", "one of other views or options",
                          "one of this run; remove it to begin anew");
  }
  Depth depth;
  if (!json::sax_parse(content, &depth, json::input_format_t::cbor)) fail();
  ShapeState state;
  try {
    state = state_of(json::from_cbor(content), finest);
  } catch (const json::exception&) {
    fail();
  }
  if (!is_consistent(state) || state.cameras.size() != cameras) fail();
  return state;
}

}  // namespace dpr
