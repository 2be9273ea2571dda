// Files of sequences.
#include "cli/sequence.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <set>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/input_file.hpp"
#include "cli/aov_files.hpp"
#include "cli/target.hpp"
#include "cli/text.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

constexpr const char* k_digits = "0123456789";

bool has_extension(const std::filesystem::path& file, std::span<const std::string_view> extensions) {
  return std::ranges::find(extensions, lower_case_extension(file)) != extensions.end();
}

bool is_video(const std::filesystem::path& file) {
  static constexpr std::array<std::string_view, 9> extensions{".mp4", ".m4v",  ".mov",  ".avi", ".mkv",
                                                              ".mpg", ".mpeg", ".webm", ".gif"};
  return has_extension(file, extensions);
}

bool is_image(const std::filesystem::path& file) {
  static constexpr std::array<std::string_view, 13> extensions{".png",  ".jpg",  ".jpeg", ".exr", ".tif",
                                                               ".tiff", ".bmp",  ".tga",  ".ppm", ".pgm",
                                                               ".hdr",  ".webp", ".jp2"};
  return has_extension(file, extensions);
}

bool is_folder(const std::filesystem::path& path) {
  std::error_code error;
  return std::filesystem::is_directory(path, error);
}

/// Entries of a folder that hold images, in natural order, but for "a.depth.exr" and the like beside "a.png", which
/// `dpr render --aov` leaves there.
std::vector<std::filesystem::path> images_in(const std::filesystem::path& folder) {
  std::error_code error;
  std::vector<std::filesystem::path> files;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (!is_folder(entry->path()) && is_image(entry->path())) files.push_back(entry->path());
  }
  if (error) throw IoError(folder, error.message());
  std::set<std::filesystem::path> stems;
  for (const std::filesystem::path& file : files) stems.insert(file.stem());
  std::erase_if(files, [&](const std::filesystem::path& file) {
    const std::filesystem::path stem = file.stem();
    const std::string name = stem.extension().string();
    return file.extension() == ".exr" && !name.empty() && AovFiles::is_name(name.substr(1)) &&
           stems.contains(stem.stem());
  });
  std::ranges::sort(files, [](const auto& a, const auto& b) {
    const std::string first = a.stem().string(), second = b.stem().string();
    return first == second ? a < b : is_naturally_less(first, second);
  });
  return files;
}

/// A file name with a number in it: "%04d", "%d" or "####".
struct NumberedName {
  std::string prefix, suffix;
  std::size_t width = 0;  ///< least number of digits

  std::string with(std::uint64_t number) const { return prefix + padded(number, width) + suffix; }
  /// The number of a name that with() would make.
  std::optional<std::uint64_t> number_of(const std::string& name) const {
    if (name.size() <= prefix.size() + suffix.size() || !name.starts_with(prefix) || !name.ends_with(suffix))
      return std::nullopt;
    const char* const begin = name.data() + prefix.size();
    const char* const end = name.data() + name.size() - suffix.size();
    std::uint64_t number = 0;
    const auto [rest, error] = std::from_chars(begin, end, number);
    if (error != std::errc() || rest != end || with(number) != name) return std::nullopt;
    return number;
  }
};

/// None of a name without a place for a number.
std::optional<NumberedName> numbered_name(const std::string& name) {
  const std::size_t hash = name.find('#');
  if (hash != std::string::npos) {
    const std::size_t end = std::min(name.find_first_not_of('#', hash), name.size());
    return NumberedName{name.substr(0, hash), name.substr(end), end - hash};
  }
  const std::size_t percent = name.find('%');
  if (percent == std::string::npos) return std::nullopt;
  const std::size_t end = name.find_first_not_of(k_digits, percent + 1);
  if (end == std::string::npos || name[end] != 'd') return std::nullopt;
  std::size_t width = 0;
  std::from_chars(name.data() + percent + 1, name.data() + end, width);
  constexpr std::size_t k_most_digits = 19;
  if (width > k_most_digits) return std::nullopt;
  return NumberedName{name.substr(0, percent), name.substr(end + 1), width};
}

/// From the lowest number to the highest, or to the first that is missing, whose file will not be found.
std::vector<std::filesystem::path> numbered_files(const std::filesystem::path& pattern,
                                                  const NumberedName& name) {
  const std::filesystem::path folder = pattern.parent_path();
  std::error_code error;
  std::vector<std::uint64_t> numbers;
  for (std::filesystem::directory_iterator entry(folder.empty() ? "." : folder, error), end;
       !error && entry != end; entry.increment(error)) {
    if (const auto number = name.number_of(entry->path().filename().string())) numbers.push_back(*number);
  }
  if (error) throw IoError(folder, error.message());
  std::ranges::sort(numbers);
  std::vector<std::filesystem::path> files;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const std::uint64_t expected = numbers.front() + i;
    files.push_back(folder / name.with(expected));
    if (numbers[i] != expected) break;
  }
  return files;
}

