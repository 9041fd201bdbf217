#include "tutti/slam/config.h"

#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <utility>

#include "apps/slam/config_table.h"
#include "core/example_configs.h"
#include "core/terminal.h"
#include "core/text_reader.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

[[noreturn]] void Fail(const std::string& file, const YAML::Mark& mark, const std::string& what) {
  throw InputError(file + ":" + std::to_string(mark.line + 1) + ": " + what);
}

// Where each key was set, so that a value that is found to be out of range later can be traced to its line.
struct KeyMarks {
  std::vector<std::pair<std::string, YAML::Mark>> keys;
  YAML::Mark section;
};

void ReadSection(const std::string& file, const std::string& section, const YAML::Node& content,
                 const ConfigTable& table, KeyMarks& marks);

// One line of a section; `seen`: keys before it.
void ReadItem(const std::string& file, const std::string& section,
              const std::pair<YAML::Node, YAML::Node>& item, const ConfigTable& table,
              std::set<std::string>& seen, KeyMarks& marks) {
  if (!item.first.IsScalar()) Fail(file, item.first.Mark(), "a key must be a word");
  const std::string name = item.first.Scalar();
  const YAML::Mark mark = item.first.Mark();
  if (!seen.insert(name).second) Fail(file, mark, "key '" + name + "' is given twice; remove one of the two");
  const std::string nested = section + "." + name;
  if (table.HasSection(nested)) {
    ReadSection(file, nested, item.second, table, marks);
    return;
  }
  const ConfigKey* key = table.Find(section, name);
  if (key == nullptr) {
    Fail(file, mark,
         "unknown key '" + name + "' in section '" + section + "'" + NearestHint(name, table.Names(section)));
  }
  const std::string wrong = key->read(item.second);
  if (!wrong.empty()) Fail(file, mark, section + "." + name + ": " + wrong);
  marks.keys.emplace_back(name, mark);
  // The same name may stand in two sections within each other: camera.fx and camera.right.fx.
  const std::size_t dot = section.find('.');
  if (dot != std::string::npos) marks.keys.emplace_back(section.substr(dot + 1) + "." + name, mark);
}

void ReadSection(const std::string& file, const std::string& section, const YAML::Node& content,
                 const ConfigTable& table, KeyMarks& marks) {
  if (content.IsNull()) return;
  if (!content.IsMap()) Fail(file, content.Mark(), "section '" + section + "' needs lines of 'key: value'");
  std::set<std::string> seen;
  // A preset changes many values: it comes first, wherever it stands, and the file's other keys on top of it.
  std::vector<std::pair<YAML::Node, YAML::Node>> items;
  for (const auto& item : content) {
    const bool preset = item.first.IsScalar() && item.first.Scalar() == "preset";
    items.emplace(preset ? items.begin() : items.end(), item.first, item.second);
  }
  for (const auto& item : items) ReadItem(file, section, item, table, seen, marks);
}

// Some messages name their section themselves, as they are said without a file, too.
std::string InSection(const std::string& section, const std::string& problem) {
  return problem.rfind(section + ": ", 0) == 0 ? problem : section + ": " + problem;
}

// Points to the line of the key that the message of Validate() speaks of, else to the section.
void Check(const std::string& file, const std::string& section, const KeyMarks& marks,
           const std::string& problem) {
  if (problem.empty()) return;
  YAML::Mark where = marks.section;
  std::size_t longest = 0;  // "threshold" must not win over "loop_threshold"
  for (const auto& [name, mark] : marks.keys) {
    if (name.size() > longest && problem.find(name) != std::string::npos) {
      longest = name.size();
      where = mark;
    }
  }
  Fail(file, where, InSection(section, problem));
}

