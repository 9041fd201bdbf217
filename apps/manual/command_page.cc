#include "apps/manual/command_page.h"

#include <nlohmann/json.hpp>

#include "tutti/core/text.h"

namespace tutti::manual {
namespace {

// `text` with every `from` replaced.
std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

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

// man(7): the macros of manual pages. Text as it is: no escapes, and no line that looks like a macro.
std::string Plain(const std::string& text) {
  std::string out = Replaced(Replaced(text, "\\", "\\e"), "-", "\\-");
  if (!out.empty() && (out[0] == '.' || out[0] == '\'')) out.insert(0, "\\&");
  return Replaced(Replaced(out, "\n.", "\n\\&."), "\n'", "\n\\&'");
}

// "--rule NAME", bold and italic.
std::string Heading(const Argument& argument) {
  std::string out;
  if (argument.positional) {
    out = "\\fI" + Plain(argument.names.front()) + "\\fR";
  } else {
    out = "\\fB" + Plain(JoinText(argument.names)) + "\\fR";
    if (!argument.value.empty()) {
      const std::string value = "\\fI" + Plain(argument.value) + "\\fR";
      out += argument.value_optional ? " [" + value + "]" : " " + value;
    }
  }
  return out + (argument.several ? " ..." : "");
}

std::string Paragraph(const Argument& argument) {
  std::string out = ".TP\n" + Heading(argument) + "\n" + Plain(argument.text);
  if (!argument.choices.empty()) out += "\n.br\nOne of: " + Plain(JoinText(argument.choices)) + ".";
  if (!argument.default_value.empty()) out += "\n.br\nDefault: " + Plain(argument.default_value) + ".";
  if (argument.required && !argument.positional) out += "\n.br\nMust be given.";
  return out + "\n";
}

std::string Synopsis(const CommandPage& program, const CommandPage& command) {
  std::string out = "\\fB" + Plain(program.name + " " + command.name) + "\\fR [\\fIoptions\\fR]";
  for (const Argument& argument : command.arguments) {
    if (argument.positional) out += " " + Heading(argument);
  }
  return out + "\n";
}

std::string Section(const CommandPage& program, const CommandPage& command) {
  std::string out = ".SS " + Plain(program.name + " " + command.name) + "\n" + Plain(command.text) +
                    ".\n.PP\n" + Synopsis(program, command);
  for (const Argument& argument : command.arguments) out += Paragraph(argument);
  if (!command.footer.empty()) out += ".PP\n.nf\n" + Plain(command.footer) + "\n.fi\n";
  return out;
}

}  // namespace

CommandPage ParsePage(const std::string& json) {
  const nlohmann::json in = nlohmann::json::parse(json);
  CommandPage page;
  page.name = in.at("name");
  page.text = in.at("text");
  page.footer = in.at("footer");
  for (const nlohmann::json& option : in.at("options")) {
    Argument argument;
    argument.names = option.at("names").get<std::vector<std::string>>();
    argument.positional = option.at("positional");
    argument.value = option.at("value");
    argument.choices = option.at("choices").get<std::vector<std::string>>();
    argument.value_optional = option.at("value_optional");
    argument.several = option.at("several");
    argument.required = option.at("required");
    argument.default_value = option.at("default");
    argument.text = option.at("text");
    page.arguments.push_back(argument);
  }
  for (const nlohmann::json& command : in.at("commands")) {
    CommandPage known;
    known.name = command.at("name");
    known.text = command.at("text");
    page.commands.push_back(known);
  }
  return page;
}

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

std::string ManPage(const CommandPage& program, const std::string& version) {
  const std::string name = Plain(program.name);
  // "tutti: what it is"
  const std::string what = Plain(program.text.substr(program.text.find(": ") + 2));
  std::string out = ".TH \"" + name + "\" 1 \"\" \"" + Plain(version) + "\"\n.SH NAME\n" + name + " \\- " +
                    what + "\n.SH SYNOPSIS\n\\fB" + name +
                    "\\fR \\fIcommand\\fR [\\fIoptions\\fR]\n.SH COMMANDS\n";
  for (const CommandPage& command : program.commands)
    out += ".TP\n\\fB" + Plain(command.name) + "\\fR\n" + Plain(command.text) + "\n";
  out += ".SH OPTIONS\n";
  for (const Argument& argument : program.arguments) out += Paragraph(argument);
  out += ".SH OPTIONS OF THE COMMANDS\n";
  for (const CommandPage& command : program.commands) out += Section(program, command);
  return out +
         ".SH EXIT STATUS\n0: done. 1: the input or the command line can't be used; one line says why. 2: an "
         "error in the program. 130: ended by Ctrl\\-C.\n";
}

}  // namespace tutti::manual
