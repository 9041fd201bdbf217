#include "apps/run/run_health.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string_view>

#include "core/terminal.h"
#include "tutti/frontend/dataset.h"

namespace tutti {
namespace {

std::string Shown(const RunSign& sign) {
  const std::string_view unit = sign.kind->unit;
  char text[40];
  if (unit == "share") {
    std::snprintf(text, sizeof text, "%.1f %%", 100 * sign.value);
  } else {
    std::snprintf(text, sizeof text, unit == "1" ? "%.0f" : "%.2f", sign.value);
  }
  return text;
}

// Most frames have no pose: what one image shows is not in the next.
bool ShowsNoFilm(const RunResult& result, const RunHealth& health) {
  std::error_code ignored;
  const bool no_photos = result.rig.sensor != Sensor::kMono || result.dataset.empty() ||
                         IsCamera(result.dataset) ||
                         std::filesystem::is_regular_file(result.dataset, ignored);  // a video, a bag
  if (health.word != HealthWord::kFailed || no_photos || result.given_odometry) return false;
  return std::any_of(health.signs.begin(), health.signs.end(), [](const RunSign& sign) {
    return sign.kind->name == std::string_view("frames_posed") && sign.kind->IsFailed(sign.value);
  });
}

std::string Sentence(const RunSign& sign) {
  std::string text = sign.kind->says;
  const std::size_t place = text.find("%s");
  if (place != std::string::npos) text.replace(place, 2, Shown(sign));
  return text + "; " + sign.kind->advice;
}

}  // namespace

const char* ToString(HealthWord word) {
  switch (word) {
    case HealthWord::kGood:
      return "good";
    case HealthWord::kDoubtful:
      return "doubtful";
    case HealthWord::kFailed:
      return "failed";
  }
  return "";
}

std::optional<RunHealth> HealthOf(const RunResult& result) {
  if (result.appearance_only) return std::nullopt;
  RunHealth health;
  health.signs = SignsOf(result);
  for (const RunSign& sign : health.signs) {
    HealthWord word = HealthWord::kGood;
    if (sign.kind->IsDoubtful(sign.value)) word = HealthWord::kDoubtful;
    if (sign.kind->IsFailed(sign.value)) word = HealthWord::kFailed;
    if (word == HealthWord::kGood) continue;
    health.reasons.push_back(Sentence(sign));
    health.word = std::max(health.word, word);
  }
  if (result.Void() && health.word != HealthWord::kFailed) {  // nothing to take a share of
    health.word = HealthWord::kFailed;
    health.reasons.push_back("no frame could be read; frames.bad_frames in summary.json says why");
  }
  if (ShowsNoFilm(result, health))
    health.reasons.push_back("are these separate photos, and no film? `tutti loops " + result.dataset +
                             "` finds those that show the same place, without poses");
  return health;
}

std::string HealthText(const RunResult& result) {
  const std::optional<RunHealth> health = HealthOf(result);
  if (!health) return "";
  const std::string word = ToString(health->word);
  if (health->word == HealthWord::kGood)
    return "\n  " + word + ": nothing that the run shows speaks against its result\n";
  std::string text = "\n  " + word + ":\n";
  for (const std::string& reason : health->reasons) text += "    * " + internal::Printable(reason) + "\n";
  return text;
}

}  // namespace tutti
