#include "apps/tutti/map_prune.h"

#include <cstdint>
#include <cstdio>
#include <memory>

#include "core/replaced_file.h"
#include "core/section_file.h"
#include "tutti/core/error.h"
#include "tutti/slam/map_file.h"
#include "tutti/slam/slam_system.h"

namespace tutti::cli {
namespace {

double Share(double part, double whole) { return whole > 0 ? 100.0 * part / whole : 100.0; }

void PrintCounts(const char* what, int before, int after) {
  std::printf("  %-10s %8d -> %8d  (%.1f %%)\n", what, before, after, Share(after, before));
}

}  // namespace

void PruneMap(const std::filesystem::path& file, const std::filesystem::path& out) {
  MapInfo info = ReadMapInfo(file);
  const auto bytes = std::filesystem::file_size(file);
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
  PrintCounts("keyframes", info.keyframes, after.keyframes);
  PrintCounts("landmarks", info.landmarks, after.landmarks);
  const auto left = std::filesystem::file_size(written);
  std::printf("  %-10s %8.1f -> %8.1f MB (%.1f %%)\n", "size", static_cast<double>(bytes) / (1 << 20),
              static_cast<double>(left) / (1 << 20),
              Share(static_cast<double>(left), static_cast<double>(bytes)));
  std::printf("  written to %s\n", written.c_str());
}

}  // namespace tutti::cli
