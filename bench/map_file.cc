// What a map file takes: bytes by part, time to save and to load.
//   build/release/bench/map_file MAP
// MAP is what `tutti run` or SlamSystem::Save wrote. It is loaded and saved again (to MAP.again, which is
// removed) five times; the file is in the page cache by then, and a save waits until the disk has it. Prints
// JSON: keyframes, frames, bytes, per keyframe kB of the file by part, and milliseconds (medians, and all
// five) of the clock and of the processor (all threads; other programs' load changes it little).
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "apps/slam/map_parts.h"
#include "core/section_file.h"
#include "core/sections.h"
#include "core/stopwatch.h"
#include "loopclosure/detector/detector_file.h"
#include "tutti/core/error.h"
#include "tutti/slam/map_file.h"
#include "tutti/slam/slam_system.h"

namespace tutti {
namespace {

std::string PartOf(std::uint32_t tag) {
  if (tag == internal::kViewSection) return "views";
  if (tag == internal::kMemberSection) return "vocabularies";
  if (tag < 100) return "detector's rest";
  if (tag == Tag(Section::kKeyframe)) return "keyframes";
  if (tag == Tag(Section::kImage)) return "images";
  if (tag == Tag(Section::kLandmarks)) return "landmarks";
  return "rest";
}

// Bytes of a file, and of the contents that it holds, by part.
std::map<std::string, std::pair<std::uint64_t, std::uint64_t>> Parts(const std::filesystem::path& file) {
  constexpr std::streamoff kFileHeader = 16;
  std::map<std::string, std::pair<std::uint64_t, std::uint64_t>> parts;
  std::ifstream in(file, std::ios::binary);
  in.seekg(kFileHeader);
  internal::SectionHeader header;
  while (in.read(reinterpret_cast<char*>(&header), sizeof header)) {
    auto& [stored, content] = parts[PartOf(header.tag)];
    stored += sizeof header + header.stored;
    content += header.size;
    in.seekg(static_cast<std::streamoff>(header.stored), std::ios::cur);
  }
  return parts;
}

double ProcessorMilliseconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void MeasureMap(const std::filesystem::path& file) {
  constexpr int kTimes = 5;
  CheckMapFile(file);
  const MapInfo info = ReadMapInfo(file);
  const std::filesystem::path again = file.string() + ".again";
  std::vector<double> load_ms, save_ms, load_cpu_ms, save_cpu_ms;
  for (int i = 0; i < kTimes; ++i) {
    const internal::Stopwatch loading;
    double cpu = ProcessorMilliseconds();
    const std::unique_ptr<SlamSystem> slam = SlamSystem::Load(file, info);
    load_ms.push_back(loading.Milliseconds() / info.keyframes);
    load_cpu_ms.push_back((ProcessorMilliseconds() - cpu) / info.keyframes);
    const internal::Stopwatch saving;
    cpu = ProcessorMilliseconds();
    slam->Save(again);
    save_ms.push_back(saving.Milliseconds() / info.keyframes);
    save_cpu_ms.push_back((ProcessorMilliseconds() - cpu) / info.keyframes);
  }
  nlohmann::ordered_json out = {{"keyframes", info.keyframes},
                                {"frames", info.frames},
                                {"landmarks", info.landmarks},
                                {"bytes", std::filesystem::file_size(again)}};
  out["kb"] = static_cast<double>(std::filesystem::file_size(again)) / 1000 / info.keyframes;
  for (const auto& [part, bytes] : Parts(again)) {
    out["parts"][part] = {{"kb", static_cast<double>(bytes.first) / 1000 / info.keyframes},
                          {"content_kb", static_cast<double>(bytes.second) / 1000 / info.keyframes}};
  }
  out["save_ms"] = Median(save_ms);
  out["load_ms"] = Median(load_ms);
  out["save_cpu_ms"] = Median(save_cpu_ms);
  out["load_cpu_ms"] = Median(load_cpu_ms);
  out["all_save_ms"] = save_ms;
  out["all_load_ms"] = load_ms;
  std::filesystem::remove(again);
  std::printf("%s\n", out.dump(1).c_str());
}

}  // namespace
}  // namespace tutti

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: map_file MAP\n");
    return 2;
  }
  try {
    tutti::MeasureMap(argv[1]);
  } catch (const tutti::InputError& error) {
    std::fprintf(stderr, "map_file: %s\n", error.what());
    return 1;
  }
  return 0;
}
