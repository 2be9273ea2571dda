// The YAML of cv::FileStorage: keys at the begin of a line; what is indented below belongs to them.
#include "scene/opencv_camera.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "base/checks.hpp"
#include "base/input_file.hpp"
#include "dpr/error.hpp"
#include "mesh/scan_text.hpp"

namespace dpr {
namespace {

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && scan::is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && scan::is_space(text.back())) text.remove_suffix(1);
  return text;
}

/// A key as OpenCV's calibration program spells it.
std::string usual_key(std::string key) {
  // Programs of OpenCV 2 write Camera_Matrix.
  std::ranges::transform(key, key.begin(), [](unsigned char c) { return std::tolower(c); });
  if (key == "cameramatrix") return "camera_matrix";
  if (key == "distcoeffs" || key == "dist_coeffs") return "distortion_coefficients";
  return key;
}

/// The value of a key: what follows on its line, and further lines that are indented.
struct YamlValue {
  std::size_t line = 0;
  std::vector<std::string_view> lines;
};

class YamlFile {
 public:
  YamlFile(const std::filesystem::path& file, std::string_view text) : file_(file) {
    scan::Lines lines(scan::without_byte_order_mark(text));
    YamlValue* last = nullptr;
    while (lines.next()) {
      const std::string_view line = lines.line(), content = trimmed(line);
      if (content.empty() || content.front() == '#' || line.front() == '%' || content == "---") continue;
      if (content == "...") break;
      const bool continues = scan::is_space(line.front()) || line.front() == '-';
      if (continues && last != nullptr) {
        last->lines.push_back(content);
      } else {
        last = add(line, lines.number());
      }
    }
  }

  const YamlValue* find(std::string_view key) const {
    const auto found = values_.find(key);
    return found == values_.end() ? nullptr : &found->second;
  }

  std::optional<int> whole_number(std::string_view key) const {
    const YamlValue* const value = find(key);
    if (value == nullptr) return {};
    const auto number = scan::parse<int>(value->lines.front());
    if (!number) fail(*value, std::string(key), "a whole number");
    return number;
  }

  /// The numbers of a matrix, row by row.
  std::vector<float> matrix(const YamlValue& value, const std::string& key) const {
    std::string data;
    bool is_data = false;
    for (const std::string_view line : value.lines) {
      is_data = is_data || line.starts_with("data:");
      if (is_data) data.append(line).append(" ");
    }
    const std::size_t begin = data.find('['), end = data.find(']');
    if (begin == std::string::npos || end == std::string::npos || end < begin)
      fail(value, key, "a matrix with \"data: [...]\"");
    std::string list = data.substr(begin + 1, end - begin - 1);
    std::ranges::replace(list, ',', ' ');
    std::vector<std::string_view> words;
    scan::split(list, words);
    std::vector<float> numbers;
    for (const std::string_view word : words) {
      const auto number = scan::parse_coordinate(word);
      if (!number) fail(value, key, "finite numbers in place of " + scan::quoted(word));
      numbers.push_back(*number);
    }
    return numbers;
  }

  [[noreturn]] void fail(const YamlValue& value, const std::string& key, const std::string& expected) const {
    throw IoError(file_, key + ": expected " + expected, value.line);
  }

 private:
  YamlValue* add(std::string_view line, std::size_t number) {
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos || scan::is_space(line.front()))
      throw IoError(file_, "not YAML as cv::FileStorage writes it: expected KEY: VALUE", number);
    const std::string key = usual_key(std::string(trimmed(line.substr(0, colon))));
    const auto [entry, is_new] = values_.insert({key, {number, {trimmed(line.substr(colon + 1))}}});
    if (!is_new) throw IoError(file_, scan::quoted(key) + " twice", number);
    return &entry->second;
  }

  const std::filesystem::path& file_;
  std::map<std::string, YamlValue, std::less<>> values_;
};

Intrinsics intrinsics_of(const YamlFile& yaml, const std::filesystem::path& file) {
  constexpr const char* k_key = "camera_matrix";
  const YamlValue* const value = yaml.find(k_key);
  if (value == nullptr) throw IoError(file, "no camera_matrix, as cv::FileStorage writes it");
  const std::vector<float> k = yaml.matrix(*value, k_key);
  if (k.size() != 9) yaml.fail(*value, k_key, "9 numbers, got " + std::to_string(k.size()));
  const std::array<std::pair<std::size_t, float>, 5> fixed{{{1, 0}, {3, 0}, {6, 0}, {7, 0}, {8, 1}}};
  for (const auto& [place, number] : fixed) {
    if (k[place] == number) continue;
    throw InvalidArgument(checks::in("camera_matrix[" + std::to_string(place) + "]", file.string()),
                          checks::text(k[place]),
                          checks::text(number) + ": [fx, 0, cx, 0, fy, cy, 0, 0, 1], without skew");
  }
  const Intrinsics intrinsics = from_opencv_intrinsics({k[0], k[4], k[2], k[5]});
  checks::require_positive(intrinsics.fx, checks::in("fx of camera_matrix", file.string()));
  checks::require_positive(intrinsics.fy, checks::in("fy of camera_matrix", file.string()));
  return intrinsics;
}