/// What a name stands for.
std::vector<std::filesystem::path> files_of(const char* option, const std::string& name) {
  const std::filesystem::path path(name);
  if (is_folder(path)) {
    std::vector<std::filesystem::path> files = images_in(path);
    if (files.empty()) throw InvalidArgument(named(option, name), "a folder without images", "images in it");
    return files;
  }
  std::error_code error;
  if (std::filesystem::exists(path, error)) return {path};
  const auto numbered = numbered_name(path.filename().string());
  if (!numbered) return {path};  // not there, which is an error when its turn comes
  std::vector<std::filesystem::path> files = numbered_files(path, *numbered);
  if (files.empty()) {
    throw InvalidArgument(named(option, name), "no file that matches",
                          "a file, a folder, or a pattern such as frames/%04d.png of files that are there");
  }
  return files;
}

bool are_folders(const std::vector<std::string>& names) { return std::ranges::all_of(names, is_folder); }

/// The digits from a place of a text on, without zeros in front; the place moves behind them.
std::string number_at(const std::string& text, std::size_t& at) {
  const std::size_t end = std::min(text.find_first_not_of(k_digits, at), text.size());
  const std::size_t begin = std::min(text.find_first_not_of('0', at), end);
  at = end;
  return text.substr(begin, end - begin);
}

/// The numbers of a name, one after the other.
std::vector<std::string> numbers_in(const std::string& name) {
  std::vector<std::string> numbers;
  for (std::size_t at = 0; (at = name.find_first_of(k_digits, at)) != std::string::npos;)
    numbers.push_back(number_at(name, at));
  return numbers;
}

/// True if both end with the same numbers, as "rgb2_007" and "depth_7"; without any, if one is the other's beginning.
bool are_named_alike(const std::string& name, const std::string& frame) {
  const std::vector<std::string> a = numbers_in(name), b = numbers_in(frame);
  if (a.empty() || b.empty()) return a.empty() && b.empty() && name.starts_with(frame);
  const std::ptrdiff_t count = std::min(std::ssize(a), std::ssize(b));
  return std::equal(a.end() - count, a.end(), b.end() - count);
}

std::deque<std::filesystem::path> files_of(const char* option, const std::vector<std::string>& names) {
  std::deque<std::filesystem::path> files;
  for (const std::string& name : names) {
    for (std::filesystem::path& file : files_of(option, name)) files.push_back(std::move(file));
  }
  return files;
}

}  // namespace

bool is_naturally_less(const std::string& a, const std::string& b) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (!is_digit(a[i]) || !is_digit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i, ++j;
      continue;
    }
    const std::string m = number_at(a, i), n = number_at(b, j);
    if (m.size() != n.size()) return m.size() < n.size();
    if (m != n) return m < n;
  }
  if (i < a.size() || j < b.size()) return j < b.size();
  return a < b;  // the same but for zeros in front
}

Sequence::Sequence(const std::vector<std::string>& names, Encoding encoding, const Scene& scene)
    : option_("--sequence"),
      files_(files_of(option_, names)),
      are_folders_(are_folders(names)),
      reader_([encoding](const std::string& file) { return read_image(file, nullptr, encoding); }),
      encoding_(encoding),
      size_of_frames_(scene.width, scene.height) {
  if (std::ranges::none_of(files_, is_video)) size_ = files_.size();
  std::ranges::for_each(files_, add_input);
}

Sequence::Sequence(const char* option, const std::vector<std::string>& names, const Scene& scene,
                   Reader reader)
    : option_(option),
      files_(files_of(option, names)),
      are_folders_(are_folders(names)),
      reader_(std::move(reader)),
      size_of_frames_(scene.width, scene.height),
      size_(files_.size()) {
  const auto video = std::ranges::find_if(files_, is_video);
  if (video != files_.end())
    throw InvalidArgument(named(option, video->string()), "a video", "an image for each frame");
  std::ranges::for_each(files_, require_file);
}

void Sequence::require_names_of(const Sequence& frames) const {
  if (!are_folders_ || !frames.are_folders_) return;
  for (std::size_t i = 0; i < files_.size(); ++i) {
    if (are_named_alike(files_[i].stem().string(), frames.files_[i].stem().string())) continue;
    throw InvalidArgument("images of " + std::string(option_) + " (command line)",
                          files_[i].filename().string() + " for " + frames.files_[i].filename().string(),
                          "the numbers or names of the files of --sequence, or a pattern or a list of files");
  }
}

std::optional<SequenceFrame> Sequence::next() {
  while (!files_.empty()) {
    const std::filesystem::path file = files_.front();
    if (!is_video(file)) {
      files_.pop_front();
      return checked(file.string(), reader_(file.string()));
    }
    if (auto frame = next_of_video()) return frame;
    files_.pop_front();
  }
  return std::nullopt;
}

std::optional<SequenceFrame> Sequence::next_of_video() {
  if (!video_) {
    video_.emplace(files_.front(), encoding_);
    video_frame_ = 0;
  }
  Image image;
  if (!video_->next(image)) {
    video_.reset();
    return std::nullopt;
  }
  return checked(files_.front().string() + ":" + std::to_string(video_frame_++), std::move(image));
}

SequenceFrame Sequence::checked(std::string file, Image image) const {
  require_size(image, size_of_frames_, named(option_, file));
  return {std::move(file), std::move(image)};
}

}  // namespace dpr::cli
