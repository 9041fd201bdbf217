// A small generated recording for an example that is started without one.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace examples {

/// Runs `tutti` with these words. The program is the environment's TUTTI, else the one of the same build,
/// else the installed one.
inline void Tutti(const char* example, const std::string& words) {
  const auto of_build = std::filesystem::path(example).parent_path() / "../tutti/tutti";
  const char* given = std::getenv("TUTTI");
  const std::string program = given != nullptr                    ? given
                              : std::filesystem::exists(of_build) ? of_build.string()
                                                                  : "tutti";
  const std::string command = "'" + program + "' " + words;
  std::printf("%s\n", command.c_str());
  std::fflush(stdout);
  if (std::system(command.c_str()) != 0)  // NOLINT(cert-env33-c): an example, and its own words
    throw std::runtime_error(
        "give a recording (see the first lines of the example), or set TUTTI to the program");
}

/// The folder example_world/NAME, which `tutti generate` fills the first time; its config.yaml is inside.
inline std::string World(const char* example, const std::string& name, const std::string& options) {
  std::string folder = "example_world/" + name;
  if (!std::filesystem::exists(folder + "/config.yaml"))
    Tutti(example, "generate --force --out " + folder + " " + options);
  return folder;
}

/// A street around a block, 1.3 times, one camera or two: 180 images.
inline std::string Town(const char* example, const std::string& sensor) {
  return World(
      example, "town_" + sensor,
      "--sensor " + sensor + " --blocks-x 1 --block 26 --laps 1.3 --rate 4 --width 480 --height 240");
}

}  // namespace examples
