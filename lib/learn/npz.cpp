#include "learn/npz.hpp"

#include <zip.h>

#include <algorithm>
#include <charconv>
#include <functional>
#include <memory>
#include <numeric>
#include <string>
#include <string_view>

#include "base/input_file.hpp"
#include "base/output_file.hpp"
#include "dpr/error.hpp"

namespace dpr::learn {
namespace {

// The format: https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html
constexpr std::string_view k_magic = "\x93NUMPY";
constexpr std::size_t k_preamble = 10;   // magic, version 1.0, two bytes of the header's length
constexpr std::size_t k_alignment = 64;  // of the data

struct CloseArchive {
  void operator()(zip_t* archive) const { zip_discard(archive); }
};
struct CloseMember {
  void operator()(zip_file_t* member) const { zip_fclose(member); }
};

std::size_t element_count(std::span<const std::size_t> shape) {
  return std::accumulate(shape.begin(), shape.end(), std::size_t{1}, std::multiplies<>());
}

/// A member of an archive, decompressed as it is read.
class Member {
 public:
  explicit Member(const std::filesystem::path& file) : file_(file) {
    int code = 0;
    archive_.reset(zip_open(file.c_str(), ZIP_RDONLY, &code));
    if (!archive_) {
      zip_error_t error;
      zip_error_init_with_code(&error, code);
      const std::string reason = zip_error_strerror(&error);
      zip_error_fini(&error);
      throw IoError(file, "cannot be read as npz: " + reason);
    }
    add_input(file);
    zip_stat_t stat;
    if (zip_stat_index(archive_.get(), 0, 0, &stat) != 0 || (stat.valid & ZIP_STAT_SIZE) == 0) {
      throw IoError(file, "holds no array");
    }
    size_ = stat.size;
    member_.reset(zip_fopen_index(archive_.get(), 0, 0));
    if (!member_) throw IoError(file, std::string("is damaged: ") + zip_strerror(archive_.get()));
  }

  std::uint64_t size() const { return size_; }

  void read(void* out, std::size_t bytes) {
    const zip_int64_t got = zip_fread(member_.get(), out, bytes);
    if (got >= 0 && static_cast<std::size_t>(got) == bytes) return;
    throw IoError(file_,
                  got < 0 ? std::string("is damaged: ") + zip_file_strerror(member_.get()) : "is truncated");
  }

  /// The checksum is compared when the end has been seen.
  void expect_end() {
    char extra = 0;
    const zip_int64_t got = zip_fread(member_.get(), &extra, 1);
    if (got == 0) return;
    throw IoError(file_, got < 0 ? std::string("is damaged: ") + zip_file_strerror(member_.get())
                                 : "holds more than its shape says");
  }

 private:
  std::filesystem::path file_;
  std::unique_ptr<zip_t, CloseArchive> archive_;
  std::unique_ptr<zip_file_t, CloseMember> member_;
  std::uint64_t size_ = 0;
};

/// Text behind `'key':` in a header, up to the first character of `end`.
std::string_view value_of(std::string_view header, std::string_view key, std::string_view end) {
  const std::size_t at = header.find(key);
  if (at == std::string_view::npos) return {};
  std::string_view rest = header.substr(at + key.size());
  const std::size_t first = rest.find_first_not_of(": ");
  if (first == std::string_view::npos) return {};
  rest.remove_prefix(first);
  return rest.substr(0, rest.find_first_of(end));
}

std::vector<std::size_t> parse_shape(const std::filesystem::path& file, std::string_view text) {
  std::vector<std::size_t> shape;
  std::size_t elements = 1;
  while (true) {
    const std::size_t digit = text.find_first_of("0123456789");
    if (digit == std::string_view::npos) return shape;
    text.remove_prefix(digit);
    std::size_t size = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), size);
    if (error != std::errc() || __builtin_mul_overflow(elements, size, &elements)) {
      throw IoError(file, "has a shape beyond all bounds");
    }
    shape.push_back(size);
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  }
}

