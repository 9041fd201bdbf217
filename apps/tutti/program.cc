#include <sys/types.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <exception>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <sstream>
#include <streambuf>
#include <string>
#include <system_error>
#include <vector>

#if defined(__GLIBC__) && defined(__GLIBCXX__)
#define TUTTI_STDERR_CAN_BE_SET  // elsewhere stderr may not be assigned to
#include <ext/stdio_sync_filebuf.h>
#endif

#include "apps/tutti/commands.h"
#include "apps/tutti/help.h"
#include "apps/tutti/options.h"
#include "core/terminal.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"
#include "tutti/slam/version.h"

// OpenMP's, which comes with CHOLMOD; null without it.
extern "C" __attribute__((weak)) void omp_set_max_active_levels(int levels);

namespace tutti::cli {
namespace {

// CHOLMOD would start up to four threads, whatever --threads says, and keep them: a process that has some
// can't be copied (RunApart).
void StartNoThreadsOfOpenMp() {
  if (omp_set_max_active_levels != nullptr) omp_set_max_active_levels(0);
}

struct Command {
  const char* name;
  const char* sentence;
};

// All commands of tutti, in the order of the help.
constexpr Command kCommands[] = {
    {"run", "visual SLAM on a data set: trajectories, loops, summary"},
    {"close", "loops and a corrected trajectory for the odometry of another program"},
    {"localize", "where the frames of a data set are in the map of an earlier run"},
    {"merge", "two maps with common places become one"},
    {"map", "what is in a map file: keyframes, landmarks, loops, size, extent"},
    {"export", "a saved map for other programs: PLY, COLMAP, nerfstudio, g2o, TUM"},
    {"dense", "a coloured mesh, a cloud, or a grid to navigate in, from depth or stereo images"},
    {"calibrate-check",
     "can the calibration be right? Measures field of view, principal point, rows and order of stereo pairs, "
     "depth unit; exit status 1 if something can't be"},
    {"evaluate", "Errors of trajectories against a reference (ATE, RPE, KITTI, drift)"},
    {"convert", "Trajectories among TUM, KITTI, EuRoC and g2o"},
    {"plot", "Trajectories and their errors as pictures (SVG, PNG, PDF)"},
    {"compare", "What does the ensemble buy? SLAM with each way to find loops"},
    {"collect", "The summaries of many runs in one table"},
    {"loops", "loop closure alone on a folder of images, measured against a ground truth"},
    {"compare-loops",
     "paired t-test between rules over the tables of several image sets (recall at 100 % precision)"},
    {"optimize", "Optimise a pose graph (g2o file; 2D, 3D or with scale)"},
    {"generate",
     "Render the synthetic world (images and exact ground truth), or change real images; the same for the "
     "same options"},
    {"demo", "a short synthetic town: SLAM with and without the ensemble, and a plot"},
    {"help", "this text; help COMMAND: that of a command"},
};

// `tutti help run` is `tutti run --help`.
std::vector<char*> WithoutHelpCommand(int argc, char** argv) {
  static char option[] = "--help";
  std::vector<char*> words(argv, argv + argc);
  if (argc > 1 && std::string(argv[1]) == "help") {
    words.erase(words.begin() + 1);
    words.push_back(option);
  }
  words.push_back(nullptr);
  return words;
}

std::string UnknownCommand(const std::string& word, const std::vector<std::string>& known) {
  return "there is no command '" + word + "'; the nearest is '" + NearestWord(word, known) +
         "', and `tutti --help` lists all";
}

// CLI11's message names what it does not know; this one what may have been meant.
std::string UnknownOption(const CLI::App& command, const std::vector<std::string>& words) {
  std::vector<std::string> known;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_group().empty()) continue;
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
    for (const std::string& name : option->get_snames()) known.push_back("-" + name);
  }
  const std::string call = (command.get_parent() == nullptr ? "" : "tutti ") + command.get_name();
  for (const std::string& word : words) {
    const std::string name = word.substr(0, word.find('='));
    if (name.size() < 2 || name[0] != '-') continue;
    return "there is no option '" + name + "' of " + call + "; the nearest is '" + NearestWord(name, known) +
           "', and `" + call + " --help` lists all";
  }
  return {};
}

