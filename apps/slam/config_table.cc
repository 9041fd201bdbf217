// How each type of value is read, strictly, and shown.
#include "apps/slam/config_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "tutti/core/text.h"

namespace tutti {
namespace {

std::string Text(const YAML::Node& node) { return node.IsScalar() ? node.Scalar() : std::string(); }

std::string Wrong(const YAML::Node& node, const std::string& wanted) {
  if (!node.IsScalar()) return "needs " + wanted;
  return "'" + node.Scalar() + "' is not " + wanted;
}

// The shortest text that reads back to the same number.
std::string ShowDouble(double value) {
  char text[40];
  for (int digits = 1; digits <= 17; ++digits) {
    std::snprintf(text, sizeof text, "%.*g", digits, value);
    if (ParseDouble(text) == value) break;
  }
  return text;
}

// A list of at most N numbers; the rest is 0. Empty, or what is wrong.
template <std::size_t N>
std::string ReadNumbers(const YAML::Node& list, std::array<double, N>& field) {
  std::array<double, N> values{};
  std::size_t i = 0;
  for (const YAML::Node& item : list) {
    const auto value = ParseDouble(Text(item));
    if (!value || !std::isfinite(*value)) return Wrong(item, "a finite number");
    values[i++] = *value;
  }
  field = values;
  return "";
}

template <std::size_t N>
std::string ShowNumbers(const std::array<double, N>& field) {
  std::string text = "[";
  for (const double value : field) text += (text.size() > 1 ? ", " : "") + ShowDouble(value);
  return text + "]";
}

}  // namespace

const ConfigKey* ConfigTable::Find(const std::string& section, const std::string& name) const {
  for (const ConfigKey& key : keys_) {
    if (key.section == section && key.name == name) return &key;
  }
  return nullptr;
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

void ConfigTable::Push(const char* name, const char* doc, std::function<std::string(const YAML::Node&)> read,
                       std::function<std::string()> show) {
  keys_.push_back({section_, name, doc, std::move(read), std::move(show), !std::exchange(basic_, false)});
}

void ConfigTable::Add(const char* name, bool& field, const char* doc) {
  Push(
      name, doc,
      [&field](const YAML::Node& node) -> std::string {
        const std::string text = Text(node);
        if (text != "true" && text != "false") return Wrong(node, "true or false");
        field = text == "true";
        return "";
      },
      [&field] { return std::string(field ? "true" : "false"); });
}

void ConfigTable::Add(const char* name, int& field, const char* doc) {
  Push(
      name, doc,
      [&field](const YAML::Node& node) -> std::string {
        const auto value = ParseInteger(Text(node));
        if (!value || *value < -2147483647LL || *value > 2147483647LL) return Wrong(node, "a whole number");
        field = static_cast<int>(*value);
        return "";
      },
      [&field] { return std::to_string(field); });
}

void ConfigTable::Add(const char* name, std::uint64_t& field, const char* doc) {
  Push(
      name, doc,
      [&field](const YAML::Node& node) -> std::string {
        const auto value = ParseInteger(Text(node));
        if (!value || *value < 0) return Wrong(node, "a whole number that is not negative");
        field = static_cast<std::uint64_t>(*value);
        return "";
      },
      [&field] { return std::to_string(field); });
}

void ConfigTable::Add(const char* name, double& field, const char* doc) {
  Push(
      name, doc,
      [&field](const YAML::Node& node) -> std::string {
        const auto value = ParseDouble(Text(node));
        if (!value || !std::isfinite(*value)) return Wrong(node, "a finite number");
        field = *value;
        return "";
      },
      [&field] { return ShowDouble(field); });
}

void ConfigTable::Add(const char* name, std::string& field, const char* doc) {
  Push(
      name, doc,
      [&field](const YAML::Node& node) -> std::string {
        if (!node.IsScalar()) return "needs a text";
        field = node.Scalar();
        return "";
      },
      [&field] { return "\"" + field + "\""; });
}

void ConfigTable::Add(const char* name, std::vector<std::string>& field, const char* doc) {
  Push(
      name, doc,
      [&field](const YAML::Node& node) -> std::string {
        if (!node.IsSequence()) return "needs a list, as in [a, b]";
        std::vector<std::string> values;
        for (const YAML::Node& item : node) {
          if (!item.IsScalar()) return "needs a list of words";
          values.push_back(item.Scalar());
        }
        field = std::move(values);
        return "";
      },
      [&field] {
        std::string text = "[";
        for (const std::string& item : field) text += (text.size() > 1 ? ", " : "") + item;
        return text + "]";
      });
}

void ConfigTable::Add(const char* name, std::array<double, 5>& field, const char* doc) {
  Push(
      name, doc,
      [&field](const YAML::Node& node) -> std::string {
        if (!node.IsSequence() || node.size() > 5) return "needs a list of up to 5 numbers";
        return ReadNumbers(node, field);
      },
      [&field] { return ShowNumbers(field); });
}

void ConfigTable::Add(const char* name, std::array<double, 3>& field, const char* doc) {
  Push(
      name, doc,
      [&field](const YAML::Node& node) -> std::string {
        if (!node.IsSequence() || node.size() != 3) return "needs a list of 3 numbers, as in [1, 2, 3]";
        return ReadNumbers(node, field);
      },
      [&field] { return ShowNumbers(field); });
}

}  // namespace tutti
