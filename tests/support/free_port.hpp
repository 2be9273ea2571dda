// A port of this machine that nobody listens at now.
#pragma once

#include <arpa/inet.h>
#include <doctest/doctest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>

namespace dpr::test {

inline std::uint16_t free_port() {
  const int descriptor = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  auto* const generic = reinterpret_cast<sockaddr*>(&address);
  socklen_t size = sizeof address;
  REQUIRE(bind(descriptor, generic, size) == 0);
  REQUIRE(getsockname(descriptor, generic, &size) == 0);
  close(descriptor);
  return ntohs(address.sin_port);
}

}  // namespace dpr::test