// What ran out, where the system had no more, and what to lower; empty if `error` is of another kind.
std::string WhatRanOut(const std::exception& error) {
  int code = 0;
  const auto* system = dynamic_cast<const std::system_error*>(&error);
  if (system != nullptr && (system->code().category() == std::system_category() ||
                            system->code().category() == std::generic_category()))
    code = system->code().value();
  const std::string text = error.what();  // of OpenCV's exception, which this program does not link
  if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr ||
      text.find("Insufficient memory") != std::string::npos ||
      text.find("Failed to allocate") != std::string::npos)
    code = ENOMEM;
  switch (code) {
    case ENOMEM:
      return "there is not enough memory; give fewer --threads, smaller images or fewer frames, or raise the "
             "limit (ulimit -v)";
    case EAGAIN:
      return "the system starts no more threads; give fewer --threads, or raise the limits (ulimit -u, "
             "ulimit -v)";
    case EMFILE:
    case ENFILE:
      return "no more files can be open at a time; give fewer --threads, or raise the limit (ulimit -n)";
    case ENOSPC:
    case EDQUOT:
      return "the disk is full; free some space, or give a folder on another disk";
    default:
      return {};
  }
}

// Prints what the library says: of --help, too.
int Exit(const CLI::App& app, const CLI::ParseError& error) {
  std::ostringstream text;
  const int status = app.exit(error, std::cout, text);
  std::fputs(internal::Printable(text.str(), internal::Breaks::kAll).c_str(), internal::StandardError());
  return status == 0 ? 0 : 1;
}

int Fail(const std::string& text) {
  internal::Say("%s", text.c_str());
  return 1;
}

constexpr std::size_t kMostAlike = 5, kMostKinds = 100, kMostLine = 1000;

std::string WithoutNumbers(const std::string& line) {
  std::string out;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (std::isdigit(static_cast<unsigned char>(line[i])) == 0) {
      out += line[i];
      continue;
    }
    while (i + 1 < line.size() && (std::isxdigit(static_cast<unsigned char>(line[i + 1])) != 0 ||
                                   line[i + 1] == 'x' || line[i + 1] == '.'))
      ++i;
    out += '#';
  }
  return out;
}

// What libraries print on stderr: five lines of a kind, and how many more there were.
// While it lives, stderr and std::cerr are its own, so that readers of images and videos, which print a line
// for each damaged one, don't fill the screen. Lines that differ in their numbers alone are of one kind.
// tutti's own messages go to internal::StandardError().
class ForeignLines {
 public:
  // `quiet`: nothing of it is printed.
  explicit ForeignLines(bool quiet);
  ~ForeignLines();
  ForeignLines(const ForeignLines&) = delete;
  ForeignLines& operator=(const ForeignLines&) = delete;

 private:
  struct Kind {
    std::string first;
    std::size_t count = 0;
  };
  void Take(const char* text, std::size_t size);
  void EndLine();

  bool quiet_;
  std::FILE* before_ = nullptr;  // stderr
  std::FILE* stream_ = nullptr;  // in its stead; null where the C library has none of its kind
  std::unique_ptr<std::streambuf> buffer_;
  std::streambuf* cerr_ = nullptr;  // std::cerr's own
  std::mutex mutex_;
  std::string line_;                   // that has not ended; guarded by mutex_, as all below
  std::map<std::string, Kind> kinds_;  // by their text without numbers
};

ForeignLines::ForeignLines(bool quiet) : quiet_(quiet) {
  internal::StandardError();  // what it was before
#ifdef TUTTI_STDERR_CAN_BE_SET
  cookie_io_functions_t functions = {};
  functions.write = [](void* self, const char* text, std::size_t size) {
    static_cast<ForeignLines*>(self)->Take(text, size);
    return static_cast<ssize_t>(size);
  };
  stream_ = fopencookie(this, "w", functions);
  if (stream_ == nullptr) return;
  std::setvbuf(stream_, nullptr, _IONBF, 0);
  before_ = stderr;
  stderr = stream_;
  buffer_ = std::make_unique<__gnu_cxx::stdio_sync_filebuf<char>>(stream_);
  cerr_ = std::cerr.rdbuf(buffer_.get());
#endif
}

