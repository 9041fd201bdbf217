// tutti merge: two maps with common places become one.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/tutti/commands.h"
#include "apps/tutti/recording_options.h"
#include "core/replaced_file.h"
#include "core/terminal.h"
#include "tutti/core/error.h"
#include "tutti/slam/map_file.h"
#include "tutti/slam/slam_system.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

struct MergeArguments {
  std::string first, second, out;
  int threads = 2;
};

std::unique_ptr<SlamSystem> OpenMap(const std::string& file, int threads) {
  MapInfo info = ReadMapInfo(file);
  info.config.run.threads = threads;
  return LoadMap(file, info);
}

// Of what the merged map was made; the data set is that of the last session, as in the map of a run.
std::string MergedNote(const MergeArguments& arguments, const MapSession& last) {
  nlohmann::json note = nlohmann::json::parse(last.note, nullptr, false);
  if (!note.is_object()) note = nlohmann::json::object();
  note["command"] = "merge";
  note["merged"] = {fs::absolute(arguments.first).lexically_normal().string(),
                    fs::absolute(arguments.second).lexically_normal().string()};
  return note.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

// One file, by whatever names, or a copy.
bool AreTheSame(const fs::path& a, const fs::path& b) {
  std::error_code ignored;
  if (!fs::is_regular_file(a, ignored) || !fs::is_regular_file(b, ignored)) return false;
  if (fs::equivalent(a, b, ignored)) return true;
  if (fs::file_size(a, ignored) != fs::file_size(b, ignored)) return false;
  std::ifstream in_a(a, std::ios::binary), in_b(b, std::ios::binary);
  using Bytes = std::istreambuf_iterator<char>;
  return in_a && in_b && std::equal(Bytes(in_a), Bytes(), Bytes(in_b), Bytes());
}

int Merge(const MergeArguments& arguments) {
  std::error_code ignored;
  if (AreTheSame(arguments.first, arguments.second))
    throw InputError(arguments.first + " and " + arguments.second +
                     " are the same map; give the maps of two recordings");
  for (const std::string& map : {arguments.first, arguments.second}) {
    if (fs::equivalent(map, arguments.out, ignored))
      throw InputError(arguments.out + ": is one of the maps that are merged; give another file with --out");
  }
  internal::CheckWritable(arguments.out, internal::Needs::kFile);
  const std::unique_ptr<SlamSystem> slam = OpenMap(arguments.first, arguments.threads),
                                    other = OpenMap(arguments.second, arguments.threads);
  const std::size_t known = slam->loops().size() + other->loops().size();
  bool joined = false;
  std::string reason;
  try {
    joined = Merge(slam.get(), other.get(), &reason);
  } catch (const InputError& error) {
    throw InputError(arguments.first + " and " + arguments.second + " can't be merged: " + error.what());
  }
  const std::vector<Loop>& loops = slam->loops();
  const auto begin = loops.begin() + static_cast<std::ptrdiff_t>(known);
  const auto accepted = std::count_if(begin, loops.end(), [](const Loop& l) { return l.accepted(); });
  if (!joined) {
    internal::Say("%s shows no place of %s that can be relied on: %s (%td were proposed); nothing is written",
                  arguments.second.c_str(), arguments.first.c_str(), reason.c_str(), loops.end() - begin);
    return 1;
  }
  slam->Snapshot(MergedNote(arguments, slam->Sessions().back())).Write(arguments.out);
  std::printf("  %s: %zu sessions, %zu keyframes; %td loops between the two maps, of %td proposed\n",
              arguments.out.c_str(), slam->Sessions().size(), slam->odometry()->map().KeyframeIds().size(),
              static_cast<std::ptrdiff_t>(accepted), loops.end() - begin);
  return 0;
}

}  // namespace

void SetUpMerge(CLI::App& command, int& exit_code) {
  const auto arguments = std::make_shared<MergeArguments>();
  command.add_option("FIRST", arguments->first, "map.tutti of a run, whose frame of reference stays")
      ->required();
  command.add_option("SECOND", arguments->second, "the map that joins it")->required();
  command.add_option("-o,--out", arguments->out, "file for the merged map")->required();
  AddThreads(command, arguments->threads);
  command.footer(
      "Without a place that both maps show, nothing is written and the exit status is 1.\n"
      "Example: tutti merge monday/map.tutti tuesday/map.tutti -o both.tutti");
  command.callback([arguments, &exit_code] { exit_code = Merge(*arguments); });
}

}  // namespace tutti::cli
