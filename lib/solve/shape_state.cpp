// Checkpoints: CBOR by nlohmann's library, which keeps every bit of a double, and a checksum of the content.
#include "solve/shape_state.hpp"

#include <nlohmann/json.hpp>
#include <ostream>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "base/input_file.hpp"
#include "base/temporary_file.hpp"
#include "dpr/error.hpp"

namespace dpr {
namespace {

using nlohmann::json;

/// What a file begins with.
constexpr std::string_view k_magic = "dpr shape checkpoint 3\n";

/// FNV-1a, 64 bits (Fowler, Noll & Vo 1991).
class Hash {
 public:
  template <typename Value>
  void add(const Value& value) {
    static_assert(std::has_unique_object_representations_v<Value> || std::is_floating_point_v<Value>);
    add_bytes(std::as_bytes(std::span(&value, 1)));
  }
  void add(const glm::vec3& v) {
    for (int i = 0; i < 3; ++i) add(v[i]);
  }
  void add_bytes(std::span<const std::byte> bytes) {
    for (const std::byte byte : bytes)
      value_ = (value_ ^ std::to_integer<std::uint64_t>(byte)) * 0x100000001b3U;
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325U;
};

void add(Hash& hash, const Camera& camera) {
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) hash.add(camera.view[column][row]);
  }
  const Intrinsics k = camera.intrinsics.value_or(Intrinsics{});
  for (const float value : {camera.fov_y_degrees, camera.znear, camera.zfar, k.fx, k.fy, k.cx, k.cy})
    hash.add(value);
}

void add(Hash& hash, const Mesh& mesh) {
  for (const auto* list : {&mesh.positions, &mesh.vertex_colors}) {
    for (const glm::vec3& v : *list) hash.add(v);
  }
  for (const glm::uvec3& f : mesh.faces) {
    for (int i = 0; i < 3; ++i) hash.add(f[i]);
  }
}

void add(Hash& hash, const Smoothing& s) {
  for (const int value :
       {static_cast<int>(s.occupancy_prior), static_cast<int>(s.depth_prior), static_cast<int>(s.composition),
        static_cast<int>(s.occupancy_estimator), static_cast<int>(s.aggregation_estimator),
        static_cast<int>(s.variance_reduction), static_cast<int>(s.draws), static_cast<int>(s.distance),
        static_cast<int>(s.occupancy_width), static_cast<int>(s.samples)}) {
    hash.add(value);
  }
  for (const float value : {s.sigma, s.gamma, s.alpha, s.occupancy_threshold, s.blur_radius.value_or(-1.0F),
                            s.background_depth}) {
    hash.add(value);
  }
  hash.add(s.seed);
}

void add(Hash& hash, const ShapeOptions& o) {
  for (const unsigned value : {o.levels, o.iterations, o.batch, o.remesh_interval,
                               static_cast<unsigned>(o.steps), static_cast<unsigned>(o.schedule)})
    hash.add(value);
  for (const float value :
       {o.edge_pixels, o.blur, o.blur_end, o.lambda, o.loss.mse, o.loss.l1, o.loss.silhouette,
        o.regularizers.laplacian, o.regularizers.edge_length, o.regularizers.normal_consistency,
        o.regularizers.flatness, o.regularizers.edge_target}) {
    hash.add(value);
  }
  hash.add(o.learning_rate);
  hash.add(o.learning_rate_end);
  hash.add(o.color_learning_rate);
}

json to_json(const OptimizerState& state) {
  return {state.first_moment, state.second_moment, state.iteration};
}

OptimizerState optimizer_state(const json& node) {
  return {node.at(0).get<std::vector<double>>(), node.at(1).get<std::vector<double>>(),
          node.at(2).get<unsigned>()};
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
  json faces = json::array(), history = json::array();
  for (const glm::uvec3& f : state.faces) faces.push_back({f.x, f.y, f.z});
  for (const ShapeIteration& step : state.history) history.push_back(to_json(step));
  return {{"iteration", state.iteration},
          {"faces", faces},
          {"positions", state.positions},
          {"colors", state.colors},
          {"position_steps", to_json(state.position_steps)},
          {"color_steps", to_json(state.color_steps)},
          {"adaptive",
           {state.adaptive.sigma, state.adaptive.gamma, state.adaptive.samples, state.adaptive.average}},
          {"history", history}};
}

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
  for (const json& step : node.at("history")) state.history.push_back(iteration(step, finest));
  return state;
}

std::uint64_t hash_of(const std::vector<std::uint8_t>& bytes, std::uint64_t fingerprint) {
  Hash hash;
  hash.add_bytes(std::as_bytes(std::span(bytes)));
  hash.add(fingerprint);
  return hash.value();
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

std::uint64_t fingerprint(const ShapeViews& views, const Mesh& start, const ShapeOptions& options) {
  Hash hash;
  hash.add(views.width);
  hash.add(views.height);
  hash.add(views.background);
  for (const ShapeView& view : views.views) {
    for (const glm::vec4& pixel : view.image.pixels) {
      for (int i = 0; i < 4; ++i) hash.add(pixel[i]);
    }
    add(hash, view.camera);
    hash.add(static_cast<int>(view.has_alpha));
  }
  if (views.smoothing) add(hash, *views.smoothing);
  add(hash, start);
  add(hash, options);
  return hash.value();
}

void write_checkpoint(const std::filesystem::path& file, const ShapeState& state, std::uint64_t fingerprint) {
  const std::vector<std::uint8_t> content = json::to_cbor(to_json(state));
  const std::vector<std::uint8_t> bytes = json::to_cbor({{"fingerprint", fingerprint},
                                                         {"checksum", hash_of(content, fingerprint)},
                                                         {"content", json::binary(content)}});
  write_whole_file(file, [&](std::ostream& out) {
    out << k_magic;
    out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  });
}

ShapeState read_checkpoint(const std::filesystem::path& file, std::uint64_t fingerprint,
                           const Smoothing& finest) {
  const std::string bytes = read_file(file);
  if (!bytes.starts_with(k_magic)) throw IoError(file, "is no checkpoint of a shape, or of another version");
  try {
    const json document = json::from_cbor(bytes.substr(k_magic.size()));
    const std::vector<std::uint8_t>& content = document.at("content").get_binary();
    const auto mark = document.at("fingerprint").get<std::uint64_t>();
    if (document.at("checksum") != hash_of(content, mark)) throw IoError(file, "the checkpoint is damaged");
    if (mark != fingerprint) {
      throw InvalidArgument("checkpoint (" + file.string() + ")", "one of other views or options",
                            "one of this run; remove it to begin anew");
    }
    return state_of(json::from_cbor(content), finest);
  } catch (const json::exception&) {
    throw IoError(file, "the checkpoint is damaged");
  }
}

}  // namespace dpr
