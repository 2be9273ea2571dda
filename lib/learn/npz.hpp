// Arrays of bytes in NumPy's .npz files: a zip archive of .npy files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

namespace dpr::learn {

/// An array of uint8 or bool, row-major.
struct ByteArray {
  std::vector<std::size_t> shape;
  std::vector<std::uint8_t> values;  ///< the product of the shape many; bool is 0 or 1
};

/// The first array of an archive, as numpy.savez() and savez_compressed() write it: uint8 or bool, in C
/// order. Checksums are checked. Throws IoError where the file is missing, damaged, or holds something else.
ByteArray read_npz(const std::filesystem::path& file);

/// Writes one array under the key arr_0, compressed; the same bytes for the same array. `is_bool` marks 0 and
/// 1 as booleans. The file appears whole or not at all. Throws IoError.
void write_npz(const std::filesystem::path& file, std::span<const std::size_t> shape,
               std::span<const std::uint8_t> values, bool is_bool = false);

}  // namespace dpr::learn