// Sets one key from `key=value`, the key without `prefix`.
void Assign(const std::string& assignment, const std::string& prefix, const ConfigTable& table) {
  const std::size_t equals = assignment.find('=');
  const std::string form = prefix.empty() ? "section.key=value" : "key=value";
  if (equals == std::string::npos) throw InputError("'" + assignment + "': write it as " + form);
  const std::string given = assignment.substr(0, equals);
  const ConfigKey* key = table.Find(prefix + given);
  if (key == nullptr) throw InputError("'" + assignment + "': " + table.Unknown(prefix, given));
  std::string wrong;
  try {
    wrong = key->read(YAML::Load(assignment.substr(equals + 1)));
  } catch (const YAML::Exception& e) {
    wrong = "not valid YAML: " + e.msg;
  }
  if (!wrong.empty()) throw InputError("'" + assignment + "': " + wrong);
}

// Takes no notice of what a parser finds.
class NoNotice : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t, const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
  }
  void OnMapEnd() override {}
};

// The one document of a text. YAML::LoadAll finds endless ones where it does not understand the first mark of
// one, as in "," or "]".
YAML::Node LoadOne(const std::string& text, const std::string& name) {
  std::istringstream in(text);
  YAML::Parser parser(in);
  NoNotice none;
  if (parser.HandleNextDocument(none) && parser.HandleNextDocument(none)) {
    throw InputError(name +
                     ": holds more than one YAML document (separated by ---), or text that is none, and only "
                     "one document could be used");
  }
  return YAML::Load(text);
}

}  // namespace

RunConfig::RunConfig() {
  graph.init = GraphInit::kFile;  // the odometry is a good start
  // A loop's error before the optimisation is the drift since then: a redescending loss (DCS) would switch
  // the loop off. False loops are refused before (LoopGate) and after (SlamSystem) instead.
  graph.robust = RobustLoss::kHuber;
  graph.max_iterations = 100;
  graph.function_tolerance = 1e-6;
}

RunConfig ParseConfig(const std::string& text, const std::string& name) {
  RunConfig config;
  const ConfigTable table(config);
  YAML::Node root;
  try {
    root = LoadOne(text, name);
  } catch (const YAML::Exception& e) {
    Fail(name, e.mark, "not valid YAML: " + e.msg);
  }
  std::map<std::string, KeyMarks> marks;
  if (root.IsDefined() && !root.IsNull()) {
    if (!root.IsMap()) throw InputError(name + ":1: needs sections such as 'dataset:' with indented keys");
    for (const auto& item : root) {
      const std::string section = item.first.IsScalar() ? item.first.Scalar() : "";
      const std::vector<std::string> sections = table.TopSections();
      if (std::find(sections.begin(), sections.end(), section) == sections.end()) {
        Fail(name, item.first.Mark(), "unknown section '" + section + "'" + NearestHint(section, sections));
      }
      if (marks.count(section) != 0)
        Fail(name, item.first.Mark(), "section '" + section + "' is given twice");
      marks[section].section = item.first.Mark();
      ReadSection(name, section, item.second, table, marks[section]);
    }
  }
  DropUnsetCameras(config.dataset);
  for (const char* section : {"camera", "imu"}) {  // their keys stand in DatasetOptions, too
    const KeyMarks& of = marks[section];
    marks["dataset"].keys.insert(marks["dataset"].keys.end(), of.keys.begin(), of.keys.end());
  }
  if (const auto problem = FirstProblem(config))
    Check(name, problem->first, marks[problem->first], problem->second);
  return config;
}

RunConfig LoadConfig(const std::filesystem::path& file) {
  constexpr std::size_t kMostBytes = 10'000'000;
  std::error_code ignored;
  const bool bare = !file.has_parent_path() || file.parent_path() == "data/configs";
  if (bare && !std::filesystem::exists(file, ignored) &&
      (file.extension().empty() || file.extension() == ".yaml")) {
    if (const auto text = internal::ExampleConfig(file.stem().string()))
      return ParseConfig(*text, "tutti's " + file.stem().string() + ".yaml");
  }
  const std::string advice = "--config needs a YAML file, or the name of one that is part of tutti: " +
                             JoinText(internal::ExampleConfigNames());
  return ParseConfig(internal::ReadText(file, advice, kMostBytes), file.string());
}

