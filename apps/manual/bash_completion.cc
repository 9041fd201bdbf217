#include "apps/manual/command_page.h"

namespace tutti::manual {
namespace {

void Append(const std::string& word, const char* between, std::string& list) {
  list += (list.empty() ? "" : between) + word;
}

// What follows an option that takes a value: lines of a case.
std::string Values(const CommandPage& command) {
  std::string files, folders, nothing, out;  // patterns of case
  for (const Argument& argument : command.arguments) {
    if (argument.positional || argument.value.empty()) continue;
    std::string words;
    for (const std::string& choice : argument.choices) Append(choice, " ", words);
    std::string pattern;
    for (const std::string& name : argument.names) Append(name, "|", pattern);
    if (!words.empty()) {
      out.append("        ").append(pattern).append(") words='").append(words).append("' ;;\n");
    } else {
      Append(pattern, "|", argument.IsPath() ? (argument.value == "DIR" ? folders : files) : nothing);
    }
  }
  if (!files.empty()) out += "        " + files + ") paths=-f ;;\n";
  if (!folders.empty()) out += "        " + folders + ") paths=-d ;;\n";
  if (!nothing.empty()) out += "        " + nothing + ") return ;;\n";
  return out;
}

std::string Options(const CommandPage& command) {
  std::string out;
  for (const Argument& argument : command.arguments) {
    if (argument.positional) continue;
    for (const std::string& name : argument.names) Append(name, " ", out);
  }
  return out;
}

}  // namespace

std::string BashCompletion(const CommandPage& program) {
  std::string commands;
  std::string cases;
  for (const CommandPage& command : program.commands) {
    Append(command.name, " ", commands);
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
  out = Replaced(Replaced(out, "@commands@", commands), "@options@", Options(program));
  return Replaced(Replaced(out, "@cases@", cases), "@name@", program.name);
}

}  // namespace tutti::manual
