// tutti map: what is in a map file, and one without redundant keyframes.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/run/runner.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/files.h"
#include "core/replaced_file.h"
#include "core/section_file.h"
#include "core/terminal.h"
#include "tutti/core/error.h"
#include "tutti/slam/map_file.h"
#include "tutti/slam/slam_system.h"

namespace tutti::cli {
namespace {

struct MapArguments {
  std::string action, file, out;
  bool check = false, json = false;
};

double Megabytes(const std::filesystem::path& file) {
  return static_cast<double>(std::filesystem::file_size(file)) / (1 << 20);
}

// What the run was called with, where a run wrote the map.
nlohmann::json NoteOf(const MapInfo& info) {
  nlohmann::json note = nlohmann::json::parse(info.note, nullptr, false);
  return note.is_object() ? note : nlohmann::json::object();
}

void PrintSessions(const MapInfo& info) {
  std::printf("  sessions       %zu\n", info.sessions.size());
  for (std::size_t s = 0; s < info.sessions.size(); ++s) {
    const MapSession& session = info.sessions[s];
    std::printf("    %zu: keyframes %d to %d, %lld frames, numbers from %lld on  %s\n", s + 1,
                session.first_keyframe, session.last_keyframe, static_cast<long long>(session.frames),
                static_cast<long long>(session.frame_offset),
                internal::Printable(DatasetOfNote(session.note)).c_str());
  }
}

nlohmann::ordered_json SessionsJson(const MapInfo& info) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const MapSession& session : info.sessions) {
    json.push_back({{"dataset", DatasetOfNote(session.note)},
                    {"frames", session.frames},
                    {"last_frame", session.last_frame},
                    {"frame_offset", session.frame_offset},
                    {"keyframes", session.keyframes},
                    {"first_keyframe", session.first_keyframe},
                    {"last_keyframe", session.last_keyframe},
                    {"first_stamp_s", session.first_stamp_s},
                    {"last_stamp_s", session.last_stamp_s}});
  }
  return json;
}

void PrintText(const MapInfo& info, const std::string& file) {
  const PinholeCamera& c = info.rig.camera;
  const bool mono = info.rig.sensor == Sensor::kMono;
  const char* const unit = mono ? "(units of the first scale)" : "m";
  const Eigen::Vector3d size = info.most - info.least;
  std::printf("  %s: %.1f MB, written by tutti %s\n", internal::Printable(file).c_str(), Megabytes(file),
              internal::Printable(info.program).c_str());
  if (const std::string dataset = DatasetOfNote(info.note); !dataset.empty())
    std::printf("  of             %s\n", internal::Printable(dataset).c_str());
  std::printf("  sensor         %s, %dx%d px, fx %.2f, fy %.2f px\n", WordOf(info.rig.sensor), c.width,
              c.height, c.fx, c.fy);
  std::printf("  frames         %lld, the last one %lld\n", static_cast<long long>(info.frames),
              static_cast<long long>(info.last_frame));
  std::printf("  keyframes      %d, from %.2f s to %.2f s\n", info.keyframes, info.first_stamp_s,
              info.last_stamp_s);
  std::printf("  landmarks      %d\n", info.landmarks);
  std::printf("  loops          %d\n", info.loops);
  std::printf("  submaps        %d\n", info.pieces);
  std::printf("  extent         %.2f x %.2f x %.2f %s\n", size.x(), size.y(), size.z(), unit);
  PrintSessions(info);
}

void PrintJson(const MapInfo& info, const std::string& file) {
  nlohmann::ordered_json json;
  json["file"] = file;
  json["bytes"] = std::filesystem::file_size(file);
  json["version"] = info.program;
  json["run"] = NoteOf(info);
  json["sensor"] = WordOf(info.rig.sensor);
  json["frames"] = info.frames;
  json["last_frame"] = info.last_frame;
  json["keyframes"] = info.keyframes;
  json["first_stamp_s"] = info.first_stamp_s;
  json["last_stamp_s"] = info.last_stamp_s;
  json["landmarks"] = info.landmarks;
  json["loops"] = info.loops;
  json["submaps"] = info.pieces;
  json["sessions"] = SessionsJson(info);
  json["least"] = {info.least.x(), info.least.y(), info.least.z()};
  json["most"] = {info.most.x(), info.most.y(), info.most.z()};
  std::fputs(JsonText(json).c_str(), stdout);
}

void Print(const MapArguments& arguments) {
  const MapInfo info = ReadMapInfo(arguments.file);
  if (arguments.check) CheckMapFile(arguments.file);
  if (arguments.json) return PrintJson(info, arguments.file);
  PrintText(info, arguments.file);
  if (arguments.check) std::printf("  all checksums are right\n");
}

// Removes redundant keyframes (SlamSystem::Prune), writes the map to `out`, or back if that is empty, and
// prints what it was and is. Throws InputError for a file that is no finished map.
void Prune(const std::filesystem::path& file, const std::filesystem::path& out) {
  MapInfo info = ReadMapInfo(file);
  const double megabytes = Megabytes(file);
  const std::filesystem::path& written = out.empty() ? file : out;
  internal::CheckWritable(written, internal::Needs::kFile);
  const std::unique_ptr<SlamSystem> slam = LoadMap(file, info, nullptr, [&file](internal::SectionReader& in) {
    if (in.Peek() == internal::kEndOfSections) return;
    throw InputError(file.string() +
                     ": is a checkpoint; let its run finish (tutti run --resume), and prune the map that "
                     "it leaves");
  });
  slam->Prune();
  slam->Snapshot(info.note).Write(written);
  const MapInfo after = ReadMapInfo(written);
  const auto percent = [](double part, double whole) { return whole > 0 ? 100.0 * part / whole : 100.0; };
  const auto print = [&](const char* what, int from, int to) {
    std::printf("  %-10s %8d -> %8d  (%.1f %%)\n", what, from, to, percent(to, from));
  };
  print("keyframes", info.keyframes, after.keyframes);
  print("landmarks", info.landmarks, after.landmarks);
  const double left = Megabytes(written);
  std::printf("  %-10s %8.1f -> %8.1f MB (%.1f %%)\n", "size", megabytes, left, percent(left, megabytes));
  std::printf("  written to %s\n", written.c_str());
}

}  // namespace

void SetUpMap(CLI::App& command, int&) {
  const auto arguments = std::make_shared<MapArguments>();
  command
      .add_option("action", arguments->action,
                  "info: what is in the map; prune: remove keyframes whose landmarks others see")
      ->required()
      ->check(CLI::IsMember({"info", "prune"}));
  command.add_option("file", arguments->file, "a map (map.tutti) or a checkpoint of `tutti run`")->required();
  command.add_flag("--check", arguments->check, "read all of it, and verify every checksum");
  command.add_flag("--json", arguments->json, "for other programs");
  command.add_option("-o,--out", arguments->out,
                     "prune: the smaller map's file; without it, FILE is replaced");
  command.callback([arguments] {
    if (arguments->action == "prune") return Prune(arguments->file, arguments->out);
    Print(*arguments);
  });
}

}  // namespace tutti::cli
