#include "apps/manual/command_page.h"
#include "tutti/core/text.h"

namespace tutti::manual {
namespace {

std::string FishQuoted(const std::string& text) {
  return "'" + Replaced(Replaced(text, "\\", "\\\\"), "'", "\\'") + "'";
}

std::string Line(const std::string& program, const std::string& condition, const Argument& argument) {
  std::string out = "complete -c " + program + " -n " + FishQuoted(condition);
  for (const std::string& name : argument.names)
    out += name.rfind("--", 0) == 0 ? " -l " + name.substr(2) : " -s " + name.substr(1);
  if (!argument.value.empty()) {
    if (!argument.choices.empty()) {
      out += " -x -a " + FishQuoted(JoinText(argument.choices, " "));
    } else if (argument.IsPath()) {
      out += argument.value == "DIR" ? " -x -a '(__fish_complete_directories)'" : " -r -F";
    } else {
      out += argument.value_optional ? "" : " -x";
    }
  }
  return out + " -d " + FishQuoted(argument.text) + "\n";
}

}  // namespace

std::string FishCompletion(const CommandPage& program) {
  std::string out = "# fish completion of " + program.name + ". Made from its list of options.\n";
  const std::string none = "__fish_use_subcommand";
  for (const CommandPage& command : program.commands) {
    out += "complete -c " + program.name + " -f -n " + FishQuoted(none) + " -a " + command.name + " -d " +
           FishQuoted(command.text) + "\n";
  }
  for (const Argument& argument : program.arguments) {
    if (!argument.positional) out += Line(program.name, none, argument);
  }
  for (const CommandPage& command : program.commands) {
    for (const Argument& argument : command.arguments) {
      if (!argument.positional)
        out += Line(program.name, "__fish_seen_subcommand_from " + command.name, argument);
    }
  }
  return out;
}

}  // namespace tutti::manual
