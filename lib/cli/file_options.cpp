#include "cli/file_options.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <string_view>

#include "base/input_file.hpp"
#include "base/output_file.hpp"
#include "dpr/error.hpp"

namespace dpr::cli {
namespace {

bool is_written(const CLI::Option& option) {
  constexpr std::array<std::string_view, 5> k_written{"--output", "--save-scene", "--save-views", "--csv",
                                                      "--checkpoint"};
  return std::ranges::any_of(k_written,
                             [&](std::string_view name) { return option.check_name(std::string(name)); });
}

/// True of two names of a file that is there, or is to be.
bool are_one_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::error_code error;
  if (exists(a, error) && exists(b, error)) return is_regular_file(a, error) && equivalent(a, b, error);
  return weakly_canonical(absolute(a, error), error) == weakly_canonical(absolute(b, error), error);
}

void require_files_apart(const CLI::App& command) {
  for (const CLI::Option* written : command.get_options()) {
    if (!is_written(*written) || written->results().empty()) continue;
    const std::string file = written->results().front();
    for (const CLI::Option* other : command.get_options()) {
      if (other == written ||
          std::ranges::none_of(other->results(), [&](const std::string& f) { return are_one_file(file, f); }))
        continue;
      throw InvalidArgument(written->get_name() + " (command line)",
                            "\"" + file + "\", the file of " + other->get_name(), "another file");
    }
  }
}

}  // namespace

void refuse_shared_files(CLI::App& command) {
  command.parse_complete_callback([&command] { require_files_apart(command); });
  for (CLI::App* other : command.get_subcommands({})) refuse_shared_files(*other);
}

void require_outputs(const std::vector<std::filesystem::path>& files, const std::string& report) {
  for (auto file = files.begin(); file != files.end(); ++file) {
    require_writable(*file);
    const auto other =
        std::find_if(files.begin(), file, [&](const auto& f) { return are_one_file(f, *file); });
    if (other != file) {
      throw InvalidArgument("outputs (command line)",
                            "\"" + other->string() + "\" and \"" + file->string() + "\"",
                            "different files; OBJ has its materials and textures beside it");
    }
  }
  if (const auto input = report.empty() ? std::nullopt : guarded_input_in(report)) {
    throw InvalidArgument("--report (command line)",
                          "\"" + report + "\", where " + input->string() + " is read",
                          "a folder without inputs");
  }
}

}  // namespace dpr::cli
