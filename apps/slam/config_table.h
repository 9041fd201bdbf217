// The table that binds the keys of the YAML file to the fields of the option structs.
#pragma once

#include <yaml-cpp/yaml.h>

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tutti/slam/config.h"

namespace tutti {

/// One key: how to read it into its field and how to print the field.
struct ConfigKey {
  std::string section, name, doc;                      ///< a section within another: "loops.extraction"
  std::function<std::string(const YAML::Node&)> read;  ///< empty, or what is wrong with the value
  std::function<std::string()> show;                   ///< the present value as YAML
  bool advanced = true;                                ///< few users ever set it
};

/// Names of an enumeration's values.
template <typename Enum>
using EnumNames = std::vector<std::pair<std::string, Enum>>;

/// Keys of all sections, bound to one RunConfig that must outlive the table. A camera is put in where it has
/// none, to bind to.
class ConfigTable {
 public:
  explicit ConfigTable(RunConfig& config);

  const std::vector<ConfigKey>& keys() const { return keys_; }
  /// The key, or nullptr.
  const ConfigKey* Find(const std::string& section, const std::string& name) const;
  bool HasSection(const std::string& section) const;
  std::vector<std::string> Sections() const;
  std::vector<std::string> TopSections() const;  ///< without those within another
  std::vector<std::string> Names(const std::string& section) const;

 private:
  void AddDataset(DatasetOptions& options);
  void AddCamera(DatasetOptions& options);
  void AddOdometry(OdometryOptions& options);
  void AddLoops(LoopDetectorOptions& options);
  void AddExtraction(ExtractionOptions& options);
  void AddEvidence(EvidenceOptions& options);
  void AddVocabulary(VocabularyOptions& options);
  void AddVerification(VerificationOptions& options);
  void AddDnn(DnnOptions& options);
  void AddGraph(PoseGraphOptions& options);
  void AddRun(SlamOptions& options);

  /// The key that is added next is one that users set.
  ConfigTable& Basic() {
    basic_ = true;
    return *this;
  }
  void Add(const char* name, bool& field, const char* doc);
  void Add(const char* name, int& field, const char* doc);
  void Add(const char* name, std::uint64_t& field, const char* doc);
  void Add(const char* name, double& field, const char* doc);
  void Add(const char* name, std::string& field, const char* doc);
  void Add(const char* name, std::vector<std::string>& field, const char* doc);
  void Add(const char* name, std::array<double, 5>& field, const char* doc);  // fewer: the rest is 0
  void Add(const char* name, std::array<double, 3>& field, const char* doc);
  template <typename Enum>
  void AddEnum(const char* name, Enum& field, EnumNames<Enum> names, const char* doc);
  void Push(const char* name, const char* doc, std::function<std::string(const YAML::Node&)> read,
            std::function<std::string()> show);

  std::string section_;  // of the keys that are being added
  bool basic_ = false;   // the next one
  std::vector<ConfigKey> keys_;
};

}  // namespace tutti
