// Where the configurations for public data sets are, for messages that name one as an example. Not installed.
#pragma once

#include <filesystem>
#include <string>

#pragma GCC visibility push(default)  // used across libraries
namespace tutti::internal {

/// Their folder: share/tutti/configs of the installation that the running program belongs to, else
/// data/configs of the source tree.
std::string ExampleConfigs();
/// The same for a program in `folder`: in bin, libexec/tutti or lib/MACHINE/tutti of an installation, or
/// elsewhere.
std::string ExampleConfigs(const std::filesystem::path& folder);

/// One of them by its name ("euroc_mono.yaml"), to be read: of the installation, of the working folder, or of
/// the source tree that the running program was built in.
std::filesystem::path ExampleConfig(const std::string& name);

}  // namespace tutti::internal
#pragma GCC visibility pop
