#include "apps/manual/command_page.h"
#include "tutti/core/text.h"

namespace tutti::manual {
namespace {

// What follows an option that takes a value: lines of a case.
std::string Values(const CommandPage& command) {
  std::vector<std::string> files, folders, nothing;  // patterns of case
  std::string out;
  for (const Argument& argument : command.arguments) {
    if (argument.positional || argument.value.empty()) continue;
    const std::string pattern = JoinText(argument.names, "|");
    if (!argument.choices.empty()) {
      out += "        " + pattern + ") words='" + JoinText(argument.choices, " ") + "' ;;\n";
    } else {
      (!argument.IsPath() ? nothing : argument.value == "DIR" ? folders : files).push_back(pattern);
    }
  }
  if (!files.empty()) out += "        " + JoinText(files, "|") + ") paths=-f ;;\n";
  if (!folders.empty()) out += "        " + JoinText(folders, "|") + ") paths=-d ;;\n";
  if (!nothing.empty()) out += "        " + JoinText(nothing, "|") + ") return ;;\n";
  return out;
}

std::string Options(const CommandPage& command) {
  std::vector<std::string> names;
  for (const Argument& argument : command.arguments) {
    if (!argument.positional) names.insert(names.end(), argument.names.begin(), argument.names.end());
  }
  return JoinText(names, " ");
}

}  // namespace

std::string BashCompletion(const CommandPage& program) {
  std::vector<std::string> commands;
  std::string cases;
  for (const CommandPage& command : program.commands) {
    commands.push_back(command.name);
    cases += "    " + command.name + ")\n      options='" + Options(command) + "'\n      case $before in\n" +
             Values(command) + "      esac\n      ;;\n";
  }
  std::string out = R"(# bash completion of @name@. Made from its list of options.
_@name@() {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} options= words= paths=
  COMPREPLY=()
  if ((COMP_CWORD == 1)); then
    mapfile -t COMPREPLY < <(compgen -W '@commands@ @options@' -- "$word")
    return
  fi
  case ${COMP_WORDS[1]} in
@cases@  esac
  if [[ -z $words && $word == -* ]]; then words=$options; fi
  if [[ -n $words ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word")
  else
    compopt -o filenames 2>/dev/null
    mapfile -t COMPREPLY < <(compgen ${paths:--f} -- "$word")
  fi
}
complete -F _@name@ @name@
)";
  out = Replaced(Replaced(out, "@commands@", JoinText(commands, " ")), "@options@", Options(program));
  return Replaced(Replaced(out, "@cases@", cases), "@name@", program.name);
}

}  // namespace tutti::manual
