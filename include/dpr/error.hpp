// The errors of the library: values a caller can act on. Everything is checked before anything is enqueued.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>

#include "dpr/export.h"

namespace dpr {

/// Base of every error the library throws; what() is one line, "WHAT (WHERE): got ..., expected ...".
class DPR_API Error : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// An argument, an option or the content of a file has a value that cannot be used.
class DPR_API InvalidArgument : public Error {
 public:
  /// @param argument what is wrong and where, e.g. "sigma (smoothing)"
  /// @param got      the value found
  /// @param expected the values that are accepted
  InvalidArgument(std::string argument, std::string got, std::string expected);

  const std::string& argument() const noexcept { return argument_; }
  const std::string& got() const noexcept { return got_; }
  const std::string& expected() const noexcept { return expected_; }

 private:
  std::string argument_, got_, expected_;
};

/// A file that cannot be read, parsed or written.
class DPR_API IoError : public Error {
 public:
  IoError(const std::filesystem::path& file, const std::string& reason, std::optional<std::size_t> line = {});

  const std::filesystem::path& file() const noexcept { return file_; }
  /// The line at fault, counted from 1, where it is known.
  std::optional<std::size_t> line() const noexcept { return line_; }

 private:
  std::filesystem::path file_;
  std::optional<std::size_t> line_;
};

/// An OpenCL call failed. `code` is the CL error code, `where` the API call or the kernel with its sizes.
class DPR_API DeviceError : public Error {
 public:
  DeviceError(int code, std::string where);

  int code() const noexcept { return code_; }
  const std::string& where() const noexcept { return where_; }

 private:
  int code_;
  std::string where_;
};

/// A kernel program did not compile. what() is one line; log() is the compiler's whole output.
class DPR_API BuildError : public Error {
 public:
  BuildError(const std::string& program, std::string device, std::string options, std::string log);

  const std::string& device() const noexcept { return device_; }
  const std::string& options() const noexcept { return options_; }
  const std::string& log() const noexcept { return log_; }

 private:
  std::string device_, options_, log_;
};

/// The name of an OpenCL error code, e.g. "CL_OUT_OF_RESOURCES".
DPR_API const char* cl_error_name(int code) noexcept;

}  // namespace dpr
