// Hash of data.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <type_traits>

namespace dpr {

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

}  // namespace dpr
