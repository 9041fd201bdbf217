// How each type of value is read, strictly, and shown; and the keys, as the option structs describe them.
#include "apps/slam/config_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <optional>
#include <type_traits>
#include <utility>

#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

std::string Text(const YAML::Node& node) { return node.IsScalar() ? node.Scalar() : std::string(); }

std::string Wrong(const YAML::Node& node, const std::string& wanted) {
  if (!node.IsScalar()) return "needs " + wanted;
  return "'" + node.Scalar() + "' is not " + wanted;
}

// The shortest text that reads back to the same number, with a power of ten only where zeros would be
// counted.
std::string ShowDouble(double value) {
  const bool plain = std::abs(value) >= 1e-4 && std::abs(value) < 1e6;
  char text[40];
  for (int digits = 1; digits <= 17; ++digits) {
    std::snprintf(text, sizeof text, "%.*g", digits, value);
    if (ParseDouble(text) == value && !(plain && std::strchr(text, 'e') != nullptr)) break;
  }
  return text;
}

// Read: sets the field; empty, or what is wrong with the value.
std::string Read(const YAML::Node& node, bool& field) {
  const std::string text = Text(node);
  if (text != "true" && text != "false") return Wrong(node, "true or false");
  field = text == "true";
  return "";
}

std::string Read(const YAML::Node& node, int& field) {
  const auto value = ParseInteger(Text(node));
  if (!value || *value < -2147483647LL || *value > 2147483647LL) return Wrong(node, "a whole number");
  field = static_cast<int>(*value);
  return "";
}

std::string Read(const YAML::Node& node, std::uint64_t& field) {
  const auto value = ParseInteger(Text(node));
  if (!value || *value < 0) return Wrong(node, "a whole number that is not negative");
  field = static_cast<std::uint64_t>(*value);
  return "";
}

std::string Read(const YAML::Node& node, double& field) {
  const auto value = ParseDouble(Text(node));
  if (!value || !std::isfinite(*value)) return Wrong(node, "a finite number");
  field = *value;
  return "";
}

std::string Read(const YAML::Node& node, std::string& field) {
  if (!node.IsScalar()) return "needs a text";
  field = node.Scalar();
  return "";
}

std::string Read(const YAML::Node& node, std::vector<std::string>& field) {
  if (!node.IsSequence()) return "needs a list, as in [a, b]";
  std::vector<std::string> values;
  for (const YAML::Node& item : node) {
    if (!item.IsScalar()) return "needs a list of words";
    values.push_back(item.Scalar());
  }
  field = std::move(values);
  return "";
}

// A matrix may be given row by row, or as a list of its rows.
std::string Read(const YAML::Node& node, TransformRows& field) {
  const char* const wanted = "needs 16 numbers, or 4 lists of 4";
  if (!node.IsSequence()) return wanted;
  std::vector<YAML::Node> numbers;
  for (const YAML::Node& item : node) {
    if (!item.IsSequence()) {
      numbers.push_back(item);
      continue;
    }
    if (item.size() != 4) return wanted;
    for (const YAML::Node& number : item) numbers.push_back(number);
  }
  TransformRows values{};
  if (numbers.size() != values.size()) return wanted;
  for (std::size_t i = 0; i < values.size(); ++i) {
    std::string wrong = Read(numbers[i], values[i]);
    if (!wrong.empty()) return wrong;
  }
  field = values;
  return "";
}

template <std::size_t N>
std::string Read(const YAML::Node& node, std::array<double, N>& field) {
  // The distortion of most cameras has fewer than five numbers.
  const bool fits = node.IsSequence() && (N == 5 ? node.size() <= N : node.size() == N);
  if (!fits) return "needs a list of " + std::string(N == 5 ? "up to " : "") + std::to_string(N) + " numbers";
  std::array<double, N> values{};
  for (std::size_t i = 0; i < node.size(); ++i) {
    std::string wrong = Read(node[i], values[i]);
    if (!wrong.empty()) return wrong;
  }
  field = values;
  return "";
}

