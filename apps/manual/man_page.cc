// man(7): the macros of manual pages.
#include "apps/manual/command_page.h"
#include "tutti/core/text.h"

namespace tutti::manual {
namespace {

// Text as it is: no escapes, and no line that looks like a macro.
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
         "error "
         "in the program. 130: ended by Ctrl\\-C.\n";
}

}  // namespace tutti::manual