constexpr const char* k_coefficients = "distortion_coefficients";

std::optional<Distortion> brown_lens(const YamlFile& yaml, const std::filesystem::path& file) {
  constexpr std::array<const char*, 14> k_names{"k1", "k2", "p1", "p2", "k3", "k4",    "k5",
                                                "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y"};
  constexpr std::size_t k_held = 5;
  const YamlValue* const value = yaml.find(k_coefficients);
  if (value == nullptr) return {};
  std::vector<float> k = yaml.matrix(*value, k_coefficients);
  constexpr std::array<std::size_t, 6> k_counts{0, 4, 5, 8, 12, 14};
  if (std::ranges::find(k_counts, k.size()) == k_counts.end())
    yaml.fail(*value, k_coefficients, "4, 5, 8, 12 or 14 numbers, got " + std::to_string(k.size()));
  for (std::size_t i = k_held; i < k.size(); ++i) {
    if (k[i] == 0) continue;
    throw InvalidArgument(checks::in(std::string(k_names[i]) + " of " + k_coefficients, file.string()),
                          checks::text(k[i]),
                          "0: a lens here has k1, k2, p1, p2 and k3; calibrate without the others");
  }
  k.resize(k_held);
  if (std::ranges::all_of(k, [](float number) { return number == 0; })) return {};
  return Distortion{k[0], k[1], k[2], k[3], k[4]};
}

Distortion fisheye_lens(const YamlFile& yaml, const std::filesystem::path& file) {
  const YamlValue* const value = yaml.find(k_coefficients);
  if (value == nullptr) throw IoError(file, std::string("a fisheye without ") + k_coefficients);
  const std::vector<float> k = yaml.matrix(*value, k_coefficients);
  if (k.size() != 4)
    yaml.fail(*value, k_coefficients, "4 numbers of a fisheye, got " + std::to_string(k.size()));
  return fisheye(k[0], k[1], k[2], k[3]);
}

bool is_fisheye(const YamlFile& yaml, const std::filesystem::path& file) {
  if (yaml.whole_number("fisheye_model").value_or(0) != 0) return true;
  const YamlValue* const model = yaml.find("distortion_model");  // ROS
  if (model == nullptr) return false;
  const std::string_view name = model->lines.front();
  if (name == "equidistant") return true;
  if (name == "plumb_bob" || name == "rational_polynomial") return false;
  throw InvalidArgument(checks::in("distortion_model", file.string()), scan::quoted(name),
                        "plumb_bob or equidistant");
}

}  // namespace

OpenCvCamera parse_opencv_camera(const std::filesystem::path& file, std::string_view text) {
  const std::string_view content = trimmed(scan::without_byte_order_mark(text));
  if (content.starts_with('<') || content.starts_with('{')) {
    throw IoError(file,
                  "XML or JSON, expected YAML, which cv::FileStorage writes to names that end with .yml");
  }
  const YamlFile yaml(file, text);
  OpenCvCamera camera{intrinsics_of(yaml, file), {}, {}};
  camera.distortion = is_fisheye(yaml, file) ? fisheye_lens(yaml, file) : brown_lens(yaml, file);
  const auto width = yaml.whole_number("image_width"), height = yaml.whole_number("image_height");
  if (!width && !height) return camera;
  if (!width || !height) {
    throw InvalidArgument(checks::in(width ? "image_height" : "image_width", file.string()), "none",
                          width ? "one beside image_width" : "one beside image_height");
  }
  for (const int side : {*width, *height}) {
    if (side < 1 || side > checks::k_largest_side) {
      throw InvalidArgument(checks::in("image_width and image_height", file.string()),
                            checks::size(*width, *height),
                            "1 to " + std::to_string(checks::k_largest_side) + " pixels on a side");
    }
  }
  camera.size = glm::ivec2(*width, *height);
  return camera;
}

OpenCvCamera read_opencv_camera(const std::filesystem::path& file) {
  return parse_opencv_camera(file, read_file(file));
}

}  // namespace dpr
