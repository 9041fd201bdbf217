#include "tests/apps/tutti/executable.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "tests/support/made_once.h"

namespace tutti::testing {

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
  char buffer[4096];
  bool sent = signal == 0;
  for (ssize_t n = 0; (n = read(pipe_ends[0], buffer, sizeof buffer)) > 0;) {
    result.output.append(buffer, static_cast<std::size_t>(n));
    if (!sent && result.output.find(text) != std::string::npos) {
      kill(child, signal);
      sent = true;
    }
  }
  close(pipe_ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  result.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return result;
}

ProcessResult RunTuttiAndSignal(const std::vector<std::string>& arguments, const std::string& text,
                                int signal) {
  return RunProgramAndSignal(TUTTI_EXECUTABLE, arguments, text, signal);
}

ProcessResult RunTutti(std::vector<std::string> arguments, const std::vector<std::string>& more) {
  arguments.insert(arguments.end(), more.begin(), more.end());
  return RunTuttiAndSignal(arguments, "", 0);
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
