#include "apps/run/run_note.h"

#include <nlohmann/json.hpp>

#include "apps/run/outputs.h"
#include "tutti/core/error.h"
#include "tutti/frontend/dataset.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

// As somebody in another folder has to write it.
std::string Absolute(const fs::path& path) {
  if (IsCamera(path.string()) || path.string() == "none") return path.string();
  return fs::absolute(path).lexically_normal().string();
}

}  // namespace

std::string NoteOf(const RunRequest& request) {
  nlohmann::ordered_json note;
  note["command"] = "run";
  note["dataset"] = Absolute(request.dataset);
  note["config"] = request.config.string();
  if (request.ground_truth) note["ground_truth"] = Absolute(*request.ground_truth);
  if (request.map) note["map"] = Absolute(*request.map);
  if (request.save_map) note["save_map"] = request.save_map->string();
  if (request.checkpoint_s) note["checkpoint_s"] = *request.checkpoint_s;
  note["keep"] = request.keep;
  return note.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

RunRequest RequestOf(const std::string& note, const fs::path& file, std::string* elsewhere) {
  const nlohmann::json json = nlohmann::json::parse(note, nullptr, false);
  if (!json.is_object() || !json.contains("dataset"))
    throw InputError(file.string() + ": is no checkpoint of tutti run");
  RunRequest request;
  try {
    request.dataset = json.at("dataset").get<std::string>();
    request.config = json.at("config").get<std::string>();
    if (json.contains("ground_truth")) request.ground_truth = json["ground_truth"].get<std::string>();
    if (json.contains("map")) request.map = json["map"].get<std::string>();
    if (json.contains("save_map")) {
      const std::string map = json["save_map"].get<std::string>();
      if (elsewhere != nullptr && map != kMap) *elsewhere = map;
      request.save_map = kMap;
    }
    if (json.contains("checkpoint_s")) request.checkpoint_s = json["checkpoint_s"].get<double>();
    request.keep = json.value("keep", false);
  } catch (const nlohmann::json::exception& error) {
    throw InputError(file.string() + ": is no checkpoint of tutti run (" + error.what() + ")");
  }
  return request;
}

std::string DatasetOfNote(const std::string& note) {
  const nlohmann::json json = nlohmann::json::parse(note, nullptr, false);
  const bool named = json.is_object() && json.contains("dataset") && json["dataset"].is_string();
  return named ? json["dataset"].get<std::string>() : std::string();
}

}  // namespace tutti
