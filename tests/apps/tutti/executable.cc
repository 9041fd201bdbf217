#include "tests/apps/tutti/executable.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <set>
#include <sstream>
#include <stdexcept>

#include "tests/support/made_once.h"
#include "tests/support/served_program.h"

namespace tutti::testing {

namespace {

// The commands of tutti-images, whose libraries take long to load.
bool ReadsImages(const std::string& command) {
  static const std::set<std::string> commands = {"run",  "calibrate-check", "compare", "loops", "generate",
                                                 "map",  "localize",        "export",  "dense", "merge",
                                                 "close"};
  return commands.count(command) > 0;
}

// What is written into a pipe until its last writer has closed it. Sends `signal` (0: none) to `child` as
// soon as that holds `text`.
std::string Output(int pipe, pid_t child, const std::string& text, int signal) {
  std::string output;
  char buffer[4096];
  bool sent = signal == 0;
  for (ssize_t n = 0; (n = read(pipe, buffer, sizeof buffer)) > 0;) {
    output.append(buffer, static_cast<std::size_t>(n));
    if (!sent && output.find(text) != std::string::npos) {
      kill(child, signal);
      sent = true;
    }
  }
  close(pipe);
  return output;
}

// A copy of a process does not have the threads that libraries started when they were loaded; the leak
// checker says so of each.
std::string WithoutMissingThreads(const std::string& output) {
  std::string kept;
  std::istringstream lines(output);
  for (std::string line; std::getline(lines, line);) {
    if (line.find("was not suspended. False leaks are possible.") == std::string::npos) kept += line + '\n';
  }
  return kept.size() == output.size() + 1 ? output : kept;
}

int ExitStatus(int status) { return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status); }

}  // namespace

ProcessResult RunProgramAndSignal(const std::filesystem::path& program,
                                  const std::vector<std::string>& arguments, const std::string& text,
                                  int signal) {
  int pipe_ends[2];
  if (pipe(pipe_ends) != 0) throw std::runtime_error("pipe failed");
  std::vector<std::string> words = {program.string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    // Started by nohup, or by a shell in the background, the tests ignore it, and so would the program.
    if (signal != 0) std::signal(signal, SIG_DFL);
    dup2(pipe_ends[1], STDOUT_FILENO);
    dup2(pipe_ends[1], STDERR_FILENO);
    close(pipe_ends[0]);
    close(pipe_ends[1]);
    execv(argv[0], argv.data());
    _exit(127);
  }
  close(pipe_ends[1]);
  ProcessResult result;
  result.output = Output(pipe_ends[0], child, text, signal);
  int status = 0;
  waitpid(child, &status, 0);
  result.status = ExitStatus(status);
  return result;
}

ProcessResult RunTuttiAndSignal(const std::vector<std::string>& arguments, const std::string& text,
                                int signal) {
  return RunProgramAndSignal(TUTTI_EXECUTABLE, arguments, text, signal);
}

ProcessResult RunTutti(std::vector<std::string> arguments, const std::vector<std::string>& more) {
  arguments.insert(arguments.end(), more.begin(), more.end());
  if (arguments.empty() || !ReadsImages(arguments[0]) || !CanBeServed())
    return RunTuttiAndSignal(arguments, "", 0);
  int pipe_ends[2];
  if (pipe2(pipe_ends, O_CLOEXEC) != 0) throw std::runtime_error("pipe failed");
  arguments.insert(arguments.begin(), TUTTI_EXECUTABLE);
  const int served = BeginServed(TUTTI_IMAGES_EXECUTABLE, arguments, pipe_ends[1]);
  close(pipe_ends[1]);
  ProcessResult result;
  result.output = WithoutMissingThreads(Output(pipe_ends[0], 0, "", 0));
  result.status = ExitStatus(EndServed(served));
  return result;
}

std::vector<std::string> RunArguments(const std::filesystem::path& config,
                                      const std::filesystem::path& dataset, const std::filesystem::path& out,
                                      const std::vector<std::string>& more) {
  std::vector<std::string> arguments = {"run", "--config", config, "--dataset", dataset, "--out", out};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

std::filesystem::path RunMadeOnce(const std::filesystem::path& config, const std::filesystem::path& dataset,
                                  const std::vector<std::string>& more) {
  std::string words = ReadAll(config) + dataset.string();
  for (const std::string& word : more) words += " " + word;
  return MadeOnce("run-" + DigestOf(words), TUTTI_IMAGES_EXECUTABLE, [&](const std::filesystem::path& out) {
    const ProcessResult run = RunTutti(RunArguments(config, dataset, out, more));
    if (run.status != 0) throw std::runtime_error("tutti run: " + run.output);
  });
}

std::string Done(const ProcessResult& run) {
  EXPECT_EQ(run.status, 0) << run.output;
  return run.output;
}

void ExpectRefusal(const ProcessResult& run, const std::vector<std::string>& words) {
  EXPECT_EQ(run.status, 1) << run.output;
  for (const std::string& word : words) EXPECT_THAT(run.output, ::testing::HasSubstr(word));
}

ProcessResult RunInShell(const std::string& script, const std::vector<std::string>& arguments) {
  std::vector<std::string> words = {"-c", script, "sh", TUTTI_EXECUTABLE};
  words.insert(words.end(), arguments.begin(), arguments.end());
  return RunProgramAndSignal("/bin/sh", words, "", 0);
}

std::string ReadAll(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

nlohmann::json ReadJson(const std::filesystem::path& file) { return nlohmann::json::parse(ReadAll(file)); }

void WriteAll(const std::filesystem::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

}  // namespace tutti::testing