template <class Enum>
std::vector<std::string> ValidWords() {
  std::vector<std::string> words;
  for (const auto& [word, value] : WordsOf(Enum())) words.emplace_back(word);
  return words;
}

template <class Enum, class = std::enable_if_t<std::is_enum_v<Enum>>>
std::string Read(const YAML::Node& node, Enum& field) {
  for (const auto& [word, value] : WordsOf(field)) {
    if (Text(node) != word) continue;
    field = value;
    return "";
  }
  return Wrong(node, "one of " + JoinText(ValidWords<Enum>()));
}

// Show: the value as YAML.
std::string Show(bool value) { return value ? "true" : "false"; }
std::string Show(int value) { return std::to_string(value); }
std::string Show(std::uint64_t value) { return std::to_string(value); }
std::string Show(double value) { return ShowDouble(value); }
std::string Show(const std::string& value) { return "\"" + value + "\""; }
std::string Show(const std::vector<std::string>& value) { return "[" + JoinText(value) + "]"; }

template <std::size_t N>
std::string Show(const std::array<double, N>& values) {
  std::vector<std::string> texts(N);
  std::transform(values.begin(), values.end(), texts.begin(), ShowDouble);
  return "[" + JoinText(texts) + "]";
}

template <class Enum, class = std::enable_if_t<std::is_enum_v<Enum>>>
std::string Show(Enum value) {
  return WordOf(value);
}

// The sentence, with unit and range or words: "frame rate [1/s; at least 0]".
template <class Field>
std::string DocOf(const OptionText& text) {
  std::string range = text.Range();
  if constexpr (std::is_enum_v<Field>) range = JoinText(ValidWords<Field>());
  const std::string unit = text.unit;
  if (range.empty() && unit.empty()) return text.sentence;
  return std::string(text.sentence) + " [" + unit + (range.empty() || unit.empty() ? "" : "; ") + range + "]";
}

}  // namespace

ConfigTable::ConfigTable(RunConfig& config) {
  for (std::optional<PinholeCamera>* camera : {&config.dataset.camera, &config.dataset.right}) {
    if (!*camera) *camera = PinholeCamera();
  }
  AddOptions("dataset", config.dataset);
  AddOptions("odometry", config.odometry);
  AddOptions("loops", config.loops);
  AddRule(config.loops);
  AddOptions("graph", config.graph);
  AddOptions("run", config.run);
}

template <class Options>
void ConfigTable::AddOptions(const std::string& section, Options& options) {
  ForEachOption(options, [&](const OptionText& text, auto& field) {
    using Field = std::decay_t<decltype(field)>;
    if constexpr (std::is_same_v<Field, std::optional<PinholeCamera>>) {
      AddOptions(text.section, *field);
      if (text.basic) return;
      for (ConfigKey& key : keys_) key.advanced = key.advanced || key.section == text.section;
    } else if constexpr (kHasOptions<Field>) {
      AddOptions(section + "." + text.name, field);
    } else if (text.in_files) {
      Add(*text.section == '\0' ? section : text.section, text, field);
    }
  });
}

template <class Field>
void ConfigTable::Add(const std::string& section, const OptionText& text, Field& field) {
  // After the last one of its section, which another struct may have begun.
  const auto last = std::find_if(keys_.rbegin(), keys_.rend(),
                                 [&](const ConfigKey& key) { return key.section == section; });
  keys_.insert(
      last == keys_.rend() ? keys_.end() : last.base(),
      {section, text.name, DocOf<Field>(text), [&field](const YAML::Node& node) { return Read(node, field); },
       [&field] { return Show(field); }, !text.basic});
}

