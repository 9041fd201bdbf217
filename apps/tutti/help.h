// What the parser says of its options: --help, as wide as the terminal, and --describe.
#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>
#include <string>

namespace tutti::cli {

/// Names to the left, texts to the right of them, each wrapped as a whole; below each other in a narrow
/// terminal.
class WrappedHelp : public CLI::Formatter {
 public:
  explicit WrappedHelp(std::size_t columns);

  std::string make_description(const CLI::App* app) const override;
  std::string make_footer(const CLI::App* app) const override;
  std::string make_usage(const CLI::App* app, std::string name) const override;
  std::string make_subcommand(const CLI::App* command) const override;
  std::string make_option(const CLI::Option* option, bool positional) const override;

 private:
  // A name and what it means.
  std::string Entry(const std::string& name, const std::string& text) const;

  std::size_t columns_;
};

/// Adds --describe, which no help shows: prints the parser's options and commands as JSON, and ends. The man
/// page and the completion of shells are made of it (apps/manual). The parser must live as long as it is
/// used.
void AddDescribeFlag(CLI::App& parser);

}  // namespace tutti::cli
