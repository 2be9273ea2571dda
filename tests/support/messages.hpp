// Message that an expression throws, so that a test can say what it must name.
#pragma once

#include <doctest/doctest.h>

#include <string>

#include "dpr/error.hpp"

namespace dpr::test {

/// The message of the exception that `action` throws; the test fails if it throws none, or one of another
/// kind.
template <typename Exception, typename Action>
std::string message_of(Action action) {
  try {
    action();
  } catch (const Exception& exception) {
    const std::string message = exception.what();
    CHECK_MESSAGE(message.find('\n') == std::string::npos, message);  // an error is one line
    return message;
  } catch (const std::exception& other) {
    FAIL("another exception: " << std::string(other.what()));
  }
  FAIL("no exception");
  return {};
}

inline bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace dpr::test

/// The expression throws that exception, and its message holds the part.
#define DPR_CHECK_MESSAGE_HAS(exception, expression, part)                             \
  do {                                                                                 \
    const std::string dpr_message =                                                    \
        dpr::test::message_of<exception>([&] { static_cast<void>(expression); });      \
    CHECK_MESSAGE(dpr::test::contains(dpr_message, part), "message: " << dpr_message); \
  } while (false)
