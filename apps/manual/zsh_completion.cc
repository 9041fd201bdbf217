// Function of zsh's completion system: _arguments with a specification for each option (zshcompsys(1)).
#include "apps/manual/command_page.h"

namespace tutti::manual {
namespace {

// Inside of single quotes and of [explanation] or :message:.
std::string ZshQuoted(const std::string& text) {
  std::string out = Replaced(Replaced(text, "\\", "\\\\"), "'", "'\\''");
  for (const char* sign : {"[", "]", ":"}) out = Replaced(out, sign, std::string("\\") + sign);
  return out;
}

// ":message:action" of a value.
std::string Value(const Argument& argument) {
  std::string action = " ";
  if (argument.IsPath()) action = argument.value == "DIR" ? "_files -/" : "_files";
  if (!argument.choices.empty()) {
    action = "(";
    for (const std::string& choice : argument.choices)
      action += (action.size() == 1 ? "" : " ") + ZshQuoted(choice);
    action += ")";
  }
  return std::string(argument.value_optional ? "::" : ":") + ZshQuoted(argument.value) + ":" + action;
}

std::string Specifications(const CommandPage& command, const std::string& indent) {
  std::string out;
  for (const Argument& argument : command.arguments) {
    const std::string begin = " \\\n" + indent + "'" + (argument.several ? "*" : "");
    if (argument.positional) {
      out.append(begin).append(":").append(ZshQuoted(argument.names.front())).append(":_files'");
      continue;
    }
    const std::string end =
        "[" + ZshQuoted(argument.text) + "]" + (argument.value.empty() ? "" : Value(argument)) + "'";
    for (const std::string& name : argument.names) out.append(begin).append(name).append(end);
  }
  return out;
}

}  // namespace

std::string ZshCompletion(const CommandPage& program) {
  std::string commands;
  std::string cases;
  for (const CommandPage& command : program.commands) {
    commands += "    '" + ZshQuoted(command.name) + ":" + Replaced(command.text, "'", "'\\''") + "'\n";
    cases += "        " + command.name + ")\n          _arguments" + Specifications(command, "            ") +
             "\n          ;;\n";
  }
  std::string out = R"(#compdef @name@
# zsh completion of @name@. Made from its list of options.
_@name@() {
  local -a commands
  local curcontext=$curcontext state line
  commands=(
@commands@  )
  _arguments -C@options@ \
    '1:command:->command' \
    '*::argument:->argument'
  case $state in
    command)
      _describe command commands
      ;;
    argument)
      case $line[1] in
@cases@      esac
      ;;
  esac
}
_@name@ "$@"
)";
  out = Replaced(Replaced(out, "@commands@", commands), "@options@", Specifications(program, "    "));
  return Replaced(Replaced(out, "@cases@", cases), "@name@", program.name);
}

}  // namespace tutti::manual