void ConfigTable::AddRule(LoopDetectorOptions& options) {
  // A word that `take` understands or refuses with an InputError.
  const auto word = [&options](void (*take)(const std::string&, LoopDetectorOptions&)) {
    return [&options, take](const YAML::Node& node) -> std::string {
      try {
        take(Text(node), options);
      } catch (const InputError& e) {
        return e.what();
      }
      return "";
    };
  };
  const auto rule =
      std::find_if(keys_.begin(), keys_.end(), [](const ConfigKey& key) { return key.name == "rule"; });
  rule->read = word(&SetRule);
  rule->show = [&options] { return RuleName(options); };
  const std::string doc =
      "published parameters that the other keys change [" + JoinText(KnownPresets()) + "]";
  keys_.insert(rule + 1, {"loops", "preset", doc, word(&ApplyPreset), [] { return "default"; }, false});
}

const ConfigKey* ConfigTable::Find(const std::string& section, const std::string& name) const {
  for (const ConfigKey& key : keys_) {
    if (key.section == section && key.name == name) return &key;
  }
  return nullptr;
}

const ConfigKey* ConfigTable::Find(const std::string& path) const {
  const std::size_t dot = path.rfind('.');
  return dot == std::string::npos ? nullptr : Find(path.substr(0, dot), path.substr(dot + 1));
}

std::string ConfigTable::Unknown(const std::string& prefix, const std::string& given) const {
  std::vector<std::string> valid;
  std::string elsewhere;  // a key of this name, where the section was left out
  for (const ConfigKey& known : keys_) {
    const std::string name = known.section + "." + known.name;
    if (name.rfind(prefix, 0) != 0) continue;
    valid.push_back(name.substr(prefix.size()));
    if (elsewhere.empty() && known.name == given) elsewhere = "; did you mean '" + valid.back() + "'?";
  }
  return "unknown key '" + given + "'" + (elsewhere.empty() ? NearestHint(given, valid) : elsewhere);
}

bool ConfigTable::HasSection(const std::string& section) const {
  return std::any_of(keys_.begin(), keys_.end(),
                     [&](const ConfigKey& key) { return key.section == section; });
}

std::vector<std::string> ConfigTable::Sections() const {
  std::vector<std::string> out;
  for (const ConfigKey& key : keys_) {
    if (out.empty() || out.back() != key.section) out.push_back(key.section);
  }
  return out;
}

std::vector<std::string> ConfigTable::TopSections() const {
  std::vector<std::string> out;
  for (const std::string& section : Sections()) {
    if (section.find('.') == std::string::npos) out.push_back(section);
  }
  return out;
}

std::vector<std::string> ConfigTable::Names(const std::string& section) const {
  std::vector<std::string> out;
  for (const ConfigKey& key : keys_) {
    if (key.section == section) out.push_back(key.name);
  }
  return out;
}

// Only the keys that a data set without calibration of its own needs beside its images: baseline, depth
// scale.
void DropUnsetCameras(DatasetOptions& options) {
  for (std::optional<PinholeCamera>* camera : {&options.camera, &options.right}) {
    if ((*camera)->fx == 0 && (*camera)->fy == 0) camera->reset();
  }
}

std::optional<std::pair<std::string, std::string>> FirstProblem(const RunConfig& config) {
  const std::pair<std::string, std::string> problems[] = {
      {"camera", config.dataset.camera ? config.dataset.camera->Validate() : ""},
      {"dataset", config.dataset.Validate()},
      {"odometry", config.odometry.Validate()},
      {"loops", config.loops.Validate()},
      {"graph", config.graph.Validate()},
      {"run", config.run.Validate()}};
  for (const auto& problem : problems) {
    if (!problem.second.empty()) return problem;
  }
  return std::nullopt;
}

std::string NearestHint(const std::string& word, const std::vector<std::string>& valid) {
  const std::string nearest = NearestWord(word, valid);
  return nearest.empty() ? "" : "; did you mean '" + nearest + "'?";
}

}  // namespace tutti