ForeignLines::~ForeignLines() {
  if (stream_ == nullptr) return;
  std::cerr.rdbuf(cerr_);
#ifdef TUTTI_STDERR_CAN_BE_SET
  stderr = before_;
#endif
  std::fclose(stream_);
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!line_.empty()) EndLine();
  for (const auto& [kind, lines] : kinds_) {
    if (lines.count > kMostAlike && !quiet_)
      internal::Say("%zu more lines of a library like '%s'", lines.count - kMostAlike, lines.first.c_str());
  }
}

void ForeignLines::Take(const char* text, std::size_t size) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (std::size_t i = 0; i < size; ++i) {
    if (text[i] == '\n' || line_.size() >= kMostLine) EndLine();
    if (text[i] != '\n') line_ += text[i];
  }
}

void ForeignLines::EndLine() {
  std::string kind = WithoutNumbers(line_);
  if (kinds_.size() >= kMostKinds && kinds_.count(kind) == 0) kind = "...";
  Kind& lines = kinds_[kind];
  if (lines.count == 0) lines.first = line_;
  if (++lines.count <= kMostAlike && !quiet_)
    std::fprintf(internal::StandardError(), "%s\n", internal::Printable(line_).c_str());
  line_.clear();
}

}  // namespace

int RunProgram(int argc, char** argv, const std::map<std::string, SetUp*>& own, int (*other)(char** argv)) {
  StartNoThreadsOfOpenMp();
  CLI::App app{"tutti: visual SLAM with an ensemble of Bayesian loop-closure filters", "tutti"};
  app.formatter(std::make_shared<WrappedHelp>(internal::TerminalColumns(stdout)));
  app.require_subcommand(1);
  app.set_version_flag("--version", std::string("tutti ") + kVersion);
  AddDescribeFlag(app);
  int exit_code = 0;
  std::vector<char*> words = WithoutHelpCommand(argc, argv);
  std::vector<std::string> known;
  for (const Command& entry : kCommands) {
    const auto add = own.find(entry.name);
    if (add == own.end() && other == nullptr) continue;
    known.emplace_back(entry.name);
    CLI::App* command = app.add_subcommand(entry.name, entry.sentence);
    if (add != own.end()) {
      add->second(*command, exit_code);
      RefuseAbsurdNumbers(*command);
      AddDescribeFlag(*command);
      continue;
    }
    command->set_help_flag();  // the other program answers --help, too
    command->prefix_command();
    command->callback([&exit_code, &words, other] { exit_code = other(words.data()); });
  }
  const ForeignLines foreign(std::any_of(words.begin(), words.end() - 1,
                                         [](const char* word) { return std::string(word) == "--quiet"; }));
  try {
    if (words[1] != nullptr && words[1][0] != '-' && std::count(known.begin(), known.end(), words[1]) == 0)
      throw InputError(UnknownCommand(words[1], known));
    if (words[1] != nullptr && words[1][0] == '-' && app.get_option_no_throw(words[1]) == nullptr)
      throw InputError(UnknownOption(app, {words[1]}));
    app.parse(static_cast<int>(words.size()) - 1, words.data());
  } catch (const CLI::ExtrasError& e) {
    const CLI::App& command = *app.get_subcommands().front();
    const std::string unknown = UnknownOption(command, command.remaining(true));
    return unknown.empty() ? Exit(app, e) : Fail(unknown);
  } catch (const CLI::ParseError& e) {
    return Exit(app, e);  // --help comes this way, too
  } catch (const InputError& e) {
    return Fail(e.what());
  } catch (const std::exception& e) {
    const std::string exhausted = WhatRanOut(e);
    if (!exhausted.empty()) return Fail(exhausted);
    internal::Say("internal error: %s; please report it with the command line", e.what());
    return 2;
  }
  return exit_code;
}

}  // namespace tutti::cli
