// The table that binds the keys of the YAML file to the fields of the option structs.
#pragma once

#include <yaml-cpp/yaml.h>

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tutti/core/options.h"
#include "tutti/slam/config.h"

namespace tutti {

/// One key: how to read it into its field and how to print the field.
struct ConfigKey {
  std::string section, name, doc;                      ///< a section within another: "loops.extraction"
  std::function<std::string(const YAML::Node&)> read;  ///< empty, or what is wrong with the value
  std::function<std::string()> show;                   ///< the present value as YAML
  bool advanced = true;                                ///< few users ever set it
};

/// Keys of all sections, bound to one RunConfig that must outlive the table. Cameras are put in where it has
/// none, to bind to.
class ConfigTable {
 public:
  explicit ConfigTable(RunConfig& config);

  const std::vector<ConfigKey>& keys() const { return keys_; }
  /// The key, or nullptr.
  const ConfigKey* Find(const std::string& section, const std::string& name) const;
  /// The same of a whole path: "loops.extraction.features".
  const ConfigKey* Find(const std::string& path) const;
  /// "unknown key 'GIVEN'; did you mean 'NEAREST'?", among the keys whose paths begin with `prefix`, without
  /// it.
  std::string Unknown(const std::string& prefix, const std::string& given) const;
  bool HasSection(const std::string& section) const;
  std::vector<std::string> Sections() const;
  std::vector<std::string> TopSections() const;  ///< without those within another
  std::vector<std::string> Names(const std::string& section) const;

 private:
  /// A key for each option, and a section within `section` for each struct of options.
  template <class Options>
  void AddOptions(const std::string& section, Options& options);
  template <class Field>
  void Add(const std::string& section, const OptionText& text, Field& field);
  /// Words of `rule` may change two fields; `preset`, which is behind it, many.
  void AddRule(LoopDetectorOptions& options);

  std::vector<ConfigKey> keys_;
};

/// Takes out the cameras that ConfigTable put in, where no key has made one of them.
void DropUnsetCameras(DatasetOptions& options);

/// Section and what is out of range in it; nothing if all is usable.
std::optional<std::pair<std::string, std::string>> FirstProblem(const RunConfig& config);

/// "; did you mean 'NEAREST'?"; empty if nothing is valid.
std::string NearestHint(const std::string& word, const std::vector<std::string>& valid);

}  // namespace tutti
