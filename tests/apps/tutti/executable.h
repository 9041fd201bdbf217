// Runs the real `tutti` executable, as a user would.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace tutti::testing {

/// What the process printed (both streams) and how it ended.
struct ProcessResult {
  int status = -1;  ///< exit status; 128 + signal if it was killed
  std::string output;
};

/// Starts `program`, sends `signal` (0: none) as soon as the output holds `text`, and waits for its end.
ProcessResult RunProgramAndSignal(const std::filesystem::path& program,
                                  const std::vector<std::string>& arguments, const std::string& text,
                                  int signal);

/// Runs tutti with these arguments, and `more` at the end, and waits for it. Commands that read images run in
/// a copy of a process that has loaded their libraries (served_program.h).
ProcessResult RunTutti(std::vector<std::string> arguments, const std::vector<std::string>& more = {});

/// `tutti run` with these, and `more` at the end.
std::vector<std::string> RunArguments(const std::filesystem::path& config,
                                      const std::filesystem::path& dataset, const std::filesystem::path& out,
                                      const std::vector<std::string>& more = {});

/// The folder that `tutti run` with these writes, made once for all tests (MadeOnce): copy what a test
/// changes.
std::filesystem::path RunMadeOnce(const std::filesystem::path& config, const std::filesystem::path& dataset,
                                  const std::vector<std::string>& more = {});

/// RunProgramAndSignal for tutti.
ProcessResult RunTuttiAndSignal(const std::vector<std::string>& arguments, const std::string& text,
                                int signal);

/// Expects that the program was content, and returns what it printed.
std::string Done(const ProcessResult& run);
/// Expects that it refused what it was told: status 1, and these words.
void ExpectRefusal(const ProcessResult& run, const std::vector<std::string>& words);

/// A script of the shell, in which "$@" is tutti with these arguments.
ProcessResult RunInShell(const std::string& script, const std::vector<std::string>& arguments);

std::string ReadAll(const std::filesystem::path& file);
nlohmann::json ReadJson(const std::filesystem::path& file);
void WriteAll(const std::filesystem::path& file, const std::string& text);

}  // namespace tutti::testing