std::string read_header(const std::filesystem::path& file, Member& member) {
  unsigned char preamble[k_preamble];
  member.read(preamble, sizeof preamble);
  if (!std::equal(k_magic.begin(), k_magic.end(), preamble,
                  [](char a, unsigned char b) { return static_cast<unsigned char>(a) == b; })) {
    throw IoError(file, "holds no .npy array");
  }
  if (preamble[6] != 1) throw IoError(file, "has an .npy header of a version other than 1");
  std::string header(preamble[8] + 256U * preamble[9], ' ');
  member.read(header.data(), header.size());
  return header;
}

struct FreeSource {
  void operator()(zip_source_t* source) const { zip_source_free(source); }
};

/// An archive with one member, in memory: libzip would make temporary files of its own beside its output.
std::string zipped(const std::filesystem::path& file, const std::string& content) {
  const auto fail = [&](const char* reason) {
    throw IoError(file, std::string("cannot be written: ") + reason);
  };
  const std::unique_ptr<zip_source_t, FreeSource> bytes(zip_source_buffer_create(nullptr, 0, 0, nullptr));
  if (!bytes) fail("no memory");
  zip_source_keep(bytes.get());  // the archive's own reference, which it gives up when it is closed
  std::unique_ptr<zip_t, CloseArchive> archive(zip_open_from_source(bytes.get(), ZIP_TRUNCATE, nullptr));
  if (!archive) fail("no memory");
  zip_source_t* member = zip_source_buffer(archive.get(), content.data(), content.size(), 0);
  // A date of its own would make two equal arrays two different files.
  constexpr zip_uint16_t k_first_dos_date = (1 << 5) | 1;  // 1 January 1980
  if (zip_file_add(archive.get(), "arr_0.npy", member, ZIP_FL_ENC_UTF_8) < 0 ||
      zip_file_set_dostime(archive.get(), 0, 0, k_first_dos_date, 0) != 0 || zip_close(archive.get()) != 0) {
    fail(zip_strerror(archive.get()));
  }
  archive.release();  // closed
  zip_stat_t stat;
  if (zip_source_stat(bytes.get(), &stat) != 0 || zip_source_open(bytes.get()) != 0) fail("no memory");
  std::string text(stat.size, '\0');
  if (zip_source_read(bytes.get(), text.data(), text.size()) != static_cast<zip_int64_t>(text.size())) {
    fail("no memory");
  }
  return text;
}

}  // namespace

ByteArray read_npz(const std::filesystem::path& file) {
  Member member(file);
  const std::string header = read_header(file, member);
  const std::string_view type = value_of(header, "'descr'", ",}");
  if (type != "'|u1'" && type != "'|b1'") {
    throw IoError(file, "holds elements of type " + std::string(type) + ", not bytes or booleans");
  }
  if (value_of(header, "'fortran_order'", ",}") != "False") throw IoError(file, "is not in C order");
  ByteArray array;
  array.shape = parse_shape(file, value_of(header, "'shape'", ")"));
  const std::size_t count = element_count(array.shape);
  // Before memory is asked for: a damaged header may say anything.
  if (member.size() != k_preamble + header.size() + count)
    throw IoError(file, "is not as large as its shape says");
  array.values.resize(count);
  if (count != 0) member.read(array.values.data(), count);
  member.expect_end();
  return array;
}

void write_npz(const std::filesystem::path& file, std::span<const std::size_t> shape,
               std::span<const std::uint8_t> values, bool is_bool) {
  if (values.size() != element_count(shape)) {
    throw InvalidArgument("values (write_npz)", std::to_string(values.size()),
                          std::to_string(element_count(shape)));
  }
  std::string header =
      std::string("{'descr': '|") + (is_bool ? "b1" : "u1") + "', 'fortran_order': False, 'shape': (";
  for (const std::size_t size : shape) header += std::to_string(size) + ", ";
  header += "), }";
  header.resize(
      (k_preamble + header.size() + 1 + k_alignment - 1) / k_alignment * k_alignment - k_preamble - 1, ' ');
  header += '\n';
  std::string content(k_magic);
  content += {'\x01', '\x00', static_cast<char>(header.size() & 0xff), static_cast<char>(header.size() >> 8)};
  content += header;
  content.append(reinterpret_cast<const char*>(values.data()), values.size());

  write_whole_file(file, zipped(file, content));
}

}  // namespace dpr::learn