void SetOptions(const std::vector<std::string>& assignments, RunConfig& config) {
  RunConfig changed = config;
  const ConfigTable table(changed);
  for (const std::string& assignment : assignments) Assign(assignment, "", table);
  DropUnsetCameras(changed.dataset);
  RunConfig checked = changed;
  // That of a video through a pipe gets its size, and is checked, when the first image is there.
  if (config.dataset.camera && config.dataset.camera->width == 0) checked.dataset.camera.reset();
  const auto problem = FirstProblem(checked);
  if (problem) throw InputError("--set: " + InSection(problem->first, problem->second));
  config = changed;
}

void SetLoopOptions(const std::vector<std::string>& assignments, LoopDetectorOptions& options) {
  RunConfig config;
  config.loops = options;
  const ConfigTable table(config);
  for (const std::string& assignment : assignments) Assign(assignment, "loops.", table);
  const std::string problem = config.loops.Validate();
  if (!problem.empty()) throw InputError("loops: " + problem);
  options = config.loops;
}

std::vector<ConfigEntry> DescribeConfig(const RunConfig& config) {
  RunConfig copy = config;
  const ConfigTable table(copy);
  std::vector<ConfigEntry> entries;
  for (const ConfigKey& key : table.keys()) {
    const bool of_a_camera = key.section == "camera" && key.name != "baseline_m" && key.name != "readout_s" &&
                             key.name != "depth_delay_s" && key.name != "T_camera_imu";
    if (of_a_camera && !config.dataset.camera) continue;
    if (key.section == "camera.right" && !config.dataset.right) continue;
    entries.push_back({key.section, key.name, key.show(), key.doc, key.advanced});
  }
  return entries;
}

namespace {

// A line of YAML and a comment beside it, in lines of at most so many columns; 0: in one line.
std::string WithComment(const std::string& line, const std::string& comment, std::size_t columns) {
  const std::size_t column = columns == 0 || columns >= 110 ? 44 : columns >= 60 ? 30 : 4;
  const std::size_t width = columns > column + 2 ? columns - column - 2 : 1;
  std::string out = line;
  std::size_t used = line.size();
  for (const std::string& part : internal::WrapText(comment, columns == 0 ? comment.size() : width)) {
    if (columns > 0 && used >= column) {
      out += "\n";
      used = 0;
    }
    out += std::string(used < column ? column - used : 1, ' ') + "# " + part;
    used = columns;
  }
  return out + "\n";
}

}  // namespace

std::string HelpConfig(bool advanced, std::size_t columns) {
  RunConfig defaults;
  defaults.dataset.camera = defaults.dataset.right = PinholeCamera();
  std::ostringstream out;
  const std::string head =
      advanced ? "All keys of the configuration with their defaults. A file needs only what it changes."
               : "What users set, with its defaults; --help-config --advanced shows all keys. A file needs "
                 "only what it changes.";
  for (const std::string& line :
       internal::WrapText(head, columns == 0 ? 108 : std::max<std::size_t>(columns, 22) - 2))
    out << "# " << line << "\n";
  std::string section;
  for (const ConfigEntry& entry : DescribeConfig(defaults)) {
    if (entry.advanced && !advanced) continue;
    const std::size_t dot = entry.section.find('.');
    const std::string indent(dot == std::string::npos ? 2 : 4, ' ');
    if (entry.section != section && dot == std::string::npos)
      out << (section.empty() ? "" : "\n") << entry.section << ":\n";
    if (entry.section != section && dot != std::string::npos)
      out << "  " << entry.section.substr(dot + 1) << ":\n";
    section = entry.section;
    out << WithComment(indent + entry.name + ": " + entry.value, entry.doc, columns);
  }
  return out.str();
}

}  // namespace tutti
