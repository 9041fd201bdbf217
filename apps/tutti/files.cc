#include "apps/tutti/files.h"

#include <system_error>

#include "core/replaced_file.h"
#include "core/terminal.h"
#include "core/text_reader.h"
#include "tutti/core/error.h"

namespace tutti::cli {

void MakeFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw InputError(folder.string() + ": can't be made (" + error.message() + ")");
}

std::filesystem::path DefaultOutput(const std::string& recording, const std::string& suffix) {
  const std::filesystem::path whole = std::filesystem::absolute(recording).lexically_normal();
  const std::filesystem::path name = (whole.has_filename() ? whole : whole.parent_path()).filename();
  std::error_code ignored;
  const std::filesystem::path bare = std::filesystem::is_directory(whole, ignored) ? name : name.stem();
  return std::filesystem::path("tutti-out") / (bare.string() + suffix);
}

std::string JsonText(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

nlohmann::ordered_json ReadJson(const std::filesystem::path& file, const std::string& advice) {
  constexpr std::size_t kMostBytes = 200'000'000;
  return nlohmann::ordered_json::parse(internal::ReadText(file, advice, kMostBytes), nullptr, false);
}

void KeepInputs(const std::vector<std::string>& read, const std::vector<std::string>& written) {
  for (const std::string& out : written) {
    for (const std::string& in : read) {
      std::error_code none;  // one of them is not there
      if (std::filesystem::is_regular_file(out, none) && std::filesystem::equivalent(in, out, none))
        throw InputError(out + ": is read, and would be overwritten by the result; choose another name");
    }
  }
}

void CheckFiles(const std::vector<std::string>& read, const std::vector<std::string>& written) {
  KeepInputs(read, written);
  for (const std::string& file : written)
    if (!file.empty()) internal::CheckWritable(file, internal::Needs::kBytes);
}

void SayWarnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) internal::Say("warning: %s", warning.c_str());
}

}  // namespace tutti::cli
