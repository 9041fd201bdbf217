// tutti_manual TUTTI FOLDER: asks the program TUTTI for its commands and options, and writes its man page and
// completion for bash into FOLDER. The build calls it; it is not installed.
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "apps/manual/command_page.h"
#include "core/replaced_file.h"

namespace {

namespace fs = std::filesystem;
using tutti::manual::CommandPage;

// What a command of the shell prints.
std::string Output(const std::string& command) {
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) throw std::runtime_error(command + ": can't be started");
  std::string out;
  std::array<char, 4096> buffer{};
  for (std::size_t n = 0; (n = fread(buffer.data(), 1, buffer.size(), pipe)) > 0;)
    out.append(buffer.data(), n);
  const int status = pclose(pipe);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) throw std::runtime_error(command + ": failed");
  return out;
}

void WriteManual(const std::string& tutti, const fs::path& folder) {
  const std::string call = "'" + tutti + "' ";
  CommandPage program = tutti::manual::ParsePage(Output(call + "--describe"));
  for (CommandPage& command : program.commands) {
    if (command.name == "help") continue;   // it has no options of its own
    const std::string text = command.text;  // in the list of commands
    command = tutti::manual::ParsePage(Output(call + command.name + " --describe"));
    command.text = text;
  }
  std::string version = Output(call + "--version");
  version.erase(version.find_last_not_of('\n') + 1);
  fs::create_directories(folder);
  tutti::internal::WriteFile(folder / "tutti.1", tutti::manual::ManPage(program, version));
  tutti::internal::WriteFile(folder / "tutti", tutti::manual::BashCompletion(program));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: tutti_manual TUTTI FOLDER\n");
    return 1;
  }
  try {
    WriteManual(argv[1], argv[2]);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "tutti_manual: %s\n", e.what());
    return 1;
  }
  return 0;
}
