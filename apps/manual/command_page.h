// What `tutti --describe` and `tutti COMMAND --describe` say, and the texts that are made of it.
#pragma once

#include <string>
#include <vector>

namespace tutti::manual {

/// An option or a positional argument.
struct Argument {
  std::vector<std::string> names;  ///< "-h", "--help"; a positional one: its name
  bool positional = false;
  std::string value;                 ///< what it takes (TEXT, INT, DIR, ...); empty for a flag
  std::vector<std::string> choices;  ///< all values that it takes; empty if they can't be listed
  bool value_optional = false;
  bool several = false;  ///< several values, or several times
  bool required = false;
  std::string default_value;
  std::string text;

  /// A file or a folder may be its value.
  bool IsPath() const { return choices.empty() && (value == "TEXT" || value == "DIR"); }
};

/// A program or one of its commands.
struct CommandPage {
  std::string name;
  std::string text;
  std::string footer;  ///< what the help ends with: notes and examples
  std::vector<Argument> arguments;
  std::vector<CommandPage> commands;
};

/// Of a page's JSON; its commands have a name and a text, no arguments. Throws std::exception if it is
/// damaged.
CommandPage ParsePage(const std::string& json);

/// The man page of the program with all commands (section 1). `version`: as --version prints it.
std::string ManPage(const CommandPage& program, const std::string& version);
/// Completion of commands, options and fixed choices; else of files.
std::string BashCompletion(const CommandPage& program);

}  // namespace tutti::manual
