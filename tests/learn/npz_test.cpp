// Arrays in .npz files: what is written reads back, and damage is named.
#include "learn/npz.hpp"

#include <doctest/doctest.h>

#include <numeric>

#include "support/file_size_limit.hpp"
#include "support/messages.hpp"
#include "support/temp_dir.hpp"

namespace dpr::test::npz_test {
namespace {

using learn::ByteArray;
using learn::read_npz;
using learn::write_npz;

std::vector<std::uint8_t> numbers(std::size_t count) {
  std::vector<std::uint8_t> values(count);
  std::iota(values.begin(), values.end(), std::uint8_t{0});
  return values;
}

/// Little-endian, with zeros after the value's own bytes.
void put(std::string& bytes, std::uint32_t value, int count) {
  for (int i = 0; i < count; ++i, value >>= 8U) bytes += static_cast<char>(value & 0xff);
}

std::uint32_t crc32(const std::string& bytes) {
  std::uint32_t crc = 0xffffffff;
  for (const char c : bytes) {
    crc ^= static_cast<unsigned char>(c);
    for (int i = 0; i < 8; ++i) crc = crc >> 1U ^ ((crc & 1U) != 0 ? 0xedb88320U : 0U);
  }
  return ~crc;
}

/// A zip archive of one member that is stored as it is: what numpy.savez() writes.
std::string stored_archive(const std::string& name, const std::string& content) {
  std::string common;
  put(common, 20, 2);  // version, no flags, stored, no date
  put(common, 0, 8);
  put(common, crc32(content), 4);
  put(common, static_cast<std::uint32_t>(content.size()), 4);
  put(common, static_cast<std::uint32_t>(content.size()), 4);
  put(common, static_cast<std::uint32_t>(name.size()), 4);
  std::string zip = "PK\x03\x04" + common + name + content;
  const auto directory = static_cast<std::uint32_t>(zip.size());
  zip += "PK\x01\x02";
  put(zip, 20, 2);
  zip += common;
  put(zip, 0, 14);  // no comment, disk 0, no attributes, member at 0
  zip += name;
  const auto size = static_cast<std::uint32_t>(zip.size()) - directory;
  zip += "PK\x05\x06";
  put(zip, 0, 4);
  put(zip, 1, 2);
  put(zip, 1, 2);
  put(zip, size, 4);
  put(zip, directory, 4);
  put(zip, 0, 2);
  return zip;
}

std::string npy(const std::string& header, const std::string& data) {
  std::string bytes = "\x93NUMPY";
  put(bytes, 1, 2);
  put(bytes, static_cast<std::uint32_t>(header.size()), 2);
  return bytes + header + data;
}

std::string good_header() { return "{'descr': '|u1', 'fortran_order': False, 'shape': (2, 3), }\n"; }

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("npz: what is written reads back, and equal arrays make equal files") {
    const TempDir folder;
    const std::size_t shape[] = {3, 5, 7};
    const std::vector<std::uint8_t> values = numbers(105);
    write_npz(folder / "a.npz", shape, values);
    write_npz(folder / "b.npz", shape, values);
    const ByteArray array = read_npz(folder / "a.npz");
    CHECK(array.shape == std::vector<std::size_t>{3, 5, 7});
    CHECK(array.values == values);
    CHECK(folder.read("a.npz") == folder.read("b.npz"));
    CHECK(folder.entries() == 2);

    const std::size_t four[] = {4};
    write_npz(folder / "flags.npz", four, std::vector<std::uint8_t>{1, 0, 0, 1}, /*is_bool=*/true);
    CHECK(read_npz(folder / "flags.npz").values == std::vector<std::uint8_t>{1, 0, 0, 1});
    const std::size_t none[] = {0, 9};
    write_npz(folder / "none.npz", none, {});
    CHECK(read_npz(folder / "none.npz").shape == std::vector<std::size_t>{0, 9});
  }

  TEST_CASE("npz: an archive as numpy.savez() stores it") {
    const TempDir folder;
    folder.write("stored.npz", stored_archive("arr_0.npy", npy(good_header(), "abcdef")));
    const ByteArray array = read_npz(folder / "stored.npz");
    CHECK(array.shape == std::vector<std::size_t>{2, 3});
    CHECK(array.values == std::vector<std::uint8_t>{'a', 'b', 'c', 'd', 'e', 'f'});
  }
}

TEST_SUITE("robustness") {
  TEST_CASE("npz: every kind of damage is one clear error") {
    const TempDir folder;
    const auto fails_with = [&](const std::string& content, const std::string& part) {
      folder.write("bad.npz", content);
      DPR_CHECK_MESSAGE_HAS(IoError, read_npz(folder / "bad.npz"), part);
    };
    DPR_CHECK_MESSAGE_HAS(IoError, read_npz(folder / "missing.npz"), "missing.npz");
    fails_with("", "cannot be read as npz");
    fails_with("no archive at all", "cannot be read as npz");
    fails_with(stored_archive("arr_0.npy", "short"), "truncated");
    fails_with(stored_archive("arr_0.npy", "something else altogether"), "no .npy array");
    const auto with = [](const std::string& header) {
      return stored_archive("arr_0.npy", npy(header, "abcdef"));
    };
    fails_with(with("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }\n"), "'<f4'");
    fails_with(with("{'descr': '|u1', 'fortran_order': True, 'shape': (2, 3), }\n"), "C order");
    fails_with(with("{'descr': '|u1', 'fortran_order': False, 'shape': (2, 4), }\n"),
               "as large as its shape");
    fails_with(with("{'descr': '|u1', 'fortran_order': False, 'shape': (99999999999999999999,), }\n"),
               "bounds");
    fails_with(with("{'descr': '|u1', 'fortran_order': False, 'shape': (4294967296, 4294967296, 4), }\n"),
               "bounds");
    fails_with(with("{}\n"), "type");

    const std::size_t shape[] = {40, 100};
    write_npz(folder / "good.npz", shape, numbers(4000));
    const std::string good = folder.read("good.npz");
    for (std::size_t length = 0; length < good.size(); length += 23) {
      folder.write("cut.npz", good.substr(0, length));
      CHECK_THROWS_AS(read_npz(folder / "cut.npz"), IoError);
    }
    std::string flipped = good;  // a bit of the compressed data
    flipped[good.size() / 2] = static_cast<char>(flipped[good.size() / 2] ^ 4);
    fails_with(flipped, "damaged");
    const std::size_t wrong[] = {3};
    DPR_CHECK_MESSAGE_HAS(InvalidArgument, write_npz(folder / "x.npz", wrong, numbers(2)), "values");
    DPR_CHECK_MESSAGE_HAS(IoError, write_npz(folder / "no" / "x.npz", shape, numbers(4000)),
                          "does not exist");
    {
      const FileSizeLimit full_disk(100);
      DPR_CHECK_MESSAGE_HAS(IoError, write_npz(folder / "good.npz", shape, numbers(4000)), "File too large");
    }
    CHECK(folder.read("good.npz") == good);
    CHECK(folder.entries() == 3);
  }
}

}  // namespace dpr::test::npz_test
