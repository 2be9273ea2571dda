// The messages of the library's errors: one line each, in one form.
#include "dpr/error.hpp"

#include <CL/cl.h>
#include <CL/cl_ext.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

namespace dpr {
namespace {

struct ErrorName {
  int code;
  const char* name;
};

#define DPR_ERROR_NAME(code) \
  ErrorName { code, #code }

// Every error code of OpenCL 1.2 (the extended ones of the loader included).
constexpr std::array k_error_names{
    DPR_ERROR_NAME(CL_SUCCESS),
    DPR_ERROR_NAME(CL_DEVICE_NOT_FOUND),
    DPR_ERROR_NAME(CL_DEVICE_NOT_AVAILABLE),
    DPR_ERROR_NAME(CL_COMPILER_NOT_AVAILABLE),
    DPR_ERROR_NAME(CL_MEM_OBJECT_ALLOCATION_FAILURE),
    DPR_ERROR_NAME(CL_OUT_OF_RESOURCES),
    DPR_ERROR_NAME(CL_OUT_OF_HOST_MEMORY),
    DPR_ERROR_NAME(CL_PROFILING_INFO_NOT_AVAILABLE),
    DPR_ERROR_NAME(CL_MEM_COPY_OVERLAP),
    DPR_ERROR_NAME(CL_IMAGE_FORMAT_MISMATCH),
    DPR_ERROR_NAME(CL_IMAGE_FORMAT_NOT_SUPPORTED),
    DPR_ERROR_NAME(CL_BUILD_PROGRAM_FAILURE),
    DPR_ERROR_NAME(CL_MAP_FAILURE),
    DPR_ERROR_NAME(CL_MISALIGNED_SUB_BUFFER_OFFSET),
    DPR_ERROR_NAME(CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST),
    DPR_ERROR_NAME(CL_COMPILE_PROGRAM_FAILURE),
    DPR_ERROR_NAME(CL_LINKER_NOT_AVAILABLE),
    DPR_ERROR_NAME(CL_LINK_PROGRAM_FAILURE),
    DPR_ERROR_NAME(CL_DEVICE_PARTITION_FAILED),
    DPR_ERROR_NAME(CL_KERNEL_ARG_INFO_NOT_AVAILABLE),
    DPR_ERROR_NAME(CL_INVALID_VALUE),
    DPR_ERROR_NAME(CL_INVALID_DEVICE_TYPE),
    DPR_ERROR_NAME(CL_INVALID_PLATFORM),
    DPR_ERROR_NAME(CL_INVALID_DEVICE),
    DPR_ERROR_NAME(CL_INVALID_CONTEXT),
    DPR_ERROR_NAME(CL_INVALID_QUEUE_PROPERTIES),
    DPR_ERROR_NAME(CL_INVALID_COMMAND_QUEUE),
    DPR_ERROR_NAME(CL_INVALID_HOST_PTR),
    DPR_ERROR_NAME(CL_INVALID_MEM_OBJECT),
    DPR_ERROR_NAME(CL_INVALID_IMAGE_FORMAT_DESCRIPTOR),
    DPR_ERROR_NAME(CL_INVALID_IMAGE_SIZE),
    DPR_ERROR_NAME(CL_INVALID_SAMPLER),
    DPR_ERROR_NAME(CL_INVALID_BINARY),
    DPR_ERROR_NAME(CL_INVALID_BUILD_OPTIONS),
    DPR_ERROR_NAME(CL_INVALID_PROGRAM),
    DPR_ERROR_NAME(CL_INVALID_PROGRAM_EXECUTABLE),
    DPR_ERROR_NAME(CL_INVALID_KERNEL_NAME),
    DPR_ERROR_NAME(CL_INVALID_KERNEL_DEFINITION),
    DPR_ERROR_NAME(CL_INVALID_KERNEL),
    DPR_ERROR_NAME(CL_INVALID_ARG_INDEX),
    DPR_ERROR_NAME(CL_INVALID_ARG_VALUE),
    DPR_ERROR_NAME(CL_INVALID_ARG_SIZE),
    DPR_ERROR_NAME(CL_INVALID_KERNEL_ARGS),
    DPR_ERROR_NAME(CL_INVALID_WORK_DIMENSION),
    DPR_ERROR_NAME(CL_INVALID_WORK_GROUP_SIZE),
    DPR_ERROR_NAME(CL_INVALID_WORK_ITEM_SIZE),
    DPR_ERROR_NAME(CL_INVALID_GLOBAL_OFFSET),
    DPR_ERROR_NAME(CL_INVALID_EVENT_WAIT_LIST),
    DPR_ERROR_NAME(CL_INVALID_EVENT),
    DPR_ERROR_NAME(CL_INVALID_OPERATION),
    DPR_ERROR_NAME(CL_INVALID_GL_OBJECT),
    DPR_ERROR_NAME(CL_INVALID_BUFFER_SIZE),
    DPR_ERROR_NAME(CL_INVALID_MIP_LEVEL),
    DPR_ERROR_NAME(CL_INVALID_GLOBAL_WORK_SIZE),
    DPR_ERROR_NAME(CL_INVALID_PROPERTY),
    DPR_ERROR_NAME(CL_INVALID_IMAGE_DESCRIPTOR),
    DPR_ERROR_NAME(CL_INVALID_COMPILER_OPTIONS),
    DPR_ERROR_NAME(CL_INVALID_LINKER_OPTIONS),
    DPR_ERROR_NAME(CL_INVALID_DEVICE_PARTITION_COUNT),
    DPR_ERROR_NAME(CL_PLATFORM_NOT_FOUND_KHR),
};

#undef DPR_ERROR_NAME

/// Files and their names may hold control characters; a message is one line, and ends where it ends.
std::string printable(const std::string& text) {
  constexpr std::string_view k_digits = "0123456789abcdef";
  std::string line;
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (code >= 0x20 && code != 0x7f) {
      line += c;
    } else {
      line.append("\\x").append({k_digits[code / 16], k_digits[code % 16]});
    }
  }
  return line;
}

std::string place(const std::filesystem::path& file, std::optional<std::size_t> line) {
  const std::string name = file.empty() ? "\"\"" : file.string();
  return line ? name + ":" + std::to_string(*line) : name;
}

// The first line of a compiler's output that says something is wrong, or its first line at all.
std::string first_complaint(const std::string& log) {
  const std::size_t error = log.find("error");
  const std::size_t anchor = error == std::string::npos ? log.find_first_not_of(" \t\r\n") : error;
  if (anchor == std::string::npos) return "the compiler says nothing";
  const std::size_t before = log.rfind('\n', anchor);
  const std::size_t begin = before == std::string::npos ? 0 : before + 1;
  return log.substr(begin, std::min(log.find_first_of("\r\n", anchor), log.size()) - begin);
}

}  // namespace

InvalidArgument::InvalidArgument(std::string argument, std::string got, std::string expected)
    : Error(printable(argument + ": got " + got + ", expected " + expected)),
      argument_(std::move(argument)),
      got_(std::move(got)),
      expected_(std::move(expected)) {}

IoError::IoError(const std::filesystem::path& file, const std::string& reason,
                 std::optional<std::size_t> line)
    : Error(printable(place(file, line) + ": " + reason)), file_(file), line_(line) {}

DeviceError::DeviceError(int code, std::string where)
    : Error(printable(where + ": got " + cl_error_name(code) + " (" + std::to_string(code) +
                      "), expected CL_SUCCESS")),
      code_(code),
      where_(std::move(where)) {}

BuildError::BuildError(const std::string& program, std::string device, std::string options, std::string log)
    : Error(printable("program " + program + " (" + device + ", options \"" + options +
                      "\"): does not build: " + first_complaint(log))),
      device_(std::move(device)),
      options_(std::move(options)),
      log_(std::move(log)) {}

const char* cl_error_name(int code) noexcept {
  const auto* found = std::find_if(k_error_names.begin(), k_error_names.end(),
                                   [code](const ErrorName& entry) { return entry.code == code; });
  return found == k_error_names.end() ? "an OpenCL error without a name" : found->name;
}

}  // namespace dpr
